//! Statistics of bodies, tools and refused messages.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use scindo_proto::Role;
use scindo_proto::messages::{BodyStats, ClientStats, Counter, ToolStats};
use scindo_world::snapshot::{BodySnapshot, ToolSnapshot};

use crate::exchange::Exchange;
use crate::exchange::meter::Rates;
use crate::inbox::counters::Figures;

/// Figures of the inbox, and the rates of poses since the last report.
#[derive(Debug, Default)]
pub struct Told {
    figures: Figures,
    /// By tool: count of poses at the last report, and poses per second since then.
    poses: BTreeMap<Arc<str>, (u64, f64)>,
}

impl Told {
    /// Copies the figures of the inbox, `seconds` after the last time. The lock is held for the copy alone.
    pub fn read(&mut self, exchange: &Exchange, seconds: f64) {
        exchange.inbox().figures_into(&mut self.figures);
        for tool in &self.figures.tools {
            let (before, hz) = self.poses.entry(tool.tool.clone()).or_default();
            *hz = tool.poses.saturating_sub(*before) as f64 / seconds;
            *before = tool.poses;
        }
        let held = &self.figures.tools;
        self.poses.retain(|id, _| held.iter().any(|tool| tool.tool == *id));
    }

    /// Cuts of clients applied so far.
    pub fn cuts_applied(&self) -> u64 {
        self.figures.cuts_applied
    }

    /// Number of tools that clients hold.
    pub fn held(&self) -> u32 {
        self.figures.tools.len() as u32
    }

    /// The clients that are present, as many as a report names, and the number of all.
    pub fn clients(&self) -> (Vec<ClientStats>, u32) {
        let to_stats = |(id, role): &(String, Role)| ClientStats {
            client_id: id.clone(),
            role: role.as_str().to_owned(),
        };
        (self.figures.clients.iter().map(to_stats).collect(), self.figures.client_count as u32)
    }

    /// Counts of refused messages and of losses, by name.
    pub fn refused(&self, exchange: &Exchange) -> Vec<Counter> {
        let all = self.figures.refused.iter().copied().chain(exchange.losses());
        all.map(|(name, count)| Counter { name: name.to_owned(), count }).collect()
    }

    /// Converts one tool for the report.
    pub fn tool_stats(&self, tool: &ToolSnapshot, rates: &Rates) -> ToolStats {
        let held = self.figures.tools.iter().find(|held| held.tool == tool.id);
        let shown = held.and_then(|held| held.one_way.since(tool.client_time_ns, Instant::now()));
        ToolStats {
            tool_id: tool.id.to_string(),
            owner: tool.owner.to_string(),
            contact_rate_hz: rates.contact_hz.get(&tool.id).copied().unwrap_or(0.0) as f32,
            pose_rate_hz: self.poses.get(&tool.id).map_or(0.0, |&(_, hz)| hz as f32),
            force_n: tool.force_n.norm() as f32,
            contact_age_ms: held.map_or(0.0, |held| held.contact_age_ms),
            pose_age_ms: shown.map_or(0.0, |shown| 1e3 * shown.as_secs_f32()),
            name: held.map_or_else(String::new, |held| held.name.to_string()),
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
        divided_cells: body.adapted.divided,
        joined_cells: body.adapted.joined,
        unbalanced_steps: body.counts.unbalanced,
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use crossbeam_channel::bounded;
    use scindo_proto::messages::{Pose, ToolSample, Vec3};

    use super::*;
    use crate::inbox::{Inbox, Sender};

    /// Sends pose `seq` of client `a` with the tool `scalpel`.
    fn pose(exchange: &Exchange, seq: u64, contact_age_ms: f32) {
        let sample = ToolSample {
            seq,
            client_id: "a".into(),
            tool_id: "scalpel".into(),
            contact_age_ms,
            pose: Some(Pose { position_m: Some(Vec3::default()), qw: 1.0, ..Pose::default() }),
            ..ToolSample::default()
        };
        let sender = Sender { client: "a", tool: "scalpel" };
        exchange.inbox().pose(sender, &sample, Instant::now()).unwrap();
    }

    #[test]
    fn rates_of_poses_count_from_the_last_report_and_end_with_the_tool() {
        let inbox = Inbox::new([], [Arc::from("scalpel")]);
        let exchange = Exchange::new(inbox, 0, (bounded(1).0, bounded(1).0));
        exchange.inbox().client_came("a", Instant::now());
        let mut told = Told::default();
        let snapshot = ToolSnapshot { id: Arc::from("scalpel"), ..ToolSnapshot::default() };
        let rates = Rates::default();
        (1..=10).for_each(|seq| pose(&exchange, seq, 2.5));
        told.read(&exchange, 0.5);
        let stats = told.tool_stats(&snapshot, &rates);
        assert_eq!((stats.pose_rate_hz, stats.contact_age_ms, told.held()), (20.0, 2.5, 1));
        (11..=14).for_each(|seq| pose(&exchange, seq, 1.5));
        told.read(&exchange, 2.0);
        let stats = told.tool_stats(&snapshot, &rates);
        assert_eq!((stats.pose_rate_hz, stats.contact_age_ms), (2.0, 1.5));
        exchange.inbox().client_went("a", Instant::now());
        told.read(&exchange, 1.0);
        let stats = told.tool_stats(&snapshot, &rates);
        assert_eq!((stats.pose_rate_hz, stats.contact_age_ms, told.held()), (0.0, 0.0, 0));
    }

    #[test]
    fn refusals_and_lost_answers_stand_in_one_report() {
        let exchange = Exchange::new(Inbox::default(), 0, (bounded(1).0, bounded(1).0));
        let mut told = Told::default();
        exchange.inbox().count("not-owner");
        exchange.answer_lost();
        exchange.answer_lost();
        told.read(&exchange, 1.0);
        let counters = told.refused(&exchange);
        let counters: Vec<_> = counters.iter().map(|counter| (&*counter.name, counter.count)).collect();
        assert_eq!(counters, [("not-owner", 1), ("answers-lost", 2)]);
    }
}
