//! Static equilibrium: f_int(x) = f_ext, solved by Newton's method with a line search on the discrete model.

use std::sync::Arc;

use nalgebra::Vector3;
use scindo_algebra::solver::{Curvature, LinearSettings, Newton, NewtonSettings, PcgSettings, StopReason};
use scindo_matter::material::Law;

use super::{Body, BodyError};
use crate::integrator::{StaticProblem, find_equilibrium};

/// Stopping criteria of a static solve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StaticSettings {
    /// Relative residual to reach: ‖f_ext − f_int‖ ≤ tolerance · ‖f_ext‖ (or the first residual, if larger).
    pub tolerance: f64,
    /// Largest number of Newton steps.
    pub newton_steps: u32,
    /// When each linear solve stops.
    pub linear: PcgSettings,
}

/// Result of a static solve.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StaticReport {
    /// Whether the tolerance was reached; if not, the body is at the best state found.
    pub converged: bool,
    /// Newton steps that were made.
    pub newton_steps: u32,
    /// Solver iterations, summed over all Newton steps.
    pub iterations: u32,
    /// Final residual relative to the loads.
    pub residual: f64,
}

impl Default for StaticSettings {
    fn default() -> Self {
        Self { tolerance: 1e-8, newton_steps: 200, linear: PcgSettings { iterations: 2000, tolerance: 1e-2 } }
    }
}

impl Body {
    /// Moves the body to its static equilibrium under gravity [m/s²], loads and constraints; it is then
    /// at rest, and nothing is left of the stress that relaxes. Residual and directions are in double precision, whatever
    /// the arithmetic of a step.
    pub fn solve_static(
        &mut self,
        gravity: Vector3<f64>,
        settings: &StaticSettings,
    ) -> Result<StaticReport, BodyError> {
        if let Some(part) = self.parts.free.iter().position(|&free| free) {
            return Err(BodyError::LoosePart { part, mass_kg: self.parts.mass[part] });
        }
        self.state.v.fill(Vector3::zeros());
        if self.pressure_lags() {
            // Here the pressure follows the surface on every path, so it is none of the dead loads.
            self.boundary.node_loads(&*self.space, self.rest.len(), &mut self.load);
        }
        // In the long run nothing is left of the stress that relaxes.
        self.relax_viscous();
        let made;
        let model = match self.dynamics.model().filter(|_| self.settings.prony.is_empty()) {
            Some(model) => model,
            None => {
                let model = self.space.model(&self.material, self.settings.volumetric)?;
                made = model.with_fibres(self.settings.fibres)?;
                &made
            }
        };
        let weight = |v: &f64| self.material.density_kg_m3 * *v * gravity;
        let weights = model.shape_integrals().iter().map(weight);
        let load: Vec<Vector3<f64>> = self.load.iter().zip(weights).map(|(f, w)| f + w).collect();
        let known = self.settings.newton(self.material.law);
        let PcgSettings { iterations, tolerance } = settings.linear;
        let mut newton = Newton::new(NewtonSettings {
            steps: settings.newton_steps,
            tolerance: settings.tolerance,
            curvature: Curvature::Exact,
            linear: LinearSettings { iterations, tolerance, ..known.linear },
            ..known
        });
        newton.set_stiff_modes(self.space.stiff_modes().map(Arc::new));
        let mut problem = StaticProblem::new(model, &load);
        if self.material.law != Law::Linear {
            problem = problem.under(&self.pressure, &self.state.x);
        }
        let done =
            find_equilibrium(&mut newton, &mut self.team, &mut problem, &self.fixed, &mut self.state.x);
        self.dynamics.follow_viscous(&mut self.team, &self.state);
        Ok(StaticReport {
            converged: done.stop == StopReason::Converged,
            newton_steps: done.steps,
            iterations: done.linear_iterations,
            residual: done.residual,
        })
    }
}
