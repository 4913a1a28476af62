//! The bench runs configurations, stores finished runs, watches the time and reports progress.

pub mod runner;

pub mod forecast;

pub mod store;

pub mod progress;

use std::io;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use crate::case::{Case, Truth};
use crate::design::Configuration;
use crate::design::axes::Factor;
use crate::settings::Settings;
use crate::trial::wear::{self, Wear};
use crate::trial::{self, Limits, Protocol, Status, Trial, one_line};
use forecast::Forecast;
use progress::Progress;
use runner::{Ask, Runner};
use store::{Store, fingerprint};

/// Makes the runs of all cases.
pub struct Bench<'a> {
    settings: &'a Settings,
    /// Finished runs, on disk.
    pub store: Store,
    tell: &'a mut dyn FnMut(&Progress),
    progress: Progress,
    forecast: Forecast,
    started: Instant,
    /// When the present case must end [s since the start]; infinite without a budget.
    until_s: f64,
    /// First file that could not be written. It ends the study.
    pub broken: Option<(PathBuf, io::Error)>,
}

impl<'a> Bench<'a> {
    /// A bench that continues with the runs in `store`.
    pub fn new(settings: &'a Settings, store: Store, tell: &'a mut dyn FnMut(&Progress)) -> Self {
        Self {
            settings,
            store,
            tell,
            progress: Progress::default(),
            forecast: Forecast::default(),
            started: Instant::now(),
            until_s: f64::INFINITY,
            broken: None,
        }
    }

    /// Settings of the study.
    pub fn settings(&self) -> &'a Settings {
        self.settings
    }

    /// Begins a case that may take `seconds` from now.
    pub fn begin(&mut self, case: &str, seconds: f64) {
        self.until_s = self.elapsed_s() + seconds;
        self.progress = Progress { case: case.to_owned(), ..Progress::default() };
        self.progress.case_s = [self.elapsed_s(), self.until_s];
    }

    /// Seconds since the study began.
    pub fn elapsed_s(&self) -> f64 {
        self.started.elapsed().as_secs_f64()
    }

    /// Whether the study must end: it was stopped, or a file could not be written.
    pub fn is_over(&self) -> bool {
        self.settings.stop.load(Ordering::Relaxed) || self.broken.is_some()
    }

    /// Shows a sentence to the user.
    pub fn note(&mut self, note: String) {
        self.progress.note = Some(note);
        (self.tell)(&self.progress);
        self.progress.note = None;
    }

    /// Reports how many points are done and planned.
    pub fn count(&mut self, done: usize, total: usize) {
        (self.progress.done, self.progress.total) = (done, total);
    }

    /// A runner for `case`.
    pub fn on<'b>(&'b mut self, case: &'b Case) -> On<'b, 'a> {
        On { bench: self, case }
    }

    /// Repeats a run even if its result is stored. The new result is not stored.
    pub fn again(&mut self, case: &Case, configuration: &Configuration, ask: Ask) -> Option<Trial> {
        if self.is_over() {
            return None;
        }
        self.progress.what = format!("once more: {}", configuration.words());
        (self.tell)(&self.progress);
        self.make(case, configuration, ask)
    }

    fn make(&mut self, case: &Case, configuration: &Configuration, ask: Ask) -> Option<Trial> {
        let scene = match case.scene.apply_sets(&configuration.overrides()) {
            Ok(scene) => scene,
            Err(error) => return Some(Trial::refused(one_line(&error.to_string()))),
        };
        let limits = self.limits(ask);
        let stop = &*self.settings.stop;
        let base_dir = case.scene.base_dir();
        let mut trial = trial::run(&scene, base_dir, configuration.threads(), case.protocol, limits, stop)?;
        if ask.timed && compares_methods(case, configuration) {
            trial.wear = worn(case, configuration, stop)?;
        }
        Some(trial)
    }

    fn limits(&self, ask: Ask) -> Limits {
        let repeat_s = match (ask.timed, self.settings.quick) {
            (false, _) => 0.0,
            (true, true) => 0.15,
            (true, false) => self.settings.within_s.map_or(1.5, |within_s| 1.5_f64.min(within_s / 200.0)),
        };
        Limits { run_s: ask.cap_s, repeat_s, repeats: if ask.timed { 11 } else { 1 } }
    }

    fn known(&self, case: &Case, configuration: &Configuration, timed: bool) -> Option<&Trial> {
        let is_motion = matches!(case.protocol, Protocol::Motion { .. });
        let enough = |trial: &&Trial| !timed || trial.cost.count != 1 || is_motion;
        self.store.get(&key(case, configuration)).filter(enough)
    }
}

/// The bench at work on one case.
pub struct On<'b, 'a> {
    bench: &'b mut Bench<'a>,
    case: &'b Case,
}

impl Runner for On<'_, '_> {
    fn run(&mut self, configuration: &Configuration, ask: Ask) -> Option<Trial> {
        let Self { bench, case } = self;
        if bench.is_over() {
            return None;
        }
        if let Some(trial) = bench.known(case, configuration, ask.timed) {
            return Some(trial.clone());
        }
        bench.progress.what = configuration.words();
        (bench.tell)(&bench.progress);
        let before_s = bench.elapsed_s();
        let trial = bench.make(case, configuration, ask)?;
        let seconds = bench.elapsed_s() - before_s;
        if trial.is_done() {
            bench.forecast.learn(case, configuration, seconds);
        }
        // A run that was stopped for its time may end when there is more time, so it is not stored.
        if trial.status != Status::Late
            && let Err(error) = bench.store.put(&key(case, configuration), &trial)
        {
            bench.broken = Some((bench.settings.out.join("runs.jsonl"), error));
        }
        Some(trial)
    }

    fn left_s(&self) -> f64 {
        self.bench.until_s - self.bench.elapsed_s()
    }

    fn forecast_s(&self, configuration: &Configuration, timed: bool) -> f64 {
        if self.bench.known(self.case, configuration, timed).is_some() {
            return 0.0;
        }
        self.bench.forecast.seconds(self.case, configuration).unwrap_or(0.0)
    }
}

/// Key of a run in the store: scene, settings and protocol.
fn key(case: &Case, configuration: &Configuration) -> String {
    let mut set = configuration.overrides();
    set.push(format!("{:?}", case.protocol));
    let scene = fingerprint(&format!("{}{}", case.scene.to_json(), set.join("\n")));
    let words =
        if let Truth::Refined { .. } = case.truth { configuration.words() } else { configuration.key() };
    format!("{} {scene} {words}", case.name)
}

/// Whether the point differs from the base of the case only in the method of cutting.
fn compares_methods(case: &Case, configuration: &Configuration) -> bool {
    let base = Configuration::base(&case.axes);
    configuration
        .setting(Factor::Cutting)
        .is_some_and(|method| base.with(Factor::Cutting, method).key() == configuration.key())
}

/// Quality of the mesh after many cuts. Empty if the scene is refused; `None` if the study must end.
fn worn(case: &Case, configuration: &Configuration, stop: &AtomicBool) -> Option<Vec<Wear>> {
    let mut set = configuration.overrides();
    set.extend(wear::at_rest(&case.bodies));
    let Ok(scene) = case.scene.apply_sets(&set) else { return Some(Vec::new()) };
    // The other methods have the mesh of one of these, or can take no further cut.
    let once = !["xfem", "snap"].contains(&configuration.label(Factor::Cutting));
    match wear::measure(&scene, case.scene.base_dir(), once, stop) {
        None if stop.load(Ordering::Relaxed) => None,
        found => Some(found.unwrap_or_default()),
    }
}
