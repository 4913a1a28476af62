//! Two triangles for every quad, and the division of doubled edges.
//!
//! Two different edges may join the same two vertices, e.g. at the end of an incision or where cells touch in an
//! edge. All but the first of them are divided in the middle, as in [`DoubledEdges`].

use std::collections::BTreeSet;

use super::super::cells::Octree;
use super::place::{Placed, bind};
use super::{NONE, OctreeSurface};
use crate::cut::shell::doubled_edges::DoubledEdges;

/// The diagonal with the larger smallest triangle is better from this ratio on.
const BETTER: f64 = 1.2;
/// The diagonal that passes nearer to the cut of the link is better from this difference on, in sides of finest
/// cells.
const NEARER: f64 = 0.01;

/// Edges to divide, by name: 5·face + k for edge k of a quad, k = 4 for its diagonal. Of the two names of an edge
/// the smaller counts.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Doubled {
    edges: BTreeSet<u32>,
    around: Vec<(u32, u32)>,
    vertices: Vec<(u32, u32)>,
}

impl Doubled {
    /// Forgets an edge.
    pub(super) fn forget(&mut self, name: u32) {
        self.edges.remove(&name);
    }

    /// Takes new numbers of the faces, in the same order.
    pub(super) fn renumber(&mut self, face: impl Fn(u32) -> u32) {
        self.edges = self.edges.iter().map(|name| 5 * face(name / 5) + name % 5).collect();
    }
}

impl OctreeSurface {
    /// Begins a change: undoes the division of doubled edges.
    pub(super) fn begin(&mut self) {
        self.patches.begin();
        self.surface.triangles.truncate(2 * self.patches.n_quads());
        self.surface.tags.truncate(2 * self.patches.n_quads());
        self.surface.vertices.truncate(self.patches.n_vertices());
        let doubled = std::mem::take(&mut self.doubled.edges);
        for &name in &doubled {
            let h = self.half_edge(name);
            self.write(h / 3 / 2);
            self.write(self.triangle_twin(h) / 3 / 2);
        }
        self.doubled.edges = doubled;
    }

    /// Divides the quads around all vertices that were placed anew.
    pub(super) fn triangulate(&mut self, octree: &Octree) {
        let mut around = std::mem::take(&mut self.around);
        around.clear();
        for &first in self.patches.walked() {
            self.patches.for_patch(first, |c| around.push(c / 4));
        }
        around.sort_unstable();
        around.dedup();
        for &q in &around {
            let turned = self.is_better_turned(octree, q);
            if turned != self.turned[q as usize] {
                self.doubled.forget(5 * self.faces[q as usize] + 4);
                self.turned[q as usize] = turned;
            }
            self.write(q);
        }
        self.find_doubled_edges(&around);
        self.around = around;
    }

    /// Writes the triangles of a quad: corners s, s + 1, s + 2 and s + 2, s + 3, s with s = 1 if it is turned.
    fn write(&mut self, q: u32) {
        let s = u32::from(self.turned[q as usize]);
        let v = [0, 1, 2, 3].map(|k| self.patches.vertex(4 * q + (s + k) % 4));
        let t = 2 * q as usize;
        self.surface.triangles[t] = [v[0], v[1], v[2]];
        self.surface.triangles[t + 1] = [v[2], v[3], v[0]];
    }

    /// Whether the diagonal from corner 1 to 3 fits better than that from 0 to 2. It should pass the point in
    /// which the link is cut, and triangles should be neither flat nor turned over.
    fn is_better_turned(&self, octree: &Octree, q: u32) -> bool {
        let h = octree.lattice().h;
        let p = self.corners(q);
        let cell = octree.cells()[self.faces[q as usize] as usize / 6].at;
        let out = self.direction(q);
        let cut = octree.lattice().centre(cell) + h * self.crossings[q as usize].distance * out;
        let up = (p[2] - p[0]).cross(&(p[3] - p[1]));
        // Distance of the cut from the triangles along the link, and size of the smaller one.
        let fit = |s: usize| {
            let mut fit = (f64::INFINITY, f64::INFINITY);
            for [a, b, c] in [[s, s + 1, s + 2], [s + 2, s + 3, s]].map(|t| t.map(|k| p[k % 4])) {
                let n = (b - a).cross(&(c - a));
                let holds = [(a, b), (b, c), (c, a)]
                    .iter()
                    .all(|(a, b)| (b - a).cross(&(cut - a)).dot(&out) >= -1e-9 * h * h);
                if holds && n.dot(&out) > 0.0 {
                    fit.0 = fit.0.min((n.dot(&(cut - a)) / n.dot(&out)).abs());
                }
                fit.1 = fit.1.min(n.dot(&up));
            }
            fit
        };
        let (plain, turned) = (fit(0), fit(1));
        let is_finite = plain.0.is_finite() && turned.0.is_finite();
        if is_finite && (plain.0 - turned.0).abs() > NEARER * h {
            return turned.0 < plain.0;
        }
        if turned.1 > BETTER * plain.1.max(0.0) {
            return true;
        }
        if plain.1 > BETTER * turned.1.max(0.0) {
            return false;
        }
        // The two lips of a narrow incision have different diagonals.
        self.faces[q as usize].is_multiple_of(2)
    }

