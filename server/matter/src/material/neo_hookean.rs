//! Stable Neo-Hookean elasticity: ψ = μ/2 (I − 3) + λ/2 (J − α)² − μ/2 log((I + 1)/4) − λ/2 (1 − α)²
//! with I = ‖F‖², J = det F, α = 1 + μ/λ − μ/(4λ). Finite for every F, also inverted.
//!
//! μ = 4/3 μ_L and λ = λ_L + 5/6 μ_L of the Lamé constants μ_L, λ_L make it Hooke's law at small strain. A
//! [collapse guard](super::collapse_guard) near F = 0 lets an element recover that has collapsed to a point.
//!
//! # Source
//! Smith, de Goes, Kim 2018, "Stable Neo-Hookean flesh simulation", eqs. 14 and 16; constants §3.4;
//! eigenvalues §4.

use nalgebra::{Matrix3, Vector3};

use super::collapse_guard::{self, Sample};
use super::principal::{PAIRS, Principal};
use super::{Lame, Matrix9, SignedSvd, Tangent};

/// The stable Neo-Hookean law. It is safe only under a line search.
#[derive(Clone, Copy, Debug)]
pub struct NeoHookean {
    /// Elastic constants of Hooke's law at small strain.
    lame: Lame,
    /// μ [Pa] of the law.
    mu: f64,
    /// λ [Pa] of the law.
    lambda: f64,
}

/// cof F = ∂(det F)/∂F [1].
pub(super) fn cofactor(F: &Matrix3<f64>) -> Matrix3<f64> {
    let (a, b, c) = (F.column(0), F.column(1), F.column(2));
    Matrix3::from_columns(&[b.cross(&c), c.cross(&a), a.cross(&b)])
}

impl NeoHookean {
    /// The law whose small-strain limit is Hooke's law with `lame`.
    pub fn new(lame: Lame) -> Self {
        Self { lame, mu: 4.0 / 3.0 * lame.mu, lambda: lame.lambda + 5.0 / 6.0 * lame.mu }
    }

    /// λ [Pa], the factor of ½(J − α)².
    pub fn lambda(&self) -> f64 {
        self.lambda
    }

    /// α − 1 = ¾ μ/λ [1].
    pub fn volume_offset(&self) -> f64 {
        0.75 * self.mu / self.lambda
    }

    /// ψ(F) [J/m³], 0 at rest.
    pub fn energy(&self, F: &Matrix3<f64>) -> f64 {
        if collapse_guard::acts(F.norm_squared()) {
            self.guarded(&SignedSvd::new(F).sigma).energy
        } else {
            self.unguarded_energy(F.norm_squared(), F.determinant())
        }
    }

    /// P = μ (1 − 1/(I + 1)) F + λ (J − α) cof F [Pa].
    pub fn stress(&self, F: &Matrix3<f64>) -> Matrix3<f64> {
        let square = F.norm_squared();
        if collapse_guard::acts(square) {
            let svd = SignedSvd::new(F);
            return self.guarded(&svd.sigma).principal.gradient(&svd);
        }
        let pressure = self.lambda * (F.determinant() - 1.0 - self.volume_offset());
        self.mu * (square / (square + 1.0)) * F + pressure * cofactor(F)
    }

    /// ∂P/∂F [Pa].
    pub fn tangent(&self, F: &Matrix3<f64>, kind: Tangent) -> Matrix9 {
        let svd = SignedSvd::new(F);
        let principal = self.guarded(&svd.sigma).principal;
        match kind {
            Tangent::Exact => principal.hessian(&svd),
            Tangent::Projected | Tangent::Held => principal.projected().hessian(&svd),
        }
    }

    /// ψ without the guard.
    fn unguarded_energy(&self, square: f64, J: f64) -> f64 {
        let (volume, offset) = (J - 1.0, self.volume_offset());
        // Both (J − α)² − (1 − α)² and the logarithm of (I + 1)/4 are expanded about the rest state, which
        // avoids cancellation there.
        let shear = square - 3.0 - (0.25 * (square - 3.0)).ln_1p();
        0.5 * self.mu * shear + 0.5 * self.lambda * volume * (volume - 2.0 * offset)
    }

    /// ψ and its derivatives by the stretches, with the guard.
    pub(super) fn guarded(&self, sigma: &Vector3<f64>) -> Sample {
        let energy = self.unguarded_energy(sigma.norm_squared(), sigma.product());
        let law = Sample { energy, principal: self.principal(sigma) };
        collapse_guard::blend(law, sigma, self.lame, self.unguarded_energy(0.0, 0.0))
    }

