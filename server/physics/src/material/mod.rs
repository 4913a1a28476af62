//! What a body is made of: elastic constants, density, damping and the constitutive law.
//!
//! A law is the triad energy density ψ(F) [J/m³], first Piola–Kirchhoff stress P(F) = ∂ψ/∂F [Pa]
//! and tangent dP = ∂P/∂F : dF [Pa], one file each, checked against finite differences there.

#[cfg(test)]
mod finite_difference;
mod linear;
mod corotational;

pub use corotational::Corotational;
pub use linear::Linear;

use nalgebra::Matrix3;
use thiserror::Error;

/// Isotropic elastic material of one body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Young's modulus E [Pa], > 0.
    pub young_pa: f64,
    /// Poisson's ratio ν [1], in (-1, 0.5).
    pub poisson: f64,
    /// Density ρ at rest [kg/m³], > 0.
    pub density_kg_m3: f64,
    /// Damping D = α M + β K̂.
    pub rayleigh: Rayleigh,
    /// Constitutive law.
    pub law: Law,
}

/// Coefficients of Rayleigh damping D = α M + β K̂, with K̂ rotated along with the material, so that
/// β does not damp rigid motion.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rayleigh {
    /// α [1/s], ≥ 0: drag of the surroundings.
    pub mass_1_s: f64,
    /// β [s], ≥ 0: viscosity of the material.
    pub stiffness_s: f64,
}

/// The constitutive laws that can be chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Law {
    /// Small strains and small rotations: cheapest, wrong as soon as the body turns.
    Linear,
    /// Small strains in a frame that turns with the material: the robust default.
    #[default]
    Corotational,
}

/// Lamé constants of an isotropic material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lame {
    /// μ [Pa], the shear modulus.
    pub mu: f64,
    /// λ [Pa].
    pub lambda: f64,
}

/// A material constant outside its range.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("{quantity} = {found} is outside {allowed}")]
pub struct MaterialError {
    /// Name of the constant, with its unit.
    pub quantity: &'static str,
    /// Value found.
    pub found: f64,
    /// Allowed range in words.
    pub allowed: &'static str,
}

impl Material {
    /// Lamé constants: μ = E / (2 (1+ν)), λ = E ν / ((1+ν)(1−2ν)).
    pub fn lame(&self) -> Lame {
        let (E, nu) = (self.young_pa, self.poisson);
        Lame { mu: E / (2.0 * (1.0 + nu)), lambda: E * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)) }
    }

    /// Tells whether every constant is finite and in its range.
    pub fn check(&self) -> Result<(), MaterialError> {
        let within = |quantity, found: f64, ok: bool, allowed| {
            if ok && found.is_finite() { Ok(()) } else { Err(MaterialError { quantity, found, allowed }) }
        };
        let Rayleigh { mass_1_s, stiffness_s } = self.rayleigh;
        within("young_pa", self.young_pa, (1e-6..=1e13).contains(&self.young_pa), "1e-6 … 1e13 Pa")?;
        within("poisson", self.poisson, (-0.99..=0.4999).contains(&self.poisson), "-0.99 … 0.4999")?;
        let rho = self.density_kg_m3;
        within("density_kg_m3", rho, (1e-6..=1e6).contains(&rho), "1e-6 … 1e6 kg/m³")?;
        within("rayleigh.mass_1_s", mass_1_s, (0.0..=1e6).contains(&mass_1_s), "0 … 1e6 1/s")?;
        within("rayleigh.stiffness_s", stiffness_s, (0.0..=1e6).contains(&stiffness_s), "0 … 1e6 s")
    }
}

impl Law {
    /// Energy density ψ(F) [J/m³]. `R` is the rotation of `F`, used by corotational laws.
    pub fn energy(self, F: &Matrix3<f64>, R: &Matrix3<f64>, lame: Lame) -> f64 {
        match self {
            Law::Linear => Linear(lame).energy(F),
            Law::Corotational => Corotational(lame).energy(F, R),
        }
    }

    /// First Piola–Kirchhoff stress P(F) [Pa].
    pub fn stress(self, F: &Matrix3<f64>, R: &Matrix3<f64>, lame: Lame) -> Matrix3<f64> {
        match self {
            Law::Linear => Linear(lame).stress(F),
            Law::Corotational => Corotational(lame).stress(F, R),
        }
    }

    /// Whether elements carry a rotation of their own.
    pub fn rotates(self) -> bool {
        matches!(self, Law::Corotational)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    const SOFT: Material = Material {
        young_pa: 1e5,
        poisson: 0.25,
        density_kg_m3: 1e3,
        rayleigh: Rayleigh { mass_1_s: 0.0, stiffness_s: 0.0 },
        law: Law::Corotational,
    };

    #[test]
    fn lame_constants_of_a_quarter_poisson_solid_are_equal() {
        let Lame { mu, lambda } = SOFT.lame();
        assert!((mu - 4e4).abs() < 1e-9 && (lambda - 4e4).abs() < 1e-9);
    }

    #[test]
    fn constants_out_of_range_are_named() {
        SOFT.check().unwrap();
        let refused = Material { poisson: 0.5, ..SOFT }.check().unwrap_err();
        assert_eq!((refused.quantity, refused.found), ("poisson", 0.5));
        for broken in [f64::NAN, f64::INFINITY, 0.0, -1.0] {
            assert!(Material { young_pa: broken, ..SOFT }.check().is_err());
            assert!(Material { density_kg_m3: broken, ..SOFT }.check().is_err());
        }
    }
}
