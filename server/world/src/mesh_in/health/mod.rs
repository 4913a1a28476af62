//! Faults of a mesh, their repair, and the plausibility of its size.

mod weld;
pub(super) mod connectivity;
pub(super) mod volume;
pub(super) mod surface;
pub(super) mod scale;
