//! The simulation as the runtime drives it: [`Simulation`] and its results on disk.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use nalgebra::Vector3;
use scindo_proto::limits::{
    HEADER_BYTES, MAX_PARAMS, MAX_STATE_BYTES, POSITION_BYTES, TAG_BYTES, TRIANGLE_BYTES,
};
use scindo_proto::messages::{
    BodyInfo, BodyLook, Effect, LookLayer, ParamsReply, Plan, RecordingStats, SessionInfo, SetRequest,
    TextureReply, ToolInfo, recorded_order,
};
use scindo_proto::{Chunk, WIRE_VERSION};
use scindo_world::inputs::{CutOutcome, Inputs, Wants};
use scindo_world::results::{Results, ResultsError};
use scindo_world::scene::{BodySpec, LookSpec};
use scindo_world::simulation::{SimBody, Simulation, StepReport};
use scindo_world::snapshot::Snapshot;
use scindo_world::tool::SCRIPT;

use super::snapshots::{self, Snapshots};
use crate::error::RuntimeError;
use crate::record::on_demand::{Ending, RecordFolder};
use crate::record::recorder::{RecordSettings, Recorder, StateMessages};
use crate::wire::convert::{to_param, to_shape, to_vec3};
use crate::wire::obstacle::to_obstacles;

/// A simulation that records its results and counts its failures.
pub struct Engine {
    sim: Simulation,
    results: Option<Results>,
    /// Steps that panicked so far.
    panics: u64,
    /// First failure to write results. Later steps are not recorded.
    failure: Option<ResultsError>,
    recorder: Option<Recorder>,
    /// Where operators may record; `None` if they may not.
    record_folder: Option<RecordFolder>,
    /// The present recording was begun by an operator.
    on_demand: bool,
    ending: Ending,
    /// Threads of the simulation, for files; 0 if nobody said.
    threads: u32,
    snapshots: Snapshots,
}

impl Engine {
    /// Drives `sim` and records each step. Fails if an id of the scene cannot stand in a key.
    pub fn new(sim: Simulation, results: Option<Results>) -> Result<Self, RuntimeError> {
        for body in &sim.scene().bodies {
            Chunk::new("body id", &body.id)?;
        }
        for tool in &sim.scene().tools {
            Chunk::new("tool id", &tool.id)?;
        }
        Ok(Self {
            sim,
            results,
            panics: 0,
            failure: None,
            recorder: None,
            record_folder: None,
            on_demand: false,
            ending: Ending::default(),
            snapshots: Snapshots::default(),
            threads: 0,
        })
    }

    /// Records everything from now on.
    ///
    /// # Errors
    /// The file exists, or cannot be created.
    pub fn record(&mut self, settings: RecordSettings) -> Result<(), RuntimeError> {
        self.recorder = Some(Recorder::begin(settings, &self.sim)?);
        Ok(())
    }

    /// Notes the number of threads of the simulation, which files tell.
    pub fn note_threads(&mut self, threads: u32) {
        self.threads = threads;
    }

    /// Lets operators record into a folder.
    pub fn let_record(&mut self, folder: RecordFolder) {
        self.record_folder = Some(folder);
    }

    /// Begins a recording of what follows, and returns the name of its file.
    ///
    /// # Errors
    /// Recordings are not allowed here, one is under way, or the file cannot be made.
    pub fn begin_recording(&mut self) -> Result<String, String> {
        if let Some(recorder) = &self.recorder {
            return Err(format!("{} is being recorded already", recorder.progress().file));
        }
        let folder = self.record_folder.as_ref();
        let folder = folder.ok_or("the server was started without a folder for recordings".to_owned())?;
        let recorder = folder.begin(&self.sim).map_err(|error| error.to_string())?;
        let file = recorder.progress().file;
        (self.recorder, self.on_demand) = (Some(recorder), true);
        Ok(file)
    }

