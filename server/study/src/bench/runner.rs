//! Runs configurations against a budget of time: what the parts of a study that plan ask for.

use crate::design::Configuration;
use crate::trial::Trial;

/// What a run is for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ask {
    /// With repetitions for its time; else for its result only.
    pub timed: bool,
    /// Longest time it may take [s].
    pub cap_s: f64,
}

/// Something that runs configurations of a case.
pub trait Runner {
    /// A run, or what is known of it from before; none if the study is to end.
    fn run(&mut self, configuration: &Configuration, ask: Ask) -> Option<Trial>;

    /// What is left of the study's time [s]; infinite without a budget.
    fn left_s(&self) -> f64;

    /// Seconds that a run will take as far as one can tell; 0 for what is known from before.
    fn forecast_s(&self, configuration: &Configuration, timed: bool) -> f64;
}

/// How far a run may exceed its forecast before it is stopped.
pub const PATIENCE: f64 = 2.0;

/// Whether a run fits into the time that is left if `keep_s` of it is kept for later.
pub fn fits(runner: &dyn Runner, configuration: &Configuration, timed: bool, keep_s: f64) -> bool {
    1.2 * runner.forecast_s(configuration, timed) <= runner.left_s() - keep_s
}
