//! Motion of a [`Model`]: every scheme, either mass, Rayleigh damping, contacts, guards.
//!
//! Explicit schemes check the critical time step; they divide a step that is too long, or refuse it.
//! Implicit schemes minimise the incremental potential of the step by Newton's method with backtracking,
//! so that contacts, inverted elements and any law are treated alike. Whatever happens, the state stays
//! finite. Every departure from what was requested is reported.

mod critical_step;
mod explicit;
mod implicit;
mod mass;
mod potential;
mod report;
mod settings;

pub use critical_step::stable_step;
pub use implicit::why_no_equilibrium;
pub use report::{DynamicsOutcome, DynamicsReport};
pub use settings::{DynamicsSettings, LEAST_NEWTON_STEPS, MassKind, Scheme};

use std::sync::Arc;

use nalgebra::Vector3;
use thiserror::Error;

use super::State;
use super::free_motion::{FreeMotion, free_motions};
use super::history::History;
use super::notice::Notice;
use super::parts::{LooseParts, Translations};
use super::relaxation::Relaxation;
use super::spin::SpinGuard;
use super::springs::{ActiveSpring, PointSpring};
use crate::assembly::{BlockCsr, Model, Tangent};
use crate::cut::NewCopy;
use crate::integrator::guard::Ledger;
use crate::material::Material;
use crate::operator::{FixedCopy, StiffModes};
use crate::solver::{Newton, NewtonSettings};
use crate::team::Team;
use critical_step::PowerIteration;
use mass::Mass;

/// Positions beyond this [m] count as not finite.
const FARTHEST: f64 = 1e15;

/// Inputs of one step.
#[derive(Clone, Copy, Debug)]
pub struct DynamicsInputs<'a> {
    /// Length of the step h [s].
    pub h: f64,
    /// Acceleration of gravity [m/s²].
    pub gravity: Vector3<f64>,
    /// Load on every node [N], gravity not included.
    pub load: &'a [Vector3<f64>],
    /// Prescribed nodes, with their positions at the end of the step.
    pub fixed: &'a [FixedCopy],
    /// Contact and tool springs of this step, whose forces are reported in the same order.
    pub springs: &'a [PointSpring],
}

/// Settings with which no step can be made.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum DynamicsError {
    /// Newmark's parameters are out of range.
    #[error("Newmark parameters beta = {beta}, gamma = {gamma}: beta must be in (0, 1], gamma in [0.5, 2]")]
    Newmark {
        /// β.
        beta: f64,
        /// γ.
        gamma: f64,
    },
}

/// Integrates the motion of one body; owns all memory that a step needs.
#[derive(Debug)]
pub struct Dynamics {
    model: Model,
    material: Material,
    settings: DynamicsSettings,
    mass: Mass,
    newton: Newton,
    relaxation: Relaxation,
    parts: LooseParts,
    /// Rigid motions of held parts that the constraints leave free; found for equilibria only.
    free_motions: Vec<FreeMotion>,
    /// Prescribed nodes for which the parts were found.
    known_fixed: Option<Vec<FixedCopy>>,
    translations: Translations,
    active: Vec<ActiveSpring>,
    accepted: Vec<bool>,
    f_ext: Vec<Vector3<f64>>,
    x_a: Vec<Vector3<f64>>,
    x_v: Vec<Vector3<f64>>,
    next: State,
    /// Acceleration at the end of the last step, for Newmark [m/s²].
    acceleration: Vec<Vector3<f64>>,
    scratch: Vec<Vector3<f64>>,
    force: Vec<Vector3<f64>>,
    /// Buffers for the stages of explicit schemes.
    stages: [Vec<Vector3<f64>>; 5],
    damping: Option<BlockCsr<f64>>,
    tangent: Option<BlockCsr<f64>>,
    power: PowerIteration,
    /// ω_max² [1/s²] without springs, and the number of explicit steps until it is computed again.
    omega_squared: Option<(f64, u32)>,
    history: History,
    ledger: Ledger,
    spin: SpinGuard,
}

impl Dynamics {
    /// Prepares the motion of `model`, which has to be made of `material`.
    pub fn new(model: Model, material: Material, settings: DynamicsSettings) -> Result<Self, DynamicsError> {
        settings.scheme.check()?;
        let n = model.n_nodes();
        let zeros = || vec![Vector3::zeros(); n];
        let mass = Mass::new(&model, material.density_kg_m3, settings.mass);
        let stages = if settings.scheme.is_explicit() { n } else { 0 };
        let mut power = PowerIteration::default();
        if settings.scheme.is_explicit() {
            power.resize(n);
        }
        Ok(Self {
            mass,
            newton: Newton::new(settings.newton),
            relaxation: Relaxation::default(),
            parts: LooseParts::default(),
            free_motions: Vec::new(),
            known_fixed: None,
            translations: Translations::default(),
            active: Vec::new(),
            accepted: Vec::new(),
            f_ext: zeros(),
            x_a: zeros(),
            x_v: zeros(),
            next: State { x: zeros(), v: zeros() },
            acceleration: zeros(),
            scratch: zeros(),
            force: zeros(),
            stages: std::array::from_fn(|_| vec![Vector3::zeros(); stages]),
            damping: (material.rayleigh.stiffness_s > 0.0).then(|| model.pattern()),
            tangent: settings.scheme.is_explicit().then(|| model.pattern()),
            power,
            omega_squared: None,
            history: History::default(),
            ledger: Ledger::default(),
            spin: SpinGuard::default(),
            model,
            material,
            settings,
        })
    }