    /// Name of the edge of half-edge 4·quad + k.
    pub(super) fn edge_name(&self, h: u32) -> u32 {
        let name = |h: u32| 5 * self.faces[h as usize / 4] + h % 4;
        name(h).min(name(self.patches.twin(h)))
    }

    /// Half-edge 3·triangle + k of half-edge 4·quad + k.
    fn in_triangle(&self, h: u32) -> u32 {
        let (q, s) = (h / 4, u32::from(self.turned[h as usize / 4]));
        let k = (h % 4 + 4 - s) % 4;
        3 * (2 * q + k / 2) + k % 2
    }

    /// One half-edge 3·triangle + k of the edge with this name.
    fn half_edge(&self, name: u32) -> u32 {
        let q = self.quad_at[name as usize / 5];
        if name % 5 == 4 { 3 * 2 * q + 2 } else { self.in_triangle(4 * q + name % 5) }
    }

    /// Opposite of half-edge 3·triangle + k.
    pub(super) fn triangle_twin(&self, h: u32) -> u32 {
        let (t, k) = (h / 3, h % 3);
        if k == 2 {
            return 3 * (t ^ 1) + 2;
        }
        self.in_triangle(self.patches.twin(self.corner(h)))
    }

    /// Corner 4·quad + k at the first end of half-edge 3·triangle + k.
    pub(super) fn corner(&self, h: u32) -> u32 {
        let (t, k) = (h / 3, h % 3);
        let s = u32::from(self.turned[t as usize / 2]);
        t / 2 * 4 + (s + 2 * (t % 2) + k) % 4
    }

    /// One half-edge 3·triangle + k of each doubled edge.
    pub(super) fn doubled_half_edges(&self) -> impl Iterator<Item = u32> {
        self.doubled.edges.iter().map(|&name| self.half_edge(name))
    }

    /// Looks around every vertex of these quads for different edges with the same two ends.
    fn find_doubled_edges(&mut self, quads: &[u32]) {
        let Doubled { mut edges, mut around, mut vertices } = std::mem::take(&mut self.doubled);
        vertices.clear();
        vertices.extend(quads.iter().flat_map(|q| 4 * q..4 * q + 4).map(|c| (self.patches.vertex(c), c)));
        vertices.sort_unstable();
        vertices.dedup_by_key(|(vertex, _)| *vertex);
        for &(_, first) in &vertices {
            around.clear();
            self.patches.for_patch(first, |c| {
                let (q, k) = (c / 4, c % 4);
                around.push((self.patches.vertex(4 * q + (k + 1) % 4), self.edge_name(c)));
                if k % 2 == u32::from(self.turned[q as usize]) {
                    around.push((self.patches.vertex(4 * q + (k + 2) % 4), 5 * self.faces[q as usize] + 4));
                }
            });
            around.sort_unstable();
            for same in around.chunk_by(|p, q| p.0 == q.0) {
                edges.remove(&same[0].1);
                edges.extend(same[1..].iter().map(|edge| edge.1));
            }
        }
        self.doubled = Doubled { edges, around, vertices };
    }

    /// Ends a change: divides doubled edges in the middle and their triangles into fans.
    pub(super) fn divide_doubled_edges(&mut self, octree: &Octree) {
        let mut doubled = DoubledEdges::default();
        self.doubled_half_edges().for_each(|h| doubled.insert(h));
        let mut surface = std::mem::take(&mut self.surface);
        let rest = |corner: u32| self.rest[self.patches.vertex(self.corner(corner)) as usize];
        doubled.divide(
            &mut surface,
            |h| self.triangle_twin(h),
            |corners, _| {
                let at = corners.iter().map(|&c| rest(c)).sum::<nalgebra::Vector3<f64>>();
                let leaf = self.faces[corners[0] as usize / 6] / 6;
                let Placed { point, .. } = bind(octree, leaf, at / corners.len() as f64);
                point
            },
        );
        self.surface = surface;
        debug_assert!(self.surface.triangles.as_flattened().iter().all(|v| *v != NONE));
    }
}
