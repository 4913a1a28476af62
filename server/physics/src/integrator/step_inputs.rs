//! Inputs of a step, and what a step by linear solves adds to them.

use nalgebra::Vector3;
use scindo_algebra::assembly::pressure::Pressure;
use scindo_algebra::operator::ElasticUpdate;
use scindo_algebra::solver::{LinearReport, PcgSettings};
use scindo_matter::element::Points;
use scindo_matter::element::{FixedCopy, Held};
use scindo_matter::material::Material;

use super::increment::Increment;
use super::parts::LooseParts;
use super::springs::{ActiveSpring, PointSpring};
use super::state::State;

/// Inputs of one step.
#[derive(Clone, Copy, Debug)]
pub struct StepInputs<'a> {
    /// Length of the step h [s].
    pub h: f64,
    /// Acceleration of gravity [m/s²].
    pub gravity: Vector3<f64>,
    /// Lumped mass of every node [kg].
    pub mass: &'a [f64],
    /// Load on every node [N], gravity not included.
    pub load: &'a [Vector3<f64>],
    /// Pressure that follows the surface. Steps by linear solves leave it out: there `load` holds it as of the predictor.
    pub pressure: &'a Pressure,
    /// Prescribed nodes, with their positions at the end of the step.
    pub fixed: &'a [FixedCopy],
    /// Connected parts of the body, and which of them are free.
    pub parts: &'a LooseParts,
    /// Contact and tool springs of this step, whose forces are reported in the same order.
    pub springs: &'a [PointSpring],
    /// Rest position of every node [m].
    pub rest: &'a [Vector3<f64>],
    /// Quadrature points of the body, for what is computed in double precision.
    pub points: &'a dyn Points,
}

impl StepInputs<'_> {
    /// Whether prescribed nodes move in a step from `before`, which puts energy in.
    pub fn is_driven(&self, before: &State) -> bool {
        let x = |f: &FixedCopy| before.x[f.copy as usize];
        self.fixed.iter().any(|f| f.held.gap(&x(f), &f.position_m) != Vector3::zeros())
    }

    /// Number of springs that push or pull with the nodes at `x` [m].
    pub fn contacts(&self, x: impl Fn(usize) -> Vector3<f64>) -> usize {
        let point = |s: &ActiveSpring| s.carriers().map(|(c, w)| w * x(c)).sum();
        self.usable_springs().filter(|s| s.law().potential(point(s)).energy > 0.0).count()
    }

    /// Potential energy of springs and loads at `x` [J]; `weight` is the force of gravity on a node [N].
    pub fn load_energy(&self, x: &[Vector3<f64>], weight: impl Fn(usize) -> Vector3<f64>) -> f64 {
        let moved = x.iter().zip(self.rest).enumerate();
        let loads: f64 = moved.map(|(c, (x, X))| (weight(c) + self.load[c]).dot(&(x - X))).sum();
        self.usable_springs().map(|s| s.law().potential(s.point(x)).energy).sum::<f64>() - loads
    }

    fn usable_springs(&self) -> impl Iterator<Item = ActiveSpring> {
        self.springs.iter().filter_map(|spring| ActiveSpring::usable(spring, self.mass.len()))
    }
}

/// Inputs of a step by linear solves.
#[derive(Clone, Copy, Debug)]
pub struct LinearInputs<'a> {
    pub step: StepInputs<'a>,
    /// Mass of every copy [kg] in single precision.
    pub mass_f32: &'a [f32],
    /// Material constants.
    pub material: &'a Material,
    /// When to stop the solver.
    pub solver: PcgSettings,
    /// How the scheme treats inertia.
    pub inertia: Inertia<'a>,
    /// Linear solves of the step, at least 1; each starts from the result of the one before. An
    /// equilibrium ends earlier once it is reached.
    pub solves: u32,
    /// Whether nothing but the material damps what the step leaves of its equations.
    pub conserves: bool,
}

/// Where a solve of a step begins.
#[derive(Clone, Copy, Debug)]
pub(super) struct Predictor<'a> {
    /// Position x̂ of every copy [m].
    pub x: &'a [Vector3<f64>],
    /// Whether it is the first solve of the step.
    pub first: bool,
}

/// How a scheme treats inertia.
#[derive(Clone, Copy, Debug)]
pub enum Inertia<'a> {
    /// Implicit Euler: x_v = x and x_a = x + h v, from the state alone.
    Euler,
    /// A scheme that remembers earlier steps.
    Remembered(StepHistory<'a>),
    /// None: the step ends in equilibrium with the loads, at rest (A = B = 0, and s = 1).
    None {
        /// Continue the search of the last step if nothing was changed from outside (Nienhuys 2003, §3.3).
        relax: bool,
    },
}

/// A scheme's increment, with x_a and x_v of every copy [m].
#[derive(Clone, Copy, Debug)]
pub struct StepHistory<'a> {
    /// Factors A and B of the scheme.
    pub increment: Increment,
    /// x_a of every copy [m]; it is the predictor, too.
    pub x_a: &'a [Vector3<f64>],
    /// x_v of every copy [m], from which v⁺ = B (x⁺ − x_v).
    pub x_v: &'a [Vector3<f64>],
}

