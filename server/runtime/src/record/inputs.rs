//! Inputs of a step as messages and back, bit for bit.

use std::sync::Arc;

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use scindo_proto::messages::{Pose, RecordedCut, RecordedStep, RecordedTool, Vec3};
use scindo_world::inputs::{CutRequest, Inputs, ToolInput, ToolMode, ToolShape, Wants};

const MODES: [ToolMode; 5] =
    [ToolMode::Hover, ToolMode::Touch, ToolMode::Grab, ToolMode::Cut, ToolMode::Scalpel];

/// A message that no server has written.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error(
    "step {number} of the recording: {what} is missing or out of range; the file was not written by scindo"
)]
pub struct Unreadable {
    /// Number of the step.
    pub number: u64,
    /// The field.
    pub what: &'static str,
}

/// Puts what a step read into `step`.
pub fn write(inputs: &Inputs, step: &mut RecordedStep) {
    step.energy = inputs.wants.energy;
    step.tools = inputs.tools.iter().map(to_tool).collect();
    step.cuts = inputs.cuts.iter().map(to_cut).collect();
}

/// What a step read.
///
/// # Errors
/// Fields without which a step cannot be made.
pub fn read(step: &RecordedStep) -> Result<Inputs, Unreadable> {
    let missing = |what| Unreadable { number: step.number, what };
    Ok(Inputs {
        tools: step.tools.iter().map(|tool| of_tool(tool, missing)).collect::<Result<_, _>>()?,
        cuts: step.cuts.iter().map(of_cut).collect(),
        wants: Wants { energy: step.energy, ..Wants::default() },
    })
}

fn to_vec(v: &Vector3<f64>) -> Vec3 {
    Vec3 { x: v.x, y: v.y, z: v.z }
}

fn of_vec(v: &Vec3) -> Vector3<f64> {
    Vector3::new(v.x, v.y, v.z)
}

/// A pose as a message.
pub fn to_pose(pose: &Isometry3<f64>) -> Pose {
    let q = pose.rotation.quaternion();
    Pose { position_m: Some(to_vec(&pose.translation.vector)), qx: q.i, qy: q.j, qz: q.k, qw: q.w }
}

/// A pose from a message, with the same bits: the quaternion is not normalised again.
pub fn of_pose(pose: &Pose) -> Option<Isometry3<f64>> {
    let place = Translation3::from(of_vec(pose.position_m.as_ref()?));
    let turn = UnitQuaternion::new_unchecked(Quaternion::new(pose.qw, pose.qx, pose.qy, pose.qz));
    Some(Isometry3::from_parts(place, turn))
}

/// Force and pose of a tool, for plots.
pub fn to_force(tool: &scindo_world::tool::Tool) -> scindo_proto::messages::ToolForce {
    scindo_proto::messages::ToolForce {
        id: tool.id.to_string(),
        owner: tool.owner.to_string(),
        pose: Some(to_pose(&tool.pose)),
        force_n: Some(to_vec(&tool.force_n)),
    }
}

fn to_tool(tool: &ToolInput) -> RecordedTool {
    let (shape, dimensions) = tool.shape.as_ref().map(to_shape).unzip();
    RecordedTool {
        id: tool.id.to_string(),
        owner: tool.owner.to_string(),
        pose: Some(to_pose(&tool.pose)),
        passed: tool.passed.iter().map(to_pose).collect(),
        velocity_m_s: Some(to_vec(&tool.velocity_m_s)),
        mode: MODES.iter().position(|mode| *mode == tool.mode).unwrap_or(0) as u32,
        closed: tool.closed,
        shape,
        dimensions: dimensions.unwrap_or_default(),
        seq: tool.seq,
        client_time_ns: tool.client_time_ns,
    }
}

