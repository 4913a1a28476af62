//! Implicit steps of a discrete model: static equilibrium, implicit Euler, BDF2, Newmark.

use nalgebra::Vector3;
use scindo_algebra::assembly::Tangent;
use scindo_algebra::solver::{NewtonReport, NewtonSettings, Potential, StopReason};
use scindo_matter::element::Points;
use scindo_matter::material::Rayleigh;
use scindo_matter::team::Team;
use scindo_matter::team::phase::Phase;

use super::course::Course;
use super::model_solver::{ModelSolver, finite};
use super::notice::Notice;
use super::potential::StepPotential;
use super::report::{Outcome, SolveReport};
use super::scheme::Scheme;
use super::settings::LEAST_NEWTON_STEPS;
use super::state::State;
use super::statics::prescribe;
use super::step_inputs::{StepHistory, StepInputs};

/// An element whose ‖F‖ is below this has collapsed.
const COLLAPSED: f64 = 0.05;
/// Least number of Newton steps allowed when a step is repeated because it failed or gained energy.
const RETRY_STEPS: u32 = 20;
/// Largest tolerance of such a repeated step: with a coarser one it would gain energy again.
const RETRY_TOLERANCE: f64 = 1e-3;
/// Halvings of a Newton step that recovers from a ruined state.
const RECOVERY_HALVINGS: u32 = 20;

/// Most times that a step is solved again because the bounds of friction have changed, and the relative change
/// that does not count.
const GRIP_PASSES: usize = 8;
const SAME_GRIP: f64 = 1e-3;

/// Φ of the step whose history is `$history`.
macro_rules! step_potential {
    ($solver:ident, ($inputs:ident, $history:ident, $before:ident), $definite:ident) => {{
        let StepHistory { increment, x_a, x_v } = *$history;
        let Rayleigh { mass_1_s: alpha, stiffness_s: beta } = $solver.material.rayleigh;
        StepPotential {
            model: &$solver.model,
            mass: &$solver.mass,
            increment,
            x_a,
            x_v,
            alpha,
            damping: $solver.damping.as_ref().filter(|_| increment.B > 0.0).map(|K| (beta, K)),
            turned: &$solver.turned,
            tension: (increment.A > 0.0 && !$solver.settings.ablation.twists).then_some(&$before.x[..]),
            f_ext: &$solver.f_ext,
            springs: &$solver.active.springs,
            pressure: ($inputs.pressure, &mut $solver.follower),
            definite: $definite,
            stored: 0.0,
            scratch: &mut $solver.scratch,
            force: &mut $solver.force,
        }
    }};
}

impl ModelSolver {
    /// Whether a repeated step is solved more accurately than others.
    pub(super) fn is_coarse(&self) -> bool {
        self.settings.newton.steps < RETRY_STEPS || self.settings.newton.tolerance > RETRY_TOLERANCE
    }

