//! Goes through the effects of a scene and steps it without each of them.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use scindo_physics::body::BodyError;
use scindo_world::assemble::BuildOptions;
use scindo_world::inputs::Inputs;
use scindo_world::scene::{Scene, SceneError};
use scindo_world::simulation::Simulation;
use serde::Serialize;
use thiserror::Error;

use super::saving::{Off, Saving, quartiles};
use super::switch::{Switch, drives, switch};
use crate::trial::one_line;

/// A twin is given up when it has taken so many times as long as the scene itself, and [`GRACE_S`] more.
const PATIENCE: f64 = 30.0;

/// Processor time that every twin gets [s].
const GRACE_S: f64 = 5.0;

/// What to measure.
#[derive(Debug, Clone)]
pub struct Request {
    /// Steps from the start of the scene, for each effect once more.
    pub steps: u32,
    /// Ends the measurement after the current step.
    pub stop: Arc<AtomicBool>,
}

/// What the effects of a scene cost on this machine, on one thread.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EffectsReport {
    /// Name of the scene.
    pub scene: String,
    /// Steps that were made with all effects.
    pub steps: u32,
    /// Median processor time of a step with all effects [ms].
    pub step_ms: f64,
    /// The effects of the plan, in its order.
    pub effects: Vec<Row>,
    /// Whether the measurement was stopped early.
    pub interrupted: bool,
}

/// One effect.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// Name in the plan.
    pub name: String,
    /// Whether the scene computes it.
    pub on: bool,
    /// Why it is on or off.
    pub why: String,
    /// Cost that the plan predicted [ms per step].
    pub predicted_ms: f64,
    /// Mean time of the stage of the step that computes it [ms], if it has one of its own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub measured_ms: Option<f64>,
    /// What switching it off does.
    pub off: Off,
}

/// A scene whose effects cannot be measured.
#[derive(Debug, Error)]
pub enum EffectsError {
    /// It cannot be built.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// It cannot be taken back to its start.
    #[error("the scene cannot be started again: {0}")]
    Body(#[from] BodyError),
}

/// Measures the effects of `scene`. `tell` hears which effect is measured, and the steps that are done of how many.
///
/// # Errors
/// A scene that cannot be built. What cannot be measured is in the report.
pub fn measure(
    scene: &Scene,
    request: &Request,
    tell: &mut dyn FnMut(&str, u64, u64),
) -> Result<EffectsReport, EffectsError> {
    let mut subject = build(scene, scene.base_dir())?;
    subject.set_stop_flag(&request.stop);
    let twins: Vec<Vec<String>> = twins(&subject);
    let steps = u64::from(request.steps);
    let total = steps * (1 + 2 * twins.len() as u64);
    let mut times = Vec::new();
    while times.len() < request.steps as usize && !request.stop.load(Ordering::Relaxed) {
        tell("all effects", times.len() as u64, total);
        times.push(step(&mut subject));
    }
    let plan = subject.plan();
    let sound = subject.failures().is_empty();
    let mut outcomes: Vec<(Vec<String>, Off)> = Vec::new();
    for keys in twins {
        let done = steps * (1 + 2 * outcomes.len() as u64);
        let off = if request.stop.load(Ordering::Relaxed) {
            Off::NotMeasured
        } else {
            subject.reset()?;
            let mut told = |pairs: usize| tell(&keys.join(" "), done + 2 * pairs as u64, total);
            without(&mut subject, sound, scene, &keys, request, &mut told)?
        };
        outcomes.push((keys, off));
    }
    let off = |name: &str| match switch(name, subject.scene()) {
        Switch::None(reason) => Off::Impossible { reason: reason.to_owned() },
        Switch::Keys(keys) => {
            outcomes.iter().find(|(of, _)| *of == keys).map_or(Off::NotMeasured, |(_, off)| off.clone())
        }
    };
    let rows = plan.effects.iter().map(|effect| Row {
        name: effect.name.clone(),
        on: effect.on,
        why: effect.why.clone(),
        predicted_ms: effect.predicted_ms,
        measured_ms: effect.measured_ms,
        off: if effect.on { off(&effect.name) } else { Off::AlreadyOff },
    });
    Ok(EffectsReport {
        scene: scene.name().to_owned(),
        steps: times.len() as u32,
        step_ms: quartiles(&mut times)[1],
        effects: rows.collect(),
        interrupted: request.stop.load(Ordering::Relaxed),
    })
}

/// The different sets of keys that switch effects off that are on.
fn twins(subject: &Simulation) -> Vec<Vec<String>> {
    let mut twins = Vec::new();
    for effect in subject.plan().effects.iter().filter(|effect| effect.on) {
        if let Switch::Keys(keys) = switch(&effect.name, subject.scene())
            && !twins.contains(&keys)
        {
            twins.push(keys);
        }
    }
    twins
}

/// Steps `subject` from its start beside a twin with other `keys`.
fn without(
    subject: &mut Simulation,
    sound: bool,
    scene: &Scene,
    keys: &[String],
    request: &Request,
    tell: &mut dyn FnMut(usize),
) -> Result<Off, BodyError> {
    let built = scene.apply_sets(keys).and_then(|twin| build(&twin, scene.base_dir()));
    let mut twin = match built {
        Ok(twin) => twin,
        Err(error) => return Ok(Off::Impossible { reason: first(&error) }),
    };
    twin.set_stop_flag(&request.stop);
    let alone = drives(keys);
    let (mut pairs, mut same_state) = (Vec::new(), 0);
    let (mut spent_ms, mut twin_ms) = (0.0, 0.0);
    for pair in 0..request.steps as usize {
        if request.stop.load(Ordering::Relaxed) {
            return Ok(Off::NotMeasured);
        }
        tell(pair);
        same_state += usize::from(!alone && twin.take_state_of(subject)?);
        let times = if pair % 2 == 0 {
            let with = step(subject);
            [with, step(&mut twin)]
        } else {
            let without = step(&mut twin);
            [step(subject), without]
        };
        (spent_ms, twin_ms) = (spent_ms + times[0], twin_ms + times[1]);
        pairs.push(times);
        if twin_ms > PATIENCE * spent_ms + 1e3 * GRACE_S {
            let reason = format!("a step takes {:.0} times as long without it", twin_ms / spent_ms);
            return Ok(Off::Fails { reason });
        }
    }
    Ok(match twin.failures().first().filter(|_| sound) {
        Some(reason) => Off::Fails { reason: one_line(reason) },
        None => Off::Measured(Saving::of(&pairs, same_state, keys.to_vec())),
    })
}

/// The first thing that is wrong with a scene, without the name of its file.
fn first(error: &SceneError) -> String {
    let Some(problem) = error.problems.first() else { return one_line(&error.to_string()) };
    let more = match error.problems.len() - 1 {
        0 => String::new(),
        more => format!(" (and {more} more)"),
    };
    one_line(&format!("{}: {}{more}", problem.place.key, problem.fault))
}

fn build(scene: &Scene, base_dir: &Path) -> Result<Simulation, SceneError> {
    Simulation::with_options(scene, base_dir, BuildOptions { threads: 1, ..BuildOptions::default() })
}

/// Makes a step and returns its processor time [ms].
fn step(simulation: &mut Simulation) -> f64 {
    1e3 * simulation.step(&Inputs::default()).processor_s
}