impl LinearInputs<'_> {
    /// s = 1/A [s²], the factor of forces in the system of a step.
    pub(super) fn s(&self) -> f64 {
        match self.inertia {
            Inertia::Euler => self.step.h * self.step.h,
            Inertia::Remembered(history) => 1.0 / history.increment.A,
            Inertia::None { .. } => 1.0,
        }
    }

    /// r = B/A [s].
    pub(super) fn r(&self) -> f64 {
        match self.inertia {
            Inertia::Euler => self.step.h,
            Inertia::Remembered(history) => history.increment.B / history.increment.A,
            Inertia::None { .. } => 0.0,
        }
    }

    /// √s [s]: δ minimises s times an energy.
    pub fn root_s(&self) -> f64 {
        match self.inertia {
            Inertia::Euler => self.step.h,
            Inertia::Remembered(history) => history.increment.A.sqrt().recip(),
            Inertia::None { .. } => 1.0,
        }
    }

    /// B [1/s]. The shortest steps have no finite inverse; nothing moves in them.
    pub(super) fn rate(&self) -> f64 {
        match self.inertia {
            Inertia::Euler => (1.0 / self.step.h).min(f64::MAX),
            Inertia::Remembered(history) => history.increment.B,
            Inertia::None { .. } => 0.0,
        }
    }

    /// Whether there is inertia.
    pub(super) fn moves(&self) -> bool {
        !matches!(self.inertia, Inertia::None { .. })
    }

    /// Whether the step moves material whose law is nonlinear in the stretch, so that it takes solves until its equations
    /// hold.
    pub(super) fn is_nonlinear(&self) -> bool {
        self.moves() && self.solves > 1 && !self.material.law.is_hookean()
    }

    /// Whether the step is an equilibrium whose stiffness turns with the material, so that its solves need a line
    /// search.
    pub(super) fn descends(&self) -> bool {
        !self.moves() && !self.relaxes() && self.material.law.rotates()
    }

    /// Whether the step may continue the search of the last one.
    pub(super) fn relaxes(&self) -> bool {
        matches!(self.inertia, Inertia::None { relax: true, .. })
    }

    /// v̂ = B (x̂ − x_v), the velocity of copy `c` at the predictor.
    #[inline(always)]
    fn velocity(&self, c: usize, state: &State, at: Predictor<'_>) -> Vector3<f64> {
        match &self.inertia {
            Inertia::Euler if at.first => state.v[c],
            Inertia::Euler => (at.x[c] - state.x[c]) * self.rate(),
            Inertia::Remembered(h) => h.increment.B * (at.x[c] - h.x_v[c]),
            Inertia::None { .. } => Vector3::zeros(),
        }
    }

    /// M (x̂ − x_a) of copy `c`. The first solve of implicit Euler begins from x_a.
    #[inline(always)]
    pub(super) fn inertia(&self, c: usize, state: &State, at: Predictor<'_>) -> Vector3<f64> {
        let x_a = match &self.inertia {
            Inertia::Remembered(h) => h.x_a[c],
            Inertia::Euler if !at.first => state.x[c] + self.step.h * state.v[c],
            Inertia::Euler | Inertia::None { .. } => return Vector3::zeros(),
        };
        self.step.mass[c] * (at.x[c] - x_a)
    }

    /// m g + load − α m v̂ of copy `c` [N].
    #[inline(always)]
    pub(super) fn external(&self, c: usize, state: &State, at: Predictor<'_>) -> Vector3<f64> {
        let drag = self.material.rayleigh.mass_1_s;
        let velocity = self.velocity(c, state, at);
        self.step.mass[c] * (self.step.gravity - drag * velocity) + self.step.load[c]
    }

    /// K̂ and its factor s + rβ.
    pub(super) fn elastic_update(&self) -> ElasticUpdate {
        let Material { law, rayleigh, .. } = *self.material;
        let scale = self.s() + self.r() * rayleigh.stiffness_s;
        ElasticUpdate { lame: self.material.lame(), law, scale }
    }

    /// 1 + rα; 0 without inertia.
    pub(super) fn mass_factor(&self) -> f64 {
        if self.moves() { 1.0 + self.r() * self.material.rayleigh.mass_1_s } else { 0.0 }
    }

    /// The prescribed directions of a copy.
    pub(super) fn held_of(&self, copy: u32) -> Held {
        let found = self.step.fixed.binary_search_by_key(&copy, |f| f.copy);
        found.map_or(Held::NOT, |f| self.step.fixed[f].held)
    }

    /// Whether both steps have the same loads and prescribed positions, and none has springs.
    pub(super) fn is_loaded_as(&self, known: &KnownLoads) -> bool {
        self.step.springs.is_empty()
            && known.material == Some(*self.material)
            && known.gravity == self.step.gravity
            && known.load == self.step.load
            && known.fixed == self.step.fixed
    }
}

/// The loads of a step, to be compared with those of the next.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct KnownLoads {
    material: Option<Material>,
    gravity: Vector3<f64>,
    load: Vec<Vector3<f64>>,
    fixed: Vec<FixedCopy>,
}

impl KnownLoads {
    /// Records the loads of `inputs`.
    pub(super) fn note(&mut self, inputs: &LinearInputs<'_>) {
        self.material = Some(*inputs.material);
        self.gravity = inputs.step.gravity;
        self.load.clear();
        self.load.extend_from_slice(inputs.step.load);
        self.fixed.clear();
        self.fixed.extend_from_slice(inputs.step.fixed);
    }
}

/// Result of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepOutcome {
    /// Report of the last linear solve; iterations are those of all passes.
    pub solve: LinearReport,
    /// Linear solves made.
    pub solves: u32,
    /// Residual that rounding may leave of the equations of the step; 0 where a linear solve makes it.
    pub rounding: f64,
    /// Pieces with det F ≤ 0 at the predictor.
    pub inverted_pieces: usize,
    /// Springs left out because one of their numbers is unusable.
    pub refused_springs: usize,
    /// Halvings of the line searches of an equilibrium.
    pub backtracks: u32,
    /// Work [J] that the internal forces did if the step solved its equations.
    pub work_j: f64,
    /// Whether everything stayed finite. If not, the state was left as it was.
    pub finite: bool,
}
