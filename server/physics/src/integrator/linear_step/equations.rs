//! Whether the equations of a step in motion hold, where several solves are made.
//!
//! Each solve begins with the true residual of the equations, relative to that of the first. It ends the step without
//! another solve once the residual is small, or is what rounding leaves: forces in single precision tell no more of it.
//!
//! # Source
//! Eisenstat, Walker 1996, "Choosing the forcing terms in an inexact Newton method", choice 1.

use scindo_algebra::operator::{Stiffness, block_of};
use scindo_algebra::solver::{LinearReport, PcgSettings, StopReason};
use scindo_matter::team::{Team, blocks};

use super::{FORCING, LinearStep};
use crate::integrator::step_inputs::LinearInputs;

/// The equations hold once their residual is this many times the tolerance, if their law is linear in the stretch, so that
/// one solve would do in quiet motion.
const ENOUGH: f64 = 10.0;
/// Parts of the residual that [rounding may leave](LinearStep::note_rounding): one that is nothing else, and one below which
/// a solve that does not halve it shows that it is.
const ROUNDED: [f64; 2] = [0.4, 4.0];

/// Part of the tolerance to which the equations of Newmark's method and its generalisation are solved in a body under
/// tension. The residual hardly tells of its softest motions, and nothing damps what is left of these.
const CONSERVED: f64 = 3e-3;

/// Residuals of the equations in the solves of a step, relative to that of the first.
#[derive(Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct StepEquations {
    /// At the start of the last solve.
    began: f64,
    /// The least one at the start of a solve, and the least of those before the last.
    least: f64,
    before: f64,
    /// What the linear system of the last solve left.
    foreseen: f64,
    /// What rounding may leave, as a norm.
    rounded: f64,
    /// The one at which the equations hold.
    hold_at: f64,
    /// The one that a linear system may leave.
    tolerance: f64,
    /// Whether the tangent of a law that is nonlinear in the stretch is made positive semidefinite in this step.
    pub definite: bool,
}

impl StepEquations {
    /// Begins a step.
    pub(super) fn begin(&mut self) {
        *self = Self { least: f64::INFINITY, before: f64::INFINITY, ..Self::default() };
    }

    /// Says how well a solve with this stiffness has to be made.
    pub(super) fn aim(&mut self, elastic: &dyn Stiffness, inputs: &LinearInputs<'_>) {
        let soft = inputs.conserves && (elastic.is_twisted() || inputs.is_nonlinear());
        self.tolerance = inputs.solver.tolerance * if soft { CONSERVED } else { 1.0 };
    }

    /// Makes the tangent positive semidefinite for the rest of the step. Returns `false` if it is.
    pub(super) fn project(&mut self, inputs: &LinearInputs<'_>) -> bool {
        if self.definite || !inputs.is_nonlinear() {
            return false;
        }
        // Residuals are measured by the preconditioner, which is another from now on.
        (self.least, self.before, self.definite) = (f64::INFINITY, f64::INFINITY, true);
        true
    }

    /// Looks at a solve that begins with a residual of this `norm`, relative to the `reference`. Returns its report if it is
    /// not made: because the equations hold, or because the last one made the residual larger.
    pub(super) fn look(
        &mut self,
        norm: f64,
        reference: f64,
        first: bool,
        inputs: &LinearInputs<'_>,
    ) -> Option<LinearReport> {
        let relative = |norm: f64| if reference > 0.0 { norm / reference } else { 0.0 };
        let began = relative(norm);
        let falls = began <= self.least;
        let [nothing_else, at_most] = ROUNDED.map(|part| part * relative(self.rounded));
        let (times, nothing_else) = if inputs.is_nonlinear() { (1.0, nothing_else) } else { (ENOUGH, 0.0) };
        let rounded = if began <= 0.5 * self.least { nothing_else } else { at_most };
        self.began = began;
        self.hold_at = rounded.max(times * self.tolerance);
        if !first && began <= self.hold_at {
            return Some(LinearReport::default());
        }
        if !falls {
            return Some(LinearReport { stop: StopReason::NoDescent, ..LinearReport::default() });
        }
        (self.before, self.least) = (self.least, began);
        None
    }

    /// When the linear system is solved: no solve of several has to be better than the tangent of the last one was.
    pub(super) fn until(&self, inputs: &LinearInputs<'_>) -> PcgSettings {
        if !inputs.is_nonlinear() {
            return PcgSettings { tolerance: self.tolerance, ..inputs.solver };
        }
        let bent = (self.began - self.foreseen).abs() / self.before;
        let part = if self.before.is_finite() { FORCING.min(bent) } else { FORCING };
        PcgSettings { tolerance: (part * self.began).max(0.5 * self.tolerance), ..inputs.solver }
    }

    /// Notes the residual that a linear system left.
    pub(super) fn foresee(&mut self, residual: f64) {
        self.foreseen = residual;
    }

    /// Ends a step: the last linear system knew nothing of the equations. Returns the residual that counts as rounding.
    pub(super) fn judge(&self, tolerance: f64, solve: &mut LinearReport) -> f64 {
        solve.residual = self.began.min(self.least);
        solve.stop = match solve.residual {
            residual if residual <= tolerance => StopReason::Converged,
            _ if self.began <= self.hold_at => StopReason::Stagnated,
            _ => StopReason::IterationLimit,
        };
        self.hold_at
    }
}

impl LinearStep {
    /// Estimates the residual that forces in single precision leave: edges of length h are known to ε h, so that a force may
    /// be wrong by ε h times its stiffness.
    pub(super) fn note_rounding(&mut self, team: &mut Team, inputs: &LinearInputs<'_>) {
        self.equations.rounded = 0.0;
        if !inputs.moves() || inputs.solves == 1 {
            return;
        }
        let (factor, density) = (inputs.mass_factor(), inputs.material.density_kg_m3);
        let diagonal = &self.diagonal;
        team.for_blocks(blocks(&mut self.partial, 1), |block, partial| {
            let known = block_of(diagonal, block).iter().zip(block_of(inputs.step.mass, block));
            partial[0] = 0.0;
            for (A, m) in known {
                let A = (f64::from(A[0]) + f64::from(A[4]) + f64::from(A[6])) / 3.0;
                let h = (m / density).cbrt();
                let force = f64::from(f32::EPSILON) * h * (A - factor * m).max(0.0);
                partial[0] += if A > 0.0 { 3.0 * force * force / A } else { 0.0 };
            }
        });
        self.equations.rounded = self.partial.iter().sum::<f64>().sqrt();
    }
}
