//! Two different edges may join the same two surface vertices, e.g. the lips of a slit two faces
//! wide. All but the first get a vertex in the middle, and their triangles a fan around the centroid,
//! so that an edge is named by its ends.

use std::collections::BTreeSet;

use super::surface::{Surface, SurfaceVertex};

/// The edges to divide, each by the smaller of its two half-edges.
#[derive(Clone, Debug, Default)]
pub struct DoubledEdges {
    edges: BTreeSet<u32>,
}

impl DoubledEdges {
    /// The edges.
    pub fn iter(&self) -> impl Iterator<Item = u32> + '_ {
        self.edges.iter().copied()
    }

    /// Forgets an edge; whether it was known.
    pub fn remove(&mut self, edge: u32) -> bool {
        self.edges.remove(&edge)
    }

    /// Adds an edge.
    pub fn insert(&mut self, edge: u32) {
        self.edges.insert(edge);
    }

    /// Number of edges.
    #[cfg(test)]
    pub fn len(&self) -> usize {
        self.edges.len()
    }

    /// Looks at all edges around a vertex, each with the vertex at its other end: of those with the same
    /// end the first stays whole.
    pub fn compare(&mut self, around: &mut [(u32, u32)]) {
        around.sort_unstable();
        for same in around.chunk_by(|p, q| p.0 == q.0) {
            self.edges.remove(&same[0].1);
            self.edges.extend(same[1..].iter().map(|edge| edge.1));
        }
    }

    /// Appends the vertices in the middle of the edges and divides the triangles there: the first part
    /// of each takes the place of the triangle, the others come behind all triangles. `middle` is the
    /// vertex in the middle of corners 3·triangle + k of one triangle, which are these vertices.
    pub fn divide(
        &self,
        surface: &mut Surface,
        twin: impl Fn(u32) -> u32,
        middle: impl Fn(&[u32], &[SurfaceVertex]) -> SurfaceVertex,
    ) {
        let mut halved: Vec<(u32, u32)> = Vec::with_capacity(2 * self.edges.len());
        let mut on_edges = Vec::with_capacity(self.edges.len());
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

/// The half-edge behind `h` in its triangle.
pub fn next(h: u32) -> u32 {
    h / 3 * 3 + (h + 1) % 3
}
