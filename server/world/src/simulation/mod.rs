//! The step: tools, cuts, adaptation, contacts, deformation, reactions, in this order.
//!
//! [`Simulation::step`] is the table of contents of the system; each line is one stage, timed.

mod plan;

mod stopwatch;

mod phase_clock;

mod adapting;

mod cuts;

mod deform;
mod dormant;

mod incision;

mod fill;

mod touch;
pub mod governor;

mod sleep;

mod twin;

mod checkpoint;

mod undo;

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use nalgebra::Vector3;
use scindo_physics::body::{Ablation, BodyError, Outcome, PcgSettings};
use scindo_physics::team::Lead;

pub(crate) use stopwatch::processor_seconds;
pub use undo::{MAX_UNDO, Undone};

use crate::assemble::{self, BuildOptions, Built};
use crate::body::BodySize;
pub use crate::body::{Probe, SimBody, StepCounts};
use crate::contact::edge::EdgeReport;
use crate::contact::pairs::{TouchReport, TouchSettings};
use crate::contact::rest::RestReport;
use crate::contact::{ContactAblation, Contacts};
use crate::inputs::{CutOutcome, CutRequest, Inputs, Wants};
use crate::mesh_in::Observer;
pub use crate::report::{BodyReport, Energy, Event, Level, PhaseSeconds, Stage, StageSeconds, StepReport};
use crate::scene::{BodySpec, CheckedScene, LiveKey, LiveParameter, Scene, SceneError};
use crate::snapshot::Snapshot;
use crate::tool::Tools;
use crate::tool::obstacle::Obstacle;
use adapting::ToolPlaces;
pub use checkpoint::CheckpointError;
use cuts::{CutContext, Cuts};
use deform::Groups;
use dormant::Dormant;
use fill::Sources;
use governor::{Governor, GovernorReport};
use phase_clock::PhaseClock;
pub use plan::Plan;
use sleep::Sleep;
use stopwatch::Stopwatch;

/// A running scene.
///
/// ```
/// use std::path::Path;
///
/// use scindo_world::inputs::Inputs;
/// use scindo_world::scene::Scene;
/// use scindo_world::simulation::{Simulation, Stage};
///
/// # const TEXT: &str = r#"
/// # schema = 1
/// # world = { gravity_m_s2 = [0, 0, -9.81], step_s = 0.01 }
/// # [[body]]
/// # id = "block"
/// # mesh = { box = { min_m = [0, 0, 0], max_m = [0.1, 0.1, 0.1], cells = [2, 2, 2] } }
/// # young_pa = 1e4
/// # poisson = 0.4
/// # density_kg_m3 = 1000
/// # "#;
/// // One block that nothing holds.
/// let mut simulation = Simulation::new(&Scene::from_toml(TEXT)?, Path::new(""))?;
/// for _ in 0..10 {
///     let report = simulation.step(&Inputs::default());
///     assert!(report.events.is_empty());
/// }
/// assert!((simulation.time_s() - 0.1).abs() < 1e-12);
/// assert!(simulation.total_seconds().of(Stage::Deform) > 0.0);
/// let body = &simulation.bodies()[0].body;
/// assert!(body.velocities().iter().all(|v| (v.z + 9.81 * 0.1).abs() < 1e-6)); // it falls
/// # Ok::<(), scindo_world::scene::SceneError>(())
/// ```
#[derive(Debug)]
pub struct Simulation {
    source: Scene,
    scene: CheckedScene,
    bodies: Vec<SimBody>,
    lead: Option<Lead>,
    tools: Tools,
    tool_places: ToolPlaces,
    cuts: Cuts,
    contacts: Contacts,
    groups: Groups,
    sleep: Sleep,
    dormant: Dormant,
    governor: Governor,
    probes: Vec<Probe>,
    plan: Plan,
    warnings: Vec<String>,
    steps: u64,
    wants: Wants,
    total: StageSeconds,
    phase_clock: PhaseClock,
    total_phases: PhaseSeconds,
    report: StepReport,
}

impl Simulation {
    /// Builds a scene; paths in it are relative to `base_dir`.
    ///
    /// # Errors
    /// Everything that stands in the way: files, meshes, empty selections, probes outside.
    pub fn new(scene: &Scene, base_dir: &Path) -> Result<Self, SceneError> {
        Self::with_options(scene, base_dir, BuildOptions::default())
    }

