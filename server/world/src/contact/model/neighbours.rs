//! What else of the tissue shapes a contact besides the place where it pushes: the walls of a groove and the edges at
//! which the tissue ends.
//!
//! # Groove
//! A tool between two walls is pushed by both, and the step renders the sum of the two, along d. Alone, that plane
//! would let the tool slide to the side from message to message. With o, the way from device to proxy, and wall i with
//! normal nᵢ, a plane along mᵢ = nᵢ − d (d·nᵢ), normalised, pushes with what o has along mᵢ. It starts from zero where d
//! already is the direction of o; two opposite walls together are a spring with two sides. A dent that the tool makes
//! itself surrounds it as well, but its sides are not as steep.
//!
//! # Edge
//! Where the tissue turns away from the plane, as at the rim of a wound, the load must fall as the tool passes beyond.
//! The face behind the edge takes it away over the radius of the tool: a round tip is still held by the edge for as long.
//!
//! # Source
//! Knott and Kuhlen, *Accurate and adaptive contact modeling for multi-rate multi-point haptic rendering of static and
//! deformable environments* (2015): planes of a convex region limit each other, concave regions add up.

use nalgebra::Vector3;
use scindo_collision::Capsule;
use smallvec::SmallVec;

use crate::contact::press::Nearest;
use crate::contact::surface::ContactSurface;

use super::plane::{ContactPlane, MAX_CONTACTS};

/// Faces with normals at such an angle are two sides of a groove: largest scalar product. A ball dents tissue by sides
/// up to 40° steep each.
const GROOVE: f64 = 0.15;
/// A face is the side of an edge if the scalar product of its normal and that of the contact is at most this large.
const SIDE: f64 = 0.5;
/// Two sides are the same edge above this scalar product.
const SAME: f64 = 0.7;
/// Most walls of a groove, and most edges of a contact.
const MOST_WALLS: usize = 3;
const MOST_EDGES: usize = 2;
/// Part of a wall's normal across the plane that is needed to hold a tool by it.
const LEAST_ACROSS: f64 = 0.3;
/// Depth behind an edge below which the tool has passed it [m].
const LEAST_DEPTH_M: f64 = 1e-4;

/// Most planes of a model before the one that hides a change of model.
const ROOM: usize = MAX_CONTACTS - 1;

/// A tool at its proxy and at the device.
#[derive(Debug, Clone, Copy)]
pub struct Poses {
    /// Where the tissue keeps it.
    pub proxy: Capsule,
    /// Where the hand is.
    pub device: Capsule,
}

/// The same about a plane, for the planes beside it.
#[derive(Debug, Clone, Copy)]
pub struct Pushed<'a> {
    /// The plane that pushes.
    pub plane: &'a ContactPlane,
    /// How stiffly the hand holds the tool [N/m].
    pub hand_n_m: f64,
    /// Way of the core from the device pose of the last step to that of the query, reversed [m].
    pub back_m: Vector3<f64>,
    /// Whether the last step pushed the tool.
    pub pressed: bool,
}

/// Adds to `out` the planes with which the walls of a groove hold a tool that touches at `place`, within `margin` [m].
pub fn walls(
    place: &Nearest,
    poses: &Poses,
    (surfaces, margin): (&[ContactSurface], f64),
    pushed: &Pushed<'_>,
    out: &mut Vec<ContactPlane>,
) {
    let mut found: SmallVec<[(Vector3<f64>, f64); MOST_WALLS]> = SmallVec::new();
    found.push((place.normal, place.parameter));
    for tree in surfaces.iter().filter_map(ContactSurface::tree) {
        tree.triangles_near(&poses.proxy, margin, |near| {
            let away = near.closest.on_segment - near.closest.on_triangle;
            let Some(normal) = away.try_normalize(1e-9) else { return };
            if found.len() < MOST_WALLS && found.iter().all(|(known, _)| known.dot(&normal) < GROOVE) {
                found.push((normal, near.closest.parameter));
            }
        });
    }
    if found.len() < 2 {
        return;
    }
    let Pushed { plane, hand_n_m, back_m, pressed } = *pushed;
    for (normal, parameter) in found {
        if out.len() >= ROOM {
            return;
        }
        let across = normal - plane.normal * plane.normal.dot(&normal);
        let Some(normal) = across.try_normalize(LEAST_ACROSS) else { continue };
        let kept = poses.proxy.core_point(parameter) - poses.device.core_point(parameter);
        // The tissue has followed the last step, and answers what came after it in series with the hand.
        let (way, since) = (normal.dot(&kept), normal.dot(&back_m));
        let load = match pressed {
            true => hand_n_m * (way - since) + plane.stiffness_n_m * since,
            false => plane.stiffness_n_m * way,
        };
        out.push(ContactPlane {
            normal,
            gap_m: -way,
            force_n: normal * load,
            tangential_stiffness_n_m: 0.0,
            friction: 0.0,
            patch_radius_m: plane.patch_radius_m + poses.device.radius,
            ..*plane
        });
    }
}

