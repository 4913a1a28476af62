//! Cutting: material pieces inside the elements, node copies that follow from connectivity, and
//! the surface in between.
//!
//! Such a cut never edits the element mesh; a cut that does is in [`remesh`]. Three layers follow from each
//! other, each a pure function of the one before:
//!
//! 1. [`fragments`](topology::fragments): a conforming tet mesh *inside* the elements, at first one fragment
//!    per element, refined by bisecting edges where a blade crosses them. Cut faces are opened only here.
//! 2. [`pieces`](topology::pieces): the face-connected components of the fragments of one element. A linear
//!    element has a constant deformation gradient per piece, so mechanics needs only its volume fraction; a quadratic
//!    one needs its second moments too.
//! 3. [`copies`](topology::copies): the components of the pieces around a node. Each is one set of degrees of
//!    freedom. Mid-edge nodes of quadratic elements have theirs from the pieces around the edge ([`middles`]).
//!
//! Crack fronts, branches, crossings and repeated cuts need no case analysis: they follow from the
//! connectivity.
//!
//! # Limit
//! A sheet is flat between the edges it crosses, so a bend inside an element is cut off by a chord. A branch
//! that is to leave another incision at its bend must begin a little before the bend, like a blade that
//! reaches into the wound. A branch that begins exactly at the bend may end before the lip. Vertices at bends
//! would cure that, but a trembling blade bends all the time.
//!
//! # Source
//! Molino, Bao, Fedkiw 2004; Sifakis, Der, Fedkiw 2007; Wang, Jiang, Schroeder, Teran 2014 (virtual
//! nodes). Jeřábková 2007 ch. 3 (the same space seen as an enrichment).

pub(crate) mod topology;
pub(crate) mod drawn;
pub(crate) mod shell;
mod sweep;
mod cut_mesh;
pub mod remesh;
pub mod middles;
mod incision_mark;
mod solid;
mod flaws;

pub(crate) use cut_mesh::sweep_bounds;
pub use cut_mesh::{CutMesh, SweepUnderWay};
pub use drawn::pending::PendingFace;
pub use flaws::Flaws;
pub use incision_mark::{IncisionMark, MarkPoint};
pub use shell::surface::Surface;
pub use solid::{Solid, SolidCells, SolidOrigin};
pub use sweep::blade::{BladeSweep, CutError, CutLimits, CutReport, MAX_SEGMENTS, Work};
pub(crate) use sweep::borders::bounds;
pub use sweep::borders::{Borders, Edge as BorderEdge, JoinSizes, edges as border_edges};
pub use sweep::front::{Front, Surroundings, sweep_from_behind, sweep_triangles};
pub use sweep::front_elements::FrontRule;
pub(crate) use sweep::sweep_triangle::SweepTriangle;
pub use sweep::swept_area::swept_area;
pub use topology::components::Components;
pub use topology::copies::NewCopy;
pub(crate) use topology::elements_around::ElementsAround;
pub use topology::pieces::Piece;

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;
