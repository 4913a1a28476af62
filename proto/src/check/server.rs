//! Reports of the server, rpc requests and replies.

use prost::Name as _;

use super::field::{Checked, In};
use crate::codec::{CountLimit, DecodeError, WireMessage};
use crate::limits::{
    MAX_BODIES, MAX_COORDINATE_M, MAX_ID_BYTES, MAX_IMAGE_BYTES, MAX_LAYERS, MAX_OBSTACLE_TRIANGLES,
    MAX_OBSTACLES, MAX_PARAMS, MAX_PROBES, MAX_REPORT_BYTES, MAX_REPORT_ENTRIES, MAX_RPC_STEPS, MAX_SCENES,
    MAX_SMALL_BYTES, MAX_STATE_BYTES, MAX_TOOLS, POSITION_BYTES, QUATERNION_TOLERANCE, TRIANGLE_BYTES,
};
use crate::messages::{
    BodyLook, Event, LoadRequest, Measures, ObstacleInfo, ParamsReply, PauseRequest, Plan, RecordRequest,
    ResetRequest, RestoreRequest, RpcReply, ScenesReply, SchemaReply, SessionInfo, SetRequest,
    SnapshotRequest, StateReply, Stats, StepRequest, TextureReply, TextureRequest, UndoRequest, event,
    obstacle_info, param,
};

/// Kinds of images that every browser can show, and a glTF file may hold.
const MEDIA_TYPES: [&str; 2] = ["image/png", "image/jpeg"];

const fn count(tag: u32, field: &'static str, allowed: usize) -> CountLimit {
    CountLimit { tag, field, allowed }
}

impl WireMessage for SessionInfo {
    const MAX_BYTES: usize = MAX_REPORT_BYTES;
    const MAX_COUNTS: &'static [CountLimit] = &[
        count(5, "bodies", MAX_BODIES),
        count(6, "tools", MAX_TOOLS),
        count(10, "obstacles", MAX_OBSTACLES),
    ];

    fn check(&self) -> Result<(), DecodeError> {
        let at = In(Self::NAME);
        at.text("server_version", &self.server_version)?;
        at.text("scene_name", &self.scene_name)?;
        at.text("scene_description", &self.scene_description)?;
        at.text("scene", &self.scene)?;
        at.positive("step_s", self.step_s, f64::MAX)?;
        for body in &self.bodies {
            at.id("bodies.id", &body.id)?;
            at.optional_vec3("bodies.min_m", &body.min_m, MAX_COORDINATE_M)?;
            at.optional_vec3("bodies.max_m", &body.max_m, MAX_COORDINATE_M)?;
            body.look.as_ref().map_or(Ok(()), |look| check_look(at, look))?;
        }
        at.optional_vec3("up", &self.up, 1.0 + QUATERNION_TOLERANCE)?;
        for tool in &self.tools {
            at.id("tools.id", &tool.id)?;
            at.optional_id("tools.owner", &tool.owner)?;
            tool.shape.as_ref().map_or(Ok(()), |s| at.shape(s))?;
        }
        self.obstacles.iter().try_for_each(|obstacle| check_obstacle(at, obstacle))
    }
}

fn check_obstacle(at: In, obstacle: &ObstacleInfo) -> Checked {
    at.id("obstacles.id", &obstacle.id)?;
    let place = |name, v| at.optional_vec3(name, v, MAX_COORDINATE_M);
    match &obstacle.shape {
        Some(obstacle_info::Shape::HalfSpace(half)) => {
            place("obstacles.half_space.point_m", &half.point_m)?;
            at.optional_vec3("obstacles.half_space.normal", &half.normal, 1.0 + QUATERNION_TOLERANCE)
        }
        Some(obstacle_info::Shape::Box(block)) => {
            place("obstacles.box.min_m", &block.min_m)?;
            place("obstacles.box.max_m", &block.max_m)
        }
        Some(obstacle_info::Shape::Capsule(capsule)) => {
            place("obstacles.capsule.from_m", &capsule.from_m)?;
            place("obstacles.capsule.to_m", &capsule.to_m)?;
            at.positive("obstacles.capsule.radius_m", capsule.radius_m, MAX_COORDINATE_M)
        }
        Some(obstacle_info::Shape::Surface(surface)) => {
            let most = MAX_OBSTACLE_TRIANGLES;
            at.at_most("obstacles.surface.triangles", surface.triangles.len(), most * TRIANGLE_BYTES)?;
            at.at_most("obstacles.surface.positions", surface.positions.len(), most * POSITION_BYTES)
        }
        None => Ok(()),
    }
}

fn check_look(at: In, look: &BodyLook) -> Checked {
    at.finite("bodies.look.opacity", f64::from(look.opacity))?;
    at.at_most("bodies.look.layers", look.layers.len(), MAX_LAYERS)?;
    look.layers.iter().try_for_each(|layer| at.finite("bodies.look.layers.depth_m", f64::from(layer.depth_m)))
}

