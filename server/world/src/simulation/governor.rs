//! The governor: what a scene gives up, step by step, when it cannot keep up with real time.
//!
//! # Method
//! A ladder that is declared here: estimates first, then the tolerances of the linear solves, down to a residual of
//! [`FLOOR`] and never below. What is still too slow after that runs in slow motion, and says so. It goes down as soon
//! as the smoothed time of a step is above the time that it simulates, and up again after a while in which steps took
//! less than half of it; the while doubles each time that going up proves too early.

use serde::Serialize;

use crate::body::SimBody;
use crate::report::{Event, Level};
use crate::scene::CheckedScene;
use scindo_physics::solver::PcgSettings;

/// The largest tolerance that the governor sets: relative residual of a linear solve.
pub const FLOOR: f64 = 1e-2;
/// Weight of the newest step in the smoothed time.
const NEWEST: f64 = 0.2;
/// Steps between two moves, in which the smoothed time settles.
const SETTLE: u32 = 8;
/// Steps that have to be good before it goes up, at first and at most.
const PATIENCE: [u32; 2] = [30, 960];
/// Part of the budget below which a step is good.
const GOOD: f64 = 0.5;

/// A rung of the ladder.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
enum Rung {
    /// As the scene asks.
    #[default]
    Whole,
    /// Without the estimate of the error.
    NoEstimate,
    /// Tolerances ten times as large.
    Looser,
    /// Tolerances at the floor.
    Floor,
}

const LADDER: [Rung; 4] = [Rung::Whole, Rung::NoEstimate, Rung::Looser, Rung::Floor];

impl Rung {
    fn tolerance(self, asked: f64) -> f64 {
        match self {
            Self::Whole | Self::NoEstimate => asked,
            Self::Looser => (10.0 * asked).min(FLOOR).max(asked),
            Self::Floor => FLOOR.max(asked),
        }
    }

    fn words(self) -> &'static str {
        match self {
            Self::Whole => "everything as the scene asks",
            Self::NoEstimate => "no estimate of the error",
            Self::Looser => "tolerances of linear solves ten times as large, up to 1e-2",
            Self::Floor => "tolerances of linear solves at 1e-2, the largest that are allowed",
        }
    }
}

/// What the governor did in a run.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, serde::Deserialize)]
pub struct GovernorReport {
    /// Steps as the scene asks.
    pub whole_steps: u64,
    /// Steps without an estimate of the error, with the tolerances that the scene asks for.
    pub without_estimate_steps: u64,
    /// Steps with tolerances ten times as large.
    pub looser_steps: u64,
    /// Steps with tolerances at the floor.
    pub floor_steps: u64,
    /// Steps of these that were still late, so that simulated time ran slower than real time.
    pub slow_steps: u64,
}

/// State of the governor of a scene.
#[derive(Debug, Clone, Default, serde::Serialize, serde::Deserialize)]
pub(crate) struct Governor {
    on: bool,
    rung: usize,
    /// Time that the last step took [s].
    last_s: Option<f64>,
    /// Smoothed time of a step [s], and the steps since the last move.
    smoothed_s: f64,
    since: u32,
    good: u32,
    patience: u32,
    /// Whether the last move was up.
    went_up: bool,
    is_slow: bool,
    report: GovernorReport,
}

impl Governor {
    pub(crate) fn new(on: bool) -> Self {
        Self { on, patience: PATIENCE[0], ..Self::default() }
    }

    /// What it did so far; `None` if the scene has none.
    pub(crate) fn report(&self) -> Option<GovernorReport> {
        self.on.then_some(self.report)
    }

    /// Whether the estimate of the error is given up.
    pub(crate) fn drops_estimate(&self) -> bool {
        LADDER[self.rung] != Rung::Whole
    }

    /// Takes note that the last step took `seconds`.
    pub(crate) fn take(&mut self, seconds: f64) {
        self.last_s = Some(seconds).filter(|seconds| self.on && seconds.is_finite());
    }

