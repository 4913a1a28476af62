//! Time integration: one step in time, or the way to an equilibrium.

mod scheme;
mod settings;
mod report;
mod step_inputs;
mod step_solver;
mod dynamics;
mod course;
mod multistep;
mod history;
mod guard;
mod notice;
pub(crate) mod increment;
mod parts;
mod local_connectivity;
mod free_motion;
mod spin;
mod springs;
mod linearly_implicit;
mod linear_step;
mod held_energy;
mod model_solver;
mod fully_implicit;
mod potential;
mod statics;
mod relaxation;
mod explicit;
mod critical_step;
mod mass;

pub use critical_step::{omega_max, stable_step};
pub use dynamics::{Dynamics, DynamicsError};
pub use free_motion::{FreeMotion, free_motions};
pub use increment::Increment;
pub use linearly_implicit::LinearlyImplicit;
pub use local_connectivity::LocalConnectivity;
pub use model_solver::ModelSolver;
pub use multistep::Multistep;
pub use notice::Notice;
pub use parts::LooseParts;
pub use relaxation::{Relaxation, RelaxationReport};
pub use report::{Outcome, SolveReport};
pub use scheme::{MassKind, Scheme};
pub use settings::{DynamicsSettings, LEAST_NEWTON_STEPS};
pub use springs::{PointSpring, SpringKind};
pub use statics::{StaticProblem, find_equilibrium, prescribe};
pub use step_inputs::StepInputs;
pub use step_solver::{SolverSettings, StepSolver};

use nalgebra::Vector3;

use crate::operator::FixedCopy;

/// Positions and velocities that a body keeps from step to step, one entry per copy.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct State {
    /// Positions [m].
    pub x: Vec<Vector3<f64>>,
    /// Velocities [m/s].
    pub v: Vec<Vector3<f64>>,
}

/// A copy lighter than this [kg] has no inertia that single precision could represent.
pub const WEIGHTLESS: f64 = 1e-30;

/// Sets the prescribed directions of `v` to 0.
fn hold(fixed: &[FixedCopy], v: &mut [Vector3<f64>]) {
    for f in fixed {
        for axis in (0..3).filter(|&axis| f.axes[axis]) {
            v[f.copy as usize][axis] = 0.0;
        }
    }
}

impl State {
    /// Copies `other` into this state, without allocating if the lengths agree.
    pub fn copy_from(&mut self, other: &State) {
        self.x.clone_from(&other.x);
        self.v.clone_from(&other.v);
    }
}