    fn principal(&self, sigma: &Vector3<f64>) -> Principal {
        let square = sigma.norm_squared();
        let pressure = self.lambda * (sigma.product() - 1.0 - self.volume_offset());
        let shear = self.mu * (square / (square + 1.0));
        let growth = 2.0 * self.mu / ((square + 1.0) * (square + 1.0));
        let volume = Self::theta_principal(sigma);
        Principal {
            slope: shear * sigma + pressure * volume.slope,
            scaling: Matrix3::from_diagonal_element(shear)
                + growth * sigma * sigma.transpose()
                + self.lambda * volume.slope * volume.slope.transpose()
                + pressure * volume.scaling,
            twist: Vector3::repeat(shear) + pressure * volume.twist,
            flip: Vector3::repeat(shear) + pressure * volume.flip,
        }
    }

    /// θ = J − 1 = σ1 σ2 σ3 − 1 as a function of its stretches. Its gradient is cof F.
    pub(super) fn theta_principal(sigma: &Vector3<f64>) -> Principal {
        let mut theta = Principal { twist: *sigma, flip: -sigma, ..Principal::default() };
        for (k, (i, j)) in PAIRS.into_iter().enumerate() {
            theta.slope[k] = sigma[i] * sigma[j];
            theta.scaling[(i, j)] = sigma[k];
            theta.scaling[(j, i)] = sigma[k];
        }
        theta
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::finite_difference::{assert_triad, assert_triad_within, samples};
    use nalgebra::Rotation3;

    const LAME: Lame = Lame { mu: 1.3, lambda: 2.1 };

    #[test]
    fn triad_agrees_with_finite_differences() {
        let law = NeoHookean::new(LAME);
        for F in samples() {
            assert_triad(&F, |F| law.energy(F), |F| law.stress(F), |F| law.tangent(F, Tangent::Exact));
        }
    }

    #[test]
    fn energy_and_principal_energy_are_the_same() {
        let law = NeoHookean::new(LAME);
        for F in samples() {
            let svd = SignedSvd::new(&F);
            assert!((law.energy(&F) - law.guarded(&svd.sigma).energy).abs() < 1e-12);
            let P = law.stress(&F);
            let principal = law.guarded(&svd.sigma).principal.gradient(&svd);
            assert!((P - principal).norm() < 1e-13 * (1.0 + P.norm() + svd.sigma[0].powi(3)));
        }
        assert!(law.energy(&Matrix3::identity()).abs() < 1e-15);
    }

    /// Sizes inside, across and outside the guard: stress and tangent stay the derivatives of the energy.
    #[test]
    fn guarded_triad_agrees_with_finite_differences() {
        let turned = Rotation3::new(Vector3::new(0.4, -1.1, 0.7)).into_inner();
        let shapes = [
            Vector3::new(0.7, 0.6, 0.4),
            Vector3::new(0.9, 0.4, -0.2),
            Vector3::new(0.99, 0.1, 0.05),
            Vector3::new(0.6, 0.5, -0.3),
        ];
        for lame in [LAME, Lame { mu: 1.0, lambda: -0.3 }, Lame { mu: 1.0, lambda: 30.0 }] {
            let law = NeoHookean::new(lame);
            for shape in shapes {
                for norm in [1e-3, 0.02, 0.049, 0.0501, 0.06, 0.075, 0.09, 0.0999, 0.1001, 0.2] {
                    let F = turned * Matrix3::from_diagonal(&(norm * shape.normalize())) * turned;
                    let h = 1e-5 * norm;
                    assert_triad_within(
                        &F,
                        h,
                        2e-5,
                        |F| law.energy(F),
                        |F| law.stress(F),
                        |F| law.tangent(F, Tangent::Exact),
                    );
                }
            }
        }
    }

    /// The energy falls outwards from a point: the guard adds no equilibrium.
    #[test]
    fn collapsed_elements_are_pushed_outwards() {
        for lame in [LAME, Lame { mu: 1.0, lambda: -0.3 }, Lame { mu: 1.0, lambda: 300.0 }] {
            let law = NeoHookean::new(lame);
            for shape in [Vector3::repeat(1.0), Vector3::new(1.0, 0.7, 0.4), Vector3::new(1.0, 0.5, -0.3)] {
                for step in 0..=95 {
                    let F = Matrix3::from_diagonal(&(0.001 * f64::from(step) * shape.normalize()));
                    let outwards = law.stress(&F).dot(&Matrix3::from_diagonal(&shape));
                    assert!(outwards < 0.0, "{step} {shape} {outwards}");
                }
            }
        }
    }
}
