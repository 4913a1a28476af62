//! The border between a discretisation and everything that computes with it.
//!
//! A [`Space`] divides the material into elements, cuts it, and shows its surface. Above it stand the
//! stiffness, the solvers, the integrators and the body, which do not know what the elements are.

pub(crate) mod deepest;
mod cells;
mod element;
mod hexahedra;
mod linear_tets;
mod quadratic_tets;
mod rest_point;
mod tets;

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod quadratic_tests;

pub use cells::{OctreeRefinement, OctreeSpace};
pub use element::Element;
pub use hexahedra::Hexahedra;
pub use linear_tets::LinearTets;
pub use quadratic_tets::QuadraticTets;
pub use rest_point::RestPoint;
pub use tets::Tets;

use std::any::Any;
use std::sync::Arc;

use nalgebra::Vector3;

use scindo_algebra::assembly::{Model, ModelError, Volumetric};
use scindo_algebra::operator::{StiffModes, Stiffness};
use scindo_algebra::solver::multigrid::Hierarchy;
use scindo_matter::cut::{
    BladeSweep, Components, CutError, CutReport, Flaws, IncisionMark, Solid, Surface, Work,
};
use scindo_matter::element::ElementKind;
use scindo_matter::element::{MaterialPoint, Points, Simd};
use scindo_matter::material::Material;
use scindo_matter::mesh::MeshError;
use scindo_matter::skin::{Kept, OwnSurface, Skin, SkinError, SkinSettings, SkinShape};
use scindo_matter::storage::saved::saved_as;
use scindo_matter::team::Team;

saved_as!(saved_space, Box, Space, Tets(Tets), Octree(OctreeSpace));
saved_as!(saved_element, Arc, Element, Linear(LinearTets), Quadratic(QuadraticTets), Hexahedra(Hexahedra));

/// What is called for a piece: with its element, its copies, and ∫ N_a dV [m³] over it for each of them.
pub type VisitPiece<'a> = dyn FnMut(usize, &[u32], &[f64]) + 'a;

/// What a discretisation offers a body. Its functions are called once per phase of a step or per cut, never
/// per element.
///
/// A *node* of the uncut body has one *copy* at first, and more once cuts run around it. Copies 0..n are those
/// of the uncut body; further ones are appended, and a reset removes them. Coarsening of an
/// [octree](Self::octree_mut), and nothing else, removes some of the further ones, and the others close up. Copies
/// come before the nodes that elements of higher order add.
pub trait Space: Any + Points + Send + Sync {
    /// The finite element.
    fn kind(&self) -> ElementKind;

