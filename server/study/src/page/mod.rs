//! Output for people: a self-contained page and a plot per case. The same data is written as JSON and as a
//! table.

mod case;

mod json;

mod text;

pub mod table;

mod wear;

use std::io;
use std::path::{Path, PathBuf};

use crate::report::frame::{page, put};
use crate::report::section;
use crate::result::StudyResult;

/// Writes `index.html`, `study.json` and `pareto-<case>.svg`. Each file is written completely or not at all.
///
/// # Errors
/// The file and the message of the system.
pub fn write(directory: &Path, study: &StudyResult) -> Result<(), (PathBuf, io::Error)> {
    put(directory, [("index.html", html(study)), ("study.json", format!("{:#}\n", json::study(study)))])?;
    put(directory, study.cases.iter().map(|r| (format!("pareto-{}.svg", r.case.name), case::picture(r))))
}

/// The complete page.
fn html(study: &StudyResult) -> String {
    let mut body = text::opening(study);
    body.extend(study.cases.iter().map(case::section));
    body.extend(study.experiments.iter().map(section::section));
    body += &text::method(study);
    page("what accuracy costs", "", &body)
}
