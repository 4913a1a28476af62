//! The study: every case, configuration after configuration, then the pages.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use scindo_world::scene::{Scene, SceneError};
use serde::Serialize;
use thiserror::Error;

use crate::axes::{Factor, block};
use crate::case::{self, Case};
use crate::design::{Configuration, design, narrow};
use crate::error::Errors;
use crate::pareto::front;
use crate::recommend::{Candidate, Recommendation, recommend};
use crate::reference::{self, Reference};
use crate::sources::{Sources, peel};
use crate::store::{Origin, Store, fingerprint};
use crate::table::Table;
use crate::trial::{self, Limits, Protocol, Trial, one_line};
use crate::wear::{self, Wear};

/// What is asked for.
#[derive(Debug, Clone)]
pub struct Settings {
    /// Names of cases (see [`case::NAMES`]) and paths of scene files.
    pub cases: Vec<String>,
    /// Where the results go; finished points there are taken over.
    pub out: PathBuf,
    /// Only what takes less than a minute.
    pub quick: bool,
    /// Recommend a configuration that fits this time per solution or frame [ms].
    pub budget_ms: Option<f64>,
    /// Simulated time of scenes in motion [s].
    pub seconds: Option<f64>,
    /// Factors and the labels that are kept of them; factors that are not named keep all.
    pub only: Vec<(Factor, Vec<String>)>,
    /// Replaces the meshes: cells along the longest side.
    pub cells: Vec<usize>,
    /// Raised from elsewhere to end the study; what is finished is kept and shown.
    pub stop: Arc<AtomicBool>,
}

/// How far it is.
#[derive(Debug, Clone, PartialEq)]
pub struct Progress {
    /// Case that is worked on.
    pub case: String,
    /// What is run now.
    pub what: String,
    /// Points done, of all cases.
    pub done: usize,
    /// Points in all, twins and references included where they are known.
    pub total: usize,
    /// Expected time left [s]; none before it can be told.
    pub left_s: Option<f64>,
}

/// Why there is no study.
#[derive(Debug, Error)]
pub enum StudyError {
    /// A scene.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A name that is neither case nor file.
    #[error("`{name}` is neither a scene file nor a case; cases: {}; groups of them: bar, cutting", case::NAMES.join(", "))]
    UnknownCase {
        /// The name.
        name: String,
    },
    /// Narrowing to nothing.
    #[error("`{label}` is no setting of {factor} in case {case}; settings: {known}")]
    UnknownSetting {
        /// The factor.
        factor: &'static str,
        /// What was asked for.
        label: String,
        /// The case.
        case: String,
        /// What there is.
        known: String,
    },
    /// The disk said no.
    #[error("cannot write {}: {source}; check that the directory is writable and has room", path.display())]
    Io {
        /// File or directory.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
}

/// A configuration and what became of it.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// What was run.
    pub configuration: Configuration,
    /// How it went.
    pub trial: Trial,
    /// How far from the reference; none without result or reference.
    pub errors: Option<Errors>,
    /// Where its error comes from; known on the Pareto front.
    pub sources: Option<Sources>,
}

impl Outcome {
    /// Cost and error, not finite where there is no result.
    pub fn point(&self) -> (f64, f64) {
        (self.trial.cost.median_ms, self.errors.map_or(f64::INFINITY, |errors| errors.l2))
    }
}

/// What came out for a case.
#[derive(Debug, Clone)]
pub struct CaseResult {
    /// The case.
    pub case: Case,
    /// The right answer, or why there is none.
    pub reference: Result<Reference, String>,
    /// All points, the base first.
    pub points: Vec<Outcome>,
    /// Indices of the Pareto front, by rising cost.
    pub front: Vec<usize>,
    /// The recommendation, where one was asked for.
    pub recommendation: Option<Recommendation>,
    /// Whether every point was run.
    pub complete: bool,
}

/// What came out.
#[derive(Debug, Clone)]
pub struct StudyResult {
    /// Case after case.
    pub cases: Vec<CaseResult>,
    /// Build and machine.
    pub origin: Origin,
    /// Points taken over from an earlier study.
    pub resumed: usize,
    /// Wall time of this study [s].
    pub seconds: f64,
    /// Load of the machine when it began and ended (one-minute average); none where unknown.
    pub load: [Option<f64>; 2],
    /// Whether it was ended early.
    pub interrupted: bool,
}

