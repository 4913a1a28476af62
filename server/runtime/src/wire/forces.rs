//! Forces of contact for clients.

use nalgebra::Vector3;
use scindo_proto::limits::{MAX_FORCE_PAIRS, MAX_FORCE_POINTS};
use scindo_proto::messages as wire;
use scindo_proto::messages::force_pair::Kind;
use scindo_world::snapshot::Snapshot;
use scindo_world::snapshot::forces::{ForceKind, ForcePair, ForcePoint};

use super::convert::{to_vec3, unix_ns};

/// The contacts of a snapshot. `obstacles` are the ids of those of the scene, and `seq` counts these messages.
pub fn to_forces(snapshot: &Snapshot, obstacles: &[String], seq: u64) -> wire::Forces {
    let pairs = snapshot.forces.pairs.iter().filter_map(|pair| to_pair(snapshot, obstacles, pair));
    wire::Forces {
        seq,
        sim_step: snapshot.step,
        sim_time_s: snapshot.time_s,
        publish_unix_ns: unix_ns(),
        pairs: pairs.take(MAX_FORCE_PAIRS).collect(),
    }
}

/// `None` for a pair whose other side is no longer there, or whose numbers cannot be sent.
fn to_pair(snapshot: &Snapshot, obstacles: &[String], pair: &ForcePair) -> Option<wire::ForcePair> {
    let (on, by) = (pair.on as usize, pair.by as usize);
    let body = |index: usize| snapshot.bodies.get(index).map(|body| body.id.to_string());
    let (kind, by) = match pair.kind {
        ForceKind::Tool => (Kind::Tool, snapshot.tools.get(by).map(|tool| tool.id.to_string())),
        ForceKind::Obstacle => (Kind::Obstacle, obstacles.get(by).cloned()),
        ForceKind::Body => (Kind::Body, body(by)),
        ForceKind::Itself => (Kind::Self_, body(by)),
    };
    let finite = pair.deepest_m.is_finite() && pair.normal_n.is_finite() && is_finite(&pair.force_n);
    let points = snapshot.forces.points_of(pair).iter().filter_map(to_point);
    finite.then_some(())?;
    Some(wire::ForcePair {
        kind: kind.into(),
        on: body(on)?,
        by: by?,
        contacts: pair.contacts,
        deepest_m: pair.deepest_m,
        force_n: Some(to_vec3(&pair.force_n)),
        normal_n: pair.normal_n,
        points: points.take(MAX_FORCE_POINTS).collect(),
    })
}

/// `None` for a point whose numbers do not fit single precision.
fn to_point(point: &ForcePoint) -> Option<wire::ForcePoint> {
    let single = |v: &Vector3<f64>| wire::Vec3f { x: v.x as f32, y: v.y as f32, z: v.z as f32 };
    let made = wire::ForcePoint {
        point_m: Some(single(&point.point_m)),
        normal: Some(single(&point.normal)),
        depth_m: point.depth_m as f32,
        normal_n: point.normal_n as f32,
        tangential_n: Some(single(&point.tangential_n)),
    };
    let fits = |v: &Vector3<f64>| v.iter().all(|c| (*c as f32).is_finite());
    let is_unit = (point.normal.norm() - 1.0).abs() < 1e-6;
    let vectors = fits(&point.point_m) && is_unit && fits(&point.tangential_n);
    (vectors && made.depth_m.is_finite() && made.normal_n.is_finite()).then_some(made)
}

fn is_finite(v: &Vector3<f64>) -> bool {
    v.iter().all(|c| c.is_finite())
}
