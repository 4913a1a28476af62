//! Processor time of steps, and what it will be over a run.

use serde::Serialize;

use super::Ending;

/// Processor time of a step on one thread of this machine [ms].
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Cost {
    /// Mean over the run that is foretold.
    pub mean_ms: f64,
    /// Mean while the scene moves.
    pub moving_ms: f64,
    /// At the end: at rest, or where the time for it was used up.
    pub last_ms: f64,
    /// Most expensive step.
    pub largest_ms: f64,
}

/// What the steps have cost so far.
#[derive(Debug, Default)]
pub(super) struct Prices {
    /// Of every step [s].
    steps_s: Vec<f64>,
    /// Iterations of every step since the last jump, of all bodies.
    iterations: Vec<u32>,
    /// Steps that were jumped over, at the price of those before them [s].
    rested: (u64, f64),
}

impl Prices {
    pub(super) fn add(&mut self, seconds: f64, iterations: u32) {
        self.steps_s.push(seconds);
        self.iterations.push(iterations);
    }

    /// Whether the price no longer falls: the last quarter of the steps took as many iterations as those of the
    /// half before it. A body that has come to rest goes on getting cheaper for a while.
    pub(super) fn are_settled(&self) -> bool {
        let n = self.iterations.len();
        let sum =
            |from: usize, to: usize| self.iterations[from..to].iter().map(|&i| u64::from(i)).sum::<u64>();
        let quarter = n / 4;
        quarter > 1 && 20 * sum(n - quarter, n) >= 9 * sum(n - 3 * quarter, n - quarter)
    }

    /// So many steps at rest, which were not made.
    pub(super) fn rested(&mut self, steps: u64) {
        self.rested.0 += steps;
        self.rested.1 += steps as f64 * self.last();
        self.iterations.clear();
    }

    /// Price of a run that goes on for `left` steps.
    pub(super) fn cost(&self, ending: Ending, left: u64) -> Cost {
        let made = self.steps_s.len() as f64;
        let sum: f64 = self.steps_s.iter().sum();
        let moving = sum / made.max(1.0);
        let last = self.last();
        // At rest the price stays; where the time was used up, the motion goes on.
        let ahead = if ending == Ending::Rest { last } else { self.recent(0.5) };
        let all = (made + self.rested.0 as f64 + left as f64).max(1.0);
        Cost {
            mean_ms: 1e3 * (sum + self.rested.1 + left as f64 * ahead) / all,
            moving_ms: 1e3 * moving,
            last_ms: 1e3 * last,
            largest_ms: 1e3 * self.steps_s.iter().copied().fold(0.0, f64::max),
        }
    }

    fn last(&self) -> f64 {
        self.recent(0.2)
    }

    /// Median of the last `share` of the steps [s].
    fn recent(&self, share: f64) -> f64 {
        let n = self.steps_s.len();
        let from = n - ((n as f64 * share).ceil() as usize).clamp(1.min(n), n);
        let mut recent = self.steps_s[from..].to_vec();
        recent.sort_by(f64::total_cmp);
        recent.get(recent.len() / 2).copied().unwrap_or(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_that_rests_is_cheaper_than_its_first_steps() {
        let mut prices = Prices::default();
        (0..10).for_each(|i| prices.add(if i < 5 { 0.010 } else { 0.002 }, 1));
        let cost = prices.cost(Ending::Rest, 90);
        assert!((cost.mean_ms - (50.0 + 10.0 + 180.0) / 100.0).abs() < 1e-9, "{cost:?}");
        assert!((cost.moving_ms - 6.0).abs() < 1e-9 && (cost.last_ms - 2.0).abs() < 1e-9, "{cost:?}");
        assert!((cost.largest_ms - 10.0).abs() < 1e-9, "{cost:?}");
    }

    #[test]
    fn a_jump_costs_what_rest_costs() {
        let mut prices = Prices::default();
        (0..10).for_each(|_| prices.add(0.004, 1));
        prices.rested(90);
        assert!((prices.cost(Ending::End, 0).mean_ms - 4.0).abs() < 1e-9);
    }

    #[test]
    fn a_price_that_falls_is_not_settled() {
        let mut prices = Prices::default();
        for (step, iterations) in [80, 40, 20, 10, 10, 10, 10, 10, 10, 10].into_iter().enumerate() {
            prices.add(0.001, iterations);
            assert_eq!(prices.are_settled(), step >= 8, "{:?}", prices.iterations);
        }
    }
}
