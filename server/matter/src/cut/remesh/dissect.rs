//! Dissection: duplicates nodes by the connected components of the elements around them.
//!
//! Two elements at a node are connected if they share a face at that node that is not selected.
//!
//! # Source
//! Nienhuys 2003, §3.2 and ch. 7.

use std::collections::{BTreeMap, BTreeSet};

use super::complex::{Complex, face_key};
use super::memory::Memory;
use super::shape::star_volume;

/// A node that was split off another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Duplicate {
    /// The new node.
    pub node: u32,
    /// The node it was split from.
    pub parent: u32,
}

/// Splits `nodes` along all marked faces. The component with the lowest element keeps the node. Loads are
/// divided by volume.
pub fn dissect(complex: &mut Complex, nodes: &BTreeSet<u32>, memories: &mut [&mut Memory]) -> Vec<Duplicate> {
    // After the split both lips of a face need its mark, so marks are kept per element meanwhile.
    let mut marked = Vec::new();
    for (&[p, q, r], &tag) in complex.tags() {
        for &t in complex.around(p) {
            let tet = complex.tet(t);
            let apex = (0..4).find(|&k| ![p, q, r].contains(&tet[k]));
            if let (true, true, Some(k)) = (tet.contains(&q), tet.contains(&r), apex) {
                marked.push((t, k, tag));
            }
        }
    }
    let mut duplicates = Vec::new();
    for &n in nodes {
        let components = components_around(complex, n);
        if components.len() < 2 {
            continue;
        }
        let volumes: Vec<f64> = components.iter().map(|c| star_volume(complex, c)).collect();
        let total: f64 = volumes.iter().sum();
        let whole = complex.node(n);
        for (component, volume) in components.iter().zip(&volumes) {
            let share = if total > 0.0 { volume / total } else { 1.0 / components.len() as f64 };
            let mut part = whole;
            part.point_force *= share;
            part.spread_force *= share;
            if component[0] == components[0][0] {
                complex.set_node(n, part);
                continue;
            }
            let node = complex.add_node(part);
            rename_all(complex, component, n, node);
            memories.iter_mut().for_each(|memory| memory.duplicate(complex, n, node, component));
            duplicates.push(Duplicate { node, parent: n });
        }
    }
    let tags: BTreeMap<_, _> =
        marked.into_iter().map(|(t, k, tag)| (face_key(complex.face(t, k)), tag)).collect();
    complex.replace_tags(tags);
    duplicates
}

/// Replaces `from` by `to` in some elements. Their marked faces stay marked, since both elements of a face
/// may be among them.
fn rename_all(complex: &mut Complex, tets: &[u32], from: u32, to: u32) {
    let mut marked = Vec::new();
    for &t in tets {
        for k in (0..4).filter(|&k| complex.tet(t)[k] != from) {
            marked.extend(complex.tag(&face_key(complex.face(t, k))).map(|tag| (t, k, tag)));
        }
    }
    tets.iter().for_each(|&t| complex.rename(t, from, to));
    for (t, k, tag) in marked {
        complex.set_tag(face_key(complex.face(t, k)), Some(tag));
    }
}

/// Connected components of the elements around `n`, each ascending, ordered by their lowest element.
fn components_around(complex: &Complex, n: u32) -> Vec<Vec<u32>> {
    let mut left: BTreeSet<u32> = complex.around(n).iter().copied().collect();
    let mut components = Vec::new();
    while let Some(first) = left.pop_first() {
        let mut component = vec![first];
        let mut next = 0;
        while next < component.len() {
            let t = component[next];
            next += 1;
            for k in (0..4).filter(|&k| complex.tet(t)[k] != n) {
                if complex.tag(&face_key(complex.face(t, k))).is_none() {
                    let beside = complex.neighbour(t, k);
                    component.extend(beside.filter(|s| left.remove(s)));
                }
            }
        }
        component.sort_unstable();
        components.push(component);
    }
    components
}
