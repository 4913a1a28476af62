//! What a step by linear solves is made from, and how it went.

use nalgebra::Vector3;

use super::State;
use super::increment::Increment;
use super::parts::LooseParts;
use super::springs::PointSpring;
use crate::material::Material;
use crate::operator::{ElasticUpdate, FixedCopy};
use crate::solver::{PcgReport, PcgSettings};

/// What a step is made from.
#[derive(Clone, Copy, Debug)]
pub struct StepInputs<'a> {
    /// Length of the step h [s].
    pub h: f64,
    /// Acceleration of gravity [m/s²].
    pub gravity: Vector3<f64>,
    /// Mass of every copy [kg].
    pub mass: &'a [f64],
    /// The same in single precision.
    pub mass_f32: &'a [f32],
    /// Load on every copy [N], gravity not included.
    pub load: &'a [Vector3<f64>],
    /// Prescribed copies.
    pub fixed: &'a [FixedCopy],
    /// Connected parts.
    pub parts: &'a LooseParts,
    /// Springs of this step.
    pub springs: &'a [PointSpring],
    /// Material constants.
    pub material: &'a Material,
    /// When to stop the solver.
    pub solver: PcgSettings,
    /// What the scheme makes of earlier steps; `None` is implicit Euler, which needs nothing but the state.
    pub history: Option<StepHistory<'a>>,
    /// Linear solves of the step, each from where the one before led; at least 1.
    pub solves: u32,
}

/// A scheme's increment, with x_a and x_v of every copy [m].
#[derive(Clone, Copy, Debug)]
pub struct StepHistory<'a> {
    /// A and B.
    pub increment: Increment,
    /// x_a, which is the predictor too.
    pub x_a: &'a [Vector3<f64>],
    /// x_v.
    pub x_v: &'a [Vector3<f64>],
}

impl StepInputs<'_> {
    /// s = 1/A [s²]: what forces are multiplied with.
    pub(super) fn s(&self) -> f64 {
        self.history.map_or(self.h * self.h, |history| 1.0 / history.increment.A)
    }

    /// r = B/A [s].
    pub(super) fn r(&self) -> f64 {
        self.history.map_or(self.h, |history| history.increment.B / history.increment.A)
    }

    /// √s [s]: δ minimises an energy times s.
    pub fn root_s(&self) -> f64 {
        self.history.map_or(self.h, |history| history.increment.A.sqrt().recip())
    }

    /// B [1/s]. The shortest steps have no finite inverse; nothing moves in them.
    pub(super) fn rate(&self) -> f64 {
        self.history.map_or((1.0 / self.h).min(f64::MAX), |history| history.increment.B)
    }

    /// v̂ = B (x̂ − x_v) of copy `c`, which the predictor x̂ takes for its velocity.
    #[inline(always)]
    fn predicted_velocity(&self, c: usize, state: &State, predicted: &[Vector3<f64>]) -> Vector3<f64> {
        self.history.map_or_else(|| state.v[c], |h| h.increment.B * (predicted[c] - h.x_v[c]))
    }

    /// M (x̂ − x_a) of copy `c`, and 0 for implicit Euler, which makes one solve from x_a.
    #[inline(always)]
    pub(super) fn inertia(&self, c: usize, predicted: &[Vector3<f64>]) -> Vector3<f64> {
        self.history.map_or_else(Vector3::zeros, |h| self.mass[c] * (predicted[c] - h.x_a[c]))
    }

    /// m g + load − α m v̂ of copy `c` [N].
    #[inline(always)]
    pub(super) fn external(&self, c: usize, state: &State, predicted: &[Vector3<f64>]) -> Vector3<f64> {
        let drag = self.material.rayleigh.mass_1_s;
        let velocity = self.predicted_velocity(c, state, predicted);
        self.mass[c] * (self.gravity - drag * velocity) + self.load[c]
    }

    /// K̂ and its factor s + rβ.
    pub(super) fn elastic_update(&self) -> ElasticUpdate {
        let Material { law, rayleigh, .. } = *self.material;
        let scale = self.s() + self.r() * rayleigh.stiffness_s;
        ElasticUpdate { lame: self.material.lame(), law, scale }
    }

    /// 1 + rα.
    pub(super) fn mass_factor(&self) -> f64 {
        1.0 + self.r() * self.material.rayleigh.mass_1_s
    }
}

/// How a step went.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepOutcome {
    /// How the last linear solve went; iterations are those of all passes.
    pub solve: PcgReport,
    /// Pieces with det F ≤ 0 at the predictor.
    pub inverted_pieces: usize,
    /// Springs that were left out because a number in them is not usable.
    pub refused_springs: usize,
    /// Whether everything stayed finite. If not, the state was left as it was.
    pub finite: bool,
}
