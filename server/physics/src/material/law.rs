//! The choice of a law, and the same three questions to each.

use nalgebra::Matrix3;

use super::{Corotational, Lame, Linear, Matrix9, NeoHookean, StVenantKirchhoff};

/// The constitutive laws that can be chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Law {
    /// Small strains and small rotations: cheapest, wrong as soon as the body turns.
    Linear,
    /// Small strains in a frame that turns with the material: the robust default.
    #[default]
    Corotational,
    /// Hooke's law between Green strain and second Piola–Kirchhoff stress, continued below a stretch
    /// of 0.65 so that inverted elements recover.
    StVenantKirchhoff,
    /// Stable Neo-Hookean with a collapse guard: large strains, only under a line search.
    NeoHookean,
}

/// Which tangent ∂P/∂F is asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tangent {
    /// The derivative of the stress; indefinite under compression.
    Exact,
    /// The exact one with its negative eigenvalues set to 0: Newton's method always descends.
    #[default]
    Projected,
    /// Corotational: with the rotation held, R C Rᵀ. Other laws: as projected.
    Held,
}

impl Law {
    /// Every law, in the order of the enumeration.
    pub const ALL: [Law; 4] = [Law::Linear, Law::Corotational, Law::StVenantKirchhoff, Law::NeoHookean];

    /// Energy density ψ(F) [J/m³], 0 at rest. Not finite only if F is not, or overflows.
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

    /// ψ [J/m³] and P [Pa] in one go.
    pub fn energy_and_stress(self, F: &Matrix3<f64>, lame: Lame) -> (f64, Matrix3<f64>) {
        match self {
            Law::Corotational => Corotational(lame).energy_and_stress(F),
            law => (law.energy(F, lame), law.stress(F, lame)),
        }
    }

    /// ∂P/∂F [Pa], on F stacked by columns.
    pub fn tangent(self, F: &Matrix3<f64>, lame: Lame, kind: Tangent) -> Matrix9 {
        match self {
            Law::Linear => Linear(lame).tangent(),
            Law::Corotational => Corotational(lame).tangent(F, kind),
            Law::StVenantKirchhoff => StVenantKirchhoff::invertible(lame).tangent(F, kind),
            Law::NeoHookean => NeoHookean::new(lame).tangent(F, kind),
        }
    }

    /// Whether elements carry a rotation of their own.
    pub fn rotates(self) -> bool {
        matches!(self, Law::Corotational)
    }
}
