//! Moves nodes of the cut surface onto the sweep.
//!
//! A node moves to a material point of an element next to it. That point has a position in the reference and
//! one in the deformed configuration, and a velocity. The existing fields of the body are thus sampled anew,
//! and a rigid motion stays rigid.
//!
//! A node inside the body goes to the foot of the perpendicular in the deformed configuration. A node on the
//! skin moves in the plane through it that keeps the volume, which is the skin itself where that is flat. A
//! node on a crease moves along the crease, and a corner stays. This contains the rule of the source
//! (projection on the intersection of sweep and skin), which is made for flat skins.
//!
//! # Source
//! Nienhuys 2003, §3.2.2.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Matrix3, Vector3};

use super::complex::{Complex, barycentric, det, face_key};
use super::memory::{EdgeKey, Memory};
use super::node::SnapNode;
use super::select::NodeMark;
use super::shape::aspect;

/// A sound move leaves at least this fraction of the volume of every element, in either configuration.
pub const LEAST_REMAINDER: f64 = 0.05;

/// No move makes an element flatter than this (least height over longest edge).
pub const LEAST_ASPECT: f64 = 1e-3;

/// Cosine of the angle between two skin faces beyond which the edge between them is a crease: 45°.
const CREASE: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// Cosine of the bend up to which a crease goes on through a node.
const STRAIGHT: f64 = 0.9;

/// Sine of the angle between sweep and skin below which a node cannot reach the sweep along the skin.
const LEAST_ANGLE: f64 = 0.1;

/// How far outside its element the new place may lie, in barycentric coordinates: inside the body only
/// rounding, on the skin also its curvature.
const OUTSIDE: f64 = 1e-9;
const OUTSIDE_ON_SKIN: f64 = 0.1;

/// Which nodes of a cut surface move onto the sweep.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Moves {
    /// No node moves. The cut follows the faces where they are and is jagged (Nienhuys 2003, fig. 3.5).
    None,
    /// Nodes whose elements all stay well shaped. Where neither end of a crossed edge can move, the edge is divided.
    #[default]
    Sound,
    /// As many as can without inverting an element. What lies between nodes of the cut surface is pressed flat, as in the
    /// source, and is for [`clean`](super::clean) to remove.
    Press,
}

/// Bounds of sound moves, from strict to lax. A move that satisfies a strict one is made first, and leaves more room for
/// others.
pub const SOUND: [Bound; 3] = [Bound::sound(0.1), Bound::sound(0.05), Bound::sound(0.03)];

/// Parts of its way that a node stays short of the sweep when it presses an element flat. The first one that keeps
/// [`LEAST_ASPECT`] is taken.
const SHORT: [f64; 9] = [0.0, 1.0 / 256.0, 1.0 / 128.0, 1.0 / 64.0, 1.0 / 32.0, 1.0 / 16.0, 0.125, 0.25, 0.5];

/// What a move must leave of every element around, in both configurations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bound {
    /// Least aspect ratio (least height over longest edge), except for elements that do not become flatter.
    aspect: f64,
    /// Least volume over that before the move.
    remainder: f64,
}

impl Bound {
    const UPRIGHT: Self = Self { aspect: LEAST_ASPECT, remainder: 0.0 };

    const fn sound(aspect: f64) -> Self {
        Self { aspect, remainder: LEAST_REMAINDER }
    }
}

/// Directions in which a node may move in the reference configuration.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Freedom {
    Space,
    /// Perpendicular to this unit vector.
    Plane(Vector3<f64>),
    /// Along this vector.
    Line(Vector3<f64>),
    None,
}

/// Moves as many nodes onto the sweep as possible, the closest first, and presses elements flat where it has to. A move
/// may make another one possible, so passes go on until none succeeds. Returns the number of nodes that stay off the
/// sweep.
pub fn relocate_all(complex: &mut Complex, nodes: Vec<u32>, marks: &BTreeMap<u32, NodeMark>) -> usize {
    let mut waiting = nodes;
    sort_by_distance(&mut waiting, marks);
    loop {
        let before = waiting.len();
        waiting.retain(|n| !relocate(complex, *n, &marks[n], (&[0.0], Bound::sound(LEAST_ASPECT))));
        if waiting.is_empty() || waiting.len() == before {
            break;
        }
    }
    waiting.retain(|n| !relocate(complex, *n, &marks[n], (&SHORT, Bound::UPRIGHT)));
    waiting.len()
}

