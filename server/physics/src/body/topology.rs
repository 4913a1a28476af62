//! Queries of a body's discretisation: elements, pieces, copies, parts, rest positions.
//!
//! Nothing outside this crate reads the state of the cuts itself, so another discretisation could answer
//! the same queries.

use nalgebra::Vector3;

use super::Body;
use crate::assembly::ElementKind;
use crate::cut::{Components, Flaws, Piece, Solid};
use crate::mesh::TetMesh;

impl Body {
    /// Topology epoch; rises with every cut that changes the surface and with every reset.
    pub fn epoch(&self) -> u32 {
        self.cut_mesh.epoch()
    }

    /// The tetrahedra at rest that are cut and drawn: the elements, or six tets for every hexahedron.
    /// Only cuts along faces change them.
    pub fn mesh(&self) -> &TetMesh {
        self.cut_mesh.mesh()
    }

    /// Box around the body at rest, lower and upper corner [m].
    pub fn bounds(&self) -> [Vector3<f64>; 2] {
        self.cut_mesh.mesh().bounds()
    }

    /// Volume at rest [m³].
    pub fn rest_volume(&self) -> f64 {
        self.cut_mesh.copy_volume().iter().sum()
    }

    /// Finite elements of the uncut body.
    pub fn n_elements(&self) -> usize {
        self.shape.n_elements(self.cut_mesh.mesh())
    }

    /// Number of pieces that cuts made of the elements; that of the elements in a body that cannot be cut.
    pub fn n_pieces(&self) -> usize {
        match self.shape.kind() {
            ElementKind::Tet4 => self.cut_mesh.pieces().len(),
            _ => self.n_elements(),
        }
    }

    /// Number of nodes of the uncut body, including those that quadratic elements add.
    pub fn n_nodes(&self) -> usize {
        self.rest.len() + self.cut_mesh.mesh().nodes.len() - self.cut_mesh.n_copies()
    }

    /// Number of copies of the mesh's nodes, without the nodes that quadratic elements add. Each copy has
    /// its own degrees of freedom.
    pub fn n_copies(&self) -> usize {
        self.cut_mesh.n_copies()
    }

    /// For every copy, the node of the mesh that it is a copy of.
    pub fn node_of_copy(&self) -> &[u32] {
        self.cut_mesh.copy_node()
    }

    /// Material pieces of the tetrahedra of [`mesh`](Self::mesh). Ids are stable; cuts append.
    pub fn pieces(&self) -> &[Piece] {
        self.cut_mesh.pieces()
    }

    /// ∫ N_a dV [m³] over piece `p`, for its four copies.
    pub fn piece_volumes(&self, p: usize) -> [f64; 4] {
        self.cut_mesh.piece_node_volume(p)
    }

    /// The piece of tetrahedron `tet` that holds the point with these barycentric coordinates.
    pub fn piece_at(&self, tet: u32, barycentric: [f64; 4]) -> u32 {
        self.cut_mesh.piece_at(tet, barycentric)
    }

    /// Parts of the material that are connected through faces, and their rest volumes.
    pub fn components(&self) -> Components {
        self.cut_mesh.components()
    }

    /// The material as tetrahedra that fill it without overlap, for export.
    pub fn solid(&self) -> Solid {
        self.cut_mesh.solid()
    }

    /// Violations of the invariants of the cut state; beyond rounding there must be none, whatever was cut.
    pub fn flaws(&self) -> Flaws {
        Flaws::of(&self.cut_mesh)
    }
}
