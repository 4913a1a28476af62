//! `scindo-haptic`: parses arguments, runs the client, prints the summary and sets the exit code.

use clap::{CommandFactory, Parser};
use scindo_haptic::command::{Arguments, Cli, run};
use std::process::ExitCode;

fn main() -> ExitCode {
    let cli = Cli::parse();
    scindo_program::start_log("warn,scindo_haptic=info");
    match (cli.manual, cli.arguments) {
        (Some(manual), _) => match manual.run::<Cli>() {
            Ok(()) => ExitCode::SUCCESS,
            Err(error) => fail(&error, 1),
        },
        (None, Some(arguments)) => touch(&arguments),
        (None, None) => {
            eprintln!("{}", Cli::command().render_usage());
            ExitCode::from(2)
        }
    }
}

fn touch(arguments: &Arguments) -> ExitCode {
    match run(arguments) {
        Ok(summary) if arguments.json => match serde_json::to_string_pretty(&summary) {
            Ok(json) => {
                println!("{json}");
                ExitCode::SUCCESS
            }
            Err(error) => fail(&error, 1),
        },
        Ok(summary) => {
            println!("{summary}");
            ExitCode::SUCCESS
        }
        Err(error) => fail(&error, error.exit_code()),
    }
}

fn fail(error: &dyn std::fmt::Display, code: u8) -> ExitCode {
    eprintln!("error: {error}");
    ExitCode::from(code)
}
