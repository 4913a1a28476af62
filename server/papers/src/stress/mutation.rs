//! Checks that the cases can fail: parts of the method are taken out, and some case must notice.

use scindo_physics::body::Ablation;
use scindo_world::contact::ContactAblation;

use super::case::{CaseReport, Setting, Status};
use super::suite::{Progress, Settings, StressError, run_cases, select};

/// A part of the method that can be taken out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mutation {
    /// The masses of pieces.
    PieceMasses,
    /// Exact geometric predicates.
    ExactPredicates,
    /// Linearisation at the inertial predictor.
    Predictor,
    /// The line search of Newton's method.
    LineSearch,
    /// Duplicated cells on the coarse levels of multigrid.
    Duplicates,
    /// Weights of hanging corners.
    HangingWeights,
    /// Vertices of hanging corners that follow a cut.
    StaleVertices,
    /// Triangles that a vertex is joined to are no contacts.
    Exclusion,
    /// Friction by the normal force at the end of the step.
    Friction,
    /// Sweeps of tools between their poses.
    Continuous,
    /// The energy tank of haptic clients.
    Tank,
}

impl Mutation {
    /// All mutations, in the order of the table.
    pub const ALL: [Self; 11] = [
        Self::PieceMasses,
        Self::ExactPredicates,
        Self::Predictor,
        Self::LineSearch,
        Self::Duplicates,
        Self::HangingWeights,
        Self::StaleVertices,
        Self::Exclusion,
        Self::Friction,
        Self::Continuous,
        Self::Tank,
    ];

    /// Stable name for programs.
    pub fn name(self) -> &'static str {
        match self {
            Self::PieceMasses => "piece-masses",
            Self::ExactPredicates => "exact-predicates",
            Self::Predictor => "predictor",
            Self::LineSearch => "line-search",
            Self::Duplicates => "duplicates",
            Self::HangingWeights => "hanging-weights",
            Self::StaleVertices => "stale-vertices",
            Self::Exclusion => "exclusion",
            Self::Friction => "friction",
            Self::Continuous => "continuous",
            Self::Tank => "tank",
        }
    }

    /// Describes what is done instead.
    pub fn words(self) -> &'static str {
        match self {
            Self::PieceMasses => {
                "the copies of a node share its mass evenly, whatever the mass of their pieces"
            }
            Self::ExactPredicates => "signs by plain floating-point determinants",
            Self::Predictor => "the fast path linearises at the positions of the previous step",
            Self::LineSearch => "Newton's method takes every full step",
            Self::Duplicates => "coarse levels of multigrid do not see cuts inside their cells",
            Self::HangingWeights => "hanging corners count as the vertices that stand in for them",
            Self::StaleVertices => "hanging corners keep the vertices that they had before a cut",
            Self::Exclusion => "a body meets all of its triangles, those beside a vertex included",
            Self::Friction => "friction is bounded by the normal force of the step before",
            Self::Continuous => "tools jump from pose to pose",
            Self::Tank => "haptic clients take over any energy that a new contact model brings",
        }
    }

    /// Names of the cases that must notice.
    pub fn named(self) -> &'static [&'static str] {
        match self {
            Self::PieceMasses => &["freed-node", "free-fall"],
            Self::ExactPredicates => &["edge-on-cut"],
            Self::Predictor => &["step-sweep", "free-spin"],
            Self::LineSearch => &["inverted"],
            Self::Duplicates => &["blade-grid"],
            Self::HangingWeights => &["cells-patch"],
            Self::StaleVertices => &["cells-patch"],
            Self::Exclusion => &["lips-in-contact"],
            Self::Friction => &["incline"],
            Self::Continuous => &["tool-jab"],
            Self::Tank => &["haptic-wall"],
        }
    }

    /// The setting with which the cases are run.
    pub fn setting(self) -> Setting {
        let none = Ablation::default();
        let ablation = match self {
            Self::PieceMasses => Ablation { piece_masses: true, ..none },
            Self::ExactPredicates => Ablation { exact_predicates: true, ..none },
            Self::Predictor => Ablation { predictor: true, ..none },
            Self::LineSearch => Ablation { line_search: true, ..none },
            Self::Duplicates => Ablation { duplicates: true, ..none },
            Self::HangingWeights => Ablation { hanging_weights: true, ..none },
            Self::StaleVertices => Ablation { stale_vertices: true, ..none },
            Self::Friction => Ablation { lagged_friction: true, ..none },
            Self::Exclusion | Self::Continuous | Self::Tank => none,
        };
        let contact =
            ContactAblation { exclusion: self == Self::Exclusion, continuous: self == Self::Continuous };
        Setting { ablation, contact, open_tank: self == Self::Tank, long: false }
    }
}

/// A case that failed under a mutation.
#[derive(Debug, Clone, PartialEq)]
pub struct Failed {
    /// Name of the case.
    pub name: &'static str,
    /// The first figure out of its bound, in words.
    pub why: String,
}

/// Outcome of all cases under one mutation.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// The part that was taken out.
    pub mutation: Mutation,
    /// Cases that failed, in the order of the list.
    pub failed: Vec<Failed>,
    /// Number of cases that were run.
    pub run: usize,
}

impl Row {
    /// Whether every named case failed.
    pub fn caught(&self) -> bool {
        let failed = |name: &&str| self.failed.iter().any(|failed| failed.name == *name);
        self.mutation.named().iter().all(failed)
    }
}

/// Runs the cases of `settings` once per mutation.
///
/// # Errors
/// A name that no case has.
pub fn table(settings: &Settings, progress: &mut dyn FnMut(Progress<'_>)) -> Result<Vec<Row>, StressError> {
    let cases = select(&settings.cases, settings.more)?;
    let row = |mutation: Mutation| {
        let reports = run_cases(&cases, &mutation.setting(), settings, progress);
        let failed = reports.iter().filter(|(report, _)| report.status == Status::Failed);
        let first = |report: &CaseReport| report.failures().into_iter().next().unwrap_or_default();
        Row {
            mutation,
            failed: failed.map(|(report, _)| Failed { name: report.case.name, why: first(report) }).collect(),
            run: reports.len(),
        }
    };
    Ok(Mutation::ALL.into_iter().map(row).collect())
}