/// Figures of a study in short, for `--json`.
#[derive(Debug, Clone, Serialize)]
pub struct Counts {
    /// Points in all.
    pub points: usize,
    /// Those without a result.
    pub failures: usize,
}

impl CaseResult {
    /// How many points there are, and how many gave no result.
    pub fn counts(&self) -> Counts {
        let failures = self.points.iter().filter(|point| !point.trial.is_done()).count();
        Counts { points: self.points.len(), failures }
    }
}

/// Runs a study and writes `points.csv`, `study.json`, a picture per case and `index.html`.
///
/// # Errors
/// Bad names or scenes, and a disk that cannot be written. Runs that fail are results.
pub fn run(settings: &Settings, tell: &mut dyn FnMut(&Progress)) -> Result<StudyResult, StudyError> {
    let started = Instant::now();
    let cases = open(settings)?;
    let origin = Origin::here();
    let io = |(path, source)| StudyError::Io { path, source };
    let store = Store::open(&settings.out, &origin).map_err(io)?;
    let table = Table::begin(&settings.out).map_err(io)?;
    let mut bench = Bench::new(settings, store, table, &cases, tell);
    let mut result = StudyResult {
        cases: Vec::new(),
        origin,
        resumed: bench.store.resumed,
        seconds: 0.0,
        load: [load(), None],
        interrupted: false,
    };
    for case in cases {
        result.cases.push(bench.study(case));
        result.seconds = started.elapsed().as_secs_f64();
        result.load[1] = load();
        result.interrupted = settings.stop.load(Ordering::Relaxed);
        if let Some((path, source)) = bench.broken.take() {
            return Err(StudyError::Io { path, source });
        }
        crate::page::write(&settings.out, &result).map_err(io)?;
        if result.interrupted {
            break;
        }
    }
    Table::whole(&settings.out, &result).map_err(io)?;
    Ok(result)
}

/// The cases asked for, narrowed.
fn open(settings: &Settings) -> Result<Vec<Case>, StudyError> {
    let mut cases = Vec::new();
    for name in &settings.cases {
        let several: &[&str] = match name.as_str() {
            "bar" => &["bar-rest", "bar-motion"],
            "cutting" => &["cut-tc1", "cut-tc2force", "cut-tc2strip"],
            _ => &[],
        };
        if !several.is_empty() {
            cases.extend(several.iter().filter_map(|name| case::builtin(name, settings.quick)));
        } else if let Some(case) = case::builtin(name, settings.quick) {
            cases.push(case);
        } else if Path::new(name).exists() {
            let scene = Scene::load(Path::new(name))?;
            cases.push(case::from_scene(&scene, settings.seconds, settings.quick)?);
        } else {
            return Err(StudyError::UnknownCase { name: name.clone() });
        }
    }
    for case in &mut cases {
        replace_meshes(case, &settings.cells);
        for (factor, labels) in &settings.only {
            check(case, *factor, labels)?;
            narrow(&mut case.axes, *factor, labels);
        }
    }
    Ok(cases)
}

/// Meshes of the wished fineness: the shape of the base mesh, scaled.
fn replace_meshes(case: &mut Case, cells: &[usize]) {
    let Some(axis) = case.axes.iter_mut().find(|axis| axis.factor == Factor::Mesh && !cells.is_empty())
    else {
        return;
    };
    let Some(base) = axis.base().cloned() else { return };
    let scaled = |longest: &usize| {
        let assignment = base.set.first()?;
        let (key, value) = assignment.split_once('=')?;
        let body = key.strip_prefix("body.")?.strip_suffix(".mesh.box.cells")?;
        let sides: Vec<f64> =
            value.trim_matches(['[', ']']).split(',').filter_map(|n| n.trim().parse().ok()).collect();
        let side = |n: f64| ((n * *longest as f64 / base.size).round() as usize).max(1);
        Some(block(body, [side(*sides.first()?), side(*sides.get(1)?), side(*sides.get(2)?)]))
    };
    let meshes: Vec<_> = cells.iter().filter_map(scaled).collect();
    if meshes.is_empty() {
        return;
    }
    axis.base = meshes.len() / 2;
    axis.settings = meshes;
    let labels: Vec<String> = axis.settings.iter().map(|setting| setting.label.clone()).collect();
    for block in &mut case.blocks {
        block
            .0
            .iter_mut()
            .filter(|(factor, _)| *factor == Factor::Mesh)
            .for_each(|(_, l)| l.clone_from(&labels));
    }
}