    /// Ends the recording that an operator began. Its last messages are written while the simulation goes on;
    /// [`take_ended_recording`](Self::take_ended_recording) tells when the file is complete.
    ///
    /// # Errors
    /// There is none, or it was asked for at the start of the server.
    pub fn end_recording(&mut self) -> Result<String, String> {
        if self.recorder.is_some() && !self.on_demand {
            return Err("the recording that the server was started with lasts until its end".to_owned());
        }
        let recorder = self.recorder.take().ok_or("nothing is being recorded".to_owned())?;
        let file = recorder.progress().file;
        self.ending.end(recorder).map_err(|error| error.to_string())?;
        Ok(file)
    }

    /// A recording whose file is complete since the last call, or why it is not.
    pub fn take_ended_recording(&mut self) -> Option<(RecordingStats, Result<(), RuntimeError>)> {
        self.ending.ended(false)
    }

    /// The recording under way.
    pub fn recording(&self) -> Option<RecordingStats> {
        self.recorder.as_ref().map(Recorder::progress)
    }

    /// The present state as the messages of a file.
    ///
    /// # Errors
    /// The state cannot be written, or is too large to be sent.
    pub fn state_messages(&self) -> Result<StateMessages, String> {
        let messages = StateMessages::of(&self.sim, self.threads)?;
        let (mib, most) = (messages.bytes() >> 20, MAX_STATE_BYTES >> 20);
        if messages.bytes() > MAX_STATE_BYTES {
            return Err(format!("the state has {mib} MiB, and at most {most} are sent"));
        }
        Ok(messages)
    }

    /// Why the recording ended before the simulation, told once.
    pub fn take_recording_failure(&mut self) -> Option<String> {
        let failure = self.recorder.as_mut()?.take_failure()?;
        if self.on_demand {
            // Another one may be begun.
            self.recorder = None;
        }
        Some(failure)
    }

    fn note(&mut self, order: impl FnOnce() -> recorded_order::Order) {
        if let Some(recorder) = &mut self.recorder {
            recorder.order(order());
        }
    }

    /// Read access to the simulation.
    pub fn simulation(&self) -> &Simulation {
        &self.sim
    }

    /// Simulated time per step [s].
    pub fn step_s(&self) -> f64 {
        self.sim.step_s()
    }

    /// Present scene, bodies and tools. Tools that clients hold are left out.
    pub fn info(&self) -> SessionInfo {
        let scene = self.sim.scene();
        let tools = scene.tools.iter().map(|tool| ToolInfo {
            id: tool.id.clone(),
            shape: Some(to_shape(&tool.shape)),
            owner: if tool.path.is_empty() { String::new() } else { SCRIPT.to_owned() },
            cuts: tool.cuts(),
        });
        SessionInfo {
            server_version: env!("CARGO_PKG_VERSION").to_owned(),
            wire_version: WIRE_VERSION,
            scene_name: scene.name.clone(),
            scene_description: scene.description.clone(),
            step_s: scene.step_s,
            bodies: self.sim.bodies().iter().zip(&scene.bodies).map(body_info).collect(),
            tools: tools.collect(),
            up: Some(to_vec3(&up(&scene.gravity_m_s2))),
            obstacles: to_obstacles(self.sim.obstacles()),
            records: self.record_folder.is_some(),
            ..SessionInfo::default()
        }
    }

    /// The images on the skins of bodies.
    pub fn textures(&self) -> Vec<TextureReply> {
        let image = |body: &SimBody| {
            let image = &body.texture.as_ref()?.image;
            Some(TextureReply {
                body_id: body.id.to_string(),
                media_type: image.media_type.to_owned(),
                image: image.bytes.clone(),
            })
        };
        self.sim.bodies().iter().filter_map(image).collect()
    }

