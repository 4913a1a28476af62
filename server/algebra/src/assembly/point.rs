//! The constitutive law at a quadrature point.

use nalgebra::{Matrix3, SMatrix};
use scindo_matter::material::{Lame, Law, Matrix9, Split, StVenantKirchhoff, Tangent};

/// A law with its constants.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct PointLaw {
    pub law: Law,
    pub lame: Lame,
}

impl PointLaw {
    pub(super) fn energy(&self, F: &Matrix3<f64>) -> f64 {
        match self.green(F, &Matrix3::zeros()) {
            Some([E, S]) => 0.5 * S.dot(&E),
            None => self.law.energy(F, self.lame),
        }
    }

    /// ψ [J/m³] and P [Pa].
    pub(super) fn energy_and_stress(&self, F: &Matrix3<f64>) -> (f64, Matrix3<f64>) {
        match self.green(F, &Matrix3::zeros()) {
            Some([E, S]) => (0.5 * S.dot(&E), F * S),
            None => self.law.energy_and_stress(F, self.lame),
        }
    }

    pub(super) fn tangent(&self, F: &Matrix3<f64>, kind: Tangent) -> Matrix9 {
        self.law.tangent(F, self.lame, kind)
    }

    /// Green strain E = ½ (FᵀF − DᵀD − I) and second Piola–Kirchhoff stress S = 2μ E + λ tr(E) I [Pa] of
    /// St. Venant–Kirchhoff's law: at F for D = 0, else those of F − D extrapolated linearly to F. `None` for
    /// other laws, and where a stretch is so small that the law departs from its textbook form.
    pub(super) fn green(&self, F: &Matrix3<f64>, D: &Matrix3<f64>) -> Option<[Matrix3<f64>; 2]> {
        if self.law != Law::StVenantKirchhoff || F.determinant() <= 0.0 {
            return None;
        }
        let Lame { mu, lambda } = self.lame;
        let least = StVenantKirchhoff::invertible(self.lame).continued_below.powi(2);
        let C: Matrix3<f64> = F.transpose() * F - D.transpose() * D;
        let above = C - Matrix3::from_diagonal_element(least);
        let minor = above[(0, 0)] * above[(1, 1)] - above[(0, 1)] * above[(1, 0)];
        if !(above[(0, 0)] > 0.0 && minor > 0.0 && above.determinant() > 0.0) {
            return None;
        }
        let E = 0.5 * (C - Matrix3::identity());
        Some([E, 2.0 * mu * E + Matrix3::from_diagonal_element(lambda * E.trace())])
    }

    /// The law split into shear and volume, if it has a volumetric part λ/2 θ².
    pub(super) fn split(&self) -> Option<Split> {
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
