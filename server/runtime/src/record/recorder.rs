//! What a simulation hands to its recording, step by step.

use std::collections::HashMap;
use std::path::PathBuf;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use prost::Message;
use scindo_proto::messages::{
    RecordedCheckpoint, RecordedEvent, RecordedForces, RecordedOrder, RecordedScene, RecordedStats,
    RecordedStep, RecordedSurface, RecordingStats, recorded_order::Order,
};
use scindo_world::inputs::{Inputs, Wants};
use scindo_world::simulation::Simulation;
use scindo_world::snapshot::Snapshot;

use super::inputs;
use super::writer::{Item, WriterThread, in_memory};
use crate::error::RuntimeError;

/// A checkpoint is not taken more often than this many times what the last one took, so that checkpoints of
/// large scenes cost at most a twentieth of the time.
const CHECKPOINT_SHARE: u32 = 20;

/// Why a recording that begins after the first step cannot be computed from its scene alone.
const IN_THE_MIDDLE: &str = "the recording begins in the middle of a scene";

const SCENE: usize = 0;
const STEP: usize = 1;
const ORDER: usize = 2;
const CHECKPOINT: usize = 3;
const EVENT: usize = 4;
const STATS: usize = 5;
const FORCES: usize = 6;
const SURFACE: usize = 7;

/// What is recorded, and where.
#[derive(Debug, Clone)]
pub struct RecordSettings {
    /// The file; it must not exist yet.
    pub file: PathBuf,
    /// Time from one checkpoint to the next.
    pub checkpoint: Duration,
    /// Whether the surfaces of all bodies are recorded.
    pub surfaces: bool,
    /// Whether the simulation waits for the disk, because it does not run in real time.
    pub patient: bool,
    /// Threads of the simulation, for the record.
    pub threads: u32,
}

/// The recording of one simulation.
pub struct Recorder {
    settings: RecordSettings,
    writer: WriterThread,
    /// Steps so far.
    number: u64,
    began: Instant,
    /// Size of all messages so far, before compression.
    bytes: u64,
    next_checkpoint: Instant,
    /// A checkpoint is due, whatever the time.
    due: bool,
    snapshot: Snapshot,
    epochs: HashMap<usize, u32>,
    /// Why it ended early.
    ended: Option<String>,
}

impl Recorder {
    /// Creates the file; its first messages are the scene and a checkpoint of its start.
    ///
    /// # Errors
    /// The file exists, or cannot be created, or the state cannot be written.
    pub fn begin(settings: RecordSettings, simulation: &Simulation) -> Result<Self, RuntimeError> {
        let writer = WriterThread::begin(&settings.file)?;
        let mut recorder = Self {
            writer,
            number: 0,
            began: Instant::now(),
            bytes: 0,
            next_checkpoint: Instant::now() + settings.checkpoint,
            due: true,
            snapshot: Snapshot::default(),
            epochs: HashMap::new(),
            ended: None,
            settings,
        };
        recorder.send(SCENE, &scene_message(simulation, recorder.settings.threads));
        if simulation.steps() > 0 {
            recorder.jump(IN_THE_MIDDLE);
        }
        recorder.checkpoint(simulation);
        Ok(recorder)
    }

    /// Records a step that read `inputs` and led to the present state.
    pub fn step(&mut self, inputs: &Inputs, simulation: &mut Simulation) {
        if self.ended.is_some() {
            return;
        }
        self.number += 1;
        let (number, report) = (self.number, simulation.report());
        let broken_off = simulation.was_broken_off();
        let mut step = RecordedStep {
            number,
            step: simulation.steps(),
            time_s: simulation.time_s(),
            hash: simulation.state_hash().to_le_bytes().to_vec().into(),
            broken_off,
            ..RecordedStep::default()
        };
        inputs::write(inputs, &mut step);
        self.send(STEP, &step);
        for event in &report.events {
            let body_id = event.body.as_deref().unwrap_or_default().to_owned();
            let (name, message) = (event.name.to_owned(), event.message.clone());
            self.send(EVENT, &RecordedEvent { number, name, message, body_id });
        }
        let stats = RecordedStats {
            number,
            time_s: simulation.time_s(),
            step_ms: 1e3 * report.seconds.iter().map(|(_, seconds)| seconds).sum::<f64>(),
            iterations: report.bodies.iter().map(|body| body.solve.iterations).collect(),
            residual: report.bodies.iter().map(|body| body.solve.residual).collect(),
        };
        self.send(STATS, &stats);
        if !simulation.tools().is_empty() {
            let tools = simulation.tools().iter().map(inputs::to_force).collect();
            self.send(FORCES, &RecordedForces { number, time_s: simulation.time_s(), tools });
        }
        if self.settings.surfaces {
            self.surfaces(simulation);
        }
        if broken_off {
            self.jump("a step was broken off by an order");
        }
        if self.due || Instant::now() >= self.next_checkpoint {
            self.checkpoint(simulation);
        }
    }

    /// Records what changed the simulation between two steps.
    pub fn order(&mut self, order: Order) {
        self.send(ORDER, &RecordedOrder { number: self.number, order: Some(order) });
    }

