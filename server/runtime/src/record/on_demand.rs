//! Recordings that an operator begins and ends while the server runs.

use std::path::{Path, PathBuf};
use std::thread::JoinHandle;
use std::time::SystemTime;

use humantime::format_rfc3339_seconds;
use scindo_proto::messages::RecordingStats;
use scindo_world::simulation::Simulation;

use super::recorder::{RecordSettings, Recorder};
use crate::error::RuntimeError;

/// Recordings of one scene that begin within a second need names of their own.
const MOST_OF_A_SECOND: u32 = 100;

/// Where recordings of clients go, and how they are made.
#[derive(Debug, Clone)]
pub struct RecordFolder {
    /// The folder, which exists.
    pub folder: PathBuf,
    /// Settings of each recording; the name of the file is chosen when it begins.
    pub settings: RecordSettings,
}

impl RecordFolder {
    /// Begins a recording, and names its file after scene and time.
    ///
    /// # Errors
    /// The file cannot be made, or the state cannot be written.
    pub fn begin(&self, simulation: &Simulation) -> Result<Recorder, RuntimeError> {
        let stem = stem(simulation.source().name(), SystemTime::now());
        let mut n = 1;
        let file = loop {
            let file = match n {
                1 => self.folder.join(format!("{stem}.mcap")),
                n => self.folder.join(format!("{stem}-{n}.mcap")),
            };
            if n == MOST_OF_A_SECOND || !file.exists() {
                break file;
            }
            n += 1;
        };
        Recorder::begin(RecordSettings { file, ..self.settings.clone() }, simulation)
    }
}

/// Beginning of a file name: letters and digits of the scene's name, and the time.
pub fn stem(scene: &str, at: SystemTime) -> String {
    let safe = |c: char| if c.is_ascii_alphanumeric() || c == '_' { c } else { '-' };
    let scene: String = scene.chars().take(64).map(safe).collect();
    let scene = scene.trim_matches('-');
    let scene = if scene.is_empty() { "scene" } else { scene };
    format!("{scene}-{}", format_rfc3339_seconds(at).to_string().replace(':', "-"))
}

/// Recordings that were ended. Their last messages are written while the simulation goes on.
#[derive(Debug, Default)]
pub struct Ending {
    threads: Vec<(RecordingStats, JoinHandle<Result<(), RuntimeError>>)>,
}

impl Ending {
    /// Ends a recording in a thread of its own.
    ///
    /// # Errors
    /// The system has no thread left, and what the disk says.
    pub fn end(&mut self, mut recorder: Recorder) -> Result<(), RuntimeError> {
        let progress = recorder.progress();
        let failed = |e: std::io::Error| RuntimeError::System {
            what: "starting a thread".to_owned(),
            reason: e.to_string(),
        };
        let thread = std::thread::Builder::new().name("record-end".to_owned());
        let thread = thread.spawn(move || recorder.end()).map_err(failed)?;
        self.threads.push((progress, thread));
        Ok(())
    }

    /// The next recording whose file is complete, or why it is not; `wait` waits for it.
    pub fn ended(&mut self, wait: bool) -> Option<(RecordingStats, Result<(), RuntimeError>)> {
        let at = self.threads.iter().position(|(_, thread)| wait || thread.is_finished())?;
        let (progress, thread) = self.threads.swap_remove(at);
        let died = RuntimeError::Died { thread: "record-end".to_owned() };
        Some((progress, thread.join().unwrap_or(Err(died))))
    }
}

/// Checks that recordings can be written into `folder`, which is made if it does not exist.
///
/// # Errors
/// What the system says.
pub fn prepare(folder: &Path) -> Result<(), RuntimeError> {
    std::fs::create_dir_all(folder).map_err(|e| RuntimeError::Option {
        option: "--recordings",
        value: folder.display().to_string(),
        reason: format!("the folder cannot be made: {e}"),
        next: "Name a folder that this user may write to".to_owned(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn file_names_hold_only_harmless_characters() {
        let at = SystemTime::UNIX_EPOCH;
        assert_eq!(stem("kidney", at), "kidney-1970-01-01T00-00-00Z");
        assert_eq!(stem("../Leber 3°", at), "Leber-3-1970-01-01T00-00-00Z");
        assert_eq!(stem("…", at), "scene-1970-01-01T00-00-00Z");
    }
}
