//! A step of a body: any scheme, with history, guards and report.
//!
//! The equations themselves are solved by a [`StepSolver`]. A step that gains energy, or does not stay finite,
//! is made again with implicit Euler. If that fails too, the body is held. Whatever happens, the state stays
//! finite, and every departure from what was requested is reported.

use nalgebra::Vector3;
use scindo_algebra::assembly::{Model, ModelError};
use scindo_algebra::operator::Stiffness;
use scindo_matter::cut::NewCopy;
use scindo_matter::element::FixedCopy;
use scindo_matter::material::{Law, Material};
use scindo_matter::storage::reserve::resize_reserving;
use scindo_matter::team::Team;

use super::active_springs::make_room;
use super::balance::Balance;
use super::course::Course;
use super::free_motion::{FreeMotion, free_motions};
use super::model_solver::ModelSolver;
use super::multistep::{Adapted, Multistep};
use super::notice::Notice;
use super::parts::LooseParts;
use super::report::{Outcome, SolveReport};
use super::scheme::{DynamicsError, Scheme};
use super::settings::DynamicsSettings;
use super::state::State;
use super::statics::prescribe;
use super::step_inputs::StepInputs;
use super::step_solver::{SolverSettings, StepSolver};
use super::together::Member;
use crate::space::Space;

/// Integrates the motion of one body; owns all memory that a step needs.
#[derive(Debug, serde::Serialize, serde::Deserialize)]
pub struct Dynamics {
    scheme: Scheme,
    law: Law,
    course: Course,
    #[serde(with = "super::saved_solver::saved")]
    solver: Box<dyn StepSolver>,
    /// Rigid motions of held parts that the constraints leave free; found for equilibria only.
    free_motions: Vec<FreeMotion>,
    /// Prescribed directions for which these were found; `None` after a change of the topology.
    known_fixed: Option<Vec<FixedCopy>>,
    f_ext: Vec<Vector3<f64>>,
    /// Prescribed nodes where the equations of generalised-α hold.
    between: Vec<FixedCopy>,
}

impl Dynamics {
    /// Steps of `scheme` whose equations `solver` solves.
    pub fn new(scheme: Scheme, law: Law, solver: Box<dyn StepSolver>) -> Result<Self, DynamicsError> {
        scheme.check()?;
        let multistep = Multistep::new(scheme, solver.model().is_some());
        let course = Course { multistep, ..Course::default() };
        let (free_motions, f_ext, between) = (Vec::new(), Vec::new(), Vec::new());
        Ok(Self { scheme, law, course, solver, free_motions, known_fixed: None, f_ext, between })
    }

    /// Steps of a discrete model in double precision.
    pub fn of_model(
        model: Model,
        material: Material,
        settings: DynamicsSettings,
    ) -> Result<Self, DynamicsError> {
        let (scheme, law, n) = (settings.scheme, material.law, model.n_nodes());
        let solver = Box::new(ModelSolver::new(model, material, settings));
        let mut dynamics = Self::new(scheme, law, solver)?;
        dynamics.resize(n);
        Ok(dynamics)
    }

    /// The way in which the equations are solved.
    pub fn solver(&self) -> &dyn StepSolver {
        &*self.solver
    }

    /// The discrete model in double precision; `None` on a body that is computed in single precision.
    pub fn model(&self) -> Option<&Model> {
        self.solver.model()
    }

    /// The stiffness in single precision; `None` on a body that is computed with a model.
    pub fn stiffness_mut(&mut self) -> Option<&mut dyn Stiffness> {
        self.solver.stiffness_mut()
    }

    /// The state before the last step.
    pub fn before(&self) -> &State {
        &self.course.before
    }

    /// Takes new stopping criteria from the next step on.
    pub fn set_solver(&mut self, settings: SolverSettings) {
        self.solver.set_solver(settings);
    }

