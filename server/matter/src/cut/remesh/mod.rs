//! Cutting along element faces, with nodes moved onto the sweep.
//!
//! This is the other way to cut a body: it changes the element mesh itself. The number of elements stays
//! nearly the same, and every element stays an ordinary one. By default four steps follow each other:
//!
//! 1. [`relocate`]: the sweep is intersected with the edges of the mesh. Nodes of crossed edges are moved onto the
//!    sweep, in the reference and in the deformed configuration at once, where the elements around stay well shaped.
//! 2. [`subdivide`]: elements are divided at crossed edges neither end of which could be moved. Faces with three nodes
//!    on the sweep form the cut surface.
//! 3. [`dissect`]: nodes are duplicated by the connected components of the elements around them.
//! 4. [`clean`]: degenerate elements are removed by splitting and collapsing edges.
//!
//! For comparisons, [`Moves::None`] and [`Moves::Press`] follow the source and divide no element. Every crossing marks the
//! nearer node of its edge, and faces whose three nodes are marked form the cut surface ([`select`]). Their nodes stay
//! where they are, or are moved even where that presses elements flat. [`SnapSettings`] leaves out step 4.
//!
//! Two baselines share the last steps: [`subdivide`] divides elements everywhere instead of moving nodes; [`remove`]
//! takes elements out.
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
//! Nienhuys 2003, *Cutting in deformable objects*, §3.2. Differences: elements are divided where no node can move well, as
//! in Steinemann, Harders, Gross, Székely 2006, *Hybrid cutting of deformable solids*. [`select`] only takes faces between
//! elements on different sides of the sweep, so the cut surface does not branch. Nodes on a curved skin move so that the
//! volume stays. Elements that cannot be collapsed are kept instead of removed.

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
