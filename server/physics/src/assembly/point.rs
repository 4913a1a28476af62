//! The constitutive law at a quadrature point, whole or split into shear and volume.

use nalgebra::{Matrix3, SMatrix, Vector3};

use crate::element::polar_rotation;
use crate::material::{Corotational, Lame, Law, Linear};

/// A tangent d vec(P)/d vec(F) [Pa]; vec is column-major, index = row + 3 · column.
pub type Matrix9 = SMatrix<f64, 9, 9>;

/// Which second derivative of the energy is assembled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tangent {
    /// The derivative of the stress; indefinite where material is compressed or inverted.
    Exact,
    /// The exact one with its negative eigenvalues set to zero.
    #[default]
    Projected,
    /// Corotational: with the rotation held; other laws: as projected.
    Held,
}

/// A law with its constants.
#[derive(Clone, Copy, Debug)]
pub(super) struct PointLaw {
    pub law: Law,
    pub lame: Lame,
}

impl PointLaw {
    pub fn energy(&self, F: &Matrix3<f64>) -> f64 {
        self.law.energy(F, &self.rotation(F), self.lame)
    }

    pub fn stress(&self, F: &Matrix3<f64>) -> Matrix3<f64> {
        self.law.stress(F, &self.rotation(F), self.lame)
    }

    pub fn tangent(&self, F: &Matrix3<f64>, kind: Tangent) -> Matrix9 {
        let R = self.rotation(F);
        let exact = |kind| {
            by_columns(|dF| match (self.law, kind) {
                (Law::Linear, _) => Linear(self.lame).tangent(dF),
                (Law::Corotational, Tangent::Held) => Corotational(self.lame).tangent_held(&R, dF),
                (Law::Corotational, _) => Corotational(self.lame).tangent(F, &R, dF),
            })
        };
        match kind {
            Tangent::Projected => projected(&exact(Tangent::Exact)),
            _ => exact(kind),
        }
    }

    fn rotation(&self, F: &Matrix3<f64>) -> Matrix3<f64> {
        if self.law.rotates() { polar_rotation(F, &Matrix3::identity()) } else { Matrix3::identity() }
    }

    /// The law taken apart, if it has a volumetric part λ/2 θ².
    pub fn split(&self) -> Option<PointSplit> {
        Some(PointSplit(*self))
    }
}

/// ψ = ψ_μ(F) + λ/2 θ(F)².
#[derive(Clone, Copy, Debug)]
pub(super) struct PointSplit(PointLaw);

impl PointSplit {
    fn shear(&self) -> PointLaw {
        PointLaw { lame: Lame { lambda: 0.0, ..self.0.lame }, ..self.0 }
    }

    pub fn shear_energy(&self, F: &Matrix3<f64>) -> f64 {
        self.shear().energy(F)
    }

    pub fn shear_stress(&self, F: &Matrix3<f64>) -> Matrix3<f64> {
        self.shear().stress(F)
    }

    pub fn shear_tangent(&self, F: &Matrix3<f64>, kind: Tangent) -> Matrix9 {
        self.shear().tangent(F, kind)
    }

    pub fn lambda(&self) -> f64 {
        self.0.lame.lambda
    }

    pub fn theta(&self, F: &Matrix3<f64>) -> f64 {
        self.0.rotation(F).dot(F) - 3.0
    }

    pub fn theta_gradient(&self, F: &Matrix3<f64>) -> Matrix3<f64> {
        self.0.rotation(F)
    }

    pub fn theta_hessian(&self, F: &Matrix3<f64>) -> Matrix9 {
        if !self.0.law.rotates() {
            return Matrix9::zeros();
        }
        let R = self.0.rotation(F);
        let S = R.transpose() * F;
        let G = (Matrix3::from_diagonal_element(S.trace()) - S).try_inverse().unwrap_or_else(Matrix3::zeros);
        by_columns(|dF| {
            let d = R.transpose() * dF;
            let skew = d - d.transpose();
            R * (G * Vector3::new(skew[(2, 1)], skew[(0, 2)], skew[(1, 0)])).cross_matrix()
        })
    }
}

fn by_columns(apply: impl Fn(&Matrix3<f64>) -> Matrix3<f64>) -> Matrix9 {
    let mut A = Matrix9::zeros();
    for c in 0..9 {
        let mut dF = Matrix3::zeros();
        dF[c] = 1.0;
        A.column_mut(c).copy_from_slice(apply(&dF).as_slice());
    }
    A
}

/// The nearest positive semidefinite matrix: negative eigenvalues set to zero.
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
