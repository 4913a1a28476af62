//! Implicit schemes: static equilibrium, implicit Euler, BDF2, Newmark.

use nalgebra::Vector3;

use super::potential::StepPotential;
use super::{
    Dynamics, DynamicsInputs, DynamicsOutcome, DynamicsReport, LEAST_NEWTON_STEPS, Notice, Scheme, finite,
};
use crate::assembly::Tangent;
use crate::integrator::guard::{GAIN_CONSERVING, GAIN_DISSIPATING};
use crate::integrator::increment::{Increment, bdf2_history, newmark_history};
use crate::integrator::{FreeMotion, LooseParts, State};
use crate::material::Law;
use crate::solver::{NewtonReport, NewtonSettings, Potential, StopReason};
use crate::team::Team;

/// An element whose ‖F‖ is below this has collapsed.
const COLLAPSED: f64 = 0.05;
/// Least number of Newton steps allowed when a step is repeated because it failed or gained energy.
const RETRY_STEPS: u32 = 20;
/// Largest tolerance of such a repeated step: with a coarser one it would gain energy again.
const RETRY_TOLERANCE: f64 = 1e-3;
/// Halvings of a Newton step that recovers from a ruined state.
const RECOVERY_HALVINGS: u32 = 20;

impl Dynamics {
    /// Makes the step; the new state is in `self.next`.
    pub(super) fn implicit_step(
        &mut self,
        team: &mut Team,
        state: &State,
        inputs: &DynamicsInputs<'_>,
        report: &mut DynamicsReport,
    ) {
        let scheme = self.settings.scheme;
        if let (Scheme::Static, Some(why)) = (scheme, self.why_no_equilibrium()) {
            report.outcome = DynamicsOutcome::Refused;
            report.notice = Some(why);
            return;
        }
        let (elastic, kinetic) = (self.model.energy_by(team, &state.x), self.mass.kinetic(&state.v));
        self.ledger.begin(kinetic + elastic + self.load_energy(&state.x));
        let (scheme, notice) = self.choose(scheme, state, inputs);
        let underheld = self.free_motions.first().map(|&motion| Notice::Underheld { motion, driven: false });
        (report.scheme, report.notice) = (scheme, notice.or(underheld));
        // Newmark's method needs the acceleration at the start of its first step.
        if let Scheme::Newmark { .. } = scheme
            && !self.history.known
        {
            let mut a = std::mem::take(&mut self.acceleration);
            self.accelerate(team, &state.x, &state.v, inputs.fixed, &mut a);
            self.acceleration = a;
        }
        // Prescribed motion does work that is not known here, so the energy is not judged then.
        let driven = inputs
            .fixed
            .iter()
            .any(|f| (0..3).any(|k| f.axes[k] && f.position_m[k] != state.x[f.copy as usize][k]));
        let mut advanced = self.attempt(team, state, inputs, (scheme, self.settings.newton.steps), report);
        let excess = match scheme {
            Scheme::Static => None,
            _ if driven => None,
            _ => self.excess(state, kinetic + elastic, scheme, report),
        };
        if let (true, Some(excess_j)) = (advanced, excess) {
            report.notice = Some(Notice::EnergyGained { excess_j });
        }
        // Implicit Euler, solved to a fine tolerance, is the fallback.
        let asked = self.settings.newton;
        let coarse = asked.steps < RETRY_STEPS || asked.tolerance > RETRY_TOLERANCE;
        let again = scheme != Scheme::ImplicitEuler || coarse;
        if scheme != Scheme::Static && again && (!advanced || excess.is_some()) {
            report.scheme = Scheme::ImplicitEuler;
            self.settings.newton.tolerance = asked.tolerance.min(RETRY_TOLERANCE);
            let steps = RETRY_STEPS.max(asked.steps);
            advanced = self.attempt(team, state, inputs, (Scheme::ImplicitEuler, steps), report);
            self.settings.newton = asked;
            if report.newton.stop == StopReason::IterationLimit && report.newton.residual <= asked.tolerance {
                report.newton.stop = StopReason::Converged;
            }
        }
        if !advanced {
            report.outcome = DynamicsOutcome::Held;
            return;
        }
        self.ledger.end(self.total_energy(report), driven);
        self.history.contacts = self.contacts();
    }

