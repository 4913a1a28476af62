//! The clock beside a step. Physics reads no clock; the world does.

use std::time::Instant;

use crate::report::{Stage, StageSeconds};

/// Processor time of the calling thread [s]: what a step costs however busy the machine is.
pub(crate) fn processor_seconds() -> f64 {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    now.tv_sec as f64 + 1e-9 * now.tv_nsec as f64
}

/// Runs along a step and books the time since the last look on a stage.
#[derive(Debug)]
pub(crate) struct Stopwatch {
    last: Instant,
    seconds: StageSeconds,
    processor_start_s: f64,
}

impl Stopwatch {
    pub(super) fn start() -> Self {
        let processor_start_s = processor_seconds();
        Self { last: Instant::now(), seconds: StageSeconds::default(), processor_start_s }
    }

    pub(super) fn book(&mut self, stage: Stage) {
        let now = Instant::now();
        self.seconds.book(stage, (now - self.last).as_secs_f64());
        self.last = now;
    }

    pub(super) fn seconds(&self) -> StageSeconds {
        self.seconds
    }

    /// Processor time of this thread since the start [s].
    pub(super) fn processor_s(&self) -> f64 {
        processor_seconds() - self.processor_start_s
    }
}