    /// All effects of the scene: whether each is on, why, and what it costs.
    pub fn plan(&self) -> Plan {
        let effects = self.sim.plan().effects.into_iter().map(|effect| Effect {
            name: effect.name,
            on: effect.on,
            why: effect.why,
            predicted_ms: effect.predicted_ms as f32,
            measured_ms: effect.measured_ms.unwrap_or(0.0) as f32,
        });
        Plan { effects: effects.collect() }
    }

    /// Parameters that [`Self::set`] may change, with present values and ranges.
    pub fn params(&self) -> ParamsReply {
        let params = self.sim.parameters().into_iter().take(MAX_PARAMS).map(to_param);
        ParamsReply { params: params.collect() }
    }

    /// Length of the longest message that holds a whole surface at present [bytes].
    pub fn longest_surface(&self) -> usize {
        let bytes = |body: &SimBody| {
            let surface = body.body.surface();
            surface.vertices.len() * POSITION_BYTES + surface.triangles.len() * (TRIANGLE_BYTES + TAG_BYTES)
        };
        self.sim.bodies().iter().map(bytes).max().unwrap_or(0) + HEADER_BYTES
    }

    /// Makes one step and records it.
    pub fn step(&mut self, inputs: &Inputs) {
        self.sim.step(inputs);
        if let Some(recorder) = &mut self.recorder {
            recorder.step(inputs, &mut self.sim);
        }
        if let Some(results) = self.results.as_mut().filter(|_| self.failure.is_none())
            && let Err(error) = results.record(&self.sim)
        {
            tracing::error!(%error, "results cannot be written; they end at this step");
            self.failure = Some(error);
        }
    }

    /// Takes note of how long the last step took.
    pub fn govern(&mut self, took: Duration) {
        let seconds = took.as_secs_f64();
        self.sim.govern(seconds);
        if self.sim.governor_report().is_some() {
            self.note(|| recorded_order::Order::GovernS(seconds));
        }
    }

    /// Installs `flag`: once it is raised, the current step ends early.
    pub fn set_stop_flag(&mut self, flag: &Arc<AtomicBool>) {
        self.sim.set_stop_flag(flag);
    }

    /// Discards cuts that wait or are under way. Their outcomes give `reason`.
    pub fn discard_cuts(&mut self, reason: &str) -> Vec<CutOutcome> {
        self.note(|| recorded_order::Order::Discard(reason.to_owned()));
        self.sim.discard_cuts(reason)
    }

    /// Completes the results. `status` is `done`, or the reason why the run ended.
    ///
    /// # Errors
    /// The disk failed, now or in an earlier step.
    pub fn finish(&mut self, status: &str) -> Result<(), RuntimeError> {
        if let Some(recorder) = &mut self.recorder {
            recorder.end()?;
        }
        while let Some((_, ended)) = self.ending.ended(true) {
            ended?;
        }
        if let Some(error) = self.failure.take() {
            return Err(error.into());
        }
        if let Some(results) = &mut self.results {
            results.finish(&self.sim, status)?;
        }
        Ok(())
    }

    /// Reasons why the run so far counts as failed; empty if it does not.
    pub fn failures(&self) -> Vec<String> {
        let mut failures = self.sim.failures();
        if self.panics > 0 {
            failures.push(format!("{} steps panicked, and the scene restarted after each", self.panics));
        }
        failures
    }

    /// Counts a panicked step. That is a defect of the program, and a reset does not excuse it.
    pub fn count_panic(&mut self) {
        self.panics += 1;
        if let Some(recorder) = &mut self.recorder {
            recorder.jump("a step panicked");
        }
    }

    /// Report of the last step.
    pub fn report(&self) -> &StepReport {
        self.sim.report()
    }

    /// Copies the present state. Parts that nobody wants stay empty.
    pub fn snapshot_into(&mut self, wants: &Wants, snapshot: &mut Snapshot) {
        self.sim.snapshot_into(wants, snapshot);
    }

