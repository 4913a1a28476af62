//! One run of one configuration: set up, solve or step, measure the time, and classify the outcome.

pub mod distance;

pub mod random;

pub mod series;

pub mod sight;

pub mod wear;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use cpu_time::ThreadTime;
use scindo_world::assemble::BuildOptions;
use scindo_world::inputs::Inputs;
use scindo_world::scene::Scene;
use scindo_world::simulation::{Level, Simulation, Stage, StepReport};
use serde::{Deserialize, Serialize};

use series::Series;
use sight::Sight;
use wear::Wear;

/// The quantity that a run computes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Protocol {
    /// One equilibrium from rest. The cost is its time over all steps that relaxation takes.
    Static,
    /// A motion. The cost is the time to compute one frame.
    Motion {
        /// Simulated time between the instants that are compared [s].
        frame_s: f64,
        /// Number of frames.
        frames: u32,
    },
}

/// Up to this many frames, the first frame counts like any other.
const FEW: usize = 11;

/// Limits on the time of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Longest time of one run [s]. A longer run is stopped and counts as failed.
    pub run_s: f64,
    /// Time for repetitions of a static solution, all together [s].
    pub repeat_s: f64,
    /// Most repetitions of a static solution.
    pub repeats: usize,
}

/// The outcome of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// The run gave a result.
    Done,
    /// The scene was refused by its check.
    Refused,
    /// A step was rolled back, or a displacement grew beyond all bounds.
    Exploded,
    /// The run ended without a solution.
    Failed,
    /// The run took longer than allowed.
    Late,
}

impl Status {
    /// Name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Status::Done => "done",
            Status::Refused => "refused",
            Status::Exploded => "exploded",
            Status::Failed => "failed",
            Status::Late => "too slow",
        }
    }
}

/// Measured times [ms]. A cost is the time of one static solution or of one frame of a motion. It is the
/// processor time of the stepping thread, which equals the wall time on an otherwise idle machine. If several
/// threads work on a step, it is the wall time.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Cost {
    /// Time to read, mesh, cut and prepare.
    pub setup_ms: f64,
    /// The first, cold measurement.
    pub first_ms: f64,
    /// Median of the measurements.
    pub median_ms: f64,
    /// 99th percentile; the slowest if there are fewer than 100. The first frame of a motion is kept apart,
    /// in `first_ms`.
    pub p99_ms: f64,
    /// Number of measurements.
    pub count: usize,
}

/// The outcome and the result of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Trial {
    /// The outcome.
    pub status: Status,
    /// The reason of a bad outcome; otherwise a remark, or empty.
    pub reason: String,
    /// The measured times.
    pub cost: Cost,
    /// Number of elements of all bodies.
    pub elements: usize,
    /// Number of unknowns of all bodies: three per copy of a node.
    pub unknowns: usize,
    /// Mean number of solver iterations per step.
    pub iterations: f64,
    /// Largest preconditioned residual at the end of a step.
    pub residual: f64,
    /// Displacements and energy; empty without a result.
    pub series: Series,
    /// Quality of the mesh after many cuts, if methods of cutting are compared.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub wear: Vec<Wear>,
    /// Extent of the scene's regions on its meshes.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub seen: Vec<Sight>,
}

impl Trial {
    /// A run that never started.
    pub fn refused(reason: String) -> Self {
        Self::without(Status::Refused, reason)
    }

    fn without(status: Status, reason: String) -> Self {
        Self {
            status,
            reason,
            cost: Cost::default(),
            elements: 0,
            unknowns: 0,
            iterations: 0.0,
            residual: 0.0,
            series: Series::default(),
            wear: Vec::new(),
            seen: Vec::new(),
        }
    }

    /// Whether the run gave a result.
    pub fn is_done(&self) -> bool {
        self.status == Status::Done
    }
}

/// Runs a scene. `None` if `stop` was raised meanwhile. A panic makes this run fail but not the others.
pub fn run(
    scene: &Scene,
    base_dir: &Path,
    threads: usize,
    protocol: Protocol,
    limits: Limits,
    stop: &AtomicBool,
) -> Option<Trial> {
    let attempt = || attempt(scene, base_dir, threads, protocol, limits, stop);
    // Nothing that the attempt touches is used after a panic.
    catch_unwind(AssertUnwindSafe(attempt)).unwrap_or_else(|_| {
        Some(Trial::without(Status::Failed, "the program panicked in this run".to_owned()))
    })
}

