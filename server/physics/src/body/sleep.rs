//! Parts that are put to sleep: they stay where they are and cost the solver nothing.
//!
//! A part that a cut has freed falls for ever. Once far away it touches nothing, but its speed still
//! grows. So does the range of numbers that a step has to represent.

use nalgebra::Vector3;
use scindo_matter::element::{FixedCopy, Held};

use super::Body;

impl Body {
    /// Puts a part that is held nowhere to sleep. Every copy of it is held where it is, at rest, until
    /// [`reset`](Self::reset) or until a cut along faces renumbers the nodes. The epoch rises. Returns
    /// whether the part was free.
    pub fn put_to_sleep(&mut self, part: usize) -> bool {
        if !self.parts.free.get(part).copied().unwrap_or(false) {
            return false;
        }
        let of_copy = (0u32..).zip(&self.parts.of_copy);
        let copies: Vec<u32> =
            of_copy.filter(|(_, of)| **of as usize == part).map(|(copy, _)| copy).collect();
        for &copy in &copies {
            let position_m = self.state.x[copy as usize].into();
            self.asleep.push(FixedCopy { copy, held: Held::FULLY, position_m });
            self.state.v[copy as usize] = Vector3::zeros();
        }
        self.dynamics.still(&copies, &self.state);
        self.asleep.sort_unstable_by_key(|held| held.copy);
        self.space.set_epoch(self.space.epoch() + 1);
        self.follow_boundary();
        true
    }

    /// Whether a copy belongs to a part that sleeps.
    pub fn is_asleep(&self, copy: u32) -> bool {
        self.asleep.binary_search_by_key(&copy, |held| held.copy).is_ok()
    }

    /// Whether any part sleeps.
    pub fn sleeps(&self) -> bool {
        !self.asleep.is_empty()
    }

    /// Writes the centre of mass [m] of every part to `centres`.
    pub fn part_centres(&self, centres: &mut Vec<Vector3<f64>>) {
        centres.clear();
        centres.resize(self.parts.len(), Vector3::zeros());
        for ((&part, m), x) in self.parts.of_copy.iter().zip(&self.mass).zip(&self.state.x) {
            centres[part as usize] += *m * x;
        }
        for (centre, mass) in centres.iter_mut().zip(&self.parts.mass) {
            *centre /= mass.max(f64::MIN_POSITIVE);
        }
    }

    /// Collects the copies held by constraints or by sleep, ascending.
    pub(super) fn find_fixed(&mut self) {
        self.boundary.fixed_copies(&*self.space, &self.rest, self.prescribed_share, &mut self.fixed);
        if !self.asleep.is_empty() {
            self.fixed.extend_from_slice(&self.asleep);
            self.fixed.sort_by_key(|held| held.copy);
            self.fixed.dedup_by_key(|held| held.copy);
        }
    }
}