    /// As [`Simulation::new`], with a choice of threads.
    ///
    /// # Errors
    /// As [`Simulation::new`].
    pub fn with_options(scene: &Scene, base_dir: &Path, options: BuildOptions) -> Result<Self, SceneError> {
        Self::observed(scene, base_dir, options, &|_| ())
    }

    /// As [`Simulation::with_options`], telling `observer` how far the meshes have come.
    ///
    /// # Errors
    /// As [`Simulation::new`].
    pub fn observed(
        scene: &Scene,
        base_dir: &Path,
        options: BuildOptions,
        observer: &Observer<'_>,
    ) -> Result<Self, SceneError> {
        let built = assemble::build(scene, base_dir, options, observer)?;
        let (source, scene) = (scene.clone(), scene.checked().clone());
        Ok(Self::assemble(source, scene, built))
    }

    /// A scene of these parts.
    pub(crate) fn assemble(source: Scene, scene: CheckedScene, built: Built) -> Self {
        let mut scene = scene;
        let sizes: Vec<BodySize> = built.bodies.iter().map(SimBody::size).collect();
        let plan = Plan::new(&scene, &sizes);
        settle(&mut scene, &built.bodies);
        let mut contacts = Contacts::new(scene.broad_phase);
        for body in &scene.bodies {
            contacts.add_body(body.young_pa, scene.effects.contact != Some(false));
        }
        for (i, body) in scene.bodies.iter().enumerate() {
            contacts.set_viscosity(i, body.damping_stiffness_s / scene.step_s);
        }
        if scene.effects.obstacles != Some(false) {
            contacts.set_obstacles(built.obstacles);
        }
        contacts.set_touch(TouchSettings::of(&scene));
        let by_force = plan.is_on("cutting force");
        if by_force {
            contacts.set_toughness(scene.bodies.iter().map(|body| body.toughness_j_m2).collect());
        }
        let report =
            StepReport { bodies: vec![BodyReport::default(); built.bodies.len()], ..StepReport::default() };
        let mut simulation = Self {
            plan,
            tools: Tools::new(&scene.tools, by_force),
            tool_places: ToolPlaces::default(),
            cuts: Cuts::new(&scene.cuts, &built.bodies),
            contacts,
            groups: Groups::default(),
            sleep: Sleep::new(&built.bodies),
            governor: Governor::new(scene.effects.governor == Some(true)),
            dormant: Dormant::new(built.bodies.len(), scene.effects.sleep == Some(true)),
            bodies: built.bodies,
            lead: built.lead,
            probes: built.probes,
            warnings: built.warnings,
            steps: 0,
            wants: Wants::default(),
            total: StageSeconds::default(),
            phase_clock: PhaseClock::default(),
            total_phases: PhaseSeconds::default(),
            report,
            source,
            scene,
        };
        simulation.measure_phases(PhaseClock::is_traced());
        simulation
    }

    /// One step of simulated time. The order of the lines is the order of the data.
    pub fn step(&mut self, inputs: &Inputs) -> &StepReport {
        let mut watch = Stopwatch::start();
        self.begin(inputs);
        let _span = tracing::trace_span!("step", number = self.steps).entered();
        self.tools.advance(self.time_s(), &inputs.tools);
        watch.book(Stage::Tools);
        self.cut(&inputs.cuts);
        watch.book(Stage::Cuts);
        self.adapt();
        watch.book(Stage::Adapt);
        self.touch();
        watch.book(Stage::Contacts);
        self.deform();
        watch.book(Stage::Deform);
        self.react();
        watch.book(Stage::Reactions);
        self.measure();
        watch.book(Stage::Measure);
        self.finish(watch)
    }

    fn begin(&mut self, inputs: &Inputs) {
        self.steps += 1;
        self.wants.take(&inputs.wants);
        self.report.begin(self.steps, self.time_s());
        let Self { governor, scene, bodies, report, .. } = self;
        report.events.extend(governor.decide(scene, bodies));
    }

    fn cut(&mut self, requests: &[CutRequest]) {
        let time_s = self.time_s();
        let allowed = self.scene.effects.cutting != Some(false);
        let Self { cuts, bodies, tools, report, probes, .. } = self;
        let before = cuts.applied();
        let estimates = self.scene.effects.error_estimate == Some(true);
        let at = &mut CutContext { bodies, tools, report, allowed, estimates };
        // A cut at t = 0 is there before the first step, hence at the time this step starts from.
        cuts.apply_schedule(time_s - self.scene.step_s, at);
        cuts.queue_requests(requests, at);
        cuts.queue_blades(at);
        cuts.work_off(at);
        if cuts.applied() > before {
            probes.iter_mut().for_each(|probe| probe.follow(&bodies[probe.body].body));
        }
    }

