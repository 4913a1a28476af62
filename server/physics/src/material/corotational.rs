//! Corotational elasticity: Hooke's law in the frame of the polar rotation R of F = R S.
//!
//! With the *exact* polar rotation the stress is the derivative of an energy. With a lagged one it
//! is not, and the body creeps.
//!
//! # Source
//! Chao, Pinkall, Sanan, Schröder 2010, "A simple geometric model for elastic deformations";
//! tangent: Smith, de Goes, Kim 2019, "Analytic eigensystems for isotropic distortion energies".

use nalgebra::{Matrix3, Vector3};

use super::Lame;

/// The corotational law. `R` is always the rotation that maximises tr(RᵀF).
#[derive(Clone, Copy, Debug)]
pub struct Corotational(
    /// Elastic constants.
    pub Lame,
);

impl Corotational {
    /// ψ = μ ‖F − R‖² + λ/2 tr²(RᵀF − I) [J/m³].
    pub fn energy(&self, F: &Matrix3<f64>, R: &Matrix3<f64>) -> f64 {
        let stretch = R.dot(F) - 3.0;
        self.0.mu * (F - R).norm_squared() + 0.5 * self.0.lambda * stretch * stretch
    }

    /// P = 2μ (F − R) + λ tr(RᵀF − I) R [Pa].
    pub fn stress(&self, F: &Matrix3<f64>, R: &Matrix3<f64>) -> Matrix3<f64> {
        2.0 * self.0.mu * (F - R) + self.0.lambda * (R.dot(F) - 3.0) * R
    }

    /// dP with the rotation held: 2μ R sym(RᵀdF) + λ tr(RᵀdF) R [Pa].
    ///
    /// Positive semidefinite for every F: the exact tangent with its three twist eigenvalues set to
    /// zero. This is the one the solver uses.
    pub fn tangent_held(&self, R: &Matrix3<f64>, dF: &Matrix3<f64>) -> Matrix3<f64> {
        let d = R.transpose() * dF;
        R * (self.0.mu * (d + d.transpose()) + Matrix3::from_diagonal_element(self.0.lambda * d.trace()))
    }

    /// The exact dP = 2μ (dF − dR) + λ (R:dF) R + λ tr(S − I) dR [Pa], indefinite under
    /// compression.
    ///
    /// # Derivation
    /// RᵀR = I gives dR = R \[ω\]ₓ; S = RᵀF symmetric gives (tr(S) I − S) ω = axl(RᵀdF − dFᵀR).
    pub fn tangent(&self, F: &Matrix3<f64>, R: &Matrix3<f64>, dF: &Matrix3<f64>) -> Matrix3<f64> {
        let S = R.transpose() * F;
        let d = R.transpose() * dF;
        let skew = d - d.transpose();
        let axl = Vector3::new(skew[(2, 1)], skew[(0, 2)], skew[(1, 0)]);
        let G = Matrix3::from_diagonal_element(S.trace()) - S;
        let omega = G.try_inverse().map_or_else(Vector3::zeros, |inverse| inverse * axl);
        let dR = R * omega.cross_matrix();
        2.0 * self.0.mu * (dF - dR) + self.0.lambda * (d.trace() * R + (S.trace() - 3.0) * dR)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::element::polar_rotation;
    use crate::material::finite_difference::{assert_triad, samples};

    const LAW: Corotational = Corotational(Lame { mu: 1.3, lambda: 2.1 });

    fn rotation(F: &Matrix3<f64>) -> Matrix3<f64> {
        polar_rotation(F, &Matrix3::identity())
    }

    #[test]
    fn triad_agrees_with_finite_differences() {
        for F in samples() {
            assert_triad(
                &F,
                |F| LAW.energy(F, &rotation(F)),
                |F| LAW.stress(F, &rotation(F)),
                |F, dF| LAW.tangent(F, &rotation(F), dF),
            );
        }
    }

    #[test]
    fn held_tangent_is_the_exact_one_without_twist_and_never_negative() {
        for F in samples() {
            let R = rotation(&F);
            let S = R.transpose() * F;
            let symmetric = R * (S + Matrix3::new(0.3, 0.1, 0.2, 0.1, -0.4, 0.5, 0.2, 0.5, 0.1));
            let exact = LAW.tangent(&F, &R, &symmetric);
            assert!((LAW.tangent_held(&R, &symmetric) - exact).norm() < 1e-9 * (1.0 + exact.norm()));
            for dF in samples() {
                assert!(LAW.tangent_held(&R, &dF).dot(&dF) >= -1e-12);
            }
        }
    }

    #[test]
    fn flat_and_collapsed_elements_stay_finite() {
        let flat = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, 0.0));
        let needle = Matrix3::from_diagonal(&Vector3::new(1.0, 1e-12, -1e-12));
        for F in [Matrix3::zeros(), flat, needle, -Matrix3::identity() * 1e-12] {
            let R = rotation(&F);
            assert!((R.transpose() * R - Matrix3::identity()).norm() < 1e-12);
            assert!(LAW.energy(&F, &R).is_finite());
            assert!(LAW.stress(&F, &R).iter().all(|p| p.is_finite()));
            assert!(LAW.tangent(&F, &R, &Matrix3::identity()).iter().all(|p| p.is_finite()));
        }
    }
}
