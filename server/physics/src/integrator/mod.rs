//! One step in time.

mod dynamics;
mod free_motion;
mod implicit_euler;
mod parts;
mod local_connectivity;
mod spin;
mod springs;
mod statics;
mod relaxation;

pub use dynamics::{
    Dynamics, DynamicsError, DynamicsInputs, DynamicsOutcome, DynamicsReport, DynamicsSettings,
    LEAST_NEWTON_STEPS, MassKind, Notice, Scheme, stable_step,
};
pub use free_motion::{FreeMotion, free_motions};
pub use implicit_euler::{ImplicitEuler, StepInputs, StepOutcome};
pub use local_connectivity::LocalConnectivity;
pub use parts::LooseParts;
pub use relaxation::{Relaxation, RelaxationReport};
pub use spin::SpinGuard;
pub use springs::{PointSpring, SpringKind};
pub use statics::{StaticProblem, find_equilibrium, prescribe};

use nalgebra::Vector3;

/// What a body remembers from step to step, one entry per copy.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct State {
    /// Positions [m].
    pub x: Vec<Vector3<f64>>,
    /// Velocities [m/s].
    pub v: Vec<Vector3<f64>>,
}

impl State {
    /// Copies `other` into this state without allocating, where the lengths agree.
    pub fn copy_from(&mut self, other: &State) {
        self.x.clone_from(&other.x);
        self.v.clone_from(&other.v);
    }
}
