//! The result of a study.

use serde::Serialize;

use crate::advice::recommend::Recommendation;
use crate::advice::sources::Sources;
use crate::bench::store::Origin;
use crate::case::Case;
use crate::design::Configuration;
use crate::reference::Reference;
use crate::report::result::ExperimentResult;
use crate::trial::Trial;
use crate::trial::distance::Errors;

/// A configuration and the result of its run.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// The configuration that was run.
    pub configuration: Configuration,
    /// The run: status, times and figures.
    pub trial: Trial,
    /// Distance from the reference; `None` without result or reference.
    pub errors: Option<Errors>,
    /// Sources of its error, known on the Pareto front.
    pub sources: Option<Sources>,
}

impl Outcome {
    /// Cost [ms] and error; not finite if there is no result.
    pub fn point(&self) -> (f64, f64) {
        (self.trial.cost.median_ms, self.errors.map_or(f64::INFINITY, |errors| errors.l2))
    }
}

/// The result of one case.
#[derive(Debug, Clone)]
pub struct CaseResult {
    /// The case that was studied.
    pub case: Case,
    /// The reference, or the reason why there is none.
    pub reference: Result<Reference, String>,
    /// All points, the base first.
    pub points: Vec<Outcome>,
    /// Indices of the Pareto front, by rising cost.
    pub front: Vec<usize>,
    /// The recommendation, if one was asked for.
    pub recommendation: Option<Recommendation>,
    /// Planned points that did not fit into the time or the budget.
    pub left_out: usize,
    /// Remarks for the reader: what was left out, what regions select.
    pub notes: Vec<String>,
    /// Whether every point was run.
    pub complete: bool,
}

/// All cases, and the circumstances of the study.
#[derive(Debug, Clone)]
pub struct StudyResult {
    /// One result per case.
    pub cases: Vec<CaseResult>,
    /// One result per experiment.
    pub experiments: Vec<ExperimentResult>,
    /// Build and machine of the study.
    pub origin: Origin,
    /// Number of points taken over from an earlier study.
    pub resumed: usize,
    /// Wall time of this study [s].
    pub seconds: f64,
    /// One-minute load average of the machine at the start and the end; `None` if unknown.
    pub load: [Option<f64>; 2],
    /// Whether it was ended early.
    pub interrupted: bool,
}

/// Totals of a study, for `--json`.
#[derive(Debug, Clone, Serialize)]
pub struct Counts {
    /// Number of points.
    pub points: usize,
    /// Number of points without a result.
    pub failures: usize,
}

impl CaseResult {
    /// Counts all points, and those without a result.
    pub fn counts(&self) -> Counts {
        let failures = self.points.iter().filter(|point| !point.trial.is_done()).count();
        Counts { points: self.points.len(), failures }
    }
}

impl StudyResult {
    /// Whether every case gave at least one result, and every experiment was made.
    pub fn has_results(&self) -> bool {
        let counts = self.cases.iter().map(CaseResult::counts);
        let made = self.experiments.iter().all(|result| result.trouble.is_none());
        let any = !self.cases.is_empty() || !self.experiments.is_empty();
        any && made && counts.into_iter().all(|counts| counts.points > counts.failures)
    }
}
