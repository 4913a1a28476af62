//! `scindo router` passes messages on until it is told to stop.

use std::process::ExitCode;

use scindo_program::say;

use super::cli::RouterArgs;
use super::signals::Signals;
use crate::error::RuntimeError;
use crate::wire::session::{NetworkConfig, router};

/// Listens, and says where.
pub fn route(args: &RouterArgs) -> Result<ExitCode, RuntimeError> {
    let network = NetworkConfig {
        listen: args.listen.clone(),
        connect: args.connect.clone(),
        zenoh_file: args.zenoh.clone(),
        ..NetworkConfig::default()
    };
    let failed =
        |e: std::io::Error| RuntimeError::System { what: "waiting".to_owned(), reason: e.to_string() };
    let waiting = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(failed)?;
    let session = router(&network, (args.longest_message as usize) << 20, args.connections)?;
    say!("scindo {}: router", env!("CARGO_PKG_VERSION"));
    say!("  at       {}", args.listen.join(", "));
    if !args.connect.is_empty() {
        say!("  joins    {}", args.connect.join(", "));
    }
    waiting.block_on(async {
        Signals::listen()?.either().await;
        Ok::<_, RuntimeError>(())
    })?;
    drop(session);
    Ok(ExitCode::SUCCESS)
}
