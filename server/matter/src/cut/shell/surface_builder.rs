//! Keeps the surface up to date at a cost that depends on what a cut changed, not on the size of the body.
//!
//! Boundary faces are [joined](super::joined) across an edge by walking through the solid around it, so the
//! surface connects exactly what the material connects. Two lips that meet only in a fragment vertex get one
//! surface vertex each.
//!
//! A boundary face never disappears, it only shrinks, so triangles keep their numbers. A pair of half-edges
//! separates only if a fragment with one of them is bisected or opened there. The new partner of each
//! half-edge then lies on such a fragment too. It is therefore enough to pair the half-edges of changed
//! fragments anew, and to walk the cycles through their corners.

use crate::element::MaterialPoint;
use crate::mesh::{TET_FACES, TetMesh};
use crate::storage::reserve::reserve_half_again;

use super::joined::{Joined, Place};
use super::surface::{Surface, bind};
use crate::cut::topology::fragments::{FragmentVertex, Fragments, NONE};
use crate::cut::topology::pieces::PieceTable;

/// The state from which the surface follows.
pub(crate) struct Material<'a> {
    /// Rest mesh.
    pub mesh: &'a TetMesh,
    /// Fragment mesh.
    pub fragments: &'a Fragments,
    /// Pieces and their copies.
    pub pieces: &'a PieceTable,
}

/// The changes that a sweep made to the fragments.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Change<'a> {
    /// Fragments that are new, were bisected or had a face opened, each once.
    pub fragments: &'a [u32],
    /// Boundary faces (4·fragment + slot) that moved from one fragment to another, as [from, to] in the order
    /// of the moves.
    pub moved: &'a [[u32; 2]],
    /// Pieces whose copies changed, ascending.
    pub pieces: &'a [u32],
}

/// The boundary faces of the fragments and their adjacency.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(crate) struct SurfaceBuilder {
    /// Boundary faces as 4·fragment + slot of the opposite vertex; triangle f of the surface is face f.
    faces: Vec<u32>,
    /// Index into `faces` per 4·fragment + slot.
    face_at: Vec<u32>,
    joined: Joined,
    /// Fragment vertex of each corner 3·face + k when its cycle was last walked.
    source: Vec<u32>,
}

impl SurfaceBuilder {
    /// Builds the surface of a fragment mesh.
    pub(crate) fn build(material: &Material) -> (Self, Surface) {
        let (mut builder, mut surface) = (Self::default(), Surface::default());
        let all: Vec<u32> = (0..material.fragments.tets.len() as u32).collect();
        builder.update(material, &Change { fragments: &all, moved: &[], pieces: &[] }, &mut surface);
        reserve_half_again(&mut builder.face_at);
        (builder, surface)
    }

    /// Updates the surface after a change.
    pub(crate) fn update(&mut self, material: &Material, change: &Change, surface: &mut Surface) {
        self.joined.begin(surface);
        self.collect_faces(material.fragments, change, surface);
        self.pair_half_edges(material.fragments);
        let mut placed = Placed { material, faces: &self.faces, source: &mut self.source };
        self.joined.number(&mut placed, surface);
        self.bind_again(material, change.pieces, surface);
        let placed = Placed { material, faces: &self.faces, source: &mut self.source };
        self.joined.divide_doubled_edges(&placed, surface);
    }

    /// Faces (4·fragment + slot) next to a lip of this incision, as far as the last update touched the lip.
    pub(crate) fn faces_beside_lips(&self, surface: &Surface, incision: u32) -> impl Iterator<Item = u32> {
        let is_lip = move |f: u32| surface.tags[f as usize] == incision;
        let lips = self.joined.touched().iter().filter(move |f| is_lip(**f));
        let beside = lips.flat_map(|f| 3 * f..3 * f + 3).map(|h| self.joined.twin(h) / 3);
        beside.filter(move |f| !is_lip(*f)).map(|f| self.faces[f as usize])
    }

    /// For every half-edge (4·fragment + slot, k) its partner.
    #[cfg(test)]
    pub(crate) fn joints(&self) -> std::collections::BTreeMap<(u32, u32), (u32, u32)> {
        let name = |h: u32| (self.faces[h as usize / 3], h % 3);
        (0..3 * self.faces.len() as u32).map(|h| (name(h), name(self.joined.twin(h)))).collect()
    }

    /// Numbers of vertices (fans not counted) and of edges that are divided.
    #[cfg(test)]
    pub(crate) fn counts(&self) -> [usize; 2] {
        let [_, vertices, doubled] = self.joined.sizes();
        [vertices, doubled]
    }

