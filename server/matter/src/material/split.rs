//! ψ(F) = ψ_μ(F) + λ/2 θ(F)²: separates the term that locks near incompressibility from the rest.
//!
//! Selective reduced integration evaluates the second term at one point of a hexahedron. Node-averaged
//! tetrahedra replace θ by its mean around a node. θ is 0 at rest.
//!
//! | law | θ | λ |
//! |---|---|---|
//! | linear | tr ε | λ |
//! | corotational | tr(RᵀF − I) | λ |
//! | stable Neo-Hookean | det F − 1 | λ + 5/6 μ |
//!
//! St. Venant–Kirchhoff continued through inversion cannot be written in this form.

use nalgebra::Matrix3;

use super::principal::Principal;
use super::{Corotational, Lame, Law, Linear, Matrix9, NeoHookean, SignedSvd, Tangent};

/// One law in two parts.
#[derive(Clone, Copy, Debug)]
pub struct Split {
    law: Splittable,
    lame: Lame,
}

#[derive(Clone, Copy, Debug)]
enum Splittable {
    Linear,
    Corotational,
    NeoHookean,
}

impl Law {
    /// The law in two parts, or `None` for St. Venant–Kirchhoff, which has no such form.
    pub fn split(self, lame: Lame) -> Option<Split> {
        let law = match self {
            Law::Linear => Splittable::Linear,
            Law::Corotational => Splittable::Corotational,
            Law::NeoHookean => Splittable::NeoHookean,
            Law::StVenantKirchhoff => return None,
        };
        Some(Split { law, lame })
    }

    /// Whether the law has two parts, so that remedies against locking can treat one of them apart.
    pub fn splits(self) -> bool {
        self.split(Lame { mu: 1.0, lambda: 1.0 }).is_some()
    }
}

impl Split {
    /// λ [Pa], the factor of ½ θ².
    pub fn lambda(&self) -> f64 {
        match self.law {
            Splittable::NeoHookean => NeoHookean::new(self.lame).lambda(),
            Splittable::Linear | Splittable::Corotational => self.lame.lambda,
        }
    }

    /// θ(F) [1], the measure of volume change in the table of this module.
    pub fn theta(&self, F: &Matrix3<f64>) -> f64 {
        match self.law {
            Splittable::Linear => Linear::theta(F),
            Splittable::Corotational => SignedSvd::new(F).sigma.sum() - 3.0,
            Splittable::NeoHookean => F.determinant() - 1.0,
        }
    }

    /// ∂θ/∂F [1].
    pub fn theta_gradient(&self, F: &Matrix3<f64>) -> Matrix3<f64> {
        match self.law {
            Splittable::Linear => Matrix3::identity(),
            Splittable::Corotational => SignedSvd::new(F).rotation(),
            Splittable::NeoHookean => super::neo_hookean::cofactor(F),
        }
    }

    /// ∂²θ/∂F² [1], indefinite.
    pub fn theta_hessian(&self, F: &Matrix3<f64>) -> Matrix9 {
        self.pressure_tangent(F, 1.0, Tangent::Exact)
    }

    /// p ∂²θ/∂F² [Pa] with the pressure p = λ θ̄ [Pa]. This is the part of the second derivative of λ/2 θ̄²
    /// besides λ ∂θ⊗∂θ. Projected: its positive semidefinite part; held: 0.
    pub fn pressure_tangent(&self, F: &Matrix3<f64>, p: f64, kind: Tangent) -> Matrix9 {
        if matches!(self.law, Splittable::Linear) || matches!(kind, Tangent::Held) {
            return Matrix9::zeros();
        }
        let svd = SignedSvd::new(F);
        let theta = self.theta_principal(&svd);
        let scaled = Principal {
            slope: p * theta.slope,
            scaling: p * theta.scaling,
            twist: p * theta.twist,
            flip: p * theta.flip,
        };
        match kind {
            Tangent::Exact => scaled.hessian(&svd),
            Tangent::Projected | Tangent::Held => scaled.projected().hessian(&svd),
        }
    }

    /// ψ_μ(F) [J/m³].
    pub fn shear_energy(&self, F: &Matrix3<f64>) -> f64 {
        let Lame { mu, .. } = self.lame;
        match self.law {
            Splittable::Linear => Linear(Lame { mu, lambda: 0.0 }).energy(F),
            Splittable::Corotational => Corotational(Lame { mu, lambda: 0.0 }).energy(F),
            Splittable::NeoHookean => {
                NeoHookean::new(self.lame).energy(F) - 0.5 * self.lambda() * self.theta(F).powi(2)
            }
        }
    }

