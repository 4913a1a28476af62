//! Bodies that have come to rest sleep until something touches them.
//!
//! A body that sleeps is not stepped: its state stays as it is, bit for bit. It wakes when a tool presses, holds or
//! cuts it, when a body that is awake comes within reach, and when a value of the scene changes. Bodies that touch
//! each other fall asleep together and wake together. The effect is off unless the scene asks for it.

use crate::body::SimBody;
use crate::contact::Contacts;
use crate::report::BodyReport;

/// A body is quiet while none of its nodes moves faster than so many cells per second.
const QUIET_CELLS_S: f64 = 2e-3;
/// A body sleeps after it has been quiet for so long [s].
const QUIET_S: f64 = 0.5;

/// Which bodies sleep.
#[derive(Debug, Clone, Default, serde::Serialize, serde::Deserialize)]
pub(crate) struct Dormant {
    /// Per body; empty if the scene lets none sleep.
    asleep: Vec<bool>,
    /// Time for which each body has been quiet [s].
    quiet_s: Vec<f64>,
    /// Topology epoch of each body.
    epochs: Vec<u32>,
}

impl Dormant {
    /// All bodies awake; `allowed` tells whether they may sleep.
    pub(super) fn new(bodies: usize, allowed: bool) -> Self {
        let bodies = if allowed { bodies } else { 0 };
        Self { asleep: vec![false; bodies], quiet_s: vec![0.0; bodies], epochs: vec![0; bodies] }
    }

    /// Per body whether it sleeps; empty if the scene lets none sleep.
    pub(super) fn asleep(&self) -> &[bool] {
        &self.asleep
    }

    /// Whether body number `i` sleeps.
    pub(super) fn is_asleep(&self, i: usize) -> bool {
        self.asleep.get(i).copied().unwrap_or(false)
    }

    /// Wakes all bodies.
    pub(super) fn wake_all(&mut self) {
        self.asleep.fill(false);
        self.quiet_s.fill(0.0);
    }

    /// Wakes body number `i`.
    pub(super) fn wake(&mut self, i: usize) {
        if let (Some(asleep), Some(quiet_s)) = (self.asleep.get_mut(i), self.quiet_s.get_mut(i)) {
            (*asleep, *quiet_s) = (false, 0.0);
        }
    }

    /// Wakes the bodies that were cut, or otherwise changed, since the last call.
    pub(super) fn follow(&mut self, bodies: &[SimBody]) {
        for (i, body) in bodies.iter().enumerate().take(self.asleep.len()) {
            if std::mem::replace(&mut self.epochs[i], body.epoch()) != body.epoch() {
                self.wake(i);
            }
        }
    }

    /// Wakes the bodies that something acts on: tools, or bodies that are awake.
    pub(super) fn disturb(&mut self, contacts: &Contacts) {
        for i in 0..self.asleep.len() {
            if self.asleep[i] && !contacts.springs(i).is_empty() {
                self.wake(i);
            }
        }
    }

    /// Wakes the bodies that stand in contact with others that are awake.
    pub(super) fn join(&mut self, contacts: &Contacts) {
        let group = |i: usize| contacts.pairs().group_of(i);
        for i in 0..self.asleep.len() {
            if self.asleep[i] && (0..self.asleep.len()).any(|k| !self.asleep[k] && group(k) == group(i)) {
                self.wake(i);
            }
        }
    }

    /// Puts groups of bodies to sleep that have been quiet for long enough at the end of a step of `h` seconds.
    pub(super) fn settle(
        &mut self,
        (time_s, h): (f64, f64),
        bodies: &[SimBody],
        contacts: &mut Contacts,
        reports: &mut [BodyReport],
    ) {
        let n = self.asleep.len();
        for (i, body) in bodies.iter().enumerate().take(n).filter(|(i, _)| !self.asleep[*i]) {
            let is_quiet = time_s >= body.settled_s()
                && !contacts.is_touched(i)
                && !reports[i].solve.is_unconverged()
                && is_slow(body);
            self.quiet_s[i] = if is_quiet { self.quiet_s[i] + h } else { 0.0 };
        }
        for first in 0..n {
            let is_in = |i: usize| contacts.pairs().group_of(i) == first;
            if (first..n).any(|i| is_in(i) && self.quiet_s[i] <= QUIET_S) {
                continue;
            }
            for (i, report) in reports.iter_mut().enumerate().take(n).skip(first) {
                if contacts.pairs().group_of(i) == first && !std::mem::replace(&mut self.asleep[i], true) {
                    report.solve.iterations = 0;
                    contacts.forget_motion(i);
                }
            }
        }
    }
}

fn is_slow(body: &SimBody) -> bool {
    let limit = QUIET_CELLS_S * body.cell_m();
    body.body.velocities().iter().all(|v| v.norm_squared() <= limit * limit)
}
