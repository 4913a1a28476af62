//! Conversion between the types of the world and the messages of the wire.

use std::sync::Arc;
use std::time::{SystemTime, UNIX_EPOCH};

use bytes::Bytes;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use scindo_proto::limits::{MARK_BYTES, MAX_MARKS, MAX_PROBES, POSITION_BYTES};
use scindo_proto::messages::{self as wire, param, tool_sample, tool_shape};
use scindo_world::inputs::{ToolInput, ToolMode, ToolShape};
use scindo_world::scene::{LiveParameter, LiveValue};
use scindo_world::snapshot::{BodySnapshot, Snapshot, SurfaceTopology, ToolSnapshot};

/// Name of the field that holds von Mises stress.
pub const STRESS: &str = "von-mises";

/// Wall-clock time in nanoseconds since 1970 (UTC).
pub fn unix_ns() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    u64::try_from(since.as_nanos()).unwrap_or(u64::MAX)
}

/// Converts to a vector of the wire.
pub fn to_vec3(v: &Vector3<f64>) -> wire::Vec3 {
    wire::Vec3 { x: v.x, y: v.y, z: v.z }
}

/// Converts to a vector of the world; an absent one is zero.
pub fn from_vec3(v: Option<wire::Vec3>) -> Vector3<f64> {
    v.map_or_else(Vector3::zeros, |v| Vector3::new(v.x, v.y, v.z))
}

/// Converts a parameter that may change while a scene runs.
pub fn to_param(parameter: LiveParameter) -> wire::Param {
    let kind = match parameter.value {
        LiveValue::Switch(_) => param::Kind::Switch,
        LiveValue::Number(_) => param::Kind::Number,
        LiveValue::Integer(_) => param::Kind::Integer,
        LiveValue::Vector(_) => param::Kind::Vector,
    };
    wire::Param {
        key: parameter.key,
        meaning: parameter.meaning.to_owned(),
        unit: parameter.unit.to_owned(),
        kind: kind.into(),
        value: parameter.value.to_string(),
        min: parameter.range[0],
        max: parameter.range[1],
        usual_min: parameter.usual[0],
        usual_max: parameter.usual[1],
        logarithmic: parameter.logarithmic,
    }
}

/// Converts to a pose of the wire.
pub fn to_pose(pose: &Isometry3<f64>) -> wire::Pose {
    let q = pose.rotation.coords;
    wire::Pose { position_m: Some(to_vec3(&pose.translation.vector)), qx: q.x, qy: q.y, qz: q.z, qw: q.w }
}

/// Converts to a pose of the world. Codec checks have ensured that the quaternion is near unit length.
pub fn from_pose(pose: &wire::Pose) -> Isometry3<f64> {
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(pose.qw, pose.qx, pose.qy, pose.qz));
    Isometry3::from_parts(Translation3::from(from_vec3(pose.position_m)), rotation)
}

/// Converts to a tool shape of the wire.
pub fn to_shape(shape: &ToolShape) -> wire::ToolShape {
    let kind = match *shape {
        ToolShape::Sphere { radius_m } => tool_shape::Kind::Sphere(tool_shape::Sphere { radius_m }),
        ToolShape::Capsule { radius_m, length_m } => {
            tool_shape::Kind::Capsule(tool_shape::Capsule { radius_m, length_m })
        }
        ToolShape::Blade { length_m, thickness_m } => {
            tool_shape::Kind::Blade(tool_shape::Blade { length_m, thickness_m })
        }
        ToolShape::Forceps { radius_m, length_m, opening_m, grip_force_n, friction } => {
            let forceps = tool_shape::Forceps { radius_m, length_m, opening_m, grip_force_n, friction };
            tool_shape::Kind::Forceps(forceps)
        }
        ToolShape::Retractor { radius_m, length_m, width_m, height_m } => {
            tool_shape::Kind::Retractor(tool_shape::Retractor { radius_m, length_m, width_m, height_m })
        }
        ToolShape::Hook { radius_m, length_m, reach_m, point_m } => {
            tool_shape::Kind::Hook(tool_shape::Hook { radius_m, length_m, reach_m, point_m })
        }
    };
    wire::ToolShape { kind: Some(kind) }
}

