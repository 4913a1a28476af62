//! What an experiment gets from the study: the user's choices, a way to report progress, and a clock.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use scindo_study::bench::progress::Progress;
use scindo_study::settings::Settings;

use super::Trouble;

/// A measurement is made at least this often, and for at least this long [s]. The least time counts.
const REPEATED: (usize, f64) = (3, 0.05);

/// The surroundings of an experiment.
pub struct ExperimentBench<'a> {
    settings: &'a Settings,
    tell: &'a mut dyn FnMut(&Progress),
    progress: Progress,
}

impl<'a> ExperimentBench<'a> {
    /// A bench for the experiment `name`.
    pub fn new(name: &str, settings: &'a Settings, tell: &'a mut dyn FnMut(&Progress)) -> Self {
        let progress =
            Progress { case: name.to_owned(), case_s: [0.0, f64::INFINITY], ..Progress::default() };
        Self { settings, tell, progress }
    }

    /// Whether only small bodies are wanted.
    pub fn is_quick(&self) -> bool {
        self.settings.quick
    }

    /// A surface that takes the place of the animal.
    pub fn surface(&self) -> Option<&Path> {
        self.settings.surface.as_deref()
    }

    /// Set when the user ends the study.
    pub fn stop(&self) -> &'a AtomicBool {
        &self.settings.stop
    }

    /// Announces the next of `total` measurements.
    ///
    /// # Errors
    /// The user has ended the study.
    pub fn begin(&mut self, what: impl Into<String>, total: usize) -> Result<(), Trouble> {
        if self.settings.stop.load(Ordering::Relaxed) {
            return Err("interrupted".into());
        }
        self.progress.what = what.into();
        self.progress.done += 1;
        self.progress.total = total.max(self.progress.done);
        (self.tell)(&self.progress);
        Ok(())
    }
}

/// The least time of some repetitions [s].
pub fn least(mut work: impl FnMut() -> Result<(), Trouble>) -> Result<f64, Trouble> {
    let (mut best, begun, mut count) = (f64::INFINITY, Instant::now(), 0);
    while count < REPEATED.0 || begun.elapsed().as_secs_f64() < REPEATED.1 {
        let from = Instant::now();
        work()?;
        best = best.min(from.elapsed().as_secs_f64());
        count += 1;
    }
    Ok(best)
}
