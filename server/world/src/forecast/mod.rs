//! What a scene will do, told from its first steps: whether they converge, how far its bodies move, whether
//! elements invert, and what a step costs on this machine.
//!
//! The scene itself is stepped from its start, with its cuts and tools, until it has come to rest after the last
//! of them, or until the time for it is used up. While everything rests, the clock jumps to the next cut. A body that is
//! still on its way then is followed on [coarse copies](coarse) of it.

mod watch;

mod coarse;

mod cost;

mod words;

use std::time::Instant;

use serde::Serialize;

pub use cost::Cost;

use crate::inputs::Inputs;
use crate::report::Level;
use crate::scene::raw::RawIntegrator;
use crate::scene::{BodySpec, CheckedScene};
use crate::simulation::{Simulation, processor_seconds};
use cost::Prices;
use watch::Watch;

/// Simulated time that is looked at after the last thing that the scene does [s], at least.
const AFTER_S: f64 = 2.0;
/// The same in steps.
const AFTER_STEPS: f64 = 100.0;
/// A machine that others use may take so many times as long as the processor time asked for.
const PATIENCE: f64 = 3.0;
/// Share of the time that is kept for coarse copies and for more iterations.
const KEPT: f64 = 0.35;
/// How many times the iterations of the scene are tried to see what a step needs.
const MORE_ITERATIONS: u32 = 40;
/// Most iterations that are tried.
const MOST_ITERATIONS: u32 = 20_000;

/// How much is asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Effort {
    /// Processor time to spend [s]; at least two steps are made.
    pub processor_s: f64,
    /// Simulated time at which the run will end [s]; none: some time after the last cut and tool.
    pub end_s: Option<f64>,
}

impl Default for Effort {
    fn default() -> Self {
        Self { processor_s: 4.0, end_s: None }
    }
}

/// Why the look into the future ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Ending {
    /// Everything came to rest after the last cut and tool.
    Rest,
    /// The end of the run was reached.
    End,
    /// The time for it was used up.
    Budget,
}

/// What a scene will do.
#[derive(Debug, Clone, Serialize)]
pub struct Forecast {
    /// Steps made.
    pub steps: u64,
    /// Simulated time reached [s].
    pub time_s: f64,
    /// Simulated time of the run that is foretold [s].
    pub end_s: f64,
    /// Why it ended.
    pub ending: Ending,
    /// Bodies in the order of the scene.
    pub bodies: Vec<BodyForecast>,
    /// Processor time of a step.
    pub cost: Cost,
    /// What goes wrong, in sentences.
    pub warnings: Vec<String>,
    #[serde(skip)]
    static_only: bool,
}

/// What a body will do.
#[derive(Debug, Clone, Default, Serialize)]
pub struct BodyForecast {
    /// Name.
    pub id: String,
    /// Whether every step reached its tolerance.
    pub converges: bool,
    /// Steps that did not.
    pub unconverged_steps: u64,
    /// Steps that were refused or rolled back.
    pub refused_steps: u64,
    /// Most iterations of a step.
    pub most_iterations: u32,
    /// Iterations that a linear solve may make.
    pub iteration_limit: u32,
    /// Iterations that a step needs to converge; none where that was not tried or not reached.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub needed_iterations: Option<u32>,
    /// Largest residual at the end of a step.
    pub largest_residual: f64,
    /// Where the solver should stop.
    pub tolerance: f64,
    /// Largest displacement of a node of a held part over the run [m].
    pub largest_displacement_m: f64,
    /// When [s].
    pub largest_at_s: f64,
    /// How the figure was found.
    pub displacement: Source,
    /// Most elements that were inverted in a step.
    pub inverted_elements: usize,
    /// Least volume ratio of an element that was seen.
    pub least_volume_ratio: f64,
    /// Mass of the parts that hang on nothing [kg], when they are most.
    pub free_mass_kg: f64,
    /// How many there are then.
    pub free_parts: usize,
}

/// How the largest displacement was found.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Source {
    /// The scene itself was stepped past it.
    #[default]
    Steps,
    /// Coarse copies were stepped past it, and their results continued to the mesh of the scene.
    CoarseCopies,
    /// It was still growing: this is a lower bound.
    AtLeast,
}

