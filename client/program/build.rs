//! Writes version and commit into the programs. Without git, and in builds for development, which would otherwise be
//! made anew after every commit, the version stands alone.

mod commit;

use std::env;
use std::path::PathBuf;

fn main() {
    println!("cargo::rerun-if-env-changed=SCINDO_COMMIT");
    let version = env::var("CARGO_PKG_VERSION").unwrap_or_default();
    let told = env::var("SCINDO_COMMIT").ok().filter(|commit| !commit.is_empty());
    let commit = told.or_else(|| {
        let folder = PathBuf::from(env::var("CARGO_MANIFEST_DIR").ok()?);
        let optimised = env::var("PROFILE").is_ok_and(|profile| profile == "release");
        let found = commit::of(&folder).filter(|_| optimised)?;
        found.files.iter().for_each(|file| println!("cargo::rerun-if-changed={}", file.display()));
        Some(found.name)
    });
    let version = commit.map_or(version.clone(), |commit| format!("{version} ({commit})"));
    println!("cargo::rustc-env=SCINDO_VERSION={version}");
}
