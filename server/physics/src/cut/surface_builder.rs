//! Keeps the surface up to date: its cost is that of what a cut changed, not that of the body.
//!
//! Boundary faces are paired across an edge by walking through the solid around it, so what is
//! joined is exactly what the material joins. A surface vertex is one cycle of boundary corners; two
//! lips that meet only in a fragment vertex get one surface vertex each.
//!
//! A boundary face never goes away, it only becomes smaller, so triangles keep their number. A pair of
//! half-edges comes apart only if a fragment with one of them is bisected or opened there, and the
//! new partner of each then lies on such a fragment too: it is enough to pair the half-edges of
//! changed fragments anew, and to walk the cycles that pass one of their corners.

use crate::mesh::{TET_FACES, TetMesh};

use super::doubled_edges::DoubledEdges;
use super::fragments::{Fragments, NONE, leave_room};
use super::pieces::PieceTable;
use super::surface::{Surface, SurfaceVertex, bind};

/// What the surface is made from.
pub struct Material<'a> {
    /// Rest mesh.
    pub mesh: &'a TetMesh,
    /// Fragment mesh.
    pub fragments: &'a Fragments,
    /// Pieces and their copies.
    pub pieces: &'a PieceTable,
}

/// What a sweep did to the fragments.
#[derive(Clone, Copy, Debug)]
pub struct Change<'a> {
    /// Fragments that are new, were bisected or had a face opened, each once.
    pub fragments: &'a [u32],
    /// Boundary faces (4·fragment + slot) that went from one fragment to another: from, to, in order.
    pub moved: &'a [[u32; 2]],
    /// Pieces that have other copies than before, ascending.
    pub pieces: &'a [u32],
}

/// Boundary faces, how they are joined, and scratch arrays.
#[derive(Clone, Debug, Default)]
pub struct SurfaceBuilder {
    /// Boundary faces as 4·fragment + slot of the opposite vertex; triangle f of the surface is face f.
    faces: Vec<u32>,
    /// Index into `faces` per 4·fragment + slot.
    face_at: Vec<u32>,
    /// Per half-edge 3·face + k (from corner k to corner k + 1) its partner.
    twin: Vec<u32>,
    /// Surface vertex per corner 3·face + k.
    corner: Vec<u32>,
    /// Fragment vertex per corner when its cycle was last walked.
    source: Vec<u32>,
    /// One corner of every surface vertex.
    representative: Vec<u32>,
    doubled: DoubledEdges,
    /// Faces of the changed fragments.
    dirty: Vec<u32>,
    /// Surface vertices whose cycle was walked in this update.
    walked: Vec<u32>,
    /// Surface vertices that may have lost their last corner.
    doubtful: Vec<u32>,
    cycle: Vec<u32>,
    /// Per corner the last update that walked it.
    seen: Vec<u32>,
    /// Per surface vertex the last update that bound it, because a cycle took its number or otherwise.
    claimed: Vec<u32>,
    stamp: u32,
}

impl SurfaceBuilder {
    /// Builds the surface of a fragment mesh.
    pub fn build(material: &Material) -> (Self, Surface) {
        let (mut builder, mut surface) = (Self::default(), Surface::default());
        let all: Vec<u32> = (0..material.fragments.tets.len() as u32).collect();
        builder.update(material, &Change { fragments: &all, moved: &[], pieces: &[] }, &mut surface);
        leave_room(&mut builder.face_at);
        (builder, surface)
    }

    /// Brings the surface up to date after a change.
    pub fn update(&mut self, material: &Material, change: &Change, surface: &mut Surface) {
        self.stamp += 1;
        self.take_off_fans(surface);
        self.collect_faces(material.fragments, change, surface);
        self.pair_half_edges(material.fragments);
        self.walk_cycles(material, surface);
        self.drop_dead_vertices(surface);
        self.bind_again(material, change.pieces, surface);
        self.find_doubled_edges();
        self.put_on_fans(material, surface);
    }

    /// Half-edges 3·face + k and their partners.
    pub fn twin(&self, h: u32) -> u32 {
        self.twin[h as usize]
    }

    /// Fragment and fragment vertex at a corner.
    pub fn fragment_corner(&self, fragments: &Fragments, corner: u32) -> (u32, u32) {
        let face = self.faces[corner as usize / 3];
        let slot = TET_FACES[face as usize % 4][corner as usize % 3];
        (face / 4, fragments.tets[face as usize / 4][slot])
    }

    /// For every half-edge (4·fragment + slot, k) its partner.
    #[cfg(test)]
    pub fn joints(&self) -> std::collections::BTreeMap<(u32, u32), (u32, u32)> {
        let name = |h: u32| (self.faces[h as usize / 3], h % 3);
        (0..self.twin.len() as u32).map(|h| (name(h), name(self.twin(h)))).collect()
    }

