//! The definition of a case, and the origin of its right answer.

use scindo_world::scene::Scene;

use super::ladder::Ladder;
use crate::design::axes::{Axis, Factor, Setting};
use crate::design::{Block, Configuration};
use crate::trial::Protocol;
use crate::trial::distance::Goal;
use crate::trial::series::Series;

/// A case of the study.
#[derive(Debug, Clone)]
pub struct Case {
    /// Short name, for files and the command line.
    pub name: String,
    /// Title on the page.
    pub title: String,
    /// Description in a few sentences.
    pub about: String,
    /// The scene, with its probes.
    pub scene: Scene,
    /// Names of its bodies.
    pub bodies: Vec<String>,
    /// What a run computes.
    pub protocol: Protocol,
    /// Fewest frames that still show what happens in a motion.
    pub fewest_frames: u32,
    /// Remarks that the user should read.
    pub notes: Vec<String>,
    /// Factors that are varied, with their settings.
    pub axes: Vec<Axis>,
    /// Combinations that are tried in addition to one factor at a time.
    pub blocks: Vec<Block>,
    /// The number that the user wants to know.
    pub goal: Goal,
    /// Origin of the right answer.
    pub truth: Truth,
    /// Factor that decides the colour of the points.
    pub colour: Factor,
    /// Factor that decides the shape of the points.
    pub shape: Factor,
}

/// Origin of the right answer.
#[derive(Debug, Clone)]
pub enum Truth {
    /// A formula or stored data.
    Known {
        /// Displacements and energy.
        series: Series,
        /// The goal, where it is known better than the field.
        goal: Option<f64>,
        /// Relative half-width of the error bar.
        error_bar: f64,
        /// Law of the reference, as the label of a setting.
        law: String,
        /// Origin of the reference, in words.
        source: String,
    },
    /// Extrapolated from the case's own finest runs.
    Extrapolated {
        /// Law of the reference, as the label of a setting.
        law: String,
        /// Ways to compute the reference, best first. The first one whose runs all succeed is used.
        plans: Vec<Plan>,
    },
    /// Refined level by level, as far as the time allows.
    Refined {
        /// Law of the reference, as the label of a setting.
        law: String,
        /// Ways to compute the reference, best first.
        ladders: Vec<Ladder>,
    },
}

/// The runs from which a reference is extrapolated.
#[derive(Debug, Clone)]
pub struct Plan {
    /// Element, integrator, … of the runs; mesh and step are replaced.
    pub configuration: Configuration,
    /// Meshes, coarse to fine; `None` if the mesh cannot be refined.
    pub meshes: Option<[Setting; 3]>,
    /// Steps, coarse to fine; `None` for statics. Meshes are compared at the first step.
    pub steps: Option<[Setting; 3]>,
    /// Integrator and element in words, for the description of the source.
    pub words: String,
}

impl Truth {
    /// Law of the reference. Every other law has a model error.
    pub fn law(&self) -> &str {
        match self {
            Truth::Known { law, .. } | Truth::Extrapolated { law, .. } | Truth::Refined { law, .. } => law,
        }
    }
}
