//! Forces of contact on disk: a row for everything that pushed something in a step.

use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use nalgebra::Vector3;

use super::{ResultsError, at};
use crate::simulation::Simulation;

/// Writes `contacts.csv`, if the scene has anything that may touch.
#[derive(Debug)]
pub(super) struct Forces {
    path: PathBuf,
    file: csv::Writer<BufWriter<File>>,
}

/// What pushes, what is pushed, how many vertices are, how deep, and with what force.
#[derive(Debug, Clone, Copy)]
pub(super) struct Row<'a> {
    /// `tool`, `obstacle`, `body` or `itself`.
    pub kind: &'static str,
    /// The tool or body that is pushed.
    pub on: &'a str,
    /// What pushes it; empty for a tool.
    pub by: &'a str,
    pub contacts: u32,
    pub deepest_m: f64,
    pub force_n: Vector3<f64>,
    pub normal_n: f64,
}

/// Hands everything that pushed something in the last step to `take`.
///
/// # Errors
/// Those of `take`.
pub(super) fn each_contact<E>(
    simulation: &Simulation,
    mut take: impl FnMut(&Row<'_>) -> Result<(), E>,
) -> Result<(), E> {
    let name = |body: usize| &*simulation.bodies()[body].id;
    for tool in simulation.tools().iter().filter(|tool| tool.force_n != Vector3::zeros()) {
        let (force_n, normal_n) = (tool.force_n, (tool.force_n - tool.friction_n).norm());
        take(&Row { kind: "tool", on: &tool.id, by: "", contacts: 0, deepest_m: 0.0, force_n, normal_n })?;
    }
    for body in 0..simulation.bodies().len() {
        let each = simulation.rest_reports(body).iter().zip(simulation.obstacles());
        for (report, obstacle) in each.filter(|(report, _)| report.contacts > 0) {
            take(&Row {
                kind: "obstacle",
                on: name(body),
                by: &obstacle.id,
                contacts: report.contacts,
                deepest_m: report.deepest_m,
                force_n: report.force_n,
                normal_n: report.normal_n,
            })?;
        }
    }
    for report in simulation.touch_reports() {
        let [on, by] = report.bodies.map(|body| name(body as usize));
        take(&Row {
            kind: if on == by { "itself" } else { "body" },
            on,
            by,
            contacts: report.contacts,
            deepest_m: report.deepest_m,
            force_n: report.force_n,
            normal_n: report.normal_n,
        })?;
    }
    Ok(())
}

impl Forces {
    /// Begins the file; `None` for a scene in which nothing touches.
    ///
    /// # Errors
    /// What the disk says.
    pub(super) fn begin(directory: &Path, simulation: &Simulation) -> Result<Option<Self>, ResultsError> {
        let plan = simulation.plan();
        let touches = plan.effects.iter().any(|effect| {
            let name = effect.name.as_str();
            let contact = name.starts_with("contact ") || name == "obstacles";
            effect.on && (contact || name == "self-collision" || name == "body-body contact")
        });
        if !touches {
            return Ok(None);
        }
        let path = directory.join("contacts.csv");
        let file = File::create(&path).map_err(at(&path))?;
        let mut file = csv::Writer::from_writer(BufWriter::new(file));
        let header = [
            "step",
            "time_s",
            "kind",
            "on",
            "by",
            "contacts",
            "deepest_m",
            "fx_n",
            "fy_n",
            "fz_n",
            "normal_n",
        ];
        file.write_record(header).map_err(|error| at(&path)(error.into()))?;
        Ok(Some(Self { path, file }))
    }

    /// Adds the contacts of the last step.
    ///
    /// # Errors
    /// What the disk says.
    pub(super) fn record(&mut self, simulation: &Simulation) -> Result<(), ResultsError> {
        each_contact(simulation, |row| self.write(simulation, row))
    }

    /// Writes what is in memory.
    ///
    /// # Errors
    /// What the disk says.
    pub(super) fn flush(&mut self) -> Result<(), ResultsError> {
        self.file.flush().map_err(at(&self.path))
    }

    fn write(&mut self, simulation: &Simulation, row: &Row<'_>) -> Result<(), ResultsError> {
        let Row { kind, on, by, contacts, deepest_m, force_n: f, normal_n } = *row;
        let when = (simulation.steps(), simulation.time_s());
        let record = (when, kind, on, by, contacts, deepest_m, [f.x, f.y, f.z], normal_n);
        self.file.serialize(record).map_err(|error| at(&self.path)(error.into()))
    }
}
