//! Progress of long work: a bar on a terminal, a few lines elsewhere, nothing with `--json`.

use std::cell::Cell;
use std::io::IsTerminal as _;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use scindo_world::mesh_in::Meshing;
use scindo_world::quantity::{digits, duration, memory};

/// Without a terminal, a line is written this often.
const EVERY: Duration = Duration::from_secs(3);

/// Meshes that take less than this [s] are not announced.
const WORTH_A_WORD_S: f64 = 2.0;

/// Progress of work that is counted in units, such as steps.
pub struct Progress {
    bar: Option<ProgressBar>,
    total: u64,
    /// Tenths of the total reported so far without a terminal.
    told: Cell<u64>,
    what: &'static str,
    quiet: bool,
}

impl Progress {
    /// Starts to report work of `total` units; `None` if the work has no end.
    pub fn begin(what: &'static str, total: Option<u64>, json: bool) -> Self {
        let terminal = std::io::stderr().is_terminal();
        let bar = total.filter(|_| terminal && !json).map(|total| {
            let template = "{bar:40} {pos}/{len} {msg} {per_sec} {eta} left";
            let style =
                ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
            ProgressBar::new(total).with_style(style).with_message(what)
        });
        Self { bar, total: total.unwrap_or(0), told: Cell::new(0), what, quiet: json || terminal }
    }

    /// Reports that `done` units are done.
    pub fn at(&self, done: u64) {
        if let Some(bar) = &self.bar {
            bar.set_position(done);
            return;
        }
        let Some(tenths) = (10 * done).checked_div(self.total) else { return };
        if !self.quiet && tenths > self.told.get() {
            self.told.set(tenths);
            eprintln!("{done}/{} {}", self.total, self.what);
        }
    }

    /// Removes the bar.
    pub fn end(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

/// Progress of work that reports the fraction done, from any thread: meshing, a forecast.
pub struct Share {
    bar: Option<ProgressBar>,
    quiet: bool,
    /// When the last line was written, and whether the work was announced.
    told: Mutex<(Instant, bool)>,
}

impl Share {
    /// Shows nothing until the first report arrives.
    pub fn begin(json: bool) -> Self {
        let terminal = std::io::stderr().is_terminal();
        let bar = (terminal && !json).then(|| {
            let style = ProgressStyle::with_template("{bar:40} {percent:>3} % {msg}")
                .unwrap_or_else(|_| ProgressStyle::default_bar());
            ProgressBar::new(1000).with_style(style)
        });
        Self { bar, quiet: json, told: Mutex::new((Instant::now(), false)) }
    }

    /// Reports the progress of meshing. Long meshing is announced once, with its size and time.
    pub fn meshing(&self, at: Meshing) {
        let expected = &at.estimate;
        let worth_a_word = expected.seconds > WORTH_A_WORD_S && !self.quiet;
        let mut told = self.told.lock().unwrap_or_else(PoisonError::into_inner);
        if worth_a_word && !std::mem::replace(&mut told.1, true) {
            let text = format!(
                "meshing at {} cells: about {} tetrahedra, {} and {} on this machine",
                expected.cells,
                if expected.tets >= 1e6 {
                    format!("{} million", digits(1e-6 * expected.tets))
                } else {
                    format!("{:.0} thousand", 1e-3 * expected.tets)
                },
                memory(expected.bytes),
                duration(expected.seconds)
            );
            match &self.bar {
                Some(bar) => bar.println(text),
                None => eprintln!("{text}"),
            }
        }
        drop(told);
        self.at(at.done, at.stage);
    }

    /// Reports that the fraction `done` (0 to 1) of the work `what` is done.
    pub fn at(&self, done: f64, what: &str) {
        if let Some(bar) = &self.bar {
            bar.set_position((1e3 * done) as u64);
            bar.set_message(what.to_owned());
            return;
        }
        let mut told = self.told.lock().unwrap_or_else(PoisonError::into_inner);
        if !self.quiet && told.0.elapsed() > EVERY {
            told.0 = Instant::now();
            eprintln!("{:.0} % {what}", 100.0 * done);
        }
    }

    /// Removes the bar.
    pub fn end(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}
