//! `scindo haptics` measures what the hand feels, by hand, delay and loss.

use std::io;
use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use scindo::command::cli::HapticsArgs;
use scindo::command::signals::listen;
use scindo::command::study_progress::bar;
use scindo::error::RuntimeError;
use scindo_program::say;
use scindo_study::report::frame::put;
use serde_json::Value;

use crate::error::PapersError;
use crate::haptics::trial::Trial;
use crate::haptics::{page, table};

/// Runs the table and writes the page. Ctrl-C ends it after the cells that are under way.
pub(super) fn haptics(args: &HapticsArgs) -> Result<ExitCode, PapersError> {
    let stop = Arc::new(AtomicBool::new(false));
    listen(&stop)?;
    let cells = table::cells(args.quick);
    let bar = bar(args.json);
    bar.set_length(cells.len() as u64);
    let trials = table::run(&cells, usize::from(args.threads), &stop, &|done, trial| {
        bar.set_position(done as u64);
        bar.set_message(format!("{}, {} ms", trial.cell.hand.name, trial.cell.delay_ms));
    })
    .map_err(RuntimeError::from)?;
    bar.finish_and_clear();
    let interrupted = stop.load(Ordering::Relaxed);
    let report = write(&args.out, &trials)?;
    let failed = trials.iter().filter(|trial| !trial.failures().is_empty()).count();
    if args.json {
        say!("{report}");
    } else {
        trials.iter().for_each(|trial| say!("{}", page::text(trial)));
        say!(
            "{} cells, {failed} out of bounds{}",
            trials.len(),
            if interrupted { "; interrupted" } else { "" }
        );
        say!("  page     {}/index.html", args.out.display());
        say!("  figures  {}/haptics.json", args.out.display());
        say!("  ticks    {}/ticks.csv", args.out.display());
    }
    Ok(if failed > 0 || interrupted { ExitCode::from(1) } else { ExitCode::SUCCESS })
}

/// Writes the page, the report and the ticks into `directory`, and returns the report.
pub(super) fn write(directory: &Path, trials: &[Trial]) -> Result<Value, PapersError> {
    let report = page::json(trials);
    let files = [
        ("index.html", page::html(trials)),
        ("haptics.json", format!("{report:#}\n")),
        ("ticks.csv", page::ticks(trials)),
    ];
    put(directory, files).map_err(|(path, error)| unwritten(&path, &error))?;
    Ok(report)
}

/// A file that could not be written.
pub(super) fn unwritten(path: &Path, error: &io::Error) -> RuntimeError {
    RuntimeError::System {
        what: format!("writing {}", path.display()),
        reason: format!("{error}; choose another directory with --out"),
    }
}
