//! The border between a discretisation and everything that computes with it.
//!
//! A [`Space`] divides the material into elements, cuts it, and shows its surface. Above it stand the
//! stiffness, the solvers, the integrators and the body, which do not know what the elements are.

mod element;
mod hexahedra;
mod linear_tets;
mod quadratic_tets;
mod tets;

pub use element::Element;
pub use hexahedra::Hexahedra;
pub use linear_tets::LinearTets;
pub use quadratic_tets::QuadraticTets;
pub use tets::Tets;

use nalgebra::Vector3;

use crate::assembly::{ElementKind, Model, ModelError, Volumetric};
use crate::cut::{
    BladeSweep, Components, CutError, CutReport, Flaws, IncisionMark, Piece, Solid, Surface, Work,
};
use crate::element::Points;
use crate::material::Material;
use crate::mesh::{MeshError, TetMesh};
use crate::operator::{StiffModes, Stiffness};
use crate::skin::{Skin, SkinError, SkinSettings, SkinShape};
use crate::snap::{Nodes, SnapCut, SnapReport, Snapper};

/// What a discretisation offers a body. Its functions are called once per phase of a step or per cut, never
/// per element.
///
/// A *node* of the uncut body has one *copy* at first, and more once cuts run around it. Copies 0..n are those
/// of the uncut body; further ones are appended, and a reset removes them. Copies come before the nodes that
/// elements of higher order add.
pub trait Space: Points + Send {
    /// The finite element.
    fn kind(&self) -> ElementKind;

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

    /// ∫ N_a dA [m²] over the skin faces all of whose nodes are `selected`, by node of the uncut body.
    fn areas(&self, selected: &[bool]) -> Vec<f64>;

    /// ∫ N_a dV [m³] of the `selected` nodes of the uncut body; 0 for the others.
    fn volumes(&self, selected: &[bool]) -> Vec<f64>;

    /// The tetrahedra at rest that are cut and drawn.
    fn mesh(&self) -> &TetMesh;

    /// Material pieces of the tetrahedra of [`mesh`](Self::mesh). The copies of a piece hang together. Ids are
    /// stable; cuts append.
    fn pieces(&self) -> &[Piece];

    /// Calls `visit` with the nodes of every group that hangs together: a piece, or an element.
    fn for_groups(&self, visit: &mut dyn FnMut(&[u32]));

    /// Whether the last cut split, created or renumbered anything that hangs together.
    fn has_changed(&self) -> bool;

    /// Calls `visit` with the copies of every group that the last cut split, created or gave other copies.
    fn for_changed_groups(&self, visit: &mut dyn FnMut(&[u32]));

    /// Calls `visit` with the copies of every group that contains `copy`, and maybe of others at its node.
    fn for_groups_around(&self, copy: u32, visit: &mut dyn FnMut(&[u32]));

    /// ∫ N_a dV [m³] over piece `p`, for its four copies.
    fn piece_volumes(&self, p: usize) -> [f64; 4];

    /// The finite element that contains piece `p`.
    fn element_of(&self, p: usize) -> usize;

    /// The piece of tetrahedron `tet` that holds the point with these barycentric coordinates.
    fn piece_at(&self, tet: u32, barycentric: [f64; 4]) -> u32;

    /// Nodes and shape functions (Σ = 1) of the point with barycentric coordinates `weights` in tetrahedron
    /// `tet`, whose piece is on `copies`.
    fn carriers(&self, tet: u32, copies: [u32; 4], weights: [f64; 4]) -> Vec<(u32, f64)>;

    /// Parts of the material that are connected through faces, and their rest volumes.
    fn components(&self) -> Components;

    /// The material as tetrahedra that fill it without overlap, for export.
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

    /// Puts a skin finer than the elements on the uncut body.
    fn put_on_skin(&mut self, settings: SkinSettings, shape: &mut SkinShape<'_>) -> Result<(), SkinError>;

    /// See [`Skin::spoil`].
    #[doc(hidden)]
    fn spoil_skin(&mut self);

    /// Cuts along the surface that the blade swept, with the copies at `x` [m].
    fn cut(&mut self, x: &[Vector3<f64>], blade: &BladeSweep, incision: u32) -> Result<CutReport, CutError>;

    /// Begins a cut with the copies at `x` [m]; [`go_on_cutting`](Self::go_on_cutting) makes it in parts.
    fn begin_cut(&mut self, x: &[Vector3<f64>], blade: &BladeSweep, incision: u32) -> Result<(), CutError>;

    /// Continues the cut that was begun until `work` is used up. Returns the report when it is complete;
    /// `None` before that, and if no cut was begun.
    fn go_on_cutting(&mut self, work: &mut Work) -> Option<CutReport>;

    /// Whether a cut was begun and is not complete.
    fn is_being_cut(&self) -> bool;

    /// Finds the mesh that a cut along its faces makes of this one, for `snapper` and the state of its nodes;
    /// `None` if nothing comes apart yet. The mesh itself stays.
    fn cut_along_faces(
        &mut self,
        snapper: &mut Snapper,
        nodes: Nodes<'_>,
        blade: &BladeSweep,
        incision: u32,
    ) -> Result<(SnapReport, Option<SnapCut>), CutError>;

    /// Undoes all cuts and drops one under way. The epoch keeps rising.
    fn reset(&mut self) -> Result<(), MeshError>;

    /// A copy without a cut under way.
    fn boxed_clone(&self) -> Box<dyn Space>;

    /// The stiffness of the elements for solvers in single precision; `None` if there is no such kernel for
    /// these elements. `portable` uses only instructions that every machine has.
    fn stiffness(&self, portable: bool) -> Option<Box<dyn Stiffness>>;

    /// Brings the stiffness that this space made up to date after the last cut. Earlier pieces keep their
    /// rotations.
    fn follow_stiffness(&self, stiffness: &mut dyn Stiffness);

    /// Stiff motions of degenerate elements, as these are cut now; `None` if there are none.
    fn stiff_modes(&self) -> Option<StiffModes>;

    /// The discrete model in double precision, for any law.
    fn model(&self, material: &Material, volumetric: Volumetric) -> Result<Model, ModelError>;

    /// Brings the model of this space up to date after the last cut.
    fn follow_model(&self, model: &mut Model, material: &Material);
}
