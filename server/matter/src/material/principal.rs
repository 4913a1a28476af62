//! Isotropic laws in their principal axes: stress and tangent from the derivatives by the stretches.
//!
//! For F = U diag(σ) Vᵀ and ψ(σ) the tangent has three eigenmodes that scale the axes and are coupled by
//! ∂²ψ/∂σ_i∂σ_j. For each pair of axes it has one more that twists and one that flips them.
//!
//! # Source
//! Smith, de Goes, Kim 2019, "Analytic eigensystems for isotropic distortion energies", §4.

use nalgebra::{Matrix3, Vector3};

use super::{Matrix9, SignedSvd};

/// The pair of axes opposite to axis k.
pub(super) const PAIRS: [(usize, usize); 3] = [(1, 2), (2, 0), (0, 1)];

/// Derivatives of an isotropic function of F by the signed stretches σ.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Principal {
    /// ∂ψ/∂σ_i.
    pub slope: Vector3<f64>,
    /// ∂²ψ/∂σ_i∂σ_j.
    pub scaling: Matrix3<f64>,
    /// (ψ_i + ψ_j)/(σ_i + σ_j) of the pair opposite to k: eigenvalue of (e_i⊗e_j − e_j⊗e_i)/√2.
    pub twist: Vector3<f64>,
    /// (ψ_i − ψ_j)/(σ_i − σ_j) of the pair opposite to k: eigenvalue of (e_i⊗e_j + e_j⊗e_i)/√2.
    pub flip: Vector3<f64>,
}

impl Principal {
    /// ∂ψ/∂F = U diag(∂ψ/∂σ) Vᵀ.
    pub(super) fn gradient(&self, svd: &SignedSvd) -> Matrix3<f64> {
        svd.compose(&self.slope)
    }

    /// The same with every negative eigenvalue set to 0, which is the nearest positive semidefinite tangent.
    pub(super) fn projected(mut self) -> Self {
        let eigen = self.scaling.symmetric_eigen();
        if eigen.eigenvalues.min() < 0.0 {
            let Q = eigen.eigenvectors;
            self.scaling = Q * Matrix3::from_diagonal(&eigen.eigenvalues.map(|v| v.max(0.0))) * Q.transpose();
        }
        self.twist = self.twist.map(|v| v.max(0.0));
        self.flip = self.flip.map(|v| v.max(0.0));
        self
    }

    /// ∂²ψ/∂F², with F stacked by columns.
    pub(super) fn hessian(&self, svd: &SignedSvd) -> Matrix9 {
        let SignedSvd { U, V, .. } = svd;
        let mut H = Matrix9::zeros();
        for column in 0..3 {
            for row in 0..3 {
                // dF = e_row ⊗ e_column in the principal axes.
                let d = U.row(row).transpose() * V.row(column);
                let mut response = Matrix3::from_diagonal(&(self.scaling * d.diagonal()));
                for (k, (i, j)) in PAIRS.into_iter().enumerate() {
                    let (sum, difference) =
                        (0.5 * (self.flip[k] + self.twist[k]), 0.5 * (self.flip[k] - self.twist[k]));
                    response[(i, j)] = sum * d[(i, j)] + difference * d[(j, i)];
                    response[(j, i)] = sum * d[(j, i)] + difference * d[(i, j)];
                }
                let dP = U * response * V.transpose();
                H.column_mut(row + 3 * column).copy_from_slice(dP.as_slice());
            }
        }
        H
    }
}
