//! Collapses edges, and splits edges and faces.
//!
//! A collapse is made only where it changes neither the topology (link condition) nor the volume, and where
//! every element around ends up better shaped than the element to be removed.
//!
//! # Source
//! Nienhuys 2003, §3.2.3. Link condition: Dey, Edelsbrunner, Guha, Nekhayev 1999, "Topology preserving
//! edge contraction", with a ghost node beyond the boundary.

use std::collections::BTreeSet;

use nalgebra::Vector3;

use super::complex::{Complex, FaceKey, det, face_key};
use super::node::{NEW, SnapNode};
use super::shape::aspect;

/// The ghost node: one apex beyond all boundary faces, which closes the links of boundary nodes.
const GHOST: u32 = u32::MAX;

/// Largest change of volume by a collapse, relative to the elements around it. It only allows for rounding.
const VOLUME: f64 = 1e-11;

/// A collapsed edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Collapse {
    /// The node that remains.
    pub kept: u32,
    /// The node that was removed.
    pub gone: u32,
}

/// Merges the ends of an edge, at one of them or in its middle. It does so only at a place where topology and
/// volume stay and every element around has an aspect ratio above `floor`.
pub fn collapse(complex: &mut Complex, a: u32, b: u32, floor: f64) -> Option<Collapse> {
    if !link_condition(complex, a, b) {
        return None;
    }
    let [node_a, node_b] = [a, b].map(|n| complex.node(n));
    let middle = SnapNode::between(&[&node_a, &node_b], &[0.5, 0.5]);
    let places = match (node_a.fixed.is_some(), node_b.fixed.is_some()) {
        (true, true) => return None,
        (true, false) => vec![(a, b, node_a)],
        (false, true) => vec![(b, a, node_b)],
        (false, false) => vec![(b, a, node_b), (a, b, node_a), (b, a, middle)],
    };
    let (kept, gone, place) =
        places.into_iter().find(|(kept, gone, place)| improves(complex, *kept, *gone, place, floor))?;
    let (mut node, other) = (complex.node(kept).placed_at(&place), complex.node(gone));
    node.point_force += other.point_force;
    node.spread_force += other.spread_force;
    if node.origin == NEW {
        node.origin = other.origin;
    }
    complex.set_node(kept, node);
    merge(complex, kept, gone);
    Some(Collapse { kept, gone })
}

/// Whether merging leaves well-shaped elements of the same total volume.
fn improves(complex: &Complex, kept: u32, gone: u32, place: &SnapNode, floor: f64) -> bool {
    let mut tets: Vec<u32> = complex.around(kept).to_vec();
    tets.extend(complex.around(gone).iter().filter(|&&t| !complex.tet(t).contains(&kept)));
    let (mut before, mut after) = (0.0, 0.0);
    for t in tets {
        let tet = complex.tet(t);
        let (rest, now) = (complex.rest(t), complex.now(t));
        before += det(&rest);
        if tet.contains(&kept) && tet.contains(&gone) {
            continue;
        }
        let put = |x: [Vector3<f64>; 4], to: Vector3<f64>| {
            std::array::from_fn(|k| if tet[k] == kept || tet[k] == gone { to } else { x[k] })
        };
        let (new_rest, new_now) = (put(rest, place.rest), put(now, place.x));
        if aspect(&new_rest) <= floor.max(0.0) || (det(&now) > 0.0 && det(&new_now) <= 0.0) {
            return false;
        }
        after += det(&new_rest);
    }
    (after - before).abs() <= VOLUME * before
}

fn merge(complex: &mut Complex, kept: u32, gone: u32) {
    let mut marked: BTreeSet<(FaceKey, u32)> = BTreeSet::new();
    for &t in complex.around(gone) {
        for k in (0..4).filter(|&k| complex.tet(t)[k] != gone) {
            let key = face_key(complex.face(t, k));
            marked.extend(complex.tag(&key).map(|tag| (key, tag)));
        }
    }
    for t in complex.around(gone).to_vec() {
        let tet = complex.tet(t);
        complex.remove_tet(t);
        if !tet.contains(&kept) {
            complex.add_tet(tet.map(|n| if n == gone { kept } else { n }));
        }
    }
    for (key, tag) in marked {
        complex.set_tag(key, None);
        if !key.contains(&kept) {
            complex.set_tag(face_key(key.map(|n| if n == gone { kept } else { n })), Some(tag));
        }
    }
}

