//! Removes degenerate elements, in passes as long as their number falls.
//!
//! # Source
//! Nienhuys 2003, §3.2.3. Unlike there, elements that cannot be collapsed are kept: removing them would lose
//! mass and open cracks, and they are not inverted.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Vector3;

use super::collapse::{Collapse, collapse, split_edge, split_face};
use super::complex::{Complex, barycentric, face_key};
use super::shape::{FLAT, Kind, aspect, kind, opposite, star_volume};
use crate::mesh::TET_EDGES;

/// Least distance of a new node from the ends of its edge, relative to the edge.
const INSIDE: f64 = 1e-3;

/// Counts and node changes of one cleaning.
#[derive(Clone, Debug, Default)]
pub struct Cleaned {
    /// Removed nodes, and the nodes they were merged with.
    pub merged: BTreeMap<u32, u32>,
    /// Collapsed edges.
    pub collapses: usize,
    /// New nodes on edges and faces.
    pub splits: usize,
    /// Degenerate elements at the start.
    pub found: usize,
    /// Degenerate elements that could not be removed.
    pub left: usize,
}

impl Cleaned {
    /// The degenerate elements of `region` are counted and stay.
    pub fn nothing(complex: &Complex, region: &BTreeSet<u32>) -> Self {
        let found = region.iter().filter(|t| is_flat(complex, **t)).count();
        Self { found, left: found, ..Self::default() }
    }

    /// The node that `n` was merged with, or `n`.
    pub fn kept(&self, mut n: u32) -> u32 {
        while let Some(&kept) = self.merged.get(&n) {
            n = kept;
        }
        n
    }

    /// Adds what was done before this cleaning. What was left then is part of what was found now.
    pub fn follow(&mut self, before: Self) {
        self.merged.extend(before.merged);
        self.collapses += before.collapses;
        self.splits += before.splits;
        self.found += before.found - before.left;
    }
}

/// Removes degenerate elements in `region`, and among the elements that replace them.
pub fn clean(complex: &mut Complex, region: BTreeSet<u32>) -> Cleaned {
    let mut cleaned = Cleaned::nothing(complex, &region);
    let mut region: Vec<u32> = region.into_iter().collect();
    let mut before = usize::MAX;
    loop {
        let flat: Vec<u32> = region.iter().copied().filter(|&t| is_flat(complex, t)).collect();
        cleaned.left = flat.len();
        if flat.is_empty() || flat.len() >= before {
            return cleaned;
        }
        before = flat.len();
        let first = complex.n_slots() as u32;
        for t in flat {
            if is_flat(complex, t) {
                remove(complex, t, &mut cleaned);
            }
        }
        region.extend(first..complex.n_slots() as u32);
    }
}

/// Largest number of elements of a crumb.
const CRUMB: usize = 16;

/// Volume of a crumb over that of the element beside it, at most.
const TINY: f64 = 0.01;

/// Keeps the body free of crumbs: where collapses have left a few thin elements around `nodes` with nothing but cut
/// surface and skin about them, they stay with an element beside them.
pub fn spare_crumbs(complex: &mut Complex, nodes: &BTreeSet<u32>) {
    let around: BTreeSet<u32> = nodes.iter().flat_map(|&n| complex.around(n).iter().copied()).collect();
    for t in around {
        let mut group = vec![t];
        let mut border = None;
        let mut at = 0;
        while at < group.len() && group.len() <= CRUMB {
            let s = group[at];
            at += 1;
            for k in 0..4 {
                let Some(other) = complex.neighbour(s, k) else { continue };
                let key = face_key(complex.face(s, k));
                if complex.tag(&key).is_some() {
                    border = border.or(Some((key, other)));
                } else if !group.contains(&other) {
                    group.push(other);
                }
            }
        }
        let Some((key, other)) = border.filter(|_| group.len() <= CRUMB) else { continue };
        if star_volume(complex, &group) < TINY * star_volume(complex, &[other]) {
            complex.set_tag(key, None);
        }
    }
}

fn is_flat(complex: &Complex, t: u32) -> bool {
    complex.is_alive(t) && aspect(&complex.rest(t)) < FLAT
}