fn of_tool(
    tool: &RecordedTool,
    missing: impl Fn(&'static str) -> Unreadable + Copy,
) -> Result<ToolInput, Unreadable> {
    let pose = |pose: &Pose| of_pose(pose).ok_or_else(|| missing("the position of a tool"));
    let shape = match tool.shape {
        None => None,
        Some(kind) => Some(of_shape(kind, &tool.dimensions).ok_or_else(|| missing("the shape of a tool"))?),
    };
    Ok(ToolInput {
        id: Arc::from(tool.id.as_str()),
        owner: Arc::from(tool.owner.as_str()),
        pose: pose(tool.pose.as_ref().ok_or_else(|| missing("the pose of a tool"))?)?,
        passed: tool.passed.iter().map(pose).collect::<Result<_, _>>()?,
        velocity_m_s: tool.velocity_m_s.as_ref().map(of_vec).unwrap_or_default(),
        mode: *MODES.get(tool.mode as usize).ok_or_else(|| missing("the mode of a tool"))?,
        closed: tool.closed,
        shape,
        seq: tool.seq,
        client_time_ns: tool.client_time_ns,
    })
}

fn to_shape(shape: &ToolShape) -> (u32, Vec<f64>) {
    match *shape {
        ToolShape::Blade { length_m, thickness_m } => (0, vec![length_m, thickness_m]),
        ToolShape::Sphere { radius_m } => (1, vec![radius_m]),
        ToolShape::Capsule { radius_m, length_m } => (2, vec![radius_m, length_m]),
        ToolShape::Forceps { radius_m, length_m, opening_m, grip_force_n, friction } => {
            (3, vec![radius_m, length_m, opening_m, grip_force_n, friction])
        }
        ToolShape::Retractor { radius_m, length_m, width_m, height_m } => {
            (4, vec![radius_m, length_m, width_m, height_m])
        }
        ToolShape::Hook { radius_m, length_m, reach_m, point_m } => {
            (5, vec![radius_m, length_m, reach_m, point_m])
        }
    }
}

fn of_shape(kind: u32, dimensions: &[f64]) -> Option<ToolShape> {
    Some(match (kind, dimensions) {
        (0, &[length_m, thickness_m]) => ToolShape::Blade { length_m, thickness_m },
        (1, &[radius_m]) => ToolShape::Sphere { radius_m },
        (2, &[radius_m, length_m]) => ToolShape::Capsule { radius_m, length_m },
        (3, &[radius_m, length_m, opening_m, grip_force_n, friction]) => {
            ToolShape::Forceps { radius_m, length_m, opening_m, grip_force_n, friction }
        }
        (4, &[radius_m, length_m, width_m, height_m]) => {
            ToolShape::Retractor { radius_m, length_m, width_m, height_m }
        }
        (5, &[radius_m, length_m, reach_m, point_m]) => {
            ToolShape::Hook { radius_m, length_m, reach_m, point_m }
        }
        _ => return None,
    })
}

fn to_cut(cut: &CutRequest) -> RecordedCut {
    RecordedCut {
        request: cut.request,
        tool: cut.tool.to_string(),
        body: cut.body.as_ref().map(|body| body.to_string()),
        points_m: cut.segments.iter().flatten().map(to_vec).collect(),
    }
}

fn of_cut(cut: &RecordedCut) -> CutRequest {
    CutRequest {
        request: cut.request,
        tool: Arc::from(cut.tool.as_str()),
        body: cut.body.as_deref().map(Arc::from),
        segments: cut
            .points_m
            .as_chunks::<2>()
            .0
            .iter()
            .map(|[tip, heel]| [of_vec(tip), of_vec(heel)])
            .collect(),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn inputs_survive_with_their_bits() {
        let pose = |k: f64| {
            let turn = UnitQuaternion::from_euler_angles(0.1 * k, 0.7, -1.3 * k);
            Isometry3::from_parts(Translation3::new(0.1 / 3.0, -k, 1e-300), turn)
        };
        let shapes = [
            ToolShape::Blade { length_m: 0.1, thickness_m: 1e-4 },
            ToolShape::Sphere { radius_m: 0.3 },
            ToolShape::Capsule { radius_m: 0.1, length_m: 0.2 },
            ToolShape::Forceps {
                radius_m: 1.0,
                length_m: 2.0,
                opening_m: 3.0,
                grip_force_n: 4.0,
                friction: 5.0,
            },
            ToolShape::Retractor { radius_m: 1.0, length_m: 2.0, width_m: 3.0, height_m: 4.0 },
            ToolShape::Hook { radius_m: 1.0, length_m: 2.0, reach_m: 3.0, point_m: 4.0 },
        ];
        let tools =
            shapes.into_iter().zip(MODES.into_iter().cycle()).enumerate().map(|(k, (shape, mode))| {
                let k = k as f64;
                ToolInput {
                    id: format!("tool-{k}").into(),
                    owner: "hand".into(),
                    pose: pose(k),
                    passed: vec![pose(k + 0.5); k as usize],
                    velocity_m_s: Vector3::new(k, 1.0 / 3.0, -0.0),
                    mode,
                    closed: (k > 2.0).then_some(k / 7.0),
                    shape: (k > 0.0).then_some(shape),
                    seq: 1 << 60,
                    client_time_ns: u64::MAX,
                }
            });
        let edge = [Vector3::new(0.1, 0.2, 0.3), Vector3::new(1.0 / 3.0, 0.0, f64::MIN_POSITIVE)];
        let cut = CutRequest {
            request: 7,
            tool: "knife".into(),
            body: Some("liver".into()),
            segments: vec![edge; 3],
        };
        let inputs = Inputs { tools: tools.collect(), cuts: vec![cut], wants: Wants::default() };
        let mut message = RecordedStep::default();
        write(&inputs, &mut message);
        let back = read(&message).unwrap();
        assert_eq!(format!("{inputs:?}"), format!("{back:?}"));
        message.tools[0].mode = 9;
        assert_eq!(read(&message).unwrap_err().what, "the mode of a tool");
    }
}
