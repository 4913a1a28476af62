//! Singular values with a sign: F = U diag(σ) Vᵀ with two rotations, for every F.
//!
//! # Source
//! One-sided Jacobi: Hestenes 1958, "Inversion of matrices by biorthogonalization"; the convention
//! of signs: Irving, Teran, Fedkiw 2004, "Invertible finite elements for robust simulation of large
//! deformation", §3.

use nalgebra::{Matrix3, Vector3};

/// Most sweeps over the three pairs of columns. Convergence is quadratic: five reach round-off.
const SWEEPS: usize = 12;

/// Cosine of the angle between two columns below which they count as orthogonal. It is of the order of
/// rounding.
const ORTHOGONAL: f64 = 4e-16;

/// F = U diag(σ) Vᵀ with det U = det V = +1.
///
/// σ1 ≥ σ2 ≥ |σ3|. Only the smallest may be negative, and it is negative exactly when det F < 0. Columns that
/// F leaves undetermined (rank ≤ 1) are completed so that U Vᵀ rotates as little as possible; F = 0 gives I.
#[derive(Clone, Copy, Debug)]
pub struct SignedSvd {
    /// Principal directions in space, one per column.
    pub U: Matrix3<f64>,
    /// Principal stretches σ [1].
    pub sigma: Vector3<f64>,
    /// Principal directions in the material, one per column.
    pub V: Matrix3<f64>,
}

impl SignedSvd {
    /// Decomposes `F`. A non-finite `F` gives non-finite stretches, and the identity for U and V.
    pub fn new(F: &Matrix3<f64>) -> Self {
        let size = F.amax();
        if !(size > 0.0 && size.is_finite()) {
            let sigma = Vector3::repeat(if size == 0.0 { 0.0 } else { f64::NAN });
            return Self { U: Matrix3::identity(), sigma, V: Matrix3::identity() };
        }
        let (mut B, mut V) = (F / size, Matrix3::identity());
        for _ in 0..SWEEPS {
            let turned = [(0, 1), (0, 2), (1, 2)].map(|(p, q)| orthogonalise(&mut B, &mut V, p, q));
            if turned == [false; 3] {
                break;
            }
        }
        sort_columns(&mut B, &mut V);
        let columns = [B.column(0).into_owned(), B.column(1).into_owned(), B.column(2).into_owned()];
        let first = columns[0].norm();
        let u0: Vector3<f64> = columns[0] / first;
        let mut rest = columns[1] - u0 * u0.dot(&columns[1]);
        rest -= u0 * u0.dot(&rest);
        let second = rest.norm();
        let u1 = if second > 1e-290 {
            rest / second
        } else {
            least_turn(&V.column(0).into(), &u0, &V.column(1).into())
        };
        let u2 = u0.cross(&u1);
        let sigma = size * Vector3::new(first, columns[1].dot(&u1), columns[2].dot(&u2));
        Self { U: Matrix3::from_columns(&[u0, u1, u2]), sigma, V }
    }

    /// The rotation R = U Vᵀ that maximises tr(RᵀF).
    pub fn rotation(&self) -> Matrix3<f64> {
        self.U * self.V.transpose()
    }

    /// U diag(`values`) Vᵀ.
    pub fn compose(&self, values: &Vector3<f64>) -> Matrix3<f64> {
        self.U * Matrix3::from_diagonal(values) * self.V.transpose()
    }
}

/// Rotates columns `p` and `q` of `B`, and of `V` with them, until they are orthogonal. Returns whether they
/// were not orthogonal before.
fn orthogonalise(B: &mut Matrix3<f64>, V: &mut Matrix3<f64>, p: usize, q: usize) -> bool {
    let (a, b) = (B.column(p).norm_squared(), B.column(q).norm_squared());
    let c = B.column(p).dot(&B.column(q));
    if c * c <= ORTHOGONAL * ORTHOGONAL * a * b {
        return false;
    }
    let zeta = (b - a) / (2.0 * c);
    let t = zeta.signum() / (zeta.abs() + (1.0 + zeta * zeta).sqrt());
    let cosine = 1.0 / (1.0 + t * t).sqrt();
    for matrix in [B, V] {
        let (x, y) = (matrix.column(p).into_owned(), matrix.column(q).into_owned());
        matrix.set_column(p, &(cosine * (x - t * y)));
        matrix.set_column(q, &(cosine * (t * x + y)));
    }
    true
}

