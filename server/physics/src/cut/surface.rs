//! The surface of the fragment mesh: skin and the two lips of every cut, closed and 2-manifold.
//!
//! Boundary faces are paired across an edge by walking through the solid around it, so what is
//! joined is exactly what the material joins. A surface vertex is one cycle of boundary corners; two
//! lips that meet only in a fragment vertex get one surface vertex each.

use nalgebra::Vector3;

use crate::mesh::{TET_FACES, TetMesh};

use super::fragments::{FragmentVertex, Fragments, NONE};
use super::pieces::PieceTable;

/// A surface point bound to the material: x = Σ weights · x\[copies\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceVertex {
    /// Copies of the piece the vertex belongs to; a valid id in unused slots too.
    pub copies: [u32; 4],
    /// Weights, Σ = 1; 0 in unused slots.
    pub weights: [f64; 4],
}

/// Closed triangle surface of a body, counter-clockwise seen from outside.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surface {
    /// Vertex ids.
    pub triangles: Vec<[u32; 3]>,
    /// Per triangle 0 for skin, n > 0 for a lip of incision n.
    pub tags: Vec<u32>,
    /// The vertices.
    pub vertices: Vec<SurfaceVertex>,
}

impl SurfaceVertex {
    /// Position [m], given the position of every copy.
    pub fn position(&self, x: &[Vector3<f64>]) -> Vector3<f64> {
        self.copies.iter().zip(&self.weights).map(|(&c, &w)| x[c as usize] * w).sum()
    }
}

impl Surface {
    /// Enclosed volume [m³], given the position of every copy: Σ p·(q × r)/6.
    pub fn volume(&self, x: &[Vector3<f64>]) -> f64 {
        let points: Vec<Vector3<f64>> = self.vertices.iter().map(|v| v.position(x)).collect();
        let origin = points.first().copied().unwrap_or_default();
        let six: f64 = self
            .triangles
            .iter()
            .map(|t| {
                let [p, q, r] = t.map(|v| points[v as usize] - origin);
                p.dot(&q.cross(&r))
            })
            .sum();
        six / 6.0
    }
}

/// Builds the surface; keeps its scratch arrays and the order in which vertices first appeared.
#[derive(Clone, Debug, Default)]
pub struct SurfaceBuilder {
    /// Boundary faces as 4·fragment + slot of the opposite vertex.
    faces: Vec<u32>,
    /// Index into `faces` per 4·fragment + slot.
    face_at: Vec<u32>,
    /// Per half-edge 3·face + k (from corner k to corner k + 1) its partner.
    twin: Vec<u32>,
    /// Surface vertex per corner 3·face + k.
    corner: Vec<u32>,
    /// Fragment vertices in the order they first came to the surface.
    order: Vec<u32>,
    /// Position of each fragment vertex in `order`.
    rank: Vec<u32>,
    /// One corner of every surface vertex.
    representative: Vec<u32>,
}

impl SurfaceBuilder {
    /// Rebuilds `surface` from the fragment mesh.
    pub fn build(
        &mut self,
        mesh: &TetMesh,
        fragments: &Fragments,
        pieces: &PieceTable,
        surface: &mut Surface,
    ) {
        self.collect_faces(fragments);
        self.pair_half_edges(fragments);
        self.number_vertices(fragments);
        surface.vertices.clear();
        for &corner in &self.representative {
            let (t, v) = self.fragment_corner(fragments, corner);
            surface.vertices.push(bind(
                mesh,
                pieces,
                fragments.piece[t as usize],
                &fragments.vertices[v as usize],
            ));
        }
        surface.triangles.clear();
        surface.triangles.extend(self.corner.chunks_exact(3).map(|c| [c[0], c[1], c[2]]));
        surface.tags.clear();
        surface.tags.extend(self.faces.iter().map(|&f| fragments.tag[f as usize / 4][f as usize % 4]));
        self.split_doubled_edges(mesh, fragments, pieces, surface);
    }

    fn collect_faces(&mut self, fragments: &Fragments) {
        self.faces.clear();
        self.face_at.clear();
        self.face_at.resize(4 * fragments.tets.len(), NONE);
        for (t, neighbours) in fragments.neighbour.iter().enumerate() {
            for (k, &n) in neighbours.iter().enumerate() {
                if n == NONE {
                    self.face_at[4 * t + k] = self.faces.len() as u32;
                    self.faces.push((4 * t + k) as u32);
                }
            }
        }
    }

    /// Fragment and fragment vertex at a corner.
    fn fragment_corner(&self, fragments: &Fragments, corner: u32) -> (u32, u32) {
        let face = self.faces[corner as usize / 3];
        let slot = TET_FACES[face as usize % 4][corner as usize % 3];
        (face / 4, fragments.tets[face as usize / 4][slot])
    }

    fn pair_half_edges(&mut self, fragments: &Fragments) {
        self.twin.clear();
        self.twin.resize(3 * self.faces.len(), NONE);
        for h in 0..self.twin.len() as u32 {
            if self.twin[h as usize] == NONE {
                let partner = self.partner(fragments, h);
                self.twin[h as usize] = partner;
                self.twin[partner as usize] = h;
            }
        }
    }

    /// The half-edge on the far side of the solid wedge around half-edge `h`.
    fn partner(&self, fragments: &Fragments, h: u32) -> u32 {
        let face = self.faces[h as usize / 3];
        let (t, opposite, edge) = fragments.around_edge(face / 4, face as usize % 4, h as usize % 3);
        3 * self.face_at[4 * t as usize + opposite] + edge as u32
    }

