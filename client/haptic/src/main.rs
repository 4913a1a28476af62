//! `scindo-haptic`: parses arguments, runs the client, prints the summary and sets the exit code.

use scindo_haptic::command::{Arguments, Cli, DeviceKind, run};
use scindo_haptic::device::list::DeviceList;
use serde::Serialize;
use std::process::ExitCode;

fn main() -> ExitCode {
    let cli = Cli::read(std::env::args_os()).unwrap_or_else(|error| error.exit());
    scindo_program::start_log("warn,scindo_haptic=info");
    match (cli.manual, cli.arguments) {
        (Some(manual), _) => match manual.run::<Cli>() {
            Ok(()) => ExitCode::SUCCESS,
            Err(error) => fail(&error, 1),
        },
        (None, Some(arguments)) if arguments.device == DeviceKind::List => {
            print(&DeviceList::look(&arguments.haply), arguments.json)
        }
        (None, Some(arguments)) => touch(&arguments),
        // `read` has refused it.
        (None, None) => ExitCode::from(2),
    }
}

fn touch(arguments: &Arguments) -> ExitCode {
    match run(arguments) {
        Ok(summary) => print(&summary, arguments.json),
        Err(error) => fail(&error, error.exit_code()),
    }
}

/// Prints a result for people or for programs.
fn print<R: Serialize + std::fmt::Display>(result: &R, as_json: bool) -> ExitCode {
    if !as_json {
        println!("{result}");
        return ExitCode::SUCCESS;
    }
    match serde_json::to_string_pretty(result) {
        Ok(json) => {
            println!("{json}");
            ExitCode::SUCCESS
        }
        Err(error) => fail(&error, 1),
    }
}

fn fail(error: &dyn std::fmt::Display, code: u8) -> ExitCode {
    eprintln!("error: {error}");
    ExitCode::from(code)
}
