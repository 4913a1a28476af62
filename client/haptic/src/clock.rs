//! The clock that the threads of the client share.

use std::time::{Duration, Instant};

/// Monotonic clock of the process: stamps ticks, poses and arrivals.
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
    /// Since the clock was made [ns].
    pub fn now_ns(&self) -> u64 {
        self.origin.elapsed().as_nanos() as u64
    }

    /// When that is.
    pub fn instant(&self, ns: u64) -> Instant {
        self.origin + Duration::from_nanos(ns)
    }
}