fn remove(complex: &mut Complex, t: u32, cleaned: &mut Cleaned) {
    let start = complex.mark();
    let (tet, x) = (complex.tet(t), complex.rest(t));
    let floor = aspect(&x);
    let mut splits = 0;
    let mut done = match kind(&x) {
        Kind::Needle => None,
        Kind::Spindle(e) => meet_spindle(&x, e).and_then(|(s, k)| {
            let [a, b] = opposite(e);
            splits = 1;
            let m = split_edge(complex, tet[a], tet[b], s);
            collapse(complex, m, tet[k], floor)
        }),
        Kind::Sliver(e, f) => meet_sliver(&x, e, f).and_then(|[s, r]| {
            splits = 2;
            let m = split_edge(complex, tet[e[0]], tet[e[1]], s);
            let n = split_edge(complex, tet[f[0]], tet[f[1]], r);
            collapse(complex, m, n, floor)
        }),
        Kind::Cap(apex) => foot(&x, apex).and_then(|weights| {
            splits = 1;
            let m = split_face(complex, t, apex, weights);
            collapse(complex, m, tet[apex], floor)
        }),
    };
    if done.is_none() {
        complex.undo(start);
        splits = 0;
        // Fall back to what is done with needles: collapse an edge, the shortest first.
        let mut edges = TET_EDGES;
        edges.sort_by(|e, f| (x[e[0]] - x[e[1]]).norm().total_cmp(&(x[f[0]] - x[f[1]]).norm()));
        done = edges.into_iter().find_map(|[i, j]| collapse(complex, tet[i], tet[j], floor));
    }
    if let Some(Collapse { kept, gone }) = done {
        cleaned.merged.insert(gone, kept);
        cleaned.collapses += 1;
        cleaned.splits += splits;
    }
}

/// The place on the edge opposite `e` that lies closest to an end of `e`: its parameter, and that end.
fn meet_spindle(x: &[Vector3<f64>; 4], e: [usize; 2]) -> Option<(f64, usize)> {
    let [a, b] = opposite(e);
    let axis = x[b] - x[a];
    let place = |k: usize| {
        let s = (x[k] - x[a]).dot(&axis) / axis.norm_squared();
        ((x[k] - x[a] - axis * s).norm(), s, k)
    };
    let [p, q] = e.map(place);
    let (_, s, k) = if p.0 <= q.0 { p } else { q };
    inside(s).then_some((s, k))
}

/// Parameters, along each, of the closest points of two edges.
fn meet_sliver(x: &[Vector3<f64>; 4], e: [usize; 2], f: [usize; 2]) -> Option<[f64; 2]> {
    let (d, c, between) = (x[e[1]] - x[e[0]], x[f[1]] - x[f[0]], x[f[0]] - x[e[0]]);
    let (dd, cc, dc) = (d.norm_squared(), c.norm_squared(), d.dot(&c));
    let area = dd * cc - dc * dc;
    let s = (between.dot(&d) * cc - between.dot(&c) * dc) / area;
    let r = (between.dot(&d) * dc - between.dot(&c) * dd) / area;
    (inside(s) && inside(r)).then_some([s, r])
}

/// Barycentric coordinates of the foot of the perpendicular from a node to the opposite face, in the node
/// order of that face.
fn foot(x: &[Vector3<f64>; 4], apex: usize) -> Option<[f64; 3]> {
    let face = crate::mesh::TET_FACES[apex].map(|k| x[k]);
    let normal = (face[1] - face[0]).cross(&(face[2] - face[0])).try_normalize(0.0)?;
    let height = normal.dot(&(x[apex] - face[0]));
    let corners = [face[0], face[1], face[2], face[0] + normal * (face[1] - face[0]).norm()];
    let [a, b, c, _] = barycentric(&corners, &(x[apex] - normal * height))?;
    let weights = [a, b, c];
    weights.iter().all(|&w| inside(w)).then_some(weights)
}

fn inside(s: f64) -> bool {
    s > INSIDE && s < 1.0 - INSIDE
}