fn attempt(
    scene: &Scene,
    base_dir: &Path,
    threads: usize,
    protocol: Protocol,
    limits: Limits,
    stop: &AtomicBool,
) -> Option<Trial> {
    let started = Instant::now();
    let options = BuildOptions { threads, ..BuildOptions::default() };
    let simulation = match Simulation::with_options(scene, base_dir, options) {
        Ok(simulation) => simulation,
        Err(error) => return Some(Trial::refused(one_line(&error.to_string()))),
    };
    let mut trial = Trial::without(Status::Done, String::new());
    trial.seen = sight::look(&simulation);
    let mut running = Running {
        alone: threads == 1,
        relaxes: scene.checked().bodies.iter().any(|body| body.mechanics.relaxes()),
        simulation,
        trial,
        deadline: started + Duration::from_secs_f64(limits.run_s),
        steps: 0,
        build_ms: started.elapsed().as_secs_f64() * 1e3,
        cut_ms: 0.0,
    };
    let mut costs = match protocol {
        Protocol::Static => running.equilibrium(limits, stop)?,
        Protocol::Motion { frame_s, frames } => running.motion(frame_s, frames, stop)?,
    };
    Some(running.finish(&mut costs))
}

/// A run in progress.
struct Running {
    /// Whether one thread does all the work, so that its processor time counts.
    alone: bool,
    /// Whether an equilibrium takes many steps.
    relaxes: bool,
    simulation: Simulation,
    trial: Trial,
    deadline: Instant,
    steps: u32,
    build_ms: f64,
    cut_ms: f64,
}

impl Running {
    /// Solves once for the result, then again from rest for the time.
    fn equilibrium(&mut self, limits: Limits, stop: &AtomicBool) -> Option<Vec<f64>> {
        let mut costs = vec![self.solve(stop)?];
        self.sample(0);
        let until = Instant::now() + Duration::from_secs_f64(limits.repeat_s);
        while self.trial.is_done() && costs.len() < limits.repeats && Instant::now() < until {
            if let Err(error) = self.simulation.reset() {
                self.end(Status::Failed, error.to_string());
                break;
            }
            costs.push(self.solve(stop)?);
        }
        Some(costs)
    }

    /// Solves from the present state and returns the time [ms].
    fn solve(&mut self, stop: &AtomicBool) -> Option<f64> {
        let mut milliseconds = self.step(stop)?;
        while self.relaxes && self.trial.is_done() && !self.has_converged() {
            milliseconds += self.step(stop)?;
        }
        let stops = self.simulation.report().bodies.iter().map(|body| format!("{:?}", body.solve.stop));
        if let Some(stop) =
            stops.into_iter().find(|stop| stop != "Converged").filter(|_| self.trial.is_done())
        {
            self.end(Status::Failed, format!("no equilibrium: the solver stopped by {stop}"));
        }
        Some(milliseconds)
    }

    fn has_converged(&self) -> bool {
        self.simulation.report().bodies.iter().all(|body| body.solve.stop == Default::default())
    }

    /// Steps through the frames and returns the time per frame [ms].
    fn motion(&mut self, frame_s: f64, frames: u32, stop: &AtomicBool) -> Option<Vec<f64>> {
        let step_s = self.simulation.step_s();
        let steps = (f64::from(frames) * frame_s / step_s).round() as u32;
        let mut costs = Vec::with_capacity(frames as usize);
        let (mut spent, mut since) = (0.0, 0.0);
        for step in 1..=steps {
            spent += self.step(stop)?;
            since += step_s / frame_s;
            if !self.trial.is_done() {
                break;
            }
            let frame = f64::from(step) * step_s / frame_s;
            if (frame - frame.round()).abs() < 1e-6 {
                self.sample(frame.round() as u32);
                costs.push(spent / since);
                (spent, since) = (0.0, 0.0);
            }
        }
        if costs.is_empty() && since > 0.0 {
            costs.push(spent / since);
        }
        Some(costs)
    }

    /// Makes one step and returns its time [ms] without cuts, which belong to the set-up.
    fn step(&mut self, stop: &AtomicBool) -> Option<f64> {
        if stop.load(Ordering::Relaxed) {
            return None;
        }
        let clock = ThreadTime::now();
        let report = self.simulation.step(&Inputs::default());
        let busy_s = clock.elapsed().as_secs_f64();
        let (wall_s, cut_s) = (report.seconds.total(), report.seconds.of(Stage::Cuts));
        let spent_s = if self.alone { busy_s } else { wall_s };
        let milliseconds = 1e3 * spent_s * (1.0 - cut_s / wall_s.max(1e-12));
        let ended = verdict(report);
        self.steps += 1;
        self.cut_ms += 1e3 * cut_s;
        let solves = report.bodies.iter().map(|body| &body.solve);
        self.trial.iterations += solves.clone().map(|solve| f64::from(solve.iterations)).sum::<f64>();
        self.trial.residual = solves.map(|solve| solve.residual).fold(self.trial.residual, f64::max);
        if let Some((status, reason)) = ended {
            self.end(status, reason);
        } else if Instant::now() > self.deadline {
            self.end(Status::Late, "the run exceeded its time limit".to_owned());
        } else if self.has_exploded() {
            self.end(
                Status::Exploded,
                "a probe moved farther than ten times the size of the body".to_owned(),
            );
        }
        Some(milliseconds)
    }

