//! The loop: absolute deadlines every millisecond, and the statistics of a run.
//!
//! A missed deadline is counted and skipped. The next one keeps its place on the grid, so lateness never
//! accumulates.

use crate::clock::LoopClock;
use crate::constants::PERIOD_NS;
use crate::statistics::{Histogram, LoopReport};
use crate::tick::{HapticTick, TickTime};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Ticks until `stop` is raised or `duration` has passed.
pub fn run(
    mut tick: HapticTick,
    clock: LoopClock,
    stop: &AtomicBool,
    duration: Option<Duration>,
) -> LoopReport {
    let sleeper = spin_sleep::SpinSleeper::default();
    let (mut lateness, mut work) = (Histogram::default(), Histogram::default());
    let start_ns = clock.now_ns();
    let end_ns = duration.map_or(u64::MAX, |d| start_ns.saturating_add(d.as_nanos() as u64));
    let (mut deadline_ns, mut woke_ns, mut missed) = (start_ns, start_ns, 0);
    while !stop.load(Ordering::Relaxed) && deadline_ns + PERIOD_NS <= end_ns {
        deadline_ns += PERIOD_NS;
        sleeper.sleep_until(clock.instant(deadline_ns));
        let now_ns = clock.now_ns();
        woke_ns = now_ns;
        let late_ns = now_ns.saturating_sub(deadline_ns);
        let skipped = late_ns / PERIOD_NS;
        deadline_ns += skipped * PERIOD_NS;
        missed += skipped;

        tick.tick(TickTime { now_ns, elapsed_s: ((1 + skipped) * PERIOD_NS) as f64 * 1e-9 });

        lateness.record(late_ns);
        work.record(clock.now_ns() - now_ns);
    }
    let seconds = woke_ns.saturating_sub(start_ns) as f64 * 1e-9;
    let report = tick.close();
    LoopReport {
        seconds,
        rate_hz: if seconds > 0.0 { report.ticks as f64 / seconds } else { 0.0 },
        missed_ticks: missed,
        lateness_ms: lateness.quantiles_ms(),
        duration_ms: work.quantiles_ms(),
        ..report
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::model::contact_slot;
    use crate::tick::Ports;
    use crate::tick::fixture::{FakeDevice, LIMITS};
    use std::sync::Arc;

    #[test]
    fn ticks_and_missed_ticks_add_up_to_the_time() {
        let (_input, contacts) = contact_slot();
        let server_alive = Arc::new(AtomicBool::new(true));
        let ports = Ports { contacts, server_alive, poses: None, log: None, meter: None };
        let tick = HapticTick::new(Box::new(FakeDevice::new()), LIMITS, ports);
        let stop = AtomicBool::new(false);
        let report = run(tick, LoopClock::default(), &stop, Some(Duration::from_millis(200)));
        assert_eq!(report.lateness_ms.count, report.ticks);
        // However late the loop woke: every millisecond up to the last tick was used or counts as missed.
        let passed = (report.seconds * 1e9).round() as u64 / PERIOD_NS;
        assert!(report.ticks + report.missed_ticks == passed && passed >= 200, "{report:?}");
    }
}