/// Converts to a tool shape of the world; `None` if the message holds none.
pub fn from_shape(shape: &wire::ToolShape) -> Option<ToolShape> {
    Some(match shape.kind? {
        tool_shape::Kind::Sphere(s) => ToolShape::Sphere { radius_m: s.radius_m },
        tool_shape::Kind::Capsule(c) => ToolShape::Capsule { radius_m: c.radius_m, length_m: c.length_m },
        tool_shape::Kind::Blade(b) => ToolShape::Blade { length_m: b.length_m, thickness_m: b.thickness_m },
        tool_shape::Kind::Forceps(f) => ToolShape::Forceps {
            radius_m: f.radius_m,
            length_m: f.length_m,
            opening_m: f.opening_m,
            grip_force_n: f.grip_force_n,
            friction: f.friction,
        },
        tool_shape::Kind::Retractor(r) => ToolShape::Retractor {
            radius_m: r.radius_m,
            length_m: r.length_m,
            width_m: r.width_m,
            height_m: r.height_m,
        },
        tool_shape::Kind::Hook(h) => ToolShape::Hook {
            radius_m: h.radius_m,
            length_m: h.length_m,
            reach_m: h.reach_m,
            point_m: h.point_m,
        },
    })
}

/// Converts to a mode of the wire.
pub fn to_mode(mode: ToolMode) -> tool_sample::Mode {
    match mode {
        ToolMode::Hover => tool_sample::Mode::Hover,
        ToolMode::Touch => tool_sample::Mode::Touch,
        ToolMode::Grab => tool_sample::Mode::Grab,
        ToolMode::Cut => tool_sample::Mode::Cut,
        ToolMode::Scalpel => tool_sample::Mode::Scalpel,
    }
}

/// Converts to a mode of the world. An unspecified one hovers.
pub fn from_mode(mode: tool_sample::Mode) -> ToolMode {
    match mode {
        tool_sample::Mode::Touch => ToolMode::Touch,
        tool_sample::Mode::Grab => ToolMode::Grab,
        tool_sample::Mode::Cut => ToolMode::Cut,
        tool_sample::Mode::Scalpel => ToolMode::Scalpel,
        tool_sample::Mode::Hover | tool_sample::Mode::Unspecified => ToolMode::Hover,
    }
}

/// Converts a checked sample to what a step reads of it.
pub fn to_tool_input(sample: &wire::ToolSample, id: Arc<str>, owner: Arc<str>) -> ToolInput {
    ToolInput {
        id,
        owner,
        pose: sample.pose.as_ref().map_or_else(Isometry3::identity, from_pose),
        passed: Vec::new(),
        velocity_m_s: from_vec3(sample.velocity_m_s),
        mode: from_mode(sample.mode()),
        closed: sample.closed.map(f64::from),
        shape: sample.shape.as_ref().and_then(from_shape),
        seq: sample.seq,
        client_time_ns: sample.client_time_ns,
    }
}

/// Positions of a body. `seq` counts the frames of the body.
pub fn to_frame(snapshot: &Snapshot, body: &BodySnapshot, seq: u64) -> wire::SurfaceFrame {
    let mut positions = Vec::with_capacity(POSITION_BYTES * body.positions.len());
    for coordinate in body.positions.iter().flatten() {
        positions.extend_from_slice(&coordinate.to_le_bytes());
    }
    let mark_count = body.marks.len().min(MAX_MARKS as usize);
    let mut marks = Vec::with_capacity(MARK_BYTES * mark_count);
    for coordinate in body.marks[..mark_count].iter().flatten().flatten() {
        marks.extend_from_slice(&coordinate.to_le_bytes());
    }
    wire::SurfaceFrame {
        seq,
        sim_step: snapshot.step,
        sim_time_s: snapshot.time_s,
        publish_unix_ns: unix_ns(),
        body_id: body.id.to_string(),
        epoch: body.topology.epoch,
        vertex_count: body.positions.len() as u32,
        positions: positions.into(),
        mark_count: mark_count as u32,
        marks: marks.into(),
    }
}