    /// The finite element in the words of messages, e.g. "element tet10".
    fn name(&self) -> &'static str {
        self.kind().name()
    }

    /// Whether [`cut`](Self::cut) and [`begin_cut`](Self::begin_cut) open it.
    fn can_be_cut(&self) -> bool;

    /// Whether [`put_on_skin`](Self::put_on_skin) can give it a skin, of triangles of its `own` or divided.
    fn can_carry_skin(&self, own: bool) -> bool;

    /// What a skin of triangles of its own lies on, of the uncut body: vertices [m] and triangles, counter-clockwise seen
    /// from outside. Empty if it can have none.
    fn skin_ground(&self) -> (Vec<Vector3<f64>>, Vec<[u32; 3]>) {
        Default::default()
    }

    /// The tetrahedra with their mesh and pieces, if it consists of them.
    fn tets(&self) -> Option<&Tets> {
        None
    }

    /// The same, for cuts along faces, which replace the mesh.
    fn tets_mut(&mut self) -> Option<&mut Tets> {
        None
    }

    /// The octree, if it consists of cubical cells.
    fn octree(&self) -> Option<&OctreeSpace> {
        None
    }

    /// The same, for refinement and coarsening. Vertices that refinement made may vanish again, and later ones
    /// then close up; those of the uncut body keep their numbers.
    fn octree_mut(&mut self) -> Option<&mut OctreeSpace> {
        None
    }

    /// Box around it at rest, lower and upper corner [m].
    fn bounds(&self) -> [Vector3<f64>; 2];

    /// Side of a typical element at rest [m]: of the finest cells, or of a cube that consists of six
    /// tetrahedra of mean volume.
    fn element_size(&self) -> f64;

    /// Number of finite elements of the uncut body.
    fn n_elements(&self) -> usize;

    /// Number of nodes of the uncut body, including those that elements of higher order add.
    fn n_nodes(&self) -> usize;

    /// Number of copies, without the nodes that elements of higher order add.
    fn n_copies(&self) -> usize {
        self.node_of_copy().len()
    }

    /// For every copy the node that it is a copy of.
    fn node_of_copy(&self) -> &[u32];

    /// Number of nodes that elements of higher order add, their copies included.
    fn n_added(&self) -> usize {
        0
    }

    /// The node of the uncut body that a copy or an added node is a copy of.
    fn node_of(&self, number: u32) -> u32 {
        self.node_of_copy().get(number as usize).copied().unwrap_or(number)
    }

    /// The number of the copy that a node of the uncut body keeps when it is split; it may change with every cut of
    /// elements that add nodes.
    fn first_copy(&self, node: u32) -> u32 {
        node
    }

    /// ∫ N_a dV [m³] of the added nodes.
    fn added_volumes(&self) -> &[f64] {
        &[]
    }

    /// The copies whose material contains `node` itself, ascending. There is one, or more where a cut passes
    /// exactly through the node.
    fn copies_with_node(&self, node: u32) -> Vec<u32>;

    /// Rest position of every copy and added node [m].
    fn rest_positions(&self) -> Vec<Vector3<f64>>;

    /// ∫ N_a dV of every copy [m³].
    fn copy_volumes(&self) -> &[f64];

    /// ∫ ρ N_a dV of every copy [kg] in a body of this density; regions may have others.
    fn copy_masses(&self, density_kg_m3: f64) -> Vec<f64> {
        self.copy_volumes().iter().map(|v| density_kg_m3 * v).collect()
    }

    /// The copies whose mass the last change may have changed, where it was a cut that left the numbers and the masses of
    /// all others, and the mass of a copy is the density times its [volume](Self::copy_volumes).
    fn reweighed(&self) -> Option<&[u32]> {
        None
    }

    /// ∫ N_a dA [m²] over the skin faces all of whose nodes are `selected`, by node of the uncut body.
    fn areas(&self, selected: &[bool]) -> Vec<f64>;

    /// Calls `visit` for every face of the skin all of whose nodes are `selected`, by node of the uncut body, as it is cut
    /// now. The points are those of [`Pressure::add_face`](scindo_algebra::assembly::pressure::Pressure::add_face). The faces of a
    /// cut face are its parts; lips of cuts are not skin. Without such faces a body takes no pressure.
    fn for_skin_faces(&self, _selected: &[bool], _visit: &mut dyn FnMut(&[MaterialPoint])) {}

    /// ∫ N_a dV [m³] of the `selected` nodes of the uncut body; 0 for the others.
    fn volumes(&self, selected: &[bool]) -> Vec<f64>;

    /// Number of pieces that cuts made of the elements; that of the elements if these are not cut themselves.
    fn n_pieces(&self) -> usize {
        self.n_elements()
    }

    /// Calls `visit` for every part that fills the volume without overlap and moves with its own copies: the
    /// [element](scindo_matter::element::Point::element) of its quadrature points, its copies, and ∫ N_a dV [m³]
    /// over it for each of them.
    fn for_pieces(&self, visit: &mut VisitPiece<'_>);

    /// Calls `visit` with the nodes of every group that hangs together: a piece, or an element.
    fn for_groups(&self, visit: &mut dyn FnMut(&[u32]));

    /// Whether the last cut split, created or renumbered anything that hangs together.
    fn has_changed(&self) -> bool;

    /// Calls `visit` with the copies of every group that the last cut split, created or gave other copies.
    fn for_changed_groups(&self, visit: &mut dyn FnMut(&[u32]));

    /// Calls `visit` with the copies of every group that contains `copy`, and maybe of others at its node.
    fn for_groups_around(&self, copy: u32, visit: &mut dyn FnMut(&[u32]));

    /// Finds a material point by its rest position [m]. If it lies on a cut or between elements, `side` points
    /// to the side that it belongs to. `None` outside the body.
    fn locate(&self, point: Vector3<f64>, side: Option<Vector3<f64>>) -> Option<RestPoint>;

    /// Finds the material points at `points` [m] with the copies at `x` [m]: each in the piece in which it lies
    /// deepest, `None` outside the body. Not to be called while a cut is under way. Spaces that cannot be cut find
    /// nothing.
    fn material_at(
        &mut self,
        _x: &[Vector3<f64>],
        points: &[Vector3<f64>],
        found: &mut Vec<Option<MaterialPoint>>,
    ) {
        found.clear();
        found.resize(points.len(), None);
    }

    /// Nodes and shape functions (Σ = 1) that carry a material point in the present cut state.
    fn carriers(&self, point: &RestPoint) -> Vec<(u32, f64)>;

    /// Parts of the material that are connected through faces, and their rest volumes.
    fn components(&self) -> Components;

    /// The material as tetrahedra or hexahedra that fill it without overlap, for export.
    fn solid(&self) -> Solid;

    /// Violations of the invariants of the cut state; beyond rounding there must be none.
    fn flaws(&self) -> Flaws;

    /// Topology epoch: rises whenever the topology or its surface changes.
    fn epoch(&self) -> u32;

    /// Sets the epoch, when the surface changed without a cut.
    fn set_epoch(&mut self, epoch: u32);

    /// The surface that is shown and touched, closed and 2-manifold.
    fn surface(&self) -> &Surface;

    /// The boundary of the elements and the lips of cuts, whatever skin is shown.
    fn element_surface(&self) -> &Surface;

    /// Lines that incisions have drawn on the surface without opening it yet.
    fn incision_marks(&self) -> Vec<IncisionMark>;

    /// The skin, if there is one.
    fn skin(&self) -> Option<&Skin>;

    /// How much of its own surface the skin consists of, if it has one.
    fn kept(&self) -> Option<Kept> {
        self.skin().and_then(Skin::kept)
    }

    /// Puts a skin finer than the elements on the uncut body.
    fn put_on_skin(
        &mut self,
        settings: SkinSettings,
        own: Option<&OwnSurface<'_>>,
        shape: &mut SkinShape<'_>,
    ) -> Result<(), SkinError>;

    /// See [`Skin::spoil`].
    #[doc(hidden)]
    fn spoil_skin(&mut self);

    /// Area [m²] of the sweep inside the material with the copies at `x` [m]. Parts that are already cut count too.
    fn swept_area(&self, x: &[Vector3<f64>], blade: &BladeSweep) -> f64;

    /// Cuts along the surface that the blade swept, with the copies at `x` [m].
    fn cut(
        &mut self,
        team: &mut Team,
        x: &[Vector3<f64>],
        blade: &BladeSweep,
        incision: u32,
    ) -> Result<CutReport, CutError>;

    /// Begins a cut with the copies at `x` [m]; [`go_on_cutting`](Self::go_on_cutting) makes it in parts.
    fn begin_cut(
        &mut self,
        team: &mut Team,
        x: &[Vector3<f64>],
        blade: &BladeSweep,
        incision: u32,
    ) -> Result<(), CutError>;

    /// Continues the cut that was begun until `work` is used up. Returns the report when it is complete;
    /// `None` before that, and if no cut was begun.
    fn go_on_cutting(&mut self, team: &mut Team, work: &mut Work) -> Option<CutReport>;

    /// Whether a cut was begun and is not complete.
    fn is_being_cut(&self) -> bool;

    /// Undoes all cuts and drops one under way. The epoch keeps rising.
    fn reset(&mut self) -> Result<(), MeshError>;

    /// A copy without a cut under way.
    fn boxed_clone(&self) -> Box<dyn Space>;

    /// Estimated memory of such a copy [byte], within a factor of about two.
    fn bytes(&self) -> usize;

    /// The stiffness of the elements for solvers in single precision; `None` if there is no such kernel for
    /// these elements. Its kernels use the instructions `simd`, as far as the machine has them.
    fn stiffness(&self, simd: Simd) -> Option<Box<dyn Stiffness>>;

    /// Whether the elements are equal cubes without being cells of an octree, so that kernels of cells take them.
    fn is_of_cubes(&self) -> bool {
        false
    }

    /// Brings the stiffness that this space made up to date after the last cut. Earlier pieces keep their
    /// rotations.
    fn follow_stiffness(&self, stiffness: &mut dyn Stiffness);

    /// The levels for multigrid on the elements as they are cut now, with a level `least` if the body is wide enough
    /// for it; `None` if there are none.
    fn hierarchy(&self, least: usize) -> Option<Hierarchy> {
        let _ = least;
        None
    }

    /// Stiff motions of degenerate elements, as these are cut now; `None` if there are none.
    fn stiff_modes(&self) -> Option<StiffModes>;

    /// The discrete model in double precision, for any law.
    fn model(&self, material: &Material, volumetric: Volumetric) -> Result<Model, ModelError>;

    /// Brings the model of this space up to date after the last cut.
    fn follow_model(&self, model: &mut Model, material: &Material);
}