fn check(case: &Case, factor: Factor, labels: &[String]) -> Result<(), StudyError> {
    let Some(axis) = case.axes.iter().find(|axis| axis.factor == factor) else { return Ok(()) };
    match labels.iter().find(|label| axis.find(label).is_none()) {
        None => Ok(()),
        Some(label) => Err(StudyError::UnknownSetting {
            factor: factor.name(),
            label: label.clone(),
            case: case.name.clone(),
            known: axis.settings.iter().map(|s| s.label.as_str()).collect::<Vec<_>>().join(", "),
        }),
    }
}

/// Runs configurations, remembers them, and tells how far it is.
struct Bench<'a> {
    settings: &'a Settings,
    store: Store,
    table: Table,
    tell: &'a mut dyn FnMut(&Progress),
    progress: Progress,
    /// Expected work in all and done, in units of the base of a case; seconds for what was done.
    work: [f64; 2],
    spent_s: f64,
    broken: Option<(PathBuf, io::Error)>,
}

/// Twins and reference runs of a case, as a share of its points: a guess for the progress bar.
const TWINS: f64 = 0.4;

impl<'a> Bench<'a> {
    fn new(
        settings: &'a Settings,
        store: Store,
        table: Table,
        cases: &[Case],
        tell: &'a mut dyn FnMut(&Progress),
    ) -> Self {
        let plan: Vec<(usize, f64)> = cases
            .iter()
            .map(|case| {
                let all = design(&case.axes, &case.blocks);
                (all.len(), all.iter().map(|c| weight(case, c)).sum::<f64>())
            })
            .collect();
        let progress = Progress {
            case: String::new(),
            what: String::new(),
            done: 0,
            total: plan.iter().map(|(n, _)| n).sum(),
            left_s: None,
        };
        let work = [plan.iter().map(|(_, w)| w).sum::<f64>() * (1.0 + TWINS), 0.0];
        Self { settings, store, table, tell, progress, work, spent_s: 0.0, broken: None }
    }

    fn study(&mut self, case: Case) -> CaseResult {
        self.progress.case.clone_from(&case.name);
        let reference = reference::settle(&case, &mut |c| self.once(&case, c));
        let mut points = Vec::new();
        let all = design(&case.axes, &case.blocks);
        let planned = all.len();
        for configuration in all {
            let Some(trial) = self.measured(&case, &configuration) else { break };
            let errors = reference.as_ref().ok().filter(|_| trial.is_done());
            let errors = errors
                .map(|r| Errors::of(&trial.series, &r.series, &case.goal, r.goal))
                .filter(Errors::is_finite);
            let point = Outcome { configuration, trial, errors, sources: None };
            if let Err(broken) = self.table.append(&case, &point) {
                self.broken = Some(broken);
                break;
            }
            points.push(point);
            self.progress.done += 1;
        }
        let complete = points.len() == planned;
        let coordinates: Vec<(f64, f64)> = points.iter().map(Outcome::point).collect();
        let front = front(&coordinates);
        if let Ok(reference) = &reference {
            // What is recommended fits by its slow steps and need not be on the front of medians.
            let choice = self.settings.budget_ms.and_then(|budget| advise(budget, &points).choice);
            for i in front.iter().copied().chain(choice.filter(|i| !front.contains(i))) {
                let Outcome { configuration, trial, .. } = &points[i];
                let found =
                    peel(&case, configuration, &trial.series, reference, &mut |c| self.once(&case, c));
                points[i].sources = Some(found);
            }
        }
        let recommendation = self.settings.budget_ms.map(|budget| advise(budget, &points));
        CaseResult { case, reference, points, front, recommendation, complete }
    }

    /// A run with repetitions for its time.
    fn measured(&mut self, case: &Case, configuration: &Configuration) -> Option<Trial> {
        self.trial(case, configuration, true)
    }

    /// A run for its result only.
    fn once(&mut self, case: &Case, configuration: &Configuration) -> Option<Trial> {
        self.trial(case, configuration, false)
    }