    /// Changes elastic constants and damping from the next step on; law and density stay. The energy
    /// balance starts anew, because the elastic energy jumps with the constants.
    pub fn set_material(&mut self, material: Material) {
        self.solver.set_material(material);
        self.course.multistep.forces_jump();
        self.course.forget_energy();
    }

    /// Forgets earlier steps. The integrator calls it itself if a state is not the one it left.
    pub fn restart(&mut self) {
        self.course.multistep.forget();
        self.course.balance.forget();
        self.solver.restart();
    }

    /// Tells that `copies` were stopped in `state` and are held from now on. The history of the others
    /// stays. The energy balance starts anew without that of the stopped copies.
    pub fn still(&mut self, copies: &[u32], state: &State) {
        self.course.multistep.still(copies, state);
        self.course.balance.forget();
    }

    /// Follows the last cut of `space`, which made the copies `new`. All material keeps its history.
    pub fn follow_cut(
        &mut self,
        team: &mut Team,
        space: &dyn Space,
        new: &[NewCopy],
    ) -> Result<(), ModelError> {
        self.course.multistep.inherit(new);
        self.course.balance.forget();
        self.solver.follow_cut(team, space)
    }

    /// Carries the history over a change of the elements; [`follow_elements`](Self::follow_elements) ends it.
    pub fn adapt(&mut self, change: Adapted<'_>) {
        self.course.multistep.adapt(change);
        self.course.balance.forget();
    }

    /// Follows the elements of `space` after all of them have [changed](Self::adapt).
    pub fn follow_elements(&mut self, team: &mut Team, space: &dyn Space) -> Result<(), ModelError> {
        self.solver.follow_cut(team, space)
    }

    /// Follows `state`, which was changed from outside, strains of springs included.
    pub fn follow_viscous(&mut self, team: &mut Team, state: &State) {
        self.course.balance.forget();
        self.solver.follow_viscous(team, state);
    }

    /// Starts anew from `space` as it is now.
    pub fn rebuild(&mut self, space: &dyn Space) -> Result<(), ModelError> {
        self.course.multistep.forget();
        self.course.balance = Balance::default();
        self.solver.rebuild(space)
    }

    /// The same as [`follow_masses`](Self::follow_masses) after a cut that changed few of them, if that is enough.
    pub fn reweigh(&mut self, space: &dyn Space, density_kg_m3: f64, mass: &mut Vec<f64>) -> bool {
        let enough = self.solver.reweigh(space, density_kg_m3, mass);
        if enough {
            self.resize(mass.len());
        }
        enough
    }

    /// Updates everything else that follows from the topology of `space` and from the masses [kg].
    pub fn follow_masses(&mut self, space: &dyn Space, mass: &[f64]) {
        self.solver.follow_masses(space, mass);
        self.resize(mass.len());
    }

    /// Tells that the connected parts have changed.
    pub fn follow_parts(&mut self) {
        self.known_fixed = None;
    }

    /// Makes room for `n` nodes, so that a step allocates nothing.
    fn resize(&mut self, n: usize) {
        let Self { course, f_ext, .. } = self;
        course.multistep.resize(n);
        for v in [&mut course.before.x, &mut course.before.v] {
            resize_reserving(v, n, Vector3::zeros());
        }
        if self.scheme == Scheme::Static {
            resize_reserving(f_ext, n, Vector3::zeros());
        }
        self.known_fixed = None;
    }

