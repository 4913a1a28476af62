//! Selects cases and runs several of them in parallel.

use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, mpsc};
use std::time::Instant;

use scindo_study::bench::store::Origin;
use thiserror::Error;

use super::case::{Case, CaseReport, Setting, Status};
use super::cases;
use super::evidence::{Bound, Evidence, Figure};

/// The user's choices for a run.
#[derive(Debug, Clone, Default)]
pub struct Settings {
    /// Names or numbers of cases; empty for all.
    pub cases: Vec<String>,
    /// Cases of the program beside those of [`cases::ALL`].
    pub more: &'static [Case],
    /// Whether cases that have a long form take it.
    pub long: bool,
    /// Number of cases run in parallel; 0 for one per hardware thread.
    pub threads: usize,
    /// Raised from elsewhere to end after the cases that are under way.
    pub stop: Arc<AtomicBool>,
}

/// The result of a run.
#[derive(Debug, Clone)]
pub struct SuiteReport {
    /// Build and machine of the run.
    pub origin: Origin,
    /// Wall time [s].
    pub seconds: f64,
    /// Whether the run ended before all cases were done.
    pub interrupted: bool,
    /// One report per finished case, in the order of the list.
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

/// Reason why a run failed.
#[derive(Debug, Error)]
pub enum StressError {
    /// There is no such case.
    #[error("there is no case '{name}'; the cases are {known}")]
    NoSuchCase {
        /// The name that was given.
        name: String,
        /// Names of all cases.
        known: String,
    },
    /// A file or directory cannot be written.
    #[error("{path}: {error}")]
    Io {
        /// The file or directory.
        path: PathBuf,
        /// The message of the system.
        error: io::Error,
    },
}

/// Progress, reported whenever a case ends.
#[derive(Debug, Clone, Copy)]
pub struct Progress<'a> {
    /// Number of finished cases.
    pub done: usize,
    /// Number of cases to run.
    pub total: usize,
    /// The case that ended last.
    pub case: &'a Case,
    /// Outcome of that case.
    pub status: Status,
}

/// The cases with these names or numbers, of the list and of the program's own; all of them if no name is given.
///
/// # Errors
/// A name that no case has.
pub fn select(names: &[String], more: &'static [Case]) -> Result<Vec<&'static Case>, StressError> {
    let mut all: Vec<&'static Case> = cases::ALL.iter().chain(more).collect();
    all.sort_by_key(|case| case.number.unwrap_or(u8::MAX));
    if names.is_empty() {
        return Ok(all);
    }
    let find = |name: &String| {
        let same =
            |case: &&Case| case.name == name || case.number.is_some_and(|number| number.to_string() == *name);
        all.iter().copied().find(same).ok_or_else(|| StressError::NoSuchCase {
            name: name.clone(),
            known: all.iter().map(|case| case.name).collect::<Vec<_>>().join(", "),
        })
    };
    names.iter().map(find).collect()
}

/// Runs the cases and reports each one that ends.
///
/// # Errors
/// A name that no case has.
pub fn run(settings: &Settings, progress: &mut dyn FnMut(Progress<'_>)) -> Result<SuiteReport, StressError> {
    let cases = select(&settings.cases, settings.more)?;
    let started = Instant::now();
    let done = run_cases(&cases, &Setting { long: settings.long, ..Setting::default() }, settings, progress);
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

/// Runs `cases` on a few threads. Reports are in the order of `cases`, with their wall times [s].
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

/// Runs one case. A panic counts as a failure.
pub fn run_case(case: &'static Case, setting: &Setting) -> CaseReport {
    let outcome = catch_unwind(AssertUnwindSafe(|| (case.run)(setting)));
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