    /// See [`why_no_equilibrium`].
    fn why_no_equilibrium(&self) -> Option<Notice> {
        let held = (&self.free_motions[..], &self.parts);
        let springs = !self.active.is_empty();
        why_no_equilibrium(held, self.model.law(), self.model.rest(), &self.f_ext, springs)
    }

    /// Energy [J] that `self.next` gained without work, if it is more than the scheme may gain.
    fn excess(&self, state: &State, energy: f64, scheme: Scheme, report: &DynamicsReport) -> Option<f64> {
        let moved = self.next.x.iter().zip(&state.x);
        let exchanged: f64 = self.f_ext.iter().zip(moved).map(|(f, (next, x))| f.dot(&(next - x))).sum();
        let gain = if scheme == Scheme::ImplicitEuler { GAIN_DISSIPATING } else { GAIN_CONSERVING };
        self.ledger.excess(self.total_energy(report), gain * (energy + exchanged.abs()))
    }

    /// The scheme for this step, and the reason if it is not the chosen one.
    fn choose(
        &mut self,
        scheme: Scheme,
        state: &State,
        inputs: &DynamicsInputs<'_>,
    ) -> (Scheme, Option<Notice>) {
        if scheme != Scheme::Bdf2 {
            return (scheme, None);
        }
        for ((next, x), v) in self.next.x.iter_mut().zip(&state.x).zip(&state.v) {
            *next = x + inputs.h * v;
        }
        let touching = self.contacts();
        let Self { spin, mass, parts, history, .. } = self;
        let turn = || inputs.h * spin.fastest(state, &mass.lumped, parts);
        match history.why_no_bdf2(inputs.h, turn, || touching) {
            Some(notice) => (Scheme::ImplicitEuler, Some(notice)),
            None => (scheme, None),
        }
    }

    /// Number of springs that push or pull at the positions in `self.next`.
    fn contacts(&self) -> usize {
        self.active.iter().filter(|s| s.potential(s.point(&self.next.x)).energy > 0.0).count()
    }

    /// Kinetic, elastic, load and spring energy of `self.next` [J].
    fn total_energy(&self, report: &DynamicsReport) -> f64 {
        report.kinetic_j + report.elastic_j.unwrap_or(0.0) + self.load_energy(&self.next.x)
    }

    /// Makes one attempt with one scheme and at most `steps` Newton steps. Returns whether the result is
    /// finite.
    fn attempt(
        &mut self,
        team: &mut Team,
        state: &State,
        inputs: &DynamicsInputs<'_>,
        (scheme, steps): (Scheme, u32),
        report: &mut DynamicsReport,
    ) -> bool {
        let increment = self.predict(state, inputs, scheme);
        let beta = if increment.B > 0.0 { self.material.rayleigh.stiffness_s } else { 0.0 };
        if let (true, Some(K)) = (beta > 0.0, &mut self.damping) {
            self.model.rotated_stiffness(&self.next.x, K);
        }
        let iterations = report.newton.linear_iterations;
        report.newton = self.minimise(team, state, inputs, (increment, beta, steps), report);
        report.newton.linear_iterations += iterations;
        if report.newton.stop == StopReason::NonFinite {
            return false;
        }
        if self.settings.linearised && steps == self.settings.newton.steps {
            report.newton = judged_by_its_solve(report.newton, self.settings.newton.tolerance);
        }
        if let (None, Some(displacement)) = (report.notice, report.newton.pivot) {
            report.notice = Some(Notice::Pivot { displacement });
        }
        for c in 0..state.x.len() {
            let (x, B) = (self.next.x[c], increment.B);
            self.next.v[c] = B * (x - self.x_v[c]);
            self.acceleration[c] = increment.A * (x - self.x_a[c]);
        }
        report.kinetic_j = self.mass.kinetic(&self.next.v);
        let elastic_j = self.model.energy_by(team, &self.next.x);
        report.elastic_j = Some(elastic_j);
        finite(&self.next) && (report.kinetic_j + elastic_j).is_finite()
    }

