//! How the volumetric part of the energy is integrated.

/// How the volumetric part λ/2 θ² of the energy is integrated: remedies against locking near ν = ½.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub enum Volumetric {
    /// At the same points as the rest of the energy.
    #[default]
    Full,
    /// Tet4: with θ̄_n, the mean of θ over the elements at node n,
    /// (1 − kept) λ/2 Σ_n V_n θ̄_n² + kept λ/2 Σ_e V_e θ_e². Averages belong to copies, so they
    /// never cross a cut.
    NodeAveraged {
        /// Share that stays with the elements and suppresses checkerboards; usually 0.05 … 0.1. It is
        /// taken of λ, or of 25 μ where λ is larger, so that nothing locks near ν = ½.
        kept: f64,
    },
    /// Hex8: at one point per element, with the mean gradients; shear stays at 2×2×2 points.
    Selective,
}
