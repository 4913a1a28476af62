//! The hard cases, which break codes that deform and cut. `scindo stress` runs and shows them.
//!
//! A [`case`] is a set-up of a few lines with a rule that it passes or fails; [`cases`] lists all of them. A
//! [`watch`] steps a body and checks what every case must keep: finite numbers, mass, momentum, energy, whole
//! steps. The results of a case are [`evidence`]: figures with bounds, charts over time, and pictures. [`suite`] runs the cases. [`mutation`] takes parts of the method out and reports which cases
//! notice. [`page`] and [`json`] write the results.
//!
//! A case uses neither clock nor chance: it gives the same figures on every run. Times are kept apart.

pub mod case;

pub mod cases;

pub mod evidence;

pub mod watch;

pub mod suite;

pub mod mutation;

mod json;

mod page;

use std::path::Path;

use scindo_study::report::frame::put;

pub use case::{Case, CaseReport, Setting, Status};
pub use evidence::{Bound, Evidence, Figure};
pub use mutation::{Mutation, Row};
pub use suite::{Progress, Settings, StressError, SuiteReport, run, run_case, select};

/// Writes `index.html` and `stress.json` into `directory`. Each file is written completely or not at all.
///
/// # Errors
/// The file and the message of the system.
pub fn write(directory: &Path, report: &SuiteReport, table: Option<&[Row]>) -> Result<(), StressError> {
    let json = format!("{:#}\n", json::suite(report, table));
    let files = [("index.html", page::html(report, table)), ("stress.json", json)];
    put(directory, files).map_err(|(path, error)| StressError::Io { path, error })
}

#[cfg(test)]
mod tests;
