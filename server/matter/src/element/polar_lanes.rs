//! Rotations of eight or sixteen deformation gradients at once, for the ordinary case det F > 0.

use super::Vector;

/// A 3×3 matrix in every lane, row by row.
pub type Mat3<V> = [V; 9];

/// Below det F / (‖F‖/√3)³ = 0.01 a lane is inverted, flat or needle-like, and Newton's inverse loses digits.
/// The caller then uses the guarded rotation. The same holds where ‖F‖² leaves the range of single precision.
const WELL_CONDITIONED: f32 = 0.01;
/// Above this det F / (‖F‖/√3)³ no stretch is further than 0.18 from 1, and the error e ← e²/2(1+e)
/// of three plain iterations is below 2e-8.
const NEARLY_RIGID: f32 = 0.95;
/// Above this the stretches are within 0.6 … 1.5 and four plain iterations reach 1e-8.
const MODERATE: f32 = 0.75;
/// Lanes of one batch.
const BATCH: u16 = 0xFF;

/// Polar rotations by Newton's iteration X ← ½(ζX + X⁻ᵀ/ζ), and one bit per lane that is set if its rotation
/// can be trusted.
///
/// ζ = √(‖X⁻¹‖/‖X‖) (Frobenius) for the first two of five iterations. Batches whose lanes are all stretched
/// little, as det F shows, take three or four iterations with ζ = 1. The error against the SVD is 3e-7.
///
/// # Source
/// Higham 1986, "Computing the polar decomposition, with applications".
#[inline(always)]
pub fn polar_newton<V: Vector>(F: &Mat3<V>) -> (Mat3<V>, u16) {
    // Scaling F leaves the rotation unchanged, and keeps the cubes and squares below in range.
    let shrink = (norm_squared(F) * V::splat(1.0 / 3.0)).sqrt().recip();
    let mut X = *F;
    for i in 0..9 {
        X[i] = X[i] * shrink;
    }
    let C = cofactor(&X);
    let det = determinant(&X, &C);
    let trusted = det.above(WELL_CONDITIONED);
    let (moderate, rigid) = (det.above(MODERATE), det.above(NEARLY_RIGID));
    // Every batch has the iterations that it would have alone, and so the same bits.
    let (first, second) = (Stretch::of(moderate, rigid), Stretch::of(moderate >> 8, rigid >> 8));
    let mut R = iterated(&X, &C, det, first);
    if V::ALL > BATCH && second != first {
        let other = iterated(&X, &C, det, second);
        for i in 0..9 {
            R[i] = R[i].with_second(other[i]);
        }
    }
    (R, trusted)
}

/// How much the lanes of a batch are stretched at most.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Stretch {
    /// Nearly not.
    Little,
    Moderate,
    Much,
}

impl Stretch {
    /// That of the batch in the lower bits, one for each lane of these grades.
    #[inline(always)]
    fn of(moderate: u16, rigid: u16) -> Self {
        match (moderate & BATCH == BATCH, rigid & BATCH == BATCH) {
            (true, true) => Self::Little,
            (true, false) => Self::Moderate,
            (false, _) => Self::Much,
        }
    }
}

/// The rotation after as many iterations as the stretch needs.
#[inline(always)]
fn iterated<V: Vector>(X: &Mat3<V>, C: &Mat3<V>, det: V, stretch: Stretch) -> Mat3<V> {
    let (mut X, C) = (*X, *C);
    let mut left = if stretch == Stretch::Much {
        X = scaled_iteration(&X, &C, det);
        let C = cofactor(&X);
        X = scaled_iteration(&X, &C, determinant(&X, &C));
        3
    } else {
        X = plain_iteration(&X, &C, det);
        if stretch == Stretch::Little { 2 } else { 3 }
    };
    while left > 0 {
        let C = cofactor(&X);
        X = plain_iteration(&X, &C, determinant(&X, &C));
        left -= 1;
    }
    X
}

/// ½ (X + X⁻ᵀ), X⁻ᵀ = C / det.
#[inline(always)]
fn plain_iteration<V: Vector>(X: &Mat3<V>, C: &Mat3<V>, det: V) -> Mat3<V> {
    let half = V::splat(0.5);
    combination(X, half, C, half * det.recip())
}

/// ½ (ζ X + X⁻ᵀ/ζ).
#[inline(always)]
fn scaled_iteration<V: Vector>(X: &Mat3<V>, C: &Mat3<V>, det: V) -> Mat3<V> {
    let half = V::splat(0.5);
    let zeta_squared = (norm_squared(C) * (norm_squared(X) * det * det).recip()).sqrt();
    let zeta = zeta_squared.sqrt();
    combination(X, half * zeta, C, half * (zeta * det).recip())
}

#[inline(always)]
fn combination<V: Vector>(X: &Mat3<V>, keep: V, C: &Mat3<V>, add: V) -> Mat3<V> {
    let mut next = *X;
    for i in 0..9 {
        next[i] = X[i].mul_add(keep, C[i] * add);
    }
    next
}

