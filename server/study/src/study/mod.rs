//! The study: runs every case and writes the pages.

pub mod effects;
mod survey;

use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::Instant;

use scindo_world::scene::{Scene, SceneError};
use thiserror::Error;

use crate::bench::Bench;
use crate::bench::progress::Progress;
use crate::bench::store::{Origin, Store};
use crate::case::{self, Case, Wishes};
use crate::design::axes::{Factor, block};
use crate::design::narrow;
use crate::page::table::Table;
use crate::report::result::ExperimentResult;
use crate::result::StudyResult;
use crate::settings::{SCENE_S, Settings};

/// Reason why a study cannot be made.
#[derive(Debug, Error)]
pub enum StudyError {
    /// A scene is invalid.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A name is neither a case nor a file.
    #[error("`{name}` is neither a scene file nor a case; {known}")]
    UnknownCase {
        /// The name that was given.
        name: String,
        /// What could be given instead.
        known: String,
    },
    /// Narrowing leaves no setting.
    #[error("`{label}` is not a setting of {factor} in case {case}; settings: {known}")]
    UnknownSetting {
        /// The factor that was narrowed.
        factor: &'static str,
        /// The label that was given.
        label: String,
        /// Name of the case.
        case: String,
        /// Labels that the case has.
        known: String,
    },
    /// A file or directory cannot be written.
    #[error("cannot write {}: {source}; check that the directory is writable and has room", path.display())]
    Io {
        /// The file or directory.
        path: PathBuf,
        /// The message of the system.
        source: io::Error,
    },
}

/// What names stand for, beside scene files.
pub trait Library {
    /// The cases of a name or group; none if it stands for none.
    fn cases(&self, name: &str, quick: bool) -> Vec<Case>;
    /// The experiments of a name or group; none if it stands for none.
    fn experiments(&self, name: &str) -> &'static [&'static str];
    /// Makes an experiment.
    fn make(
        &self,
        experiment: &'static str,
        settings: &Settings,
        tell: &mut dyn FnMut(&Progress),
    ) -> ExperimentResult;
    /// All names, for the message that refuses another one.
    fn names(&self) -> String;
}

/// No names: only scene files are studied.
pub struct Scenes;

impl Library for Scenes {
    fn cases(&self, _: &str, _: bool) -> Vec<Case> {
        Vec::new()
    }

    fn experiments(&self, _: &str) -> &'static [&'static str] {
        &[]
    }

    fn make(&self, name: &'static str, _: &Settings, _: &mut dyn FnMut(&Progress)) -> ExperimentResult {
        ExperimentResult { name, ..ExperimentResult::default() }
    }

    fn names(&self) -> String {
        "give the path of a scene file".to_owned()
    }
}

/// Runs a study of scene files and writes `points.csv`, `study.json`, a plot per case and `index.html`.
///
/// # Errors
/// Bad names, bad scenes, or files that cannot be written. Failed runs are results.
///
/// ```
/// use std::sync::Arc;
/// use std::sync::atomic::AtomicBool;
///
/// use scindo_study::{Settings, run};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let directory = tempfile::tempdir()?;
/// let scene = directory.path().join("block.toml");
/// # let text = r#"
/// # schema = 1
/// # world = { gravity_m_s2 = [0, 0, -9.81] }
/// # [[body]]
/// # id = "block"
/// # mesh = { box = { min_m = [0, 0, 0], max_m = [0.1, 0.1, 0.1], cells = [2, 2, 2] } }
/// # law = "linear"
/// # integrator = "static"
/// # young_pa = 1e4
/// # poisson = 0.3
/// # density_kg_m3 = 1000
/// # fix = [{ where = { slab = { axis = "z", from = 0, to = 0 } } }]
/// # "#;
/// # std::fs::write(&scene, text)?;
/// let settings = Settings {
///     cases: vec![scene.display().to_string()],
///     out: directory.path().join("accuracy"),
///     quick: true,
///     within_s: Some(1.0),
///     budget_ms: Some(10.0),
///     seconds: None,
///     only: Vec::new(),
///     cells: Vec::new(),
///     surface: None,
///     stop: Arc::new(AtomicBool::new(false)),
/// };
/// let result = run(&settings, &mut |progress| println!("{}", progress.what))?;
/// assert_eq!(result.cases.len(), 1);
/// assert!(settings.out.join("index.html").exists() && !result.interrupted);
/// # Ok(())
/// # }
/// ```
pub fn run(settings: &Settings, tell: &mut dyn FnMut(&Progress)) -> Result<StudyResult, StudyError> {
    run_with(&Scenes, settings, tell)
}

