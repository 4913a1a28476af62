//! Kinds of elements, and of their quadrature.

/// Finite element of a model, and the points at which its energy is integrated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum ElementKind {
    /// Linear tetrahedron, one point.
    #[default]
    Tet4,
    /// Quadratic tetrahedron, four points.
    Tet10,
    /// Trilinear hexahedron, 2×2×2 points.
    Hex8,
    /// Cubes on an adaptive octree, which are cut along the links between them; 2×2×2 points.
    Octree,
}

impl ElementKind {
    /// Its name in messages.
    pub fn name(self) -> &'static str {
        match self {
            ElementKind::Tet4 => "element tet4",
            ElementKind::Tet10 => "element tet10",
            ElementKind::Hex8 => "element hex8",
            ElementKind::Octree => "element octree",
        }
    }

    /// Nodes per element.
    pub fn nodes(self) -> usize {
        match self {
            ElementKind::Tet4 => 4,
            ElementKind::Tet10 => 10,
            ElementKind::Hex8 | ElementKind::Octree => 8,
        }
    }

    /// Quadrature points per element.
    pub fn points(self) -> usize {
        match self {
            ElementKind::Tet4 => 1,
            ElementKind::Tet10 => 4,
            ElementKind::Hex8 | ElementKind::Octree => 8,
        }
    }
}

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
