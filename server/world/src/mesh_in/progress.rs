//! Progress reports of mesh generation.

use super::estimate::MeshEstimate;

/// Progress of mesh generation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Meshing {
    /// Name of the present stage.
    pub stage: &'static str,
    /// Share of the whole work done, 0 to 1.
    pub done: f64,
    /// Estimated size and cost of the whole mesh.
    pub estimate: MeshEstimate,
}

/// Receives progress reports, possibly from several threads.
pub type Observer<'a> = dyn Fn(Meshing) + Sync + 'a;
