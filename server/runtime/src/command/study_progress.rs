//! Progress of a study: a bar on a terminal, otherwise a line every few seconds.

use std::io::IsTerminal as _;
use std::sync::{Arc, Mutex, PoisonError, mpsc};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use scindo_study::Progress;

/// Longest time between two lines without a terminal, even if nothing new began.
const EVERY: Duration = Duration::from_secs(9);

/// Shortest time between two lines.
const SELDOM: Duration = Duration::from_secs(2);

/// Resolution of the bar when it shows time.
const PARTS: u64 = 1000;

/// A progress bar on the standard error; with `--json`, a hidden one.
pub fn bar(json: bool) -> ProgressBar {
    let target = if json { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
    let style = ProgressStyle::with_template("{bar:24} {pos}/{len} {wide_msg}");
    let bar = ProgressBar::with_draw_target(Some(0), target)
        .with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar.enable_steady_tick(Duration::from_millis(500));
    bar
}

/// Shows the progress of a study on the standard error.
pub struct StudyProgress {
    bar: ProgressBar,
    lines: Option<Lines>,
    started: Instant,
}

/// Writes lines from a thread of its own, so that a long run does not silence them.
struct Lines {
    message: Arc<Mutex<String>>,
    last: Arc<Mutex<Instant>>,
    end: mpsc::SyncSender<()>,
    thread: Option<JoinHandle<()>>,
}

impl StudyProgress {
    /// Writes to the standard error even with `--json`, because the report goes to the standard output.
    pub fn begin() -> Self {
        let terminal = std::io::stderr().is_terminal();
        let target = if terminal { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let style = ProgressStyle::with_template("{bar:24} {elapsed} {wide_msg}");
        let bar = ProgressBar::with_draw_target(Some(PARTS), target)
            .with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        bar.enable_steady_tick(Duration::from_millis(500));
        let lines = if terminal { None } else { Lines::begin() };
        Self { bar, lines, started: Instant::now() }
    }

    /// Shows the current progress.
    pub fn show(&self, progress: &Progress) {
        if let Some(note) = &progress.note {
            match &self.lines {
                None => self.bar.println(note),
                Some(_) => eprintln!("{note}"),
            }
            return;
        }
        let [from_s, until_s] = progress.case_s;
        let now_s = self.started.elapsed().as_secs_f64();
        let share = if until_s.is_finite() {
            (now_s - from_s) / (until_s - from_s)
        } else {
            progress.done as f64 / progress.total.max(1) as f64
        };
        self.bar.set_position((share.clamp(0.0, 1.0) * PARTS as f64) as u64);
        let how_far = match progress.total {
            0 => "reference".to_owned(),
            total => format!("{}/{total}", progress.done),
        };
        let left = if until_s.is_finite() {
            format!(", at most {} left", minutes((until_s - now_s).max(0.0)))
        } else {
            String::new()
        };
        let message = format!("{} {how_far}{left}: {}", progress.case, progress.what);
        match &self.lines {
            None => self.bar.set_message(message),
            Some(lines) => lines.set(message),
        }
    }

    /// Removes the bar.
    pub fn end(&self) {
        self.bar.finish_and_clear();
    }
}

impl Lines {
    /// `None` if the system cannot start another thread.
    fn begin() -> Option<Self> {
        let message = Arc::new(Mutex::new("reading the scene".to_owned()));
        let last = Arc::new(Mutex::new(Instant::now()));
        let (end, ended) = mpsc::sync_channel(1);
        let (text, told) = (message.clone(), last.clone());
        let started = Instant::now();
        let tick = move || {
            while ended.recv_timeout(Duration::from_millis(500)) == Err(mpsc::RecvTimeoutError::Timeout) {
                let mut told = told.lock().unwrap_or_else(PoisonError::into_inner);
                if told.elapsed() >= EVERY {
                    *told = Instant::now();
                    let text = text.lock().unwrap_or_else(PoisonError::into_inner);
                    eprintln!("[{:.0} s] {text}", started.elapsed().as_secs_f64());
                }
            }
        };
        let thread = std::thread::Builder::new().name("progress".to_owned()).spawn(tick).ok()?;
        Some(Self { message, last, end, thread: Some(thread) })
    }

    fn set(&self, message: String) {
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        if last.elapsed() >= SELDOM {
            *last = Instant::now();
            eprintln!("{message}");
        }
        *self.message.lock().unwrap_or_else(PoisonError::into_inner) = message;
    }
}

impl Drop for Lines {
    fn drop(&mut self) {
        let _ = self.end.send(());
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// A duration in words.
pub fn minutes(seconds: f64) -> String {
    let seconds = seconds.ceil() as u64;
    if seconds < 90 { format!("{seconds} s") } else { format!("{} min", seconds.div_ceil(60)) }
}
