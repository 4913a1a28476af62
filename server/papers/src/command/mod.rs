//! The commands of `scindo` that this program runs. Their options are those of `scindo`'s command line.

mod library;

mod stress;

mod haptics;

mod reliability;

mod book;

use std::process::ExitCode;

use clap::Parser;
use scindo::command::accuracy::accuracy;
use scindo::command::cli::Papers;
use scindo::command::report;

use library::Named;

/// Runs the commands `accuracy`, `stress`, `haptics`, `reliability` and `book` of `scindo`, which starts this program.
#[derive(Debug, Parser)]
#[command(name = "scindo-papers", version = scindo_program::VERSION)]
struct Cli {
    #[command(subcommand)]
    command: Papers,
}

/// Parses the command line, runs the command and maps its outcome to an exit code.
pub fn main() -> ExitCode {
    let Cli { command } = Cli::parse();
    scindo_program::start_log("error,scindo=info,scindo_world=info");
    let json = command.is_json();
    let outcome = match command {
        Papers::Accuracy(args) => accuracy(&args, &Named).map_err(Into::into),
        Papers::Stress(args) => stress::stress(&args),
        Papers::Haptics(args) => haptics::haptics(&args),
        Papers::Reliability(args) => reliability::reliability(&args),
        Papers::Book(args) => book::book(&args),
    };
    outcome.unwrap_or_else(|error| {
        report(&error, error.code(), json);
        error.exit_code()
    })
}
