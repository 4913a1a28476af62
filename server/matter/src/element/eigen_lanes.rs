//! Eigenvalues and eigenvectors of eight or sixteen symmetric 3×3 matrices at once.

use super::Vector;

/// Sweeps over the three entries above the diagonal. Convergence is quadratic: after four, the largest entry that is
/// left is rounding.
const SWEEPS: usize = 4;
/// Keeps quotients finite where both parts are 0. Its square must not underflow.
const TINY: f32 = 1e-18;

/// Eigenvalues of the matrices (xx, xy, xz, yy, yz, zz), in no order, and an orthonormal eigenvector of each, by
/// Jacobi's method. Entries are to lie between 1e-10 and 1e10 or to be 0.
///
/// # Source
/// Golub, Van Loan 2013, "Matrix Computations", §8.5.
#[inline(always)]
pub fn symmetric_eigen<V: Vector>(A: &[V; 6]) -> ([V; 3], [[V; 3]; 3]) {
    let (zero, one) = (V::splat(0.0), V::splat(1.0));
    let mut values = [A[0], A[3], A[5]];
    // Entry k lies in the row and column of the two other axes.
    let mut off = [A[4], A[2], A[1]];
    let mut vectors = [[one, zero, zero], [zero, one, zero], [zero, zero, one]];
    for _ in 0..SWEEPS {
        for k in 0..3 {
            let (p, q) = ((k + 1) % 3, (k + 2) % 3);
            let (c, s, t) = rotation(values[p], values[q], off[k]);
            values[p] = values[p] - t * off[k];
            values[q] = t.mul_add(off[k], values[q]);
            off[k] = zero;
            // The entries beside it: (k, p) is number q, and (k, q) number p.
            let (kp, kq) = (off[q], off[p]);
            off[q] = c.mul_add(kp, -(s * kq));
            off[p] = s.mul_add(kp, c * kq);
            for i in 0..3 {
                let (vp, vq) = (vectors[p][i], vectors[q][i]);
                vectors[p][i] = c.mul_add(vp, -(s * vq));
                vectors[q][i] = s.mul_add(vp, c * vq);
            }
        }
    }
    (values, vectors)
}

/// Cosine, sine and tangent of the angle, at most 45°, that takes the entry `pq` to 0.
#[inline(always)]
fn rotation<V: Vector>(pp: V, qq: V, pq: V) -> (V, V, V) {
    let (one, twice) = (V::splat(1.0), pq + pq);
    let d = qq - pp + V::splat(TINY);
    let size = d.max(-d).max(V::splat(TINY));
    let radius = d.mul_add(d, twice * twice).sqrt();
    let sign = d * size.recip();
    let t = sign * twice * (size + radius).recip();
    let c = t.mul_add(t, one).sqrt().recip();
    (c, t * c, t)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::element::{LANES, Lanes};
    use fastrand::Rng;
    use nalgebra::{Matrix3, SymmetricEigen};

    /// Largest error of values and of A = Σ λ v vᵀ relative to the matrix, and of orthogonality, over `matrices`.
    fn worst(matrices: &[Matrix3<f64>; LANES]) -> [f64; 3] {
        let entries = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];
        let lanes = entries.map(|at| Lanes(matrices.map(|A| A[at] as f32)));
        let (values, vectors) = symmetric_eigen(&lanes);
        let mut worst = [0.0_f64; 3];
        for (lane, A) in matrices.iter().enumerate() {
            let A = A.map(|a| f64::from(a as f32));
            let v = Matrix3::from_fn(|i, k| f64::from(vectors[k][i].0[lane]));
            let d = nalgebra::Vector3::from_fn(|k, _| f64::from(values[k].0[lane]));
            let size = A.norm().max(1e-30);
            let mut found: Vec<f64> = d.iter().copied().collect();
            let mut exact: Vec<f64> = SymmetricEigen::new(A).eigenvalues.iter().copied().collect();
            found.sort_by(f64::total_cmp);
            exact.sort_by(f64::total_cmp);
            let apart = found.iter().zip(&exact).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            worst[0] = worst[0].max(apart / size);
            worst[1] = worst[1].max((v * Matrix3::from_diagonal(&d) * v.transpose() - A).norm() / size);
            worst[2] = worst[2].max((v.transpose() * v - Matrix3::identity()).norm());
        }
        worst
    }

    #[test]
    fn agrees_with_double_precision() {
        let mut random = Rng::with_seed(4);
        let mut entry = || 2.0 * random.f64() - 1.0;
        for round in 0..400 {
            let size = [1.0, 1e-6, 1e6, 1.0][round % 4];
            let matrices = [(); LANES].map(|()| {
                let A = Matrix3::from_fn(|_, _| entry());
                let symmetric = A + A.transpose();
                // Close to a multiple of I, as strains are.
                if round % 4 == 3 { Matrix3::identity() + 1e-4 * symmetric } else { size * symmetric }
            });
            let worst = worst(&matrices);
            assert!(worst.iter().all(|error| *error < 2e-6), "{round}: {worst:?}");
        }
    }

    #[test]
    fn equal_values_and_zeros_have_an_orthonormal_frame() {
        let of = |d: [f64; 6]| Matrix3::new(d[0], d[1], d[2], d[1], d[3], d[4], d[2], d[4], d[5]);
        let matrices = [
            of([0.0; 6]),
            of([1.0, 0.0, 0.0, 1.0, 0.0, 1.0]),
            of([1.0, 0.0, 0.0, 1.0, 0.0, 3.0]),
            of([1.0, 1.0, 1.0, 1.0, 1.0, 1.0]),
            of([0.0, 1.0, 0.0, 0.0, 0.0, 0.0]),
            of([1.0, 1e-7, 0.0, 1.0, 1e-7, 1.0]),
            of([0.0, 1.0, 1.0, 0.0, 1.0, 0.0]),
            of([1e6, 1.0, 1e-6, 1.0, 0.0, 0.0]),
        ];
        let worst = worst(&matrices);
        assert!(worst.iter().all(|error| *error < 2e-6), "{worst:?}");
    }
}
