//! Faults of a mesh, their repair, and the plausibility of its size.

mod weld;
pub mod connectivity;
pub mod volume;
pub mod surface;
pub mod scale;
