//! The same simulation again: from the start of a recording or from a checkpoint, held against the hashes.
//!
//! A checkpoint of another build cannot be read. The start needs none: it is made from the scene.

use std::collections::BTreeMap;
use std::path::Path;

use scindo_proto::messages::{RecordedOrder, RecordedScene, RecordedStep, recorded_order::Order};
use scindo_world::assemble::BuildOptions;
use scindo_world::scene::Scene;
use scindo_world::simulation::Simulation;
use serde::Serialize;

use super::inputs;
use super::reader::{Recorded, Recording, newest_checkpoint};
use crate::error::RuntimeError;

/// What came of a replay.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Replayed {
    /// Number of the step after which the replay began, 0 for the start.
    pub from: u64,
    /// Steps that were made again.
    pub steps: u64,
    /// Steps of them whose hash was compared.
    pub compared: u64,
    /// Checkpoints of the file that were skipped, because the inputs lead there as well.
    pub checkpoints: u64,
    /// The first step whose state differs.
    pub first_difference: Option<Difference>,
    /// Reasons for which the replay went on from a checkpoint, in the order of the recording.
    pub jumps: Vec<String>,
    /// Why the file ends before its end.
    pub truncated: Option<String>,
}

/// A step that came out otherwise.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Difference {
    /// Number of the step in the recording.
    pub number: u64,
    /// Number of the step in the scene.
    pub step: u64,
    /// Hash that was recorded.
    pub recorded: String,
    /// Hash now.
    pub found: String,
}

/// A recording that is computed again.
pub struct Replay {
    recording: Recording,
    simulation: Simulation,
    snapshots: BTreeMap<String, Vec<u8>>,
    /// Waiting for the checkpoint that follows a change that cannot be computed again.
    jumping: bool,
    found: Replayed,
}

impl Replay {
    /// Opens a recording, builds its scene, and goes to the newest checkpoint at or before `from_s` of simulated
    /// time since the recording began, or to the start.
    ///
    /// # Errors
    /// No recording, a scene that cannot be built, a checkpoint that cannot be read.
    pub fn open(path: &Path, threads: usize, from_s: Option<f64>) -> Result<Self, RuntimeError> {
        let mut recording = Recording::open(path)?;
        let scene = recording.scene()?;
        let simulation = build(&scene, threads)?;
        let (snapshots, found) = (BTreeMap::new(), Replayed::default());
        let mut replay = Self { recording, simulation, snapshots, jumping: false, found };
        if let Some(from_s) = from_s.filter(|from_s| *from_s > 0.0) {
            // A little more than the whole steps, against rounding.
            replay.go_to(path, (from_s / scene.step_s + 1e-6) as u64)?;
        }
        Ok(replay)
    }

    /// The simulation as it is now.
    pub fn simulation(&self) -> &Simulation {
        &self.simulation
    }

    /// What has been found so far.
    pub fn found(&self) -> &Replayed {
        &self.found
    }

    /// The same for a caller that draws surfaces.
    pub fn simulation_mut(&mut self) -> &mut Simulation {
        &mut self.simulation
    }

    /// Makes the next recorded step again. `None` at the end of the recording.
    ///
    /// # Errors
    /// A recording that contradicts itself.
    pub fn step(&mut self) -> Result<Option<u64>, RuntimeError> {
        while let Some(message) = self.recording.next_message()? {
            match message {
                Recorded::Order(order) => self.order(order)?,
                Recorded::Checkpoint(checkpoint) if self.jumping => {
                    self.simulation.restore(&checkpoint.state).map_err(|e| refused(&e))?;
                    self.jumping = false;
                }
                Recorded::Checkpoint(_) => self.found.checkpoints += 1,
                Recorded::Step(step) => {
                    self.make(&step)?;
                    return Ok(Some(step.number));
                }
                Recorded::Scene(_) | Recorded::Event(_) | Recorded::Forces(_) => {}
            }
        }
        self.found.truncated = self.recording.truncated().map(str::to_owned);
        Ok(None)
    }

