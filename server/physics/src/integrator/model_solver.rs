//! Steps of a discrete model in double precision: any element, any law, every scheme, either mass.
//!
//! Explicit schemes check the critical time step; they divide a step that is too long, or refuse it.
//! Implicit schemes minimise the incremental potential of the step by Newton's method with backtracking,
//! so that contacts, inverted elements and any law are treated alike.

use std::sync::Arc;

use nalgebra::Vector3;
use scindo_algebra::assembly::pressure::Follower;
use scindo_algebra::assembly::{BlockCsr, Model, ModelError, Volumetric};
use scindo_algebra::solver::Newton;
use scindo_matter::element::FixedCopy;
use scindo_matter::element::Points;
use scindo_matter::material::{Fibres, Material, Prony};
use scindo_matter::storage::reserve::resize_reserving;
use scindo_matter::team::Team;

use super::active_springs::ActiveSprings;
use super::course::Course;
use super::critical_step::{Frequency, PowerIteration};
use super::mass::Mass;
use super::notice::Notice;
use super::parts::Translations;
use super::relaxation::Relaxation;
use super::report::SolveReport;
use super::scheme::Scheme;
use super::settings::DynamicsSettings;
use super::state::State;
use super::step_inputs::StepInputs;
use super::step_solver::{SolverSettings, StepSolver};
use crate::space::Space;

/// Positions beyond this [m] count as not finite.
const FARTHEST: f64 = 1e15;

/// A discrete model with all memory that its steps need.
#[derive(Debug, serde::Serialize, serde::Deserialize)]
pub struct ModelSolver {
    pub(super) model: Model,
    pub(super) material: Material,
    pub(super) settings: DynamicsSettings,
    /// Whether an attempt replaces one that failed.
    pub(super) careful: bool,
    pub(super) mass: Mass,
    pub(super) newton: Newton,
    pub(super) relaxation: Relaxation,
    pub(super) translations: Translations,
    pub(super) active: ActiveSprings,
    pub(super) f_ext: Vec<Vector3<f64>>,
    /// Pressure that follows the surface, around the iterate of Newton's method.
    pub(super) follower: Follower,
    pub(super) scratch: Vec<Vector3<f64>>,
    pub(super) force: Vec<Vector3<f64>>,
    /// Buffers for the stages of explicit schemes.
    pub(super) stages: [Vec<Vector3<f64>>; 5],
    pub(super) damping: Option<BlockCsr<f64>>,
    /// What its product with the motion of a step has too much of the change of strain [N].
    pub(super) turned: Vec<Vector3<f64>>,
    pub(super) tangent: Option<BlockCsr<f64>>,
    pub(super) power: PowerIteration,
    /// ω_max without springs, for explicit schemes.
    pub(super) frequency: Option<Frequency>,
}

impl ModelSolver {
    /// Prepares the motion of `model`, which has to be made of `material`.
    pub fn new(model: Model, material: Material, settings: DynamicsSettings) -> Self {
        let mut solver = Self {
            careful: false,
            mass: Mass::new(&model, material.density_kg_m3, settings.mass),
            newton: Newton::new(settings.newton),
            relaxation: Relaxation::default(),
            translations: Translations::default(),
            active: ActiveSprings::default(),
            f_ext: Vec::new(),
            follower: Follower::default(),
            scratch: Vec::new(),
            force: Vec::new(),
            stages: Default::default(),
            damping: None,
            turned: Vec::new(),
            tangent: None,
            power: PowerIteration::default(),
            frequency: None,
            model,
            material,
            settings,
        };
        solver.resize();
        solver
    }

    /// Makes room for the nodes of the model, so that a step allocates nothing.
    fn resize(&mut self) {
        let Self { model, settings, material, f_ext, scratch, force, turned, stages, power, .. } = self;
        let n = model.n_nodes();
        for v in [f_ext, scratch, force, turned] {
            resize_reserving(v, n, Vector3::zeros());
        }
        self.damping = (material.rayleigh.stiffness_s > 0.0).then(|| model.pattern());
        if settings.scheme.is_explicit() {
            stages.iter_mut().for_each(|v| resize_reserving(v, n, Vector3::zeros()));
            power.resize(n);
            self.tangent = Some(model.pattern());
        }
        self.frequency = None;
    }

    /// The model of `space` as it is cut now.
    pub fn of_space(
        space: &dyn Space,
        material: Material,
        (volumetric, fibres, prony): (Volumetric, Fibres, Prony),
        settings: DynamicsSettings,
    ) -> Result<Self, ModelError> {
        let mut model = space.model(&material, volumetric)?.with_fibres(fibres)?.with_prony(prony)?;
        if let Some(sharing) = settings.mass.sharing(settings.scheme.is_explicit()) {
            model.share_mass(sharing);
        }
        let mut solver = Self::new(model, material, settings);
        solver.newton.set_stiff_modes(space.stiff_modes().map(Arc::new));
        Ok(solver)
    }

    /// Sets loads and usable springs of a step from `state`.
    pub(super) fn begin(&mut self, state: &State, inputs: &StepInputs<'_>, report: &mut SolveReport) {
        for c in 0..self.f_ext.len() {
            self.f_ext[c] = self.weight(c, inputs.mass[c], inputs.gravity) + inputs.load[c];
        }
        self.active.begin(inputs, &state.x);
        report.refused_springs = self.active.refused();
    }
}

