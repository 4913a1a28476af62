//! Requests to end this program from outside.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use tokio::signal::unix::{Signal, SignalKind, signal};

use crate::error::RuntimeError;

/// Ctrl-C and requests to terminate. One that comes while nobody waits for it is kept for the next who does.
pub struct Signals {
    interrupt: Signal,
    terminate: Signal,
}

impl Signals {
    /// Begins to listen; neither signal ends the program from now on. For a thread that has entered a runtime.
    ///
    /// # Errors
    /// If the system does not let this program listen.
    pub fn listen() -> Result<Self, RuntimeError> {
        let failed = |e: std::io::Error| RuntimeError::System {
            what: "listening for signals".to_owned(),
            reason: e.to_string(),
        };
        Ok(Self {
            interrupt: signal(SignalKind::interrupt()).map_err(failed)?,
            terminate: signal(SignalKind::terminate()).map_err(failed)?,
        })
    }

    /// Waits for either.
    pub async fn either(&mut self) {
        tokio::select! {
            _ = self.interrupt.recv() => {}
            _ = self.terminate.recv() => {}
        }
    }

    /// Waits for Ctrl-C.
    pub async fn interrupt(&mut self) {
        let _ = self.interrupt.recv().await;
    }
}

/// Raises `stop` at the first Ctrl-C or request to terminate. A second Ctrl-C ends the program.
///
/// # Errors
/// The system does not let this program listen.
pub fn listen(stop: &Arc<AtomicBool>) -> Result<(), RuntimeError> {
    let failed = |e: std::io::Error| RuntimeError::System {
        what: "listening for signals".to_owned(),
        reason: e.to_string(),
    };
    let stop = stop.clone();
    let signals = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(failed)?;
    let wait = move || {
        signals.block_on(async {
            let Ok(mut requests) = Signals::listen() else { return };
            requests.either().await;
            stop.store(true, Ordering::Relaxed);
            requests.interrupt().await;
            std::process::exit(130);
        });
    };
    std::thread::Builder::new().name("signals".to_owned()).spawn(wait).map_err(failed)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    /// A loop that also does other things does not wait all the time.
    #[tokio::test]
    async fn a_request_is_heard_by_who_waits_later() {
        let mut signals = Signals::listen().unwrap();
        for name in ["INT", "TERM"] {
            let kill = format!("kill -{name} {}", std::process::id());
            assert!(std::process::Command::new("sh").args(["-c", &kill]).status().unwrap().success());
            tokio::time::sleep(Duration::from_millis(50)).await;
            tokio::time::timeout(Duration::from_secs(10), signals.either()).await.expect(name);
        }
    }
}
