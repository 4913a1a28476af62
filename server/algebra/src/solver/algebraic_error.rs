//! The algebraic error of conjugate gradients, estimated while they run.

/// Number of iterations by which the estimate lags.
const DELAY: usize = 4;

/// Estimate of ‖x* − x‖_A from the numbers that conjugate gradients compute anyway.
///
/// ‖x* − x_k‖²_A = Σ_{j ≥ k} α_j r_jᵀM⁻¹r_j, and the sum of the first d terms is a lower bound that is
/// sharp once the iteration converges. Here d = 4, so the estimate is that of the iterate four
/// iterations ago: a little pessimistic about the present one.
///
/// # Source
/// Hestenes, Stiefel 1952, theorem 6:1; Strakoš, Tichý 2002 (stable in finite precision).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AlgebraicError {
    terms: [f64; DELAY],
    next: usize,
}

impl AlgebraicError {
    /// Adds the term α rᵀM⁻¹r of an iteration, in the unit of energy.
    #[inline]
    pub fn add(&mut self, term: f64) {
        self.terms[self.next] = term;
        self.next = (self.next + 1) % DELAY;
    }

    /// Estimate of ‖x* − x_{k−4}‖_A, or of the first iterate where there were fewer iterations.
    pub fn norm(&self) -> f64 {
        self.terms.iter().sum::<f64>().max(0.0).sqrt()
    }
}
