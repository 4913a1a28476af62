//! What an experiment gives: tables, charts, plots and pictures.

use serde_json::{Value, json};

use super::chart::Chart;
use super::html::time;
use super::plot::Plot;
use crate::words::compact;

pub use super::view::Picture;

/// How a number is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// A whole number.
    Count,
    /// A time [s].
    Seconds,
    /// A plain number.
    Number,
    /// A factor.
    Times,
    /// A part of a whole.
    Share,
}

impl Unit {
    /// Stable name for programs.
    pub fn name(self) -> &'static str {
        match self {
            Self::Count => "count",
            Self::Seconds => "s",
            Self::Number | Self::Share => "1",
            Self::Times => "times",
        }
    }

    /// A number for people.
    pub fn show(self, value: f64) -> String {
        match self {
            _ if !value.is_finite() => "–".to_owned(),
            Self::Count => thousands(value.round() as u64),
            Self::Seconds if value < 1e-4 => format!("{} µs", compact(1e6 * value)),
            Self::Seconds => time(1e3 * value),
            Self::Number => compact(value),
            Self::Times => format!("{} ×", compact(value)),
            Self::Share => format!("{:.0} %", 100.0 * value),
        }
    }
}

/// A whole number with its thousands apart.
fn thousands(n: u64) -> String {
    let digits = n.to_string();
    let mut out = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push(',');
        }
        out.push(digit);
    }
    out
}

/// A column of a table.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// Heading.
    pub name: &'static str,
    /// How its numbers are shown.
    pub unit: Unit,
}

/// A row of a table.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// What was measured.
    pub name: String,
    /// A number per column, where there is one.
    pub values: Vec<Option<f64>>,
    /// Whether these are figures of the paper.
    pub printed: bool,
}

/// A table.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// The line above the table.
    pub title: String,
    /// What its numbers are.
    pub about: String,
    /// Columns after the name.
    pub columns: Vec<Column>,
    /// One row per case, in the order of the page.
    pub rows: Vec<Row>,
}

impl Table {
    /// A table without rows.
    pub fn new(title: &str, about: &str, columns: &[(&'static str, Unit)]) -> Self {
        Self {
            title: title.to_owned(),
            about: about.to_owned(),
            columns: columns.iter().map(|&(name, unit)| Column { name, unit }).collect(),
            rows: Vec::new(),
        }
    }

    /// Adds a measured row.
    pub fn row(&mut self, name: impl Into<String>, values: &[Option<f64>]) {
        self.rows.push(Row { name: name.into(), values: values.to_vec(), printed: false });
    }

    /// Adds figures of the paper.
    pub fn printed(&mut self, name: impl Into<String>, values: &[Option<f64>]) {
        self.rows.push(Row { name: name.into(), values: values.to_vec(), printed: true });
    }
}

/// Plots that stand side by side.
#[derive(Clone, Debug, Default)]
pub struct Plots {
    /// What they show.
    pub caption: String,
    /// Errors over time.
    pub plots: Vec<Plot>,
    /// Lines.
    pub charts: Vec<Chart>,
}

/// The result of an experiment.
#[derive(Clone, Debug, Default)]
pub struct ExperimentResult {
    /// Its name on the command line.
    pub name: &'static str,
    /// Heading.
    pub title: String,
    /// Description in a few sentences.
    pub about: String,
    /// Remarks for the reader.
    pub notes: Vec<String>,
    /// What the page shows as tables.
    pub tables: Vec<Table>,
    /// Plots and charts.
    pub plots: Vec<Plots>,
    /// Pictures of bodies.
    pub pictures: Vec<Picture>,
    /// Why it could not be made.
    pub trouble: Option<String>,
}

impl ExperimentResult {
    /// The result for programs.
    pub fn to_json(&self) -> Value {
        let table = |table: &Table| {
            json!({
                "title": table.title,
                "about": table.about,
                "columns": table.columns.iter().map(|c| json!({ "name": c.name, "unit": c.unit.name() })).collect::<Vec<_>>(),
                "rows": table.rows.iter().map(|r| json!({ "name": r.name, "printed": r.printed, "values": r.values })).collect::<Vec<_>>(),
            })
        };
        let lines = |chart: &Chart| {
            let line = |line: &super::chart::Line| json!({ "name": line.name, "points": line.points });
            json!({
                "title": chart.title,
                "x": chart.x_label,
                "y": chart.y_label,
                "lines": chart.lines.iter().map(line).collect::<Vec<_>>(),
            })
        };
        let marks = |plot: &Plot| {
            let name = |i: usize| plot.colours.iter().find(|c| c.0 == i).map(|c| c.1.clone());
            let mark = |m: &super::plot::Mark| json!({ "of": name(m.colour), "ms": m.x, "error": m.y });
            json!({ "title": plot.title, "marks": plot.marks.iter().map(mark).collect::<Vec<_>>() })
        };
        json!({
            "name": self.name,
            "title": self.title,
            "about": self.about,
            "notes": self.notes,
            "trouble": self.trouble,
            "tables": self.tables.iter().map(table).collect::<Vec<_>>(),
            "charts": self.plots.iter().flat_map(|p| &p.charts).map(lines).collect::<Vec<_>>(),
            "plots": self.plots.iter().flat_map(|p| &p.plots).map(marks).collect::<Vec<_>>(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_units() {
        assert_eq!(Unit::Count.show(203_503.0), "203,503");
        assert_eq!(Unit::Seconds.show(1.5e-6), "1.5 µs");
        assert_eq!(Unit::Seconds.show(2.42), "2.42 s");
        assert_eq!(Unit::Times.show(f64::NAN), "–");
        assert_eq!(Unit::Share.show(0.58), "58 %");
    }
}
