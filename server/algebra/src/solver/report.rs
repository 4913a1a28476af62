//! What every solver reports.

/// Why a solver stopped.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum StopReason {
    /// The residual fell below the tolerance.
    #[default]
    Converged,
    /// The iterations ran out first; the residual tells how good the result is.
    IterationLimit,
    /// pᵀAp ≤ 0, or a pivot that is not positive: the operator is not positive definite; the iterate
    /// before it is returned (Steihaug 1983).
    NonPositiveCurvature,
    /// Rounding: more work no longer lowers the true residual; the best iterate is returned.
    Stagnated,
    /// No step along any direction tried lowers the potential; the iterate was left where it was.
    NoDescent,
    /// The stop flag was raised; the residual tells how good the result is.
    Interrupted,
    /// A scalar product is NaN or infinite; the result must not be used.
    NonFinite,
}

/// Result of a solution of A x = b.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LinearReport {
    /// Iterations made, each one product with A; for a factorisation the solves with its factors.
    pub iterations: u32,
    /// √(rᵀM⁻¹r) of the true residual b − A x, over the reference.
    pub residual: f64,
    /// What ended the iteration.
    pub stop: StopReason,
    /// Estimate of the algebraic error ‖x* − x‖_A, [√J] where A is a stiffness [N/m].
    pub algebraic_error: f64,
    /// Number of times the residual was recomputed in double precision.
    pub refinements: u32,
    /// The displacement (3 · copy + axis) whose pivot is not positive, if a factorisation met one.
    pub pivot: Option<u32>,
}