    fn react(&mut self) {
        for (i, body) in self.bodies.iter().enumerate().filter(|(i, _)| !self.dormant.is_asleep(*i)) {
            self.contacts.collect(i, body.body.spring_forces());
            self.contacts.settle(i, body);
        }
        self.contacts.settle_pairs(&self.bodies, self.dormant.asleep());
        self.contacts.settle_edges(&mut self.tools, &self.bodies);
        self.contacts.react(&mut self.tools);
        self.contacts.draw_scalpels(&mut self.tools);
    }

    fn measure(&mut self) {
        let energy = self.wants.energy || self.scene.effects.energy == Some(true);
        let estimate = self.scene.effects.error_estimate == Some(true) && !self.governor.drops_estimate();
        let each = self.bodies.iter_mut().zip(&mut self.report.bodies).enumerate();
        for (i, (body, report)) in each {
            if self.dormant.is_asleep(i) && report.energy.is_some() == energy {
                continue;
            }
            report.energy = energy.then(|| body.energy());
            report.mesh_error = if estimate { body.mesh_error() } else { None };
        }
    }

    fn finish(&mut self, watch: Stopwatch) -> &StepReport {
        self.report.seconds = watch.seconds();
        self.report.phases = self.phase_clock.take();
        self.report.processor_s = watch.processor_s();
        self.total.add(&self.report.seconds);
        self.total_phases.add(&self.report.phases);
        &self.report
    }

    /// Back to the start of the scene: uncut, undeformed, at rest. Epochs keep rising; tools held
    /// by clients stay with them from their next sample on.
    ///
    /// # Errors
    /// When a body cannot be built again.
    pub fn reset(&mut self) -> Result<(), BodyError> {
        for (i, body) in self.bodies.iter_mut().enumerate() {
            body.body.reset()?;
            body.has_changed_topology();
            body.has_been_reset();
            body.throw()?;
            self.contacts.forget_motion(i);
        }
        for probe in &mut self.probes {
            probe.follow(&self.bodies[probe.body].body);
        }
        self.tools.reset();
        self.contacts.reset(&self.tools);
        self.dormant.wake_all();
        self.cuts.reset();
        self.steps = 0;
        self.total = StageSeconds::default();
        self.total_phases = PhaseSeconds::default();
        Ok(())
    }

    /// Takes the last incision back, whoever made it, with everything that was cut in the same bodies since
    /// it began. The tissue closes where it is now and moves on; epochs rise.
    ///
    /// # Errors
    /// That there is no cut to take back.
    pub fn undo(&mut self) -> Result<Undone, String> {
        let undone = self.cuts.undo(&mut self.bodies)?;
        for &body in &undone.bodies {
            self.dormant.wake(body);
            self.contacts.forget_motion(body);
        }
        for probe in &mut self.probes {
            probe.follow(&self.bodies[probe.body].body);
        }
        Ok(undone)
    }

    /// Goes on as if `steps` steps had been made in which nothing moved.
    pub(crate) fn skip_to(&mut self, steps: u64) {
        self.steps = steps;
    }

    /// Lets the linear solves of the body `id` make so many iterations from now on.
    pub(crate) fn allow_iterations(&mut self, id: &str, iterations: u32) {
        for body in self.bodies.iter_mut().filter(|body| &*body.id == id) {
            let solver = PcgSettings { iterations, ..body.body.settings().solver };
            // Only the range of the number could be refused, and the callers keep within it.
            let _ = body.body.set_solver(solver);
        }
    }

    /// Forgets the cuts of clients that wait or are being made; their outcomes say `reason`. To be called
    /// before a [`reset`](Self::reset), or at the end.
    pub fn discard_cuts(&mut self, reason: &str) -> Vec<CutOutcome> {
        self.cuts.discard(reason)
    }

    /// Begins (`on`) or ends to measure the phases of deforming. They are not measured at first, unless the
    /// log asks for their spans.
    pub fn measure_phases(&mut self, on: bool) {
        self.phase_clock.set(on, self.bodies.iter_mut().map(|body| &mut body.body));
    }

