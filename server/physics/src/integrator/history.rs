//! States of earlier steps, for schemes that need them.

use nalgebra::Vector3;
use scindo_matter::cut::NewCopy;
use scindo_matter::octree::Restriction;

use super::guard::LARGEST_TURN;
use super::notice::Notice;
use super::state::State;

/// The last two states.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct History {
    /// State before the last step; `last` is the one that the last step left.
    pub before: State,
    last: State,
    /// Length of the last step [s].
    pub h: f64,
    /// Number of springs in contact at the end of the last step.
    pub contacts: usize,
    /// Whether there was a last step; without one the rest is invalid.
    pub known: bool,
}

impl History {
    /// Forgets the last step.
    pub(super) fn forget(&mut self) {
        self.known = false;
        self.contacts = 0;
    }

    /// Whether `state` is what the last step left.
    pub(super) fn continues(&self, state: &State) -> bool {
        self.known && self.last.x == state.x && self.last.v == state.v
    }

    /// Treats `copies`, which are held from now on, as if they had always rested at the positions of `state`.
    pub(super) fn still(&mut self, copies: &[u32], state: &State) {
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

    /// Why BDF2 cannot make a step of `h` [s]: no history of steps as long, a turn by an angle [rad] that it does
    /// not bear, or more springs in contact at the end of the step than there were.
    pub(super) fn why_no_bdf2(
        &self,
        h: f64,
        angle_rad: impl FnOnce() -> f64,
        contacts: impl FnOnce() -> usize,
    ) -> Option<Notice> {
        if !self.known || (self.h - h).abs() > 1e-9 * h {
            return Some(Notice::Started);
        }
        let angle_rad = angle_rad();
        if angle_rad > LARGEST_TURN {
            return Some(Notice::Spinning { angle_rad });
        }
        (contacts() > self.contacts).then_some(Notice::ContactOnset)
    }

    /// Records a step of length `h` [s] from `before` to `after`.
    pub(super) fn push(&mut self, before: &State, after: &State, h: f64) {
        self.before.copy_motion_from(before);
        self.last.copy_motion_from(after);
        self.h = h;
        self.known = true;
    }

    /// Carries positions and velocities over a coarsening.
    pub(super) fn coarsen(&mut self, restriction: &Restriction<'_>) {
        if self.known {
            for kept in [&mut self.before, &mut self.last] {
                restriction.sample(&mut kept.x);
                restriction.project(&mut kept.v);
            }
        }
    }

    /// Gives the copies `new`, which a cut made, the history of their parents.
    pub(super) fn inherit(&mut self, new: &[NewCopy]) {
        if !self.known {
            return;
        }
        for kept in [&mut self.before, &mut self.last] {
            for values in [&mut kept.x, &mut kept.v] {
                NewCopy::inherit(new, values);
            }
        }
    }
}
