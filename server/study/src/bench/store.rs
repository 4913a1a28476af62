//! Finished runs stay on disk. Every run is appended as it ends, and a study that is started again with the
//! same directory reads it back.
//!
//! `runs.jsonl` holds a line on the machine and the build, then one line per run. Times of another machine or
//! build mean nothing here, so a file with a different first line is renamed.

use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions};
use std::io::{self, BufRead, BufReader, Write};
use std::path::{Path, PathBuf};

use scindo_world::results::Machine;
use serde::{Deserialize, Serialize};

use crate::trial::Trial;

/// Build and machine; times depend on both.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Origin {
    /// Version of the program.
    pub version: String,
    /// Commit that the program was built from.
    pub commit: String,
    /// Processor and system.
    pub machine: Machine,
}

impl Origin {
    /// This build on this machine.
    pub fn here() -> Self {
        Self {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            commit: env!("SCINDO_COMMIT").to_owned(),
            machine: Machine::here(),
        }
    }
}

#[derive(Serialize, Deserialize)]
struct Line {
    key: String,
    trial: Trial,
}

/// The runs of a study, in memory and on disk.
#[derive(Debug)]
pub struct Store {
    runs: BTreeMap<String, Trial>,
    file: File,
    /// Number of runs read from an earlier study.
    pub resumed: usize,
}

impl Store {
    /// Opens the runs in `directory`, which is created if missing.
    ///
    /// # Errors
    /// A file or directory that the system cannot read or write.
    pub fn open(directory: &Path, origin: &Origin) -> Result<Self, (PathBuf, io::Error)> {
        fs::create_dir_all(directory).map_err(|e| (directory.to_owned(), e))?;
        let path = directory.join("runs.jsonl");
        let at = |e| (path.clone(), e);
        let header = serde_json::to_string(origin).map_err(|e| at(e.into()))?;
        let runs = read(&path, &header).map_err(at)?;
        let fresh = runs.is_none();
        if fresh && path.exists() {
            fs::rename(&path, directory.join("runs.old.jsonl")).map_err(at)?;
        }
        let mut file = OpenOptions::new().create(true).append(true).open(&path).map_err(at)?;
        if fresh {
            writeln!(file, "{header}").map_err(at)?;
        } else {
            // Ends a line that a kill cut short. Empty lines are ignored.
            writeln!(file).map_err(at)?;
        }
        let runs = runs.unwrap_or_default();
        Ok(Self { resumed: runs.len(), runs, file })
    }

    /// Looks up a finished run.
    pub fn get(&self, key: &str) -> Option<&Trial> {
        self.runs.get(key)
    }

    /// Stores a finished run.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn put(&mut self, key: &str, trial: &Trial) -> io::Result<()> {
        let line = Line { key: key.to_owned(), trial: trial.clone() };
        writeln!(self.file, "{}", serde_json::to_string(&line)?)?;
        self.runs.insert(line.key, line.trial);
        Ok(())
    }
}

/// Reads the runs of a file that begins with `header`; `None` if there is no such file. A last line that a
/// kill cut short is dropped.
fn read(path: &Path, header: &str) -> io::Result<Option<BTreeMap<String, Trial>>> {
    let file = match File::open(path) {
        Ok(file) => file,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(error),
    };
    let mut lines = BufReader::new(file).lines();
    if lines.next().transpose()?.as_deref() != Some(header) {
        return Ok(None);
    }
    let mut runs = BTreeMap::new();
    for line in lines {
        if let Ok(Line { key, trial }) = serde_json::from_str(&line?) {
            runs.insert(key, trial);
        }
    }
    Ok(Some(runs))
}

/// A short name for a text: its 64-bit FNV-1a hash in hexadecimal.
pub fn fingerprint(text: &str) -> String {
    let hash = text
        .bytes()
        .fold(0xcbf2_9ce4_8422_2325_u64, |h, byte| (h ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3));
    format!("{hash:016x}")
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn finished_runs_are_found_again() {
        let directory = tempfile::tempdir().unwrap();
        let origin = Origin::here();
        let mut store = Store::open(directory.path(), &origin).unwrap();
        let mut trial = Trial::refused("no".into());
        trial.cost.median_ms = 0.1 + 0.2;
        store.put("a", &trial).unwrap();
        drop(store);
        // Simulates a kill in the middle of a line.
        let path = directory.path().join("runs.jsonl");
        let mut file = OpenOptions::new().append(true).open(&path).unwrap();
        write!(file, "{{\"key\":\"b\",\"tri").unwrap();
        drop(file);
        let mut store = Store::open(directory.path(), &origin).unwrap();
        assert_eq!((store.resumed, store.get("a"), store.get("b")), (1, Some(&trial), None));
        store.put("b", &trial).unwrap();
        assert_eq!(Store::open(directory.path(), &origin).unwrap().resumed, 2);
    }

    #[test]
    fn runs_of_another_build_are_put_aside() {
        let directory = tempfile::tempdir().unwrap();
        let origin = Origin::here();
        Store::open(directory.path(), &origin).unwrap().put("a", &Trial::refused(String::new())).unwrap();
        let other = Origin { commit: "another".into(), ..origin };
        let store = Store::open(directory.path(), &other).unwrap();
        assert_eq!(store.resumed, 0);
        assert!(directory.path().join("runs.old.jsonl").exists());
    }
}
