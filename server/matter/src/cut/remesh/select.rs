//! Selects the cut surface: the faces of the mesh that represent the sweep.
//!
//! Every edge that the sweep crosses marks the node closest to the crossing. A face is selected under three
//! conditions: its nodes are marked, the sweep has passed through an element next to it, and its two elements
//! lie on different sides of the sweep. The last condition is not in the source, whose cut surfaces may
//! branch. Without it an element with four marked nodes may lose all its faces, and faces nearly
//! perpendicular to the sweep are pressed flat.
//!
//! # Source
//! Nienhuys 2003, §3.2.1.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Vector3;

use super::complex::{Complex, FaceKey, face_key};
use super::memory::{Crossing, Memory};
use crate::cut::SweepTriangle;
use crate::mesh::TET_EDGES;

/// Number of crossed edges from which the sweep has passed through an element.
const PASSED: usize = 3;

/// The mark of a node: the closest crossing on its edges.
#[derive(Clone, Copy, Debug)]
pub struct NodeMark {
    /// The crossing at present [m].
    pub point: Vector3<f64>,
    /// Unit normal of the sweep there.
    pub normal: Vector3<f64>,
    /// Distance from the node [m].
    pub distance: f64,
}

/// What a sweep selects.
#[derive(Clone, Debug, Default)]
pub struct Selection {
    /// Marked nodes.
    pub marks: BTreeMap<u32, NodeMark>,
    /// Selected faces.
    pub faces: BTreeSet<FaceKey>,
}

/// Intersects the sweep with the edges of the mesh. If an incision crosses an edge several times, its first
/// crossing counts. The elements `near` the sweep, ascending, must be all that it may meet.
pub fn cross(complex: &Complex, near: &[u32], triangles: &[SweepTriangle], memory: &mut Memory) {
    let boxes: Vec<(u32, [Vector3<f64>; 2])> = near
        .iter()
        .map(|&t| {
            let [a, b, c, d] = complex.now(t);
            (t, [a.inf(&b).inf(&c.inf(&d)), a.sup(&b).sup(&c.sup(&d))])
        })
        .filter(|(_, [low, high])| triangles.iter().any(|s| s.overlaps(low, high)))
        .collect();
    for triangle in triangles {
        let [p, q, r] = triangle.corners;
        let normal = (q - p).cross(&(r - p)) / triangle.double_area;
        for (t, _) in boxes.iter().filter(|(_, [low, high])| triangle.overlaps(low, high)) {
            let (tet, x) = (complex.tet(*t), complex.now(*t));
            let side = x.map(|x| triangle.side(&x));
            for [i, j] in TET_EDGES {
                // A node exactly on the plane counts as above it, in the same way for every edge.
                if (side[i] >= 0.0) == (side[j] >= 0.0) || !triangle.holds_line(&x[i], &x[j]) {
                    continue;
                }
                let (lower, upper) = if tet[i] < tet[j] { (i, j) } else { (j, i) };
                let edge = [tet[lower], tet[upper]];
                let t = side[lower] / (side[lower] - side[upper]);
                let crossing = Crossing { t, upwards: side[lower] >= 0.0, normal };
                // The closest node already lies on the cut surface: this edge needs no other.
                if !memory.on.contains_key(&crossing.near(&edge)) {
                    memory.crossings.entry(edge).or_insert(crossing);
                }
            }
        }
    }
}

/// Marks nodes and selects faces from all crossings of the incision so far.
pub fn select(complex: &Complex, memory: &Memory) -> Selection {
    let mut selection = Selection { marks: marks(complex, memory), faces: BTreeSet::new() };
    let mut crossed: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for (edge, crossing) in &memory.crossings {
        for t in complex.around_edge(edge[0], edge[1]) {
            crossed.entry(t).or_default().push(crossing.near(edge));
        }
    }
    for (&t, crossings) in &crossed {
        let mut own: Vec<u32> = crossings.clone();
        own.extend(complex.tet(t).iter().filter(|n| memory.on.contains_key(n)));
        own.sort_unstable();
        own.dedup();
        if own.len() < PASSED && crossings.len() < PASSED {
            continue;
        }
        for k in 0..4 {
            let key = face_key(complex.face(t, k));
            if separates(complex, memory, &selection.marks, t, k) {
                selection.faces.insert(key);
            }
        }
    }
    close_notches(complex, memory, &mut selection);
    spare_single_elements(complex, memory, &mut selection);
    selection
}

