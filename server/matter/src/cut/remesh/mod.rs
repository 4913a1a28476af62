//! Cutting along element faces, with nodes moved onto the sweep.
//!
//! This is the other way to cut a body: it changes the element mesh itself. The number of elements stays
//! nearly the same, and every element stays an ordinary one. Four steps in sequence:
//!
//! 1. [`select`]: the sweep is intersected with the edges of the mesh, each crossing marks the nearer
//!    node, and faces whose three nodes are marked form the cut surface.
//! 2. [`relocate`]: nodes of the cut surface are moved onto the sweep, in the reference and in the
//!    deformed configuration at once.
//! 3. [`dissect`]: nodes are duplicated by the connected components of the elements around them.
//! 4. [`clean`]: degenerate elements are removed by splitting and collapsing edges.
//!
//! [`SnapSettings`] leaves out 2, 4 or both, for comparisons.
//!
//! Two baselines share the last steps: [`subdivide`] divides elements where the sweep parts them, in place of 1, 2 and 4;
//! [`remove`] takes elements out.
//!
//! [`Snapper`] runs them. Per incision it remembers what a sweep has crossed but not cut yet. It searches where
//! a cut inside the elements does too, and copies only what it changes of the mesh.
//!
//! # Invariants
//! A cut keeps the volume, hence the mass, unless it removes elements, and inverts no element. An element may become flat, but a moved
//! node never makes it flatter than [`relocate::LEAST_ASPECT`]. Signs are exact and lengths are only compared
//! with lengths, so the same cut in millimetres and in metres gives the same mesh.
//!
//! # Source
//! Nienhuys 2003, *Cutting in deformable objects*, §3.2. Four things differ here. Faces are selected only
//! between elements on different sides of the sweep, so the cut surface does not branch. Nodes on a curved
//! skin move so that the volume stays. A node whose move would nearly invert an element stays where it is.
//! Elements that cannot be collapsed are kept instead of removed.

pub mod node;
mod paged;
pub mod complex;
pub mod memory;
pub mod select;
pub mod relocate;
pub mod dissect;
pub mod shape;
pub mod collapse;
pub mod clean;
pub mod subdivide;
pub mod remove;
mod snapper;

pub use node::{Nodes, SnapNode};
pub use relocate::Moves;
pub use snapper::{MeshCut, SnapCut, SnapReport, SnapSettings, Snapper};

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;
