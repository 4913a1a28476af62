//! Explicit schemes: symplectic Euler, midpoint, fourth-order Runge–Kutta.

use nalgebra::Vector3;
use scindo_algebra::assembly::Tangent;
use scindo_matter::element::Points;
use scindo_matter::material::Law;
use scindo_matter::team::Team;
use scindo_matter::team::phase::Phase;

use super::course::Course;
use super::critical_step::{Frequency, stable_step};
use super::model_solver::{ModelSolver, finite};
use super::notice::Notice;
use super::report::{Outcome, SolveReport};
use super::scheme::Scheme;
use super::state::{State, hold};
use super::step_inputs::StepInputs;

/// Fraction of the longest stable step that is used.
const MARGIN: f64 = 0.95;
/// Looks at ω_max after which it is computed again, for a body whose stiffness changes.
const RECHECK: u32 = 128;
/// Growth of the largest squared stretch of a body after which ω_max is computed again.
const STIFFER: f64 = 1.02;
/// A step that did not stay finite, or whose material stiffened in it, is tried again with shorter sub-steps, so often.
const RETRIES: u32 = 3;

impl ModelSolver {
    /// Makes the step. If it would take too many parts, it is refused.
    pub(super) fn explicit_step(
        &mut self,
        team: &mut Team,
        (course, state): (&Course, &mut State),
        inputs: &StepInputs<'_>,
        report: &mut SolveReport,
    ) {
        let before = &course.before;
        let mut stable_s = self.stable_step(team, before, inputs);
        let mut substeps = parts(inputs.h, stable_s);
        report.notice = (substeps > 1).then_some(Notice::Divided { substeps, stable_s });
        for _ in 0..=RETRIES {
            report.stable_step_s = Some(stable_s);
            report.substeps = substeps;
            if substeps > self.settings.most_substeps.max(1) {
                report.outcome = Outcome::Refused;
                report.notice = Some(Notice::TooLong { h_s: inputs.h, stable_s, needed: substeps });
                return;
            }
            self.substeps(team, before, state, inputs, substeps);
            if team.told_to_stop() {
                return;
            }
            if !finite(state) {
                substeps = substeps.saturating_mul(2);
                report.notice = Some(Notice::DividedAgain { substeps });
                continue;
            }
            if !self.model.stiffens() {
                return;
            }
            // Material that has stiffened on the way needs parts that are stable at its end, too.
            stable_s = stable_s.min(self.stable_step(team, state, inputs));
            let needed = parts(inputs.h, stable_s);
            if needed <= substeps {
                return;
            }
            substeps = needed;
            report.notice = Some(Notice::Divided { substeps, stable_s });
        }
        report.outcome = Outcome::Held;
    }

    /// Makes a step in so many parts.
    fn substeps(
        &mut self,
        team: &mut Team,
        before: &State,
        state: &mut State,
        inputs: &StepInputs<'_>,
        substeps: u32,
    ) {
        let h = inputs.h / f64::from(substeps);
        state.copy_from(before);
        // Prescribed nodes move at the constant velocity that reaches their target.
        for f in inputs.fixed {
            let c = f.copy as usize;
            f.held.clear(&mut state.v[c]);
            state.v[c] += f.held.gap(&before.x[c], &f.position_m) / inputs.h;
        }
        for k in 1..=substeps {
            if team.told_to_stop() {
                return;
            }
            let part = (h, f64::from(k) / f64::from(substeps));
            self.substep(team, (before, state), inputs, part);
        }
    }

    /// Longest stable step [s], including the springs of this step.
    fn stable_step(&mut self, team: &mut Team, state: &State, inputs: &StepInputs<'_>) -> f64 {
        // Body and springs are bounded apart: springs change with every step, ω_max of the body hardly does.
        let largest = if self.model.stiffens() { largest_stretch(inputs.points, &state.x) } else { 0.0 };
        let known = self.frequency.take().filter(|known| {
            self.model.law() == Law::Linear || (known.left > 0 && largest <= STIFFER * known.largest)
        });
        let body = match known {
            Some(known) => Frequency { left: known.left.saturating_sub(1), ..known },
            None => {
                let K = self.tangent.get_or_insert_with(|| self.model.pattern());
                self.model.tangent(&state.x, Tangent::Projected, K);
                let omega = self.power.omega_max(team, K, &mut self.mass, inputs.fixed);
                Frequency { omega_squared: omega.powi(2), left: RECHECK, largest }
            }
        };
        self.frequency = Some(body);
        let springs = self.power.spring_bound(&self.active.springs, &self.mass.lumped);
        stable_step(self.settings.scheme, (body.omega_squared + springs).sqrt(), self.material.rayleigh)
    }