/// Looks into the future of `simulation`, which is reset at the end. `told` hears the share that is done.
///
/// # Errors
/// When a body cannot be built again.
pub fn forecast(
    simulation: &mut Simulation,
    effort: Effort,
    told: &mut dyn FnMut(f64),
) -> Result<Forecast, scindo_physics::body::BodyError> {
    let mut run = Run::new(simulation, effort);
    let ending = run.go(told);
    let growing: Vec<bool> =
        run.watches.iter().map(|watch| ending == Ending::Budget && watch.grows()).collect();
    let mut forecast = run.concluded(ending);
    simulation.reset()?;
    let left = effort.processor_s * KEPT;
    if growing.contains(&true) {
        let end_s = forecast.end_s;
        coarse::follow(
            simulation,
            &mut forecast.bodies,
            &growing,
            Effort { processor_s: left, end_s: Some(end_s) },
        );
    }
    if forecast.bodies.iter().any(|body| body.unconverged_steps > 0) {
        more_iterations(simulation, &mut forecast.bodies, left);
        simulation.reset()?;
    }
    words::warnings(simulation.scene(), &mut forecast);
    told(1.0);
    Ok(forecast)
}

/// Steps of a simulation with an eye on it.
struct Run<'a> {
    simulation: &'a mut Simulation,
    effort: Effort,
    end_s: f64,
    watches: Vec<Watch>,
    prices: Prices,
    warnings: Vec<String>,
    /// Steps that were jumped over at rest.
    skipped: u64,
    started: Instant,
    spent_s: f64,
    static_only: bool,
}

impl<'a> Run<'a> {
    fn new(simulation: &'a mut Simulation, effort: Effort) -> Self {
        let scene = simulation.scene();
        let h = scene.step_s;
        let end_s = effort.end_s.unwrap_or(last_event(scene) + AFTER_S.max(AFTER_STEPS * h)).max(h);
        let static_only = scene.bodies.iter().all(|body| body.mechanics.integrator == RawIntegrator::Static);
        let watches = simulation.bodies().iter().map(Watch::new).collect();
        Self {
            simulation,
            effort,
            end_s,
            watches,
            prices: Prices::default(),
            warnings: Vec::new(),
            skipped: 0,
            started: Instant::now(),
            spent_s: 0.0,
            static_only,
        }
    }

    fn go(&mut self, told: &mut dyn FnMut(f64)) -> Ending {
        let inputs = Inputs::default();
        let h = self.simulation.step_s();
        let budget_s = (1.0 - KEPT) * self.effort.processor_s;
        loop {
            let before = processor_seconds();
            self.simulation.step(&inputs);
            let cpu_s = self.simulation.report().processor_s;
            self.record(cpu_s);
            self.spent_s += processor_seconds() - before;
            let time_s = self.simulation.time_s();
            told((self.spent_s / budget_s).max(time_s / self.end_s).min(1.0));
            if time_s > self.end_s - 0.5 * h {
                return Ending::End;
            }
            if self.rests() {
                match next_event(self.simulation.scene(), time_s) {
                    None => return Ending::Rest,
                    Some(at_s) if at_s >= self.end_s => return Ending::Rest,
                    Some(at_s) => self.jump(at_s),
                }
            }
            let late = self.started.elapsed().as_secs_f64() > PATIENCE * budget_s;
            if self.simulation.steps() - self.skipped >= 2 && (self.spent_s > budget_s || late) {
                return Ending::Budget;
            }
        }
    }

    fn record(&mut self, cpu_s: f64) {
        let time_s = self.simulation.time_s();
        let report = self.simulation.report();
        self.prices.add(cpu_s, report.bodies.iter().map(|body| body.solve.iterations).sum());
        for event in report.events.iter().filter(|event| event.level >= Level::Warning) {
            let body = event.body.as_deref().unwrap_or("scene");
            let text = format!("body.{body}: {}", event.message);
            // Convergence is said once and in other words.
            if event.name.starts_with("cut") && !self.warnings.contains(&text) {
                self.warnings.push(text);
            }
        }
        for (i, watch) in self.watches.iter_mut().enumerate() {
            watch.record(
                &self.simulation.bodies()[i],
                &report.bodies[i].solve,
                (time_s, self.simulation.step_s()),
            );
        }
    }

