//! Force continuity when the contact changes.
//!
//! A new message would make the force jump. When it arrives, the difference between the felt force and the
//! force of the new model becomes an offset. The offset falls linearly to zero over one contact period. After
//! a cut has changed the topology it takes at least 20 ms:
//!
//! f(t) = f_new(t) + (f_felt(t₀) − f_new(t₀)) · (1 − (t − t₀)/T_blend).
//!
//! A message that arrives while an offset still falls takes over the rest of it and keeps its remaining time.

use crate::constants::{EPOCH_BLEND_NS, MAX_BLEND_NS, MIN_BLEND_NS};
use crate::contact::model::ContactModel;
use nalgebra::Vector3;

/// The offset while it falls.
#[derive(Debug, Clone, Copy)]
pub struct Blend {
    offset_n: Vector3<f64>,
    from_ns: u64,
    duration_ns: u64,
    /// Force of the contact law alone in the last tick [N].
    last_law_n: Vector3<f64>,
    last_arrival_ns: u64,
    last_key: (u64, u64),
    last_epoch: u32,
}

impl Default for Blend {
    fn default() -> Self {
        Self {
            offset_n: Vector3::zeros(),
            from_ns: 0,
            duration_ns: MIN_BLEND_NS,
            last_law_n: Vector3::zeros(),
            last_arrival_ns: 0,
            last_key: (0, 0),
            last_epoch: 0,
        }
    }
}

impl Blend {
    /// Continuous force [N] from `force_n`, the force of `model` now.
    pub fn apply(&mut self, force_n: Vector3<f64>, model: &ContactModel, now_ns: u64) -> Vector3<f64> {
        let key = (model.seq, model.received_ns);
        if key != self.last_key {
            self.restart(force_n, model, now_ns);
            self.last_key = key;
        }
        self.last_law_n = force_n;
        force_n + self.offset_at(now_ns)
    }

    fn restart(&mut self, force_n: Vector3<f64>, model: &ContactModel, now_ns: u64) {
        let first = self.last_key.0 == 0;
        let since_ns = if first { 0 } else { model.received_ns.saturating_sub(self.last_arrival_ns) };
        let period_ns = since_ns.clamp(MIN_BLEND_NS, MAX_BLEND_NS);
        let cut = model.epoch != self.last_epoch && !first;
        let epoch_ns = if cut { EPOCH_BLEND_NS } else { 0 };
        let remaining_ns = (self.from_ns + self.duration_ns).saturating_sub(now_ns);
        self.offset_n = self.last_law_n + self.offset_at(now_ns) - force_n;
        self.from_ns = now_ns;
        self.duration_ns = period_ns.max(epoch_ns).max(remaining_ns);
        self.last_arrival_ns = model.received_ns;
        self.last_epoch = model.epoch;
    }

    /// The rest of the offset [N].
    fn offset_at(&self, now_ns: u64) -> Vector3<f64> {
        let progress = now_ns.saturating_sub(self.from_ns) as f64 / self.duration_ns as f64;
        self.offset_n * (1.0 - progress).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn model(seq: u64, epoch: u32, received_ms: u64) -> ContactModel {
        ContactModel { seq, epoch, received_ns: received_ms * 1_000_000, ..ContactModel::NONE }
    }

    fn force(blend: &mut Blend, z: f64, model: &ContactModel, now_ms: u64) -> f64 {
        blend.apply(Vector3::new(0.0, 0.0, z), model, now_ms * 1_000_000).z
    }

    #[test]
    fn a_change_is_spread_over_one_contact_period() {
        let mut blend = Blend::default();
        force(&mut blend, 0.0, &model(1, 1, 100), 100);
        let change = model(2, 1, 105);
        let felt: Vec<f64> = (105..=112).map(|ms| force(&mut blend, 1.0, &change, ms)).collect();
        assert_eq!(felt[0], 0.0);
        assert!((felt[1] - 0.2).abs() < 1e-12 && (felt[4] - 0.8).abs() < 1e-12);
        assert_eq!(felt[5], 1.0);
    }

    #[test]
    fn a_cut_is_spread_over_twenty_milliseconds_whatever_follows() {
        let mut blend = Blend::default();
        force(&mut blend, 0.0, &model(1, 1, 0), 40);
        force(&mut blend, 1.0, &model(2, 1, 0), 80);
        assert_eq!(force(&mut blend, 1.0, &model(2, 1, 0), 120), 1.0);
        let mut last = 1.0;
        for ms in 120..=140 {
            let newest = model(3 + (ms - 120) / 5, 2, ms - (ms - 120) % 5);
            let felt = force(&mut blend, 0.0, &newest, ms);
            assert!((last - felt).abs() < 0.0501, "{ms}: {last} → {felt}");
            last = felt;
        }
        assert_eq!(last, 0.0);
    }

    #[test]
    fn within_one_message_the_law_acts_at_once() {
        let mut blend = Blend::default();
        let one = model(1, 1, 0);
        force(&mut blend, 0.0, &one, 0);
        assert_eq!(force(&mut blend, 0.7, &one, 50), 0.7);
        assert_eq!(force(&mut blend, 0.9, &one, 51), 0.9);
    }
}
