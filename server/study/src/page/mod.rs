//! Output for people: a self-contained page and a plot per case. The same data is written as JSON and as a
//! table.

mod case;

mod json;

mod text;

pub mod table;

mod wear;

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use crate::report::{interactive, section, style, view};
use crate::result::StudyResult;

/// Writes `index.html`, `study.json` and `pareto-<case>.svg`. Each file is written completely or not at all.
///
/// # Errors
/// The file and the message of the system.
pub fn write(directory: &Path, study: &StudyResult) -> Result<(), (PathBuf, io::Error)> {
    let put = |name: &str, text: &str| {
        let (path, draft) = (directory.join(name), directory.join(format!("{name}.part")));
        fs::write(&draft, text).and_then(|()| fs::rename(&draft, &path)).map_err(|error| (path, error))
    };
    put("index.html", &html(study))?;
    put("study.json", &format!("{:#}\n", json::study(study)))?;
    for result in &study.cases {
        put(&format!("pareto-{}.svg", result.case.name), &case::picture(result))?;
    }
    Ok(())
}

/// The complete page.
fn html(study: &StudyResult) -> String {
    let mut out = String::with_capacity(1 << 18);
    out += "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n";
    out += "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n";
    out += "<title>scindo · what accuracy costs</title>\n<style>\n";
    out += style::PAGE;
    out += style::COLOURS;
    out += style::PLOT;
    out += style::LINES;
    out += interactive::STYLE;
    out += &view::style();
    out += "</style>\n</head>\n<body>\n<main>\n";
    out += &text::opening(study);
    for result in &study.cases {
        out += &case::section(result);
    }
    for result in &study.experiments {
        out += &section::section(result);
    }
    out += &text::method(study);
    out += "</main>\n";
    out += interactive::SCRIPT;
    out += "</body>\n</html>\n";
    out
}
