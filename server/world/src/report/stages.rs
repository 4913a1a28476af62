//! The stages of a step and the seconds that they take.

/// The stages of a step in their order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// Scripts and hands move the tools.
    Tools,
    /// Blades separate material.
    Cuts,
    /// Cells are divided and joined.
    Adapt,
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
    pub const ALL: [Stage; 7] = [
        Stage::Tools,
        Stage::Cuts,
        Stage::Adapt,
        Stage::Contacts,
        Stage::Deform,
        Stage::Reactions,
        Stage::Measure,
    ];

    /// Name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Stage::Tools => "tools",
            Stage::Cuts => "cuts",
            Stage::Adapt => "adapt",
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

    /// Books the time of a stage.
    pub(crate) fn book(&mut self, stage: Stage, seconds: f64) {
        self.0[stage as usize] += seconds;
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
