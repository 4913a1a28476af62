//! Where the tip has been, tick by tick. A model is made for a pose that lies in the past by its age; the
//! client knows the way since then exactly.

use nalgebra::Vector3;

/// Ticks that are kept: half a second.
const TICKS: usize = 512;

/// The tip at one tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Past {
    /// Loop clock [ns].
    pub at_ns: u64,
    /// Tip [m].
    pub tip_m: Vector3<f64>,
}

/// The tips of the last half second. Fixed size: recording allocates nothing.
#[derive(Debug, Clone)]
pub struct TipHistory {
    ticks: Box<[Past]>,
    next: usize,
    count: usize,
}

impl Default for TipHistory {
    fn default() -> Self {
        let nowhere = Past { at_ns: 0, tip_m: Vector3::zeros() };
        Self { ticks: vec![nowhere; TICKS].into_boxed_slice(), next: 0, count: 0 }
    }
}

impl TipHistory {
    /// Adds the tip at `at_ns`, and forgets the oldest one.
    pub fn record(&mut self, at_ns: u64, tip_m: Vector3<f64>) {
        self.ticks[self.next] = Past { at_ns, tip_m };
        self.next = (self.next + 1) % TICKS;
        self.count = (self.count + 1).min(TICKS);
    }

    /// From the oldest tip to the newest.
    pub fn iter(&self) -> impl Iterator<Item = &Past> {
        let oldest = (self.next + TICKS - self.count) % TICKS;
        let (newer, older) = self.ticks.split_at(oldest);
        older.iter().chain(newer).take(self.count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_ticks_are_kept_in_order() {
        let mut history = TipHistory::default();
        assert_eq!(history.iter().count(), 0);
        for ms in 0..700u64 {
            history.record(ms, Vector3::x() * ms as f64);
            let expected = (ms + 1).min(TICKS as u64);
            assert_eq!(history.iter().count() as u64, expected);
        }
        let times: Vec<u64> = history.iter().map(|past| past.at_ns).collect();
        assert_eq!(times, (700 - TICKS as u64..700).collect::<Vec<_>>());
        assert!(history.iter().all(|past| past.tip_m.x == past.at_ns as f64));
    }
}
