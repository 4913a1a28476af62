//! Forces that hold and displace places of bodies, on disk: a row per place and step, for as long as displacements or
//! loads of the body change.

use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use super::{ResultsError, at};
use crate::body::SimBody;
use crate::simulation::Simulation;

/// Writes `reactions.csv`, if displacements or loads of the scene change over time.
#[derive(Debug)]
pub(super) struct Reactions {
    path: PathBuf,
    file: csv::Writer<BufWriter<File>>,
}

impl Reactions {
    /// Begins the file; `None` for a scene in which nothing changes.
    ///
    /// # Errors
    /// What the disk says.
    pub(super) fn begin(directory: &Path, simulation: &Simulation) -> Result<Option<Self>, ResultsError> {
        if !simulation.bodies().iter().any(|body| body.settled_s() > 0.0) {
            return Ok(None);
        }
        let path = directory.join("reactions.csv");
        let file = File::create(&path).map_err(at(&path))?;
        let mut file = csv::Writer::from_writer(BufWriter::new(file));
        let header = ["step", "time_s", "body", "fix", "displacement_share", "fx_n", "fy_n", "fz_n"];
        file.write_record(header).map_err(|error| at(&path)(error.into()))?;
        Ok(Some(Self { path, file }))
    }

    /// Adds the forces at the end of the last step.
    ///
    /// # Errors
    /// What the disk says.
    pub(super) fn record(&mut self, simulation: &Simulation) -> Result<(), ResultsError> {
        let when = (simulation.steps(), simulation.time_s());
        // The step that reaches the end of a table may end an instant after it.
        let changed = |body: &&SimBody| when.1 < body.settled_s() + simulation.scene().step_s;
        for body in simulation.bodies().iter().filter(|body| body.settled_s() > 0.0).filter(changed) {
            let share = body.displacement.share(when.1);
            for (fix, force) in body.reactions(simulation.scene().gravity_m_s2).into_iter().enumerate() {
                let force: [f64; 3] = force.into();
                let row = (when, &*body.id, fix, share, force);
                self.file.serialize(row).map_err(|error| at(&self.path)(error.into()))?;
            }
        }
        Ok(())
    }

    /// Writes what is in memory.
    ///
    /// # Errors
    /// What the disk says.
    pub(super) fn flush(&mut self) -> Result<(), ResultsError> {
        self.file.flush().map_err(at(&self.path))
    }
}
