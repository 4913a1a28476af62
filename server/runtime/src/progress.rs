//! Progress of long work: a bar on a terminal, a few lines elsewhere, nothing with `--json`.

use std::cell::Cell;
use std::io::IsTerminal as _;

use indicatif::{ProgressBar, ProgressStyle};

/// See the module.
pub struct Progress {
    bar: Option<ProgressBar>,
    total: u64,
    /// Tenths told so far, where there is no terminal.
    told: Cell<u64>,
    what: &'static str,
    quiet: bool,
}

impl Progress {
    /// Work of `total` units; `None` if it has no end.
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

    /// `done` units are done.
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

    /// The work ended.
    pub fn end(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}