#[inline(always)]
fn determinant<V: Vector>(X: &Mat3<V>, C: &Mat3<V>) -> V {
    X[0].mul_add(C[0], X[1].mul_add(C[1], X[2] * C[2]))
}

#[inline(always)]
fn norm_squared<V: Vector>(X: &Mat3<V>) -> V {
    let mut sum = X[0] * X[0];
    for x in &X[1..] {
        sum = x.mul_add(*x, sum);
    }
    sum
}

/// det(X) X⁻ᵀ: rows are cross products of the other two rows.
#[inline(always)]
fn cofactor<V: Vector>(X: &Mat3<V>) -> Mat3<V> {
    [
        minor(X, 4, 8, 5, 7),
        minor(X, 5, 6, 3, 8),
        minor(X, 3, 7, 4, 6),
        minor(X, 2, 7, 1, 8),
        minor(X, 0, 8, 2, 6),
        minor(X, 1, 6, 0, 7),
        minor(X, 1, 5, 2, 4),
        minor(X, 2, 3, 0, 5),
        minor(X, 0, 4, 1, 3),
    ]
}

#[inline(always)]
fn minor<V: Vector>(X: &Mat3<V>, a: usize, b: usize, c: usize, d: usize) -> V {
    X[a].mul_add(X[b], -(X[c] * X[d]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::element::{LANES, Lanes, polar_rotation};
    use nalgebra::{Matrix3, Rotation3, Vector3};

    /// Polar rotation by the singular value decomposition in double precision, for det F > 0.
    fn polar_svd(F: &Matrix3<f64>) -> Matrix3<f64> {
        let svd = F.svd(true, true);
        svd.u.zip(svd.v_t).map_or_else(Matrix3::identity, |(U, V_t)| U * V_t)
    }

    /// Largest deviation from the SVD over many gradients with stretches within `low`…`high`, and how
    /// many lanes of how many were trusted.
    fn worst(low: f64, high: f64) -> (f64, u32, u32) {
        let (mut worst, mut trusted_lanes, mut all) = (0.0_f64, 0, 0);
        for s in 0..300 {
            let mut lanes = [Lanes::default(); 9];
            let mut gradients = [Matrix3::zeros(); LANES];
            for (lane, gradient) in gradients.iter_mut().enumerate() {
                let t = f64::from(s * LANES as u32) + lane as f64;
                let turn = Rotation3::new(Vector3::new(t.sin(), (2.3 * t).cos(), (0.7 * t).sin()) * 3.0);
                let other = Rotation3::new(Vector3::new((1.3 * t).cos(), t.cos(), 0.5));
                let between = |a: f64| low + (high - low) * (0.5 + 0.5 * a.sin());
                let stretch = Vector3::new(between(5.0 * t), between(3.1 * t), between(1.7 * t + 1.0));
                let F = turn * other.inverse() * Matrix3::from_diagonal(&stretch) * other.matrix();
                *gradient = (F / [1e12, 1.0, 1e-12][s as usize % 3]).map(|f| f64::from(f as f32));
                for i in 0..9 {
                    lanes[i].0[lane] = gradient[(i / 3, i % 3)] as f32;
                }
            }
            let (R, trusted) = polar_newton(&lanes);
            for (lane, F) in gradients.iter().enumerate() {
                all += 1;
                if trusted >> lane & 1 == 1 {
                    trusted_lanes += 1;
                    let exact = polar_svd(F);
                    for i in 0..9 {
                        worst = worst.max((f64::from(R[i].0[lane]) - exact[(i / 3, i % 3)]).abs());
                    }
                    let guarded = polar_rotation(F, &Matrix3::identity());
                    assert!((guarded - exact).norm() < 1e-9);
                }
            }
        }
        (worst, trusted_lanes, all)
    }

    #[test]
    fn agrees_with_the_singular_value_decomposition_wherever_it_is_trusted() {
        for (low, high, allowed) in
            [(0.99, 1.01, 4e-7), (0.85, 1.15, 4e-7), (0.7, 1.4, 4e-7), (0.5, 1.9, 5e-7), (0.3, 2.5, 2e-6)]
        {
            let (error, trusted, all) = worst(low, high);
            assert!(error < allowed, "stretch {low} … {high}: {error:e}");
            assert!(trusted > all * 19 / 20, "stretch {low} … {high}: {trusted} of {all}");
        }
    }

    #[test]
    fn inverted_flat_zero_and_broken_lanes_are_not_trusted() {
        let cases: [[f32; 3]; 8] = [
            [1.0, 1.0, 1.0],
            [1.0, 1.0, -1.0],
            [1.0, 1.0, 0.0],
            [0.0, 0.0, 0.0],
            [1.0, 1e-4, 1e-4],
            [f32::NAN, 1.0, 1.0],
            [f32::INFINITY, 1.0, 1.0],
            [0.3, 2.5, 1.0],
        ];
        let mut F = [Lanes::default(); 9];
        for (lane, d) in cases.iter().enumerate() {
            for i in 0..3 {
                F[4 * i].0[lane] = d[i];
            }
        }
        let (_, trusted) = polar_newton(&F);
        assert_eq!(trusted, 0b1000_0001);
    }
}