    /// Decides by the last step how the next one is made. Returns what it tells people.
    pub(crate) fn decide(&mut self, scene: &CheckedScene, bodies: &mut [SimBody]) -> Option<Event> {
        let (seconds, budget_s) = (self.last_s.take()?, scene.step_s);
        self.count(seconds > budget_s);
        self.since += 1;
        self.smoothed_s = match self.since {
            1 => seconds,
            _ => self.smoothed_s + NEWEST * (seconds - self.smoothed_s),
        };
        self.good = if self.smoothed_s < GOOD * budget_s { self.good + 1 } else { 0 };
        let (now, due) = (1e3 * self.smoothed_s, 1e3 * budget_s);
        if self.since >= SETTLE && self.smoothed_s > budget_s {
            if let Some(lower) = self.lower(scene, bodies) {
                if self.went_up {
                    self.patience = (2 * self.patience).min(PATIENCE[1]);
                }
                self.move_to(lower, false, scene, bodies);
                let words = LADDER[lower].words();
                let message = format!("steps take {now:.1} ms where {due:.1} ms are due: {words}");
                return Some(event(Level::Warning, "gave-up", message));
            }
            if !std::mem::replace(&mut self.is_slow, true) {
                let message = format!(
                    "steps take {now:.1} ms where {due:.1} ms are due, and nothing is left to give up: time runs at \
                     {:.2} of real time",
                    due / now
                );
                return Some(event(Level::Warning, "slow-motion", message));
            }
        } else if self.smoothed_s < budget_s && std::mem::replace(&mut self.is_slow, false) {
            return Some(event(
                Level::Info,
                "real-time",
                "simulated time keeps up with real time again".into(),
            ));
        }
        if self.rung > 0 && self.good >= self.patience {
            let higher = self.higher(scene, bodies);
            self.move_to(higher, true, scene, bodies);
            let message =
                format!("steps take {now:.1} ms where {due:.1} ms are due: {}", LADDER[higher].words());
            return Some(event(Level::Info, "took-back", message));
        }
        None
    }

    /// Gives bodies the tolerances of the present rung, e.g. after the scene has changed.
    pub(crate) fn apply(&self, scene: &CheckedScene, bodies: &mut [SimBody]) {
        if !self.on {
            return;
        }
        for (spec, body) in scene.bodies.iter().zip(bodies).filter(|(_, body)| !body.fixed_iterations) {
            let tolerance = LADDER[self.rung].tolerance(spec.mechanics.tolerance);
            let solver = PcgSettings { tolerance, ..body.body.settings().solver };
            // A tolerance that the body cannot have, e.g. for its arithmetic, leaves it as it is.
            let _ = body.body.set_solver(solver);
        }
    }

    fn move_to(&mut self, rung: usize, up: bool, scene: &CheckedScene, bodies: &mut [SimBody]) {
        (self.rung, self.went_up, self.since, self.good) = (rung, up, 0, 0);
        self.apply(scene, bodies);
    }

    /// The next rung down on which this scene gives up more.
    fn lower(&self, scene: &CheckedScene, bodies: &[SimBody]) -> Option<usize> {
        (self.rung + 1..LADDER.len()).find(|&rung| differ(LADDER[rung], LADDER[self.rung], scene, bodies))
    }

    /// The next rung up on which this scene gives up less; the first one if there is none.
    fn higher(&self, scene: &CheckedScene, bodies: &[SimBody]) -> usize {
        let above = (0..self.rung).rev();
        let mut other = above.filter(|&rung| differ(LADDER[rung], LADDER[self.rung], scene, bodies));
        other.next().unwrap_or(0)
    }

    fn count(&mut self, late: bool) {
        let steps = match LADDER[self.rung] {
            Rung::Whole => &mut self.report.whole_steps,
            Rung::NoEstimate => &mut self.report.without_estimate_steps,
            Rung::Looser => &mut self.report.looser_steps,
            Rung::Floor => &mut self.report.floor_steps,
        };
        *steps += 1;
        self.report.slow_steps += u64::from(late);
    }
}

/// Whether two rungs are different for a scene.
fn differ(a: Rung, b: Rung, scene: &CheckedScene, bodies: &[SimBody]) -> bool {
    let estimates = scene.effects.error_estimate == Some(true);
    let mut governed = scene.bodies.iter().zip(bodies).filter(|(_, body)| !body.fixed_iterations);
    (estimates && (a == Rung::Whole) != (b == Rung::Whole))
        || governed.any(|(spec, _)| {
            let asked = spec.mechanics.tolerance;
            a.tolerance(asked) != b.tolerance(asked)
        })
}

fn event(level: Level, name: &'static str, message: String) -> Event {
    Event { level, name, message, body: None }
}
