//! What a case is, and where its right answer comes from.

use scindo_world::scene::Scene;

use super::ladder::Ladder;
use crate::design::axes::{Axis, Factor, Setting};
use crate::design::{Block, Configuration};
use crate::distance::Goal;
use crate::trial::Protocol;
use crate::trial::series::Series;

/// A case of the study.
#[derive(Debug, Clone)]
pub struct Case {
    /// Short name, for files and the command line.
    pub name: String,
    /// Title for people.
    pub title: String,
    /// What it is, in a few sentences.
    pub about: String,
    /// The scene, with its probes.
    pub scene: Scene,
    /// Names of its bodies.
    pub bodies: Vec<String>,
    /// What a run computes.
    pub protocol: Protocol,
    /// How few frames still show what happens in a motion.
    pub fewest_frames: u32,
    /// What the user should know about it.
    pub notes: Vec<String>,
    /// What is varied.
    pub axes: Vec<Axis>,
    /// Combinations that are tried besides one factor at a time.
    pub blocks: Vec<Block>,
    /// What it is asked for.
    pub goal: Goal,
    /// Where the right answer comes from.
    pub truth: Truth,
    /// The factor that colours the points, and the one that shapes them.
    pub colour: Factor,
    /// See `colour`.
    pub shape: Factor,
}

/// Where the right answer comes from.
#[derive(Debug, Clone)]
pub enum Truth {
    /// A formula or stored data.
    Known {
        /// The field and the energy.
        series: Series,
        /// The goal, where it is known better than the field.
        goal: Option<f64>,
        /// Relative half-width of the error bar.
        error_bar: f64,
        /// The law it was computed with, as the label of a setting.
        law: String,
        /// Where it comes from.
        source: String,
    },
    /// Extrapolation of the case's own finest runs.
    Extrapolated {
        /// The law it is computed with, as the label of a setting.
        law: String,
        /// Ways to compute it, the best first; the first whose runs all succeed is taken.
        plans: Vec<Plan>,
    },
    /// Levels of refinement, as many as the time allows.
    Refined {
        /// The law it is computed with, as the label of a setting.
        law: String,
        /// Ways to compute it, the best first.
        ladders: Vec<Ladder>,
    },
}

/// A way to a reference: which runs it is extrapolated from.
#[derive(Debug, Clone)]
pub struct Plan {
    /// Element, integrator, … of its runs; mesh and step are replaced.
    pub configuration: Configuration,
    /// Meshes, coarse to fine; none where the mesh cannot be refined.
    pub meshes: Option<[Setting; 3]>,
    /// Steps, coarse to fine; none for statics. Meshes are compared at the first.
    pub steps: Option<[Setting; 3]>,
    /// Order of the integrator, for the words of the source.
    pub words: String,
}

impl Truth {
    /// The law of the reference: other laws have an error of the model.
    pub fn law(&self) -> &str {
        match self {
            Truth::Known { law, .. } | Truth::Extrapolated { law, .. } | Truth::Refined { law, .. } => law,
        }
    }
}
