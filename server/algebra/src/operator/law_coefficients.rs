//! Constants of laws that are nonlinear in the stretch, as their kernels need them.

use scindo_matter::material::{Lame, Law, NeoHookean, StVenantKirchhoff};

/// Constants of an update with a nonlinear law.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct LawCoefficients {
    pub law: Law,
    /// Constants of Hooke's law at small strain.
    pub lame: Lame,
    /// μ and λ [Pa] of the law.
    pub mu: f32,
    pub lambda: f32,
    /// α − 1 of the Neo-Hookean law.
    pub offset: f32,
    /// s [s²], the factor of the tangent in the operator, and rβ [s²], that of damping.
    pub s: f32,
    pub damped: f32,
    /// Least stretch for which the formula of the law holds.
    pub least: f32,
    /// Whether the tangent is made positive semidefinite.
    pub definite: bool,
}

impl LawCoefficients {
    /// Those of a nonlinear law with s and rβ [s²]; `None` with other laws.
    pub(super) fn new(law: Law, lame: Lame, s: f64, damped: f64, definite: bool) -> Option<Self> {
        let (mu, lambda, offset, least) = match law {
            Law::Linear | Law::Corotational => return None,
            Law::StVenantKirchhoff => {
                (lame.mu, lame.lambda, 0.0, StVenantKirchhoff::invertible(lame).continued_below)
            }
            Law::NeoHookean => {
                let law = NeoHookean::new(lame);
                (4.0 / 3.0 * lame.mu, law.lambda(), law.volume_offset(), 0.0)
            }
        };
        let [mu, lambda, offset, least] = [mu, lambda, offset, least].map(|c| c as f32);
        Some(Self { law, lame, mu, lambda, offset, s: s as f32, damped: damped as f32, least, definite })
    }
}