    /// Surface vertex, and where it should be: fragment and fragment vertex, of every corner.
    #[cfg(test)]
    pub(crate) fn corners(&self, fragments: &Fragments) -> Vec<(u32, (u32, u32))> {
        let corners = 0..3 * self.faces.len() as u32;
        corners.map(|c| (self.joined.vertex(c), corner_of(&self.faces, fragments, c))).collect()
    }

    fn collect_faces(&mut self, fragments: &Fragments, change: &Change, surface: &mut Surface) {
        self.face_at.resize(4 * fragments.tets.len(), NONE);
        for &[from, to] in change.moved {
            let f = std::mem::replace(&mut self.face_at[from as usize], NONE);
            // A face that appeared since the last update has no number yet, wherever it was.
            if f != NONE {
                self.face_at[to as usize] = f;
                self.faces[f as usize] = to;
            }
        }
        for &t in change.fragments {
            for (k, &n) in fragments.neighbour[t as usize].iter().enumerate() {
                if n != NONE {
                    continue;
                }
                let at = &mut self.face_at[4 * t as usize + k];
                if *at == NONE {
                    *at = self.joined.add(fragments.tag[t as usize][k], surface);
                    self.faces.push(4 * t + k as u32);
                }
                self.joined.touch(*at);
            }
        }
        self.source.resize(3 * self.faces.len(), NONE);
    }

    fn pair_half_edges(&mut self, fragments: &Fragments) {
        for i in 0..self.joined.touched().len() {
            let f = self.joined.touched()[i];
            (3 * f..3 * f + 3).for_each(|h| self.joined.open(h));
        }
        for i in 0..self.joined.touched().len() {
            let f = self.joined.touched()[i];
            for h in 3 * f..3 * f + 3 {
                if self.joined.twin(h) == NONE {
                    let partner = self.partner(fragments, h);
                    self.joined.join(h, partner);
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

    /// Binds the surface vertices of pieces with new copies again, unless their cycle was walked. All pieces
    /// around a vertex have the same copies of the nodes that carry it, so any of them will do.
    fn bind_again(&mut self, material: &Material, pieces: &[u32], surface: &mut Surface) {
        let fragments = material.fragments;
        for &p in pieces {
            for t in material.pieces.fragments(p, fragments) {
                for (k, _) in fragments.neighbour[t as usize].iter().enumerate().filter(|(_, n)| **n == NONE)
                {
                    let f = self.face_at[4 * t as usize + k];
                    for c in 3 * f..3 * f + 3 {
                        let id = self.joined.vertex(c);
                        if self.joined.claim(id) {
                            let (_, v) = corner_of(&self.faces, fragments, c);
                            surface.vertices[id as usize] =
                                bind(material.mesh, material.pieces, p, &fragments.vertices[v as usize]);
                        }
                    }
                }
            }
        }
    }
}

/// Fragment and fragment vertex at a corner.
fn corner_of(faces: &[u32], fragments: &Fragments, corner: u32) -> (u32, u32) {
    let face = faces[corner as usize / 3];
    let slot = TET_FACES[face as usize % 4][corner as usize % 3];
    (face / 4, fragments.tets[face as usize / 4][slot])
}

/// Places surface vertices at the vertices of the fragments.
struct Placed<'a> {
    material: &'a Material<'a>,
    faces: &'a [u32],
    source: &'a mut [u32],
}

impl Placed<'_> {
    fn bound(&self, t: u32, v: &FragmentVertex) -> MaterialPoint {
        let Material { mesh, fragments, pieces } = self.material;
        bind(mesh, pieces, fragments.piece[t as usize], v)
    }
}

impl Place for Placed<'_> {
    /// A corner of a bisected face moved to another fragment vertex, so it cannot keep its surface vertex.
    fn stays(&self, corner: u32, cycle: &[u32]) -> bool {
        let fragments = self.material.fragments;
        let (source, v) = (self.source[corner as usize], corner_of(self.faces, fragments, cycle[0]).1);
        source == v || fragments.vertices[source as usize] == fragments.vertices[v as usize]
    }

    fn vertex(&mut self, cycle: &[u32]) -> MaterialPoint {
        let fragments = self.material.fragments;
        let (t, v) = corner_of(self.faces, fragments, cycle[0]);
        cycle.iter().for_each(|&c| self.source[c as usize] = v);
        self.bound(t, &fragments.vertices[v as usize])
    }

    fn middle(&self, corners: &[u32], _of: &[MaterialPoint]) -> MaterialPoint {
        let fragments = self.material.fragments;
        let at = |c: u32| fragments.vertices[corner_of(self.faces, fragments, c).1 as usize];
        let mut middle = at(corners[0]);
        for (&corner, n) in corners[1..].iter().zip(2u32..) {
            middle = FragmentVertex::between(&middle, &at(corner), 1.0 / f64::from(n));
        }
        self.bound(corner_of(self.faces, fragments, corners[0]).0, &middle)
    }
}
