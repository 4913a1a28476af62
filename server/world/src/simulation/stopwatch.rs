//! Seconds per stage of a step. Physics reads no clock; the world does.

use std::time::Instant;

/// The stages of a step in their order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// Scripts and hands move the tools.
    Tools,
    /// Blades separate material.
    Cuts,
    /// Tools meet surfaces.
    Contacts,
    /// Bodies deform: operator, solver, integrator.
    Deform,
    /// Forces on the tools.
    Reactions,
    /// Probes, energies, events.
    Measure,
}

impl Stage {
    /// All stages in their order.
    pub const ALL: [Stage; 6] =
        [Stage::Tools, Stage::Cuts, Stage::Contacts, Stage::Deform, Stage::Reactions, Stage::Measure];

    /// Name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Stage::Tools => "tools",
            Stage::Cuts => "cuts",
            Stage::Contacts => "contacts",
            Stage::Deform => "deform",
            Stage::Reactions => "reactions",
            Stage::Measure => "measure",
        }
    }
}

/// Seconds per stage.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct StageSeconds([f64; Stage::ALL.len()]);

impl StageSeconds {
    /// Seconds of one stage.
    pub fn of(&self, stage: Stage) -> f64 {
        self.0[stage as usize]
    }

    /// Seconds of all stages together.
    pub fn total(&self) -> f64 {
        self.0.iter().sum()
    }

    /// Adds the times of another step.
    pub fn add(&mut self, other: &StageSeconds) {
        self.0.iter_mut().zip(&other.0).for_each(|(sum, s)| *sum += s);
    }

    /// Name and seconds of every stage.
    pub fn iter(&self) -> impl Iterator<Item = (&'static str, f64)> + '_ {
        Stage::ALL.iter().map(|stage| (stage.name(), self.of(*stage)))
    }
}

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
    pub fn start() -> Self {
        let processor_start_s = processor_seconds();
        Self { last: Instant::now(), seconds: StageSeconds::default(), processor_start_s }
    }

    pub fn book(&mut self, stage: Stage) {
        let now = Instant::now();
        self.seconds.0[stage as usize] += (now - self.last).as_secs_f64();
        self.last = now;
    }

    pub fn seconds(&self) -> StageSeconds {
        self.seconds
    }

    /// Processor time of this thread since the start [s].
    pub fn processor_s(&self) -> f64 {
        processor_seconds() - self.processor_start_s
    }
}
