//! What the parts of the book have measured, read from the files that they leave.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use serde_json::Value;

use super::catalogue::{Number, Paper};
use super::part::Part;

/// The reports of all parts that are there.
#[derive(Debug, Default)]
pub struct Measured {
    reports: BTreeMap<String, Value>,
    /// Seconds that parts took.
    seconds: BTreeMap<String, f64>,
}

impl Measured {
    /// Reads the reports of `parts` in the directory of a book. A part that was not run has none.
    pub fn read(directory: &Path, parts: &[Part]) -> Self {
        let report = |part: &Part| {
            let text = fs::read_to_string(part.report(directory)).ok()?;
            Some((part.name.clone(), serde_json::from_str(&text).ok()?))
        };
        let seconds = |part: &Part| Some((part.name.clone(), part.seconds(directory)?));
        Self {
            reports: parts.iter().filter_map(report).collect(),
            seconds: parts.iter().filter_map(seconds).collect(),
        }
    }

    /// One report alone.
    #[cfg(test)]
    pub fn of_report(part: &str, report: Value) -> Self {
        Self { reports: BTreeMap::from([(part.to_owned(), report)]), ..Self::default() }
    }

    /// Seconds that a part took, once it is finished.
    pub fn seconds(&self, part: &str) -> Option<f64> {
        self.seconds.get(part).copied()
    }

    /// The reports on the effects of scenes.
    pub fn effects(&self) -> impl Iterator<Item = (&String, &Value)> {
        self.reports.iter().filter(|(part, _)| part.starts_with("effects-"))
    }

    /// The report of a part.
    pub fn report(&self, part: &str) -> Option<&Value> {
        self.reports.get(part)
    }

    /// The measured value of a printed number, in its unit. One that was reached [on fewer
    /// cores](Self::on_fewer_cores) counts, too.
    pub fn of(&self, paper: &Paper, number: &Number, quick: bool) -> Option<f64> {
        self.own(number, quick).or_else(|| self.on_fewer_cores(paper, number, quick))
    }

    /// The value on fewer cores than in the paper, where that is enough, and it was not measured on as many.
    pub fn on_fewer_cores(&self, paper: &Paper, number: &Number, quick: bool) -> Option<f64> {
        if self.own(number, quick).is_some() {
            return None;
        }
        let value = self.at(&number.source_on_fewer_cores()?)? * number.scale;
        (value >= number.bar(paper)).then_some(value)
    }

    fn own(&self, number: &Number, quick: bool) -> Option<f64> {
        self.at(&number.source(quick)?).map(|value| value * number.scale)
    }

    fn at(&self, source: &[&str]) -> Option<f64> {
        match *source {
            ["stress", case, figure] => self.figure(case, figure),
            [experiment, table, row, column] => self.cell(experiment, [table, row, column]),
            _ => None,
        }
    }

    /// A figure of a hard case.
    fn figure(&self, case: &str, name: &str) -> Option<f64> {
        let report = self.reports.get("stress")?;
        let named = |list: &'static str, name: &str, of: &Value| -> Option<Value> {
            of.get(list)?.as_array()?.iter().find(|entry| entry["name"] == name).cloned()
        };
        named("figures", name, &named("cases", case, report)?)?["value"].as_f64()
    }

    /// A cell of a table of an experiment. The title of the table is given by its beginning.
    fn cell(&self, experiment: &str, [table, row, column]: [&str; 3]) -> Option<f64> {
        let experiments = self.reports.get(experiment)?["experiments"].as_array()?;
        let made = experiments.iter().find(|made| made["name"] == experiment)?;
        let starts = |t: &&Value| t["title"].as_str().is_some_and(|title| title.starts_with(table));
        let table = made["tables"].as_array()?.iter().find(starts)?;
        let at = table["columns"].as_array()?.iter().position(|c| c["name"] == column)?;
        let rows = table["rows"].as_array()?;
        rows.iter().find(|r| r["name"] == row && r["printed"] == false)?["values"].get(at)?.as_f64()
    }
}