    /// Goes back to the start. Epochs keep rising.
    ///
    /// # Errors
    /// The reason why a body cannot be built again, in words.
    pub fn reset(&mut self) -> Result<(), String> {
        self.sim.reset().map_err(|error| error.to_string())?;
        self.note(|| recorded_order::Order::Reset(true));
        if let Some(recorder) = &mut self.recorder {
            recorder.catch_up(&self.sim);
        }
        Ok(())
    }

    /// Takes the last cut back and returns its description.
    ///
    /// # Errors
    /// There is no cut to take back.
    pub fn undo(&mut self) -> Result<String, String> {
        let undone = self.sim.undo()?;
        self.note(|| recorded_order::Order::Undo(true));
        let ids: Vec<&str> = undone.bodies.iter().map(|&body| &*self.sim.bodies()[body].id).collect();
        Ok(format!("{}: incision {} was undone", ids.join(", "), undone.incision))
    }

    /// Changes one parameter of the scene.
    ///
    /// # Errors
    /// What is wrong with key or value, in words.
    pub fn set(&mut self, key: &str, value: &str) -> Result<(), String> {
        self.sim.set(key, value)?;
        let request = SetRequest { key: key.to_owned(), value: value.to_owned() };
        self.note(|| recorded_order::Order::Set(request));
        Ok(())
    }

    /// Keeps the present state as `name`.
    ///
    /// # Errors
    /// A name that is not allowed, no room, or a state that cannot be written.
    pub fn snapshot(&mut self, name: &str) -> Result<String, String> {
        snapshots::check(name)?;
        let state = self.sim.checkpoint().map_err(|error| error.to_string())?;
        let bytes = state.len();
        self.snapshots.keep(name, state)?;
        self.note(|| recorded_order::Order::Snapshot(name.to_owned()));
        Ok(format!("kept step {} as {name}, {} KiB", self.sim.steps(), bytes.div_ceil(1 << 10)))
    }

    /// Whether a state is kept as `name`.
    pub fn has_snapshot(&self, name: &str) -> bool {
        self.snapshots.get(name).is_ok()
    }

    /// Goes back to the state that was kept as `name`. Epochs keep rising.
    ///
    /// # Errors
    /// There is none, or it does not belong to this scene. Nothing has changed then.
    pub fn restore(&mut self, name: &str) -> Result<String, String> {
        let state = self.snapshots.get(name)?;
        self.sim.restore(state).map_err(|error| error.to_string())?;
        self.note(|| recorded_order::Order::Restore(name.to_owned()));
        if let Some(recorder) = &mut self.recorder {
            recorder.must_follow();
            recorder.catch_up(&self.sim);
        }
        Ok(format!("back at step {}, as it was kept as {name}", self.sim.steps()))
    }
}

/// Unit vector against gravity; z without gravity.
fn up(gravity: &Vector3<f64>) -> Vector3<f64> {
    (-gravity).try_normalize(1e-9).unwrap_or_else(Vector3::z)
}

fn to_look(look: &LookSpec) -> BodyLook {
    let layer = |&(depth_m, colour): &(f64, u32)| LookLayer { depth_m: depth_m as f32, colour };
    BodyLook {
        colour: look.colour,
        opacity: look.opacity as f32,
        layers: look.layers.iter().map(layer).collect(),
        textured: look.texture.is_some(),
    }
}

fn body_info((body, spec): (&SimBody, &BodySpec)) -> BodyInfo {
    let positions = body.body.positions();
    let first = positions.first().copied().unwrap_or_default();
    let (min, max) = positions.iter().fold((first, first), |(min, max), x| (min.inf(x), max.sup(x)));
    BodyInfo {
        id: body.id.to_string(),
        epoch: body.shown_epoch(),
        elements: body.body.n_elements() as u32,
        nodes: body.body.n_nodes() as u32,
        min_m: Some(to_vec3(&min)),
        max_m: Some(to_vec3(&max)),
        look: Some(to_look(&spec.look)),
    }
}
