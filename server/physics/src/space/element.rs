//! What an element adds to the tetrahedra of surface and contact: more nodes, other shape functions, other
//! faces.

use std::any::Any;
use std::fmt::Debug;
use std::sync::Arc;

use nalgebra::Vector3;
use scindo_algebra::assembly::{Model, ModelError, Volumetric};
use scindo_algebra::operator::StiffModes;
use scindo_matter::cut::{CutMesh, NewCopy};
use scindo_matter::element::ElementKind;
use scindo_matter::element::{MaterialPoint, Point};
use scindo_matter::material::{Material, Regions};
use scindo_matter::mesh::TetMesh;
use scindo_matter::octree::Octree;
use smallvec::SmallVec;

/// A shape function below this is that of a node beside the face; the rest is rounding.
const BESIDE: f64 = 1e-12;

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

    /// Number of nodes that the element adds, their copies included. They are numbered after all copies of the mesh's
    /// nodes.
    fn n_added(&self) -> usize {
        0
    }

    /// The node of the uncut body that entry `added` of the added nodes is a copy of.
    fn node_of_added(&self, added: usize) -> u32 {
        added as u32
    }

    /// Which of the added nodes are copies of `node` whose material contains its place, ascending.
    fn added_with_node(&self, cut: &CutMesh, node: u32) -> Vec<u32> {
        let _ = (cut, node);
        Vec::new()
    }

    /// ∫ N_a dV [m³] of the added nodes.
    fn added_volumes(&self) -> &[f64] {
        &[]
    }

    /// Motions for which the preconditioner needs other variables than the displacements; linear tetrahedra have theirs
    /// from the mesh.
    fn modes(&self, cut: &CutMesh) -> Option<StiffModes> {
        let _ = cut;
        None
    }

    /// The element after the last cut of `cut` and the added nodes that the cut made; `None` if it adds no nodes.
    fn follow_cut(&self, cut: &CutMesh) -> Option<(Arc<dyn Element>, Vec<NewCopy>)> {
        let _ = cut;
        None
    }

    /// The element after a reset of `cut`; `None` if it adds no nodes.
    fn uncut(&self, cut: &CutMesh) -> Option<Arc<dyn Element>> {
        let _ = cut;
        None
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

    /// Brings `model` up to date with the pieces of `cut`, whose materials are those of `regions`. Linear tetrahedra are
    /// followed by the model itself.
    fn follow_model(&self, model: &mut Model, cut: &CutMesh, regions: Regions) {
        let _ = (model, cut, regions);
    }

    /// ∫ N_a dA [m²] over the skin faces all of whose nodes are `selected`, by node.
    fn areas(&self, mesh: &TetMesh, selected: &[bool]) -> Vec<f64>;

    /// Calls `visit` for the faces of the skin; see [`Space::for_skin_faces`](super::Space::for_skin_faces). `is_chosen`
    /// tells whether the node of a copy or added node is selected.
    fn for_skin_faces(
        &self,
        cut: &CutMesh,
        is_chosen: &dyn Fn(u32) -> bool,
        visit: &mut dyn FnMut(&[MaterialPoint]),
    ) {
        for p in 0..cut.pieces().len() {
            for corners in cut.skin_fragments(p) {
                let middles = [[0, 1], [1, 2], [2, 0]]
                    .map(|[a, b]| std::array::from_fn(|i| 0.5 * (corners[a][i] + corners[b][i])));
                let quadratic = self.kind() == ElementKind::Tet10;
                let weights = corners.into_iter().chain(middles).take(if quadratic { 6 } else { 3 });
                let bound = |weights| {
                    let carriers = self.carriers(cut, p as u32, weights).into_iter();
                    MaterialPoint::new(carriers.filter(|(_, w)| w.abs() > BESIDE))
                };
                let points: SmallVec<[MaterialPoint; 6]> = weights.map(bound).collect();
                if points.iter().all(|point| point.copies().iter().all(|&copy| is_chosen(copy))) {
                    visit(&points);
                }
            }
        }
    }

    /// ∫ N_a dV [m³] of the `selected` nodes of the uncut body; 0 for the others.
    fn volumes(&self, mesh: &TetMesh, selected: &[bool]) -> Vec<f64>;

    /// Nodes and shape functions of the point of `piece` with barycentric coordinates `weights` in its tetrahedron.
    fn carriers(&self, cut: &CutMesh, piece: u32, weights: [f64; 4]) -> Vec<(u32, f64)>;

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
