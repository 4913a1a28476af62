//! How long ago a client's hand was at a pose, although its clock differs from that of the server.
//!
//! The time from sending to arrival, as the two clocks tell it, is the way plus the difference of the clocks. Its least
//! value within some seconds belongs to a pose that waited nowhere, so its way took half of the least round trip that
//! the client has measured. What remains is the difference of the clocks.

use std::time::{Duration, Instant};

use scindo_proto::messages::ToolSample;

/// How long the least values are kept. Clocks of machines drift apart by less than a tenth of a millisecond in it.
const WINDOW: Duration = Duration::from_secs(5);

/// Least values of one window.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Least {
    /// Time of arrival minus time of sending [ns].
    apart_ns: i64,
    /// Round trip [ns]; the largest number as long as none is known.
    round_trip_ns: i64,
}

const NOTHING: Least = Least { apart_ns: i64::MAX, round_trip_ns: i64::MAX };

/// The way of the poses of one tool.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OneWay {
    start: Instant,
    since: Instant,
    now: Least,
    before: Least,
}

impl OneWay {
    /// The way of a tool that was taken at `now`.
    pub fn new(now: Instant) -> Self {
        Self { start: now, since: now, now: NOTHING, before: NOTHING }
    }

    /// Takes notice of a pose that arrived at `now`.
    pub fn arrived(&mut self, sample: &ToolSample, now: Instant) {
        if now.duration_since(self.since) > WINDOW {
            (self.before, self.now, self.since) = (self.now, NOTHING, now);
        }
        let apart_ns = self.apart_ns(sample.client_time_ns, now);
        let least = &mut self.now;
        least.apart_ns = least.apart_ns.min(apart_ns);
        let round_trip_ns = f64::from(sample.round_trip_ms) * 1e6;
        if round_trip_ns > 0.0 {
            least.round_trip_ns = least.round_trip_ns.min(round_trip_ns as i64);
        }
    }

    /// Time from the moment at which the client's clock showed `client_time_ns` to `now`; `None` as long as the client
    /// has not measured a round trip.
    pub fn since(&self, client_time_ns: u64, now: Instant) -> Option<Duration> {
        let apart_ns = self.now.apart_ns.min(self.before.apart_ns);
        let round_trip_ns = self.now.round_trip_ns.min(self.before.round_trip_ns);
        if client_time_ns == 0 || apart_ns == i64::MAX || round_trip_ns == i64::MAX {
            return None;
        }
        let way_ns = self.apart_ns(client_time_ns, now).saturating_sub(apart_ns);
        u64::try_from(way_ns.saturating_add(round_trip_ns / 2)).ok().map(Duration::from_nanos)
    }

    /// Time [ns] from `client_time_ns` of the client's clock to `now` of this one, each from a beginning of its own.
    fn apart_ns(&self, client_time_ns: u64, now: Instant) -> i64 {
        let here = i64::try_from(now.duration_since(self.start).as_nanos()).unwrap_or(i64::MAX);
        here.saturating_sub(i64::try_from(client_time_ns).unwrap_or(i64::MAX))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    #[test]
    fn the_clocks_may_differ_by_years() {
        let start = Instant::now();
        for clock_ns in [1_000 * MS, 1_800_000_000_000 * MS] {
            let mut way = OneWay::new(start);
            assert_eq!(way.since(clock_ns, start), None, "nothing is known");
            // Every tenth pose takes 3 ms, the others wait for a while. A round trip takes 6 ms or more.
            for i in 0..200 {
                let wait = if i % 10 == 0 { 0 } else { 1 + i % 7 };
                let sample = ToolSample {
                    client_time_ns: clock_ns + i * 2 * MS,
                    round_trip_ms: 6.0 + wait as f32,
                    ..ToolSample::default()
                };
                way.arrived(&sample, start + Duration::from_millis(2 * i + 3 + wait));
            }
            let since = way.since(clock_ns + 300 * MS, start + Duration::from_millis(340)).unwrap();
            assert!((since.as_secs_f64() - 0.040).abs() < 1e-5, "{since:?}");
        }
    }

    #[test]
    fn a_way_that_becomes_longer_is_known_after_two_windows() {
        let start = Instant::now();
        let mut way = OneWay::new(start);
        let mut send = |from_s: u64, to_s: u64, takes_ms: u64| {
            for i in from_s * 100..to_s * 100 {
                let sample = ToolSample {
                    client_time_ns: 1 + i * 10 * MS,
                    round_trip_ms: 2.0 * takes_ms as f32,
                    ..ToolSample::default()
                };
                way.arrived(&sample, start + Duration::from_millis(10 * i + takes_ms));
            }
            let told = way.since(1 + to_s * 1000 * MS, start + Duration::from_millis(to_s * 1000 + 50));
            told.unwrap().as_secs_f64()
        };
        assert!((send(0, 4, 1) - 0.050).abs() < 1e-5);
        assert!((send(4, 20, 20) - 0.050).abs() < 1e-5);
    }
}
