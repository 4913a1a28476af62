//! The material of a body: elastic constants, density, damping and the constitutive law.
//!
//! A law consists of the energy density ψ(F) [J/m³], the first Piola–Kirchhoff stress P(F) = ∂ψ/∂F [Pa] and
//! the tangent ∂P/∂F [Pa]. Each law has its own file, which checks the three against finite differences. A
//! law has no state besides F. What has a past, [`Prony`] series, stands beside the law; so do families of [`Fibre`]s.

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
mod fibres;
mod prony;
mod regions;
mod split;
#[cfg(test)]
mod law_tests;

pub use corotational::Corotational;
pub use fibres::{Fibre, Fibres, MAX_FIBRES};
pub use law::{Law, Tangent};
pub use linear::Linear;
pub use neo_hookean::NeoHookean;
pub use prony::{MAX_PRONY, Prony, PronySpring, PronyTerm, Strain};
pub use prony::{first_piola, matrix};
pub use regions::{Regions, RegionsError};
pub use split::Split;
pub use st_venant_kirchhoff::StVenantKirchhoff;
pub use svd::SignedSvd;

use std::ops::RangeInclusive;

use thiserror::Error;

/// ∂²ψ/∂F² with F stacked by columns: entry (row, column) of F has index row + 3·column.
pub type Matrix9 = nalgebra::SMatrix<f64, 9, 9>;

/// Isotropic elastic material of one body.
///
/// ```
/// use scindo_matter::material::{Law, Material, Rayleigh};
///
/// let liver = Material {
///     young_pa: 1e4,
///     poisson: 0.4,
///     density_kg_m3: 1060.0,
///     rayleigh: Rayleigh { mass_1_s: 0.0, stiffness_s: 0.02 },
///     law: Law::Corotational,
/// };
/// liver.check()?;
/// assert!((liver.lame().mu - 1e4 / 2.8).abs() < 1e-9); // μ = E / (2 (1 + ν)) [Pa]
///
/// let incompressible = Material { poisson: 0.5, ..liver };
/// assert!(incompressible.check().is_err());
/// # Ok::<(), scindo_matter::material::MaterialError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Material {
    /// Young's modulus E [Pa], within [`Material::YOUNG_PA`].
    pub young_pa: f64,
    /// Poisson's ratio ν [1], within [`Material::POISSON`].
    pub poisson: f64,
    /// Density ρ at rest [kg/m³], within [`Material::DENSITY_KG_M3`].
    pub density_kg_m3: f64,
    /// Damping D = α M + β K̂.
    pub rayleigh: Rayleigh,
    /// Constitutive law.
    pub law: Law,
}

/// Elastic constants and density of a region that differs from the rest of its body. Law and damping are those of
/// the body.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Region {
    /// Young's modulus E [Pa], within [`Material::YOUNG_PA`].
    pub young_pa: f64,
    /// Poisson's ratio ν [1], within [`Material::POISSON`].
    pub poisson: f64,
    /// Density ρ at rest [kg/m³], within [`Material::DENSITY_KG_M3`].
    pub density_kg_m3: f64,
}

impl Region {
    /// Region number `number` of these: they count from 1, and 0 is the body's own material.
    #[inline]
    pub fn numbered(regions: &[Self], number: u16) -> Option<&Self> {
        usize::from(number).checked_sub(1).and_then(|at| regions.get(at))
    }

    /// Lamé constants; see [`Material::lame`].
    pub fn lame(&self) -> Lame {
        let (E, nu) = (self.young_pa, self.poisson);
        Lame { mu: E / (2.0 * (1.0 + nu)), lambda: E * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)) }
    }

    /// Checks that every constant is finite and in its range.
    pub fn check(&self) -> Result<(), MaterialError> {
        within("young_pa", self.young_pa, Material::YOUNG_PA)?;
        within("poisson", self.poisson, Material::POISSON)?;
        within("density_kg_m3", self.density_kg_m3, Material::DENSITY_KG_M3)
    }
}

/// Coefficients of Rayleigh damping D = α M + β K̂. K̂ rotates with the material, so β does not damp rigid
/// motion.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Rayleigh {
    /// α [1/s], ≥ 0: drag of the surroundings.
    pub mass_1_s: f64,
    /// β [s], ≥ 0: viscosity of the material.
    pub stiffness_s: f64,
}

/// Lamé constants of an isotropic material.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Lame {
    /// μ [Pa], the shear modulus.
    pub mu: f64,
    /// λ [Pa].
    pub lambda: f64,
}

/// A material constant outside its range.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("{quantity} = {found:e} is outside {:e} … {:e}", range.start(), range.end())]
pub struct MaterialError {
    /// Name of the constant, with its unit.
    pub quantity: &'static str,
    /// Value found.
    pub found: f64,
    /// Allowed range.
    pub range: RangeInclusive<f64>,
}

impl Material {
    /// Range of Young's modulus [Pa].
    pub const YOUNG_PA: RangeInclusive<f64> = 1e-6..=1e13;
    /// Range of Poisson's ratio.
    pub const POISSON: RangeInclusive<f64> = -0.99..=0.4999;
    /// Range of the density [kg/m³].
    pub const DENSITY_KG_M3: RangeInclusive<f64> = 1e-6..=1e6;
    /// Range of the drag α [1/s].
    pub const MASS_1_S: RangeInclusive<f64> = 0.0..=1e6;
    /// Range of the viscosity β [s].
    pub const STIFFNESS_S: RangeInclusive<f64> = 0.0..=1e6;

    /// Lamé constants: μ = E / (2 (1+ν)), λ = E ν / ((1+ν)(1−2ν)).
    pub fn lame(&self) -> Lame {
        self.constants().lame()
    }

    /// Elastic constants and density.
    fn constants(&self) -> Region {
        let Self { young_pa, poisson, density_kg_m3, .. } = *self;
        Region { young_pa, poisson, density_kg_m3 }
    }

    /// The material of a region of a body of this material.
    pub fn of_region(&self, region: &Region) -> Self {
        let Region { young_pa, poisson, density_kg_m3 } = *region;
        Self { young_pa, poisson, density_kg_m3, ..*self }
    }

    /// Checks that every constant is finite and in its range.
    pub fn check(&self) -> Result<(), MaterialError> {
        self.constants().check()?;
        let Rayleigh { mass_1_s, stiffness_s } = self.rayleigh;
        within("rayleigh.mass_1_s", mass_1_s, Self::MASS_1_S)?;
        within("rayleigh.stiffness_s", stiffness_s, Self::STIFFNESS_S)
    }
}

fn within(quantity: &'static str, found: f64, range: RangeInclusive<f64>) -> Result<(), MaterialError> {
    if range.contains(&found) { Ok(()) } else { Err(MaterialError { quantity, found, range }) }
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