fn sort_by_distance(nodes: &mut [u32], marks: &BTreeMap<u32, NodeMark>) {
    nodes.sort_by(|p, q| marks[p].distance.total_cmp(&marks[q].distance).then(p.cmp(q)));
}

/// Moves nodes onto the sweep, the closest first, until each of the crossed `edges` has one end there or none that may
/// move. Returns the nodes that moved, and the unit normals of the sweep there.
pub fn relocate_ends(
    complex: &mut Complex,
    edges: &BTreeSet<EdgeKey>,
    memory: &Memory,
    bound: Bound,
) -> BTreeMap<u32, Vector3<f64>> {
    let mut marks: BTreeMap<u32, NodeMark> = BTreeMap::new();
    let mut others: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for edge in edges {
        let Some(crossing) = memory.crossings.get(edge) else { continue };
        let (point, normal) = (crossing.point(edge, complex), crossing.normal);
        for (n, other) in [(edge[0], edge[1]), (edge[1], edge[0])] {
            others.entry(n).or_default().push(other);
            let distance = (point - complex.x_of(n)).norm();
            if marks.get(&n).is_none_or(|mark| distance < mark.distance) {
                marks.insert(n, NodeMark { point, normal, distance });
            }
        }
    }
    let mut waiting: Vec<u32> = marks.keys().copied().collect();
    sort_by_distance(&mut waiting, &marks);
    let mut moved = BTreeMap::new();
    loop {
        let before = waiting.len();
        waiting.retain(|n| {
            let is_needed = others[n].iter().any(|other| !moved.contains_key(other));
            if is_needed && relocate(complex, *n, &marks[n], (&[0.0], bound)) {
                moved.insert(*n, marks[n].normal);
            }
            is_needed && !moved.contains_key(n)
        });
        if waiting.len() == before {
            return moved;
        }
    }
}

/// Moves node `n` onto the sweep near `mark`, or as far as the first of the parts of its way allows that it may stay
/// `short`. Returns `false` if it has to stay.
fn relocate(complex: &mut Complex, n: u32, mark: &NodeMark, (short, bound): (&[f64], Bound)) -> bool {
    let node = complex.node(n);
    if node.fixed.is_some() {
        return false;
    }
    let freedom = freedom(complex, n);
    let Some(target) = target(complex, n, mark, freedom) else { return false };
    if !target.rest.iter().chain(target.x.iter()).all(|c| c.is_finite()) {
        return false;
    }
    // Node and target lie in one element, and so does everything between them.
    let places = short.iter().map(|&part| match part {
        0.0 => target,
        part => SnapNode::between(&[&target, &node], &[1.0 - part, part]),
    });
    let Some(moved) = places.into_iter().find(|moved| keeps(complex, n, moved, bound)) else { return false };
    complex.set_node(n, node.placed_at(&moved));
    true
}

/// The material point in the star of `n` that lies on the sweep.
fn target(complex: &Complex, n: u32, mark: &NodeMark, freedom: Freedom) -> Option<SnapNode> {
    let node = complex.node(n);
    // Distance from the sweep [m], positive along its normal.
    let s = mark.normal.dot(&(node.x - mark.point));
    let least = if freedom == Freedom::Space { -OUTSIDE } else { -OUTSIDE_ON_SKIN };
    let mut best: Option<(f64, SnapNode)> = None;
    for &t in complex.around(n) {
        let weights = match freedom {
            Freedom::None => None,
            Freedom::Space => barycentric(&complex.now(t), &(node.x - mark.normal * s)),
            Freedom::Plane(up) => along(complex, t, n, mark, |N| {
                let way = N - up * up.dot(&N);
                (way.norm() > LEAST_ANGLE * N.norm()).then(|| way * (-s / way.norm_squared()))
            }),
            Freedom::Line(d) => along(complex, t, n, mark, |N| {
                let slope = N.dot(&d);
                (slope.abs() > LEAST_ANGLE * N.norm() * d.norm()).then(|| d * (-s / slope))
            }),
        };
        let Some(weights) = weights else { continue };
        let depth = weights.into_iter().fold(f64::INFINITY, f64::min);
        if depth >= least && best.as_ref().is_none_or(|b| depth > b.0) {
            let nodes = complex.tet(t).map(|n| complex.node(n));
            best = Some((depth, SnapNode::between(&nodes.each_ref(), &weights)));
        }
    }
    best.map(|b| b.1)
}

