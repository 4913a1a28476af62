//! What a step reports.

use scindo_algebra::solver::StopReason;

use super::notice::Notice;
use super::scheme::Scheme;

/// Result of one step of a body.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct SolveReport {
    /// The scheme used; it differs from the chosen one if a guard replaced it.
    pub scheme: Scheme,
    /// Solver iterations, summed over all parts of the step.
    pub iterations: u32,
    /// √(rᵀM⁻¹r) over the reference of the step, as [`is_unconverged`](Self::is_unconverged) says, in the worst part
    /// of the step; that of Newton's method if the step is nonlinear.
    pub residual: f64,
    /// Value that `residual` has to reach; 0 if nothing is solved, as in explicit integrators.
    pub tolerance: f64,
    /// Residual that rounding may leave of equations whose forces are in single precision. It counts as reached; 0 where
    /// the tolerance alone decides.
    pub rounding: f64,
    /// Why the last linear or Newton solve stopped.
    pub stop: StopReason,
    /// Whether the body advanced, and if not, why.
    pub outcome: Outcome,
    /// Number of equal parts into which the step was divided.
    pub substeps: u32,
    /// Quadrature points with det F ≤ 0 at the start of the step; linear tetrahedra have one per piece.
    pub inverted_pieces: usize,
    /// Springs left out because one of their numbers is unusable.
    pub refused_springs: usize,
    /// Newton steps; 1 if the step is one linear solve, 0 for explicit integrators.
    pub newton_steps: u32,
    /// Halvings of the step length in all line searches.
    pub backtracks: u32,
    /// Estimated algebraic error of the last linear solve in the energy norm [√J]; 0 without an estimate.
    pub algebraic_error: f64,
    /// Longest stable step [s] of an explicit scheme, as last computed.
    pub stable_step_s: Option<f64>,
    /// Elastic energy at the end [J], where the step had to compute it.
    pub elastic_j: Option<f64>,
    /// Work [J] that the internal forces did if the step solved its equations; 0 where nobody asks.
    pub internal_work_j: f64,
    /// What the step did differently from what was requested.
    pub notice: Option<Notice>,
}

impl SolveReport {
    /// Whether the body advanced by a step whose residual is above its tolerance. The residual is
    /// √(rᵀM⁻¹r) after the linear solve if a step is one by design, after Newton's method otherwise. Its reference is
    /// the largest of its value at the start of the step, that of the loads (1 % of it on the fast path in motion) and,
    /// in equilibria and Newton's method, a small part of √(2Ψ).
    pub fn is_unconverged(&self) -> bool {
        self.outcome == Outcome::Advanced
            && self.tolerance > 0.0
            && self.residual > self.tolerance.max(self.rounding)
    }

    /// Report of a step of two parts, of which `next` is the second.
    pub fn then(&self, next: &Self) -> Self {
        let excess = |part: &Self| part.residual / part.tolerance.max(part.rounding).max(f64::MIN_POSITIVE);
        let worse = if excess(next) >= excess(self) { next } else { self };
        Self {
            iterations: self.iterations + next.iterations,
            residual: worse.residual,
            tolerance: worse.tolerance,
            rounding: worse.rounding,
            stop: worse.stop,
            substeps: self.substeps.max(next.substeps),
            inverted_pieces: self.inverted_pieces.max(next.inverted_pieces),
            refused_springs: self.refused_springs.max(next.refused_springs),
            newton_steps: self.newton_steps + next.newton_steps,
            backtracks: self.backtracks + next.backtracks,
            internal_work_j: self.internal_work_j + next.internal_work_j,
            notice: next.notice.or(self.notice),
            ..*next
        }
    }

    /// Whether energy came from nowhere again in this step and those just before it: the body may shake for ever.
    pub fn is_unbalanced(&self) -> bool {
        matches!(self.notice, Some(Notice::Unbalanced { again: true, .. }))
    }

    /// Whether the step failed as a whole and was made in parts. Sub-steps that an explicit integrator
    /// plans do not count.
    pub fn is_divided(&self) -> bool {
        let planned = matches!(self.notice, Some(Notice::Divided { .. }));
        self.outcome == Outcome::Advanced && self.substeps > 1 && !planned
    }
}

/// How a step ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Outcome {
    /// The body advanced by the whole step.
    #[default]
    Advanced,
    /// The body is where it was, and at rest. No attempt stayed finite, or a part was drawn out far beyond
    /// its size; the notice says which.
    Held,
    /// The stop flag was raised; the body is as it was before the step.
    Interrupted,
    /// The step length or the gravity is unusable, or there is no equilibrium; nothing was changed.
    Refused,
}
