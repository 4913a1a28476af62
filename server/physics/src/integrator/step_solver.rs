//! The ways to solve the equations of a step, behind one interface.

use std::any::Any;
use std::fmt::Debug;

use nalgebra::Vector3;
use scindo_algebra::assembly::{Model, ModelError};
use scindo_algebra::operator::Stiffness;
use scindo_algebra::solver::multigrid::{CoarsestSolve, CycleShape, LevelReport};
use scindo_algebra::solver::{Method, NewtonSettings, PcgSettings};
use scindo_matter::element::FixedCopy;
use scindo_matter::element::Points;
use scindo_matter::material::Material;
use scindo_matter::team::Team;

use super::course::Course;
use super::notice::Notice;
use super::report::SolveReport;
use super::scheme::Scheme;
use super::state::State;
use super::step_inputs::StepInputs;
use super::together::Member;
use crate::space::Space;

/// Solves the equations of one step, from the state before it. What all ways have in common (history,
/// guards, energy balance, report) is in [`Dynamics`](super::Dynamics).
pub trait StepSolver: Any + Debug + Send {
    /// Moves `state` by the step with `scheme`, and writes spring forces and report. If the result is not
    /// finite the outcome is `Held`, and `state` may be anything.
    fn attempt(
        &mut self,
        team: &mut Team,
        course: &mut Course,
        state: &mut State,
        step: (Scheme, &StepInputs<'_>),
        results: (&mut SolveReport, &mut [Vector3<f64>]),
    );

    /// Prepares an attempt that replaces one that failed or gained energy; it is made with implicit Euler.
    fn be_careful(&mut self, careful: bool) {
        let _ = careful;
    }

    /// Whether a step that was made with `scheme` may be made again, because it would come out otherwise.
    fn may_repeat(&self, scheme: Scheme) -> bool {
        scheme != Scheme::ImplicitEuler
    }

    /// Why the inputs cannot be used.
    fn why_refused(&self, state: &State, inputs: &StepInputs<'_>) -> Option<Notice> {
        let _ = (state, inputs);
        None
    }

    /// Computes the acceleration [m/s²] of every node at `state`, 0 where it is prescribed. Newmark's method
    /// starts from it.
    fn accelerate(
        &mut self,
        team: &mut Team,
        state: &State,
        inputs: &StepInputs<'_>,
        acceleration: &mut [Vector3<f64>],
    );

    /// Elastic energy [J] in `state` of the body with these quadrature points.
    fn elastic_energy(&mut self, team: &mut Team, state: &State, points: &dyn Points) -> f64;

    /// Elastic energy [J] that is not told from rounding, of a body with these lumped masses [kg].
    fn rounding_energy(&self, mass: &[f64]) -> f64 {
        let _ = mass;
        0.0
    }

    /// Follows `state`, whose strains of springs were changed from outside.
    fn follow_viscous(&mut self, team: &mut Team, state: &State) {
        let _ = (team, state);
    }

    /// ½ vᵀ M v [J].
    fn kinetic_energy(&self, mass: &[f64], v: &[Vector3<f64>]) -> f64 {
        mass.iter().zip(v).map(|(m, v)| 0.5 * m * v.norm_squared()).sum()
    }

    /// Force of gravity `g` [m/s²] on node `c` of lumped mass `m` [N].
    fn weight(&self, c: usize, m: f64, g: Vector3<f64>) -> Vector3<f64> {
        let _ = c;
        m * g
    }

    /// Forgets what earlier steps have found, because the state or the material was changed from outside.
    fn restart(&mut self) {}

    /// Takes new prescribed directions.
    fn hold(&mut self, fixed: &[FixedCopy]) {
        let _ = fixed;
    }

    /// Takes new elastic constants and damping.
    fn set_material(&mut self, material: Material);

    /// Takes new stopping criteria of the solvers.
    fn set_solver(&mut self, settings: SolverSettings);

    /// Follows the last cut of `space`.
    fn follow_cut(&mut self, team: &mut Team, space: &dyn Space) -> Result<(), ModelError>;

    /// Starts anew from `space` as it is now.
    fn rebuild(&mut self, space: &dyn Space) -> Result<(), ModelError>;

    /// Updates everything else that follows from the topology and from the masses [kg].
    fn follow_masses(&mut self, space: &dyn Space, mass: &[f64]);

    /// The same after a cut that changed the masses of some copies alone, see [`Space::reweighed`]: these are computed
    /// anew for a density [kg/m³]. Returns whether that was enough.
    fn reweigh(&mut self, _space: &dyn Space, _density_kg_m3: f64, _mass: &mut Vec<f64>) -> bool {
        false
    }

    /// Lumped mass [kg] of every node, for a density [kg/m³].
    fn lumped_masses(&self, space: &dyn Space, density_kg_m3: f64, mass: &mut Vec<f64>);

    /// Of the last step: pieces of degenerate elements, nodes moved relative to others for them, and pieces
    /// that keep a stiff motion.
    fn stiff_motions(&self) -> [usize; 3];

    /// Figures of the levels of multigrid, from the finest on, and how the coarsest one is solved, if it is used.
    fn levels(&self) -> Option<(Vec<LevelReport>, CoarsestSolve)> {
        None
    }

    /// Whether bodies can take this way together, as [`member`](Self::member)s of one step.
    fn can_step_together(&self) -> bool {
        false
    }

    /// This body's part of a step of several bodies with implicit Euler, if it can be part of one.
    fn member<'a>(
        &'a mut self,
        team: &'a mut Team,
        (course, state): (&mut Course, &'a mut State),
        inputs: StepInputs<'a>,
        spring_forces: &'a mut [Vector3<f64>],
    ) -> Option<Member<'a>> {
        let _ = (team, course, state, inputs, spring_forces);
        None
    }

    /// Moves copies without mass along with the rest of their piece, after a step that bodies made together: no
    /// force would move them.
    fn carry_weightless(&self, state: &mut State, inputs: &StepInputs<'_>) {
        let _ = (state, inputs);
    }

    /// The discrete model in double precision, if this way has one.
    fn model(&self) -> Option<&Model> {
        None
    }

    /// The stiffness in single precision, if this way has one.
    fn stiffness_mut(&mut self) -> Option<&mut dyn Stiffness> {
        None
    }
}

/// When the solvers stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolverSettings {
    /// Newton's method and its linear solves.
    pub newton: NewtonSettings,
    /// Linear solves of a step that is a fixed number of them by design, and when each of them stops.
    pub linear: (u32, PcgSettings),
    /// Method of these linear solves.
    pub method: Method,
    /// Level of multigrid that is simulated; 0 is the finest one.
    pub simulate_level: u8,
    /// Shape of the cycles of multigrid.
    pub cycle: CycleShape,
    /// [`Scheme::Static`] only: number of iterations of matrix-free relaxation per step, in place of Newton's
    /// method. They continue from step to step.
    pub relaxation: Option<u32>,
}
