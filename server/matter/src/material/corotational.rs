//! Corotational elasticity: Hooke's law in the frame of the polar rotation R of F = R S.
//!
//! With the *exact* polar rotation the stress is the derivative of an energy. With a lagged rotation it is
//! not, and the body creeps.
//!
//! # Source
//! Chao, Pinkall, Sanan, Schröder 2010, "A simple geometric model for elastic deformations";
//! tangent: Smith, de Goes, Kim 2019, "Analytic eigensystems for isotropic distortion energies".

use nalgebra::{Matrix3, Vector3};

use super::principal::{PAIRS, Principal};
use super::{Lame, Matrix9, SignedSvd, Tangent};

/// The corotational law. R is always the rotation that maximises tr(RᵀF).
#[derive(Clone, Copy, Debug)]
pub struct Corotational(
    /// Elastic constants.
    pub Lame,
);

/// Where σ_i + σ_j → 0 the rotation jumps and the energy has a ridge. The curvature is capped at this sum.
const LEAST_SUM: f64 = 1e-6;

impl Corotational {
    /// Least σ_i + σ_j in [`twists`](Self::twists): in flat material under tension λ_k would grow beyond all bounds.
    pub const LEAST_STRETCHES: f64 = 0.1;

    /// ψ = μ ‖F − R‖² + λ/2 tr²(RᵀF − I) [J/m³].
    pub fn energy(&self, F: &Matrix3<f64>) -> f64 {
        self.energy_and_stress(F).0
    }

    /// P = 2μ (F − R) + λ tr(RᵀF − I) R [Pa].
    pub fn stress(&self, F: &Matrix3<f64>) -> Matrix3<f64> {
        self.energy_and_stress(F).1
    }

    /// Energy and stress from one decomposition.
    pub fn energy_and_stress(&self, F: &Matrix3<f64>) -> (f64, Matrix3<f64>) {
        let Lame { mu, lambda } = self.0;
        let R = SignedSvd::new(F).rotation();
        let (d, theta) = (F - R, R.dot(F) - 3.0);
        (mu * d.norm_squared() + 0.5 * lambda * theta * theta, 2.0 * mu * d + lambda * theta * R)
    }

    /// ∂P/∂F [Pa]. Its eigenvalues are 2μ and, once, 2μ + 3λ on the six symmetric modes U sym Vᵀ, and t_ij =
    /// 2μ + (λ tr(S − I) − 2μ)·2/(σ_i + σ_j) on the three twists. Compression makes the t_ij negative. `Held`
    /// sets the twists to 0, which gives R C Rᵀ, the tangent of the stiffness-warping solver.
    pub fn tangent(&self, F: &Matrix3<f64>, kind: Tangent) -> Matrix9 {
        let svd = SignedSvd::new(F);
        let mut principal = self.principal(&svd.sigma);
        match kind {
            Tangent::Exact => {}
            Tangent::Projected => principal.twist = principal.twist.map(|t| t.max(0.0)),
            Tangent::Held => principal.twist = Vector3::zeros(),
        }
        principal.hessian(&svd)
    }

    /// Q = Σ λ_k v_k v_kᵀ [Pa] in the frame of the material, over the axes v_k of the stretch: what tension adds to the
    /// tangent `Held` for turns of the material against its rotation. With half the curl w of a displacement in the frame
    /// of R, that is the energy wᵀ Q w per volume. λ_k = (T_i + T_j)/(σ_i + σ_j) with the principal stresses T of Biot;
    /// negative ones, of compression, are left out.
    pub fn twists(&self, F: &Matrix3<f64>) -> Matrix3<f64> {
        let Lame { mu, lambda } = self.0;
        let SignedSvd { sigma, V, .. } = SignedSvd::new(F);
        let pressure = lambda * (sigma.sum() - 3.0);
        let eigenvalue = Vector3::from_fn(|k, _| {
            let sum = sigma[(k + 1) % 3] + sigma[(k + 2) % 3];
            (2.0 * (mu * (sum - 2.0) + pressure)).max(0.0) / sum.max(Self::LEAST_STRETCHES)
        });
        V * Matrix3::from_diagonal(&eigenvalue) * V.transpose()
    }

    /// ψ = μ Σ (σ_i − 1)² + λ/2 (Σ σ_i − 3)² as a function of its stretches.
    pub(super) fn principal(&self, sigma: &Vector3<f64>) -> Principal {
        let Lame { mu, lambda } = self.0;
        let theta = sigma.sum() - 3.0;
        let volume = Self::theta_principal(sigma);
        Principal {
            slope: 2.0 * mu * sigma.add_scalar(-1.0) + lambda * theta * volume.slope,
            scaling: Matrix3::from_diagonal_element(2.0 * mu) + Matrix3::from_element(lambda),
            twist: Vector3::repeat(2.0 * mu) + (lambda * theta - 2.0 * mu) * volume.twist,
            flip: Vector3::repeat(2.0 * mu),
        }
    }

