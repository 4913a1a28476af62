//! Why a mesh cannot be simulated.

use thiserror::Error;

/// A rest mesh that mechanics cannot use, with the place and the value found.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum MeshError {
    /// The mesh has no tetrahedron.
    #[error("the mesh has no tetrahedra; give a volumetric mesh, or a surface to be filled")]
    Empty,
    /// There are more nodes or tets than 32-bit ids can number.
    #[error("the mesh has {found} nodes or tets, at most {limit} are supported; coarsen it")]
    TooLarge {
        /// Count found.
        found: usize,
        /// Largest count allowed.
        limit: usize,
    },
    /// A node position is NaN or infinite.
    #[error("node {node} is at {position_m:?} m; every coordinate must be finite")]
    NonFinite {
        /// Node id.
        node: usize,
        /// Position found [m].
        position_m: [f64; 3],
    },
    /// A tet names a node that does not exist.
    #[error("tet {tet} names node {node}, but the mesh has nodes 0..{n_nodes}")]
    NodeOutOfRange {
        /// Tet id.
        tet: usize,
        /// Node id found.
        node: u32,
        /// Number of nodes.
        n_nodes: usize,
    },
    /// A tet names the same node twice.
    #[error("tet {tet} names node {node} twice; remove the collapsed element")]
    RepeatedNode {
        /// Tet id.
        tet: usize,
        /// Node id found twice.
        node: u32,
    },
    /// The four nodes of a tet are (nearly) coplanar.
    #[error(
        "tet {tet} is flat: volume {volume_m3:.3e} m³, at least {least_m3:.3e} m³ is needed for \
         its size; remove it or improve the mesh"
    )]
    Degenerate {
        /// Tet id.
        tet: usize,
        /// Signed volume found [m³].
        volume_m3: f64,
        /// Smallest usable volume [m³] for its longest edge.
        least_m3: f64,
    },
    /// A tet is listed with negative orientation.
    #[error(
        "tet {tet} is inside out: volume {volume_m3:.3e} m³; swap two of its nodes, or build the \
         mesh with TetMesh::repaired"
    )]
    Inverted {
        /// Tet id.
        tet: usize,
        /// Signed volume found [m³].
        volume_m3: f64,
    },
    /// A node belongs to no tet, so it has no mass and no stiffness.
    #[error("node {node} belongs to no tet; drop it, or build the mesh with TetMesh::repaired")]
    UnusedNode {
        /// Node id.
        node: usize,
    },
}
