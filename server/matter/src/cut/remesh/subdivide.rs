//! Remeshing: the elements that the sweep has parted are divided exactly along it, and nothing is done for the shape
//! of what results. It is the classical baseline that other ways to cut are measured against.
//!
//! Every crossed edge of a parted element gets a node where the sweep crosses it, one edge after the other in the
//! order of their nodes. Where it crosses closer to the end of an edge than a thousandth of it, the end itself counts as
//! lying on the sweep, and stays where it is. All elements around the edge are bisected, so the mesh stays conforming. Elements at the
//! front of the cut are divided without being parted. Afterwards the cut surface consists of the faces whose three
//! nodes lie on the sweep.
//!
//! # Source
//! Bielser, Maiwald, Gross 1999, *Interactive cuts through 3-dimensional soft tissue*: parted elements are replaced by
//! smaller ones. The bisections replace their table of cases.

use std::collections::BTreeSet;

use super::collapse::split_edge;
use super::complex::{Complex, FaceKey, det, face_key};
use super::memory::{EdgeKey, Memory};
use super::node::SnapNode;
use crate::mesh::{DEGENERATE_VOLUME, TET_EDGES};

/// Least distance of a new node from the ends of its edge, relative to the edge. Without it a node that lies on the sweep
/// but for rounding could be parted from both of its sides.
pub const INSIDE: f64 = 1e-3;

/// Distance from the sweep, relative to an edge, up to which a node lies on the sweep but for rounding.
const ROUNDING: f64 = 1e-9;

/// A new element has at least so many times the volume below which a mesh is refused.
const ROOM: f64 = 100.0;

/// What the divisions left.
#[derive(Clone, Debug, Default)]
pub struct Divided {
    /// The cut surface.
    pub faces: BTreeSet<FaceKey>,
    /// Number of new nodes on edges.
    pub splits: usize,
    /// Crossed edges that were left alone, because a part of an element would have had no volume.
    pub refused: usize,
}

/// Lets a node count as lying on the sweep where this crosses one of the `edges` closer to the node than a `part` of the
/// edge. Returns the number of such nodes that lie beside the sweep, not counting those that rounding puts there.
pub fn settle_ends(memory: &mut Memory, edges: &BTreeSet<EdgeKey>, part: f64) -> usize {
    let crossed = edges.iter().filter_map(|edge| Some((edge, memory.crossings.get(edge)?)));
    let ends = crossed.map(|(edge, c)| (c.near(edge), c.normal, c.t.min(1.0 - c.t)));
    let ends: Vec<_> = ends.filter(|end| end.2 < part).collect();
    let beside: BTreeSet<u32> = ends.iter().filter(|end| end.2 > ROUNDING).map(|end| end.0).collect();
    memory.settle(ends.into_iter().map(|(n, normal, _)| (n, normal)));
    beside.len()
}

/// Divides all elements that the incision of `memory` has parted.
pub fn subdivide(complex: &mut Complex, memory: &mut Memory) -> Divided {
    let mut divided = Divided::default();
    for edge in edges_of_parted(complex, memory) {
        let Some(crossing) = memory.crossings.get(&edge).copied() else { continue };
        let t = crossing.t;
        if !leaves_volume(complex, edge, t) {
            divided.refused += 1;
            continue;
        }
        let ends = edge.map(|n| complex.node(n));
        let node = split_edge(complex, edge[0], edge[1], t);
        hold_between(complex, node, &ends, t);
        divided.splits += 1;
        memory.crossings.remove(&edge);
        memory.on.insert(node, crossing.normal);
    }
    divided.faces = surface(complex, memory);
    divided
}

