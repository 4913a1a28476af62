//! The commands, one file each.

use std::process::ExitCode;

use clap::Parser;

use crate::cli::{Cli, Command};
use crate::error::RuntimeError;

pub mod run;

pub mod check;

pub mod mesh;

pub mod accuracy;

pub mod stress;

/// Parses, runs, and turns the outcome into an exit code: the one place that does.
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    start_log();
    let json = match &cli.command {
        None => cli.demonstration.json,
        Some(Command::Run(args)) => args.serve.json,
        Some(Command::Check(args)) => args.json,
        Some(Command::Mesh(args)) => args.json,
        Some(Command::Accuracy(args)) => args.json,
        Some(Command::Stress(args)) => args.json,
    };
    let outcome = match cli.command {
        None => run::demonstration(&cli.demonstration),
        Some(Command::Run(args)) => run::scene(&args),
        Some(Command::Check(args)) => check::check(&args),
        Some(Command::Mesh(args)) => mesh::mesh(&args),
        Some(Command::Accuracy(args)) => accuracy::accuracy(&args),
        Some(Command::Stress(args)) => stress::stress(&args),
    };
    match outcome {
        Ok(code) => code,
        Err(error) => {
            report(&error, json);
            error.exit_code()
        }
    }
}

fn report(error: &RuntimeError, json: bool) {
    if json {
        let report = serde_json::json!({ "error": { "code": error.code(), "message": error.to_string() } });
        println!("{report}");
    } else {
        eprintln!("error: {error}");
    }
}

fn start_log() {
    let filter = tracing_subscriber::EnvFilter::try_from_env("SCINDO_LOG").unwrap_or_else(|_| {
        tracing_subscriber::EnvFilter::new(
            "error,scindo=info,scindo_world=info,scindo_view=info,scindo_client=warn",
        )
    });
    let colours = std::io::IsTerminal::is_terminal(&std::io::stderr());
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .with_ansi(colours)
        .with_target(false)
        .init();
}
