//! The largest frequency of a small generalised eigenproblem.

use nalgebra::DMatrix;

use super::error::EnrichmentError;

/// A pivot of the scaled mass matrix below this is round-off.
const SMALLEST_PIVOT: f64 = 1e-13;

/// ω_max [rad/s] with K q = ω² M q, for symmetric positive semidefinite K [N/m] and positive definite M [kg].
/// It uses dense matrices and is meant for single elements.
///
/// M is scaled to a unit diagonal, S M S = L Lᵀ with S = diag(M)^−½, so that masses many orders of magnitude
/// apart do no harm. Then ω² are the eigenvalues of L⁻¹ S K S L⁻ᵀ.
pub(super) fn largest_frequency(K: &DMatrix<f64>, M: &DMatrix<f64>) -> Result<f64, EnrichmentError> {
    let n = M.nrows();
    let mut scale = Vec::with_capacity(n);
    for i in 0..n {
        let m = M[(i, i)];
        if !(m > 0.0 && m.is_finite()) {
            return Err(EnrichmentError::SingularMass { pivot: i, value: m });
        }
        scale.push(1.0 / m.sqrt());
    }
    let scaled = |A: &DMatrix<f64>| DMatrix::from_fn(n, n, |i, j| scale[i] * A[(i, j)] * scale[j]);
    let L = cholesky(scaled(M))?;
    let mut A = scaled(K);
    // A ← L⁻¹ A L⁻ᵀ: forward substitution on the columns, then on the rows.
    for _ in 0..2 {
        for column in 0..n {
            for i in 0..n {
                let known: f64 = (0..i).map(|k| L[(i, k)] * A[(k, column)]).sum();
                A[(i, column)] = (A[(i, column)] - known) / L[(i, i)];
            }
        }
        A.transpose_mut();
    }
    let symmetric = (&A + A.transpose()) / 2.0;
    Ok(symmetric.symmetric_eigenvalues().max().max(0.0).sqrt())
}

fn cholesky(mut A: DMatrix<f64>) -> Result<DMatrix<f64>, EnrichmentError> {
    let n = A.nrows();
    for j in 0..n {
        for i in j..n {
            let known: f64 = (0..j).map(|k| A[(i, k)] * A[(j, k)]).sum();
            A[(i, j)] -= known;
        }
        let pivot = A[(j, j)];
        if pivot.is_nan() || pivot <= SMALLEST_PIVOT {
            return Err(EnrichmentError::SingularMass { pivot: j, value: pivot });
        }
        for i in j..n {
            A[(i, j)] /= pivot.sqrt();
        }
    }
    Ok(A)
}
