//! Rates and costs between two reports.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

/// Counts since the last report.
#[derive(Debug, Default)]
struct Interval {
    steps: u64,
    stages: Vec<(&'static str, f64)>,
    contacts: BTreeMap<Arc<str>, u64>,
}

/// Rates and costs. The simulation and contact threads write them and the publisher reads them. Each holds
/// the lock for a few additions.
#[derive(Debug)]
pub struct Meter {
    interval: Mutex<(Instant, Interval)>,
}

/// Means over the interval that ended.
#[derive(Debug, Default)]
pub struct Rates {
    /// Length of the interval [s].
    pub seconds: f64,
    /// Steps per second.
    pub step_hz: f64,
    /// Mean duration of each stage [ms].
    pub stages_ms: Vec<(&'static str, f64)>,
    /// Contact messages per second, by tool.
    pub contact_hz: BTreeMap<Arc<str>, f64>,
}

impl Default for Meter {
    fn default() -> Self {
        Self { interval: Mutex::new((Instant::now(), Interval::default())) }
    }
}

impl Meter {
    /// Counts a step and the duration of its stages [ms].
    pub fn step(&self, stages: impl Iterator<Item = (&'static str, f64)>) {
        let interval = &mut self.lock().1;
        interval.steps += 1;
        for (name, seconds) in stages {
            match interval.stages.iter_mut().find(|(known, _)| *known == name) {
                Some((_, sum)) => *sum += seconds,
                None => interval.stages.push((name, seconds)),
            }
        }
    }

    /// Counts a contact message.
    pub fn contact(&self, tool: &Arc<str>) {
        let interval = &mut self.lock().1;
        match interval.contacts.get_mut(tool) {
            Some(count) => *count += 1,
            None => {
                interval.contacts.insert(tool.clone(), 1);
            }
        }
    }

    /// Ends the interval and begins the next.
    pub fn read(&self) -> Rates {
        let (since, interval) = std::mem::replace(&mut *self.lock(), (Instant::now(), Interval::default()));
        let seconds = since.elapsed().as_secs_f64().max(1e-9);
        let steps = interval.steps.max(1) as f64;
        let to_ms = |(name, sum): (&'static str, f64)| (name, 1e3 * sum / steps);
        Rates {
            seconds,
            step_hz: interval.steps as f64 / seconds,
            stages_ms: interval.stages.into_iter().map(to_ms).collect(),
            contact_hz: interval.contacts.into_iter().map(|(t, n)| (t, n as f64 / seconds)).collect(),
        }
    }

    fn lock(&self) -> MutexGuard<'_, (Instant, Interval)> {
        self.interval.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
