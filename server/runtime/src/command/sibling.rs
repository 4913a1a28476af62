//! Programs beside this one that run some of its commands.

use std::env::{self, consts::EXE_SUFFIX};
use std::io::ErrorKind;
use std::os::unix::process::CommandExt as _;
use std::path::PathBuf;
use std::process::Command;

use crate::error::RuntimeError;

/// Replaces this program by `program`, with the same arguments: the one beside this program, else the one on the PATH.
/// Signals, output and exit code are then those of `program`. Returns only if that fails.
pub(super) fn run(program: &'static str, command: &'static str) -> RuntimeError {
    let beside = beside(program).filter(|path| path.exists());
    let found = beside.unwrap_or_else(|| PathBuf::from(program));
    let error = Command::new(&found).args(env::args_os().skip(1)).exec();
    match error.kind() {
        ErrorKind::NotFound => RuntimeError::NoSibling { program, command },
        _ => {
            RuntimeError::System { what: format!("starting {}", found.display()), reason: error.to_string() }
        }
    }
}

fn beside(program: &str) -> Option<PathBuf> {
    Some(env::current_exe().ok()?.parent()?.join(format!("{program}{EXE_SUFFIX}")))
}
