//! What came out of a study.

use serde::Serialize;

use crate::advice::recommend::Recommendation;
use crate::advice::sources::Sources;
use crate::bench::store::Origin;
use crate::case::Case;
use crate::design::Configuration;
use crate::distance::Errors;
use crate::reference::Reference;
use crate::trial::Trial;

/// A configuration and what became of it.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// What was run.
    pub configuration: Configuration,
    /// How it went.
    pub trial: Trial,
    /// How far from the reference; none without result or reference.
    pub errors: Option<Errors>,
    /// Where its error comes from; known on the Pareto front.
    pub sources: Option<Sources>,
}

impl Outcome {
    /// Cost and error, not finite where there is no result.
    pub fn point(&self) -> (f64, f64) {
        (self.trial.cost.median_ms, self.errors.map_or(f64::INFINITY, |errors| errors.l2))
    }
}

/// What came out for a case.
#[derive(Debug, Clone)]
pub struct CaseResult {
    /// The case.
    pub case: Case,
    /// The right answer, or why there is none.
    pub reference: Result<Reference, String>,
    /// All points, the base first.
    pub points: Vec<Outcome>,
    /// Indices of the Pareto front, by rising cost.
    pub front: Vec<usize>,
    /// The recommendation, where one was asked for.
    pub recommendation: Option<Recommendation>,
    /// Points that were planned and not run, because they did not fit into the time or the budget.
    pub left_out: usize,
    /// What the reader should know: what was left out, what regions select.
    pub notes: Vec<String>,
    /// Whether every point was run.
    pub complete: bool,
}

/// Cases, and how they were studied.
#[derive(Debug, Clone)]
pub struct StudyResult {
    /// Case after case.
    pub cases: Vec<CaseResult>,
    /// Build and machine.
    pub origin: Origin,
    /// Points taken over from an earlier study.
    pub resumed: usize,
    /// Wall time of this study [s].
    pub seconds: f64,
    /// Load of the machine when it began and ended (one-minute average); none where unknown.
    pub load: [Option<f64>; 2],
    /// Whether it was ended early.
    pub interrupted: bool,
}

/// Figures of a study in short, for `--json`.
#[derive(Debug, Clone, Serialize)]
pub struct Counts {
    /// Points in all.
    pub points: usize,
    /// Those without a result.
    pub failures: usize,
}

impl CaseResult {
    /// How many points there are, and how many gave no result.
    pub fn counts(&self) -> Counts {
        let failures = self.points.iter().filter(|point| !point.trial.is_done()).count();
        Counts { points: self.points.len(), failures }
    }
}

impl StudyResult {
    /// Whether every case gave at least one result.
    pub fn has_results(&self) -> bool {
        let counts = self.cases.iter().map(CaseResult::counts);
        !self.cases.is_empty() && counts.into_iter().all(|counts| counts.points > counts.failures)
    }
}