    /// Notes that the state changes in a way that cannot be computed again.
    pub fn jump(&mut self, reason: &str) {
        self.order(Order::Jump(reason.to_owned()));
        self.due = true;
    }

    /// Asks for a checkpoint as soon as possible.
    pub fn must_follow(&mut self) {
        self.due = true;
    }

    /// Writes the checkpoint that a [jump](Self::jump) asked for.
    pub fn catch_up(&mut self, simulation: &Simulation) {
        if self.due {
            self.checkpoint(simulation);
        }
    }

    /// Name of the file, time since it began [s], size of its messages [bytes].
    pub fn progress(&self) -> RecordingStats {
        let name = self.settings.file.file_name().unwrap_or_default();
        let file = name.to_string_lossy().into_owned();
        RecordingStats { file, seconds: self.began.elapsed().as_secs_f64(), bytes: self.bytes }
    }

    /// Why the recording ended before the simulation, once.
    pub fn take_failure(&mut self) -> Option<String> {
        self.ended.as_mut().map(std::mem::take).filter(|reason| !reason.is_empty())
    }

    /// Writes the end of the file.
    ///
    /// # Errors
    /// What the disk says.
    pub fn end(&mut self) -> Result<(), RuntimeError> {
        self.writer.end()
    }

    fn checkpoint(&mut self, simulation: &Simulation) {
        if self.ended.is_some() {
            return;
        }
        let start = Instant::now();
        match simulation.checkpoint() {
            Ok(state) => {
                let (number, step) = (self.number, simulation.steps());
                self.send(CHECKPOINT, &RecordedCheckpoint { number, step, state: state.into() });
            }
            Err(error) => self.ended = Some(error.to_string()),
        }
        let took = start.elapsed();
        self.next_checkpoint = start + self.settings.checkpoint.max(took * CHECKPOINT_SHARE);
        self.due = false;
    }

    fn surfaces(&mut self, simulation: &mut Simulation) {
        let n = simulation.bodies().len();
        let wants = Wants { surface: vec![true; n], ..Wants::default() };
        let mut snapshot = std::mem::take(&mut self.snapshot);
        simulation.snapshot_into(&wants, &mut snapshot);
        for (index, body) in snapshot.bodies.iter().enumerate() {
            let is_new = self.epochs.insert(index, body.epoch) != Some(body.epoch);
            let triangles = if is_new { &body.topology.triangles[..] } else { &[] };
            let message = RecordedSurface {
                number: self.number,
                time_s: snapshot.time_s,
                body_id: body.id.to_string(),
                epoch: body.epoch,
                positions_m: body.positions.iter().flatten().flat_map(|x| x.to_le_bytes()).collect(),
                triangles: triangles.iter().flatten().flat_map(|x| x.to_le_bytes()).collect(),
            };
            self.send(SURFACE, &message);
        }
        self.snapshot = snapshot;
    }

    fn send(&mut self, topic: usize, message: &impl Message) {
        if self.ended.is_some() {
            return;
        }
        let item = item(topic, message);
        self.bytes += item.bytes.len() as u64;
        if let Err(reason) = self.writer.send(item, self.settings.patient) {
            self.ended = Some(reason);
        }
    }
}

/// A state as the messages of a recording without steps.
pub struct StateMessages {
    scene: String,
    items: Vec<Item>,
}

impl StateMessages {
    /// The present state.
    ///
    /// # Errors
    /// The state cannot be written.
    pub fn of(simulation: &Simulation, threads: u32) -> Result<Self, String> {
        let (number, step) = (0, simulation.steps());
        let state = simulation.checkpoint().map_err(|error| error.to_string())?;
        let scene = scene_message(simulation, threads);
        let jump = RecordedOrder { number, order: Some(Order::Jump(IN_THE_MIDDLE.to_owned())) };
        let checkpoint = RecordedCheckpoint { number, step, state: state.into() };
        let items = vec![item(SCENE, &scene), item(ORDER, &jump), item(CHECKPOINT, &checkpoint)];
        Ok(Self { scene: scene.name, items })
    }

    /// Name of the scene.
    pub fn scene(&self) -> &str {
        &self.scene
    }

    /// Size of the messages, before compression [bytes].
    pub fn bytes(&self) -> usize {
        self.items.iter().map(|item| item.bytes.len()).sum()
    }

    /// The bytes of the file.
    ///
    /// # Errors
    /// What the library says.
    pub fn file(&self) -> Result<Vec<u8>, String> {
        in_memory(&self.items)
    }
}

fn item(topic: usize, message: &impl Message) -> Item {
    let unix = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    let unix_ns = u64::try_from(unix.as_nanos()).unwrap_or(u64::MAX);
    Item { topic, unix_ns, bytes: message.encode_to_vec() }
}

fn scene_message(simulation: &Simulation, threads: u32) -> RecordedScene {
    let scene = simulation.source();
    RecordedScene {
        json: scene.to_json().to_string(),
        file: scene.file().to_owned(),
        base_dir: std::path::absolute(scene.base_dir())
            .map_or_else(|_| String::new(), |folder| folder.display().to_string()),
        name: scene.name().to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        step_s: simulation.step_s(),
        threads,
    }
}
