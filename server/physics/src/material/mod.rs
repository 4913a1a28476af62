//! What a body is made of: elastic constants, density, damping and the constitutive law.
//!
//! A law is the triad energy density ψ(F) [J/m³], first Piola–Kirchhoff stress P(F) = ∂ψ/∂F [Pa]
//! and tangent ∂P/∂F [Pa], one file each, checked against finite differences there. A law has no
//! state besides F.

#[cfg(test)]
mod finite_difference;
mod svd;
mod principal;
mod linear;
mod corotational;
mod st_venant_kirchhoff;
mod collapse_guard;
mod neo_hookean;
mod law;
mod split;
#[cfg(test)]
mod law_tests;

pub use corotational::Corotational;
pub use law::{Law, Tangent};
pub use linear::Linear;
pub use neo_hookean::NeoHookean;
pub use split::Split;
pub use st_venant_kirchhoff::StVenantKirchhoff;
pub use svd::SignedSvd;

use thiserror::Error;

/// ∂²ψ/∂F² on F stacked by columns: entry (row, column) of F has index row + 3·column.
pub type Matrix9 = nalgebra::SMatrix<f64, 9, 9>;

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