    /// Computes x_a and x_v, and writes the predictor to `self.next.x`.
    fn predict(&mut self, state: &State, inputs: &DynamicsInputs<'_>, scheme: Scheme) -> Increment {
        let h = inputs.h;
        let State { x, v } = state;
        let increment = match scheme {
            Scheme::Static => {
                self.x_a.copy_from_slice(x);
                self.x_v.copy_from_slice(x);
                self.next.x.copy_from_slice(x);
                Increment::NONE
            }
            Scheme::Bdf2 => {
                let before = &self.history.before;
                for c in 0..x.len() {
                    let known = [[&x[c], &v[c]], [&before.x[c], &before.v[c]]];
                    [self.x_v[c], self.x_a[c]] = bdf2_history(h, known[0], known[1]);
                    self.next.x[c] = self.x_a[c];
                }
                Increment::bdf2(h)
            }
            Scheme::Newmark { beta, gamma } => {
                for c in 0..x.len() {
                    let known = [&x[c], &v[c], &self.acceleration[c]];
                    [self.x_v[c], self.x_a[c]] = newmark_history(h, (beta, gamma), known);
                    self.next.x[c] = x[c] + h * v[c];
                }
                Increment::newmark(h, beta, gamma)
            }
            _ => {
                for c in 0..x.len() {
                    self.x_v[c] = x[c];
                    self.x_a[c] = x[c] + h * v[c];
                    self.next.x[c] = self.x_a[c];
                }
                Increment::euler(h)
            }
        };
        self.prescribe(inputs);
        increment
    }

    fn prescribe(&mut self, inputs: &DynamicsInputs<'_>) {
        for f in inputs.fixed {
            for k in (0..3).filter(|&k| f.axes[k]) {
                self.next.x[f.copy as usize][k] = f.position_m[k];
            }
        }
    }

