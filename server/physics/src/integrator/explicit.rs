//! Explicit schemes: symplectic Euler, midpoint, fourth-order Runge–Kutta.

use nalgebra::Vector3;
use scindo_algebra::assembly::Tangent;
use scindo_matter::element::FixedCopy;
use scindo_matter::material::Law;
use scindo_matter::team::Team;
use scindo_matter::team::phase::Phase;

use super::course::Course;
use super::critical_step::stable_step;
use super::model_solver::{ModelSolver, finite};
use super::notice::Notice;
use super::report::{Outcome, SolveReport};
use super::scheme::Scheme;
use super::state::{State, hold};
use super::step_inputs::StepInputs;

/// Fraction of the longest stable step that is used.
const MARGIN: f64 = 0.95;
/// Steps after which ω_max is computed again, for a body whose stiffness changes.
const RECHECK: u32 = 128;
/// A step that did not stay finite is tried again with sub-steps half, then a quarter as long.
const RETRIES: u32 = 2;

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
        let stable_s = self.stable_step(team, before, inputs.fixed);
        report.stable_step_s = Some(stable_s);
        let parts = (inputs.h / (MARGIN * stable_s) * (1.0 - 1e-9)).ceil().max(1.0);
        // The cast saturates: a stable step of length zero needs more parts than anyone allows.
        let needed = if parts.is_nan() { u32::MAX } else { parts as u32 };
        if needed > self.settings.most_substeps.max(1) {
            report.outcome = Outcome::Refused;
            report.notice = Some(Notice::TooLong { h_s: inputs.h, stable_s, needed });
            return;
        }
        for retry in 0..=RETRIES {
            report.substeps = needed << retry;
            report.notice = match (retry, report.substeps) {
                (0, 1) => None,
                (0, substeps) => Some(Notice::Divided { substeps, stable_s }),
                (_, substeps) => Some(Notice::DividedAgain { substeps }),
            };
            let h = inputs.h / f64::from(report.substeps);
            state.copy_from(before);
            // Prescribed nodes move at the constant velocity that reaches their target.
            for f in inputs.fixed {
                let c = f.copy as usize;
                f.held.clear(&mut state.v[c]);
                state.v[c] += f.held.gap(&before.x[c], &f.position_m) / inputs.h;
            }
            for k in 1..=report.substeps {
                if team.told_to_stop() {
                    return;
                }
                let part = (h, f64::from(k) / f64::from(report.substeps));
                self.substep(team, (before, state), inputs, part);
            }
            if finite(state) {
                return;
            }
        }
        report.outcome = Outcome::Held;
    }

    /// Longest stable step [s], including the springs of this step.
    fn stable_step(&mut self, team: &mut Team, state: &State, fixed: &[FixedCopy]) -> f64 {
        // Body and springs are bounded apart: springs change with every step, ω_max of the body does not.
        let body = match self.omega_squared {
            Some((omega_squared, left)) if left > 0 || self.model.law() == Law::Linear => {
                self.omega_squared = Some((omega_squared, left.saturating_sub(1)));
                omega_squared
            }
            _ => {
                let K = self.tangent.get_or_insert_with(|| self.model.pattern());
                self.model.tangent(&state.x, Tangent::Projected, K);
                let omega_squared = self.power.omega_max(team, K, &mut self.mass, fixed).powi(2);
                self.omega_squared = Some((omega_squared, RECHECK));
                omega_squared
            }
        };
        let springs = self.power.spring_bound(&self.active.springs, &self.mass.lumped);
        stable_step(self.settings.scheme, (body + springs).sqrt(), self.material.rayleigh)
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