    /// Makes one part of length `h` [s], which ends at the fraction `s` of the step from `before`.
    fn substep(
        &mut self,
        team: &mut Team,
        (before, next): (&State, &mut State),
        inputs: &StepInputs<'_>,
        (h, s): (f64, f64),
    ) {
        let [mut x, mut v, mut a, mut dx, mut dv] = std::mem::take(&mut self.stages);
        match self.settings.scheme {
            Scheme::Midpoint => {
                self.acceleration_at(team, [&next.x, &next.v], inputs, &mut a);
                shifted(&next.x, h / 2.0, &next.v, &mut x);
                shifted(&next.v, h / 2.0, &a, &mut v);
                self.acceleration_at(team, [&x, &v], inputs, &mut a);
                add(&mut next.x, h, &v);
                add(&mut next.v, h, &a);
            }
            Scheme::Rk4 => {
                // Stage k at c h: k_x = v_k, k_v = a(x_k, v_k); sums with weights 1, 2, 2, 1.
                dx.fill(Vector3::zeros());
                dv.fill(Vector3::zeros());
                x.copy_from_slice(&next.x);
                v.copy_from_slice(&next.v);
                for (weight, forward) in [(1.0, 0.5), (2.0, 0.5), (2.0, 1.0), (1.0, 0.0)] {
                    self.acceleration_at(team, [&x, &v], inputs, &mut a);
                    add(&mut dx, weight, &v);
                    add(&mut dv, weight, &a);
                    shifted(&next.x, h * forward, &v, &mut x);
                    shifted(&next.v, h * forward, &a, &mut v);
                }
                add(&mut next.x, h / 6.0, &dx);
                add(&mut next.v, h / 6.0, &dv);
            }
            _ => {
                self.acceleration_at(team, [&next.x, &next.v], inputs, &mut a);
                add(&mut next.v, h, &a);
                add(&mut next.x, h, &next.v);
            }
        }
        // Set rather than integrated, so that prescribed nodes arrive without rounding.
        for f in inputs.fixed {
            let c = f.copy as usize;
            let there = before.x[c] + s * f.held.gap(&before.x[c], &f.position_m);
            f.held.place(&mut next.x[c], &there.into());
        }
        self.stages = [x, v, a, dx, dv];
    }

    /// a = M⁻¹ (f_ext + f_pressure(x) + f_springs(x) − f_int(x) − α M v − β K̂(x) v) [m/s²], 0 where prescribed.
    pub(super) fn acceleration_at(
        &mut self,
        team: &mut Team,
        [x, v]: [&[Vector3<f64>]; 2],
        inputs: &StepInputs<'_>,
        a: &mut [Vector3<f64>],
    ) {
        team.begin(Phase::Residual);
        let rayleigh = self.material.rayleigh;
        self.model.internal_forces_by(team, x, &mut self.force);
        if rayleigh.stiffness_s > 0.0 {
            self.model.add_rotated_stiffness_times(rayleigh.stiffness_s, x, v, &mut self.force);
        }
        if rayleigh.mass_1_s > 0.0 {
            self.mass.add_times(rayleigh.mass_1_s, v, &mut self.force);
        }
        for (f, f_ext) in self.force.iter_mut().zip(&self.f_ext) {
            *f = f_ext - *f;
        }
        inputs.pressure.add_forces(x, &mut self.force);
        for spring in &self.active.springs {
            let force = spring.law().potential(spring.point(x)).force;
            spring.carriers().for_each(|(c, w)| self.force[c] += w * force);
        }
        hold(inputs.fixed, &mut self.force);
        team.begin(Phase::Solve);
        a.fill(Vector3::zeros());
        self.mass.solve(team, &self.force, a);
        hold(inputs.fixed, a);
        team.begin(Phase::Commit);
    }
}

/// Number of parts of a step of `h` [s].
fn parts(h: f64, stable_s: f64) -> u32 {
    let parts = (h / (MARGIN * stable_s) * (1.0 - 1e-9)).ceil().max(1.0);
    // The cast saturates: a stable step of length zero needs more parts than anyone allows.
    if parts.is_nan() { u32::MAX } else { parts as u32 }
}

/// Largest ‖F‖² of a body.
fn largest_stretch(points: &dyn Points, x: &[Vector3<f64>]) -> f64 {
    let mut largest = 0.0_f64;
    points.for_points(x, &mut |point| largest = largest.max(point.F.norm_squared()));
    largest
}

/// y += s x.
fn add(y: &mut [Vector3<f64>], s: f64, x: &[Vector3<f64>]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y += s * x;
    }
}

/// z = y + s x.
fn shifted(y: &[Vector3<f64>], s: f64, x: &[Vector3<f64>], z: &mut [Vector3<f64>]) {
    for ((z, y), x) in z.iter_mut().zip(y).zip(x) {
        *z = y + s * x;
    }
}