impl WireMessage for Stats {
    const MAX_BYTES: usize = MAX_REPORT_BYTES;
    const MAX_COUNTS: &'static [CountLimit] = &[
        count(7, "stages", MAX_REPORT_ENTRIES),
        count(8, "bodies", MAX_BODIES),
        count(9, "tools", MAX_TOOLS),
        count(10, "refused", MAX_REPORT_ENTRIES),
        count(15, "clients", MAX_REPORT_ENTRIES),
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
            at.finite("bodies.tolerance", f64::from(body.tolerance))?;
            at.finite("bodies.volume_m3", body.volume_m3)?;
        }
        for tool in &self.tools {
            at.id("tools.tool_id", &tool.tool_id)?;
            at.optional_id("tools.owner", &tool.owner)?;
            at.finite("tools.contact_rate_hz", f64::from(tool.contact_rate_hz))?;
            at.finite("tools.pose_rate_hz", f64::from(tool.pose_rate_hz))?;
            at.finite("tools.force_n", f64::from(tool.force_n))?;
            at.finite("tools.contact_age_ms", f64::from(tool.contact_age_ms))?;
            at.positive("tools.pose_age_ms", f64::from(tool.pose_age_ms), f64::MAX)?;
            at.name("tools.name", &tool.name)?;
        }
        for client in &self.clients {
            at.id("clients.client_id", &client.client_id)?;
            at.text("clients.role", &client.role)?;
        }
        if let Some(recording) = &self.recording {
            at.text("recording.file", &recording.file)?;
            at.finite("recording.seconds", recording.seconds)?;
        }
        self.refused.iter().try_for_each(|counter| at.text("refused.name", &counter.name))
    }
}

impl WireMessage for Measures {
    const MAX_BYTES: usize = MAX_REPORT_BYTES;
    const MAX_COUNTS: &'static [CountLimit] =
        &[count(5, "probes", MAX_PROBES), count(6, "energies", MAX_BODIES)];

    fn check(&self) -> Result<(), DecodeError> {
        let at = In(Self::NAME);
        at.finite("sim_time_s", self.sim_time_s)?;
        for probe in &self.probes {
            at.id("probes.id", &probe.id)?;
            at.id("probes.body_id", &probe.body_id)?;
            at.optional_vec3("probes.position_m", &probe.position_m, MAX_COORDINATE_M)?;
            at.optional_vec3("probes.rest_m", &probe.rest_m, MAX_COORDINATE_M)?;
        }
        for energy in &self.energies {
            at.id("energies.body_id", &energy.body_id)?;
            at.finite("energies.kinetic_j", energy.kinetic_j)?;
            at.finite("energies.elastic_j", energy.elastic_j)?;
        }
        Ok(())
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

impl WireMessage for ParamsReply {
    const MAX_BYTES: usize = MAX_REPORT_BYTES;
    const MAX_COUNTS: &'static [CountLimit] = &[count(1, "params", MAX_PARAMS)];

    fn check(&self) -> Checked {
        let at = In(Self::NAME);
        for param in &self.params {
            at.text("params.key", &param.key)?;
            at.text("params.meaning", &param.meaning)?;
            at.text("params.unit", &param.unit)?;
            at.text("params.value", &param.value)?;
            at.known::<param::Kind>("params.kind", param.kind)?;
            let ranges = [param.min, param.max, param.usual_min, param.usual_max];
            ranges.into_iter().try_for_each(|end| at.finite("params.range", end))?;
        }
        Ok(())
    }
}

impl WireMessage for UndoRequest {
    const MAX_BYTES: usize = MAX_SMALL_BYTES;

    fn check(&self) -> Checked {
        Ok(())
    }
}

impl WireMessage for SnapshotRequest {
    const MAX_BYTES: usize = MAX_SMALL_BYTES;

    fn check(&self) -> Checked {
        In(Self::NAME).id("name", &self.name)
    }
}

impl WireMessage for RestoreRequest {
    const MAX_BYTES: usize = MAX_SMALL_BYTES;

    fn check(&self) -> Checked {
        In(Self::NAME).id("name", &self.name)
    }
}

impl WireMessage for RecordRequest {
    const MAX_BYTES: usize = MAX_SMALL_BYTES;

    fn check(&self) -> Checked {
        Ok(())
    }
}

impl WireMessage for StateReply {
    const MAX_BYTES: usize = MAX_STATE_BYTES + MAX_SMALL_BYTES;

    fn check(&self) -> Checked {
        In(Self::NAME).text("name", &self.name)
    }
}

impl WireMessage for TextureRequest {
    const MAX_BYTES: usize = MAX_SMALL_BYTES;

    fn check(&self) -> Checked {
        In(Self::NAME).id("body_id", &self.body_id)
    }
}

impl WireMessage for TextureReply {
    const MAX_BYTES: usize = MAX_IMAGE_BYTES + MAX_SMALL_BYTES;

    fn check(&self) -> Checked {
        let at = In(Self::NAME);
        at.id("body_id", &self.body_id)?;
        at.at_most("image", self.image.len(), MAX_IMAGE_BYTES)?;
        if MEDIA_TYPES.contains(&self.media_type.as_str()) {
            return Ok(());
        }
        let found: String = self.media_type.chars().take(MAX_ID_BYTES).collect();
        Err(at.range("media_type", found, MEDIA_TYPES.join(" or ")))
    }
}

impl WireMessage for ScenesReply {
    const MAX_BYTES: usize = MAX_REPORT_BYTES;
    const MAX_COUNTS: &'static [CountLimit] = &[count(1, "scenes", MAX_SCENES)];

    fn check(&self) -> Checked {
        let at = In(Self::NAME);
        self.scenes.iter().try_for_each(|scene| {
            at.text("scenes.name", &scene.name)?;
            at.text("scenes.description", &scene.description)
        })
    }
}

impl WireMessage for LoadRequest {
    const MAX_BYTES: usize = MAX_SMALL_BYTES;

    fn check(&self) -> Checked {
        In(Self::NAME).text("name", &self.name)
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
