//! `scindo export`: a recording as VTK series, glTF or CSV. States are computed again, so nothing but the recording
//! is needed, and every export is of full accuracy.

use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::Path;
use std::process::ExitCode;

use scindo_program::say;
use scindo_world::results::{save_series, write_fields};
use scindo_world::simulation::Simulation;
use serde_json::json;

use super::cli::ExportArgs;
use super::progress::Progress;
use crate::error::RuntimeError;
use crate::record::gltf::{Gltf, MAX_FRAMES};
use crate::record::reader::{Recorded, Recording};
use crate::record::replay::Replay;

/// Runs the command.
pub fn export(args: &ExportArgs) -> Result<ExitCode, RuntimeError> {
    if !(args.every.is_finite() && args.every > 0.0) {
        return Err(RuntimeError::Option {
            option: "--every",
            value: args.every.to_string(),
            reason: "a time between frames must be positive".to_owned(),
            next: "Leave it out for 0.1".to_owned(),
        });
    }
    // Read once for its length: key frames are spread over all of it, and the last step is always a frame.
    let steps = count(&args.file)?;
    let mut replay = Replay::open(&args.file, usize::from(args.threads), None)?;
    let step_s = replay.simulation().step_s();
    let mut series = args.vtu.as_deref().map(Series::begin).transpose()?;
    let mut gltf = args.gltf.as_ref().map(|_| Gltf::new());
    let mut forces = args.csv.as_deref().map(Forces::begin).transpose()?;
    let every = ((args.every / step_s).round() as u64).max(1);
    // One less than a file may hold, because the last step is a frame in any case.
    let key = steps.div_ceil(MAX_FRAMES as u64 - 1).max(1);
    let progress = Progress::begin("steps", Some(steps), args.json);
    let mut next = Some(0);
    while let Some(number) = next {
        let is_last = number == steps;
        if let Some(series) = series.as_mut().filter(|_| number.is_multiple_of(every) || is_last) {
            // Not by the time of the simulation, which a reset sets back.
            series.add(number as f64 * step_s, replay.simulation())?;
        }
        if let Some(gltf) = gltf.as_mut().filter(|_| number.is_multiple_of(key) || is_last) {
            gltf.add(replay.simulation_mut());
        }
        if let Some(forces) = forces.as_mut().filter(|_| number > 0) {
            forces.add(number, replay.simulation())?;
        }
        progress.at(number);
        next = replay.step()?;
    }
    progress.end();
    let frames = series.as_ref().map(|series| series.frames.len());
    let key_frames = gltf.as_ref().map(Gltf::frames);
    if let Some(series) = &series {
        series.end()?;
    }
    if let (Some(gltf), Some(path)) = (gltf, &args.gltf) {
        gltf.save(path)?;
    }
    if let Some(forces) = forces {
        forces.end()?;
    }
    if args.json {
        let report = json!({ "exported": {
            "steps": steps, "frames": frames, "key_frames": key_frames, "truncated": replay.found().truncated,
            "first_difference": replay.found().first_difference,
        }});
        say!("{report}");
        return Ok(ExitCode::SUCCESS);
    }
    // The states are what this build makes of the inputs, so the export stands and says so.
    if let Some(first) = &replay.found().first_difference {
        tracing::warn!("from step {} on, the states are not those that were recorded", first.number);
    }
    say!("exported {steps} steps");
    if let (Some(directory), Some(frames)) = (&args.vtu, frames) {
        say!("  {}/series.pvd, {frames} frames", directory.display());
    }
    if let (Some(path), Some(frames)) = (&args.gltf, key_frames) {
        say!("  {}, {frames} key frames", path.display());
    }
    if let Some(path) = &args.csv {
        say!("  {}", path.display());
    }
    Ok(ExitCode::SUCCESS)
}

/// Steps in a recording.
fn count(path: &Path) -> Result<u64, RuntimeError> {
    let mut recording = Recording::open(path)?;
    recording.scene()?;
    let mut steps = 0;
    while let Some(message) = recording.next_message()? {
        if let Recorded::Step(step) = message {
            steps = step.number;
        }
    }
    Ok(steps)
}

fn failed(file: &Path, reason: &dyn std::error::Error) -> RuntimeError {
    RuntimeError::Export { file: file.display().to_string(), reason: reason.to_string() }
}

/// A ParaView series in the making.
struct Series<'a> {
    directory: &'a Path,
    frames: Vec<(f64, Vec<String>)>,
}

impl<'a> Series<'a> {
    fn begin(directory: &'a Path) -> Result<Self, RuntimeError> {
        fs::create_dir_all(directory).map_err(|e| failed(directory, &e))?;
        Ok(Self { directory, frames: Vec::new() })
    }

    fn add(&mut self, time_s: f64, simulation: &Simulation) -> Result<(), RuntimeError> {
        let name = format!("frame-{:06}", self.frames.len());
        let files = write_fields(self.directory, &name, simulation).map_err(|(file, e)| failed(&file, &e))?;
        self.frames.push((time_s, files.into()));
        Ok(())
    }

    fn end(&self) -> Result<(), RuntimeError> {
        let path = self.directory.join("series.pvd");
        save_series(&path, &self.frames).map_err(|e| failed(&path, &e))
    }
}

/// A table of forces in the making.
struct Forces<'a> {
    path: &'a Path,
    out: BufWriter<File>,
}

impl<'a> Forces<'a> {
    fn begin(path: &'a Path) -> Result<Self, RuntimeError> {
        let mut out = BufWriter::new(File::create(path).map_err(|e| failed(path, &e))?);
        let head = "number,step,time_s,tool,owner,x_m,y_m,z_m,qx,qy,qz,qw,fx_n,fy_n,fz_n";
        writeln!(out, "{head}").map_err(|e| failed(path, &e))?;
        Ok(Self { path, out })
    }

    fn add(&mut self, number: u64, simulation: &Simulation) -> Result<(), RuntimeError> {
        let (step, time_s) = (simulation.steps(), simulation.time_s());
        for tool in simulation.tools().iter() {
            let (x, q, f) = (tool.pose.translation.vector, tool.pose.rotation.quaternion(), tool.force_n);
            // Names hold no character that CSV would have to quote.
            let line = format!(
                "{number},{step},{time_s},{},{},{},{},{},{},{},{},{},{},{},{}",
                tool.id, tool.owner, x.x, x.y, x.z, q.i, q.j, q.k, q.w, f.x, f.y, f.z
            );
            writeln!(self.out, "{line}").map_err(|e| failed(self.path, &e))?;
        }
        Ok(())
    }

    fn end(mut self) -> Result<(), RuntimeError> {
        self.out.flush().map_err(|e| failed(self.path, &e))
    }
}
