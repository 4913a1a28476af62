//! Rotations of eight deformation gradients at once, for the ordinary case det F > 0.

use super::{LANES, Vector8};

/// A 3×3 matrix in every lane, row by row.
pub type Mat3<V> = [V; 9];

/// Below det F / (‖F‖/√3)³ = 0.01 a lane is inverted, flat or needle-like, and Newton's inverse
/// loses digits there: the caller takes the guarded rotation instead. So it does where ‖F‖² leaves
/// single precision.
const WELL_CONDITIONED: f32 = 0.01;
const ITERATIONS: usize = 5;
const SCALED_ITERATIONS: usize = 2;

/// Polar rotations by Newton's iteration X ← ½(ζX + X⁻ᵀ/ζ), and per lane whether it can be trusted.
///
/// ζ = √(‖X⁻¹‖/‖X‖) (Frobenius) for the first two iterations. Error against the SVD 2e-7.
///
/// # Source
/// Higham 1986, "Computing the polar decomposition, with applications".
#[inline(always)]
pub fn polar_newton<V: Vector8>(F: &Mat3<V>) -> (Mat3<V>, [bool; LANES]) {
    // Size does not matter to the rotation, but it would to the cubes and squares below.
    let size = (norm_squared(F) * V::splat(1.0 / 3.0)).sqrt();
    let mut X = F.map(|x| x * size.recip());
    let mut trusted = [true; LANES];
    for k in 0..ITERATIONS {
        let C = cofactor(&X);
        let det = X[0].mul_add(C[0], X[1].mul_add(C[1], X[2] * C[2]));
        if k == 0 {
            let det = det.store();
            trusted = std::array::from_fn(|lane| det.0[lane] > WELL_CONDITIONED);
        }
        // X⁻ᵀ = C / det
        let (keep, add) = if k < SCALED_ITERATIONS {
            let zeta_squared = (norm_squared(&C) * (norm_squared(&X) * det * det).recip()).sqrt();
            let zeta = zeta_squared.sqrt();
            (V::splat(0.5) * zeta, V::splat(0.5) * (zeta * det).recip())
        } else {
            (V::splat(0.5), V::splat(0.5) * det.recip())
        };
        for i in 0..9 {
            X[i] = X[i].mul_add(keep, C[i] * add);
        }
    }
    (X, trusted)
}

#[inline(always)]
fn norm_squared<V: Vector8>(X: &Mat3<V>) -> V {
    let mut sum = X[0] * X[0];
    for x in &X[1..] {
        sum = x.mul_add(*x, sum);
    }
    sum
}

/// det(X) X⁻ᵀ: rows are cross products of the other two rows.
#[inline(always)]
fn cofactor<V: Vector8>(X: &Mat3<V>) -> Mat3<V> {
    let minor = |a: usize, b: usize, c: usize, d: usize| X[a].mul_add(X[b], -(X[c] * X[d]));
    [
        minor(4, 8, 5, 7),
        minor(5, 6, 3, 8),
        minor(3, 7, 4, 6),
        minor(2, 7, 1, 8),
        minor(0, 8, 2, 6),
        minor(1, 6, 0, 7),
        minor(1, 5, 2, 4),
        minor(2, 3, 0, 5),
        minor(0, 4, 1, 3),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::element::{Lanes, polar_rotation};
    use nalgebra::{Matrix3, Rotation3, Vector3};

    #[test]
    fn agrees_with_the_guarded_rotation_wherever_it_is_trusted() {
        let mut trusted_lanes = 0;
        for s in 0..400 {
            let t = f64::from(s);
            let turn = Rotation3::new(Vector3::new(t.sin(), (2.3 * t).cos(), (0.7 * t).sin()) * 3.0);
            let other = Rotation3::new(Vector3::new((1.3 * t).cos(), t.cos(), 0.5));
            let stretch = Vector3::new(
                1.4 + 1.1 * (5.0 * t).sin(),
                1.4 + 1.1 * (3.1 * t).cos(),
                0.3 + (t * 1.7).sin().abs(),
            );
            let F = turn * other.inverse() * Matrix3::from_diagonal(&stretch) * other.matrix();
            let F = F / [1e12, 1.0, 1e-12][s as usize % 3];
            let mut lanes = [Lanes::default(); 9];
            for (i, lane) in lanes.iter_mut().enumerate() {
                *lane = Lanes::splat(F[(i / 3, i % 3)] as f32);
            }
            let (R, trusted) = polar_newton(&lanes);
            let exact = polar_rotation(&F, &Matrix3::identity());
            if trusted[0] {
                trusted_lanes += 1;
                for (i, r) in R.iter().enumerate() {
                    let error = (f64::from(r.0[3]) - exact[(i / 3, i % 3)]).abs();
                    assert!(error < 2e-6, "{error:e} at {F}");
                }
            }
        }
        assert!(trusted_lanes > 350, "{trusted_lanes}");
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
        assert_eq!(trusted, [true, false, false, false, false, false, false, true]);
    }
}
