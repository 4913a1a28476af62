//! Inverse diagonal blocks of an assembled matrix.

use nalgebra::{Matrix3, Vector3};
use scindo_matter::element::Held;

use super::constraint::Filter;
use super::real::{Real, dot};
use crate::assembly::BlockCsr;

/// M⁻¹: the inverses of the 3×3 diagonal blocks of A, 0 in the prescribed directions.
///
/// The norm √(rᵀM⁻¹r) weighs every copy by its own stiffness, so that slivers count.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
#[serde(bound(serialize = "T: Real + serde::Serialize", deserialize = "T: Real + serde::Deserialize<'de>"))]
pub struct DiagonalInverse<T> {
    inverse: Vec<Matrix3<T>>,
}

impl<T: Real> DiagonalInverse<T> {
    /// Inverts the diagonal blocks of `A`.
    pub fn update(&mut self, A: &BlockCsr<f64>, filter: &Filter) {
        self.inverse.resize(A.n_rows(), Matrix3::zeros());
        for (i, inverse) in self.inverse.iter_mut().enumerate() {
            *inverse = rounded(invert(A.diagonal(i), Held::NOT));
        }
        for &(copy, held) in filter.held() {
            let i = copy as usize;
            self.inverse[i] = rounded(invert(A.diagonal(i), held));
        }
    }

    /// Inverts `block` in place of that of copy `i`, 0 in the directions `held`.
    pub fn set(&mut self, i: usize, block: Matrix3<f64>, held: Held) {
        self.inverse[i] = rounded(invert(block, held));
    }

    /// M⁻¹ of copy `i` times `r`.
    #[inline(always)]
    pub fn times(&self, i: usize, r: &Vector3<T>) -> Vector3<T> {
        self.inverse[i] * r
    }

    /// z = M⁻¹ r.
    pub fn apply(&self, r: &[Vector3<T>], z: &mut [Vector3<T>]) {
        for ((z, r), M) in z.iter_mut().zip(r).zip(&self.inverse) {
            *z = M * r;
        }
    }

    /// √(rᵀM⁻¹r); prescribed directions do not count.
    pub fn norm(&self, r: &[Vector3<T>]) -> f64 {
        root(r.iter().zip(&self.inverse).map(|(r, M)| dot(r, &(M * r))).sum())
    }
}

/// Rounds the matrix to the precision of the iteration. A block that overflows becomes 0: so light a copy
/// does not move.
fn rounded<T: Real>(M: Matrix3<f64>) -> Matrix3<T> {
    let rounded = M.map(T::of);
    if rounded.iter().all(|m| m.wide().is_finite()) { rounded } else { Matrix3::zeros() }
}

/// √s of a sum that only rounding can make negative; NaN stays NaN.
pub(super) fn root(s: f64) -> f64 {
    if s < 0.0 { 0.0 } else { s.sqrt() }
}

/// Inverse of the free part of a symmetric block, scaled by its size so that blocks of any size keep
/// their digits. A block that is not positive definite is replaced by its size times the identity:
/// M must be positive definite whatever A is. A block of zeros, or of nonsense, gives 0.
fn invert(mut block: Matrix3<f64>, held: Held) -> Matrix3<f64> {
    let size = block.amax();
    if !(size > f64::MIN_POSITIVE && size.is_finite()) {
        return Matrix3::zeros();
    }
    block /= size;
    match held {
        Held::Axes(axes) => (0..3).filter(|&k| axes[k]).for_each(|k| {
            block.row_mut(k).fill(0.0);
            block.column_mut(k).fill(0.0);
            block[(k, k)] = 1.0;
        }),
        _ => block = held.filter_block(&block, 1.0),
    }
    let mut inverse = match block.cholesky() {
        Some(factor) if factor.l_dirty().diagonal().min() > 1e-8 => factor.inverse() / size,
        _ => Matrix3::identity() / size,
    };
    match held {
        Held::Axes(axes) => (0..3).filter(|&k| axes[k]).for_each(|k| {
            inverse.row_mut(k).fill(0.0);
            inverse.column_mut(k).fill(0.0);
        }),
        _ => inverse = held.filter_block(&inverse, 0.0),
    }
    inverse
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inverts_the_free_part_of_blocks_of_any_size() {
        let A = Matrix3::new(4.0, 1.0, 0.5, 1.0, 3.0, -0.2, 0.5, -0.2, 5.0);
        for size in [1e-200, 1e-20, 1.0, 1e20] {
            assert!((invert(A * size, Held::NOT) * size * A - Matrix3::identity()).norm() < 1e-12);
            let part = invert(A * size, Held::Axes([false, true, false])) * size;
            assert_eq!(part.row(1).amax(), 0.0);
            assert!((part[(0, 0)] * (4.0 - 0.05) - 1.0).abs() < 1e-12, "{part}");
        }
    }

    #[test]
    fn is_positive_whatever_the_block() {
        let indefinite = invert(Matrix3::from_diagonal(&Vector3::new(1.0, -2.0, 1.0)), Held::NOT);
        assert_eq!(indefinite, Matrix3::identity() / 2.0);
        for nothing in [0.0, f64::NAN, f64::INFINITY] {
            assert_eq!(invert(Matrix3::repeat(nothing), Held::NOT), Matrix3::zeros());
        }
    }
}
