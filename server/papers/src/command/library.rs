//! The names that the study of accuracy knows here: cases and experiments.

use scindo_study::case::Case;
use scindo_study::report::result::ExperimentResult;
use scindo_study::{Library, Progress, Settings};

use crate::lab::ExperimentBench;
use crate::{cases, experiment};

/// All cases and experiments.
pub(super) struct Named;

impl Library for Named {
    fn cases(&self, name: &str, quick: bool) -> Vec<Case> {
        cases::cases(name, quick)
    }

    fn experiments(&self, name: &str) -> &'static [&'static str] {
        experiment::named(name)
    }

    fn make(
        &self,
        experiment: &'static str,
        settings: &Settings,
        tell: &mut dyn FnMut(&Progress),
    ) -> ExperimentResult {
        experiment::study(experiment, &mut ExperimentBench::new(experiment, settings, tell))
    }

    fn names(&self) -> String {
        let (cases, experiments) = (cases::NAMES.join(", "), experiment::NAMES.join(", "));
        format!(
            "cases: {cases}; groups of them: bar, cutting; experiments: {experiments}; groups of them: dick, cells"
        )
    }
}