    fn rests(&self) -> bool {
        let acting = acts(self.simulation.scene(), self.simulation.time_s());
        !acting && self.watches.iter().all(|watch| watch.rests(self.static_only)) && self.prices.are_settled()
    }

    /// To the step that begins at `at_s` [s]; what lies between is at rest.
    fn jump(&mut self, at_s: f64) {
        let now = self.simulation.steps();
        let then = ((at_s / self.simulation.step_s() - 1e-9).ceil() as u64).max(now);
        self.simulation.skip_to(then);
        self.skipped += then - now;
        self.prices.rested(then - now);
        let time_s = self.simulation.time_s();
        self.watches.iter_mut().for_each(|watch| watch.next_event(time_s));
    }

    fn concluded(mut self, ending: Ending) -> Forecast {
        let h = self.simulation.step_s();
        let left = ((self.end_s - self.simulation.time_s()) / h).round().max(0.0) as u64;
        let cost = self.prices.cost(ending, left);
        let bodies = self.simulation.bodies().iter().zip(&mut self.watches);
        Forecast {
            steps: self.simulation.steps() - self.skipped,
            time_s: self.simulation.time_s(),
            end_s: self.end_s,
            ending,
            bodies: bodies.map(|(body, watch)| watch.forecast(body, ending)).collect(),
            cost,
            warnings: self.warnings,
            static_only: self.static_only,
        }
    }
}

/// When the last cut happens, the last tool has gone through its path and displacements and loads have arrived [s].
fn last_event(scene: &CheckedScene) -> f64 {
    let held = scene.bodies.iter().map(BodySpec::settled_s);
    let cuts = scene.cuts.iter().map(|cut| cut.at_s);
    let tools = scene.tools.iter().filter_map(|tool| tool.path.last()).map(|point| point.at_s);
    cuts.chain(tools).chain(held).fold(0.0, f64::max)
}

/// When the next cut happens or tool begins, after `time_s` [s].
fn next_event(scene: &CheckedScene, time_s: f64) -> Option<f64> {
    let cuts = scene.cuts.iter().map(|cut| cut.at_s);
    let tools = scene.tools.iter().filter_map(|tool| tool.path.first()).map(|point| point.at_s);
    // A cut is made in the step that begins at its time.
    let after = time_s - 1e-9 * time_s.max(1.0);
    cuts.chain(tools).filter(|at| *at >= after).min_by(f64::total_cmp)
}

/// Whether a tool is on its path at `time_s` [s], or a displacement or load changes.
fn acts(scene: &CheckedScene, time_s: f64) -> bool {
    let arriving = scene.bodies.iter().any(|body| time_s < body.settled_s());
    arriving
        || scene.tools.iter().any(|tool| match &tool.path[..] {
            [first, .., last] => first.at_s <= time_s && (time_s <= last.at_s || tool.repeat_s.is_some()),
            _ => false,
        })
}

/// Makes the first steps again with more iterations, to tell how many it takes.
fn more_iterations(simulation: &mut Simulation, bodies: &mut [BodyForecast], processor_s: f64) {
    let start = processor_seconds();
    for body in bodies.iter() {
        let iterations = body.iteration_limit.saturating_mul(MORE_ITERATIONS).clamp(1, MOST_ITERATIONS);
        simulation.allow_iterations(&body.id, iterations);
    }
    let mut most = vec![Some(0); bodies.len()];
    while simulation.steps() < 8 {
        simulation.step(&Inputs::default());
        for (most, report) in most.iter_mut().zip(&simulation.report().bodies) {
            let needed = watch::converged(&report.solve)
                .then(|| report.solve.iterations.div_ceil(report.solve.newton_steps.max(1)));
            *most = most.zip(needed).map(|(most, needed)| u32::max(most, needed));
        }
        if processor_seconds() - start > processor_s {
            break;
        }
    }
    for (body, most) in bodies.iter_mut().zip(most) {
        if body.unconverged_steps > 0 {
            // Where the first steps keep within the limit, it was a later one that did not.
            let limit = body.iteration_limit;
            body.needed_iterations = most.map(|most| if most > limit { most } else { 2 * limit });
        }
        simulation.allow_iterations(&body.id, body.iteration_limit);
    }
}
