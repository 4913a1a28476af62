//! The general path: any element, law, integrator and solver, in double precision.

use std::sync::Arc;

use nalgebra::Vector3;

use super::settings::BodySettings;
use super::shape::Shape;
use super::{BodyError, Outcome, SolveReport, StaticReport};
use crate::assembly::Model;
use crate::cut::CutMesh;
use crate::integrator::{
    Dynamics, DynamicsInputs, DynamicsOutcome, DynamicsReport, DynamicsSettings, State, StaticProblem,
    find_equilibrium,
};
use crate::material::Material;
use crate::operator::{FixedCopy, StiffModes, degenerate_elements};
use crate::solver::{Newton, NewtonSettings, StopReason};
use crate::team::Team;

/// The general path: integrator, density, and the stiff motions of degenerate elements.
#[derive(Debug)]
pub(super) struct General {
    pub dynamics: Dynamics,
    density_kg_m3: f64,
    /// Stiff motions of degenerate elements; linear tetrahedra only.
    modes: Option<Arc<StiffModes>>,
}

impl General {
    /// Builds the model of `mesh` as it is cut now, without history.
    pub fn new(
        shape: &Shape,
        mesh: &CutMesh,
        material: &Material,
        settings: &BodySettings,
    ) -> Result<Self, BodyError> {
        let mut model = shape.model(mesh, material, settings.volumetric)?;
        if settings.scheme.is_explicit() {
            model.share_mass_evenly();
        }
        let with = DynamicsSettings {
            scheme: settings.scheme,
            mass: settings.mass,
            linearised: settings.is_linearised(material.law),
            newton: settings.newton(material.law),
            relaxation: settings.relaxation_iterations(),
            ..DynamicsSettings::default()
        };
        let mut dynamics = Dynamics::new(model, *material, with)?;
        let modes = if matches!(shape, Shape::Tet4) {
            let elements = degenerate_elements(mesh.mesh());
            StiffModes::new(mesh.mesh(), mesh.pieces(), mesh.n_copies(), &elements).map(Arc::new)
        } else {
            None
        };
        dynamics.set_stiff_modes(modes.clone());
        Ok(Self { dynamics, density_kg_m3: material.density_kg_m3, modes })
    }

    /// The discrete model.
    pub fn model(&self) -> &Model {
        self.dynamics.model()
    }

    /// Advances by the step of `inputs`.
    pub fn step(
        &mut self,
        team: &mut Team,
        state: &mut State,
        inputs: &DynamicsInputs<'_>,
        spring_forces: &mut Vec<Vector3<f64>>,
    ) -> SolveReport {
        report_of(&self.dynamics.step(team, state, inputs, spring_forces))
    }

    /// The state before the last step that advanced.
    pub fn before(&self) -> &State {
        self.dynamics.before()
    }

    /// Moves `x` to equilibrium under `load` [N] and `gravity` [m/s²].
    pub fn equilibrium(
        &self,
        team: &mut Team,
        x: &mut [Vector3<f64>],
        (load, gravity): (&[Vector3<f64>], Vector3<f64>),
        fixed: &[FixedCopy],
        settings: NewtonSettings,
    ) -> StaticReport {
        let weights = self.model().shape_integrals().iter().map(|v| self.density_kg_m3 * v * gravity);
        let load: Vec<Vector3<f64>> = load.iter().zip(weights).map(|(f, w)| f + w).collect();
        let mut problem = StaticProblem::new(self.model(), &load);
        let mut newton = Newton::new(settings);
        newton.set_stiff_modes(self.modes.clone());
        let done = find_equilibrium(&mut newton, team, &mut problem, fixed, x);
        StaticReport {
            converged: done.stop == StopReason::Converged,
            newton_steps: done.steps,
            iterations: done.linear_iterations,
            residual: done.residual,
        }
    }
}

fn report_of(report: &DynamicsReport) -> SolveReport {
    SolveReport {
        iterations: report.newton.linear_iterations,
        residual: report.newton.residual,
        stop: report.newton.stop,
        outcome: match report.outcome {
            DynamicsOutcome::Advanced => Outcome::Advanced,
            DynamicsOutcome::Held => Outcome::Held,
            DynamicsOutcome::Refused => Outcome::Refused,
            DynamicsOutcome::Interrupted => Outcome::Interrupted,
        },
        substeps: report.substeps,
        inverted_pieces: report.inverted,
        refused_springs: report.refused_springs,
        newton_steps: report.newton.steps,
        backtracks: report.newton.backtracks,
        algebraic_error: report.newton.algebraic_error,
        tolerance: 0.0, // a setting of the body
        notice: report.notice,
    }
}
