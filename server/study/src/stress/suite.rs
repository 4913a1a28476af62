//! Picks cases and runs them, several at the same time.

use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, mpsc};
use std::time::Instant;

use thiserror::Error;

use super::case::{Case, CaseReport, Setting, Status};
use super::cases;
use super::evidence::{Bound, Evidence, Figure};
use crate::bench::store::Origin;

/// What is run.
#[derive(Debug, Clone, Default)]
pub struct Settings {
    /// Names or numbers of cases; empty: all.
    pub cases: Vec<String>,
    /// Cases run at the same time; 0: one per hardware thread.
    pub threads: usize,
    /// Set to end after the cases that are being run.
    pub stop: Arc<AtomicBool>,
}

/// The suite as it was run.
#[derive(Debug, Clone)]
pub struct SuiteReport {
    /// Build and machine.
    pub origin: Origin,
    /// Wall time [s].
    pub seconds: f64,
    /// Whether it was ended before all cases were run.
    pub interrupted: bool,
    /// One report per case that was run, in the order of the list.
    pub cases: Vec<CaseReport>,
    /// Wall time of every case [s], in the same order.
    pub case_seconds: Vec<f64>,
}

impl SuiteReport {
    /// Number of cases with this status.
    pub fn count(&self, status: Status) -> usize {
        self.cases.iter().filter(|report| report.status == status).count()
    }
}

/// Why nothing was run.
#[derive(Debug, Error)]
pub enum StressError {
    /// There is no such case.
    #[error("there is no case '{name}'; the cases are {known}")]
    NoSuchCase {
        /// What was asked for.
        name: String,
        /// Names of all cases.
        known: String,
    },
    /// A file or directory cannot be written.
    #[error("{path}: {error}")]
    Io {
        /// Which.
        path: PathBuf,
        /// What the system says.
        error: io::Error,
    },
}

/// A case ended.
#[derive(Debug, Clone, Copy)]
pub struct Progress<'a> {
    /// Cases that are done.
    pub done: usize,
    /// Cases to be run.
    pub total: usize,
    /// The one that ended last.
    pub case: &'a Case,
    /// How.
    pub status: Status,
}

/// The cases that go by these names or numbers; all of them if there is none.
///
/// # Errors
/// A name that no case has.
pub fn select(names: &[String]) -> Result<Vec<&'static Case>, StressError> {
    let all = cases::ALL;
    if names.is_empty() {
        return Ok(all.iter().collect());
    }
    let find = |name: &String| {
        let same =
            |case: &&Case| case.name == name || case.number.is_some_and(|number| number.to_string() == *name);
        all.iter().find(same).ok_or_else(|| StressError::NoSuchCase {
            name: name.clone(),
            known: all.iter().map(|case| case.name).collect::<Vec<_>>().join(", "),
        })
    };
    names.iter().map(find).collect()
}

/// Runs the cases and tells of every one that ends.
///
/// # Errors
/// A name that no case has.
pub fn run(settings: &Settings, progress: &mut dyn FnMut(Progress<'_>)) -> Result<SuiteReport, StressError> {
    let cases = select(&settings.cases)?;
    let started = Instant::now();
    let done = run_cases(&cases, &Setting::default(), settings, progress);
    let interrupted = done.len() < cases.len();
    let (cases, case_seconds) = done.into_iter().unzip();
    Ok(SuiteReport {
        origin: Origin::here(),
        seconds: started.elapsed().as_secs_f64(),
        interrupted,
        cases,
        case_seconds,
    })
}

/// Runs `cases` on a few threads; reports come in the order of `cases`, with their wall times [s].
pub(super) fn run_cases(
    cases: &[&'static Case],
    setting: &Setting,
    settings: &Settings,
    progress: &mut dyn FnMut(Progress<'_>),
) -> Vec<(CaseReport, f64)> {
    let hardware = std::thread::available_parallelism().map_or(1, usize::from);
    let threads = if settings.threads > 0 { settings.threads } else { hardware }.min(cases.len().max(1));
    let next = AtomicUsize::new(0);
    let (send, receive) = mpsc::sync_channel(threads);
    let mut reports: Vec<Option<(CaseReport, f64)>> = vec![None; cases.len()];
    std::thread::scope(|scope| {
        for _ in 0..threads {
            let (send, next) = (send.clone(), &next);
            scope.spawn(move || {
                while !settings.stop.load(Ordering::Relaxed) {
                    let i = next.fetch_add(1, Ordering::Relaxed);
                    let Some(case) = cases.get(i) else { return };
                    let started = Instant::now();
                    let report = run_case(case, setting);
                    if send.send((i, report, started.elapsed().as_secs_f64())).is_err() {
                        return;
                    }
                }
            });
        }
        drop(send);
        for (done, (i, report, seconds)) in receive.iter().enumerate() {
            progress(Progress { done: done + 1, total: cases.len(), case: cases[i], status: report.status });
            reports[i] = Some((report, seconds));
        }
    });
    reports.into_iter().flatten().collect()
}

/// Runs one case; a panic is a failure like any other.
pub fn run_case(case: &'static Case, setting: &Setting) -> CaseReport {
    let Some(run) = case.run else {
        return CaseReport { case, status: Status::NotYet, reason: None, evidence: Evidence::default() };
    };
    let outcome = catch_unwind(AssertUnwindSafe(|| run(setting)));
    let (evidence, reason) = match outcome {
        Ok(Ok(evidence)) => (evidence, None),
        Ok(Err(error)) => (Evidence::default(), Some(error.to_string())),
        Err(_) => (Evidence::default(), Some("it panicked".to_owned())),
    };
    let holds = reason.is_none() && evidence.figures.iter().all(Figure::holds);
    let bounded = evidence.figures.iter().any(|figure| figure.bound != Bound::Told);
    let status = if holds && bounded { Status::Passed } else { Status::Failed };
    CaseReport { case, status, reason, evidence }
}
