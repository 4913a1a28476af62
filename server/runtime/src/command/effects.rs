//! `scindo effects`: what each effect of a scene costs, and what switching it off saves.

use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use scindo_program::say;
use scindo_study::study::effects::{EffectsReport, Off, Request, Row, measure};
use scindo_world::scene::Scene;

use super::cli::EffectsArgs;
use super::signals::listen;
use super::study_progress::bar;
use crate::error::RuntimeError;

/// Measures the effects of the scene. Ctrl-C ends it after the current step and prints what is known.
pub fn effects(args: &EffectsArgs) -> Result<ExitCode, RuntimeError> {
    let scene = Scene::load_with(&args.scene, &args.set)?;
    let stop = Arc::new(AtomicBool::new(false));
    listen(&stop)?;
    let bar = bar(args.json);
    let report = measure(&scene, &Request { steps: args.steps, stop }, &mut |what, done, total| {
        bar.set_length(total);
        bar.set_position(done);
        bar.set_message(what.to_owned());
    })?;
    bar.finish_and_clear();
    if args.json {
        say!("{:#}", serde_json::json!(report));
    } else {
        print(&report);
    }
    Ok(if report.interrupted { ExitCode::from(1) } else { ExitCode::SUCCESS })
}

fn print(report: &EffectsReport) {
    say!(
        "{}: {:.3} ms per step (median of {}, one thread)",
        report.scene,
        report.step_ms,
        match report.steps {
            1 => "1 step".to_owned(),
            steps => format!("{steps} steps"),
        }
    );
    let width = report.effects.iter().map(|row| row.name.len()).max().unwrap_or(0).max("effect".len());
    say!(
        "{:width$}  {:3}  {:>9}  {:>9}  {:>17}  why",
        "effect",
        "",
        "predicted",
        "ms/step",
        "off saves [ms]"
    );
    for row in &report.effects {
        let switch = if row.on { "on" } else { "off" };
        let number =
            |ms: Option<f64>| ms.filter(|ms| *ms > 0.0).map_or(String::new(), |ms| format!("{ms:.3}"));
        let (predicted, measured) = (number(Some(row.predicted_ms)), number(row.measured_ms));
        let (saves, remark) = saving(row);
        say!("{:width$}  {switch:3}  {predicted:>9}  {measured:>9}  {saves:>17}  {}", row.name, row.why);
        if let Some(remark) = remark {
            say!("{:width$}       {remark}", "");
        }
    }
    if report.interrupted {
        say!("interrupted: effects without a figure were not measured");
    }
}

/// The saving, and what else is to be known of it.
fn saving(row: &Row) -> (String, Option<String>) {
    match &row.off {
        Off::AlreadyOff | Off::NotMeasured => (String::new(), None),
        Off::Impossible { reason } => ("-".to_owned(), Some(format!("cannot be switched off: {reason}"))),
        Off::Fails { reason } => ("-".to_owned(), Some(format!("fails when switched off: {reason}"))),
        Off::Measured(saving) => {
            let saves = format!("{:.3} ± {:.3}", saving.saves_ms, saving.standard_error_ms);
            let apart = saving.pairs - saving.same_state;
            let remark = match apart {
                0 => None,
                _ if saving.same_state == 0 => Some("moves on its own when switched off".to_owned()),
                _ => Some(format!("{apart} of {} steps were compared in different states", saving.pairs)),
            };
            (saves, remark)
        }
    }
}