    fn make(&mut self, step: &RecordedStep) -> Result<(), RuntimeError> {
        let inputs = inputs::read(step).map_err(|e| refused(&e))?;
        self.simulation.step(&inputs);
        self.found.steps += 1;
        if step.broken_off || self.found.first_difference.is_some() {
            return Ok(());
        }
        self.found.compared += 1;
        let found = self.simulation.state_hash();
        if step.hash[..] != found.to_le_bytes() {
            let recorded = <[u8; 16]>::try_from(&step.hash[..])
                .map_or_else(|_| "none".to_owned(), |hash| format!("{:032x}", u128::from_le_bytes(hash)));
            let found = format!("{found:032x}");
            let (number, step) = (step.number, step.step);
            self.found.first_difference = Some(Difference { number, step, recorded, found });
        }
        Ok(())
    }

    fn order(&mut self, order: RecordedOrder) -> Result<(), RuntimeError> {
        let number = order.number;
        let fails = |what: &str, why: String| RuntimeError::Replay {
            reason: format!("the order `{what}` after step {number} fails: {why}"),
        };
        match order.order {
            Some(Order::Reset(_)) => self.simulation.reset().map_err(|e| fails("reset", e.to_string()))?,
            Some(Order::Undo(_)) => drop(self.simulation.undo().map_err(|e| fails("undo", e))?),
            Some(Order::Set(set)) => {
                self.simulation.set(&set.key, &set.value).map_err(|e| fails("set", e))?;
            }
            Some(Order::GovernS(seconds)) => self.simulation.govern(seconds),
            Some(Order::Discard(reason)) => drop(self.simulation.discard_cuts(&reason)),
            Some(Order::Snapshot(name)) => {
                let state = self.simulation.checkpoint().map_err(|e| fails("snapshot", e.to_string()))?;
                self.snapshots.insert(name, state);
            }
            Some(Order::Restore(name)) => match self.snapshots.get(&name) {
                Some(state) => {
                    self.simulation.restore(state).map_err(|e| fails("restore", e.to_string()))?;
                }
                // It was taken before the replay began; the checkpoint that follows has the same state.
                None => self.jumping = true,
            },
            Some(Order::Jump(reason)) => {
                self.found.jumps.push(format!("after step {number}: {reason}"));
                self.jumping = true;
            }
            None => {}
        }
        Ok(())
    }

    /// Goes to the newest checkpoint after at most `most` steps.
    fn go_to(&mut self, path: &Path, most: u64) -> Result<(), RuntimeError> {
        let mut newest = None;
        while let Some(message) = self.recording.next_message()? {
            match message {
                Recorded::Checkpoint(checkpoint) if checkpoint.number <= most => newest = Some(checkpoint),
                Recorded::Step(step) if step.number > most => break,
                _ => {}
            }
        }
        let Some(newest) = newest else { return self.begin_again(path, None) };
        self.begin_again(path, Some(newest.number))?;
        self.simulation.restore(&newest.state).map_err(|e| refused(&e))?;
        self.found.from = newest.number;
        Ok(())
    }

    /// Reads from the beginning, and up to the last checkpoint after step `number`.
    fn begin_again(&mut self, path: &Path, number: Option<u64>) -> Result<(), RuntimeError> {
        self.recording = Recording::open(path)?;
        self.recording.scene()?;
        while let Some(number) = number {
            match self.recording.next_message()? {
                Some(Recorded::Checkpoint(checkpoint)) if checkpoint.number == number => break,
                Some(_) => {}
                None => break,
            }
        }
        Ok(())
    }
}

/// The newest checkpoint of a recording, and its scene, to go on from.
///
/// # Errors
/// No recording, or one without a checkpoint.
pub fn newest(path: &Path) -> Result<(Scene, u64, Vec<u8>), RuntimeError> {
    let (scene, newest) = newest_checkpoint(path)?;
    Ok((read_scene(&scene)?, newest.step, newest.state.to_vec()))
}

fn read_scene(scene: &RecordedScene) -> Result<Scene, RuntimeError> {
    Ok(Scene::from_json_in(&scene.json, &scene.file, Path::new(&scene.base_dir))?)
}

fn build(scene: &RecordedScene, threads: usize) -> Result<Simulation, RuntimeError> {
    let scene = read_scene(scene)?;
    let options = BuildOptions { threads, ..BuildOptions::default() };
    Ok(Simulation::with_options(&scene, scene.base_dir(), options)?)
}

fn refused(error: &dyn std::error::Error) -> RuntimeError {
    RuntimeError::Replay { reason: error.to_string() }
}
