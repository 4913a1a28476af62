//! Figures for Prometheus: what a running server does, in the OpenMetrics text format.
//!
//! Time per step is summed while the simulation runs, because a monitor asks seldom. Everything else is taken from
//! the newest report ([`Stats`]), so what has left the scene leaves the page. Without `--metrics` none of this exists.

mod newest;

mod process;

pub mod serve;

use std::sync::{Arc, Mutex, PoisonError};

use prometheus_client::collector::Collector;
use prometheus_client::encoding::{DescriptorEncoder, EncodeMetric, text};
use prometheus_client::metrics::MetricType;
use prometheus_client::metrics::counter::ConstCounter;
use prometheus_client::metrics::histogram::{Histogram, exponential_buckets};
use prometheus_client::metrics::info::Info;
use prometheus_client::registry::Registry;
use scindo_proto::messages::Stats;

/// Smallest bound of the histogram of step times [s]; each further one is twice the one before.
const SHORTEST_STEP_S: f64 = 0.000_25;

/// Number of bounds; the largest is 2 s.
const STEP_BOUNDS: u16 = 14;

/// The figures of a server. They outlive a change of scene.
#[derive(Debug)]
pub struct Metrics {
    registry: Registry,
    steps: Histogram,
    stages: Arc<Stages>,
    newest: Arc<Mutex<Option<Stats>>>,
}

/// Seconds spent so far in each stage of a step.
#[derive(Debug, Default)]
struct Stages(Mutex<Vec<(&'static str, f64)>>);

impl Default for Metrics {
    fn default() -> Self {
        let steps = Histogram::new(exponential_buckets(SHORTEST_STEP_S, 2.0, STEP_BOUNDS));
        let (stages, newest) = (Arc::<Stages>::default(), Arc::<Mutex<Option<Stats>>>::default());
        let mut whole = Registry::default();
        let registry = whole.sub_registry_with_prefix("scindo");
        registry.register(
            "build",
            "Version and commit",
            Info::new(vec![("version", scindo_program::VERSION)]),
        );
        registry.register("step_seconds", "Wall time of a step", steps.clone());
        registry.register_collector(Box::new(stages.clone()));
        registry.register_collector(Box::new(newest::Newest(newest.clone())));
        whole.sub_registry_with_prefix("process").register_collector(Box::new(process::Process));
        Self { registry: whole, steps, stages, newest }
    }
}

impl Metrics {
    /// Counts a step and the time of each of its stages [s].
    pub fn step(&self, stages: impl Iterator<Item = (&'static str, f64)>) {
        let mut sums = lock(&self.stages.0);
        let mut whole = 0.0;
        for (name, seconds) in stages {
            whole += seconds;
            match sums.iter_mut().find(|(known, _)| *known == name) {
                Some((_, sum)) => *sum += seconds,
                None => sums.push((name, seconds)),
            }
        }
        drop(sums);
        self.steps.observe(whole);
    }

    /// Takes the newest report.
    pub fn report(&self, stats: &Stats) {
        *lock(&self.newest) = Some(stats.clone());
    }

    /// All figures as text.
    pub fn text(&self) -> String {
        let mut text = String::new();
        // Writing to a string does not fail.
        let _ = text::encode(&mut text, &self.registry);
        text
    }
}

impl Collector for Stages {
    fn encode(&self, mut encoder: DescriptorEncoder<'_>) -> std::fmt::Result {
        let sums = lock(&self.0).clone();
        let help = "Wall time of all steps, by stage";
        let mut family = encoder.encode_descriptor("stage_seconds", help, None, MetricType::Counter)?;
        for (name, seconds) in sums {
            ConstCounter::new(seconds).encode(family.encode_family(&[("stage", name)])?)?;
        }
        Ok(())
    }
}

fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use scindo_proto::messages::{BodyStats, Counter, ToolStats};

    use super::*;

    fn stats(tool: &str) -> Stats {
        Stats {
            sim_time_s: 1.5,
            real_time_factor: 0.75,
            bodies: vec![BodyStats { body_id: "liver".into(), iterations: 12, ..BodyStats::default() }],
            tools: vec![ToolStats { tool_id: tool.into(), contact_age_ms: 2.0, ..ToolStats::default() }],
            refused: vec![Counter { name: "not-owner".into(), count: 3 }],
            client_count: 7,
            ..Stats::default()
        }
    }

    #[test]
    fn a_page_holds_sums_of_all_steps_and_the_newest_report() {
        let metrics = Metrics::default();
        for _ in 0..4 {
            metrics.step([("deform", 0.003), ("contact", 0.001)].into_iter());
        }
        metrics.report(&stats("scalpel"));
        let text = metrics.text();
        for line in [
            "scindo_step_seconds_count 4",
            "scindo_step_seconds_bucket{le=\"0.002\"} 0",
            "scindo_step_seconds_bucket{le=\"0.004\"} 4",
            "scindo_stage_seconds_total{stage=\"deform\"} 0.012",
            "scindo_real_time_factor 0.75",
            "scindo_body_iterations{body=\"liver\"} 12.0",
            "scindo_tool_contact_age_seconds{tool=\"scalpel\"} 0.002",
            "scindo_refused_messages_total{reason=\"not-owner\"} 3",
            "scindo_clients 7.0",
            "# EOF",
        ] {
            assert!(text.lines().any(|found| found == line), "{line} in\n{text}");
        }
        let resident = text.lines().find_map(|line| line.strip_prefix("process_resident_memory_bytes "));
        assert!(resident.is_some_and(|bytes| bytes.parse().is_ok_and(|n: u64| n > 1 << 20)), "{text}");
    }

    #[test]
    fn what_left_the_scene_leaves_the_page() {
        let metrics = Metrics::default();
        metrics.report(&stats("first"));
        metrics.report(&stats("second"));
        let text = metrics.text();
        assert!(!text.contains("first") && text.contains("second"), "{text}");
    }

    #[test]
    fn ids_cannot_forge_a_line() {
        let metrics = Metrics::default();
        metrics.report(&stats("a\"} 1\nscindo_clients 99.0\n"));
        let text = metrics.text();
        assert!(!text.lines().any(|line| line == "scindo_clients 99.0"), "{text}");
    }
}