    /// Makes the step with `scheme`. If the result is not finite, the outcome is `Held`.
    pub(super) fn implicit_step(
        &mut self,
        team: &mut Team,
        (course, state): (&mut Course, &mut State),
        (scheme, inputs): (Scheme, &StepInputs<'_>),
        report: &mut SolveReport,
    ) {
        team.begin(Phase::Predict);
        let Course { multistep, before, .. } = course;
        let Some(history) = multistep.extrapolate(team, before, (scheme, inputs.h)) else { return };
        match scheme {
            scheme if scheme.is_newmark() => {
                // Where the equations hold: at the end of the step, or inside it.
                let h = inputs.h * scheme.alpha().map_or(1.0, |alpha| 1.0 - alpha.alpha_f);
                let known = before.x.iter().zip(&before.v);
                state.x.iter_mut().zip(known).for_each(|(next, (x, v))| *next = x + h * v);
            }
            _ => state.x.copy_from_slice(history.x_a),
        }
        prescribe(inputs.fixed, &mut state.x);
        team.begin(Phase::Operator);
        self.model.begin_viscous(team, inputs.h, &before.x, &before.viscous);
        let increment = history.increment;
        if let (true, Some(K)) = (increment.B > 0.0, &mut self.damping) {
            self.model.rotated_stiffness(&state.x, K);
            self.turned.fill(Vector3::zeros());
            // In other schemes the expansions of a steady turn cancel.
            if scheme == Scheme::ImplicitEuler && !self.settings.ablation.twists {
                self.model.add_turned_strain(&state.x, &before.x, &mut self.turned);
            }
        }
        let newton = self.minimise(team, (before, &mut state.x), (inputs, &history), report);
        team.begin(Phase::Commit);
        if newton.stop == StopReason::NonFinite {
            report.outcome = Outcome::Held;
            return;
        }
        if let (None, Some(displacement)) = (report.notice, newton.pivot) {
            report.notice = Some(Notice::Pivot { displacement });
        }
        for ((v, x), from) in state.v.iter_mut().zip(&state.x).zip(history.x_v) {
            *v = increment.B * (x - from);
        }
        let State { x, viscous, .. } = &mut *state;
        self.model.end_viscous(team, inputs.h, (&before.x, x), viscous);
        team.begin(Phase::Guards);
        let elastic_j = self.model.energy_with_by(team, &state.x, &state.viscous);
        report.elastic_j = Some(elastic_j);
        if !finite(state) || !(self.mass.kinetic(&state.v) + elastic_j).is_finite() {
            report.outcome = Outcome::Held;
        }
    }

    /// Settings of Newton's method in this attempt, and whether it is one of few solves by design.
    fn newton_settings(&self) -> (NewtonSettings, bool) {
        let asked = self.settings.newton;
        if !self.careful {
            return (asked, self.settings.linearised);
        }
        let (steps, tolerance) = (asked.steps.max(RETRY_STEPS), asked.tolerance.min(RETRY_TOLERANCE));
        let linearised = self.settings.linearised && steps == asked.steps;
        (NewtonSettings { steps, tolerance, ..asked }, linearised)
    }

    /// Runs Newton's method from the predictor `x`, and balances the momentum of loose parts before and after
    /// it. A part in free fall then moves before the first iteration. Conjugate gradients find such slow
    /// modes last and need not look for them.
    fn minimise(
        &mut self,
        team: &mut Team,
        (before, x): (&State, &mut [Vector3<f64>]),
        (inputs, history): (&StepInputs<'_>, &StepHistory<'_>),
        report: &mut SolveReport,
    ) -> NewtonReport {
        team.begin(Phase::Guards);
        let ruined = self.count_ruined(x, report);
        let (settings, linearised) = self.newton_settings();
        let increment = history.increment;
        // With a single solve Newmark's method gains energy where the body turns.
        let least = if report.scheme.is_newmark() { 2 } else { 1 };
        let quadratic = self.model.law().is_hookean();
        let steps = match quadratic && !ruined && self.active.springs.is_empty() {
            true => settings.steps.max(least),
            false => settings.steps.max(LEAST_NEWTON_STEPS),
        };
        if ruined && steps > self.settings.newton.steps && report.notice.is_none() {
            report.notice = Some(Notice::Recovery);
        }
        let halvings = if ruined { RECOVERY_HALVINGS.max(settings.halvings) } else { settings.halvings };
        // A step with a single solve uses the rotations of the predictor and a fine tolerance. Implicit
        // Euler then gains no energy up to 2 rad per step; beyond that, the ledger detects it.
        let single = steps == 1;
        let mut linear = settings.linear;
        if single {
            linear.tolerance = linear.tolerance.min(settings.tolerance);
        }
        self.newton.settings = NewtonSettings { steps, halvings, linear, ..settings };
        let loose = increment.A > 0.0 && inputs.parts.any_free();
        if loose && self.active.springs.is_empty() {
            self.balance_parts(x, (inputs, history));
        }
        let definite = if single { Tangent::Held } else { Tangent::Projected };
        self.follower.begin(inputs.pressure, x);
        let mut phi = step_potential!(self, (inputs, history, before), definite);
        team.begin(Phase::Residual);
        if !phi.value(team, x).is_finite() {
            // The velocity is so high that the predictor overflows: start from the present positions.
            x.copy_from_slice(&before.x);
            prescribe(inputs.fixed, x);
            phi.pressure.1.begin(inputs.pressure, x);
        }
        // Relaxation spreads an equilibrium over many steps, in each of which a few iterations are made.
        if let (Scheme::Static, Some(iterations)) = (self.settings.scheme, self.settings.relaxation) {
            self.relaxation.tolerance = settings.tolerance;
            if !self.active.springs.is_empty() {
                self.relaxation.restart_next(); // springs move without being loads
            }
            team.begin(Phase::Solve);
            let done = self.relaxation.relax(team, &mut phi, inputs.fixed, x, iterations);
            report.iterations += done.iterations;
            (report.residual, report.stop) = (done.residual, done.stop);
            return NewtonReport { stop: done.stop, ..NewtonReport::default() };
        }
        let mut done = self.newton.minimise(team, &mut phi, x, inputs.fixed);
        for _ in 0..GRIP_PASSES {
            // Friction is bounded by the normal force at the end of the step, which only this solve has found.
            let springs = self.active.springs.iter_mut();
            let changed = springs.map(|spring| spring.renew_grip(spring.point(x))).fold(0.0, f64::max);
            if changed <= SAME_GRIP || done.stop == StopReason::NonFinite {
                break;
            }
            self.follower.begin(inputs.pressure, x);
            let mut phi = step_potential!(self, (inputs, history, before), definite);
            let again = self.newton.minimise(team, &mut phi, x, inputs.fixed);
            let (steps, backtracks) = (done.steps + again.steps, done.backtracks + again.backtracks);
            let linear_iterations = done.linear_iterations + again.linear_iterations;
            done = NewtonReport { steps, backtracks, linear_iterations, ..again };
        }
        if done.stop != StopReason::NonFinite && loose {
            self.balance_parts(x, (inputs, history));
        }
        // Where few solves are the step by design, the last of them tells whether it has converged.
        if linearised {
            done = judged_by_its_solve(done, settings.tolerance);
        }
        // A repeated step may aim at a finer tolerance than was asked for, which it need not reach.
        let reached = done.residual <= self.settings.newton.tolerance;
        if self.careful && done.stop == StopReason::IterationLimit && reached {
            done.stop = StopReason::Converged;
        }
        report.iterations += done.linear_iterations;
        (report.residual, report.stop) = (done.residual, done.stop);
        (report.newton_steps, report.backtracks) = (done.steps, done.backtracks);
        report.algebraic_error = done.algebraic_error;
        done
    }

    /// Translates every free part to where its momentum is balanced exactly. An iteration that stops
    /// early leaves a residual, which would be spurious momentum.
    fn balance_parts(
        &mut self,
        x: &mut [Vector3<f64>],
        (inputs, history): (&StepInputs<'_>, &StepHistory<'_>),
    ) {
        let (StepHistory { increment, x_a, x_v }, parts) = (*history, inputs.parts);
        let alpha = self.material.rayleigh.mass_1_s;
        let Self { mass, scratch: g, force: moved, translations, f_ext, active, .. } = self;
        g.fill(Vector3::zeros());
        // Internal forces and K̂ sum to zero over every part; inertia and loads remain.
        for (s, from) in [(increment.A, x_a), (alpha * increment.B, x_v)] {
            for ((d, x), from) in moved.iter_mut().zip(&*x).zip(from) {
                *d = x - from;
            }
            mass.add_times(s, moved, g);
        }
        if !inputs.pressure.is_empty() {
            moved.fill(Vector3::zeros());
            inputs.pressure.add_forces(x, moved);
            g.iter_mut().zip(&*moved).for_each(|(g, f)| *g -= f);
        }
        translations.restart(parts);
        translations.begin(parts, increment.A + alpha * increment.B);
        for (c, (f, g)) in f_ext.iter().zip(g).enumerate() {
            translations.add(parts, c, *f - *g);
        }
        for spring in &active.springs {
            let response = spring.law().potential(spring.point(x));
            translations.add_spring(parts, spring.main_copy(), response.stiffness, response.force);
        }
        translations.solve(parts);
        for (x, &part) in x.iter_mut().zip(&parts.of_copy) {
            *x += translations.shift[part as usize];
        }
    }

    /// Counts the inverted quadrature points at the predictor into the report. Returns whether any
    /// element is inverted or collapsed.
    fn count_ruined(&self, x: &[Vector3<f64>], report: &mut SolveReport) -> bool {
        let mut ruined = false;
        report.inverted_pieces = 0;
        self.model.for_points(x, &mut |point| {
            let inverted = point.F.determinant() <= 0.0;
            report.inverted_pieces += usize::from(inverted);
            ruined |= inverted || point.F.norm() < COLLAPSED;
        });
        ruined
    }
}

/// Report of a step that is a fixed number of linear solves by design. If Newton's method ran out of
/// steps, the step is judged by the residual of its last solve.
fn judged_by_its_solve(newton: NewtonReport, tolerance: f64) -> NewtonReport {
    if newton.stop != StopReason::IterationLimit {
        return newton;
    }
    let residual = newton.linear_residual;
    let stop = if residual <= tolerance { StopReason::Converged } else { StopReason::IterationLimit };
    NewtonReport { residual, stop, ..newton }
}