    /// Numbers of vertices (fans not counted) and of edges that are divided.
    #[cfg(test)]
    pub fn counts(&self) -> [usize; 2] {
        [self.representative.len(), self.doubled.len()]
    }

    /// Surface vertex, and where it should be: fragment and fragment vertex, of every corner.
    #[cfg(test)]
    pub fn corners(&self, fragments: &Fragments) -> Vec<(u32, (u32, u32))> {
        (0u32..).zip(&self.corner).map(|(c, &id)| (id, self.fragment_corner(fragments, c))).collect()
    }

    /// Surface vertices of triangle f as it is without a fan.
    fn triangle(&self, f: u32) -> [u32; 3] {
        [0, 1, 2].map(|k| self.corner[3 * f as usize + k])
    }

    fn take_off_fans(&mut self, surface: &mut Surface) {
        surface.vertices.truncate(self.representative.len());
        surface.triangles.truncate(self.faces.len());
        surface.tags.truncate(self.faces.len());
        for f in self.doubled.triangles(|h| self.twin(h)) {
            surface.triangles[f as usize] = self.triangle(f);
        }
    }

    fn put_on_fans(&mut self, material: &Material, surface: &mut Surface) {
        let mut doubled = std::mem::take(&mut self.doubled);
        doubled.put_on_fans(self, material, surface);
        self.doubled = doubled;
    }

    fn collect_faces(&mut self, fragments: &Fragments, change: &Change, surface: &mut Surface) {
        self.face_at.resize(4 * fragments.tets.len(), NONE);
        for &[from, to] in change.moved {
            let f = std::mem::replace(&mut self.face_at[from as usize], NONE);
            // Faces that appeared since the last update are not known yet, wherever they were.
            if f != NONE {
                self.face_at[to as usize] = f;
                self.faces[f as usize] = to;
            }
        }
        self.dirty.clear();
        for &t in change.fragments {
            for (k, &n) in fragments.neighbour[t as usize].iter().enumerate() {
                if n != NONE {
                    continue;
                }
                let at = &mut self.face_at[4 * t as usize + k];
                if *at == NONE {
                    *at = self.faces.len() as u32;
                    self.faces.push(4 * t + k as u32);
                    surface.triangles.push([NONE; 3]);
                    surface.tags.push(fragments.tag[t as usize][k]);
                }
                self.dirty.push(*at);
            }
        }
        let n = 3 * self.faces.len();
        for per_corner in [&mut self.twin, &mut self.corner, &mut self.source] {
            per_corner.resize(n, NONE);
        }
        self.seen.resize(n, 0);
    }

    fn pair_half_edges(&mut self, fragments: &Fragments) {
        for i in 0..self.dirty.len() {
            for h in 3 * self.dirty[i]..3 * self.dirty[i] + 3 {
                let twin = std::mem::replace(&mut self.twin[h as usize], NONE);
                if twin != NONE {
                    self.doubled.remove(h.min(twin));
                }
            }
        }
        for i in 0..self.dirty.len() {
            for h in 3 * self.dirty[i]..3 * self.dirty[i] + 3 {
                if self.twin[h as usize] == NONE {
                    let partner = self.partner(fragments, h);
                    self.twin[h as usize] = partner;
                    self.twin[partner as usize] = h;
                }
            }
        }
    }

    /// The half-edge on the far side of the solid wedge around half-edge `h`.
    fn partner(&self, fragments: &Fragments, h: u32) -> u32 {
        let face = self.faces[h as usize / 3];
        let (t, opposite, edge) = fragments.around_edge(face / 4, face as usize % 4, h as usize % 3);
        3 * self.face_at[4 * t as usize + opposite] + edge as u32
    }

    /// The corner behind `c` in its cycle.
    fn next_in_cycle(&self, c: u32) -> u32 {
        self.twin[(c / 3 * 3 + (c + 2) % 3) as usize]
    }

    /// Numbers the cycles through the corners of dirty faces. A cycle keeps the number of its vertex;
    /// of several that come from one vertex the first keeps it, the others get new ones.
    fn walk_cycles(&mut self, material: &Material, surface: &mut Surface) {
        self.walked.clear();
        self.doubtful.clear();
        self.claimed.resize(self.representative.len(), 0);
        for i in 0..self.dirty.len() {
            for first in 3 * self.dirty[i]..3 * self.dirty[i] + 3 {
                if self.seen[first as usize] != self.stamp {
                    self.walk_cycle(material, first, surface);
                }
            }
        }
    }

