//! What is told while a mesh is made.

use super::estimate::MeshEstimate;

/// How far the making of a mesh has come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Meshing {
    /// What is done now.
    pub stage: &'static str,
    /// Share of the whole that is done, 0 to 1.
    pub done: f64,
    /// What it will take altogether.
    pub estimate: MeshEstimate,
}

/// Hears how far the making of a mesh has come; from several threads.
pub type Observer<'a> = dyn Fn(Meshing) + Sync + 'a;
