//! Cutting along element faces with nodes moved onto the sweep.
//!
//! The other way to cut a body: the element mesh itself is changed, so that the number of elements
//! stays nearly the same and every element stays a plain one. Four actions in sequence:
//!
//! 1. [`select`]: the sweep is intersected with the edges of the mesh, each crossing marks the nearer
//!    node, and faces whose three nodes are marked form the cut surface.
//! 2. [`relocate`]: nodes of the cut surface are moved onto the sweep, in the reference and in the
//!    deformed configuration at once.
//! 3. [`dissect`]: nodes are duplicated by the connected components of the elements around them.
//! 4. [`clean`]: degenerate elements are removed by splitting and collapsing edges.
//!
//! [`Snapper`] runs them and remembers, per incision, what a sweep has crossed but not yet cut.
//!
//! # Invariants
//! The volume, hence the mass, is that of the body before; no element is inverted by a cut; an
//! element may become flat, never flatter than [`relocate::LEAST_ASPECT`] by a node that moved.
//! Signs are exact and lengths are only ever compared with lengths: the same cut in millimetres
//! and in metres gives the same mesh.
//!
//! # Source
//! Nienhuys 2003, *Cutting in deformable objects*, §3.2. What is different here: faces are selected
//! only between elements on different sides of the sweep, so that the cut surface does not branch;
//! nodes on a curved skin move so that the volume stays; a node whose move would nearly invert an
//! element stays where it is; elements that cannot be collapsed are kept instead of removed.

pub mod node;
pub mod complex;
pub mod memory;
pub mod select;
pub mod relocate;
pub mod dissect;
pub mod shape;
pub mod collapse;
pub mod clean;
mod snapper;

pub use node::SnapNode;
pub use snapper::{SnapCut, SnapReport, Snapper};

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;
