//! `scindo-igtl`: the OpenIGTLink bridge as a program.

use std::process::ExitCode;

use clap::Parser;
use scindo_igtl::command::{Cli, run};

#[tokio::main(flavor = "multi_thread", worker_threads = 2)]
async fn main() -> ExitCode {
    let cli = Cli::parse();
    scindo_program::start_log("warn,scindo_igtl=info");
    let (result, code) = match &cli.manual {
        Some(manual) => (manual.run::<Cli>().map_err(|error| error.to_string()), 1),
        None => match run(&cli.arguments).await {
            Ok(()) => (Ok(()), 0),
            Err(error) => (Err(error.to_string()), error.exit_code()),
        },
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(code)
        }
    }
}
