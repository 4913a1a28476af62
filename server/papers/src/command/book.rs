//! `scindo book` runs all studies, part by part, and writes one site.

use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use indicatif::ProgressBar;
use scindo::command::cli::BookArgs;
use scindo::command::signals::listen;
use scindo::command::study_progress::bar;
use scindo::error::RuntimeError;
use scindo_program::say;
use scindo_study::bench::store::Origin;
use scindo_study::report::frame::put;
use scindo_study::study::effects::{Request, measure};
use scindo_study::{Settings, run_with};
use scindo_world::scene::ShippedScene;
use serde_json::json;

use super::haptics::{unwritten, write};
use super::library::Named;
use crate::book::part::{Kind, Part, parts};
use crate::book::verdict::Verdict;
use crate::book::{self, Tally};
use crate::error::PapersError;
use crate::haptics::cases::CASES;
use crate::haptics::table;
use crate::stress::{self, cases};

/// Time limit of a case of the accuracy study in the quick form [s]. Experiments have none.
const QUICK_CASE_S: f64 = 30.0;
/// Steps per effect of a scene: in the quick form, and in the whole one.
const EFFECT_STEPS: [u32; 2] = [20, 100];
/// Threads of the table of hands.
const HANDS: usize = 2;

/// Runs the parts that are not done yet, and writes the pages after each of them. Ctrl-C ends it; the same command goes
/// on.
pub(super) fn book(args: &BookArgs) -> Result<ExitCode, PapersError> {
    let all = parts(args.quick);
    if args.list {
        all.iter().for_each(|part| say!("{:24} {}", part.name, part.title));
        return Ok(ExitCode::SUCCESS);
    }
    let wanted = chosen(args, &all)?;
    let stop = Arc::new(AtomicBool::new(false));
    listen(&stop)?;
    let origin = Origin::here();
    let bar = bar(args.json);
    bar.set_length(wanted.len() as u64);
    let mut states = Vec::new();
    for (done, part) in wanted.iter().enumerate() {
        bar.set_position(done as u64);
        let state = if stop.load(Ordering::Relaxed) {
            State::NotRun
        } else if part.is_done(&args.out, &origin, args.quick) {
            State::Kept
        } else {
            let started = Instant::now();
            let outcome = make(part, args, &stop, &bar);
            let seconds = started.elapsed().as_secs_f64();
            match outcome {
                Err(error) => State::Failed(error.to_string()),
                Ok(()) if stop.load(Ordering::Relaxed) => State::NotRun,
                Ok(()) => {
                    let finished = part.finish(&args.out, &origin, args.quick, seconds);
                    finished.map_err(|error| unwritten(&part.folder(&args.out), &error))?;
                    State::Done
                }
            }
        };
        states.push(state);
        book::write(&args.out, &all, &origin, args.quick)?;
    }
    bar.finish_and_clear();
    let tallies = book::write(&args.out, &all, &origin, args.quick)?;
    let interrupted = stop.load(Ordering::Relaxed);
    report(args, &wanted, &states, &tallies, interrupted);
    let failed = states.iter().any(|state| matches!(state, State::Failed(_)));
    Ok(if interrupted || failed { ExitCode::from(1) } else { ExitCode::SUCCESS })
}

/// What became of a part.
enum State {
    /// It ran.
    Done,
    /// An earlier run had finished it.
    Kept,
    /// The user ended the book before or within it.
    NotRun,
    /// It could not be made.
    Failed(String),
}

impl State {
    fn name(&self) -> &'static str {
        match self {
            Self::Done => "done",
            Self::Kept => "kept",
            Self::NotRun => "not run",
            Self::Failed(_) => "failed",
        }
    }
}

