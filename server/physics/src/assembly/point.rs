//! The constitutive law at a quadrature point.

use nalgebra::{Matrix3, SMatrix};

use crate::material::{Lame, Law, Matrix9, Split, Tangent};

/// A law with its constants.
#[derive(Clone, Copy, Debug)]
pub(super) struct PointLaw {
    pub law: Law,
    pub lame: Lame,
}

impl PointLaw {
    pub fn energy(&self, F: &Matrix3<f64>) -> f64 {
        self.law.energy(F, self.lame)
    }

    /// ψ [J/m³] and P [Pa].
    pub fn energy_and_stress(&self, F: &Matrix3<f64>) -> (f64, Matrix3<f64>) {
        self.law.energy_and_stress(F, self.lame)
    }

    pub fn tangent(&self, F: &Matrix3<f64>, kind: Tangent) -> Matrix9 {
        self.law.tangent(F, self.lame, kind)
    }

    /// The law split into shear and volume, if it has a volumetric part λ/2 θ².
    pub fn split(&self) -> Option<Split> {
        self.law.split(self.lame)
    }
}

/// The nearest positive semidefinite matrix: negative eigenvalues set to zero. A matrix that is not
/// finite is returned as it is.
pub(super) fn projected<const N: usize>(A: &SMatrix<f64, N, N>) -> SMatrix<f64, N, N>
where
    nalgebra::Const<N>: nalgebra::DimSub<nalgebra::U1>,
    nalgebra::DefaultAllocator:
        nalgebra::allocator::Allocator<nalgebra::DimDiff<nalgebra::Const<N>, nalgebra::U1>>,
{
    if !A.iter().all(|v| v.is_finite()) {
        return *A;
    }
    let symmetric = 0.5 * (A + A.transpose());
    let eigen = symmetric.symmetric_eigen();
    let mut B = symmetric;
    for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
        if *value < 0.0 {
            B -= *value * vector * vector.transpose();
        }
    }
    B
}
