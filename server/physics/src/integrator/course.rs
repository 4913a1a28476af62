//! What is kept of a motion from step to step, whichever way its equations are solved.

use super::balance::Balance;
use super::multistep::Multistep;
use super::spin::SpinGuard;
use super::state::State;

/// History and guards of a motion.
#[derive(Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct Course {
    /// States, accelerations and energy of earlier steps.
    pub multistep: Multistep,
    /// Whether steps solve their equations.
    pub(super) balance: Balance,
    /// How fast the parts turn.
    pub spin: SpinGuard,
    /// State before the present or last step.
    pub before: State,
}

impl Course {
    /// Forgets the energy of earlier steps, which has changed from outside.
    pub(super) fn forget_energy(&mut self) {
        self.multistep.forget_energy();
        self.balance.forget();
    }
}
