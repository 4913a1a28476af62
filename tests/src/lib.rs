//! What tests over the network share: patience, free ports, the built programs, and child processes that end with
//! the test.

pub mod random_scene;

pub mod scene;

pub mod relay;

use std::io;
use std::net::TcpListener;
use std::path::PathBuf;
use std::process::{Child, Command, Output, Stdio};
use std::sync::atomic::{AtomicU16, Ordering};
use std::time::Duration;

/// How long a test waits for what must come, however busy the machine is: longer only when something hangs.
pub const PATIENCE: Duration = Duration::from_secs(60);

/// Path of one of the workspace's programs, built into the directory that holds the running test.
///
/// # Panics
/// When the program has not been built (`cargo build --workspace --bins`).
#[must_use]
pub fn program(name: &str) -> PathBuf {
    let test = std::env::current_exe().expect("a running test has a path");
    let directory =
        test.parent().and_then(|deps| deps.parent()).expect("tests stand in <target>/<profile>/deps");
    let path = directory.join(name);
    assert!(path.exists(), "{} is missing: run `cargo build --workspace --bins` first", path.display());
    path
}

/// A TCP port on loopback that is free together with the next one, where a server sends its surfaces.
///
/// Below the ports that the system gives to outgoing connections: none of those takes it meanwhile.
///
/// # Panics
/// When no such pair is left.
#[must_use]
pub fn free_pair() -> u16 {
    static NEXT: AtomicU16 = AtomicU16::new(0);
    let start = (std::process::id() % 1000) as u16 * 10;
    let free = |port: &u16| (0..2).all(|next| TcpListener::bind(("127.0.0.1", port + next)).is_ok());
    let tried =
        std::iter::repeat_with(|| 10_000 + (start + 2 * NEXT.fetch_add(1, Ordering::Relaxed)) % 10_000);
    tried.take(5000).find(free).expect("two free ports side by side")
}

/// Runs a program to its end and returns what it printed and its exit code.
///
/// # Errors
/// When it cannot be started.
pub fn run(name: &str, arguments: &[&str]) -> io::Result<Output> {
    Command::new(program(name)).args(arguments).stdin(Stdio::null()).output()
}

/// A child process that is killed when the test is done with it.
pub struct Running(pub Child);

impl Running {
    /// Starts a program in the background.
    ///
    /// # Errors
    /// When it cannot be started.
    pub fn start(name: &str, arguments: &[&str]) -> io::Result<Self> {
        let child = Command::new(program(name)).args(arguments).stdin(Stdio::null()).spawn()?;
        Ok(Self(child))
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // The child may have ended by itself; either way it is reaped.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}
