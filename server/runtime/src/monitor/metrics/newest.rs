//! Figures of the newest report.

use std::sync::{Arc, Mutex};

use prometheus_client::collector::Collector;
use prometheus_client::encoding::{DescriptorEncoder, EncodeMetric as _};
use prometheus_client::metrics::MetricType;
use prometheus_client::metrics::counter::ConstCounter;
use prometheus_client::metrics::gauge::ConstGauge;
use scindo_proto::messages::{BodyStats, Stats, ToolStats};

use super::lock;

/// Milliseconds in a second.
const MILLI: f64 = 1e-3;

/// The newest report, if there is one.
#[derive(Debug)]
pub(super) struct Newest(pub Arc<Mutex<Option<Stats>>>);

type Column<T> = (&'static str, &'static str, fn(&T) -> f64);

/// Gauges of the whole server: name, meaning, value.
const SERVER: [Column<Stats>; 7] = [
    ("simulated_seconds", "Simulated time since the start or the last reset", |s| s.sim_time_s),
    ("real_time_factor", "Simulated time over wall time, in the last interval", |s| {
        s.real_time_factor.into()
    }),
    ("step_rate_hertz", "Steps per second, in the last interval", |s| s.step_rate_hz.into()),
    ("paused", "1 while the simulation is paused", |s| s.paused.into()),
    ("clients", "Clients that are present", |s| s.client_count.into()),
    ("held_tools", "Tools that clients hold", |s| s.haptic_clients.into()),
    ("watched_surfaces", "Bodies whose surface somebody watches", |s| s.surface_subscribers.into()),
];

/// Gauges of a body.
const BODY: [Column<BodyStats>; 6] = [
    ("body_iterations", "Iterations of the solver in the last step", |b| b.iterations.into()),
    ("body_residual", "Relative residual after the last step", |b| b.residual.into()),
    ("body_tolerance", "Largest residual of a converged step", |b| b.tolerance.into()),
    ("body_elements", "Elements of the mesh", |b| b.elements.into()),
    ("body_copies", "Copies of nodes, with those that cuts made", |b| b.copies.into()),
    ("body_inverted_elements", "Elements that are inverted at present", |b| b.inverted.into()),
];

type Kind = (&'static str, fn(&BodyStats) -> u64);

/// Kinds of steps that did not go as asked, by their label.
const STEPS: [Kind; 5] = [
    ("unconverged", |b| b.unconverged_steps),
    ("refused", |b| b.refused_steps),
    ("divided", |b| b.divided_steps),
    ("rolled-back", |b| b.rolled_back_steps),
    ("unbalanced", |b| b.unbalanced_steps),
];

/// Gauges of a tool.
const TOOL: [Column<ToolStats>; 5] = [
    ("tool_contact_rate_hertz", "Contact models sent per second", |t| t.contact_rate_hz.into()),
    ("tool_pose_rate_hertz", "Poses taken per second", |t| t.pose_rate_hz.into()),
    (
        "tool_contact_age_seconds",
        "Age of the contact model that the device last used; 0 if not reported",
        |t| MILLI * f64::from(t.contact_age_ms),
    ),
    ("tool_pose_age_seconds", "Age of the pose in the newest step; 0 if not known", |t| {
        MILLI * f64::from(t.pose_age_ms)
    }),
    ("tool_force_newtons", "Force on the tool", |t| t.force_n.into()),
];

impl Collector for Newest {
    fn encode(&self, mut encoder: DescriptorEncoder<'_>) -> std::fmt::Result {
        let Some(stats) = lock(&self.0).clone() else { return Ok(()) };
        for (name, help, value) in SERVER {
            let gauge = encoder.encode_descriptor(name, help, None, MetricType::Gauge)?;
            ConstGauge::new(value(&stats)).encode(gauge)?;
        }
        let cuts = encoder.encode_descriptor("cuts_applied", "Cuts of clients", None, MetricType::Counter)?;
        ConstCounter::new(stats.cuts_applied).encode(cuts)?;
        table(&mut encoder, &BODY, &stats.bodies, |body| ("body", &body.body_id))?;
        table(&mut encoder, &TOOL, &stats.tools, |tool| ("tool", &tool.tool_id))?;
        let help = "Steps since the start or the last reset that did not go as asked, by kind";
        let mut family = encoder.encode_descriptor("body_troubled_steps", help, None, MetricType::Counter)?;
        for body in &stats.bodies {
            for (kind, count) in STEPS {
                let labels = [("body", &*body.body_id), ("kind", kind)];
                ConstCounter::new(count(body)).encode(family.encode_family(&labels)?)?;
            }
        }
        let help = "Messages refused or lost, by reason";
        let mut family = encoder.encode_descriptor("refused_messages", help, None, MetricType::Counter)?;
        for counter in &stats.refused {
            ConstCounter::new(counter.count).encode(family.encode_family(&[("reason", &*counter.name)])?)?;
        }
        Ok(())
    }
}

/// One gauge per column and row.
fn table<T>(
    encoder: &mut DescriptorEncoder<'_>,
    columns: &[Column<T>],
    rows: &[T],
    label: impl Fn(&T) -> (&'static str, &str),
) -> std::fmt::Result {
    for (name, help, value) in columns {
        let mut family = encoder.encode_descriptor(name, help, None, MetricType::Gauge)?;
        for row in rows {
            ConstGauge::new(value(row)).encode(family.encode_family(&[label(row)])?)?;
        }
    }
    Ok(())
}
