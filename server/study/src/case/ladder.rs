//! Levels of refinement that lead to a reference: mesh and step are refined together.

use crate::design::Configuration;
use crate::design::axes::{Factor, Setting, step};

/// A sequence of levels.
#[derive(Debug, Clone)]
pub struct Ladder {
    /// Element, integrator, … of the runs; mesh and step are replaced.
    pub configuration: Configuration,
    /// Meshes, coarse to fine, whose size is the factor f. Empty if the mesh cannot be refined.
    pub meshes: Vec<Setting>,
    /// Frame [s] that is divided into steps; `None` for statics.
    pub step_s: Option<f64>,
    /// Element and integrator in words.
    pub words: String,
}

/// Most levels of a ladder that refines only the step.
const MOST_LEVELS: usize = 8;

impl Ladder {
    /// The run on mesh `mesh` with `n` steps per frame.
    pub fn at(&self, mesh: usize, n: u32) -> Configuration {
        let mut configuration = self.configuration.clone();
        if let Some(mesh) = self.meshes.get(mesh) {
            configuration = configuration.with(Factor::Mesh, mesh);
        }
        if let Some(step_s) = self.step_s {
            configuration = configuration.with(Factor::Step, &step(step_s / f64::from(n)));
        }
        configuration
    }

    /// Number of levels.
    pub fn levels(&self) -> usize {
        match (self.meshes.len(), self.step_s) {
            (0 | 1, None) => 1,
            (0 | 1, Some(_)) => MOST_LEVELS,
            (n, _) => n,
        }
    }

    /// Mesh and steps per frame of level `i`, with `n0` steps on the coarsest mesh.
    pub fn level(&self, i: usize, n0: u32) -> (usize, u32) {
        if self.meshes.len() < 2 {
            return (0, n0 << i);
        }
        let ratio = self.meshes[i].size / self.meshes[0].size;
        (i, ((f64::from(n0) * ratio).round() as u32).max(1))
    }

    /// Size h of a level: that of its elements, or of its step if the mesh stays the same.
    pub fn size(&self, i: usize, n0: u32) -> f64 {
        let (mesh, n) = self.level(i, n0);
        if self.meshes.len() < 2 { 1.0 / f64::from(n) } else { 1.0 / self.meshes[mesh].size }
    }
}