fn marks(complex: &Complex, memory: &Memory) -> BTreeMap<u32, NodeMark> {
    let mut marks: BTreeMap<u32, NodeMark> = BTreeMap::new();
    for (edge, crossing) in &memory.crossings {
        let node = crossing.near(edge);
        let point = crossing.point(edge, complex);
        let distance = (point - complex.x_of(node)).norm();
        if marks.get(&node).is_none_or(|mark| distance < mark.distance) {
            marks.insert(node, NodeMark { point, normal: crossing.normal, distance });
        }
    }
    marks
}

/// Whether the face of `t` opposite local node `k` is marked and the sweep runs between its two elements.
fn separates(complex: &Complex, memory: &Memory, marks: &BTreeMap<u32, NodeMark>, t: u32, k: usize) -> bool {
    let face = complex.face(t, k);
    let marked = |n: &u32| marks.contains_key(n) || memory.on.contains_key(n);
    if !face.iter().all(marked) {
        return false;
    }
    let Some(other) = complex.neighbour(t, k) else { return false };
    let nearest = face.iter().filter_map(|n| marks.get(n)).min_by(|a, b| a.distance.total_cmp(&b.distance));
    let Some(plane) = nearest else { return false };
    let above = |t: u32| {
        let apex = complex.tet(t).into_iter().find(|n| !face.contains(n)).filter(|n| !marked(n));
        // An element with four marked nodes is on the side of its centroid.
        let at = match apex {
            Some(apex) => complex.x_of(apex),
            None => complex.now(t).iter().sum::<Vector3<f64>>() / 4.0,
        };
        (at - plane.point).dot(&plane.normal) >= 0.0
    };
    above(t) != above(other)
}

/// Adds faces whose three nodes are on the cut surface although no element next to them was passed. A sweep
/// in small parts leaves such notches: it puts the nodes of a face on the surface one by one.
fn close_notches(complex: &Complex, memory: &Memory, selection: &mut Selection) {
    let new: BTreeSet<u32> = selection.faces.iter().flatten().copied().collect();
    let normal = |n: &u32| match selection.marks.get(n) {
        Some(mark) if new.contains(n) => Some(mark.normal),
        _ => memory.on.get(n).copied(),
    };
    let mut faces = Vec::new();
    for t in new.iter().flat_map(|&n| complex.around(n)) {
        for k in 0..4 {
            let face = complex.face(*t, k);
            let (Some(p), Some(q), Some(r)) = (normal(&face[0]), normal(&face[1]), normal(&face[2])) else {
                continue;
            };
            let Some(other) = complex.neighbour(*t, k) else { continue };
            let key = face_key(face);
            let decided = |t: u32| {
                let cut = |k| {
                    let key = face_key(complex.face(t, k));
                    selection.faces.contains(&key) || complex.tag(&key).is_some()
                };
                complex.tet(t).iter().all(|n| normal(n).is_some()) && (0..4).any(cut)
            };
            let is_cut = selection.faces.contains(&key) || complex.tag(&key).is_some();
            // The first face of an element with four nodes on the surface already settled its side.
            if is_cut || decided(*t) || decided(other) {
                continue;
            }
            let middle = face.map(|n| complex.x_of(n)).iter().sum::<Vector3<f64>>() / 3.0;
            let above = |t: u32| {
                let apex = complex.tet(t).into_iter().find(|n| !face.contains(n) && normal(n).is_none());
                // An element with four nodes on the surface counts as above it.
                apex.is_none_or(|n| (complex.x_of(n) - middle).dot(&(p + q + r)) >= 0.0)
            };
            if above(*t) != above(other) {
                faces.push(key);
            }
        }
    }
    selection.faces.extend(faces);
}

/// Keeps an element whose nodes are all marked with one of its neighbours, so that it does not fall out.
fn spare_single_elements(complex: &Complex, memory: &Memory, selection: &mut Selection) {
    let marked = |n: &u32| selection.marks.contains_key(n) || memory.on.contains_key(n);
    let mut beside: BTreeSet<u32> = BTreeSet::new();
    for [p, q, r] in &selection.faces {
        let here = |t: &&u32| complex.tet(**t).contains(q) && complex.tet(**t).contains(r);
        beside.extend(complex.around(*p).iter().filter(here));
    }
    for t in beside {
        let keys = [0, 1, 2, 3].map(|k| face_key(complex.face(t, k)));
        let parted = |k: usize| {
            complex.neighbour(t, k).is_none()
                || selection.faces.contains(&keys[k])
                || complex.tag(&keys[k]).is_some()
        };
        let falls_out = complex.tet(t).iter().all(marked) && (0..4).all(parted);
        if let (true, Some(key)) = (falls_out, keys.iter().find(|key| selection.faces.contains(*key))) {
            selection.faces.remove(key);
        }
    }
}
