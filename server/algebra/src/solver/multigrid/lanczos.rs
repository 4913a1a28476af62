//! The largest eigenvalue of D⁻¹A from the coefficients of conjugate gradients with the preconditioner D⁻¹.
//!
//! They are those of the Lanczos process: with the steps α and the factors β of the directions, the eigenvalues of a
//! tridiagonal matrix are Ritz values, which approach the outermost eigenvalues from inside. A dozen iterations find
//! what power iterations need a hundred for.
//!
//! # Source
//! Saad, *Iterative Methods for Sparse Linear Systems*, §6.7.3.

/// A residual whose zᵀr is below this part of the first one is rounding: the directions span all that A acts on.
const ROUNDING: f64 = 1e-10;

/// The largest Ritz value after so many iterations, from below the largest eigenvalue; 0 if A takes the first direction
/// to 0.
///
/// `iterate` is given α and the zᵀr of the iteration before, both 0 at first, and does r ← r − αq, z = D⁻¹r,
/// p ← z + βp with β the [`factor`] of both, and q = Ap. It returns zᵀr and pᵀq.
pub(super) fn largest_ritz_value(iterations: usize, mut iterate: impl FnMut(f32, f64) -> [f64; 2]) -> f64 {
    let mut rows = Vec::with_capacity(iterations);
    let mut last = 0.0;
    let (mut alpha, mut before, mut least) = (0.0, 0.0, 0.0);
    for _ in 0..iterations {
        let [product, curvature] = iterate(alpha as f32, before);
        if !(product > least && curvature > 0.0 && curvature.is_finite()) {
            break;
        }
        if before == 0.0 {
            least = ROUNDING * product;
        }
        let beta = factor(product, before);
        let inverse = curvature / product;
        rows.push(Row { diagonal: inverse + beta * last, beside: beta * last * last });
        (alpha, before, last) = (product / curvature, product, inverse);
    }
    largest(&rows)
}

/// β: zᵀr over the one `before`; 0 at first.
pub(super) fn factor(product: f64, before: f64) -> f64 {
    if before > 0.0 { product / before } else { 0.0 }
}

/// A row of a symmetric tridiagonal matrix: its diagonal entry, and the square of the one to its left.
#[derive(Clone, Copy, Debug)]
struct Row {
    diagonal: f64,
    beside: f64,
}

/// The largest eigenvalue of a positive definite tridiagonal matrix; 0 without a row.
fn largest(rows: &[Row]) -> f64 {
    // Sturm: as many pivots of T − λ are negative as eigenvalues are below λ.
    let is_above = |lambda: f64| {
        let mut pivot = 1.0;
        rows.iter().all(|row| {
            pivot = row.diagonal - lambda - row.beside / pivot;
            pivot < 0.0
        })
    };
    let most = |entry: fn(&Row) -> f64| rows.iter().map(entry).fold(0.0, f64::max);
    let (mut low, mut high) = (0.0, most(|row| row.diagonal) + 2.0 * most(|row| row.beside).sqrt());
    while high - low > 1e-4 * high {
        let middle = 0.5 * (low + high);
        *(if is_above(middle) { &mut high } else { &mut low }) = middle;
    }
    high
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::*;

    /// The estimate for a diagonal matrix with eigenvalues 1 … n.
    fn estimate(n: usize, iterations: usize) -> f64 {
        let A = DMatrix::from_diagonal(&DVector::from_fn(n, |i, _| 1.0 + i as f64));
        let mut r = DVector::from_fn(n, |i, _| 1.0 + 0.5 * (7.0 * i as f64).sin());
        let (mut p, mut q) = (r.clone(), DVector::zeros(n));
        largest_ritz_value(iterations, |alpha, before| {
            r -= &q * f64::from(alpha);
            let product = r.norm_squared();
            p = &r + factor(product, before) * &p;
            q = &A * &p;
            [product, p.dot(&q)]
        })
    }

    #[test]
    fn the_largest_eigenvalue_is_found_from_below() {
        // As many iterations as eigenvalues find it.
        assert!((estimate(8, 8) - 8.0).abs() < 2e-3);
        let found = estimate(500, 15);
        assert!(found <= 500.0 * (1.0 + 1e-4) && found > 0.97 * 500.0, "{found}");
    }

    #[test]
    fn nothing_and_one_direction_end_well() {
        assert_eq!(largest_ritz_value(9, |_, _| [0.0, 0.0]), 0.0);
        assert_eq!(largest_ritz_value(9, |_, _| [1.0, f64::NAN]), 0.0);
        // One direction: its Rayleigh quotient.
        let found = largest_ritz_value(9, |_, before| if before > 0.0 { [0.0, 0.0] } else { [2.0, 3.0] });
        assert!((found - 1.5).abs() < 1e-3);
    }
}
