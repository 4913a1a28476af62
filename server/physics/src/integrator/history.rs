//! What earlier steps left behind.

use nalgebra::Vector3;

use super::State;
use crate::cut::NewCopy;

/// The last two states.
#[derive(Clone, Debug, Default)]
pub struct History {
    /// State before the last step, and the one that the last step left.
    pub before: State,
    last: State,
    /// Length of the last step [s].
    pub h: f64,
    /// Springs in contact at the end of it.
    pub contacts: usize,
    /// Whether there was a last step.
    pub known: bool,
}

impl History {
    /// There was no last step.
    pub fn forget(&mut self) {
        self.known = false;
        self.contacts = 0;
    }

    /// Whether `state` is what the last step left.
    pub fn continues(&self, state: &State) -> bool {
        self.known && self.last == *state
    }

    /// Copies that are held from now on, at the positions of `state`, have never moved.
    pub fn still(&mut self, copies: &[u32], state: &State) {
        if !self.known {
            return;
        }
        for &c in copies {
            for kept in [&mut self.before, &mut self.last] {
                kept.x[c as usize] = state.x[c as usize];
                kept.v[c as usize] = Vector3::zeros();
            }
        }
    }

    /// A step of length `h` from `before` to `after` was made.
    pub fn push(&mut self, before: &State, after: &State, h: f64) {
        self.before.copy_from(before);
        self.last.copy_from(after);
        self.h = h;
        self.known = true;
    }

    /// A cut made the copies `new`, each of which was its parent until now.
    pub fn inherit(&mut self, new: &[NewCopy]) {
        if !self.known {
            return;
        }
        for kept in [&mut self.before, &mut self.last] {
            for values in [&mut kept.x, &mut kept.v] {
                for copy in new {
                    debug_assert_eq!(values.len(), copy.copy as usize);
                    values.push(values[copy.parent as usize]);
                }
            }
        }
    }
}
