//! `scindo top`: what a server does at present, in a terminal. It looks as any client does, over the network.

pub mod report;

pub mod screen;

use std::time::{Duration, Instant};

use scindo_client::messages::{SessionInfo, Stats};

/// A report is late after this time; servers send five per second.
const LATE: Duration = Duration::from_secs(2);

/// What the screen shows.
#[derive(Debug, Clone, Default)]
pub struct View {
    /// Where the server is, as the user named it.
    pub at: String,
    /// Scene, bodies and tools.
    pub info: SessionInfo,
    /// The newest report.
    pub stats: Option<Stats>,
    /// When the newest statistics came.
    pub came: Option<Instant>,
    /// Refused messages per second, by reason, in the order of the report.
    pub refused_hz: Vec<f64>,
}

impl View {
    /// Takes a report that came at `now`.
    pub fn take(&mut self, stats: Stats, now: Instant) {
        let seconds = self.came.map_or(0.0, |came| now.duration_since(came).as_secs_f64());
        let before = self.stats.as_ref().map_or(&[][..], |stats| &stats.refused);
        let rate = |name: &str, count: u64| {
            let old = before.iter().find(|old| old.name == name).map_or(0, |old| old.count);
            if seconds > 0.0 { count.saturating_sub(old) as f64 / seconds } else { 0.0 }
        };
        self.refused_hz = stats.refused.iter().map(|counter| rate(&counter.name, counter.count)).collect();
        self.stats = Some(stats);
        self.came = Some(now);
    }

    /// Seconds since the last report, if it is late.
    pub fn late_s(&self, now: Instant) -> Option<u64> {
        let age = now.duration_since(self.came?);
        (age > LATE).then_some(age.as_secs())
    }
}
