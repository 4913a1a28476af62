//! What people read: one self-contained page, a picture per case, and the same as JSON.

mod case;

mod json;

mod plot;

mod scale;

pub(crate) mod style;

mod text;

mod wear;

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use crate::result::StudyResult;

/// Writes `index.html`, `study.json` and `pareto-<case>.svg`, each whole or not at all.
///
/// # Errors
/// File and what the system says.
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

/// The page.
fn html(study: &StudyResult) -> String {
    let mut out = String::with_capacity(1 << 18);
    out += "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n";
    out += "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n";
    out += "<title>scindo · what accuracy costs</title>\n<style>\n";
    out += style::PAGE;
    out += style::COLOURS;
    out += style::PLOT;
    out += "</style>\n</head>\n<body>\n<main>\n";
    out += &text::opening(study);
    for result in &study.cases {
        out += &case::section(result);
    }
    out += &text::method(study);
    out += "</main>\n</body>\n</html>\n";
    out
}

/// Text for HTML and SVG.
pub(crate) fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// Prose for HTML: what stands in backticks is code.
fn prose(text: &str) -> String {
    let part =
        |(i, part): (usize, &str)| if i % 2 == 1 { format!("<code>{part}</code>") } else { part.to_owned() };
    escape(text).split('`').enumerate().map(part).collect()
}

/// Milliseconds for people: three digits, seconds from a thousand on.
fn time(milliseconds: f64) -> String {
    if !milliseconds.is_finite() || milliseconds <= 0.0 {
        return "–".to_owned();
    }
    let (value, unit) = if milliseconds >= 999.5 { (milliseconds / 1e3, "s") } else { (milliseconds, "ms") };
    let digits = (2 - value.log10().floor() as i32).clamp(0, 3) as usize;
    format!("{value:.digits$} {unit}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_stands_in_backticks_is_code() {
        assert_eq!(prose("`xfem` & no"), "<code>xfem</code> &amp; no");
    }

    #[test]
    fn times_for_people() {
        assert_eq!(time(0.01234), "0.012 ms");
        assert_eq!(time(1.234), "1.23 ms");
        assert_eq!(time(123.4), "123 ms");
        assert_eq!(time(12345.0), "12.3 s");
        assert_eq!(time(f64::NAN), "–");
    }
}
