//! The step: tools, cuts, contacts, deformation, reactions, in this order.
//!
//! [`Simulation::step`] is the table of contents of the system; each line is one stage, timed.

mod stopwatch;

mod report;

mod body;

mod cuts;

mod incision;

use std::path::Path;

use nalgebra::Vector3;
use scindo_physics::body::BodyError;

pub use body::SimBody;
pub use report::{BodyReport, Energy, Event, Level, StepReport};
pub use stopwatch::{Stage, StageSeconds};

use crate::build::{self, BuildOptions};
use crate::contact::Contacts;
use crate::inputs::{CutRequest, Inputs, Wants};
use crate::plan::{BodySize, Plan};
use crate::probe::Probe;
use crate::scene::{CheckedScene, Scene, SceneError};
use crate::snapshot::{Snapshot, Sources};
use crate::tool::Tools;
use cuts::{Cuts, Theatre};
use stopwatch::Stopwatch;

/// A running scene.
#[derive(Debug)]
pub struct Simulation {
    source: Scene,
    scene: CheckedScene,
    bodies: Vec<SimBody>,
    tools: Tools,
    cuts: Cuts,
    contacts: Contacts,
    probes: Vec<Probe>,
    plan: Plan,
    warnings: Vec<String>,
    steps: u64,
    wants: Wants,
    total: StageSeconds,
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
        let built = build::build(scene, base_dir, options)?;
        let (source, scene) = (scene.clone(), scene.checked().clone());
        let sizes: Vec<BodySize> = built.bodies.iter().map(SimBody::size).collect();
        let mut contacts = Contacts::default();
        for body in &scene.bodies {
            contacts.add_body(body.young_pa, scene.effects.contact != Some(false));
        }
        let report =
            StepReport { bodies: vec![BodyReport::default(); built.bodies.len()], ..StepReport::default() };
        let mut warnings = built.warnings;
        warnings.extend(cuts::doubts(&scene.cuts, &built.bodies));
        Ok(Self {
            plan: Plan::new(&scene, &sizes),
            tools: Tools::new(&scene.tools),
            cuts: Cuts::new(&scene.cuts, &built.bodies),
            contacts,
            bodies: built.bodies,
            probes: built.probes,
            warnings,
            steps: 0,
            wants: Wants::default(),
            total: StageSeconds::default(),
            report,
            source,
            scene,
        })
    }

    /// One step of simulated time. The order of the lines is the order of the data.
    pub fn step(&mut self, inputs: &Inputs) -> &StepReport {
        let mut watch = Stopwatch::start();
        self.begin(inputs);
        self.tools.advance(self.time_s(), &inputs.tools);
        watch.book(Stage::Tools);
        self.cut(&inputs.cuts);
        watch.book(Stage::Cuts);
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
    }

    fn cut(&mut self, requests: &[CutRequest]) {
        let time_s = self.time_s();
        let allowed = self.scene.effects.cutting != Some(false);
        let Self { cuts, bodies, tools, report, probes, .. } = self;
        let before = cuts.applied();
        let at = &mut Theatre { bodies, tools, report, allowed };
        // A cut at t = 0 is there before the first step, hence at the time this step starts from.
        cuts.apply_schedule(time_s - self.scene.step_s, at);
        cuts.apply_requests(requests, at);
        cuts.apply_blades(at);
        if cuts.applied() > before {
            probes.iter_mut().for_each(|probe| probe.follow(&bodies[probe.body].body));
        }
    }

    fn touch(&mut self) {
        if self.tools.any_active() {
            for (i, body) in self.bodies.iter_mut().enumerate() {
                let (shown, positions) = body.surface_now();
                let epoch = shown.cut_mesh().epoch();
                if let Err(error) = self.contacts.update_surface(i, epoch, shown.surface(), positions) {
                    self.report.tell(Level::Error, "contact-surface", &body.id, error.to_string());
                }
            }
        }
        self.contacts.detect(&mut self.tools);
    }

    fn deform(&mut self) {
        for (i, body) in self.bodies.iter_mut().enumerate() {
            let solve = body.body.step(self.scene.step_s, self.scene.gravity_m_s2, self.contacts.springs(i));
            body.has_moved();
            self.report.bodies[i].solve = solve;
            self.report.tell_of_solve(&body.id, &solve, &mut body.noticed);
        }
    }

    fn react(&mut self) {
        for (i, body) in self.bodies.iter().enumerate() {
            self.contacts.collect(i, body.body.spring_forces());
        }
        self.contacts.react(&mut self.tools);
    }

    fn measure(&mut self) {
        let energy = self.wants.energy || self.scene.effects.energy == Some(true);
        let estimate = self.scene.effects.error_estimate == Some(true);
        for (body, report) in self.bodies.iter_mut().zip(&mut self.report.bodies) {
            report.energy = energy.then(|| body.energy());
            report.mesh_error = if estimate { body.mesh_error() } else { None };
        }
    }

    fn finish(&mut self, watch: Stopwatch) -> &StepReport {
        self.report.seconds = watch.seconds();
        self.total.add(&self.report.seconds);
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
            self.contacts.forget_motion(i);
        }
        for probe in &mut self.probes {
            probe.follow(&self.bodies[probe.body].body);
        }
        self.tools.reset();
        self.cuts.reset();
        self.steps = 0;
        self.total = StageSeconds::default();
        Ok(())
    }

    /// Fills a snapshot of the present state: surfaces only as `wants` says.
    pub fn snapshot_into(&mut self, wants: &Wants, snapshot: &mut Snapshot) {
        let (steps, time_s) = (self.steps, self.time_s());
        let Self { bodies, report, tools, .. } = self;
        snapshot.fill(steps, time_s, wants, Sources { bodies, report, tools });
    }

    /// Changes one value of the scene while it runs, under the same checks as the file.
    ///
    /// # Errors
    /// What is wrong with key or value, or that it takes effect only at a start.
    pub fn set(&mut self, key: &str, value: &str) -> Result<(), String> {
        let changed = self.source.apply_set(&format!("{key}={value}")).map_err(|error| error.to_string())?;
        let scene = changed.checked().clone();
        let live = key == "world.gravity_m_s2" || key == "effects.energy" || key == "effects.error_estimate";
        let solver = key.starts_with("body.") && key.contains(".solver.");
        if !live && !solver {
            return Err(format!(
                "`{key}` takes effect only at a start, with --set; while running: world.gravity_m_s2, \
                 effects.energy, effects.error_estimate, body.<id>.solver.iterations, body.<id>.solver.tolerance"
            ));
        }
        for (body, spec) in self.bodies.iter_mut().zip(&scene.bodies) {
            let solver = build::mechanics::linear(&spec.mechanics);
            body.body.set_solver(solver).map_err(|error| error.to_string())?;
        }
        self.scene = scene;
        self.source = changed;
        Ok(())
    }
}

/// What can be read off a simulation.
impl Simulation {
    /// The checked scene it was built from.
    pub fn scene(&self) -> &CheckedScene {
        &self.scene
    }

    /// Steps done since the start or the last reset.
    pub fn steps(&self) -> u64 {
        self.steps
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
}
