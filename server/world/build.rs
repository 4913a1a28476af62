//! Gives the crate the hash of the sources that its checkpoints follow: another build may order a state differently.

use std::collections::hash_map::DefaultHasher;
use std::hash::{Hash, Hasher};
use std::path::{Path, PathBuf};
use std::{fs, io};

/// Folders whose types and arithmetic a state depends on, relative to this crate.
const SOURCES: [&str; 5] = ["src", "../matter/src", "../algebra/src", "../physics/src", "../collision/src"];

fn main() -> io::Result<()> {
    let mut hash = DefaultHasher::new();
    for folder in SOURCES {
        println!("cargo:rerun-if-changed={folder}");
        let mut files = Vec::new();
        list(Path::new(folder), &mut files)?;
        files.sort();
        for file in files {
            file.hash(&mut hash);
            fs::read(&file)?.hash(&mut hash);
        }
    }
    println!("cargo:rustc-env=SCINDO_STATE={:016x}", hash.finish());
    Ok(())
}

fn list(folder: &Path, files: &mut Vec<PathBuf>) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            list(&path, files)?;
        } else {
            files.push(path);
        }
    }
    Ok(())
}