    /// Continues from `before`, whose model was cut since; the cut made the nodes `new`. Forces jump at a
    /// cut, so Newmark's method starts from a new acceleration.
    pub fn continue_from(&mut self, before: Dynamics, new: &[NewCopy]) {
        if !matches!(self.settings.scheme, Scheme::Newmark { .. }) {
            self.history = before.history;
            self.history.inherit(new);
        }
    }

    /// The model that moves.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Scheme, mass and solver settings in use.
    pub fn settings(&self) -> &DynamicsSettings {
        &self.settings
    }

    /// Lumped masses [kg], also where the mass matrix is consistent.
    pub fn masses(&self) -> &[f64] {
        &self.mass.lumped
    }

    /// Sets the stiff motions of the model's degenerate elements, so that they cost no extra iterations.
    pub fn set_stiff_modes(&mut self, modes: Option<Arc<StiffModes>>) {
        self.newton.set_stiff_modes(modes);
    }

    /// Of the last step: pieces of degenerate elements, copies moved relative to others for them, and
    /// pieces that keep a stiff motion.
    pub fn stiff_motions(&self) -> [usize; 3] {
        self.newton.stiff_motions()
    }

    /// Changes Newton's method and the number of relaxation iterations, from the next step on.
    pub fn set_solver(&mut self, newton: NewtonSettings, relaxation: Option<u32>) {
        (self.settings.newton, self.settings.relaxation) = (newton, relaxation);
    }

    /// Changes elastic constants and damping from the next step on; law and density stay. The energy
    /// balance starts anew, because the elastic energy jumps with the constants.
    pub fn set_material(&mut self, material: Material) {
        self.model.set_lame(material.lame());
        let (damped, model) = (material.rayleigh.stiffness_s > 0.0, &self.model);
        self.damping = damped.then(|| self.damping.take().unwrap_or_else(|| model.pattern()));
        self.material =
            Material { law: self.material.law, density_kg_m3: self.material.density_kg_m3, ..material };
        self.relaxation.forget();
        self.restart();
    }

    /// Force of gravity `g` [m/s²] on node `c` [N]: M g in motion, the consistent load ρ ∫ N dV g in an
    /// equilibrium, where no mass matrix has to agree with it.
    pub fn weight(&self, c: usize, g: Vector3<f64>) -> Vector3<f64> {
        match self.settings.scheme {
            Scheme::Static => self.material.density_kg_m3 * self.model.shape_integrals()[c] * g,
            _ => self.mass.weight(c, g),
        }
    }

    /// The state before the last step that advanced.
    pub fn before(&self) -> &State {
        &self.history.before
    }

    /// Connected parts, as of the last step.
    pub fn parts(&self) -> &LooseParts {
        &self.parts
    }

    /// ½ vᵀ M v [J].
    pub fn kinetic_energy(&self, v: &[Vector3<f64>]) -> f64 {
        self.mass.kinetic(v)
    }

    /// Forgets earlier steps. The integrator calls it itself if a state is not the one it left.
    pub fn restart(&mut self) {
        self.history.forget();
        self.ledger.forget();
        self.omega_squared = None;
    }

    /// Tells that `copies` were stopped in `state` and are held from now on. The history of the others
    /// stays. The energy balance starts anew without that of the stopped copies.
    pub fn still(&mut self, copies: &[u32], state: &State) {
        self.history.still(copies, state);
        copies.iter().for_each(|&c| self.acceleration[c as usize] = Vector3::zeros());
        self.ledger.forget();
    }

    /// Advances `state` by h. The force of every spring at the end of the step goes to
    /// `spring_forces`, in the order of the inputs.
    pub fn step(
        &mut self,
        team: &mut Team,
        state: &mut State,
        inputs: &DynamicsInputs<'_>,
        spring_forces: &mut Vec<Vector3<f64>>,
    ) -> DynamicsReport {
        let mut report =
            DynamicsReport { scheme: self.settings.scheme, substeps: 1, ..DynamicsReport::default() };
        spring_forces.clear();
        spring_forces.resize(inputs.springs.len(), Vector3::zeros());
        if !self.usable(state, inputs) {
            report.outcome = DynamicsOutcome::Refused;
            report.notice = Some(Notice::BadInput);
            return report;
        }
        self.follow_fixed(inputs.fixed);
        self.begin(state, inputs);
        report.refused_springs = inputs.springs.len() - self.active.len();
        if !self.history.continues(state) {
            self.restart();
        }
        if self.settings.scheme.is_explicit() {
            self.explicit_step(team, state, inputs, &mut report);
        } else {
            self.implicit_step(team, state, inputs, &mut report);
        }
        if team.told_to_stop() {
            report.outcome = DynamicsOutcome::Interrupted;
        }
        match report.outcome {
            DynamicsOutcome::Advanced => {
                self.history.push(state, &self.next, inputs.h);
                std::mem::swap(state, &mut self.next);
                self.write_spring_forces(state, spring_forces);
            }
            DynamicsOutcome::Held => {
                state.v.fill(Vector3::zeros());
                self.restart();
                report.notice = Some(Notice::NotFinite);
            }
            DynamicsOutcome::Interrupted => self.restart(),
            DynamicsOutcome::Refused => {}
        }
        report
    }