/// Crossed edges of the elements whose nodes beside the sweep hang together only over crossed edges, ascending.
pub fn edges_of_parted(complex: &Complex, memory: &Memory) -> BTreeSet<EdgeKey> {
    let crossed = memory.crossings.keys().flat_map(|edge| complex.around_edge(edge[0], edge[1]));
    let touched: BTreeSet<u32> = crossed.collect();
    let mut edges = BTreeSet::new();
    for t in touched {
        let tet = complex.tet(t);
        let key = |[i, j]: [usize; 2]| if tet[i] < tet[j] { [tet[i], tet[j]] } else { [tet[j], tet[i]] };
        let beside = |i: usize| !memory.on.contains_key(&tet[i]);
        // Parts of the element, by the lowest of their local nodes.
        let mut part = [0, 1, 2, 3];
        for [i, j] in TET_EDGES {
            if beside(i) && beside(j) && !memory.crossings.contains_key(&key([i, j])) {
                let (low, high) = (part[i].min(part[j]), part[i].max(part[j]));
                part.iter_mut().filter(|p| **p == high).for_each(|p| *p = low);
            }
        }
        let parts: BTreeSet<usize> = (0..4).filter(|&i| beside(i)).map(|i| part[i]).collect();
        if parts.len() > 1 {
            edges.extend(TET_EDGES.map(key).into_iter().filter(|edge| memory.crossings.contains_key(edge)));
        }
    }
    edges
}

/// Whether all parts that the elements around the edge would be divided into have a volume that a mesh may have.
fn leaves_volume(complex: &Complex, edge: EdgeKey, t: f64) -> bool {
    let [a, b] = edge.map(|n| complex.node(n));
    let between = SnapNode::between(&[&a, &b], &[1.0 - t, t]).rest;
    complex.around_edge(edge[0], edge[1]).into_iter().all(|e| {
        edge.iter().all(|away| {
            let x = complex.tet(e).map(|n| if n == *away { between } else { complex.rest_of(n) });
            let longest = TET_EDGES.iter().map(|&[i, j]| (x[i] - x[j]).norm()).fold(0.0, f64::max);
            det(&x) / 6.0 > ROOM * DEGENERATE_VOLUME * longest.powi(3)
        })
    })
}

/// A node on an edge whose ends are held in the same directions is held with them.
fn hold_between(complex: &mut Complex, node: u32, ends: &[SnapNode; 2], t: f64) {
    if let [Some((held, u)), Some((other, w))] = ends.map(|end| end.fixed)
        && held == other
    {
        let fixed = Some((held, u * (1.0 - t) + w * t));
        complex.set_node(node, SnapNode { fixed, ..complex.node(node) });
    }
}

/// Faces between two elements whose three nodes lie on the sweep, as far as they are not open yet.
fn surface(complex: &Complex, memory: &Memory) -> BTreeSet<FaceKey> {
    let mut faces = BTreeSet::new();
    for t in memory.on.keys().flat_map(|&n| complex.around(n)) {
        for k in 0..4 {
            let face = complex.face(*t, k);
            let key = face_key(face);
            let is_on = face.iter().all(|n| memory.on.contains_key(n));
            if is_on && complex.tag(&key).is_none() && complex.neighbour(*t, k).is_some() {
                faces.insert(key);
            }
        }
    }
    keep_flat_elements(complex, memory, &mut faces);
    faces
}

/// Keeps an element whose four nodes lie on the sweep with a neighbour, so that it does not fall out; if there is a
/// choice, with one that has a node beside the sweep.
fn keep_flat_elements(complex: &Complex, memory: &Memory, faces: &mut BTreeSet<FaceKey>) {
    let is_flat = |t: u32| complex.tet(t).iter().all(|n| memory.on.contains_key(n));
    let flat: BTreeSet<u32> =
        memory.on.keys().flat_map(|&n| complex.around(n)).copied().filter(|&t| is_flat(t)).collect();
    for t in flat {
        let open = |k: &usize| faces.contains(&face_key(complex.face(t, *k)));
        let thick = |k: &usize| complex.neighbour(t, *k).is_some_and(|other| !is_flat(other));
        let kept = (0..4).filter(open).find(thick).or_else(|| (0..4).find(open));
        if let Some(k) = kept {
            faces.remove(&face_key(complex.face(t, k)));
        }
    }
}
