//! What a body keeps from step to step.

use nalgebra::Vector3;
use scindo_matter::element::FixedCopy;
use scindo_matter::material::Strain;

/// What a body keeps from step to step: positions and velocities, one entry per copy, and what relaxes in a viscoelastic
/// body.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct State {
    /// Positions [m].
    pub x: Vec<Vector3<f64>>,
    /// Velocities [m/s].
    pub v: Vec<Vector3<f64>>,
    /// Strains d of the springs of a [`Prony`](scindo_matter::material::Prony) series, per element, quadrature point and term.
    /// Empty without one.
    pub viscous: Vec<Strain>,
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
        self.viscous.clone_from(&other.viscous);
    }

    /// The same without what relaxes.
    pub fn copy_motion_from(&mut self, other: &State) {
        self.x.clone_from(&other.x);
        self.v.clone_from(&other.v);
    }
}
