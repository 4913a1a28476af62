//! Statistics of a run: rates, jitter, round trips, largest force step. No allocation after start-up.

use serde::Serialize;

/// Sub-buckets per octave: resolution 1.6 %.
const SUB: u64 = 64;
const BUCKETS: usize = 60 * SUB as usize;

/// Histogram of durations with logarithmic buckets; fixed size, 30 KiB.
#[derive(Debug, Clone)]
pub struct Histogram {
    buckets: Box<[u64]>,
    count: u64,
    max_ns: u64,
}

impl Default for Histogram {
    fn default() -> Self {
        Self { buckets: vec![0; BUCKETS].into_boxed_slice(), count: 0, max_ns: 0 }
    }
}

impl Histogram {
    /// Counts one duration.
    pub fn record(&mut self, ns: u64) {
        self.buckets[bucket(ns)] += 1;
        self.count += 1;
        self.max_ns = self.max_ns.max(ns);
    }

    /// Duration below which the fraction `q` of all durations lies [ns], rounded up to its bucket.
    pub fn quantile_ns(&self, q: f64) -> u64 {
        let rank = (q * self.count as f64).ceil().max(1.0) as u64;
        let mut seen = 0;
        for (index, n) in self.buckets.iter().enumerate() {
            seen += n;
            if seen >= rank {
                return upper_bound(index).min(self.max_ns);
            }
        }
        self.max_ns
    }

    /// Count, median, 99th percentile and largest, in milliseconds.
    pub fn quantiles_ms(&self) -> Quantiles {
        let ms = |ns: u64| ns as f64 * 1e-6;
        Quantiles {
            count: self.count,
            p50: ms(self.quantile_ns(0.50)),
            p99: ms(self.quantile_ns(0.99)),
            max: ms(self.max_ns),
        }
    }
}

fn bucket(ns: u64) -> usize {
    if ns < SUB {
        return ns as usize;
    }
    let octave = u64::from(63 - ns.leading_zeros()) - 6;
    ((octave + 1) * SUB + ((ns >> octave) & (SUB - 1))) as usize
}

fn upper_bound(index: usize) -> u64 {
    let (octave, sub) = (index as u64 / SUB, index as u64 % SUB);
    if octave == 0 { sub } else { ((SUB + sub + 1) << (octave - 1)) - 1 }
}

/// Round trips from a pose to the contact that was computed for it.
pub type RoundTrips = Histogram;

/// Quantiles of durations [ms].
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Quantiles {
    /// Number of durations.
    pub count: u64,
    /// Median.
    pub p50: f64,
    /// 99th percentile.
    pub p99: f64,
    /// Largest.
    pub max: f64,
}

/// Figures of the network side.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct LinkReport {
    /// Contact messages taken.
    pub contacts: u64,
    /// Mean rate of the messages between first and last [Hz].
    pub contact_rate_hz: f64,
    /// Number of missing sequence numbers.
    pub contacts_lost: u64,
    /// Messages that arrived after a newer one and were dropped.
    pub contacts_late: u64,
    /// Messages that could not be used.
    pub contacts_refused: u64,
    /// Messages for the client that held the tool meanwhile.
    pub contacts_of_others: u64,
    /// Number of streams: the first one, and another for each restart of the server.
    pub contact_streams: u64,
    /// Longest time between two messages [ms].
    pub longest_contact_gap_ms: f64,
    /// Time from sending a pose to the first contact computed for it [ms].
    pub round_trip_ms: Quantiles,
    /// Poses that reached the network.
    pub poses_sent: u64,
}

/// Figures of the loop.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct LoopReport {
    /// Ticks done.
    pub ticks: u64,
    /// Time from the first to the last tick [s].
    pub seconds: f64,
    /// Rate over that time [Hz].
    pub rate_hz: f64,
    /// Deadlines that passed without a tick.
    pub missed_ticks: u64,
    /// Delay of the start of ticks [ms].
    pub lateness_ms: Quantiles,
    /// Duration of ticks [ms].
    pub duration_ms: Quantiles,
    /// Age of the pose behind the contact model in use, on the client's own clock [ms].
    pub model_age_ms: Quantiles,
    /// Largest force [N].
    pub max_force_n: f64,
    /// Largest change of force between two ticks [N], except cuts at device faults.
    pub max_force_step_n: f64,
    /// The same change per period [N/s].
    pub max_slew_n_s: f64,
    /// Ticks with force on the hand.
    pub touch_ticks: u64,
    /// Ticks on a contact that had outlived its validity.
    pub stale_ticks: u64,
    /// Number of times that a device fault cut the force.
    pub device_faults: u64,
    /// Lowest energy of the passivity observer [J].
    pub min_energy_j: f64,
    /// Poses that were due but within the deadband of the last one sent.
    pub poses_withheld: u64,
    /// Poses dropped because the queue was full.
    pub poses_dropped: u64,
    /// Rows of the log dropped because the queue was full.
    pub log_rows_dropped: u64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_exact_to_two_percent() {
        let mut histogram = Histogram::default();
        (1..=10_000u64).for_each(|us| histogram.record(us * 1000));
        let q = histogram.quantiles_ms();
        assert!((q.p50 / 5.0 - 1.0).abs() < 0.02, "{q:?}");
        assert!((q.p99 / 9.9 - 1.0).abs() < 0.02, "{q:?}");
        assert_eq!((q.max, q.count), (10.0, 10_000));
    }

    #[test]
    fn every_duration_has_a_bucket_that_holds_it() {
        for ns in [0, 1, 63, 64, 65, 127, 128, 1_000_000, u64::MAX / 2, u64::MAX] {
            let index = bucket(ns);
            assert!(index < BUCKETS, "{ns}");
            if ns < u64::MAX / 4 {
                assert!(upper_bound(index) >= ns && (index == 0 || upper_bound(index - 1) < ns), "{ns}");
            }
        }
        assert_eq!(Histogram::default().quantile_ns(0.5), 0);
    }
}