/// A face behind an edge.
#[derive(Debug, Clone, Copy)]
struct Side {
    /// Distance from the contact [m].
    distance: f64,
    normal: Vector3<f64>,
    /// Its point closest to the contact [m].
    at: Vector3<f64>,
}

/// Adds to `out` the planes at which the tissue under contact number `of`, at `place`, ends within `reach` [m].
pub fn edges(
    place: &Nearest,
    poses: &Poses,
    (surfaces, reach): (&[ContactSurface], f64),
    of: usize,
    out: &mut Vec<ContactPlane>,
) {
    let Some(tree) = surfaces.get(place.body).and_then(ContactSurface::tree) else { return };
    let mut found: SmallVec<[Side; MOST_EDGES]> = SmallVec::new();
    tree.triangles_near(&Capsule { core: [place.point; 2], radius: 0.0 }, reach, |near| {
        let Some(normal) = tree.area_normal(near.triangle).try_normalize(f64::MIN_POSITIVE) else { return };
        let at = near.closest.on_triangle;
        let is_side = normal.dot(&place.normal).abs() <= SIDE;
        let behind = normal.dot(&(place.point - at)) <= 0.0 && place.normal.dot(&(at - place.point)) <= 1e-6;
        if !is_side || !behind {
            return;
        }
        let side = Side { distance: near.distance, normal, at };
        match found.iter().position(|known| known.normal.dot(&normal) > SAME) {
            Some(i) if side.distance < found[i].distance => found[i] = side,
            Some(_) => {}
            None if found.len() < MOST_EDGES => found.push(side),
            None => {}
        }
    });
    let (device, radius) = (poses.device.core_point(place.parameter), poses.device.radius);
    for Side { normal, at, .. } in found {
        let depth = radius - normal.dot(&(device - at));
        if depth > LEAST_DEPTH_M && out.len() < ROOM {
            out.push(ContactPlane {
                point_m: at,
                normal,
                gap_m: -depth,
                patch_radius_m: depth.min(radius.max(10.0 * LEAST_DEPTH_M)),
                edge_of: Some(of),
                ..ContactPlane::NONE
            });
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use std::sync::Arc;

    use nalgebra::Isometry3;

    use super::super::{ContactModels, LocalContact, ToolQuery};
    use super::*;
    use crate::inputs::{ToolMode, ToolShape};
    use crate::snapshot::{BodySnapshot, Snapshot, SurfaceTopology, ToolSnapshot};

    type V = Vector3<f64>;

    const RADIUS_M: f64 = 0.004;
    const BALL: ToolShape = ToolShape::Sphere { radius_m: RADIUS_M };
    const HAND: f64 = 800.0;
    const SERIES: f64 = 300.0;
    /// Half the width of the groove, and its depth [m].
    const GROOVE_M: f64 = 0.01;

    /// A block with a groove along y, whose walls slope by 45° to both sides.
    fn block() -> BodySnapshot {
        let g = GROOVE_M as f32;
        let outline =
            [[-0.04, -0.03], [0.04, -0.03], [0.04, 0.0], [g, 0.0], [0.0, -g], [-g, 0.0], [-0.04, 0.0]];
        let positions: Vec<[f32; 3]> =
            [-0.05, 0.05].iter().flat_map(|&y| outline.map(|[x, z]| [x, y, z])).collect();
        let n = outline.len() as u32;
        let mut triangles: Vec<[u32; 3]> = Vec::new();
        for i in 0..n {
            let j = (i + 1) % n;
            triangles.extend([[i, n + j, j], [i, n + i, n + j]]);
        }
        for [a, b, c] in [[0, 1, 4], [1, 2, 4], [2, 3, 4], [0, 4, 6], [4, 5, 6]] {
            triangles.extend([[a, b, c], [n + a, n + c, n + b]]);
        }
        let vertex_count = positions.len() as u32;
        let topology = SurfaceTopology { epoch: 1, vertex_count, triangles, ..SurfaceTopology::default() };
        let velocities = vec![[0.0; 3]; positions.len()];
        BodySnapshot { topology: Arc::new(topology), positions, velocities, ..BodySnapshot::default() }
    }

    /// The model of a ball that the tissue keeps at `proxy` and a hand presses to `device`, by the force along z.
    fn model(proxy: V, device: V) -> LocalContact {
        let pose = |tip: V| Isometry3::translation(tip.x, tip.y, tip.z);
        let tool = ToolSnapshot {
            id: Arc::from("probe"),
            shape: BALL,
            mode: ToolMode::Touch,
            pose: pose(device),
            proxy: pose(proxy),
            force_n: V::z() * (proxy.z - device.z) * HAND,
            stiffness_n_m: HAND,
            contact_stiffness_n_m: SERIES,
            max_force_n: 8.0,
            ..ToolSnapshot::default()
        };
        let snapshot = Snapshot { bodies: vec![block()], tools: vec![tool], step: 1, ..Snapshot::default() };
        let mut models = ContactModels::default();
        models.take(&snapshot, 0.0);
        let query = ToolQuery {
            id: Arc::from("probe"),
            shape: BALL,
            pose: pose(device),
            velocity_m_s: V::zeros(),
            mode: ToolMode::Touch,
        };
        // The force comes up gently.
        for tick in 1..100 {
            models.evaluate(&query, 0.01 * f64::from(tick));
        }
        models.evaluate(&query, 1.0).clone()
    }

    #[test]
    fn a_ball_in_a_groove_is_held_from_both_sides() {
        let proxy = V::z() * (RADIUS_M * 2f64.sqrt() - GROOVE_M + 1e-6);
        let device = proxy - V::z() * 0.002;
        let model = model(proxy, device);
        assert_eq!(model.planes.len(), 3, "{:?}", model.planes);
        let force = |way: V| model.force_at(device + way);
        let rest = force(V::zeros());
        assert!((rest - V::z() * 0.002 * HAND).norm() < 1e-3, "{rest}");
        for x in [-0.001, 0.001] {
            let back = force(V::x() * x) - rest;
            assert!((back + V::x() * SERIES * x).norm() < 0.05 * SERIES * 0.001, "{x} {back}");
        }
        // Along the groove it slides, and down it is pressed as by one plane.
        assert!((force(V::y() * 0.001) - rest).norm() < 1e-9);
        assert!((force(-V::z() * 0.001) - rest - V::z() * SERIES * 0.001).norm() < 1e-6);
    }

    #[test]
    fn a_ball_on_the_flat_has_one_plane_and_at_an_edge_its_load_ends() {
        let on = |x: f64| (V::new(x, 0.0, RADIUS_M + 1e-6), V::new(x, 0.0, RADIUS_M - 0.001));
        let (proxy, device) = on(-0.025);
        assert_eq!(model(proxy, device).planes.len(), 1);
        let (proxy, device) = on(0.038);
        let model = model(proxy, device);
        assert_eq!(model.planes.len(), 2, "{:?}", model.planes);
        let force = |x: f64| model.force_at(V::new(x, 0.0, device.z)).z;
        let whole = force(0.038);
        assert!((whole - 0.001 * HAND).abs() < 1e-3, "{whole}");
        assert!((force(0.039) - whole).abs() < 1e-3, "the tool is still before the edge");
        let share = force(0.042) / whole;
        assert!((share - 0.5).abs() < 0.01, "half of the ball is beyond: {share}");
        assert_eq!(force(0.045), 0.0);
    }
}
