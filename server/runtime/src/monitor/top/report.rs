//! A report as JSON, for programs.

use scindo_client::messages::{BodyStats, Stats, ToolStats};
use serde_json::{Map, Value, json};

/// The figures of `stats`, with the names that they have on the wire.
pub fn json(stats: &Stats) -> Value {
    json!({
        "sim_step": stats.sim_step, "sim_time_s": stats.sim_time_s, "paused": stats.paused,
        "step_rate_hz": stats.step_rate_hz, "real_time_factor": stats.real_time_factor,
        "stages_ms": map(stats.stages.iter().map(|stage| (&stage.name, json!(stage.milliseconds)))),
        "bodies": map(stats.bodies.iter().map(|body| (&body.body_id, of_body(body)))),
        "tools": map(stats.tools.iter().map(|tool| (&tool.tool_id, of_tool(tool)))),
        "refused": map(stats.refused.iter().map(|counter| (&counter.name, json!(counter.count)))),
        "clients": map(stats.clients.iter().map(|client| (&client.client_id, json!(client.role)))),
        "client_count": stats.client_count, "cuts_applied": stats.cuts_applied,
        "surface_subscribers": stats.surface_subscribers,
    })
}

fn map<'a>(entries: impl Iterator<Item = (&'a String, Value)>) -> Map<String, Value> {
    entries.map(|(name, value)| (name.clone(), value)).collect()
}

fn of_body(body: &BodyStats) -> Value {
    json!({
        "iterations": body.iterations, "residual": body.residual, "tolerance": body.tolerance,
        "elements": body.elements, "copies": body.copies, "epoch": body.epoch, "inverted": body.inverted,
        "unconverged_steps": body.unconverged_steps, "refused_steps": body.refused_steps,
        "divided_steps": body.divided_steps, "rolled_back_steps": body.rolled_back_steps,
        "unbalanced_steps": body.unbalanced_steps,
    })
}

fn of_tool(tool: &ToolStats) -> Value {
    json!({
        "owner": tool.owner, "name": tool.name, "pose_rate_hz": tool.pose_rate_hz,
        "contact_rate_hz": tool.contact_rate_hz, "contact_age_ms": tool.contact_age_ms,
        "pose_age_ms": tool.pose_age_ms, "force_n": tool.force_n,
    })
}