/// Sorts the columns of `B` by falling length. Every exchange changes one sign, so `V` stays a rotation.
fn sort_columns(B: &mut Matrix3<f64>, V: &mut Matrix3<f64>) {
    for (p, q) in [(0, 1), (1, 2), (0, 1)] {
        if B.column(p).norm_squared() < B.column(q).norm_squared() {
            for matrix in [&mut *B, &mut *V] {
                let first = -matrix.column(p).into_owned();
                let second = matrix.column(q).into_owned();
                matrix.set_column(p, &second);
                matrix.set_column(q, &first);
            }
        }
    }
}

/// Applies to `w` the smallest rotation that takes unit vector `from` to `to`.
fn least_turn(from: &Vector3<f64>, to: &Vector3<f64>, w: &Vector3<f64>) -> Vector3<f64> {
    let axis = from.cross(to);
    let cosine = from.dot(to);
    if cosine > -0.999_999 {
        let turned = w + axis.cross(w) + axis.cross(&axis.cross(w)) / (1.0 + cosine);
        (turned - to * to.dot(&turned)).normalize()
    } else {
        // A half turn about `w` itself, which is orthogonal to `from`.
        (w - to * to.dot(w)).normalize()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Rotation3;
    use proptest::prelude::*;

    fn assert_decomposed(F: &Matrix3<f64>) {
        let svd = SignedSvd::new(F);
        let SignedSvd { U, sigma, V } = svd;
        for rotation in [U, V] {
            assert!((rotation.transpose() * rotation - Matrix3::identity()).norm() < 1e-13, "{F} {rotation}");
            assert!(rotation.determinant() > 0.0, "{F} {rotation}");
        }
        assert!((svd.compose(&sigma) - F).norm() <= 1e-14 * F.norm(), "{F} {sigma}");
        assert!(sigma[0] >= sigma[1] - 1e-15 * sigma[0], "{sigma}");
        assert!(sigma[1] >= sigma[2].abs() - 1e-15 * sigma[0], "{sigma}");
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]

        #[test]
        fn composes_to_any_matrix(f in prop::array::uniform9(-2.0..2.0f64), exponent in -200..200i32) {
            assert_decomposed(&(Matrix3::from_row_slice(&f) * 10f64.powi(exponent)));
        }

        #[test]
        fn agrees_with_the_polar_rotation(f in prop::array::uniform9(-2.0..2.0f64)) {
            let F = Matrix3::from_row_slice(&f);
            let R = SignedSvd::new(&F).rotation();
            let newton = crate::element::polar_rotation(&F, &Matrix3::identity());
            assert!((R.dot(&F) - newton.dot(&F)).abs() < 1e-12 * F.norm());
        }

        #[test]
        fn repeated_and_vanishing_stretches(
            a in prop::array::uniform3(-3.0..3.0f64),
            b in prop::array::uniform3(-3.0..3.0f64),
            which in prop::array::uniform3(0..6usize),
        ) {
            let (A, B) = (Rotation3::new(Vector3::from(a)), Rotation3::new(Vector3::from(b)));
            let values = [0.0, 1e-12, -1e-12, 1.0, 1.0 + 1e-12, -1.0];
            let sigma = Vector3::from(which.map(|w| values[w]));
            assert_decomposed(&(A.matrix() * Matrix3::from_diagonal(&sigma) * B.matrix()));
        }
    }

    #[test]
    fn the_smallest_stretch_carries_the_sign() {
        let sigma = SignedSvd::new(&Matrix3::from_diagonal(&Vector3::new(-3.0, 2.0, 0.5))).sigma;
        assert!((sigma - Vector3::new(3.0, 2.0, -0.5)).norm() < 1e-15);
        let sigma = SignedSvd::new(&-Matrix3::identity()).sigma;
        assert!((sigma - Vector3::new(1.0, 1.0, -1.0)).norm() < 1e-15);
    }

    #[test]
    fn open_directions_turn_least() {
        assert_eq!(SignedSvd::new(&Matrix3::zeros()).rotation(), Matrix3::identity());
        let line = Matrix3::from_diagonal(&Vector3::new(0.7, 0.0, 0.0));
        assert!((SignedSvd::new(&line).rotation() - Matrix3::identity()).norm() < 1e-14);
        let turned = Rotation3::new(Vector3::new(0.0, 0.0, 0.5)).into_inner();
        assert!((SignedSvd::new(&(turned * line)).rotation() - turned).norm() < 1e-14);
        assert_decomposed(&-line);
    }

    #[test]
    fn non_finite_stays_non_finite() {
        assert!(SignedSvd::new(&Matrix3::from_element(f64::NAN)).sigma[0].is_nan());
        assert!(SignedSvd::new(&Matrix3::from_element(f64::INFINITY)).sigma[0].is_nan());
    }
}
