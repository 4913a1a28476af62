//! What a body keeps from step to step.

use nalgebra::Vector3;

use crate::operator::FixedCopy;

/// Positions and velocities that a body keeps from step to step, one entry per copy.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct State {
    /// Positions [m].
    pub x: Vec<Vector3<f64>>,
    /// Velocities [m/s].
    pub v: Vec<Vector3<f64>>,
}

/// A copy lighter than this [kg] has no inertia that single precision could represent.
pub const WEIGHTLESS: f64 = 1e-30;

/// Sets the prescribed directions of `v` to 0.
pub(super) fn hold(fixed: &[FixedCopy], v: &mut [Vector3<f64>]) {
    for f in fixed {
        f.held.clear(&mut v[f.copy as usize]);
    }
}

impl State {
    /// Copies `other` into this state, without allocating if the lengths agree.
    pub fn copy_from(&mut self, other: &State) {
        self.x.clone_from(&other.x);
        self.v.clone_from(&other.v);
    }
}