impl StepSolver for ModelSolver {
    fn attempt(
        &mut self,
        team: &mut Team,
        course: &mut Course,
        state: &mut State,
        (scheme, inputs): (Scheme, &StepInputs<'_>),
        (report, spring_forces): (&mut SolveReport, &mut [Vector3<f64>]),
    ) {
        self.begin(state, inputs, report);
        if scheme.is_explicit() {
            self.explicit_step(team, (course, state), inputs, report);
        } else {
            self.implicit_step(team, (course, state), (scheme, inputs), report);
        }
        self.active.write(spring_forces, |spring| spring.law().potential(spring.point(&state.x)).force);
    }

    fn be_careful(&mut self, careful: bool) {
        self.careful = careful;
    }

    fn may_repeat(&self, scheme: Scheme) -> bool {
        scheme != Scheme::ImplicitEuler || self.is_coarse()
    }

    fn why_refused(&self, state: &State, inputs: &StepInputs<'_>) -> Option<Notice> {
        let n = self.model.n_nodes();
        let finite = |v: &Vector3<f64>| v.iter().all(|c| c.abs() < FARTHEST);
        let lengths = [state.x.len(), state.v.len(), inputs.load.len()];
        let usable = lengths == [n; 3]
            && inputs.h > 0.0
            && inputs.h.is_finite()
            && finite(&inputs.gravity)
            && inputs.load.iter().chain(&state.x).chain(&state.v).all(finite)
            && inputs
                .fixed
                .iter()
                .all(|f| (f.copy as usize) < n && finite(&f.held.part_of(&f.position_m.into())));
        (!usable).then_some(Notice::BadInput)
    }

    fn accelerate(
        &mut self,
        team: &mut Team,
        state: &State,
        inputs: &StepInputs<'_>,
        acceleration: &mut [Vector3<f64>],
    ) {
        self.begin(state, inputs, &mut SolveReport::default());
        self.follow_viscous(team, state);
        self.acceleration_at(team, [&state.x, &state.v], inputs, acceleration);
    }

    fn elastic_energy(&mut self, team: &mut Team, state: &State, _: &dyn Points) -> f64 {
        self.model.energy_with_by(team, &state.x, &state.viscous)
    }

    fn follow_viscous(&mut self, team: &mut Team, state: &State) {
        self.model.begin_viscous(team, 0.0, &state.x, &state.viscous);
    }

    fn kinetic_energy(&self, _: &[f64], v: &[Vector3<f64>]) -> f64 {
        self.mass.kinetic(v)
    }

    /// M g in motion, the consistent load ρ ∫ N dV g in an equilibrium, where no mass matrix has to agree
    /// with it.
    fn weight(&self, c: usize, _: f64, g: Vector3<f64>) -> Vector3<f64> {
        match self.settings.scheme {
            Scheme::Static => self.material.density_kg_m3 * self.model.shape_integrals()[c] * g,
            _ => self.mass.weight(c, g),
        }
    }

    fn restart(&mut self) {
        self.frequency = None;
    }

    fn hold(&mut self, fixed: &[FixedCopy]) {
        self.mass.hold(fixed);
        self.frequency = None;
    }

    fn set_material(&mut self, material: Material) {
        self.model.set_lame(material.lame());
        let (damped, model) = (material.rayleigh.stiffness_s > 0.0, &self.model);
        self.damping = damped.then(|| self.damping.take().unwrap_or_else(|| model.pattern()));
        let Material { law, density_kg_m3, .. } = self.material;
        self.material = Material { law, density_kg_m3, ..material };
        self.relaxation.forget();
        self.frequency = None;
    }

    fn set_solver(&mut self, settings: SolverSettings) {
        (self.settings.newton, self.settings.relaxation) = (settings.newton, settings.relaxation);
    }

    fn follow_cut(&mut self, _: &mut Team, space: &dyn Space) -> Result<(), ModelError> {
        space.follow_model(&mut self.model, &self.material);
        self.model.resize_viscous();
        self.mass = Mass::new(&self.model, self.material.density_kg_m3, self.settings.mass);
        self.newton.forget_pattern();
        self.newton.set_stiff_modes(space.stiff_modes().map(Arc::new));
        self.relaxation.forget();
        self.resize();
        Ok(())
    }

    fn rebuild(&mut self, space: &dyn Space) -> Result<(), ModelError> {
        let kept = (self.model.volumetric(), *self.model.fibres(), *self.model.prony());
        *self = Self::of_space(space, self.material, kept, self.settings)?;
        Ok(())
    }

    fn follow_masses(&mut self, _: &dyn Space, _: &[f64]) {}

    fn lumped_masses(&self, _: &dyn Space, _: f64, mass: &mut Vec<f64>) {
        mass.clone_from(&self.mass.lumped);
    }

    fn stiff_motions(&self) -> [usize; 3] {
        self.newton.stiff_motions()
    }

    fn model(&self) -> Option<&Model> {
        Some(&self.model)
    }
}

/// Whether all numbers are finite and below [`FARTHEST`].
pub(super) fn finite(state: &State) -> bool {
    let fine = |v: &Vector3<f64>| v.iter().all(|c| c.abs() < FARTHEST);
    state.x.iter().all(fine) && state.v.iter().all(fine)
}
