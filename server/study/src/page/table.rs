//! `points.csv`: one line per point, written as soon as a case is finished.

use std::fs::{File, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};

use crate::case::Case;
use crate::design::axes::Factor;
use crate::result::{Outcome, StudyResult};
use crate::trial::wear::CUTS;

/// An open `points.csv`.
#[derive(Debug)]
pub struct Table {
    path: PathBuf,
    lines: csv::Writer<File>,
}

/// Columns after the factors.
const FIGURES: [&str; 20] = [
    "status",
    "reason",
    "elements",
    "unknowns",
    "setup_ms",
    "first_ms",
    "median_ms",
    "p99_ms",
    "repeats",
    "error_l2",
    "error_energy",
    "error_energy_norm",
    "error_goal",
    "goal_m",
    "energy_j",
    "iterations",
    "residual",
    "quality_1_cut",
    "quality_10_cuts",
    "quality_100_cuts",
];

type Broken = (PathBuf, io::Error);

impl Table {
    /// Creates the file. Points taken over from an earlier study are written again.
    ///
    /// # Errors
    /// The file and the message of the system.
    pub fn begin(directory: &Path) -> Result<Self, Broken> {
        let path = directory.join("points.csv");
        let file = OpenOptions::new().create(true).write(true).truncate(true).open(&path);
        let file = file.map_err(|error| (path.clone(), error))?;
        let mut table = Self { path, lines: csv::Writer::from_writer(file) };
        let factors = Factor::ALL.iter().map(|factor| factor.name());
        table.write(
            ["case"]
                .into_iter()
                .chain(factors)
                .chain(FIGURES)
                .chain(["front", "dominant"])
                .map(str::to_owned)
                .collect(),
        )?;
        Ok(table)
    }

    /// Writes the whole table, including columns known only at the end: front and dominant error.
    ///
    /// # Errors
    /// The file and the message of the system.
    pub fn whole(directory: &Path, study: &StudyResult) -> Result<(), Broken> {
        let mut table = Self::begin(directory)?;
        for result in &study.cases {
            for (i, point) in result.points.iter().enumerate() {
                table.write(line(&result.case, point, Some(result.front.contains(&i))))?;
            }
        }
        Ok(())
    }

    fn write(&mut self, fields: Vec<String>) -> Result<(), Broken> {
        let written = self.lines.write_record(fields).map_err(io::Error::from);
        written.and_then(|()| self.lines.flush()).map_err(|error| (self.path.clone(), error))
    }
}

fn line(case: &Case, point: &Outcome, on_front: Option<bool>) -> Vec<String> {
    let trial = &point.trial;
    let cost = &trial.cost;
    let mut fields = vec![case.name.clone()];
    fields.extend(Factor::ALL.iter().map(|factor| point.configuration.label(*factor).to_owned()));
    fields.extend([trial.status.name().to_owned(), trial.reason.clone()]);
    fields.extend([trial.elements.to_string(), trial.unknowns.to_string()]);
    let times = [cost.setup_ms, cost.first_ms, cost.median_ms, cost.p99_ms];
    fields.extend(times.map(|ms| if cost.count > 0 { format!("{ms:.4}") } else { String::new() }));
    fields.push(cost.count.to_string());
    let errors = point.errors.map(|e| [e.l2, e.energy, e.energy_norm(), e.goal]);
    fields.extend((0..4).map(|i| errors.map_or(String::new(), |e| format!("{:.6e}", e[i]))));
    let results = trial.is_done().then(|| [case.goal.of(&trial.series), last(&trial.series.energy_j)]);
    fields.extend((0..2).map(|i| results.map_or(String::new(), |r| format!("{:.9e}", r[i]))));
    fields.extend([format!("{:.1}", trial.iterations), format!("{:.3e}", trial.residual)]);
    let after = |cuts: usize| trial.wear.iter().find(|wear| wear.cuts == cuts);
    fields.extend(CUTS.map(|cuts| after(cuts).map_or(String::new(), |wear| format!("{:.6}", wear.quality))));
    fields.push(on_front.map_or(String::new(), |on| on.to_string()));
    let dominant = point.sources.as_ref().and_then(|sources| sources.dominant());
    fields.push(dominant.map_or(String::new(), |source| source.name().to_owned()));
    fields
}

fn last(values: &[f64]) -> f64 {
    values.last().copied().unwrap_or(f64::NAN)
}
