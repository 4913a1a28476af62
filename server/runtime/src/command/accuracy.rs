//! `scindo accuracy`: what accuracy costs in time, on reference cases or a scene.

use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use scindo_program::say;
use scindo_study::design::axes::Factor;
use scindo_study::report::result::ExperimentResult;
use scindo_study::words::percent;
use scindo_study::{CaseResult, Library, Settings, StudyResult, run_with};
use serde_json::json;

use super::cli::AccuracyArgs;
use super::signals::listen;
use super::study_progress::StudyProgress;
use crate::error::RuntimeError;

/// Whether only scene files are to be studied, which need no names. A name has no ending.
pub fn is_of_scenes(args: &AccuracyArgs) -> bool {
    let is_scene = |name: &String| Path::new(name).extension().is_some() && Path::new(name).is_file();
    args.cases.iter().all(is_scene)
}

/// Runs the study. Ctrl-C ends it after the current step; finished runs are kept and shown.
///
/// # Errors
/// An option, a name or a scene that cannot be used, or files that cannot be written.
pub fn accuracy(args: &AccuracyArgs, library: &dyn Library) -> Result<ExitCode, RuntimeError> {
    check(args)?;
    let stop = Arc::new(AtomicBool::new(false));
    listen(&stop)?;
    let settings = Settings {
        cases: args.cases.clone(),
        out: args.out.clone(),
        quick: args.quick,
        within_s: args.within.map(|within| within.as_secs_f64()),
        budget_ms: args.budget_ms,
        seconds: args.seconds,
        only: narrowed(args),
        cells: args.cells.iter().map(|n| *n as usize).collect(),
        surface: args.surface.clone(),
        stop,
    };
    let progress = StudyProgress::begin();
    let study = run_with(library, &settings, &mut |now| progress.show(now))?;
    progress.end();
    drop(progress);
    if args.json {
        say!("{}", as_json(args, &study));
    } else {
        print(args, &study);
    }
    Ok(if study.interrupted || !study.has_results() { ExitCode::from(1) } else { ExitCode::SUCCESS })
}

fn check(args: &AccuracyArgs) -> Result<(), RuntimeError> {
    let positive = |option, value: Option<f64>| match value {
        Some(x) if !(x.is_finite() && x > 0.0) => Err(RuntimeError::Option {
            option,
            value: x.to_string(),
            reason: "it must be a positive number".to_owned(),
            next: "Leave it out for the default".to_owned(),
        }),
        _ => Ok(()),
    };
    positive("--budget-ms", args.budget_ms)?;
    positive("--seconds", args.seconds)
}

fn narrowed(args: &AccuracyArgs) -> Vec<(Factor, Vec<String>)> {
    let given = [
        (Factor::Law, &args.law),
        (Factor::Element, &args.element),
        (Factor::Integrator, &args.integrator),
        (Factor::Solver, &args.solver),
        (Factor::Threads, &args.threads),
    ];
    given
        .into_iter()
        .filter(|(_, labels)| !labels.is_empty())
        .map(|(f, labels)| (f, labels.clone()))
        .collect()
}

fn print(args: &AccuracyArgs, study: &StudyResult) {
    for result in &study.cases {
        print_case(result);
    }
    study.experiments.iter().for_each(print_experiment);
    let directory = args.out.display();
    let how = if study.interrupted { "interrupted; the same command resumes from here" } else { "done" };
    say!("{how}: {:.0} s, {} runs reused", study.seconds, study.resumed);
    say!("  page     {directory}/index.html");
    say!("  figures  {directory}/points.csv, study.json, pareto-*.svg");
}

fn print_case(result: &CaseResult) {
    let counts = result.counts();
    let left_out = match result.left_out {
        0 => String::new(),
        n => format!(", {n} skipped (too slow for the budget, or no time left)"),
    };
    say!("{}: {} points, {} without a result{left_out}", result.case.title, counts.points, counts.failures);
    match &result.reference {
        Ok(reference) => {
            say!("  reference known to ± {}: {}", percent(reference.error_bar), reference.source)
        }
        Err(why) => say!("  no reference: {why}"),
    }
    for note in &result.notes {
        say!("  note: {note}");
    }
    if result.points.is_empty() {
        return;
    }
    say!("  {:>10} {:>10}  {:14} Pareto front", "time", "error", "dominated by");
    for &i in &result.front {
        let point = &result.points[i];
        let (milliseconds, error) = point.point();
        let dominant = point.sources.as_ref().and_then(|s| s.dominant()).map_or("-", |source| source.name());
        say!(
            "  {milliseconds:>7.2} ms {:>8.3} %  {dominant:14} {}",
            100.0 * error,
            point.configuration.words()
        );
    }
    if let Some(advice) = &result.recommendation {
        say!("  {}", advice.words);
        for set in &advice.set {
            say!("    --set '{set}'");
        }
    }
}

fn print_experiment(result: &ExperimentResult) {
    say!("{}", result.title);
    if let Some(trouble) = &result.trouble {
        say!("  no result: {trouble}");
    }
    for note in &result.notes {
        say!("  note: {note}");
    }
    for table in &result.tables {
        say!("  {}", table.title);
        for row in &table.rows {
            let values = table.columns.iter().zip(&row.values);
            let words = values.filter_map(|(column, value)| {
                Some(format!("{} {}", column.name, column.unit.show((*value)?)))
            });
            say!("    {:36} {}", row.name, words.collect::<Vec<_>>().join(", "));
        }
    }
}

fn as_json(args: &AccuracyArgs, study: &StudyResult) -> serde_json::Value {
    let case = |result: &CaseResult| {
        json!({
            "name": result.case.name,
            "counts": result.counts(),
            "left_out": result.left_out,
            "notes": result.notes,
            "reference": result.reference.as_ref().ok(),
            "no_reference": result.reference.as_ref().err(),
            "front": result.front.iter().map(|&i| {
                let point = &result.points[i];
                json!({ "median_ms": point.point().0, "error": point.point().1, "set": point.configuration.words() })
            }).collect::<Vec<_>>(),
            "recommendation": result.recommendation,
        })
    };
    json!({
        "out": args.out,
        "seconds": study.seconds,
        "interrupted": study.interrupted,
        "cases": study.cases.iter().map(case).collect::<Vec<_>>(),
        "experiments": study.experiments.iter().map(ExperimentResult::to_json).collect::<Vec<_>>(),
    })
}