    fn walk_cycle(&mut self, material: &Material, first: u32, surface: &mut Surface) {
        let (t, v) = self.fragment_corner(material.fragments, first);
        let point = material.fragments.vertices[v as usize];
        let mut cycle = std::mem::take(&mut self.cycle);
        cycle.clear();
        let (mut c, mut id) = (first, NONE);
        while self.seen[c as usize] != self.stamp {
            self.seen[c as usize] = self.stamp;
            cycle.push(c);
            let old = self.corner[c as usize];
            if old != NONE {
                self.doubtful.push(old);
                // A bisected face has a corner elsewhere than it had.
                let source = std::mem::replace(&mut self.source[c as usize], v);
                let same = source == v || material.fragments.vertices[source as usize] == point;
                if id == NONE && same && self.claimed[old as usize] != self.stamp {
                    id = old;
                }
            }
            c = self.next_in_cycle(c);
        }
        if id == NONE {
            id = self.representative.len() as u32;
            self.representative.push(first);
            self.claimed.push(self.stamp);
            surface.vertices.push(SurfaceVertex { copies: [0; 4], weights: [0.0; 4] });
        }
        self.claimed[id as usize] = self.stamp;
        self.representative[id as usize] = first;
        self.walked.push(id);
        surface.vertices[id as usize] =
            bind(material.mesh, material.pieces, material.fragments.piece[t as usize], &point);
        for &c in &cycle {
            self.source[c as usize] = v;
            self.set_corner(c, id, surface);
        }
        self.cycle = cycle;
    }

    fn set_corner(&mut self, c: u32, id: u32, surface: &mut Surface) {
        self.corner[c as usize] = id;
        surface.triangles[c as usize / 3][c as usize % 3] = id;
    }

    /// Vertices without corners, after two cycles became one, make room for the last ones.
    fn drop_dead_vertices(&mut self, surface: &mut Surface) {
        self.doubtful.retain(|&id| self.claimed[id as usize] != self.stamp);
        self.doubtful.sort_unstable_by(|p, q| q.cmp(p));
        self.doubtful.dedup();
        for i in 0..self.doubtful.len() {
            let id = self.doubtful[i];
            let last = self.representative.len() as u32 - 1;
            self.representative.swap_remove(id as usize);
            self.claimed.swap_remove(id as usize);
            surface.vertices.swap_remove(id as usize);
            if id == last {
                continue;
            }
            if let Some(walked) = self.walked.iter_mut().find(|w| **w == last) {
                *walked = id;
            }
            let first = self.representative[id as usize];
            let mut c = first;
            loop {
                self.set_corner(c, id, surface);
                c = self.next_in_cycle(c);
                if c == first {
                    break;
                }
            }
        }
    }

    /// Surface vertices of pieces that have other copies now, as far as they were not walked. All pieces
    /// around a vertex have the same copies of the nodes it lies between, so any of them will do.
    fn bind_again(&mut self, material: &Material, pieces: &[u32], surface: &mut Surface) {
        let fragments = material.fragments;
        for &p in pieces {
            for t in material.pieces.fragments(p, fragments) {
                for (k, _) in fragments.neighbour[t as usize].iter().enumerate().filter(|(_, n)| **n == NONE)
                {
                    let f = self.face_at[4 * t as usize + k];
                    for c in 3 * f..3 * f + 3 {
                        let id = self.corner[c as usize] as usize;
                        if std::mem::replace(&mut self.claimed[id], self.stamp) != self.stamp {
                            let (_, v) = self.fragment_corner(fragments, c);
                            surface.vertices[id] =
                                bind(material.mesh, material.pieces, p, &fragments.vertices[v as usize]);
                        }
                    }
                }
            }
        }
    }

    /// Looks for different edges between the same two vertices around every vertex that was walked.
    fn find_doubled_edges(&mut self) {
        let mut edges: Vec<(u32, u32)> = Vec::new();
        for i in 0..self.walked.len() {
            edges.clear();
            let first = self.representative[self.walked[i] as usize];
            let mut h = first;
            loop {
                let head = self.corner[next(h) as usize];
                edges.push((head, h.min(self.twin(h))));
                h = self.next_in_cycle(h);
                if h == first {
                    break;
                }
            }
            edges.sort_unstable();
            for same in edges.chunk_by(|p, q| p.0 == q.0) {
                self.doubled.remove(same[0].1);
                same[1..].iter().for_each(|&(_, edge)| self.doubled.insert(edge));
            }
        }
    }
}

/// The half-edge behind `h` in its triangle.
pub fn next(h: u32) -> u32 {
    h / 3 * 3 + (h + 1) % 3
}
