//! The commands, one file each.

use std::process::ExitCode;

use clap::Parser;
use scindo_program::Manual;
use scindo_study::Scenes;

use crate::error::RuntimeError;
use cli::{Cli, Command, Papers};

pub mod cli;

pub mod signals;

pub mod progress;

pub mod run;

pub mod replay;

pub mod export;

pub mod check;

pub mod mesh;

pub mod accuracy;

pub mod study_progress;

mod sibling;

pub mod effects;

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
        Some(Command::Papers(papers)) => papers.is_json(),
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
        Some(Command::Papers(Papers::Accuracy(args))) if accuracy::is_of_scenes(&args) => {
            accuracy::accuracy(&args, &Scenes)
        }
        Some(Command::Papers(papers)) => Err(sibling::run("scindo-papers", papers.name())),
        Some(Command::Certs(args)) => certs::certs(&args),
        Some(Command::Router(args)) => router::route(&args),
        Some(Command::Doctor(args)) => doctor::doctor(&args),
        Some(Command::Top(args)) => top::top(&args),
        Some(Command::Effects(args)) => effects::effects(&args),
        Some(Command::Manual(manual)) => describe(&manual),
    };
    outcome.unwrap_or_else(|error| {
        report(&error, error.code(), json);
        error.exit_code()
    })
}

/// Prints why a command failed: as JSON to the standard output, or in words to the standard error.
pub fn report(error: &dyn std::error::Error, code: &str, json: bool) {
    if json {
        let report = serde_json::json!({ "error": { "code": code, "message": error.to_string() } });
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
