//! Cutting: material pieces inside the elements, node copies that follow from connectivity, and
//! the surface in between.
//!
//! A cut never edits the element mesh. Three layers follow from each other, each a pure function of
//! the one before:
//!
//! 1. [`fragments`]: a conforming tet mesh *inside* the elements, at first one fragment per element,
//!    refined by bisecting edges where a blade crosses them. Cut faces are opened here and nowhere
//!    else.
//! 2. [`pieces`]: the face-connected components of the fragments of one element. A linear element
//!    has a constant deformation gradient per piece, so mechanics needs only its volume fraction.
//! 3. [`copies`]: the components of the pieces around a node. Each is one set of degrees of freedom.
//!
//! Crack fronts, branches, crossings and re-cuts need no case analysis: they are what connectivity
//! says they are.
//!
//! # Limit
//! Between the edges it crosses a sheet is flat, so a bend inside an element is cut off by a chord. A
//! branch that is to come off another incision's bend begins a little before it, as a blade does that
//! reaches into the wound; one that begins exactly there may end before the lip. Vertices at bends would
//! mend that, but a blade that trembles bends all the time.
//!
//! # Source
//! Molino, Bao, Fedkiw 2004; Sifakis, Der, Fedkiw 2007; Wang, Jiang, Schroeder, Teran 2014 (virtual
//! nodes). Jeřábková 2007 ch. 3 (the same space seen as an enrichment).

mod blade;
mod incision_sets;
mod crossings;
mod marks;
mod slot;
pub(crate) mod fragments;
pub(crate) mod traces;
mod sweep_triangle;
mod front;
mod swept_area;
pub(crate) mod pieces;
mod copies;
mod surface;
mod pending;
mod runs;
mod detect;
mod separate;
mod doubled_edges;
pub(crate) mod joined;
mod surface_builder;
mod components;
mod locate;
mod cut_mesh;
mod incision_mark;
mod solid;
mod flaws;

pub use blade::{BladeSweep, CutError, CutLimits, CutReport, MAX_SEGMENTS, NewCopy, Work};
pub use components::Components;
pub use cut_mesh::{CutMesh, SweepUnderWay};
pub use flaws::Flaws;
pub(crate) use front::{Front, Surroundings, sweep_triangles};
pub use incision_mark::{IncisionMark, MarkPoint};
pub use pending::PendingFace;
pub use pieces::Piece;
pub use solid::Solid;
pub use surface::{Surface, SurfaceVertex};
pub(crate) use sweep_triangle::SweepTriangle;
pub use swept_area::swept_area;

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;