/// Triangles of a body. `seq` counts the topologies of the body.
pub fn to_topology(snapshot: &Snapshot, body: &BodySnapshot, seq: u64) -> wire::SurfaceTopology {
    let SurfaceTopology { epoch, vertex_count, triangles, tags, rest, held, hangs } = &*body.topology;
    let on_image = body.texture.iter().flat_map(|texture| body.topology.on_image(texture));
    let coordinates = rest.iter().flatten().flat_map(|c| c.to_le_bytes());
    wire::SurfaceTopology {
        seq,
        sim_step: snapshot.step,
        sim_time_s: snapshot.time_s,
        publish_unix_ns: unix_ns(),
        body_id: body.id.to_string(),
        epoch: *epoch,
        vertex_count: *vertex_count,
        triangle_count: triangles.len() as u32,
        triangles: little_endian(triangles.iter().flatten(), 3 * triangles.len()),
        tags: little_endian(tags.iter(), tags.len()),
        rest_positions: coordinates.collect::<Vec<u8>>().into(),
        held: bits(held),
        hangs: bits(hangs),
        texture_coordinates: on_image
            .flat_map(|corners| corners.into_iter().flatten().flat_map(f32::to_le_bytes))
            .collect::<Vec<u8>>()
            .into(),
    }
}

/// Packs eight flags into each byte, lowest bit first.
fn bits(flags: &[bool]) -> Bytes {
    let byte = |flags: &[bool]| flags.iter().rev().fold(0, |byte: u8, &flag| (byte << 1) | u8::from(flag));
    flags.chunks(8).map(byte).collect::<Vec<u8>>().into()
}

/// Von Mises stress on the surface of a body. `seq` counts the fields of the body.
pub fn to_stress(snapshot: &Snapshot, body: &BodySnapshot, seq: u64) -> wire::SurfaceField {
    wire::SurfaceField {
        seq,
        sim_step: snapshot.step,
        sim_time_s: snapshot.time_s,
        publish_unix_ns: unix_ns(),
        body_id: body.id.to_string(),
        epoch: body.topology.epoch,
        vertex_count: body.stress.len() as u32,
        name: STRESS.to_owned(),
        values: body.stress.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>().into(),
    }
}

/// Probes and energies. `seq` counts these messages.
pub fn to_measures(snapshot: &Snapshot, probes: &[ProbeName], seq: u64) -> wire::Measures {
    let point = |(name, position): (&ProbeName, &Vector3<f64>)| wire::ProbePoint {
        id: name.id.clone(),
        body_id: name.body.clone(),
        position_m: Some(to_vec3(position)),
        rest_m: Some(to_vec3(&name.rest_m)),
    };
    let energy = |body: &BodySnapshot| {
        let energy = body.energy?;
        let finite = |joule: f64| if joule.is_finite() { joule } else { f64::MAX };
        Some(wire::BodyEnergy {
            body_id: body.id.to_string(),
            kinetic_j: finite(energy.kinetic_j),
            elastic_j: finite(energy.elastic_j),
        })
    };
    wire::Measures {
        seq,
        sim_step: snapshot.step,
        sim_time_s: snapshot.time_s,
        publish_unix_ns: unix_ns(),
        probes: probes.iter().zip(&snapshot.probes).take(MAX_PROBES).map(point).collect(),
        energies: snapshot.bodies.iter().filter_map(energy).collect(),
    }
}

/// Identity and place of a probe, which stay constant during a scene.
#[derive(Debug, Clone)]
pub struct ProbeName {
    /// Id of the probe in the scene.
    pub id: String,
    /// Id of the body that it lies in.
    pub body: String,
    /// Rest position [m].
    pub rest_m: Vector3<f64>,
}

fn little_endian<'a>(words: impl Iterator<Item = &'a u32>, count: usize) -> Bytes {
    let mut bytes = Vec::with_capacity(4 * count);
    for word in words {
        bytes.extend_from_slice(&word.to_le_bytes());
    }
    bytes.into()
}

/// State of a tool for viewers. `seq` counts these messages.
pub fn to_tool_state(snapshot: &Snapshot, tool: &ToolSnapshot, seq: u64) -> wire::ToolState {
    wire::ToolState {
        seq,
        sim_step: snapshot.step,
        sim_time_s: snapshot.time_s,
        publish_unix_ns: unix_ns(),
        tool_id: tool.id.to_string(),
        shape: Some(to_shape(&tool.shape)),
        pose: Some(to_pose(&tool.pose)),
        proxy_pose: Some(to_pose(&tool.proxy)),
        mode: to_mode(tool.mode).into(),
        force_n: Some(to_vec3(&tool.force_n)),
        owner: tool.owner.to_string(),
        max_force_n: tool.max_force_n as f32,
        held_point_m: tool.held_m.as_ref().map(to_vec3),
        closed: tool.closed as f32,
    }
}