    /// θ = tr(RᵀF − I) = Σ σ_i − 3 as a function of its stretches. Its gradient is R, its Hessian ∂R/∂F.
    pub(super) fn theta_principal(sigma: &Vector3<f64>) -> Principal {
        let twist = PAIRS.map(|(i, j)| 2.0 / (sigma[i] + sigma[j]).max(LEAST_SUM));
        Principal { slope: Vector3::repeat(1.0), twist: twist.into(), ..Principal::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::finite_difference::{assert_triad, samples};

    const LAW: Corotational = Corotational(Lame { mu: 1.3, lambda: 2.1 });

    #[test]
    fn triad_agrees_with_finite_differences() {
        for F in samples() {
            assert_triad(&F, |F| LAW.energy(F), |F| LAW.stress(F), |F| LAW.tangent(F, Tangent::Exact));
        }
    }

    #[test]
    fn principal_form_is_the_same_law() {
        for F in samples() {
            let svd = SignedSvd::new(&F);
            let P = LAW.principal(&svd.sigma).gradient(&svd);
            assert!((P - LAW.stress(&F)).norm() < 1e-12 * (1.0 + P.norm()));
        }
    }

    #[test]
    fn eigenvalues_of_the_exact_tangent_are_the_published_ones() {
        for F in samples() {
            let SignedSvd { sigma, .. } = SignedSvd::new(&F);
            let Lame { mu, lambda } = LAW.0;
            let twist = |i: usize, j: usize| {
                2.0 * mu + (lambda * (sigma.sum() - 3.0) - 2.0 * mu) * 2.0 / (sigma[i] + sigma[j])
            };
            let mut expected = vec![2.0 * mu; 5];
            expected.extend([2.0 * mu + 3.0 * lambda, twist(0, 1), twist(0, 2), twist(1, 2)]);
            expected.sort_by(f64::total_cmp);
            let mut found: Vec<f64> =
                LAW.tangent(&F, Tangent::Exact).symmetric_eigenvalues().iter().copied().collect();
            found.sort_by(f64::total_cmp);
            for (found, expected) in found.iter().zip(&expected) {
                assert!(
                    (found - expected).abs() < 1e-9 * (1.0 + expected.abs()),
                    "{found} {expected} at {F}"
                );
            }
        }
    }

    #[test]
    fn held_tangent_and_twists_are_the_projected_one() {
        for F in samples() {
            let svd = SignedSvd::new(&F);
            // The flattest samples are beyond the bound of twists.
            if svd.sigma.sum() - svd.sigma.amax() < Corotational::LEAST_STRETCHES {
                continue;
            }
            let (R, Q) = (svd.rotation(), LAW.twists(&F));
            let dF = Matrix3::new(0.3, 0.1, 0.2, -0.6, -0.4, 0.5, 0.9, 0.5, 0.1);
            let H = R.transpose() * dF;
            let skew = 0.5 * (H - H.transpose());
            let w = Vector3::new(skew[(2, 1)], skew[(0, 2)], skew[(1, 0)]);
            let d = nalgebra::SVector::<f64, 9>::from_column_slice(dF.as_slice());
            let held = LAW.tangent(&F, Tangent::Held) * d;
            let twists = R * (Q * w).cross_matrix();
            let found = held + nalgebra::SVector::<f64, 9>::from_column_slice(twists.as_slice());
            let projected = LAW.tangent(&F, Tangent::Projected) * d;
            assert!((found - projected).norm() < 1e-9 * (1.0 + projected.norm()), "{F}");
        }
    }

    #[test]
    fn held_tangent_is_the_exact_one_without_twist() {
        for F in samples() {
            let svd = SignedSvd::new(&F);
            let symmetric =
                svd.U * Matrix3::new(0.3, 0.1, 0.2, 0.1, -0.4, 0.5, 0.2, 0.5, 0.1) * svd.V.transpose();
            let d = nalgebra::SVector::<f64, 9>::from_column_slice(symmetric.as_slice());
            let exact = LAW.tangent(&F, Tangent::Exact) * d;
            let held = LAW.tangent(&F, Tangent::Held);
            assert!((held * d - exact).norm() < 1e-9 * (1.0 + exact.norm()));
            let R = svd.rotation();
            let turn = R * Vector3::new(0.2, -0.5, 0.3).cross_matrix();
            let turn = nalgebra::SVector::<f64, 9>::from_column_slice(turn.as_slice());
            assert!((held * turn).norm() < 1e-12);
        }
    }
}
