//! What is wrong with a mesh, what was repaired, and whether its size can be meant.

mod weld;
pub mod connectivity;
pub mod volume;
pub mod surface;
pub mod scale;