    fn trial(&mut self, case: &Case, configuration: &Configuration, timed: bool) -> Option<Trial> {
        if self.settings.stop.load(Ordering::Relaxed) || self.broken.is_some() {
            return None;
        }
        self.progress.what = configuration.words();
        (self.tell)(&self.progress);
        let weight = weight(case, configuration);
        let key = key(case, configuration);
        let known = self.store.get(&key).filter(|trial| !timed || trial.cost.count != 1 || is_motion(case));
        if let Some(trial) = known.cloned() {
            self.work[0] -= weight;
            return Some(trial);
        }
        let started = Instant::now();
        let trial = match case.scene.apply_sets(&configuration.overrides()) {
            Err(error) => Trial::refused(one_line(&error.to_string())),
            Ok(scene) => {
                let limits = limits(self.settings.quick, timed);
                let (threads, stop) = (configuration.threads(), &*self.settings.stop);
                let base_dir = case.scene.base_dir();
                let mut trial = trial::run(&scene, base_dir, threads, case.protocol, limits, stop)?;
                if timed && compares_methods(case, configuration) {
                    trial.wear = worn(case, configuration, stop)?;
                }
                trial
            }
        };
        self.spent_s += started.elapsed().as_secs_f64();
        self.work[1] += weight;
        self.work[0] = self.work[0].max(self.work[1]);
        self.progress.left_s = Some(self.spent_s / self.work[1] * (self.work[0] - self.work[1]));
        if let Err(error) = self.store.put(&key, &trial) {
            self.broken = Some((self.settings.out.join("runs.jsonl"), error));
        }
        Some(trial)
    }
}

/// Whether nothing but the method of cutting differs from the base of the case.
fn compares_methods(case: &Case, configuration: &Configuration) -> bool {
    let base = Configuration::base(&case.axes);
    configuration
        .setting(Factor::Cutting)
        .is_some_and(|method| base.with(Factor::Cutting, method).key() == configuration.key())
}

/// The mesh after many cuts; nothing where the scene is refused, none where the study is to end.
fn worn(case: &Case, configuration: &Configuration, stop: &AtomicBool) -> Option<Vec<Wear>> {
    let mut set = configuration.overrides();
    set.extend(wear::at_rest(&case.bodies));
    let Ok(scene) = case.scene.apply_sets(&set) else { return Some(Vec::new()) };
    // The others have the mesh of one of these, or can take no further cut.
    let once = !["xfem", "snap"].contains(&configuration.label(Factor::Cutting));
    match wear::measure(&scene, case.scene.base_dir(), once, stop) {
        None if stop.load(Ordering::Relaxed) => None,
        found => Some(found.unwrap_or_default()),
    }
}

fn is_motion(case: &Case) -> bool {
    matches!(case.protocol, Protocol::Motion { .. })
}

/// How long runs may take. References and twins may take longer than what is compared.
fn limits(quick: bool, timed: bool) -> Limits {
    let run_s = if quick { 3.0 } else { 12.0 };
    if timed {
        Limits { run_s, repeat_s: if quick { 0.15 } else { 1.5 }, repeats: 11 }
    } else {
        Limits { run_s: 10.0 * run_s, repeat_s: 0.0, repeats: 1 }
    }
}

/// What a run is known by: scene, settings and protocol.
fn key(case: &Case, configuration: &Configuration) -> String {
    let scene = fingerprint(&format!("{}{:?}", case.scene.to_json(), case.protocol));
    format!("{} {scene} {}", case.name, configuration.key())
}

/// Expected work of a run: cells of the mesh times steps per frame, whatever the unit.
fn weight(case: &Case, configuration: &Configuration) -> f64 {
    let cells = configuration.setting(Factor::Mesh).map_or(1.0, |setting| (setting.size / 20.0).powi(3));
    let element = match configuration.label(Factor::Element) {
        "tet10" => 8.0,
        "hex8" => 2.0,
        _ => 1.0,
    };
    let steps = match case.protocol {
        Protocol::Static => 10.0,
        Protocol::Motion { frame_s, frames } => {
            f64::from(frames) * configuration.setting(Factor::Step).map_or(1.0, |h| frame_s / h.size)
        }
    };
    0.5 + cells * element * steps / 100.0
}

fn advise(budget_ms: f64, points: &[Outcome]) -> Recommendation {
    let words: Vec<String> = points.iter().map(|point| point.configuration.words()).collect();
    let mut candidates = Vec::with_capacity(points.len());
    for (point, words) in points.iter().zip(&words) {
        let (p99_ms, error) = (point.trial.cost.p99_ms, point.point().1);
        candidates.push(Candidate { p99_ms, error, words, sources: point.sources.as_ref() });
    }
    recommend(budget_ms, &candidates)
}

/// One-minute load average, where the system tells.
fn load() -> Option<f64> {
    std::fs::read_to_string("/proc/loadavg").ok()?.split_whitespace().next()?.parse().ok()
}
