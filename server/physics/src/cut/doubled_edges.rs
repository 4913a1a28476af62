//! Two different edges may join the same two surface vertices, e.g. the lips of a slit two faces
//! wide. All but the first get a vertex in the middle, and their triangles a fan around the centroid,
//! so that an edge is named by its ends.

use std::collections::BTreeSet;

use super::fragments::FragmentVertex;
use super::surface::{Surface, bind};
use super::surface_builder::{Material, SurfaceBuilder};

/// The edges to divide, each by the smaller of its two half-edges.
#[derive(Clone, Debug, Default)]
pub struct DoubledEdges {
    edges: BTreeSet<u32>,
}

impl DoubledEdges {
    /// Adds an edge.
    pub fn insert(&mut self, edge: u32) {
        self.edges.insert(edge);
    }

    /// Forgets an edge.
    pub fn remove(&mut self, edge: u32) {
        self.edges.remove(&edge);
    }

    /// Number of edges.
    #[cfg(test)]
    pub fn len(&self) -> usize {
        self.edges.len()
    }

    /// Triangles with such an edge, some more than once.
    pub fn triangles(&self, twin: impl Fn(u32) -> u32) -> Vec<u32> {
        self.edges.iter().flat_map(|&h| [h / 3, twin(h) / 3]).collect()
    }

    /// Appends the vertices in the middle of the edges and divides the triangles there: the first
    /// part of each takes the place of the triangle, the others come behind all triangles.
    pub fn put_on_fans(&mut self, builder: &SurfaceBuilder, material: &Material, surface: &mut Surface) {
        let Material { mesh, fragments, pieces } = material;
        let place = |t: u32, v: &FragmentVertex| bind(mesh, pieces, fragments.piece[t as usize], v);
        let at = |corner: u32| {
            let (t, v) = builder.fragment_corner(fragments, corner);
            (t, fragments.vertices[v as usize])
        };
        let mut middle = Vec::with_capacity(2 * self.edges.len());
        for &h in &self.edges {
            let ((t, a), (_, b)) = (at(h), at(super::surface_builder::next(h)));
            let id = surface.vertices.len() as u32;
            surface.vertices.push(place(t, &FragmentVertex::between(&a, &b, 0.5)));
            middle.extend([(h, id), (builder.twin(h), id)]);
        }
        middle.sort_unstable();
        for on_triangle in middle.chunk_by(|p, q| p.0 / 3 == q.0 / 3) {
            let f = on_triangle[0].0 / 3;
            let mut ring = Vec::with_capacity(6);
            for (h, corner) in (3 * f..).zip(surface.triangles[f as usize]) {
                ring.push(corner);
                ring.extend(on_triangle.iter().filter(|m| m.0 == h).map(|m| m.1));
            }
            let [(t, a), (_, b), (_, c)] = [0, 1, 2].map(|k| at(3 * f + k));
            let centroid = FragmentVertex::between(&FragmentVertex::between(&a, &b, 0.5), &c, 1.0 / 3.0);
            let centre = surface.vertices.len() as u32;
            surface.vertices.push(place(t, &centroid));
            let tag = surface.tags[f as usize];
            for k in 0..ring.len() {
                let fan = [ring[k], ring[(k + 1) % ring.len()], centre];
                if k == 0 {
                    surface.triangles[f as usize] = fan;
                } else {
                    surface.triangles.push(fan);
                    surface.tags.push(tag);
                }
            }
        }
    }
}
