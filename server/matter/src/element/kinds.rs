//! Kinds of finite elements.

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
