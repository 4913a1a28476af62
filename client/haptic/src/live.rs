//! Figures while the loop runs: a terminal shows one line that is rewritten, other outputs get a line per
//! second.
//!
//! The loop writes its figures to a [`Meter`] with single atomic operations. Another thread reads and prints
//! them.

use std::io::IsTerminal as _;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crossbeam_channel::{RecvTimeoutError, Sender};
use indicatif::{ProgressBar, ProgressStyle};

use crate::log::row::LogRow;
use crate::safety::flag;

/// How often the line on a terminal changes.
const TERMINAL_PERIOD: Duration = Duration::from_millis(100);

/// How often a line is written without a terminal.
const LINE_PERIOD: Duration = Duration::from_secs(1);

/// What happened since the last reading. The loop writes it without waiting.
#[derive(Debug, Default)]
pub struct Meter {
    ticks: AtomicU64,
    touch_ticks: AtomicU64,
    /// Force at the last tick, and largest force since the last reading [µN].
    force_un: AtomicU64,
    peak_un: AtomicU64,
    /// Largest age of the contact in use since the last reading [µs].
    age_us: AtomicU64,
    /// All flags raised since the last reading.
    flags: AtomicU32,
}

impl Meter {
    /// Counts one tick.
    pub fn record(&self, row: &LogRow) {
        let force_un = (row.force_n.norm() * 1e6) as u64;
        self.ticks.fetch_add(1, Ordering::Relaxed);
        self.touch_ticks.fetch_add(u64::from(force_un > 0), Ordering::Relaxed);
        self.force_un.store(force_un, Ordering::Relaxed);
        self.peak_un.fetch_max(force_un, Ordering::Relaxed);
        self.age_us.fetch_max((row.contact_age_ms * 1e3) as u64, Ordering::Relaxed);
        self.flags.fetch_or(row.flags, Ordering::Relaxed);
    }

    /// Returns the figures of the interval `elapsed`, in which `contacts` messages arrived, and resets them.
    fn take(&self, contacts: u64, elapsed: Duration) -> Figures {
        let per_second = |count: u64| count as f64 / elapsed.as_secs_f64().max(1e-9);
        Figures {
            force_n: self.force_un.load(Ordering::Relaxed) as f64 * 1e-6,
            peak_n: self.peak_un.swap(0, Ordering::Relaxed) as f64 * 1e-6,
            loop_hz: per_second(self.ticks.swap(0, Ordering::Relaxed)),
            contact_hz: per_second(contacts),
            age_ms: self.age_us.swap(0, Ordering::Relaxed) as f64 * 1e-3,
            touches: self.touch_ticks.swap(0, Ordering::Relaxed) > 0,
            flags: self.flags.swap(0, Ordering::Relaxed),
        }
    }
}

/// The figures of one line.
#[derive(Debug)]
struct Figures {
    force_n: f64,
    peak_n: f64,
    loop_hz: f64,
    contact_hz: f64,
    age_ms: f64,
    touches: bool,
    flags: u32,
}

impl Figures {
    /// The worst present state of the touch.
    fn state(&self) -> &'static str {
        let has = |flags| self.flags & flags != 0;
        match () {
            () if has(flag::DEVICE_FAULTS) => "device fault",
            () if has(flag::LOST) => "no contact messages",
            () if has(flag::STALE) => "contact too old",
            () if has(flag::WAITING) => "waiting for free space",
            () if self.touches => "touching",
            () => "free",
        }
    }
}

impl std::fmt::Display for Figures {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { force_n, peak_n, loop_hz, contact_hz, age_ms, .. } = self;
        write!(
            f,
            "force {force_n:5.2} N (peak {peak_n:5.2})   loop {loop_hz:4.0} Hz   contact {contact_hz:4.0} Hz   "
        )?;
        // Before the first message, the loop counts an age beyond every clock.
        if *age_ms < 1e5 {
            write!(f, "age {age_ms:5.1} ms   ")?;
        } else {
            write!(f, "age     - ms   ")?;
        }
        f.write_str(self.state())
    }
}

/// The thread that prints the figures.
pub struct Live {
    stop: Sender<()>,
    thread: JoinHandle<()>,
}

impl Live {
    /// Starts to print. `contacts` returns the number of messages taken so far.
    ///
    /// # Errors
    /// The system cannot start another thread.
    pub fn start(meter: Arc<Meter>, contacts: impl Fn() -> u64 + Send + 'static) -> std::io::Result<Self> {
        let (stop, stopped) = crossbeam_channel::bounded::<()>(1);
        let terminal = std::io::stderr().is_terminal();
        let period = if terminal { TERMINAL_PERIOD } else { LINE_PERIOD };
        let run = move || {
            let line = terminal.then(line);
            let (mut seen, mut looked) = (contacts(), Instant::now());
            while stopped.recv_timeout(period) == Err(RecvTimeoutError::Timeout) {
                let (now, count) = (Instant::now(), contacts());
                let figures = meter.take(count - seen, now - looked);
                (seen, looked) = (count, now);
                match &line {
                    Some(line) => line.set_message(figures.to_string()),
                    None => eprintln!("{figures}"),
                }
            }
            if let Some(line) = line {
                line.finish_and_clear();
            }
        };
        let thread = std::thread::Builder::new().name("haptic-live".into()).spawn(run)?;
        Ok(Self { stop, thread })
    }

    /// Ends the thread and its line.
    pub fn end(self) {
        drop(self.stop);
        if self.thread.join().is_err() {
            tracing::error!("the live figures panicked");
        }
    }
}

fn line() -> ProgressBar {
    let style =
        ProgressStyle::with_template("{wide_msg}").unwrap_or_else(|_| ProgressStyle::default_spinner());
    ProgressBar::new_spinner().with_style(style)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    fn row(force_n: f64, contact_age_ms: f64, flags: u32) -> LogRow {
        let zero = Vector3::zeros();
        LogRow {
            time_s: 0.0,
            position_m: zero,
            velocity_m_s: zero,
            tissue_n: zero,
            force_n: Vector3::new(0.0, 0.0, force_n),
            contact_seq: 1,
            contact_age_ms,
            round_trip_ms: 0.0,
            epoch: 1,
            energy_j: 0.0,
            flags,
        }
    }

    #[test]
    fn a_look_tells_what_happened_since_the_last_one() {
        let meter = Meter::default();
        for (force, age) in [(0.5, 1.0), (1.25, 4.0), (0.75, 2.0)] {
            meter.record(&row(force, age, 0));
        }
        let line = meter.take(48, Duration::from_millis(100)).to_string();
        for part in
            ["force  0.75 N (peak  1.25)", "loop   30 Hz", "contact  480 Hz", "age   4.0 ms", "touching"]
        {
            assert!(line.contains(part), "{part}: {line}");
        }
        let line = meter.take(0, Duration::from_millis(100)).to_string();
        assert!(line.contains("loop    0 Hz") && line.ends_with("free"), "{line}");
    }

    #[test]
    fn the_worst_state_is_named_and_an_age_without_messages_is_none() {
        let meter = Meter::default();
        meter.record(&row(0.0, 1e6, flag::STALE | flag::LOST | flag::WAITING));
        let line = meter.take(0, Duration::from_secs(1)).to_string();
        assert!(line.contains("age     - ms") && line.ends_with("no contact messages"), "{line}");
    }
}
