//! Which corners of quads are one vertex.
//!
//! Corners are one vertex exactly when the edges around them join them. Numbers of vertices stay dense: the last
//! vertex takes the number of one that lost all its corners.

use nalgebra::Vector3;

use super::NONE;
use super::place::Placed;
use crate::element::MaterialPoint;

/// Where the vertices are.
pub(super) struct Vertices<'a> {
    /// Position of each at rest [m].
    pub rest: &'a mut Vec<Vector3<f64>>,
    /// The same place in the material.
    pub points: &'a mut Vec<MaterialPoint>,
}

/// Quads by number. Half-edge 4·quad + k runs from corner k to the next.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Patches {
    /// Opposite of each half-edge, or [`NONE`] while it is open.
    twin: Vec<u32>,
    /// Vertex of each corner.
    corner: Vec<u32>,
    /// One corner of every vertex.
    representative: Vec<u32>,
    /// Quads that changed in this round, each once.
    dirty: Vec<u32>,
    /// Per quad the last round in which it changed.
    changed: Vec<u32>,
    /// Per corner the last round in which its patch was walked.
    seen: Vec<u32>,
    /// Per vertex the last round in which a patch took its number.
    claimed: Vec<u32>,
    /// Vertices that may have lost their last corner.
    doubtful: Vec<u32>,
    /// One corner of every patch that was walked in this round.
    walked: Vec<u32>,
    patch: Vec<u32>,
    round: u32,
}

impl Patches {
    /// Begins a change.
    pub(super) fn begin(&mut self) {
        self.round += 1;
        self.dirty.clear();
        self.walked.clear();
        self.doubtful.clear();
    }

    /// Adds a quad with four open edges.
    pub(super) fn add_quad(&mut self) {
        self.twin.extend([NONE; 4]);
        self.corner.extend([NONE; 4]);
        self.seen.extend([0; 4]);
        self.changed.push(0);
    }

    /// Reports that a quad changed: its vertices are determined anew.
    pub(super) fn touch(&mut self, q: u32) {
        if std::mem::replace(&mut self.changed[q as usize], self.round) != self.round {
            self.dirty.push(q);
        }
    }

    /// Quads that changed in this round.
    pub(super) fn touched(&self) -> &[u32] {
        &self.dirty
    }

    /// One corner of every patch that was walked in this round.
    pub(super) fn walked(&self) -> &[u32] {
        &self.walked
    }

    /// Number of quads.
    pub(super) fn n_quads(&self) -> usize {
        self.changed.len()
    }

    /// Number of vertices.
    pub(super) fn n_vertices(&self) -> usize {
        self.representative.len()
    }

    /// Opposite of a half-edge, or [`NONE`] while it is open.
    #[inline]
    pub(super) fn twin(&self, h: u32) -> u32 {
        self.twin[h as usize]
    }

    /// Vertex of a corner.
    #[inline]
    pub(super) fn vertex(&self, corner: u32) -> u32 {
        self.corner[corner as usize]
    }

    /// Separates a half-edge from its opposite.
    pub(super) fn open(&mut self, h: u32) {
        let twin = std::mem::replace(&mut self.twin[h as usize], NONE);
        if twin != NONE {
            self.twin[twin as usize] = NONE;
        }
    }

    /// Makes two open half-edges opposites of each other.
    pub(super) fn join(&mut self, g: u32, h: u32) {
        (self.twin[g as usize], self.twin[h as usize]) = (h, g);
    }

    /// Numbers the vertices of all changed quads. `place` is called with the corners of each of their patches.
    pub(super) fn number(&mut self, vertices: &mut Vertices<'_>, mut place: impl FnMut(&[u32]) -> Placed) {
        let mut patch = std::mem::take(&mut self.patch);
        for i in 0..self.dirty.len() {
            for first in 4 * self.dirty[i]..4 * self.dirty[i] + 4 {
                if self.seen[first as usize] != self.round {
                    self.walk(first, &mut patch);
                    self.name(&patch, place(&patch), vertices);
                }
            }
        }
        self.patch = patch;
        self.drop_dead_vertices(vertices);
    }

    /// The next corner after `c` around their vertex.
    fn next_around(&self, c: u32) -> u32 {
        self.twin[(c / 4 * 4 + (c + 3) % 4) as usize]
    }

    fn walk(&mut self, first: u32, patch: &mut Vec<u32>) {
        patch.clear();
        let mut c = first;
        while self.seen[c as usize] != self.round {
            self.seen[c as usize] = self.round;
            patch.push(c);
            c = self.next_around(c);
        }
    }

    /// Calls `visit` for all corners around the vertex of corner `first`.
    pub(super) fn for_patch(&self, first: u32, mut visit: impl FnMut(u32)) {
        let mut c = first;
        loop {
            visit(c);
            c = self.next_around(c);
            if c == first {
                break;
            }
        }
    }

    /// Numbers the vertex of a patch. A patch keeps its old number; if a vertex fell apart, its first patch
    /// keeps it.
    fn name(&mut self, patch: &[u32], placed: Placed, vertices: &mut Vertices<'_>) {
        let mut id = NONE;
        for &c in patch {
            let old = self.corner[c as usize];
            if old != NONE {
                self.doubtful.push(old);
                if id == NONE && self.claimed[old as usize] != self.round {
                    id = old;
                }
            }
        }
        if id == NONE {
            id = self.representative.len() as u32;
            self.representative.push(NONE);
            self.claimed.push(0);
            vertices.rest.push(placed.at);
            vertices.points.push(placed.point);
        } else {
            vertices.rest[id as usize] = placed.at;
            vertices.points[id as usize] = placed.point;
        }
        self.claimed[id as usize] = self.round;
        self.representative[id as usize] = patch[0];
        self.walked.push(patch[0]);
        patch.iter().for_each(|&c| self.corner[c as usize] = id);
    }

    fn drop_dead_vertices(&mut self, vertices: &mut Vertices<'_>) {
        let mut doubtful = std::mem::take(&mut self.doubtful);
        doubtful.retain(|&id| self.claimed[id as usize] != self.round);
        // Highest number first: the vertex that takes over a free number is then never dead itself.
        doubtful.sort_unstable_by(|p, q| q.cmp(p));
        doubtful.dedup();
        for &id in &doubtful {
            let last = self.representative.len() as u32 - 1;
            self.representative.swap_remove(id as usize);
            self.claimed.swap_remove(id as usize);
            vertices.rest.swap_remove(id as usize);
            vertices.points.swap_remove(id as usize);
            if id == last {
                continue;
            }
            // The quads around the renumbered vertex need other triangles, but no other places.
            let first = self.representative[id as usize];
            let mut c = first;
            loop {
                self.corner[c as usize] = id;
                c = self.next_around(c);
                if c == first {
                    break;
                }
            }
            if self.claimed[id as usize] != self.round {
                self.claimed[id as usize] = self.round;
                self.walked.push(first);
            }
        }
        self.doubtful = doubtful;
    }
}
