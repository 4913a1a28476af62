//! Two different edges may join the same two surface vertices, e.g. at the lips of a slit two faces wide. All
//! but the first of them get a vertex in the middle, and their triangles are divided into fans around the
//! centroid. Every edge is then identified by its ends.

use std::collections::BTreeSet;

use super::surface::Surface;
use crate::element::MaterialPoint;

/// The edges to divide, each identified by the smaller of its two half-edges.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(crate) struct DoubledEdges {
    edges: BTreeSet<u32>,
}

impl DoubledEdges {
    /// The edges in ascending order.
    pub(crate) fn iter(&self) -> impl Iterator<Item = u32> + '_ {
        self.edges.iter().copied()
    }

    /// Forgets an edge and returns whether it was known.
    pub(crate) fn remove(&mut self, edge: u32) -> bool {
        self.edges.remove(&edge)
    }

    /// Records an edge that has to be divided.
    pub(crate) fn insert(&mut self, edge: u32) {
        self.edges.insert(edge);
    }

    /// Number of edges.
    #[cfg(test)]
    pub(crate) fn len(&self) -> usize {
        self.edges.len()
    }

    /// Compares all edges around a vertex, each given with the vertex at its other end. Of edges with the
    /// same end the first stays whole.
    pub(crate) fn compare(&mut self, around: &mut [(u32, u32)]) {
        around.sort_unstable();
        for same in around.chunk_by(|p, q| p.0 == q.0) {
            self.edges.remove(&same[0].1);
            self.edges.extend(same[1..].iter().map(|edge| edge.1));
        }
    }

    /// Appends the vertices in the middle of the edges and divides the triangles there. The first part of a
    /// triangle takes its number, the others are appended behind all triangles. `middle` returns the centroid
    /// of corners 3·triangle + k of one triangle, whose vertices it is given.
    pub(crate) fn divide(
        &self,
        surface: &mut Surface,
        twin: impl Fn(u32) -> u32,
        middle: impl Fn(&[u32], &[MaterialPoint]) -> MaterialPoint,
    ) {
        let mut halved: Vec<(u32, u32)> = Vec::with_capacity(2 * self.edges.len());
        let mut on_edges = Vec::with_capacity(self.edges.len());
        // An edge is divided at one point, which both of its triangles use.
        for (&h, id) in self.edges.iter().zip(surface.vertices.len() as u32..) {
            let (triangle, k) = (surface.triangles[h as usize / 3], h as usize % 3);
            let ends = [k, (k + 1) % 3].map(|k| surface.vertices[triangle[k] as usize]);
            on_edges.push(middle(&[h, next(h)], &ends));
            halved.extend([(h, id), (twin(h), id)]);
        }
        surface.vertices.extend(on_edges);
        halved.sort_unstable();
        for on_triangle in halved.chunk_by(|p, q| p.0 / 3 == q.0 / 3) {
            let t = on_triangle[0].0 / 3;
            let (triangle, tag) = (surface.triangles[t as usize], surface.tags[t as usize]);
            // The outline of the triangle, with the new vertices in their order.
            let mut ring = Vec::with_capacity(6);
            for (h, corner) in (3 * t..).zip(triangle) {
                ring.push(corner);
                ring.extend(on_triangle.iter().filter(|m| m.0 == h).map(|m| m.1));
            }
            let centre = surface.vertices.len() as u32;
            let corners = triangle.map(|v| surface.vertices[v as usize]);
            surface.vertices.push(middle(&[3 * t, 3 * t + 1, 3 * t + 2], &corners));
            for k in 0..ring.len() {
                let fan = [ring[k], ring[(k + 1) % ring.len()], centre];
                if k == 0 {
                    surface.triangles[t as usize] = fan;
                } else {
                    surface.triangles.push(fan);
                    surface.tags.push(tag);
                }
            }
        }
    }
}

/// The next half-edge after `h` in its triangle.
pub(crate) fn next(h: u32) -> u32 {
    h / 3 * 3 + (h + 1) % 3
}