    /// Advances `state` by h. The force of every spring at the end of the step goes to `spring_forces`, in
    /// the order of the inputs.
    pub fn step(
        &mut self,
        team: &mut Team,
        state: &mut State,
        inputs: &StepInputs<'_>,
        spring_forces: &mut Vec<Vector3<f64>>,
    ) -> SolveReport {
        let mut report = SolveReport { scheme: self.scheme, substeps: 1, ..SolveReport::default() };
        spring_forces.clear();
        make_room(spring_forces, inputs.springs.len(), 1);
        spring_forces.resize(inputs.springs.len(), Vector3::zeros());
        let bad_input = self.solver.why_refused(state, inputs);
        if bad_input.is_none() {
            self.follow_fixed(inputs);
        }
        if let Some(why) = bad_input.or_else(|| self.why_no_equilibrium(inputs)) {
            return SolveReport { outcome: Outcome::Refused, notice: Some(why), ..report };
        }
        self.course.before.copy_from(state);
        if !self.course.multistep.continues(state) {
            self.restart();
        }
        if self.scheme.is_explicit() {
            self.attempt(team, state, (self.scheme, inputs), &mut report, spring_forces);
        } else {
            self.implicit_step(team, state, inputs, &mut report, spring_forces);
        }
        if team.told_to_stop() {
            report.outcome = Outcome::Interrupted;
        }
        if report.outcome == Outcome::Advanced {
            self.course.multistep.push((&self.course.before, state), inputs, report.scheme);
            self.balance(team, state, inputs, &mut report);
            return report;
        }
        state.copy_from(&self.course.before);
        self.solver.follow_viscous(team, state);
        spring_forces.fill(Vector3::zeros());
        self.course.forget_energy();
        if report.outcome == Outcome::Held {
            state.v.fill(Vector3::zeros());
            report.notice = Some(Notice::NotFinite);
        }
        report
    }

    /// Begins a step that several bodies make together. Returns whether this body can: its steps are linear solves,
    /// and the inputs are usable.
    pub fn begin_together(&mut self, state: &State, inputs: &StepInputs<'_>) -> bool {
        if !self.solver.can_step_together() || self.solver.why_refused(state, inputs).is_some() {
            return false;
        }
        self.follow_fixed(inputs);
        self.course.before.copy_from(state);
        if !self.course.multistep.continues(state) {
            self.restart();
        }
        true
    }

    /// Whether steps of this body can be solved together with those of others.
    pub fn can_step_together(&self) -> bool {
        self.solver.can_step_together()
    }