    /// Takes parts of the method out of a simulation that has just been made, for a check that their lack is noticed.
    ///
    /// # Errors
    /// A solver that cannot be made.
    #[doc(hidden)]
    pub fn ablate(&mut self, ablation: Ablation, contact: ContactAblation) -> Result<(), BodyError> {
        self.contacts.ablate(contact);
        self.bodies.iter_mut().try_for_each(|body| body.body.ablate(ablation))
    }

    /// A step under way ends as soon as `flag` is raised: bodies that have not moved yet stay as they were.
    /// Without it a step takes as long as its solvers do.
    pub fn set_stop_flag(&mut self, flag: &Arc<AtomicBool>) {
        self.bodies.iter_mut().for_each(|body| body.body.set_stop_flag(Arc::clone(flag)));
    }

    /// Fills a snapshot of the present state: surfaces only as `wants` says.
    pub fn snapshot_into(&mut self, wants: &Wants, snapshot: &mut Snapshot) {
        (snapshot.step, snapshot.time_s) = (self.steps, self.time_s());
        snapshot.broad_phase = self.scene.broad_phase;
        snapshot.step_s = self.step_s();
        let Self { bodies, report, tools, contacts, probes, groups, .. } = self;
        Sources { bodies, report, tools, contacts, probes, groups }.fill(wants, snapshot);
    }

    /// Changes one value of the scene while it runs: a [`LiveKey`], within its range.
    ///
    /// # Errors
    /// What is wrong with key or value, with the keys or the range that are allowed. Nothing has changed
    /// then.
    pub fn set(&mut self, key: &str, value: &str) -> Result<(), String> {
        let live = LiveKey::parse(&self.scene, key)?;
        let value = live.read(&self.scene, value)?;
        let assignment = format!("{}={value}", live.path(&self.scene));
        let changed = self.source.apply_set(&assignment).map_err(|error| error.to_string())?;
        if let LiveKey::Body(index, _) = live {
            self.change_body(index, &changed.checked().bodies[index])?;
        }
        self.dormant.wake_all();
        self.scene = changed.checked().clone();
        settle(&mut self.scene, &self.bodies);
        self.source = changed;
        let sizes: Vec<BodySize> = self.bodies.iter().map(SimBody::size).collect();
        self.plan = Plan::new(&self.scene, &sizes);
        self.governor.apply(&self.scene, &mut self.bodies);
        Ok(())
    }

    /// Takes note that the last step, with all that belongs to it, took `seconds` of real time: from the next step on,
    /// a scene with a governor gives up accuracy where it is late, and takes it back where it is not. The report of
    /// that step tells.
    pub fn govern(&mut self, seconds: f64) {
        self.governor.take(seconds);
    }

    fn change_body(&mut self, index: usize, spec: &BodySpec) -> Result<(), String> {
        let body = &mut self.bodies[index].body;
        let stiffness = body.material().young_pa;
        let viscosity = body.material().rayleigh.stiffness_s;
        let known = body.settings().solver;
        let iterations = spec.mechanics.iterations.unwrap_or(known.iterations);
        let solver = PcgSettings { iterations, tolerance: spec.mechanics.tolerance };
        if solver != known {
            body.set_solver(solver).map_err(|error| error.to_string())?;
        }
        body.set_constants(assemble::constants(spec)).map_err(|error| error.to_string())?;
        if viscosity != spec.damping_stiffness_s {
            self.contacts.set_viscosity(index, spec.damping_stiffness_s / self.scene.step_s);
        }
        if stiffness != spec.young_pa {
            self.contacts.set_stiffness(index, spec.young_pa);
        }
        Ok(())
    }
}

/// Notes the limits of iterations that bodies have chosen for themselves.
fn settle(scene: &mut CheckedScene, bodies: &[SimBody]) {
    for (spec, body) in scene.bodies.iter_mut().zip(bodies) {
        spec.mechanics.iterations.get_or_insert(body.body.settings().solver.iterations);
    }
}

/// What can be read off a simulation.
impl Simulation {
    /// The checked scene it was built from.
    pub fn scene(&self) -> &CheckedScene {
        &self.scene
    }

    /// The scene as it was read.
    pub fn source(&self) -> &Scene {
        &self.source
    }