fn chosen(args: &BookArgs, all: &[Part]) -> Result<Vec<Part>, PapersError> {
    if let Some(name) = args.parts.iter().find(|name| all.iter().all(|part| part.name != **name)) {
        let refused = RuntimeError::Option {
            option: "--part",
            value: name.clone(),
            reason: "this form of the book has no such part".to_owned(),
            next: "`scindo book --list` names the parts; add --quick for those of the quick form".to_owned(),
        };
        return Err(refused.into());
    }
    let is_wanted = |part: &&Part| args.parts.is_empty() || args.parts.contains(&part.name);
    Ok(all.iter().filter(is_wanted).cloned().collect())
}

/// Runs a part.
fn make(part: &Part, args: &BookArgs, stop: &Arc<AtomicBool>, bar: &ProgressBar) -> Result<(), PapersError> {
    let folder = part.folder(&args.out);
    let tell = |what: &str| bar.set_message(format!("{}: {what}", part.name));
    tell("");
    std::fs::create_dir_all(&folder).map_err(|error| unwritten(&folder, &error))?;
    match part.kind {
        Kind::Accuracy => {
            let settings = Settings {
                cases: vec![part.name.clone()],
                out: folder,
                quick: args.quick,
                within_s: args.quick.then_some(QUICK_CASE_S),
                budget_ms: None,
                seconds: None,
                only: Vec::new(),
                cells: Vec::new(),
                surface: None,
                stop: stop.clone(),
            };
            run_with(&Named, &settings, &mut |progress| tell(&progress.what)).map_err(RuntimeError::from)?;
        }
        Kind::Stress => {
            let quick = cases::ALL.iter().filter(|case| case.quick).map(|case| case.name.to_owned());
            let settings = stress::Settings {
                cases: if args.quick { quick.collect() } else { Vec::new() },
                more: CASES,
                stop: stop.clone(),
                ..stress::Settings::default()
            };
            let report = stress::run(&settings, &mut |progress| tell(progress.case.name))?;
            stress::write(&folder, &report, None)?;
        }
        Kind::Haptics => {
            let cells = table::cells(args.quick);
            let trials = table::run(&cells, HANDS, stop, &|_, trial| tell(trial.cell.hand.name))
                .map_err(RuntimeError::from)?;
            write(&folder, &trials)?;
        }
        Kind::Effects => {
            let Some(scene) = part.scene().and_then(ShippedScene::of_name) else { return Ok(()) };
            let scene = scene.read(&[]).map_err(RuntimeError::from)?;
            let request = Request { steps: EFFECT_STEPS[usize::from(!args.quick)], stop: stop.clone() };
            let report =
                measure(&scene, &request, &mut |what, _, _| tell(what)).map_err(RuntimeError::from)?;
            put(&folder, [("effects.json", format!("{:#}\n", json!(report)))])
                .map_err(|(path, error)| unwritten(&path, &error))?;
        }
    }
    Ok(())
}

fn report(args: &BookArgs, parts: &[Part], states: &[State], tallies: &[Tally], interrupted: bool) {
    if args.json {
        let part = |(part, state): (&Part, &State)| {
            let reason = if let State::Failed(reason) = state { Some(reason) } else { None };
            json!({ "name": part.name, "state": state.name(), "reason": reason })
        };
        say!(
            "{}",
            json!({
                "out": args.out,
                "interrupted": interrupted,
                "parts": parts.iter().zip(states).map(part).collect::<Vec<_>>(),
                "papers": tallies.iter().map(Tally::to_json).collect::<Vec<_>>(),
            })
        );
        return;
    }
    for (part, state) in parts.iter().zip(states) {
        let reason = if let State::Failed(reason) = state { format!(": {reason}") } else { String::new() };
        say!("{:8} {:24} {}{reason}", state.name(), part.name, part.title);
    }
    for tally in tallies {
        let counts = Verdict::ALL.iter().zip(tally.counts).filter(|(_, count)| *count > 0);
        let words: Vec<String> =
            counts.map(|(verdict, count)| format!("{count} {}", verdict.name())).collect();
        say!("{}: {}", tally.paper, words.join(", "));
    }
    if interrupted {
        say!("interrupted; the same command goes on from here");
    }
    say!("  page     {}/index.html", args.out.display());
    say!("  figures  {}/book.json", args.out.display());
}
