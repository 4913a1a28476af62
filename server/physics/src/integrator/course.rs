//! What is kept of a motion from step to step, whichever way its equations are solved.

use super::multistep::Multistep;
use super::spin::SpinGuard;
use super::state::State;

/// History and guards of a motion.
#[derive(Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct Course {
    /// States, accelerations and energy of earlier steps.
    pub multistep: Multistep,
    /// How fast the parts turn.
    pub spin: SpinGuard,
    /// State before the present or last step.
    pub before: State,
}
