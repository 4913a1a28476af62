//! The ways to solve the equations of a step, behind one interface.

use std::any::Any;
use std::fmt::Debug;

use nalgebra::Vector3;

use super::course::Course;
use super::linearly_implicit::LinearlyImplicit;
use super::model_solver::ModelSolver;
use super::notice::Notice;
use super::report::SolveReport;
use super::scheme::Scheme;
use super::springs::ActiveSpring;
use super::state::State;
use super::step_inputs::StepInputs;
use crate::assembly::{Model, ModelError};
use crate::element::Points;
use crate::material::Material;
use crate::operator::{FixedCopy, Stiffness};
use crate::solver::multigrid::{CoarsestSolve, LevelReport};
use crate::solver::{Method, NewtonSettings, PcgSettings};
use crate::space::Space;
use crate::storage::saved::saved_as;
use crate::team::Team;

saved_as!(saved_solver, Box, StepSolver, Linear(LinearlyImplicit), Model(ModelSolver));

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

    /// Elastic energy [J] at `x` [m] of the body with these quadrature points.
    fn elastic_energy(&mut self, team: &mut Team, x: &[Vector3<f64>], points: &dyn Points) -> f64;

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

    /// Lumped mass [kg] of every node, for a density [kg/m³].
    fn lumped_masses(&self, space: &dyn Space, density_kg_m3: f64, mass: &mut Vec<f64>);

    /// Of the last step: pieces of degenerate elements, nodes moved relative to others for them, and pieces
    /// that keep a stiff motion.
    fn stiff_motions(&self) -> [usize; 3];

    /// Figures of the levels of multigrid, from the finest on, and how the coarsest one is solved, if it is used.
    fn levels(&self) -> Option<(Vec<LevelReport>, CoarsestSolve)> {
        None
    }

    /// This way as one that bodies can take together, if it is.
    fn linearly_implicit(&mut self) -> Option<&mut LinearlyImplicit> {
        None
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
    /// [`Scheme::Static`] only: number of iterations of matrix-free relaxation per step, in place of Newton's
    /// method. They continue from step to step.
    pub relaxation: Option<u32>,
}

/// Springs for which room is made when the first one acts: those of a ball that bears with all its points. A press that
/// deepens then takes no memory.
const SPRING_ROOM: usize = 64;

/// Makes room in `list` for `each` entries per spring, if there are any springs.
pub fn make_room<T>(list: &mut Vec<T>, springs: usize, each: usize) {
    if springs > 0 {
        list.reserve((each * SPRING_ROOM).saturating_sub(list.len()));
    }
}

/// The springs of a step that can be used.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct ActiveSprings {
    /// Usable springs.
    pub springs: Vec<ActiveSpring>,
    /// Which springs of the inputs these are.
    accepted: Vec<bool>,
}

impl ActiveSprings {
    /// Takes the springs of `inputs`, whose points are at `x` [m] now.
    pub fn begin(&mut self, inputs: &StepInputs<'_>, x: &[Vector3<f64>]) {
        self.springs.clear();
        self.accepted.clear();
        make_room(&mut self.springs, inputs.springs.len(), 1);
        make_room(&mut self.accepted, inputs.springs.len(), 1);
        for spring in inputs.springs {
            let active = ActiveSpring::new(spring, x);
            self.accepted.push(active.is_some());
            self.springs.extend(active);
        }
    }

    /// Number of springs that were left out.
    pub fn refused(&self) -> usize {
        self.accepted.len() - self.springs.len()
    }

    /// Writes the force of every spring in the order of the inputs; 0 for those that were left out.
    pub fn write(&self, forces: &mut [Vector3<f64>], force: impl Fn(&ActiveSpring) -> Vector3<f64>) {
        let mut active = self.springs.iter();
        for (out, &accepted) in forces.iter_mut().zip(&self.accepted) {
            let spring = if accepted { active.next() } else { None };
            *out = spring.map_or_else(Vector3::zeros, &force);
        }
    }
}
