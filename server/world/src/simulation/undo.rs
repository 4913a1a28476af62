//! Cuts that can be taken back: the topology of a body from before each of its last incisions.
//!
//! A copy is made when an incision meets a body for the first time, and at no other time.

use std::collections::VecDeque;

use scindo_physics::body::{BodyError, BodyTopology};
use scindo_physics::cut::{BladeSweep, CutReport};

use crate::body::{SimBody, bounds};

/// Incisions that can be taken back.
pub const MAX_UNDO: usize = 8;
/// Memory for all of them [bytes].
const MAX_BYTES: usize = 512 << 20;

/// A body from before an incision.
#[derive(Debug, serde::Serialize, serde::Deserialize)]
struct Kept {
    body: usize,
    incision: u32,
    topology: BodyTopology,
    bytes: usize,
    /// Whether the incision did anything to the body yet.
    used: bool,
}

/// The last incisions, oldest first.
#[derive(Debug, Default, serde::Serialize, serde::Deserialize)]
pub(crate) struct History {
    kept: VecDeque<Kept>,
    /// An incision was forgotten for lack of room.
    forgotten: bool,
}

/// What was taken back.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Undone {
    /// Number of the incision.
    pub incision: u32,
    /// Bodies that are as they were before it.
    pub bodies: Vec<usize>,
    /// Incisions that can still be taken back.
    pub left: usize,
}

impl History {
    /// Keeps `body`, number `index`, if this is the first that `incision` comes near it.
    pub(super) fn before(&mut self, index: usize, body: &SimBody, blade: &BladeSweep, incision: u32) {
        let known = |kept: &Kept| kept.body == index && kept.incision == incision;
        if self.kept.iter().any(known) || !meets(body, blade) {
            return;
        }
        let unused = self.kept.iter().position(|kept| kept.body == index && !kept.used);
        if let Some(mut kept) = unused.and_then(|at| self.kept.remove(at)) {
            kept.incision = incision;
            self.kept.push_back(kept);
            return;
        }
        let topology = body.body.topology();
        let bytes = topology.bytes();
        self.kept.push_back(Kept { body: index, incision, topology, bytes, used: false });
        while self.kept.len() > MAX_UNDO || self.kept.iter().map(|kept| kept.bytes).sum::<usize>() > MAX_BYTES
        {
            self.forgotten = true;
            self.kept.pop_front();
        }
    }

    /// Notes what a sweep of `incision` did to body number `index`, which had `epoch` before.
    pub(super) fn after(&mut self, index: usize, incision: u32, epoch: u32, done: &CutReport) {
        if done.epoch == epoch && done.pending_edges == 0 && done.elements_cut == 0 {
            return;
        }
        let of_it = |kept: &&mut Kept| kept.body == index && kept.incision == incision;
        self.kept.iter_mut().filter(of_it).for_each(|kept| kept.used = true);
    }

    /// Takes the last incision back, in every body that it went through.
    ///
    /// # Errors
    /// That there is none, or that a body cannot be built again.
    pub(super) fn undo(&mut self, bodies: &mut [SimBody]) -> Result<Undone, String> {
        while self.kept.back().is_some_and(|kept| !kept.used) {
            self.kept.pop_back();
        }
        let Some(incision) = self.kept.back().map(|kept| kept.incision) else {
            return Err(match self.forgotten {
                true => {
                    format!("there is no cut left to undo: the last {MAX_UNDO} are kept, memory permitting")
                }
                false => "there is no cut to undo".to_owned(),
            });
        };
        let mut undone = Undone { incision, bodies: Vec::new(), left: 0 };
        while let Some(kept) = self.kept.pop_back_if(|kept| kept.incision == incision || !kept.used) {
            if kept.incision == incision {
                let body = &mut bodies[kept.body];
                body.body.restore(kept.topology).map_err(|error: BodyError| error.to_string())?;
                body.has_changed_topology();
                undone.bodies.push(kept.body);
            }
        }
        let mut left: Vec<u32> =
            self.kept.iter().filter(|kept| kept.used).map(|kept| kept.incision).collect();
        left.dedup();
        undone.left = left.len();
        Ok(undone)
    }

    /// Nothing can be taken back any more.
    pub(super) fn clear(&mut self) {
        *self = Self::default();
    }
}

/// Whether the box around the sweep meets the box around the body.
fn meets(body: &SimBody, blade: &BladeSweep) -> bool {
    let (low, high) = bounds(body.body.positions());
    let (from, to) = bounds(blade.segments.iter().flatten());
    (0..3).all(|k| to[k] >= low[k] && from[k] <= high[k])
}
