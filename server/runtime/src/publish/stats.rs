//! Statistics of bodies, tools and refused messages.

use std::collections::BTreeMap;
use std::sync::Arc;

use scindo_proto::messages::{BodyStats, Counter, ToolStats};
use scindo_world::snapshot::{BodySnapshot, ToolSnapshot};

use crate::exchange::Exchange;
use crate::exchange::meter::Rates;

/// Figures of the inbox at the time of a report. They are copied so that nobody waits for the report.
pub struct Told {
    /// Poses per second, by tool.
    pose_hz: BTreeMap<Arc<str>, f64>,
    /// By tool: age of the contact model that its device last used [ms].
    contact_age_ms: BTreeMap<Arc<str>, f32>,
    refused: Vec<(&'static str, u64)>,
    /// Cuts of clients applied so far.
    pub cuts_applied: u64,
    /// Number of tools that clients hold.
    pub held: u32,
}

impl Told {
    /// Reads the inbox. `before` holds the counts of poses at the last report, `seconds` ago, and is updated.
    pub fn by(exchange: &Exchange, before: &mut BTreeMap<Arc<str>, u64>, seconds: f64) -> Self {
        let (counts, contact_age_ms, refused, cuts_applied) = {
            let inbox = exchange.inbox();
            let counts: Vec<(Arc<str>, u64)> = inbox.pose_counts().map(|(t, n)| (t.clone(), n)).collect();
            let ages = counts.iter().map(|(tool, _)| (tool.clone(), inbox.contact_age_ms(tool)));
            let ages: BTreeMap<_, _> = ages.collect();
            (
                counts,
                ages,
                inbox.refused().iter().map(|(&name, &n)| (name, n)).collect(),
                inbox.cuts_applied(),
            )
        };
        let held = counts.len() as u32;
        let mut pose_hz = BTreeMap::new();
        for (tool, count) in counts {
            let last = before.insert(tool.clone(), count).unwrap_or(0);
            pose_hz.insert(tool, count.saturating_sub(last) as f64 / seconds);
        }
        before.retain(|tool, _| pose_hz.contains_key(tool));
        Self { pose_hz, contact_age_ms, refused, cuts_applied, held }
    }

    /// Counts of refused messages and of losses, by name.
    pub fn refused(&self, exchange: &Exchange) -> Vec<Counter> {
        let all = self.refused.iter().copied().chain(exchange.losses());
        all.map(|(name, count)| Counter { name: name.to_owned(), count }).collect()
    }

    /// Converts one tool for the report.
    pub fn tool_stats(&self, tool: &ToolSnapshot, rates: &Rates) -> ToolStats {
        let rate = |rates: &BTreeMap<Arc<str>, f64>| rates.get(&tool.id).copied().unwrap_or(0.0) as f32;
        ToolStats {
            tool_id: tool.id.to_string(),
            owner: tool.owner.to_string(),
            contact_rate_hz: rate(&rates.contact_hz),
            pose_rate_hz: rate(&self.pose_hz),
            force_n: tool.force_n.norm() as f32,
            contact_age_ms: self.contact_age_ms.get(&tool.id).copied().unwrap_or(0.0),
        }
    }
}

/// Converts one body for the report.
pub fn body_stats(body: &BodySnapshot) -> BodyStats {
    BodyStats {
        body_id: body.id.to_string(),
        iterations: body.iterations,
        residual: body.residual as f32,
        elements: body.elements,
        pieces: body.pieces,
        copies: body.copies,
        epoch: body.epoch,
        volume_m3: body.rest_volume_m3,
        tolerance: body.tolerance as f32,
        unconverged_steps: body.counts.unconverged,
        refused_steps: body.counts.refused,
        divided_steps: body.counts.divided,
        rolled_back_steps: body.counts.rolled_back,
        inverted: body.inverted,
        fixed_iterations: body.fixed_iterations,
        unconverged: body.unconverged,
    }
}
