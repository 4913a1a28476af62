//! Cases: a scene, what is varied in it, what it is asked for, and where the right answer comes from.

mod cantilever;

mod cut_beam;

pub mod cutting;

mod bar;

mod scene;

mod vary;

mod refine;

mod subdivide;

pub mod sight;

mod gold;

mod shared;

use scindo_world::scene::Scene;

pub use scene::{Wishes, from_scene};

use crate::axes::{Axis, Factor, Setting};
use crate::design::{Block, Configuration};
use crate::distance::Goal;
use crate::ladder::Ladder;
use crate::series::Series;
use crate::trial::Protocol;

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

/// Names of the cases that come with the program.
pub const NAMES: [&str; 7] =
    ["r1", "r2-tc1", "bar-rest", "bar-motion", "cut-tc1", "cut-tc2force", "cut-tc2strip"];

/// A case that comes with the program; `quick` leaves out what takes long.
pub fn builtin(name: &str, quick: bool) -> Option<Case> {
    match name {
        "r1" => Some(cantilever::case(quick)),
        "r2-tc1" => Some(cut_beam::case(quick)),
        "bar-rest" => Some(bar::at_rest(quick)),
        "bar-motion" => Some(bar::in_motion(quick)),
        "cut-tc1" => Some(cutting::case(cutting::Pull::Gravity, quick)),
        "cut-tc2force" => Some(cutting::case(cutting::Pull::Force, quick)),
        "cut-tc2strip" => Some(cutting::case(cutting::Pull::Strip, quick)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::design;

    #[test]
    fn every_case_has_a_base_and_a_bounded_number_of_points() {
        for name in NAMES {
            for quick in [false, true] {
                let case = builtin(name, quick).expect(name);
                let all = design(&case.axes, &case.blocks);
                assert!((10..=160).contains(&all.len()), "{name}: {} points", all.len());
                let law = case.axes.iter().find(|axis| axis.factor == Factor::Law).expect("law");
                assert!(law.find(case.truth.law()).is_some(), "{name}: the reference has a law of the axis");
                if let Truth::Known { series, .. } = &case.truth {
                    assert_eq!(series.width(), 3 * case.scene.checked().probes.len(), "{name}");
                }
            }
        }
    }
}
