//! What a step says about itself.

use std::mem::{Discriminant, discriminant};
use std::sync::Arc;

use scindo_physics::body::{Notice, Outcome, SolveReport};
use scindo_physics::estimate::MeshError;

use super::stopwatch::StageSeconds;
use crate::inputs::CutOutcome;

/// How a step went. The buffers are reused from step to step.
#[derive(Debug, Clone, Default)]
pub struct StepReport {
    /// Number of this step, from 1.
    pub step: u64,
    /// Simulated time after it [s].
    pub time_s: f64,
    /// Measured seconds per stage.
    pub seconds: StageSeconds,
    /// Per body, in the order of the scene.
    pub bodies: Vec<BodyReport>,
    /// What became of every requested cut of this step.
    pub cuts: Vec<CutOutcome>,
    /// What happened; empty in a steady step.
    pub events: Vec<Event>,
}

/// How a body's step went.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct BodyReport {
    /// Solver and outcome.
    pub solve: SolveReport,
    /// Energies, when asked for.
    pub energy: Option<Energy>,
    /// Estimated discretisation error, when asked for.
    pub mesh_error: Option<MeshError>,
}

/// Energy of a body.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
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

    /// Tells what a solve did differently from what was asked for: failures always, everything else
    /// when it begins. `known` is what was told of the last step.
    pub(crate) fn tell_of_solve(
        &mut self,
        body: &Arc<str>,
        solve: &SolveReport,
        known: &mut Option<Discriminant<Notice>>,
    ) {
        let notice = solve.notice.as_ref().map(discriminant);
        let begins = notice != *known;
        *known = notice;
        match (solve.outcome, solve.notice) {
            (Outcome::Refused, Some(why)) => self.tell(Level::Error, "step-refused", body, why.to_string()),
            (Outcome::Refused, None) => {
                self.tell(Level::Error, "step-refused", body, "step or gravity is not usable".into());
            }
            (Outcome::Held, _) => {
                let parts = solve.substeps;
                let message =
                    format!("not finite even in {parts} parts; the body is back where it was, at rest");
                self.tell(Level::Error, "step-rolled-back", body, message);
            }
            (Outcome::Advanced, Some(notice)) if begins => {
                let level = if matches!(notice, Notice::Started) { Level::Info } else { Level::Warning };
                self.tell(level, "step-notice", body, notice.to_string());
            }
            (Outcome::Advanced, None) if solve.substeps > 1 => {
                let message = format!("done in {} parts to stay finite", solve.substeps);
                self.tell(Level::Warning, "step-divided", body, message);
            }
            (Outcome::Advanced, _) => {}
        }
    }

    pub(crate) fn tell(&mut self, level: Level, name: &'static str, body: &Arc<str>, message: String) {
        self.events.push(Event { level, name, message, body: Some(body.clone()) });
    }
}
