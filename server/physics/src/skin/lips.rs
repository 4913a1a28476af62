//! The wound: lip faces of the fragments as triangles whose borders follow the skin.

use std::collections::BTreeMap;

use super::border::{Borders, HalfEdge};
use super::sheet::Sheet;
use crate::cut::CutMesh;
use crate::cut::fragments::NONE;
use crate::mesh::TET_FACES;

/// What a corner of a lip is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Corner {
    /// A skin point.
    Skin(u32),
    /// A vertex of the fragments.
    Lip(u32),
    /// The middle of a lip.
    Middle,
}

/// Triangles of all lips. Their half-edges are numbered behind those of the skin.
#[derive(Clone, Debug, Default)]
pub struct Lips {
    /// Number of the first half-edge.
    pub first: u32,
    /// Corners of each triangle.
    pub corners: Vec<[Corner; 3]>,
    /// Opposite of each half-edge.
    pub twin: Vec<u32>,
    /// Piece of each triangle.
    pub piece: Vec<u32>,
    /// Incision of each triangle.
    pub tag: Vec<u32>,
}

impl Lips {
    /// Triangles of the lips. `seam` receives the opposite of every cut half-edge of the skin. `None`
    /// where an edge of the cut curve has no chain, or two have the same.
    pub fn new(cut: &CutMesh, sheet: &Sheet, borders: &Borders, seam: &mut [u32]) -> Option<Self> {
        let f = &cut.fragments;
        let mut lips = Self { first: 3 * sheet.corners.len() as u32, ..Self::default() };
        let chains: BTreeMap<HalfEdge, &[u32]> =
            borders.edges.iter().map(|b| (b.lip, b.chain.as_slice())).collect();
        for &h in borders.edges.iter().flat_map(|b| &b.chain) {
            seam[h as usize] = NONE;
        }
        let mut inner: BTreeMap<HalfEdge, u32> = BTreeMap::new();
        for &(t, k) in &borders.lips {
            let mut ring = Vec::with_capacity(6);
            let mut parts = [1; 3];
            for edge in 0..3 {
                match chains.get(&(t, k, edge)) {
                    Some([]) => return None,
                    Some(chain) => {
                        // The lip runs against the skin.
                        ring.extend(chain.iter().rev().map(|&h| Corner::Skin(sheet.to(h))));
                        parts[edge] = chain.len();
                    }
                    None => ring.push(Corner::Lip(f.tets[t as usize][TET_FACES[k][edge]])),
                }
            }
            let outline = lips.fill(&ring, parts, f.piece[t as usize], f.tag[t as usize][k]);
            let mut rest = outline.as_slice();
            for (edge, n) in parts.into_iter().enumerate() {
                let (mine, others) = rest.split_at(n);
                match chains.get(&(t, k, edge)) {
                    Some(chain) => {
                        for (&h, &skin) in mine.iter().zip(chain.iter().rev()) {
                            if seam[skin as usize] != NONE {
                                return None;
                            }
                            seam[skin as usize] = h;
                            lips.twin[(h - lips.first) as usize] = skin;
                        }
                    }
                    None => {
                        inner.insert((t, k, edge), mine[0]);
                    }
                }
                rest = others;
            }
        }
        for (&(t, k, edge), &mine) in &inner {
            lips.twin[(mine - lips.first) as usize] = *inner.get(&f.around_edge(t, k, edge))?;
        }
        Some(lips)
    }

    fn push(&mut self, corners: [Corner; 3], piece: u32, tag: u32) -> u32 {
        let h = self.first + 3 * self.corners.len() as u32;
        self.corners.push(corners);
        self.twin.extend([NONE; 3]);
        self.piece.push(piece);
        self.tag.push(tag);
        h
    }

    fn link(&mut self, g: u32, h: u32) {
        self.twin[(g - self.first) as usize] = h;
        self.twin[(h - self.first) as usize] = g;
    }

    /// Triangles that fill an outline whose three sides have these parts; returns the half-edges along
    /// it. Both lips of a cut are filled alike.
    fn fill(&mut self, ring: &[Corner], parts: [usize; 3], piece: u32, tag: u32) -> Vec<u32> {
        let n = ring.len();
        if n == 3 {
            let h = self.push([ring[0], ring[1], ring[2]], piece, tag);
            return vec![h, h + 1, h + 2];
        }
        let mut outline = vec![NONE; n];
        if parts.iter().filter(|&&p| p > 1).count() == 1 {
            // A fan from the corner opposite the divided side.
            let side = parts.iter().position(|&p| p > 1).unwrap_or(0);
            let first: usize = parts[..side].iter().sum();
            let apex = (first + parts[side] + 1) % n;
            let mut last = NONE;
            for i in 0..parts[side] {
                let corners = [ring[(first + i) % n], ring[(first + i + 1) % n], ring[apex]];
                let h = self.push(corners, piece, tag);
                outline[(first + i) % n] = h;
                if i == 0 {
                    outline[apex] = h + 2;
                } else {
                    self.link(last, h + 2);
                }
                last = h + 1;
            }
            outline[(first + parts[side]) % n] = last;
            return outline;
        }
        let first = self.first + 3 * self.corners.len() as u32;
        for i in 0..n {
            outline[i] = self.push([ring[i], ring[(i + 1) % n], Corner::Middle], piece, tag);
        }
        for i in 0..n as u32 {
            self.link(first + 3 * i + 1, first + 3 * ((i + 1) % n as u32) + 2);
        }
        outline
    }
}
