//! What an element adds to the tetrahedra of surface and contact: more nodes, other shape functions, other
//! faces.

use std::any::Any;
use std::fmt::Debug;

use nalgebra::Vector3;

use crate::assembly::{ElementKind, Model, ModelError, Volumetric};
use crate::cut::CutMesh;
use crate::element::Point;
use crate::material::Material;
use crate::mesh::TetMesh;
use crate::octree::Octree;

/// A finite element on the nodes of a tet mesh, with the data it needs beside that.
pub trait Element: Any + Debug + Send + Sync {
    /// The element's kind.
    fn kind(&self) -> ElementKind;

    /// Rest position [m] of every node: copies first, then the nodes that the element adds.
    fn rest_positions(&self, cut: &CutMesh) -> Vec<Vector3<f64>> {
        cut.rest_positions()
    }

    /// Number of nodes of the uncut body.
    fn n_nodes(&self, mesh: &TetMesh) -> usize {
        mesh.nodes.len()
    }

    /// Number of elements at rest.
    fn n_elements(&self, mesh: &TetMesh) -> usize {
        mesh.tets.len()
    }

    /// The element that contains piece `p`.
    fn element_of(&self, p: usize) -> usize {
        p
    }

    /// The discrete model in double precision.
    fn model(&self, cut: &CutMesh, material: &Material, how: Volumetric) -> Result<Model, ModelError>;

    /// ∫ N_a dA [m²] over the skin faces all of whose nodes are `selected`, by node.
    fn areas(&self, mesh: &TetMesh, selected: &[bool]) -> Vec<f64>;

    /// ∫ N_a dV [m³] of the `selected` nodes of the uncut body; 0 for the others.
    fn volumes(&self, mesh: &TetMesh, selected: &[bool]) -> Vec<f64>;

    /// Nodes and shape functions of the point with barycentric coordinates `weights` in tet `tet`, whose
    /// piece is on `copies`.
    fn carriers(&self, tet: u32, copies: [u32; 4], weights: [f64; 4]) -> Vec<(u32, f64)>;

    /// The elements as cells of an octree, numbered alike, if they are equal cubes; for the kernels of cells.
    fn cubes(&self) -> Option<Octree> {
        None
    }

    /// Calls `visit` with the nodes of every group that hangs together.
    fn for_groups(&self, cut: &CutMesh, visit: &mut dyn FnMut(&[u32])) {
        cut.pieces().iter().for_each(|piece| visit(&piece.copies));
    }

    /// Calls `visit` for every quadrature point with the nodes at `x` [m].
    fn for_points(&self, cut: &CutMesh, x: &[Vector3<f64>], visit: &mut dyn FnMut(Point<'_>));
}