/// Barycentric coordinates in `t` of the displaced rest position of `n`. The displacement is `way` applied to
/// Fᵀ n, the normal of the sweep pulled back to the reference configuration.
fn along(
    complex: &Complex,
    t: u32,
    n: u32,
    mark: &NodeMark,
    way: impl Fn(Vector3<f64>) -> Option<Vector3<f64>>,
) -> Option<[f64; 4]> {
    let edges = |x: [Vector3<f64>; 4]| Matrix3::from_columns(&[x[1] - x[0], x[2] - x[0], x[3] - x[0]]);
    let rest = complex.rest(t);
    let F = edges(complex.now(t)) * edges(rest).try_inverse()?;
    let moved = complex.rest_of(n) + way(F.transpose() * mark.normal)?;
    barycentric(&rest, &moved)
}

/// The freedom that the skin around `n` leaves it.
fn freedom(complex: &Complex, n: u32) -> Freedom {
    let mut skin: Vec<([u32; 3], Vector3<f64>, Option<u32>)> = Vec::new();
    for &t in complex.around(n) {
        for k in (0..4).filter(|&k| complex.tet(t)[k] != n) {
            if complex.neighbour(t, k).is_none() {
                let face = complex.face(t, k);
                let [p, q, r] = face.map(|n| complex.rest_of(n));
                skin.push((face, (q - p).cross(&(r - p)), complex.tag(&face_key(face))));
            }
        }
    }
    if skin.is_empty() {
        return Freedom::Space;
    }
    let mut beside: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (i, (face, ..)) in skin.iter().enumerate() {
        face.iter().filter(|&&m| m != n).for_each(|&m| beside.entry(m).or_default().push(i));
    }
    let mut creases = Vec::new();
    for (&m, faces) in &beside {
        let [i, j] = faces[..] else { return Freedom::None };
        let cosine = skin[i].1.dot(&skin[j].1) / (skin[i].1.norm() * skin[j].1.norm());
        // A flat face has no direction, so its edges count as creases.
        if cosine.is_nan() || cosine < CREASE || skin[i].2 != skin[j].2 {
            creases.push(m);
        }
    }
    let up: Vector3<f64> = skin.iter().map(|face| face.1).sum();
    let size: f64 = skin.iter().map(|face| face.1.norm()).sum();
    // At the tip of an incision the normals of the two lips cancel.
    let up = if up.norm() > 1e-9 * size { up.normalize() } else { Vector3::zeros() };
    let rest = |m: u32| complex.rest_of(m);
    match creases[..] {
        [] => Freedom::Plane(up),
        [a, b] => {
            let (to_a, to_b) = (rest(a) - rest(n), rest(b) - rest(n));
            if -to_a.dot(&to_b) < STRAIGHT * to_a.norm() * to_b.norm() {
                return Freedom::None;
            }
            let d = rest(b) - rest(a);
            Freedom::Line(d - up * up.dot(&d))
        }
        _ => Freedom::None,
    }
}

/// Whether all elements around `n` keep as much of their volume and shape as the bound asks.
fn keeps(complex: &Complex, n: u32, moved: &SnapNode, bound: Bound) -> bool {
    complex.around(n).iter().all(|&t| {
        let at = complex.tet(t).map(|m| m == n);
        let put = |mut x: [Vector3<f64>; 4], to: Vector3<f64>| {
            for (x, at) in x.iter_mut().zip(at) {
                if at {
                    *x = to;
                }
            }
            x
        };
        let (rest, now) = (complex.rest(t), complex.now(t));
        let (new_rest, new_now) = (put(rest, moved.rest), put(now, moved.x));
        let is_good = |new: &[Vector3<f64>; 4], old: &[Vector3<f64>; 4]| {
            det(new) > bound.remainder * det(old)
                && (aspect(new) >= bound.aspect || aspect(new) >= aspect(old))
        };
        let is_inverted = det(&now) <= 0.0;
        is_good(&new_rest, &rest) && (is_inverted || is_good(&new_now, &now))
    })
}
