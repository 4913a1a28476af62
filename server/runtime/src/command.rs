//! The commands, one file each.

use std::process::ExitCode;

use clap::Parser;
use scindo_program::Manual;

use crate::error::RuntimeError;
use cli::{Cli, Command};

pub mod cli;

mod say;

mod signals;

pub mod progress;

pub mod run;

pub mod replay;

pub mod export;

pub mod check;

pub mod mesh;

pub mod accuracy;

mod study_progress;

pub mod stress;

pub mod haptics;

pub mod reliability;

pub mod effects;

pub mod book;

pub mod certs;

pub mod router;

pub mod doctor;

pub mod top;

/// Parses the command line, runs the command and maps its outcome to an exit code. Nothing else does.
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    scindo_program::start_log("error,scindo=info,scindo_world=info,scindo_view=info,scindo_client=warn");
    let json = match &cli.command {
        None => cli.demonstration.json,
        Some(Command::Run(args)) => args.serve.json,
        Some(Command::Demo(args)) => args.serve.json,
        Some(Command::Replay(args)) => args.json,
        Some(Command::Export(args)) => args.json,
        Some(Command::Check(args)) => args.json,
        Some(Command::Mesh(args)) => args.json,
        Some(Command::Accuracy(args)) => args.json,
        Some(Command::Stress(args)) => args.json,
        Some(Command::Haptics(args)) => args.json,
        Some(Command::Reliability(args)) => args.json,
        Some(Command::Book(args)) => args.json,
        Some(Command::Certs(args)) => args.json,
        Some(Command::Doctor(args)) => args.json,
        Some(Command::Top(args)) => args.json,
        Some(Command::Effects(args)) => args.json,
        Some(Command::Router(_) | Command::Manual(_)) => false,
    };
    let outcome = match cli.command {
        None => run::demonstration(&cli.demonstration),
        Some(Command::Run(args)) => run::scene(&args),
        Some(Command::Demo(args)) => run::demo(&args),
        Some(Command::Replay(args)) => replay::replay(&args),
        Some(Command::Export(args)) => export::export(&args),
        Some(Command::Check(args)) => check::check(&args),
        Some(Command::Mesh(args)) => mesh::mesh(&args),
        Some(Command::Accuracy(args)) => accuracy::accuracy(&args),
        Some(Command::Stress(args)) => stress::stress(&args),
        Some(Command::Haptics(args)) => haptics::haptics(&args),
        Some(Command::Reliability(args)) => reliability::reliability(&args),
        Some(Command::Book(args)) => book::book(&args),
        Some(Command::Certs(args)) => certs::certs(&args),
        Some(Command::Router(args)) => router::route(&args),
        Some(Command::Doctor(args)) => doctor::doctor(&args),
        Some(Command::Top(args)) => top::top(&args),
        Some(Command::Effects(args)) => effects::effects(&args),
        Some(Command::Manual(manual)) => describe(&manual),
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

fn describe(manual: &Manual) -> Result<ExitCode, RuntimeError> {
    let failed = |e: std::io::Error| RuntimeError::System {
        what: "writing completions or man pages".to_owned(),
        reason: e.to_string(),
    };
    manual.run::<Cli>().map_err(failed)?;
    Ok(ExitCode::SUCCESS)
}
