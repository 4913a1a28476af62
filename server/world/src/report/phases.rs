//! Seconds per phase of the mechanics, within the stage that deforms bodies.

use scindo_physics::team::phase::Phase;

/// Seconds per [`Phase`], over all bodies.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct PhaseSeconds([f64; Phase::ALL.len()]);

impl PhaseSeconds {
    /// Seconds of one phase.
    pub fn of(&self, phase: Phase) -> f64 {
        self.0[phase as usize]
    }

    /// Seconds of all phases together.
    pub fn total(&self) -> f64 {
        self.0.iter().sum()
    }

    /// Books the time of a phase.
    pub(crate) fn book(&mut self, phase: Phase, seconds: f64) {
        self.0[phase as usize] += seconds;
    }

    /// Adds the times of another step.
    pub fn add(&mut self, other: &PhaseSeconds) {
        self.0.iter_mut().zip(&other.0).for_each(|(sum, s)| *sum += s);
    }

    /// Name and seconds of every phase.
    pub fn iter(&self) -> impl Iterator<Item = (&'static str, f64)> + '_ {
        Phase::ALL.iter().map(|phase| (phase.name(), self.of(*phase)))
    }
}
