//! What a step says about itself.

mod phases;

mod stages;

use std::mem::discriminant;
use std::sync::Arc;

use scindo_physics::body::estimate::MeshError;
use scindo_physics::body::{AdaptReport, Notice, Outcome, SolveReport};

use crate::inputs::CutOutcome;
pub use phases::PhaseSeconds;
pub use stages::{Stage, StageSeconds};

/// How a step went. The buffers are reused from step to step.
#[derive(Debug, Clone, Default)]
pub struct StepReport {
    /// Number of this step, from 1.
    pub step: u64,
    /// Simulated time after it [s].
    pub time_s: f64,
    /// Measured seconds per stage.
    pub seconds: StageSeconds,
    /// Measured seconds per phase of the stage that deforms; zeros unless they are asked for.
    pub phases: PhaseSeconds,
    /// Processor time of the thread that steps [s]; what other threads of `--threads` do is not in it.
    pub processor_s: f64,
    /// Per body, in the order of the scene.
    pub bodies: Vec<BodyReport>,
    /// What became of every requested cut of this step.
    pub cuts: Vec<CutOutcome>,
    /// What happened; empty in a steady step.
    pub events: Vec<Event>,
}

/// How a body's step went.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct BodyReport {
    /// Solver and outcome.
    pub solve: SolveReport,
    /// How its cells were adapted before the step.
    pub adapted: AdaptReport,
    /// Energies, when asked for.
    pub energy: Option<Energy>,
    /// Estimated discretisation error, when asked for.
    pub mesh_error: Option<MeshError>,
}

/// Energy of a body.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Energy {
    /// ½ Σ m v² [J].
    pub kinetic_j: f64,
    /// Σ V ψ(F) [J].
    pub elastic_j: f64,
}

/// Something worth telling people.
#[derive(Debug, Clone, PartialEq)]
pub struct Event {
    /// How bad it is.
    pub level: Level,
    /// Stable name such as `cut-applied`.
    pub name: &'static str,
    /// What happened, in words.
    pub message: String,
    /// The body it happened to.
    pub body: Option<Arc<str>>,
}

/// How bad an event is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// For the record.
    Info,
    /// Goes on, but look at it.
    Warning,
    /// Something asked for was not done.
    Error,
}

impl StepReport {
    pub(crate) fn begin(&mut self, step: u64, time_s: f64) {
        self.step = step;
        self.time_s = time_s;
        self.cuts.clear();
        self.events.clear();
    }

    /// Tells what a step did differently from what was asked for, when it begins. `known` is what was told
    /// of the last step.
    pub(crate) fn tell_of_solve(&mut self, body: &Arc<str>, solve: &SolveReport, known: &mut Option<Notice>) {
        let begins = solve.notice.as_ref().map(discriminant) != known.as_ref().map(discriminant);
        *known = solve.notice;
        if solve.outcome == Outcome::Interrupted {
            let message = "the step was interrupted by a command; the body is as before the step".into();
            self.tell(Level::Warning, "step-interrupted", body, message);
        }
        // Unbalanced steps have an event of their own.
        let notice = solve.notice.filter(|_| begins && !solve.is_unbalanced());
        if let (Outcome::Advanced, Some(notice)) = (solve.outcome, notice) {
            let meant = matches!(notice, Notice::Started | Notice::Divided { .. });
            let level = if meant { Level::Info } else { Level::Warning };
            self.tell(level, "step-notice", body, notice.to_string());
        }
    }

    pub(crate) fn tell(&mut self, level: Level, name: &'static str, body: &Arc<str>, message: String) {
        self.events.push(Event { level, name, message, body: Some(body.clone()) });
    }
}