    /// Runs Newton's method from the predictor, and balances the momentum of loose parts before and after
    /// it. A part in free fall then moves before the first iteration. Conjugate gradients find such slow
    /// modes last and need not look for them.
    fn minimise(
        &mut self,
        team: &mut Team,
        state: &State,
        inputs: &DynamicsInputs<'_>,
        (increment, beta, steps): (Increment, f64, u32),
        report: &mut DynamicsReport,
    ) -> NewtonReport {
        let ruined = self.count_ruined(report);
        let settings = self.settings.newton;
        // With a single solve Newmark's method gains energy where the body turns.
        let least = if matches!(report.scheme, Scheme::Newmark { .. }) { 2 } else { 1 };
        let quadratic = matches!(self.model.law(), Law::Linear | Law::Corotational);
        let steps = match quadratic && !ruined && self.active.is_empty() {
            true => steps.max(least),
            false => steps.max(LEAST_NEWTON_STEPS),
        };
        if ruined && steps > settings.steps && report.notice.is_none() {
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
        let loose = increment.A > 0.0 && self.parts.any_free();
        if loose && self.active.is_empty() {
            self.balance_parts(increment);
        }
        let mut phi = StepPotential {
            model: &self.model,
            mass: &self.mass,
            increment,
            x_a: &self.x_a,
            x_v: &self.x_v,
            alpha: self.material.rayleigh.mass_1_s,
            damping: self.damping.as_ref().filter(|_| beta > 0.0).map(|K| (beta, K)),
            f_ext: &self.f_ext,
            springs: &self.active,
            definite: if single { Tangent::Held } else { Tangent::Projected },
            stored: 0.0,
            scratch: &mut self.scratch,
            force: &mut self.force,
        };
        let x = &mut self.next.x;
        if !phi.value(team, x).is_finite() {
            // The velocity is so high that the predictor overflows: start from the present positions.
            x.copy_from_slice(&state.x);
            for f in inputs.fixed {
                for k in (0..3).filter(|&k| f.axes[k]) {
                    x[f.copy as usize][k] = f.position_m[k];
                }
            }
        }
        if let (Scheme::Static, Some(iterations)) = (self.settings.scheme, self.settings.relaxation) {
            self.relaxation.tolerance = settings.tolerance;
            if !self.active.is_empty() {
                self.relaxation.restart_next(); // springs move without being loads
            }
            let done = self.relaxation.relax(team, &mut phi, inputs.fixed, x, iterations);
            return NewtonReport {
                linear_iterations: done.iterations,
                residual: done.residual,
                stop: done.stop,
                indefinite: done.indefinite,
                potential: done.potential,
                ..NewtonReport::default()
            };
        }
        let done = self.newton.minimise(team, &mut phi, x, inputs.fixed);
        if done.stop != StopReason::NonFinite && loose {
            self.balance_parts(increment);
        }
        done
    }

    /// Translates every free part to where its momentum is balanced exactly. An iteration that stops
    /// early leaves a residual, which would be spurious momentum.
    fn balance_parts(&mut self, increment: Increment) {
        let factor = increment.A + self.material.rayleigh.mass_1_s * increment.B;
        let mut g = std::mem::take(&mut self.scratch);
        g.fill(Vector3::zeros());
        // Internal forces and K̂ sum to zero over every part; inertia and loads remain.
        let alpha = self.material.rayleigh.mass_1_s;
        let x = &self.next.x;
        for (s, from) in [(increment.A, &self.x_a), (alpha * increment.B, &self.x_v)] {
            for ((d, x), from) in self.force.iter_mut().zip(x).zip(from) {
                *d = x - from;
            }
            self.mass.add_times(s, &self.force, &mut g);
        }
        self.translations.restart(&self.parts);
        self.translations.begin(&self.parts, factor);
        for (c, g) in g.iter().enumerate() {
            self.translations.add(&self.parts, c, self.f_ext[c] - g);
        }
        for spring in &self.active {
            let response = spring.potential(spring.point(x));
            self.translations.add_spring(&self.parts, spring.main_copy(), response.stiffness, response.force);
        }
        self.translations.solve(&self.parts);
        for (c, x) in self.next.x.iter_mut().enumerate() {
            *x += self.translations.shift[self.parts.of_copy[c] as usize];
        }
        self.scratch = g;
    }

    /// Counts the inverted quadrature points at the predictor into the report. Returns whether any
    /// element is inverted or collapsed.
    fn count_ruined(&self, report: &mut DynamicsReport) -> bool {
        let mut ruined = false;
        report.inverted = 0;
        for e in 0..self.model.n_elements() {
            for q in 0..self.model.kind().points() {
                let F = self.model.deformation_gradient(e, q, &self.next.x);
                let inverted = F.determinant() <= 0.0;
                report.inverted += usize::from(inverted);
                ruined |= inverted || F.norm() < COLLAPSED;
            }
        }
        ruined
    }
}

/// The reason why a body has no equilibrium: a part that is held nowhere, or a free rigid motion that the
/// loads `f_ext` [N] drive. A finite rotation comes to an end, but the linear law knows no finite
/// rotations. Springs may hold what the boundary conditions do not.
pub fn why_no_equilibrium(
    (free_motions, parts): (&[FreeMotion], &LooseParts),
    law: Law,
    rest: &[Vector3<f64>],
    f_ext: &[Vector3<f64>],
    springs: bool,
) -> Option<Notice> {
    if parts.any_free() {
        return Some(Notice::LooseBody);
    }
    let endless = |m: &&FreeMotion| m.is_translation() || law == Law::Linear;
    let driven = |m: &&FreeMotion| m.is_driven(parts, rest, f_ext);
    let motion = free_motions.iter().filter(endless).find(driven).filter(|_| !springs)?;
    Some(Notice::Underheld { motion: *motion, driven: true })
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