    /// ∂ψ_μ/∂F [Pa].
    pub fn shear_stress(&self, F: &Matrix3<f64>) -> Matrix3<f64> {
        let Lame { mu, .. } = self.lame;
        match self.law {
            Splittable::Linear => Linear(Lame { mu, lambda: 0.0 }).stress(F),
            Splittable::Corotational => Corotational(Lame { mu, lambda: 0.0 }).stress(F),
            Splittable::NeoHookean => {
                NeoHookean::new(self.lame).stress(F) - self.lambda() * self.theta(F) * self.theta_gradient(F)
            }
        }
    }

    /// ∂²ψ_μ/∂F² [Pa].
    pub fn shear_tangent(&self, F: &Matrix3<f64>, kind: Tangent) -> Matrix9 {
        let Lame { mu, .. } = self.lame;
        match self.law {
            Splittable::Linear => Linear(Lame { mu, lambda: 0.0 }).tangent(),
            Splittable::Corotational => Corotational(Lame { mu, lambda: 0.0 }).tangent(F, kind),
            Splittable::NeoHookean => {
                let svd = SignedSvd::new(F);
                let (whole, theta) =
                    (NeoHookean::new(self.lame).guarded(&svd.sigma).principal, self.theta_principal(&svd));
                let (lambda, p) = (self.lambda(), self.lambda() * (svd.sigma.product() - 1.0));
                let shear = Principal {
                    slope: whole.slope - p * theta.slope,
                    scaling: whole.scaling
                        - lambda * theta.slope * theta.slope.transpose()
                        - p * theta.scaling,
                    twist: whole.twist - p * theta.twist,
                    flip: whole.flip - p * theta.flip,
                };
                match kind {
                    Tangent::Exact => shear.hessian(&svd),
                    Tangent::Projected | Tangent::Held => shear.projected().hessian(&svd),
                }
            }
        }
    }

    fn theta_principal(&self, svd: &SignedSvd) -> Principal {
        match self.law {
            Splittable::NeoHookean => NeoHookean::theta_principal(&svd.sigma),
            Splittable::Linear | Splittable::Corotational => Corotational::theta_principal(&svd.sigma),
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::material::finite_difference::{assert_triad, samples};

    const LAME: Lame = Lame { mu: 1.3, lambda: 2.1 };

    #[test]
    fn both_parts_agree_with_finite_differences() {
        for law in Law::ALL.into_iter().filter_map(|law| law.split(LAME)) {
            for F in samples() {
                let shear = |F: &_| law.shear_tangent(F, Tangent::Exact);
                assert_triad(&F, |F| law.shear_energy(F), |F| law.shear_stress(F), shear);
                assert_triad(&F, |F| law.theta(F), |F| law.theta_gradient(F), |F| law.theta_hessian(F));
            }
        }
        assert!(!Law::StVenantKirchhoff.splits());
    }

    #[test]
    fn the_parts_add_up() {
        for law in Law::ALL {
            let Some(split) = law.split(LAME) else { continue };
            let lambda = split.lambda();
            for F in samples() {
                let (theta, gradient) = (split.theta(&F), split.theta_gradient(&F));
                let size = 1.0 + law.stress(&F, LAME).norm();
                let energy = split.shear_energy(&F) + 0.5 * lambda * theta * theta;
                assert!((energy - law.energy(&F, LAME)).abs() < 1e-12 * size * size);
                let stress = split.shear_stress(&F) + lambda * theta * gradient;
                assert!((stress - law.stress(&F, LAME)).norm() < 1e-12 * size);
                let g = nalgebra::SVector::<f64, 9>::from_column_slice(gradient.as_slice());
                let whole = split.shear_tangent(&F, Tangent::Exact)
                    + lambda * g * g.transpose()
                    + split.pressure_tangent(&F, lambda * theta, Tangent::Exact);
                let exact = law.tangent(&F, LAME, Tangent::Exact);
                assert!((whole - exact).norm() < 1e-11 * (1.0 + exact.norm()));
                for p in [-2.0, 3.0] {
                    let projected = split.pressure_tangent(&F, p, Tangent::Projected);
                    assert!(projected.symmetric_eigenvalues().min() > -1e-12 * (1.0 + projected.norm()));
                }
            }
            assert!(split.theta(&Matrix3::identity()).abs() < 1e-15);
            assert!(split.shear_stress(&Matrix3::identity()).norm() < 1e-14);
        }
    }
}