    /// Steps done since the start or the last reset.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// What may change while it runs, with its present value and range.
    pub fn parameters(&self) -> Vec<LiveParameter> {
        LiveKey::all(&self.scene).into_iter().map(|key| key.parameter(&self.scene)).collect()
    }

    /// Simulated time [s].
    pub fn time_s(&self) -> f64 {
        self.steps as f64 * self.scene.step_s
    }

    /// Simulated time per step [s].
    pub fn step_s(&self) -> f64 {
        self.scene.step_s
    }

    /// Bodies in the order of the scene.
    pub fn bodies(&self) -> &[SimBody] {
        &self.bodies
    }

    /// Tools, those of the scene first.
    pub fn tools(&self) -> &Tools {
        &self.tools
    }

    /// Obstacles in the order of the scene.
    pub fn obstacles(&self) -> &[Obstacle] {
        self.contacts.obstacles()
    }

    /// Contact of body number `body` with all obstacles in the last step.
    pub fn rest_report(&self, body: usize) -> &RestReport {
        self.contacts.rest_report(body)
    }

    /// The same with each obstacle, in their order; empty before the first step.
    pub fn rest_reports(&self, body: usize) -> &[RestReport] {
        self.contacts.rest_reports(body)
    }

    /// What the edge of tool number `tool` has done since it began to cut with force; `None` for other tools.
    pub fn edge_report(&self, tool: usize) -> Option<EdgeReport> {
        self.contacts.hand(tool)?.edge()
    }

    /// Contacts of bodies with each other and with themselves in the last step, one report per pair.
    pub fn touch_reports(&self) -> &[TouchReport] {
        self.contacts.pairs().reports()
    }

    /// Whether body number `body` has come to rest and sleeps.
    pub fn is_asleep(&self, body: usize) -> bool {
        self.dormant.is_asleep(body)
    }

    /// What the governor has given up, and for how long; `None` if the scene has none.
    pub fn governor_report(&self) -> Option<GovernorReport> {
        self.governor.report()
    }

    /// Probes in the order of the scene.
    pub fn probes(&self) -> &[Probe] {
        &self.probes
    }

    /// Current position of a probe [m].
    pub fn probe_position(&self, probe: &Probe) -> Vector3<f64> {
        probe.position(self.bodies[probe.body].body.positions())
    }

    /// What is odd about the scene but allowed.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// What went wrong in the steps since the start or the last reset, a line for each body and kind, and
    /// what the estimate of the error does not see.
    pub fn troubles(&self) -> Vec<String> {
        let blind_spots = cuts::rounded_fronts(self.cuts.swept(), &self.bodies);
        self.bodies.iter().flat_map(SimBody::troubles).chain(blind_spots).collect()
    }

    /// Why the steps since the start or the last reset do not count as a run that succeeded; empty if they
    /// do. See [`SimBody::failure`].
    pub fn failures(&self) -> Vec<String> {
        self.bodies.iter().filter_map(SimBody::failure).collect()
    }

    /// Whether the last step ended early for the [stop flag](Self::set_stop_flag): its result depends on the time.
    pub fn was_broken_off(&self) -> bool {
        self.report.bodies.iter().any(|body| body.solve.outcome == Outcome::Interrupted)
    }

    /// Report of the last step.
    pub fn report(&self) -> &StepReport {
        &self.report
    }

    /// Cuts that changed a body so far.
    pub fn cuts_applied(&self) -> u64 {
        self.cuts.applied()
    }

    /// Effects on and off, with predicted and, after the first step, measured cost.
    pub fn plan(&self) -> Plan {
        let mut plan = self.plan.clone();
        if self.steps > 0 {
            let per_step = |stage| self.total.of(stage) * 1e3 / self.steps as f64;
            plan.measured("deformation", per_step(Stage::Deform));
            plan.measured("cutting", per_step(Stage::Cuts));
            plan.measured("adaptation", per_step(Stage::Adapt));
            plan.measured("contact", per_step(Stage::Contacts) + per_step(Stage::Reactions));
            plan.measured("energies", per_step(Stage::Measure));
        }
        plan.listening(&self.wants);
        plan
    }

    /// Seconds per stage since the start or the last reset.
    pub fn total_seconds(&self) -> StageSeconds {
        self.total
    }

    /// Seconds per phase of deforming since the start or the last reset, as far as they were measured.
    pub fn total_phases(&self) -> PhaseSeconds {
        self.total_phases
    }
}
