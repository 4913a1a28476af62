//! Interface between the parts of a study that plan runs and the bench that makes them within a time.

use crate::design::Configuration;
use crate::trial::Trial;

/// Purpose and limit of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ask {
    /// Repeat the run to measure its time; otherwise only the result counts.
    pub timed: bool,
    /// Longest time that the run may take [s].
    pub cap_s: f64,
}

/// Something that runs configurations of a case.
pub trait Runner {
    /// Makes a run or returns a stored one. `None` if the study must end.
    fn run(&mut self, configuration: &Configuration, ask: Ask) -> Option<Trial>;

    /// Time left for the study [s]; infinite without a budget.
    fn left_s(&self) -> f64;

    /// Expected duration of a run [s]; 0 if its result is stored or nothing is known yet.
    fn forecast_s(&self, configuration: &Configuration, timed: bool) -> f64;
}

/// A run is stopped after this multiple of its forecast.
pub const PATIENCE: f64 = 2.0;

/// Whether a run fits into the remaining time when `keep_s` [s] of it is reserved.
pub fn fits(runner: &dyn Runner, configuration: &Configuration, timed: bool, keep_s: f64) -> bool {
    1.2 * runner.forecast_s(configuration, timed) <= runner.left_s() - keep_s
}
