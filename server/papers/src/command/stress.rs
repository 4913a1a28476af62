//! `scindo stress` runs the hard cases, and shows whether they can fail.

use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use indicatif::ProgressBar;
use scindo::command::cli::StressArgs;
use scindo::command::signals::listen;
use scindo::command::study_progress::bar;
use scindo_program::say;
use serde_json::json;

use crate::error::PapersError;
use crate::haptics::cases::CASES;
use crate::stress::{self, CaseReport, Progress, Row, Settings, Status, SuiteReport};

/// Runs the cases and writes the page. Ctrl-C ends it after the cases that are under way.
pub(super) fn stress(args: &StressArgs) -> Result<ExitCode, PapersError> {
    if args.list {
        return list(args);
    }
    let stop = Arc::new(AtomicBool::new(false));
    listen(&stop)?;
    let settings = Settings {
        cases: args.cases.clone(),
        more: CASES,
        long: args.long,
        threads: usize::from(args.threads),
        stop,
    };
    let bar = bar(args.json);
    let report = stress::run(&settings, &mut |progress| show(&bar, "", &progress))?;
    let table = match args.mutations {
        true => Some(stress::mutation::table(&settings, &mut |p| show(&bar, "mutation check, ", &p))?),
        false => None,
    };
    bar.finish_and_clear();
    stress::write(&args.out, &report, table.as_deref())?;
    if args.json {
        say!("{}", as_json(args, &report, table.as_deref()));
    } else {
        print(args, &report, table.as_deref());
    }
    let missed = table.is_some_and(|rows| rows.iter().any(|row| !row.caught()));
    let failed = report.count(Status::Failed) > 0 || report.interrupted || missed;
    Ok(if failed { ExitCode::from(1) } else { ExitCode::SUCCESS })
}

fn list(args: &StressArgs) -> Result<ExitCode, PapersError> {
    for case in stress::select(&args.cases, CASES)? {
        let number = case.number.map_or(String::new(), |number| number.to_string());
        say!("{number:>3}  {:16} {}", case.name, case.title);
    }
    Ok(ExitCode::SUCCESS)
}

fn show(bar: &ProgressBar, what: &str, progress: &Progress<'_>) {
    bar.set_length(progress.total as u64);
    bar.set_position(progress.done as u64);
    bar.set_message(format!("{what}{}: {}", progress.case.name, progress.status.name()));
}

fn print(args: &StressArgs, report: &SuiteReport, table: Option<&[Row]>) {
    for case in &report.cases {
        let number = case.case.number.map_or(String::new(), |number| number.to_string());
        say!("{number:>3}  {:8} {:16} {}", case.status.name(), case.case.name, case.case.title);
        for failure in failures(case) {
            say!("              {failure}");
        }
    }
    for row in table.into_iter().flatten() {
        let caught = if row.caught() { "caught" } else { "MISSED" };
        say!("without {}: {caught}; {} of {} cases fail", row.mutation.name(), row.failed.len(), row.run);
        for failed in &row.failed {
            say!("     {:16} {}", failed.name, failed.why);
        }
    }
    say!(
        "{} passed, {} failed, in {:.0} s{}",
        report.count(Status::Passed),
        report.count(Status::Failed),
        report.seconds,
        if report.interrupted { "; interrupted" } else { "" }
    );
    say!("  page     {}/index.html", args.out.display());
    say!("  figures  {}/stress.json", args.out.display());
}

fn failures(case: &CaseReport) -> Vec<String> {
    if case.status == Status::Failed { case.failures() } else { Vec::new() }
}

fn as_json(args: &StressArgs, report: &SuiteReport, table: Option<&[Row]>) -> serde_json::Value {
    let cases = report.cases.iter().map(|case| {
        json!({
            "name": case.case.name,
            "number": case.case.number,
            "status": case.status.name(),
            "failures": failures(case),
        })
    });
    json!({
        "out": args.out,
        "seconds": report.seconds,
        "interrupted": report.interrupted,
        "passed": report.count(Status::Passed),
        "failed": report.count(Status::Failed),
        "cases": cases.collect::<Vec<_>>(),
        "mutations": table.map(|rows| rows.iter().map(|row| json!({
            "mutation": row.mutation.name(),
            "caught": row.caught(),
            "cases": row.failed.iter().map(|failed| failed.name).collect::<Vec<_>>(),
        })).collect::<Vec<_>>()),
    })
}
