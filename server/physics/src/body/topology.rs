//! Queries of a body's discretisation: elements, pieces, copies, parts, rest positions.
//!
//! Nothing outside this crate reads the state of the cuts itself, so that any [`Space`](crate::space::Space)
//! can answer the same queries.

use nalgebra::Vector3;

use super::Body;
use crate::assembly::ElementKind;
use crate::cut::{Components, Flaws, Piece, Solid};
use crate::mesh::TetMesh;

impl Body {
    /// Topology epoch; rises with every cut that changes the surface and with every reset.
    pub fn epoch(&self) -> u32 {
        self.space.epoch()
    }

    /// The tetrahedra at rest that are cut and drawn: the elements, or six tets for every hexahedron.
    /// Only cuts along faces change them.
    pub fn mesh(&self) -> &TetMesh {
        self.space.mesh()
    }

    /// Box around the body at rest, lower and upper corner [m].
    pub fn bounds(&self) -> [Vector3<f64>; 2] {
        self.space.mesh().bounds()
    }

    /// Volume at rest [m³].
    pub fn rest_volume(&self) -> f64 {
        self.space.copy_volumes().iter().sum()
    }

    /// Finite elements of the uncut body.
    pub fn n_elements(&self) -> usize {
        self.space.n_elements()
    }

    /// Number of pieces that cuts made of the elements; that of the elements in a body that cannot be cut.
    pub fn n_pieces(&self) -> usize {
        match self.space.kind() {
            ElementKind::Tet4 => self.space.pieces().len(),
            _ => self.n_elements(),
        }
    }

    /// Number of nodes of the uncut body, including those that quadratic elements add.
    pub fn n_nodes(&self) -> usize {
        self.space.n_nodes()
    }

    /// Number of copies of the mesh's nodes, without the nodes that quadratic elements add. Each copy has
    /// its own degrees of freedom.
    pub fn n_copies(&self) -> usize {
        self.space.n_copies()
    }

    /// For every copy, the node of the mesh that it is a copy of.
    pub fn node_of_copy(&self) -> &[u32] {
        self.space.node_of_copy()
    }

    /// Material pieces of the tetrahedra of [`mesh`](Self::mesh). Ids are stable; cuts append.
    pub fn pieces(&self) -> &[Piece] {
        self.space.pieces()
    }

    /// ∫ N_a dV [m³] over piece `p`, for its four copies.
    pub fn piece_volumes(&self, p: usize) -> [f64; 4] {
        self.space.piece_volumes(p)
    }

    /// The piece of tetrahedron `tet` that holds the point with these barycentric coordinates.
    pub fn piece_at(&self, tet: u32, barycentric: [f64; 4]) -> u32 {
        self.space.piece_at(tet, barycentric)
    }

    /// Parts of the material that are connected through faces, and their rest volumes.
    pub fn components(&self) -> Components {
        self.space.components()
    }

    /// The material as tetrahedra that fill it without overlap, for export.
    pub fn solid(&self) -> Solid {
        self.space.solid()
    }

    /// Violations of the invariants of the cut state; beyond rounding there must be none, whatever was cut.
    pub fn flaws(&self) -> Flaws {
        self.space.flaws()
    }
}