    /// This body's part of the step that [`begin_together`](Self::begin_together) began.
    pub fn member<'a>(
        &'a mut self,
        team: &'a mut Team,
        state: &'a mut State,
        inputs: StepInputs<'a>,
        spring_forces: &'a mut Vec<Vector3<f64>>,
    ) -> Option<Member<'a>> {
        spring_forces.clear();
        make_room(spring_forces, inputs.springs.len(), 1);
        spring_forces.resize(inputs.springs.len(), Vector3::zeros());
        let Self { course, solver, .. } = self;
        solver.member(team, (course, state), inputs, spring_forces)
    }

    /// Ends a step that several bodies made together; `finite` tells whether it moved them.
    pub fn end_together(&mut self, state: &mut State, inputs: &StepInputs<'_>, finite: bool) {
        if !finite {
            return state.copy_from(&self.course.before);
        }
        self.solver.carry_weightless(state, inputs);
        self.course.multistep.push((&self.course.before, state), inputs, Scheme::ImplicitEuler);
        self.course.forget_energy();
    }

    /// Makes the step with the scheme of the body, or with implicit Euler where a guard demands it.
    fn implicit_step(
        &mut self,
        team: &mut Team,
        state: &mut State,
        inputs: &StepInputs<'_>,
        report: &mut SolveReport,
        spring_forces: &mut [Vector3<f64>],
    ) {
        let Course { multistep, spin, .. } = &mut self.course;
        let (scheme, notice) = multistep.choose(state, (inputs, self.law), spin);
        let underheld = self.free_motions.first().map(|&motion| Notice::Underheld { motion, driven: false });
        (report.scheme, report.notice) = (scheme, notice.or(underheld));
        if multistep.starts_newmark(scheme) {
            self.solver.accelerate(team, state, inputs, multistep.acceleration_mut());
        }
        let before_j = self.begin_energy(team, state, inputs);
        self.solver.be_careful(self.course.balance.is_careful());
        self.attempt(team, state, (scheme, inputs), report, spring_forces);
        // A step that was made in parts was made with implicit Euler.
        let (made_with, iterations) = (report.scheme, report.iterations);
        let repeats = self.solver.may_repeat(made_with) && self.scheme != Scheme::Static;
        let excess = self.end_energy(team, state, (inputs, before_j), report, repeats);
        if !repeats || team.told_to_stop() || (report.outcome == Outcome::Advanced && excess.is_none()) {
            return;
        }
        if let Some(excess_j) = excess {
            report.notice = Some(Notice::EnergyGained { excess_j });
        }
        state.copy_from(&self.course.before);
        (report.scheme, report.outcome) = (Scheme::ImplicitEuler, Outcome::Advanced);
        self.solver.be_careful(true);
        self.attempt(team, state, (Scheme::ImplicitEuler, inputs), report, spring_forces);
        self.solver.be_careful(false);
        report.iterations += iterations;
        self.end_energy(team, state, (inputs, before_j), report, false);
    }

    fn attempt(
        &mut self,
        team: &mut Team,
        state: &mut State,
        (scheme, inputs): (Scheme, &StepInputs<'_>),
        report: &mut SolveReport,
        spring_forces: &mut [Vector3<f64>],
    ) {
        let Self { course, solver, between, .. } = self;
        let share = scheme.alpha().map_or(1.0, |alpha| 1.0 - alpha.alpha_f);
        if share == 1.0 {
            return solver.attempt(team, course, state, (scheme, inputs), (report, spring_forces));
        }
        // The equations hold between the ends of the step, so prescribed nodes stand there.
        between.clear();
        between.extend(inputs.fixed.iter().map(|fixed| {
            let from = course.before.x[fixed.copy as usize];
            let to = Vector3::from(fixed.position_m);
            FixedCopy { position_m: (from + (to - from) * share).into(), ..*fixed }
        }));
        let inner = StepInputs { fixed: between, ..*inputs };
        solver.attempt(team, course, state, (scheme, &inner), (report, spring_forces));
        if report.scheme == scheme {
            let State { x: from_x, v: from_v, .. } = &course.before;
            state.x.iter_mut().zip(from_x).for_each(|(x, from)| *x = from + (*x - from) / share);
            state.v.iter_mut().zip(from_v).for_each(|(v, from)| *v = from + (*v - from) / share);
            report.internal_work_j /= share;
            report.elastic_j = None;
        }
        prescribe(inputs.fixed, &mut state.x);
    }

    /// Begins the energy balance of a step from `state`. Returns kinetic and elastic energy [J] there.
    fn begin_energy(&mut self, team: &mut Team, state: &State, inputs: &StepInputs<'_>) -> f64 {
        let Self { course: Course { multistep, .. }, solver, .. } = self;
        if !multistep.judges_energy() {
            return 0.0;
        }
        let kinetic_j = solver.kinetic_energy(inputs.mass, &state.v);
        let weight = |c: usize| solver.weight(c, inputs.mass[c], inputs.gravity);
        let loads_j = inputs.load_energy(&state.x, weight);
        multistep.begin_energy(kinetic_j, loads_j, || solver.elastic_energy(team, state, inputs.points))
    }

    /// Ends the energy balance of an attempt that began with `before_j`. Returns the energy [J] that it gained
    /// without work, if it is more than its scheme may gain. An attempt that may be repeated is booked only
    /// if it gained none.
    fn end_energy(
        &mut self,
        team: &mut Team,
        state: &State,
        (inputs, before_j): (&StepInputs<'_>, f64),
        report: &SolveReport,
        may_repeat: bool,
    ) -> Option<f64> {
        let Self { course: Course { multistep, before, .. }, solver, .. } = self;
        if !multistep.judges_energy() || report.outcome != Outcome::Advanced {
            return None;
        }
        let elastic_j = report.elastic_j.unwrap_or_else(|| solver.elastic_energy(team, state, inputs.points));
        let weight = |c: usize| solver.weight(c, inputs.mass[c], inputs.gravity);
        let force = |c: usize| weight(c) + inputs.load[c];
        let exchanged: f64 = (0..state.x.len()).map(|c| force(c).dot(&(state.x[c] - before.x[c]))).sum();
        // Pressure on a part of a surface has no potential. Its work in the step counts instead.
        let pressed = inputs.pressure.work(&before.x, &state.x);
        let kinetic = solver.kinetic_energy(inputs.mass, &state.v);
        let H = kinetic + elastic_j + inputs.load_energy(&state.x, weight) - pressed;
        let driven = inputs.is_driven(before);
        let end = (H, elastic_j, before_j + exchanged.abs() + pressed.abs());
        multistep.end_energy(end, report.scheme, (driven, may_repeat))
    }

    /// Judges by energy whether steps by linear solves solve their equations.
    fn balance(&mut self, team: &mut Team, state: &State, inputs: &StepInputs<'_>, report: &mut SolveReport) {
        let Self { course: Course { balance, before, .. }, solver, scheme, .. } = self;
        if solver.model().is_some() || !scheme.is_implicit_motion() {
            return;
        }
        // What moves prescribed nodes does work that is not known here.
        if inputs.is_driven(before) {
            return balance.forget();
        }
        let energies = || {
            let elastic_j = solver.elastic_energy(team, state, inputs.points);
            [elastic_j, solver.kinetic_energy(inputs.mass, &state.v), solver.rounding_energy(inputs.mass)]
        };
        let careful = balance.is_careful();
        if let Some((excess_j, again)) = balance.book(report.internal_work_j, energies) {
            report.notice = Some(Notice::Unbalanced { excess_j, careful, again });
        }
    }

    /// Follows a change of the prescribed directions.
    fn follow_fixed(&mut self, inputs: &StepInputs<'_>) {
        let held = |f: &FixedCopy| (f.copy, f.held);
        let same = |known: &Vec<FixedCopy>| known.iter().map(held).eq(inputs.fixed.iter().map(held));
        if self.known_fixed.as_ref().is_some_and(same) {
            return;
        }
        self.course.spin.follow(inputs.rest, inputs.mass, inputs.parts);
        if self.scheme == Scheme::Static {
            self.free_motions = free_motions(inputs.parts, inputs.rest, inputs.fixed);
        }
        self.solver.hold(inputs.fixed);
        self.known_fixed = Some(inputs.fixed.to_vec());
    }

    /// The reason why the body has no equilibrium: a part that is held nowhere, or a free rigid motion that
    /// the loads drive. A finite rotation comes to an end, but the linear law knows no finite rotations.
    /// Springs may hold what the boundary conditions do not.
    fn why_no_equilibrium(&mut self, inputs: &StepInputs<'_>) -> Option<Notice> {
        let parts: &LooseParts = inputs.parts;
        if self.scheme != Scheme::Static || (self.free_motions.is_empty() && !parts.any_free()) {
            return None;
        }
        if parts.any_free() {
            return Some(Notice::LooseBody);
        }
        for (c, f_ext) in self.f_ext.iter_mut().enumerate() {
            *f_ext = self.solver.weight(c, inputs.mass[c], inputs.gravity) + inputs.load[c];
        }
        inputs.pressure.add_forces(inputs.rest, &mut self.f_ext);
        let endless = |m: &&FreeMotion| m.is_translation() || self.law == Law::Linear;
        let driven = |m: &&FreeMotion| m.is_driven(parts, inputs.rest, &self.f_ext);
        let motion = self.free_motions.iter().filter(endless).find(driven);
        let motion = motion.filter(|_| inputs.springs.is_empty())?;
        Some(Notice::Underheld { motion: *motion, driven: true })
    }
}
