//! The constitutive law of a body, chosen at run time: energy, stress and tangent of each.

use nalgebra::Matrix3;

use super::{Corotational, Lame, Linear, Matrix9, NeoHookean, StVenantKirchhoff};

/// The constitutive laws to choose from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Law {
    /// Small strains and small rotations: cheapest, and wrong as soon as the body rotates.
    Linear,
    /// Small strains in a frame that rotates with the material: the robust default.
    #[default]
    Corotational,
    /// Hooke's law between Green strain and second Piola–Kirchhoff stress, continued below a stretch
    /// of 0.65 so that inverted elements recover.
    StVenantKirchhoff,
    /// Stable Neo-Hookean with a collapse guard: large strains, only under a line search.
    NeoHookean,
}

/// Which tangent ∂P/∂F is evaluated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tangent {
    /// The derivative of the stress. It is indefinite under compression.
    Exact,
    /// The exact tangent with negative eigenvalues set to 0, so that Newton's method always descends.
    #[default]
    Projected,
    /// Corotational law: the tangent with the rotation held, R C Rᵀ. Other laws: as projected.
    Held,
}

impl Law {
    /// Every law, in the order of the enumeration.
    pub const ALL: [Law; 4] = [Law::Linear, Law::Corotational, Law::StVenantKirchhoff, Law::NeoHookean];

    /// Energy density ψ(F) [J/m³], 0 at rest. It is finite unless F is not finite or the value overflows.
    pub fn energy(self, F: &Matrix3<f64>, lame: Lame) -> f64 {
        match self {
            Law::Linear => Linear(lame).energy(F),
            Law::Corotational => Corotational(lame).energy(F),
            Law::StVenantKirchhoff => StVenantKirchhoff::invertible(lame).energy(F),
            Law::NeoHookean => NeoHookean::new(lame).energy(F),
        }
    }

    /// First Piola–Kirchhoff stress P(F) = ∂ψ/∂F [Pa].
    pub fn stress(self, F: &Matrix3<f64>, lame: Lame) -> Matrix3<f64> {
        match self {
            Law::Linear => Linear(lame).stress(F),
            Law::Corotational => Corotational(lame).stress(F),
            Law::StVenantKirchhoff => StVenantKirchhoff::invertible(lame).stress(F),
            Law::NeoHookean => NeoHookean::new(lame).stress(F),
        }
    }

    /// ψ [J/m³] and P [Pa] in one call. The corotational law decomposes F only once for both.
    pub fn energy_and_stress(self, F: &Matrix3<f64>, lame: Lame) -> (f64, Matrix3<f64>) {
        match self {
            Law::Corotational => Corotational(lame).energy_and_stress(F),
            law => (law.energy(F, lame), law.stress(F, lame)),
        }
    }

    /// ∂P/∂F [Pa], with F stacked by columns.
    pub fn tangent(self, F: &Matrix3<f64>, lame: Lame, kind: Tangent) -> Matrix9 {
        match self {
            Law::Linear => Linear(lame).tangent(),
            Law::Corotational => Corotational(lame).tangent(F, kind),
            Law::StVenantKirchhoff => StVenantKirchhoff::invertible(lame).tangent(F, kind),
            Law::NeoHookean => NeoHookean::new(lame).tangent(F, kind),
        }
    }

    /// Whether the law uses the rotation of each element.
    pub fn rotates(self) -> bool {
        matches!(self, Law::Corotational)
    }

    /// Whether the stress is linear in the stretch, so that a linear solve from the predictor makes a step.
    pub fn is_hookean(self) -> bool {
        matches!(self, Law::Linear | Law::Corotational)
    }
}