/// Whether the edge can be contracted without a change of topology: Lk a ∩ Lk b = Lk ab.
fn link_condition(complex: &Complex, a: u32, b: u32) -> bool {
    let (of_a, of_b) = (link(complex, a), link(complex, b));
    let of_edge: Vec<[u32; 2]> = of_a.iter().filter_map(|t| without(t, b)).collect();
    let edge_nodes: BTreeSet<u32> = of_edge.iter().flatten().copied().collect();
    let edge_edges: BTreeSet<[u32; 2]> = of_edge.into_iter().collect();
    let edges = |link: &BTreeSet<FaceKey>| -> BTreeSet<[u32; 2]> {
        link.iter().flat_map(|&[p, q, r]| [[p, q], [p, r], [q, r]]).collect()
    };
    let nodes = |link: &BTreeSet<FaceKey>| -> BTreeSet<u32> { link.iter().flatten().copied().collect() };
    of_a.is_disjoint(&of_b)
        && edges(&of_a).intersection(&edges(&of_b)).all(|e| edge_edges.contains(e))
        && nodes(&of_a).intersection(&nodes(&of_b)).all(|n| edge_nodes.contains(n))
}

/// Triangles opposite a node, including those of the ghost elements beyond the boundary.
fn link(complex: &Complex, n: u32) -> BTreeSet<FaceKey> {
    let mut link = BTreeSet::new();
    for &t in complex.around(n) {
        for k in 0..4 {
            let face = complex.face(t, k);
            if complex.tet(t)[k] == n {
                link.insert(face_key(face));
            } else if complex.neighbour(t, k).is_none() {
                link.insert(face_key(face.map(|m| if m == n { GHOST } else { m })));
            }
        }
    }
    link
}

/// The other two nodes of a triangle, if it has `n`.
fn without(&[p, q, r]: &FaceKey, n: u32) -> Option<[u32; 2]> {
    match n {
        _ if n == p => Some([q, r]),
        _ if n == q => Some([p, r]),
        _ if n == r => Some([p, q]),
        _ => None,
    }
}

/// Adds a node on the edge from `a` to `b`, at parameter `s` from `a`, and splits the elements around it.
pub fn split_edge(complex: &mut Complex, a: u32, b: u32, s: f64) -> u32 {
    let place = SnapNode::between(&[&complex.node(a), &complex.node(b)], &[1.0 - s, s]);
    split(complex, place, &[a, b])
}

/// Adds a node on the face of `t` opposite its local node `k`, at these barycentric coordinates, and splits
/// the elements next to it.
pub fn split_face(complex: &mut Complex, t: u32, k: usize, weights: [f64; 3]) -> u32 {
    let face = complex.face(t, k);
    let place = SnapNode::between(&face.map(|n| complex.node(n)).each_ref(), &weights);
    split(complex, place, &face)
}

/// Adds a node inside the edge or face with these nodes. Every element with all of them is divided into as
/// many as there are nodes.
fn split(complex: &mut Complex, place: SnapNode, nodes: &[u32]) -> u32 {
    let m = complex.add_node(place);
    let holds = |tet: &[u32]| nodes.iter().all(|n| tet.contains(n));
    let around: Vec<u32> =
        complex.around(nodes[0]).iter().copied().filter(|&t| holds(&complex.tet(t))).collect();
    let mut marked = BTreeSet::new();
    for &t in &around {
        for key in (0..4).map(|k| face_key(complex.face(t, k))).filter(|key| holds(key)) {
            marked.extend(complex.tag(&key).map(|tag| (key, tag)));
        }
    }
    for t in around {
        let tet = complex.tet(t);
        complex.remove_tet(t);
        for &away in nodes {
            complex.add_tet(tet.map(|n| if n == away { m } else { n }));
        }
    }
    for (key, tag) in marked {
        complex.set_tag(key, None);
        for &away in nodes {
            complex.set_tag(face_key(key.map(|n| if n == away { m } else { n })), Some(tag));
        }
    }
    m
}
