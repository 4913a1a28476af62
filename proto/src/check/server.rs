//! Reports of the server, rpc requests and replies.

use prost::Name as _;

use super::field::{Checked, In};
use crate::codec::{CountLimit, DecodeError, WireMessage};
use crate::limits::{
    MAX_BODIES, MAX_COORDINATE_M, MAX_REPORT_BYTES, MAX_REPORT_ENTRIES, MAX_RPC_STEPS, MAX_SMALL_BYTES,
    MAX_TOOLS,
};
use crate::messages::{
    Event, PauseRequest, Plan, ResetRequest, RpcReply, SchemaReply, SessionInfo, SetRequest, Stats,
    StepRequest, event,
};

const fn count(tag: u32, field: &'static str, allowed: usize) -> CountLimit {
    CountLimit { tag, field, allowed }
}

impl WireMessage for SessionInfo {
    const MAX_BYTES: usize = MAX_REPORT_BYTES;
    const MAX_COUNTS: &'static [CountLimit] = &[count(5, "bodies", MAX_BODIES), count(6, "tools", MAX_TOOLS)];

    fn check(&self) -> Result<(), DecodeError> {
        let at = In(Self::NAME);
        at.text("server_version", &self.server_version)?;
        at.text("scene_name", &self.scene_name)?;
        at.positive("step_s", self.step_s, f64::MAX)?;
        for body in &self.bodies {
            at.id("bodies.id", &body.id)?;
            at.optional_vec3("bodies.min_m", &body.min_m, MAX_COORDINATE_M)?;
            at.optional_vec3("bodies.max_m", &body.max_m, MAX_COORDINATE_M)?;
        }
        for tool in &self.tools {
            at.id("tools.id", &tool.id)?;
            at.optional_id("tools.owner", &tool.owner)?;
            tool.shape.as_ref().map_or(Ok(()), |s| at.shape(s))?;
        }
        Ok(())
    }
}

impl WireMessage for Stats {
    const MAX_BYTES: usize = MAX_REPORT_BYTES;
    const MAX_COUNTS: &'static [CountLimit] = &[
        count(7, "stages", MAX_REPORT_ENTRIES),
        count(8, "bodies", MAX_BODIES),
        count(9, "tools", MAX_TOOLS),
        count(10, "refused", MAX_REPORT_ENTRIES),
    ];

    fn check(&self) -> Result<(), DecodeError> {
        let at = In(Self::NAME);
        at.finite("sim_time_s", self.sim_time_s)?;
        at.finite("step_rate_hz", f64::from(self.step_rate_hz))?;
        at.finite("real_time_factor", f64::from(self.real_time_factor))?;
        for stage in &self.stages {
            at.text("stages.name", &stage.name)?;
            at.finite("stages.milliseconds", f64::from(stage.milliseconds))?;
        }
        for body in &self.bodies {
            at.id("bodies.body_id", &body.body_id)?;
            at.finite("bodies.residual", f64::from(body.residual))?;
            at.finite("bodies.volume_m3", body.volume_m3)?;
        }
        for tool in &self.tools {
            at.id("tools.tool_id", &tool.tool_id)?;
            at.optional_id("tools.owner", &tool.owner)?;
            at.finite("tools.contact_rate_hz", f64::from(tool.contact_rate_hz))?;
            at.finite("tools.pose_rate_hz", f64::from(tool.pose_rate_hz))?;
            at.finite("tools.force_n", f64::from(tool.force_n))?;
        }
        self.refused.iter().try_for_each(|counter| at.text("refused.name", &counter.name))
    }
}

impl WireMessage for Event {
    const MAX_BYTES: usize = MAX_SMALL_BYTES;

    fn check(&self) -> Result<(), DecodeError> {
        let at = In(Self::NAME);
        at.known::<event::Level>("level", self.level)?;
        at.text("name", &self.name)?;
        at.text("message", &self.message)
    }
}

impl WireMessage for Plan {
    const MAX_BYTES: usize = MAX_REPORT_BYTES;
    const MAX_COUNTS: &'static [CountLimit] = &[count(1, "effects", MAX_REPORT_ENTRIES)];

    fn check(&self) -> Result<(), DecodeError> {
        let at = In(Self::NAME);
        for effect in &self.effects {
            at.text("effects.name", &effect.name)?;
            at.text("effects.why", &effect.why)?;
            at.finite("effects.predicted_ms", f64::from(effect.predicted_ms))?;
            at.finite("effects.measured_ms", f64::from(effect.measured_ms))?;
        }
        Ok(())
    }
}

impl WireMessage for PauseRequest {
    const MAX_BYTES: usize = MAX_SMALL_BYTES;

    fn check(&self) -> Checked {
        Ok(())
    }
}

impl WireMessage for StepRequest {
    const MAX_BYTES: usize = MAX_SMALL_BYTES;

    fn check(&self) -> Checked {
        if (1..=MAX_RPC_STEPS).contains(&self.count) {
            return Ok(());
        }
        Err(In(Self::NAME).range("count", self.count, format!("1 to {MAX_RPC_STEPS}")))
    }
}

impl WireMessage for ResetRequest {
    const MAX_BYTES: usize = MAX_SMALL_BYTES;

    fn check(&self) -> Checked {
        Ok(())
    }
}

impl WireMessage for SetRequest {
    const MAX_BYTES: usize = MAX_SMALL_BYTES;

    fn check(&self) -> Checked {
        In(Self::NAME).text("key", &self.key)?;
        In(Self::NAME).text("value", &self.value)
    }
}

impl WireMessage for RpcReply {
    const MAX_BYTES: usize = MAX_SMALL_BYTES;

    fn check(&self) -> Checked {
        In(Self::NAME).text("message", &self.message)?;
        In(Self::NAME).error(&self.error)
    }
}

impl WireMessage for SchemaReply {
    const MAX_BYTES: usize = MAX_REPORT_BYTES;

    fn check(&self) -> Checked {
        Ok(())
    }
}
