//! What is seen of one body from step to step.

use nalgebra::Vector3;
use scindo_physics::body::{Outcome, SolveReport};

use super::{BodyForecast, Ending, Source};
use crate::body::{SimBody, bounds};

/// At rest the speed times the time since the last event is this share of the displacement: an exponential
/// approach has 0.3 % of its way left then.
const REST: f64 = 0.02;
/// Motion below this share of the body's size is none.
const NOTHING: f64 = 1e-7;
/// Fewest steps before a body in motion, and a static one, can be at rest.
const STEPS_TO_REST: [usize; 2] = [8, 3];
/// A peak is past when this share of the time that led to it has gone by since.
const PAST: f64 = 0.4;

/// See the module.
pub(super) struct Watch {
    size_m: f64,
    before: Vec<Vector3<f64>>,
    event_s: f64,
    /// Since the last event: time [s] and largest speed of a node [m/s].
    speeds: Vec<(f64, f64)>,
    /// Since the last event: largest displacement [m] and when [s].
    peak: (f64, f64),
    time_s: f64,
    now_m: f64,
    seen: BodyForecast,
}

impl Watch {
    pub(super) fn new(body: &SimBody) -> Self {
        let (low, high) = bounds(body.body.rest_positions());
        let solver = body.body.settings().solver;
        Self {
            size_m: (high - low).max(),
            before: body.body.positions().to_vec(),
            event_s: 0.0,
            speeds: Vec::new(),
            peak: (0.0, 0.0),
            time_s: 0.0,
            now_m: 0.0,
            seen: BodyForecast {
                id: body.id.to_string(),
                iteration_limit: solver.iterations,
                tolerance: solver.tolerance,
                least_volume_ratio: 1.0,
                ..BodyForecast::default()
            },
        }
    }

    /// Looks at the body after a step of length `h` that ended at `time_s` [s].
    pub(super) fn record(&mut self, body: &SimBody, solve: &SolveReport, (time_s, h): (f64, f64)) {
        self.seen.unconverged_steps += u64::from(!converged(solve));
        self.seen.refused_steps += u64::from(solve.outcome != Outcome::Advanced);
        self.seen.most_iterations = self.seen.most_iterations.max(solve.iterations);
        self.seen.largest_residual = self.seen.largest_residual.max(solve.residual);
        self.seen.inverted_elements = self.seen.inverted_elements.max(solve.inverted_pieces);
        self.time_s = time_s;
        let parts = body.body.parts();
        let free = || (0..parts.len()).filter(|&part| parts.free[part]);
        // Parts that have fallen far are put to sleep and count as held.
        if free().count() > self.seen.free_parts {
            self.seen.free_parts = free().count();
            self.seen.free_mass_kg = free().map(|part| parts.mass[part]).sum();
        }
        let x = body.body.positions();
        let moved =
            |node: usize| self.before.get(node).map_or(0.0, |before| (x[node] - before).norm_squared());
        let fastest = body.held_nodes().map(moved).fold(0.0, f64::max);
        self.before.clear();
        self.before.extend_from_slice(x);
        self.now_m = body.displacement_m();
        if self.now_m > self.seen.largest_displacement_m {
            (self.seen.largest_displacement_m, self.seen.largest_at_s) = (self.now_m, time_s);
        }
        if self.now_m > self.peak.0 {
            self.peak = (self.now_m, time_s);
        }
        self.speeds.push((time_s - self.event_s, f64::sqrt(fastest) / h));
    }

    /// Something happens at `time_s` [s]: a cut, a tool.
    pub(super) fn next_event(&mut self, time_s: f64) {
        self.event_s = time_s;
        self.peak = (0.0, time_s);
        self.speeds.clear();
    }

    /// Whether the body has come to rest since the last event.
    pub(super) fn rests(&self, is_static: bool) -> bool {
        let n = self.speeds.len();
        if n < STEPS_TO_REST[usize::from(is_static)] {
            return false;
        }
        // Half the steps, because a body that swings stands still at each turn.
        let still =
            |(t, speed): &(f64, f64)| speed * t < REST * self.now_m || speed * t < NOTHING * self.size_m;
        let from = if is_static { n - 1 } else { n / 2 };
        self.speeds[from..].iter().all(still)
    }

    /// Whether the largest displacement may still lie ahead.
    pub(super) fn grows(&self) -> bool {
        let (peak_m, peak_s) = self.peak;
        let past = self.time_s - peak_s >= PAST * (peak_s - self.event_s) && self.speeds.len() >= 3;
        !past && peak_m > 0.5 * self.seen.largest_displacement_m
    }

    /// What has been seen.
    pub(super) fn forecast(&mut self, body: &SimBody, ending: Ending) -> BodyForecast {
        self.seen.least_volume_ratio = body.body.least_volume_ratio();
        self.seen.converges = self.seen.unconverged_steps + self.seen.refused_steps == 0;
        if ending == Ending::Budget && self.grows() {
            self.seen.displacement = Source::AtLeast;
        }
        std::mem::take(&mut self.seen)
    }
}

/// Whether a step reached its tolerance.
pub(super) fn converged(solve: &SolveReport) -> bool {
    !solve.is_unconverged()
}
