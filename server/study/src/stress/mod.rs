//! The hard cases: what breaks codes that deform and cut, run and shown by `scindo stress`.
//!
//! A [`case`] is a set-up of a few lines with a rule that it passes or fails; [`cases`] lists all of
//! them. A [`watch`] steps a body and holds it to what every case must keep: finite numbers, mass,
//! momentum, energy, whole steps. What a case leaves is [`evidence`]: figures with their bounds,
//! [`chart`]s over time, pictures ([`view`]). [`suite`] runs them. [`mutation`] takes parts of the method
//! away and tells which cases notice; [`page`] and [`json`] write it down.
//!
//! A case knows no clock and no chance: it gives the same figures on every run. Times stand apart.

pub mod case;

pub mod cases;

pub mod evidence;

pub mod watch;

pub mod chart;

pub mod view;

pub mod suite;

pub mod mutation;

mod json;

mod page;

use std::fs;
use std::path::Path;

pub use case::{Case, CaseReport, Setting, Status};
pub use evidence::{Bound, Evidence, Figure};
pub use mutation::{Mutation, Row};
pub use suite::{Progress, Settings, StressError, SuiteReport, run, run_case, select};

/// Writes `index.html` and `stress.json` into `directory`, each whole or not at all.
///
/// # Errors
/// File and what the system says.
pub fn write(directory: &Path, report: &SuiteReport, table: Option<&[Row]>) -> Result<(), StressError> {
    let io = |path: &Path| {
        let path = path.to_owned();
        move |error| StressError::Io { path, error }
    };
    fs::create_dir_all(directory).map_err(io(directory))?;
    for (name, text) in [
        ("index.html", page::html(report, table)),
        ("stress.json", format!("{:#}\n", json::suite(report, table))),
    ] {
        let (path, draft) = (directory.join(name), directory.join(format!("{name}.part")));
        fs::write(&draft, text).and_then(|()| fs::rename(&draft, &path)).map_err(io(&path))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests;
