//! The clock that the threads of the client share.

use std::time::{Duration, Instant};

/// Monotonic clock of the process. It stamps ticks, poses and arrivals.
#[derive(Debug, Clone, Copy)]
pub struct LoopClock {
    origin: Instant,
}

impl Default for LoopClock {
    fn default() -> Self {
        Self { origin: Instant::now() }
    }
}

impl LoopClock {
    /// Time since the clock was created [ns].
    pub fn now_ns(&self) -> u64 {
        self.origin.elapsed().as_nanos() as u64
    }

    /// The instant at `ns` on this clock.
    pub fn instant(&self, ns: u64) -> Instant {
        self.origin + Duration::from_nanos(ns)
    }
}
