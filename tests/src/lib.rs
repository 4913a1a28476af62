//! What the end-to-end tests share: the built programs, free ports, and child processes that end with the test.

use std::io;
use std::net::TcpListener;
use std::path::PathBuf;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

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

/// A TCP port on loopback that was free a moment ago.
///
/// # Errors
/// When no port can be bound.
pub fn free_port() -> io::Result<u16> {
    Ok(TcpListener::bind(("127.0.0.1", 0))?.local_addr()?.port())
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

/// Asks `done` every 20 ms until it says yes or the time is over; returns its last answer.
pub fn eventually(limit: Duration, mut done: impl FnMut() -> bool) -> bool {
    let end = Instant::now() + limit;
    while Instant::now() < end {
        if done() {
            return true;
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    done()
}