    /// Numbers the cycles of corners: the first cycle at every fragment vertex in the order those
    /// came to the surface, further cycles behind all of them.
    fn number_vertices(&mut self, fragments: &Fragments) {
        self.rank.resize(fragments.vertices.len(), NONE);
        for corner in 0..self.twin.len() as u32 {
            let (_, v) = self.fragment_corner(fragments, corner);
            if self.rank[v as usize] == NONE {
                self.rank[v as usize] = self.order.len() as u32;
                self.order.push(v);
            }
        }
        self.corner.clear();
        self.corner.resize(self.twin.len(), NONE);
        self.representative.clear();
        self.representative.resize(self.order.len(), NONE);
        for corner in 0..self.twin.len() as u32 {
            if self.corner[corner as usize] != NONE {
                continue;
            }
            let (_, v) = self.fragment_corner(fragments, corner);
            let mut id = self.rank[v as usize];
            if self.representative[id as usize] == NONE {
                self.representative[id as usize] = corner;
            } else {
                id = self.representative.len() as u32;
                self.representative.push(corner);
            }
            let mut c = corner;
            while self.corner[c as usize] == NONE {
                self.corner[c as usize] = id;
                c = self.twin[(c / 3 * 3 + (c + 2) % 3) as usize];
            }
        }
    }

    /// Two different edges may join the same two vertices, e.g. the lips of a slit two faces wide.
    /// All but the first get a vertex in the middle, and their triangles a fan around the centroid.
    fn split_doubled_edges(
        &self,
        mesh: &TetMesh,
        fragments: &Fragments,
        pieces: &PieceTable,
        surface: &mut Surface,
    ) {
        let mut middle = Vec::new();
        for h in doubled_half_edges(&surface.triangles, surface.vertices.len()) {
            let twin = self.twin[h as usize];
            if middle.iter().any(|&(g, _): &(u32, u32)| g == h || g == twin) {
                continue;
            }
            let (t, a) = self.fragment_corner(fragments, h);
            let (_, b) = self.fragment_corner(fragments, next(h));
            let v = FragmentVertex::between(
                &fragments.vertices[a as usize],
                &fragments.vertices[b as usize],
                0.5,
            );
            let id = surface.vertices.len() as u32;
            surface.vertices.push(bind(mesh, pieces, fragments.piece[t as usize], &v));
            middle.push((h, id));
            middle.push((twin, id));
        }
        middle.sort_unstable();
        for on_triangle in middle.chunk_by(|p, q| p.0 / 3 == q.0 / 3) {
            let f = on_triangle[0].0 / 3;
            let triangle = surface.triangles[f as usize];
            let mut ring = Vec::with_capacity(6);
            for k in 0..3 {
                ring.push(triangle[k as usize]);
                ring.extend(on_triangle.iter().filter(|m| m.0 == 3 * f + k).map(|m| m.1));
            }
            let (t, _) = self.fragment_corner(fragments, 3 * f);
            let [a, b, c] =
                [0, 1, 2].map(|k| fragments.vertices[self.fragment_corner(fragments, 3 * f + k).1 as usize]);
            let centroid = FragmentVertex::between(&FragmentVertex::between(&a, &b, 0.5), &c, 1.0 / 3.0);
            let centre = surface.vertices.len() as u32;
            surface.vertices.push(bind(mesh, pieces, fragments.piece[t as usize], &centroid));
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

/// The half-edge behind `h` in its triangle.
fn next(h: u32) -> u32 {
    h / 3 * 3 + (h + 1) % 3
}

/// Half-edges 3·triangle + k whose directed vertex pair an earlier half-edge already has.
fn doubled_half_edges(triangles: &[[u32; 3]], n_vertices: usize) -> Vec<u32> {
    let mut start = vec![0u32; n_vertices + 1];
    for &v in triangles.iter().flatten() {
        start[v as usize + 1] += 1;
    }
    for v in 0..n_vertices {
        start[v + 1] += start[v];
    }
    let mut end = start.clone();
    let mut heads = vec![0u32; 3 * triangles.len()];
    let mut doubled = Vec::new();
    for (f, triangle) in (0u32..).zip(triangles) {
        for k in 0..3 {
            let (v, w) = (triangle[k] as usize, triangle[(k + 1) % 3]);
            if heads[start[v] as usize..end[v] as usize].contains(&w) {
                doubled.push(3 * f + k as u32);
            } else {
                heads[end[v] as usize] = w;
                end[v] += 1;
            }
        }
    }
    doubled
}

/// The vertex as mechanics moves it: weights on the copies of piece `p`.
fn bind(mesh: &TetMesh, pieces: &PieceTable, p: u32, v: &FragmentVertex) -> SurfaceVertex {
    let piece = &pieces.pieces[p as usize];
    let nodes = &mesh.tets[piece.element as usize];
    let mut bound = SurfaceVertex { copies: [NONE; 4], weights: v.weights };
    for (copy, &node) in bound.copies.iter_mut().zip(&v.nodes) {
        if let Some(a) = nodes.iter().position(|&n| n == node) {
            *copy = piece.copies[a];
        }
    }
    let [first, ..] = bound.copies;
    for copy in bound.copies.iter_mut().filter(|c| **c == NONE) {
        *copy = first;
    }
    bound
}