    fn end(&mut self, status: Status, reason: String) {
        self.trial.status = status;
        self.trial.reason = format!("{reason} (step {})", self.steps);
    }

    fn displacements(&self) -> Vec<f64> {
        let simulation = &self.simulation;
        let of = |probe: &scindo_world::body::Probe| {
            let u = simulation.probe_position(probe) - probe.rest_m;
            [u.x, u.y, u.z]
        };
        simulation.probes().iter().flat_map(of).collect()
    }

    fn has_exploded(&self) -> bool {
        let size = self.simulation.bodies().iter().map(|body| body.rest_volume_m3.cbrt()).fold(0.0, f64::max);
        self.displacements().iter().any(|u| !u.is_finite() || u.abs() > 100.0 * size)
    }

    fn sample(&mut self, frame: u32) {
        if !self.trial.is_done() {
            return;
        }
        let displacements = self.displacements();
        let series = &mut self.trial.series;
        series.frames.push(frame);
        series.displacement_m.extend(displacements);
        series.energy_j.push(self.simulation.bodies().iter().map(|body| body.energy().elastic_j).sum());
        if !series.is_finite() {
            self.end(Status::Exploded, "not finite".to_owned());
        }
    }

    fn finish(mut self, costs: &mut [f64]) -> Trial {
        let bodies = self.simulation.bodies();
        self.trial.elements = bodies.iter().map(|body| body.size().elements).sum();
        self.trial.unknowns = bodies.iter().map(|body| 3 * body.body.positions().len()).sum();
        self.trial.iterations /= f64::from(self.steps.max(1));
        let solves = costs.len().max(1) as f64;
        self.trial.cost = Cost::of(costs, self.build_ms + self.cut_ms / solves);
        if !self.trial.is_done() {
            self.trial.series = Series::default();
        }
        self.trial
    }
}

/// The outcome that the report of a bad step implies.
fn verdict(report: &StepReport) -> Option<(Status, String)> {
    if let Some(bad) = report.events.iter().find(|event| event.level == Level::Error) {
        let status = if bad.name == "step-rolled-back" { Status::Exploded } else { Status::Failed };
        return Some((status, bad.message.clone()));
    }
    let lost = report.bodies.iter().find(|body| body.solve.outcome != Default::default())?;
    Some((Status::Failed, format!("the body did not advance: {:?}", lost.solve.outcome)))
}

impl Cost {
    fn of(costs: &mut [f64], setup_ms: f64) -> Self {
        let count = costs.len();
        let first_ms = costs.first().copied().unwrap_or(0.0);
        let costs = &mut costs[usize::from(count > FEW)..];
        costs.sort_by(f64::total_cmp);
        let at = |share: f64| {
            let index = (share * costs.len() as f64).ceil() as usize;
            costs.get(index.clamp(1, costs.len().max(1)) - 1).copied().unwrap_or(0.0)
        };
        Self { setup_ms, first_ms, median_ms: at(0.5), p99_ms: at(0.99), count }
    }
}

/// An error message reduced to one line, for tables.
pub fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_of_few_and_many() {
        let mut ten: Vec<f64> = (1..=10).rev().map(f64::from).collect();
        let cost = Cost::of(&mut ten, 3.0);
        assert_eq!((cost.first_ms, cost.median_ms, cost.p99_ms, cost.count), (10.0, 5.0, 10.0, 10));
        let mut many: Vec<f64> = (1..=200).map(f64::from).collect();
        assert_eq!(Cost::of(&mut many, 0.0).p99_ms, 199.0);
        let mut cold: Vec<f64> = [90.0].into_iter().chain([1.0; 20]).collect();
        let cost = Cost::of(&mut cold, 0.0);
        assert_eq!(
            (cost.first_ms, cost.p99_ms, cost.count),
            (90.0, 1.0, 21),
            "a cold first frame stands apart"
        );
        assert_eq!(Cost::of(&mut [], 0.0), Cost::default());
    }
}
