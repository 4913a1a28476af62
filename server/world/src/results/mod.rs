//! Results on disk: summary, probes and fields.
//!
//! [`Results`] is driven by whoever runs the simulation: begin, record after every step, finish.
//! A run that is interrupted still leaves complete files, as long as `finish` is called; what was
//! recorded up to the last second survives even a kill.

mod machine;

mod summary;

mod fields;

mod forces;

mod reactions;

use std::fs::{self, File};
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde_json::Value;
use thiserror::Error;

pub use crate::format::vtu::save_pvd as save_series;
pub use fields::write_fields;
pub use machine::Machine;
pub use summary::{BodySummary, Summary, Timing};

use crate::format::vtu;
use crate::scene::Scene;
use crate::simulation::Simulation;
use fields::write_blocks;
use forces::Forces;
use reactions::Reactions;
use summary::Running;

/// How long recorded probes may stay in memory.
const FLUSH_EVERY: Duration = Duration::from_secs(1);

/// Why results could not be written.
#[derive(Debug, Error)]
pub enum ResultsError {
    /// The disk said no.
    #[error("cannot write {}: {source}; check that the directory exists, is writable and has room", path.display())]
    Io {
        /// File or directory.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// The fields could not be written.
    #[error("cannot write {}: {source}", path.display())]
    Fields {
        /// File.
        path: PathBuf,
        /// What the writer of the fields says.
        source: vtu::VtuError,
    },
}

/// Writes the results of one run into a directory.
#[derive(Debug)]
pub struct Results {
    directory: PathBuf,
    scene: Value,
    probes: csv::Writer<BufWriter<File>>,
    forces: Option<Forces>,
    reactions: Option<Reactions>,
    flushed: Instant,
    running: Running,
    series_steps: u64,
    series: Vec<(f64, Vec<String>)>,
}

impl Results {
    /// Makes the directory and begins the files.
    ///
    /// # Errors
    /// What the disk says.
    pub fn begin(directory: &Path, scene: &Scene, simulation: &Simulation) -> Result<Self, ResultsError> {
        fs::create_dir_all(directory).map_err(at(directory))?;
        let path = directory.join("probes.csv");
        let file = File::create(&path).map_err(at(&path))?;
        let mut results = Self {
            directory: directory.to_owned(),
            scene: scene.to_json(),
            probes: csv::Writer::from_writer(BufWriter::new(file)),
            forces: Forces::begin(directory, simulation)?,
            reactions: Reactions::begin(directory, simulation)?,
            flushed: Instant::now(),
            running: Running::default(),
            series_steps: u64::from(scene.checked().series_steps),
            series: Vec::new(),
        };
        let header = ["step", "time_s", "id", "x_m", "y_m", "z_m", "ux_m", "uy_m", "uz_m"];
        results.probes.write_record(header).map_err(|error| at(&path)(error.into()))?;
        results.record_probes(simulation)?;
        results.write_summary(simulation, "running")?;
        Ok(results)
    }

    /// To be called after every step.
    ///
    /// # Errors
    /// What the disk says.
    pub fn record(&mut self, simulation: &Simulation) -> Result<(), ResultsError> {
        self.running.add(simulation);
        self.record_probes(simulation)?;
        self.forces.as_mut().map_or(Ok(()), |forces| forces.record(simulation))?;
        self.reactions.as_mut().map_or(Ok(()), |reactions| reactions.record(simulation))?;
        if self.series_steps > 0 && simulation.steps().is_multiple_of(self.series_steps) {
            self.record_fields(simulation)?;
        }
        if self.flushed.elapsed() > FLUSH_EVERY {
            self.probes.flush().map_err(at(&self.directory.join("probes.csv")))?;
            self.forces.as_mut().map_or(Ok(()), Forces::flush)?;
            self.reactions.as_mut().map_or(Ok(()), Reactions::flush)?;
            self.flushed = Instant::now();
        }
        Ok(())
    }

    /// Completes all files. `status` is `done`, or why the run ended.
    ///
    /// # Errors
    /// What the disk says.
    pub fn finish(&mut self, simulation: &Simulation, status: &str) -> Result<Summary, ResultsError> {
        self.probes.flush().map_err(at(&self.directory.join("probes.csv")))?;
        self.forces.as_mut().map_or(Ok(()), Forces::flush)?;
        self.reactions.as_mut().map_or(Ok(()), Reactions::flush)?;
        write_blocks(&self.directory, "final", simulation)
            .map_err(|(path, source)| ResultsError::Fields { path, source })?;
        if self.series_steps > 0 {
            let path = self.directory.join("series.pvd");
            vtu::save_pvd(&path, &self.series).map_err(at(&path))?;
        }
        self.write_summary(simulation, status)
    }

    fn record_probes(&mut self, simulation: &Simulation) -> Result<(), ResultsError> {
        for probe in simulation.probes() {
            let x = simulation.probe_position(probe);
            let u = x - probe.rest_m;
            let row = (simulation.steps(), simulation.time_s(), &probe.id, x.x, x.y, x.z, u.x, u.y, u.z);
            let path = || self.directory.join("probes.csv");
            self.probes.serialize(row).map_err(|error| at(&path())(error.into()))?;
        }
        Ok(())
    }

    fn record_fields(&mut self, simulation: &Simulation) -> Result<(), ResultsError> {
        let name = format!("step_{:06}", simulation.steps());
        let files = write_fields(&self.directory, &name, simulation)
            .map_err(|(path, source)| ResultsError::Fields { path, source })?;
        self.series.push((simulation.time_s(), files.to_vec()));
        Ok(())
    }

    /// Written beside and then renamed, so that a reader never sees half a file.
    fn write_summary(&self, simulation: &Simulation, status: &str) -> Result<Summary, ResultsError> {
        let summary = self.running.summary(simulation, self.scene.clone(), status);
        let path = self.directory.join("summary.json");
        let draft = self.directory.join("summary.json.part");
        let text = serde_json::to_string_pretty(&summary).map_err(|error| at(&path)(error.into()))?;
        fs::write(&draft, text + "\n").map_err(at(&draft))?;
        fs::rename(&draft, &path).map_err(at(&path))?;
        Ok(summary)
    }
}

fn at(path: &Path) -> impl Fn(io::Error) -> ResultsError + use<> {
    let path = path.to_owned();
    move |source| ResultsError::Io { path: path.clone(), source }
}