    /// ω_max [rad/s] of the tangent at `x` [m] and the mass matrix, in the directions that `fixed`
    /// leaves free; Δt_c = 2/ω_max.
    pub fn omega_max(&mut self, team: &mut Team, x: &[Vector3<f64>], fixed: &[FixedCopy]) -> f64 {
        let n = self.model.n_nodes();
        self.power.resize(n);
        self.mass.hold(fixed);
        let K = self.tangent.get_or_insert_with(|| self.model.pattern());
        self.model.tangent(x, Tangent::Projected, K);
        self.power.omega_max(team, K, &mut self.mass, fixed)
    }

    fn usable(&self, state: &State, inputs: &DynamicsInputs<'_>) -> bool {
        let n = self.model.n_nodes();
        let finite = |v: &Vector3<f64>| v.iter().all(|c| c.abs() < FARTHEST);
        let lengths = [state.x.len(), state.v.len(), inputs.load.len()];
        lengths == [n; 3]
            && inputs.h > 0.0
            && inputs.h.is_finite()
            && finite(&inputs.gravity)
            && inputs.load.iter().all(finite)
            && state.x.iter().all(finite)
            && state.v.iter().all(finite)
            && inputs.fixed.iter().all(|f| {
                (f.copy as usize) < n && (0..3).all(|k| !f.axes[k] || f.position_m[k].abs() < FARTHEST)
            })
    }

    /// Finds the connected parts again if the prescribed directions have changed.
    fn follow_fixed(&mut self, fixed: &[FixedCopy]) {
        let same = |known: &Vec<FixedCopy>| {
            known.len() == fixed.len()
                && known.iter().zip(fixed).all(|(a, b)| (a.copy, a.axes) == (b.copy, b.axes))
        };
        if self.known_fixed.as_ref().is_some_and(same) {
            return;
        }
        let model = &self.model;
        let elements = (0..model.n_elements()).map(|e| model.element(e));
        let ends: Vec<[u32; 2]> = model.springs().iter().map(|s| [s.a, s.b]).collect();
        let groups = elements.chain(ends.iter().map(|s| &s[..]));
        self.parts = LooseParts::connected(groups, &self.mass.lumped, fixed);
        if self.settings.scheme == Scheme::Static {
            self.free_motions = free_motions(&self.parts, self.model.rest(), fixed);
        }
        self.mass.hold(fixed);
        self.spin.resize(self.parts.len());
        self.omega_squared = None;
        self.known_fixed = Some(fixed.to_vec());
    }

    /// Sets loads and usable springs of the step.
    fn begin(&mut self, state: &State, inputs: &DynamicsInputs<'_>) {
        for c in 0..self.f_ext.len() {
            self.f_ext[c] = self.weight(c, inputs.gravity) + inputs.load[c];
        }
        self.active.clear();
        self.accepted.clear();
        for spring in inputs.springs {
            let active = ActiveSpring::new(spring, &state.x);
            self.accepted.push(active.is_some());
            self.active.extend(active);
        }
    }

    fn write_spring_forces(&self, state: &State, spring_forces: &mut [Vector3<f64>]) {
        let mut active = self.active.iter();
        for (force, _) in spring_forces.iter_mut().zip(&self.accepted).filter(|(_, accepted)| **accepted) {
            if let Some(spring) = active.next() {
                *force = spring.potential(spring.point(&state.x)).force;
            }
        }
    }

    /// Potential energy of springs and loads at `x` [J]; gravity is one of the loads.
    fn load_energy(&self, x: &[Vector3<f64>]) -> f64 {
        let moved = x.iter().zip(self.model.rest());
        let loads: f64 = self.f_ext.iter().zip(moved).map(|(f, (x, X))| f.dot(&(x - X))).sum();
        let springs: f64 = self.active.iter().map(|s| s.potential(s.point(x)).energy).sum();
        springs - loads
    }
}

/// Whether all numbers are finite and below [`FARTHEST`].
fn finite(state: &State) -> bool {
    let fine = |v: &Vector3<f64>| v.iter().all(|c| c.abs() < FARTHEST);
    state.x.iter().all(fine) && state.v.iter().all(fine)
}
