//! What a step reports.

use super::Scheme;
use crate::integrator::notice::Notice;
use crate::solver::NewtonReport;

/// Result of a step of [`Dynamics`](super::Dynamics).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DynamicsReport {
    /// Whether the body advanced, and if not, why.
    pub outcome: DynamicsOutcome,
    /// The scheme used; it differs from the chosen one if a guard replaced it.
    pub scheme: Scheme,
    /// A departure from what was requested, if there was one.
    pub notice: Option<Notice>,
    /// Newton's method in its last solve; linear iterations are those of the whole step. With
    /// [`linearised`](super::DynamicsSettings::linearised), `residual` is that of the linear solve.
    pub newton: NewtonReport,
    /// Number of equal parts into which an explicit step was divided; 1 for implicit schemes.
    pub substeps: u32,
    /// Longest stable step [s] of an explicit scheme, as last computed.
    pub stable_step_s: Option<f64>,
    /// Quadrature points with det F ≤ 0 at the start of the step.
    pub inverted: usize,
    /// Springs left out because one of their numbers is unusable.
    pub refused_springs: usize,
    /// Kinetic energy at the end [J].
    pub kinetic_j: f64,
    /// Elastic energy at the end [J]; `None` for explicit schemes, which do not compute it.
    pub elastic_j: Option<f64>,
}

/// How a step ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DynamicsOutcome {
    /// The body advanced by the whole step.
    #[default]
    Advanced,
    /// No attempt stayed finite: the body is where it was, and at rest.
    Held,
    /// The step cannot be made as requested; nothing was changed.
    Refused,
    /// The stop flag was raised; the body is as it was.
    Interrupted,
}