/// As [`run`], with names that stand for the cases and experiments of a library.
///
/// # Errors
/// Those of [`run`].
pub fn run_with(
    library: &dyn Library,
    settings: &Settings,
    tell: &mut dyn FnMut(&Progress),
) -> Result<StudyResult, StudyError> {
    let cases = open(library, settings)?;
    let origin = Origin::here();
    let io = |(path, source)| StudyError::Io { path, source };
    let store = Store::open(&settings.out, &origin).map_err(io)?;
    Table::begin(&settings.out).map_err(io)?;
    let wanted = settings.cases.iter().flat_map(|name| library.experiments(name)).copied();
    let started = Instant::now();
    let mut bench = Bench::new(settings, store, &mut *tell);
    let resumed = bench.store.resumed;
    let mut result = StudyResult {
        cases: Vec::new(),
        experiments: Vec::new(),
        origin,
        resumed,
        seconds: 0.0,
        load: [load(), None],
        interrupted: false,
    };
    let mut waiting = cases.len();
    for case in cases {
        let seconds = share(settings, &case, waiting, bench.elapsed_s());
        result.cases.push(survey::study(&mut bench, case, seconds));
        waiting -= 1;
        result.seconds = bench.elapsed_s();
        result.load[1] = load();
        result.interrupted = settings.stop.load(Ordering::Relaxed);
        if let Some((path, source)) = bench.broken.take() {
            return Err(StudyError::Io { path, source });
        }
        Table::whole(&settings.out, &result).map_err(io)?;
        crate::page::write(&settings.out, &result).map_err(io)?;
        if result.interrupted {
            break;
        }
    }
    drop(bench);
    for name in wanted {
        if settings.stop.load(Ordering::Relaxed) {
            result.interrupted = true;
            break;
        }
        result.experiments.push(library.make(name, settings, &mut *tell));
        result.seconds = started.elapsed().as_secs_f64();
        result.load[1] = load();
        result.interrupted = settings.stop.load(Ordering::Relaxed);
        crate::page::write(&settings.out, &result).map_err(io)?;
    }
    Ok(result)
}

/// Time for the next of `waiting` cases [s]: an equal share of the remaining budget.
fn share(settings: &Settings, case: &Case, waiting: usize, elapsed_s: f64) -> f64 {
    match (settings.within_s, &case.truth) {
        (Some(within_s), _) => (within_s - elapsed_s).max(0.0) / waiting as f64,
        (None, case::Truth::Refined { .. }) => SCENE_S[usize::from(settings.quick)],
        (None, _) => f64::INFINITY,
    }
}

/// Opens the requested cases and narrows them.
fn open(library: &dyn Library, settings: &Settings) -> Result<Vec<Case>, StudyError> {
    let mut cases = Vec::new();
    let threads = threads(settings);
    for name in settings.cases.iter().filter(|name| library.experiments(name).is_empty()) {
        let known = library.cases(name, settings.quick);
        if !known.is_empty() {
            cases.extend(known);
        } else if Path::new(name).exists() {
            let scene = Scene::load(Path::new(name))?;
            cases.push(case::from_scene(&scene, wishes(settings, &threads))?);
        } else {
            return Err(StudyError::UnknownCase { name: name.clone(), known: library.names() });
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

/// The user's choices that concern scenes.
fn wishes<'a>(settings: &'a Settings, threads: &'a [usize]) -> Wishes<'a> {
    Wishes {
        seconds: settings.seconds,
        quick: settings.quick,
        cells: &settings.cells,
        threads,
        directory: &settings.out,
    }
}

/// Numbers of threads that the user asked for.
fn threads(settings: &Settings) -> Vec<usize> {
    let asked = settings.only.iter().filter(|(factor, _)| *factor == Factor::Threads);
    asked.flat_map(|(_, labels)| labels.iter().filter_map(|label| label.parse().ok())).collect()
}

/// Replaces the meshes of a built-in case by scaled copies of the base mesh with the wished fineness.
fn replace_meshes(case: &mut Case, cells: &[usize]) {
    if matches!(case.truth, case::Truth::Refined { .. }) {
        return;
    }
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

/// One-minute load average, if the system reports it.
fn load() -> Option<f64> {
    std::fs::read_to_string("/proc/loadavg").ok()?.split_whitespace().next()?.parse().ok()
}
