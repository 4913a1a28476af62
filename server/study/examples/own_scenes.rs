//! Holds what `scindo accuracy SCENE --budget-ms B --within T` recommends against what it promises.
//!
//! For each scene: the study; its recommendation run again, whose 99th percentile must keep the budget
//! within 10 %; and runs on meshes up to eight times finer than the scene's with an eighth of its step, as far as
//! they end in time. The recommendation must be as far from where they lead as the printed error says, within the
//! printed bar.
//!
//! The finest of these meshes errs itself, sometimes by more than the bar: at the front of a cut, at the border of what
//! is held. So the distances from the three finest are continued by Aitken's Δ² method where they converge.
//!
//! `tests/accuracy/own_scenes.sh` calls it; run by a person, since it takes long.

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use scindo_study::case::Truth;
use scindo_study::trial::distance::Errors;
use scindo_study::trial::{self, Limits, Trial};
use scindo_study::words::percent;
use scindo_study::{CaseResult, Settings, run};

/// Meshes of the check, relative to the scene's, and its step.
const FINER: [f64; 5] = [2.0, 2.8, 4.0, 5.6, 8.0];
const STEPS: u32 = 8;

/// Longest time of a run of the check [s]. After one that took longer than the second, none is tried on a finer mesh: it
/// would take several times as long, and as much memory.
const CHECK_S: f64 = 600.0;
const ENOUGH_S: f64 = 45.0;

/// Largest ratio of successive differences with which they are continued: that of order 1 on meshes √2 apart. Singular
/// stress at the front of a cut or at the border of what is held allows displacements this order.
const SLOWEST: f64 = std::f64::consts::FRAC_1_SQRT_2;

fn main() -> ExitCode {
    let mut arguments = std::env::args().skip(1);
    let mut number = || arguments.next().and_then(|text| text.parse::<f64>().ok());
    let (Some(budget_ms), Some(within_s)) = (number(), number()) else {
        eprintln!("usage: own_scenes BUDGET_MS WITHIN_S OUT SCENE...");
        return ExitCode::from(2);
    };
    let Some(out) = arguments.next().map(PathBuf::from) else { return ExitCode::from(2) };
    let (mut all, mut held) = (0, 0);
    for scene in arguments {
        all += 1;
        match check(&scene, budget_ms, within_s, out.join(all.to_string())) {
            Ok(words) => {
                held += 1;
                println!("held    {scene}: {words}");
            }
            Err(words) => println!("FAILED  {scene}: {words}"),
        }
    }
    println!("{held} of {all} held");
    if 10 * held >= 9 * all { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

fn check(scene: &str, budget_ms: f64, within_s: f64, out: PathBuf) -> Result<String, String> {
    let settings = Settings {
        cases: vec![scene.to_owned()],
        out,
        quick: false,
        within_s: Some(within_s),
        budget_ms: Some(budget_ms),
        seconds: None,
        only: Vec::new(),
        cells: Vec::new(),
        surface: None,
        stop: Arc::new(AtomicBool::new(false)),
    };
    let study = run(&settings, &mut |progress| progress.note.iter().for_each(|note| eprintln!("{note}")))
        .map_err(|error| error.to_string())?;
    let case = &study.cases[0];
    let reference = case.reference.as_ref().map_err(Clone::clone)?;
    let advice = case.recommendation.as_ref().ok_or("no recommendation")?;
    println!("{scene} ({:.0} s)\n  ± {}: {}", study.seconds, percent(reference.error_bar), reference.source);
    case.notes.iter().for_each(|note| println!("  note: {note}"));
    println!("  {}", advice.words);
    let Some(choice) = advice.choice else { return Ok("nothing fits, and it says so".to_owned()) };
    let point = &case.points[choice];
    let again = repeat(case, &point.configuration.overrides(), point.configuration.threads())?;
    let checked = finer(case, &again)?;
    let printed = advice.error.unwrap_or(f64::NAN);
    let words = format!(
        "p99 {:.2} ms again {:.2} ms; error {} ± {}, by finer runs {} ({checked})",
        point.trial.cost.p99_ms,
        again.cost.p99_ms,
        percent(printed),
        percent(advice.error_bar),
        percent(checked.error),
    );
    let keeps = again.cost.p99_ms <= 1.1 * budget_ms;
    let honest = (checked.error - printed).abs() <= advice.error_bar;
    if keeps && honest { Ok(words) } else { Err(words) }
}

fn repeat(case: &CaseResult, set: &[String], threads: usize) -> Result<Trial, String> {
    let scene = case.case.scene.apply_sets(set).map_err(|error| error.to_string())?;
    let limits = Limits { run_s: CHECK_S, repeat_s: 2.0, repeats: 11 };
    let stop = AtomicBool::new(false);
    let trial = trial::run(&scene, case.case.scene.base_dir(), threads, case.case.protocol, limits, &stop);
    let trial = trial.ok_or("stopped")?;
    if trial.is_done() { Ok(trial) } else { Err(trial.reason) }
}

/// How far a run is from where finer meshes lead.
struct Checked {
    error: f64,
    /// Element and integrator of the finer runs.
    way: String,
    /// Distances from them, coarse to fine.
    distances: Vec<f64>,
    /// Elements of the finest.
    elements: usize,
}

impl std::fmt::Display for Checked {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let distances: Vec<String> = self.distances.iter().map(|d| percent(*d)).collect();
        write!(f, "{}, up to {} elements: {}", self.way, self.elements, distances.join(", "))
    }
}

/// The distance of `run` from finer meshes, by the way that the reference took, or else the next one that ends in time.
fn finer(case: &CaseResult, run: &Trial) -> Result<Checked, String> {
    let Truth::Refined { ladders, .. } = &case.case.truth else { return Err("not a scene".to_owned()) };
    let mut why = "no ladder".to_owned();
    for ladder in ladders {
        let (mut distances, mut elements) = (Vec::new(), 0);
        let mut last = None;
        for factor in FINER {
            let most = ladder.meshes.iter().rposition(|mesh| mesh.size <= 1.1 * factor).unwrap_or(0);
            if last.replace(most) == Some(most) {
                continue;
            }
            let started = Instant::now();
            match repeat(case, &ladder.at(most, STEPS).overrides(), 1) {
                Ok(truth) => {
                    distances.push(Errors::of(&run.series, &truth.series, &case.case.goal, None).l2);
                    elements = truth.elements;
                    if started.elapsed().as_secs_f64() > ENOUGH_S {
                        break;
                    }
                }
                Err(reason) => {
                    why = format!("the finer run: {reason}");
                    break;
                }
            }
        }
        if let Some(error) = continued(&distances) {
            return Ok(Checked { error, way: ladder.words.clone(), distances, elements });
        }
    }
    Err(why)
}

/// Where a sequence leads: by Aitken's Δ² method if its last differences shrink with one sign, else its last member.
fn continued(sequence: &[f64]) -> Option<f64> {
    let last = *sequence.last()?;
    let [.., a, b, c] = sequence else { return Some(last) };
    let ratio = (c - b) / (b - a);
    let capped = ratio.min(SLOWEST);
    Some(if ratio > 0.0 && ratio < 1.0 { c + (c - b) * capped / (1.0 - capped) } else { last })
}
