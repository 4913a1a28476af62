//! A closed surface of triangles joined edge by edge: which triangles are neighbours, and which corners are
//! one vertex.
//!
//! The caller reports the triangles that changed; all other changes are found around them. Corners are one
//! vertex exactly when the edges around them join them, so the surface is closed and 2-manifold by
//! construction. Numbers stay dense: the last vertex takes the number of a vertex without corners, and the
//! last triangle that of a removed triangle.

use super::doubled_edges::{DoubledEdges, next};
use super::surface::Surface;
use crate::cut::topology::fragments::NONE;
use crate::element::MaterialPoint;

/// Where the vertices of the surface lie. Corners are numbered 3·triangle + k.
pub(crate) trait Place {
    /// Whether a cycle may keep the vertex that `corner` had before the change.
    fn stays(&self, _corner: u32, _cycle: &[u32]) -> bool {
        true
    }
    /// The vertex in which the corners of a cycle meet.
    fn vertex(&mut self, cycle: &[u32]) -> MaterialPoint;
    /// The vertex at the centroid of two or three corners of one triangle, whose vertices are `of`.
    fn middle(&self, corners: &[u32], of: &[MaterialPoint]) -> MaterialPoint;
}

/// Triangles by number. Half-edge 3·triangle + k runs from corner k to the next.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(crate) struct Joined {
    /// Opposite of each half-edge, or [`NONE`] while it is open.
    twin: Vec<u32>,
    /// Surface vertex of each corner.
    corner: Vec<u32>,
    /// One corner of every surface vertex.
    representative: Vec<u32>,
    /// Edges whose two ends are also joined by another edge.
    doubled: DoubledEdges,
    /// Triangles that changed in this round, each once.
    dirty: Vec<u32>,
    /// Per triangle the last round in which it changed.
    changed: Vec<u32>,
    /// Per corner the last round in which its cycle was walked.
    seen: Vec<u32>,
    /// Per vertex the last round in which a cycle took its number or `claim` was called for it.
    claimed: Vec<u32>,
    /// Vertices that may have lost their last corner.
    doubtful: Vec<u32>,
    /// Vertices whose cycle was walked in this round.
    walked: Vec<u32>,
    cycle: Vec<u32>,
    around: Vec<(u32, u32)>,
    round: u32,
}

impl Joined {
    /// Begins a change: undoes the division of doubled edges, so that every triangle is whole again.
    pub(crate) fn begin(&mut self, surface: &mut Surface) {
        self.round += 1;
        self.dirty.clear();
        self.walked.clear();
        self.doubtful.clear();
        let n = self.changed.len();
        surface.triangles.truncate(n);
        surface.tags.truncate(n);
        surface.vertices.truncate(self.representative.len());
        for h in self.doubled.iter().flat_map(|h| [h, self.twin[h as usize]]) {
            let t = h / 3;
            surface.triangles[t as usize] = [0, 1, 2].map(|k| self.corner[(3 * t + k) as usize]);
        }
    }

    /// Adds a triangle with a tag and three open edges. Returns its number.
    pub(crate) fn add(&mut self, tag: u32, surface: &mut Surface) -> u32 {
        let t = self.changed.len() as u32;
        self.twin.extend([NONE; 3]);
        self.corner.extend([NONE; 3]);
        self.seen.extend([0; 3]);
        self.changed.push(0);
        surface.triangles.push([NONE; 3]);
        surface.tags.push(tag);
        t
    }

    /// Reports that a triangle changed: its vertices are determined anew.
    pub(crate) fn touch(&mut self, t: u32) {
        if std::mem::replace(&mut self.changed[t as usize], self.round) != self.round {
            self.dirty.push(t);
        }
    }

    /// Opposite of a half-edge, or [`NONE`] while it is open.
    pub(crate) fn twin(&self, h: u32) -> u32 {
        self.twin[h as usize]
    }

    /// Separates a half-edge from its opposite.
    pub(crate) fn open(&mut self, h: u32) {
        let twin = std::mem::replace(&mut self.twin[h as usize], NONE);
        if twin != NONE {
            self.doubled.remove(h.min(twin));
            self.twin[twin as usize] = NONE;
        }
    }

    /// Makes two half-edges opposites of each other.
    pub(crate) fn join(&mut self, g: u32, h: u32) {
        if self.twin[g as usize] != h {
            self.open(g);
            self.open(h);
            (self.twin[g as usize], self.twin[h as usize]) = (h, g);
        }
    }

    /// Opens all edges of a triangle and forgets its vertices.
    pub(crate) fn clear(&mut self, t: u32) {
        for h in 3 * t..3 * t + 3 {
            self.open(h);
            let old = std::mem::replace(&mut self.corner[h as usize], NONE);
            if old != NONE {
                self.doubtful.push(old);
            }
        }
    }

    /// Removes a triangle whose edges are all open. The last triangle takes its number. Returns the old
    /// number of that one.
    pub(crate) fn remove(&mut self, t: u32, surface: &mut Surface) -> u32 {
        let last = self.changed.len() as u32 - 1;
        self.dirty.retain(|d| *d != t);
        if t != last {
            // Everything that refers to a corner or half-edge of the last triangle has to follow its new
            // number.
            for k in 0..3 {
                let (from, to) = ((3 * last + k) as usize, (3 * t + k) as usize);
                let twin = self.twin[from];
                if twin != NONE {
                    if self.doubled.remove((from as u32).min(twin)) {
                        self.doubled.insert((to as u32).min(twin));
                    }
                    self.twin[twin as usize] = to as u32;
                }
                (self.twin[to], self.corner[to], self.seen[to]) = (twin, self.corner[from], self.seen[from]);
                let vertex = self.corner[to];
                if vertex != NONE && self.representative[vertex as usize] == from as u32 {
                    self.representative[vertex as usize] = to as u32;
                }
            }
            self.changed[t as usize] = self.changed[last as usize];
            self.dirty.iter_mut().filter(|d| **d == last).for_each(|d| *d = t);
        }
        self.changed.pop();
        for per_corner in [&mut self.twin, &mut self.corner, &mut self.seen] {
            per_corner.truncate(3 * last as usize);
        }
        surface.triangles.swap_remove(t as usize);
        surface.tags.swap_remove(t as usize);
        last
    }

    /// Whether a changed triangle still has an open edge.
    pub(crate) fn is_open(&self) -> bool {
        self.dirty.iter().flat_map(|&t| 3 * t..3 * t + 3).any(|h| self.twin[h as usize] == NONE)
    }

    /// Numbers of triangles, vertices and doubled edges.
    #[cfg(test)]
    pub(crate) fn sizes(&self) -> [usize; 3] {
        [self.changed.len(), self.representative.len(), self.doubled.len()]
    }

    /// Triangles that changed in this round.
    pub(crate) fn touched(&self) -> &[u32] {
        &self.dirty
    }

    /// Surface vertex of a corner.
    pub(crate) fn vertex(&self, corner: u32) -> u32 {
        self.corner[corner as usize]
    }

    /// Marks a vertex as up to date for this round. Returns whether it was not yet.
    pub(crate) fn claim(&mut self, vertex: u32) -> bool {
        std::mem::replace(&mut self.claimed[vertex as usize], self.round) != self.round
    }

    /// Determines the vertices around all changed triangles.
    pub(crate) fn number(&mut self, place: &mut impl Place, surface: &mut Surface) {
        let mut cycle = std::mem::take(&mut self.cycle);
        for i in 0..self.dirty.len() {
            for first in 3 * self.dirty[i]..3 * self.dirty[i] + 3 {
                if self.seen[first as usize] != self.round {
                    self.walk(first, &mut cycle);
                    self.name(&cycle, place, surface);
                }
            }
        }
        self.cycle = cycle;
        self.drop_dead_vertices(surface);
        self.find_doubled_edges();
    }

    /// The next corner after `c` in the cycle around their vertex.
    fn next_around(&self, c: u32) -> u32 {
        self.twin[(c / 3 * 3 + (c + 2) % 3) as usize]
    }

    fn walk(&mut self, first: u32, cycle: &mut Vec<u32>) {
        cycle.clear();
        let mut c = first;
        while self.seen[c as usize] != self.round {
            self.seen[c as usize] = self.round;
            cycle.push(c);
            c = self.next_around(c);
        }
    }

    /// Numbers the vertex of a cycle. A cycle keeps its old number; if a vertex fell apart, its first cycle
    /// keeps it.
    fn name(&mut self, cycle: &[u32], place: &mut impl Place, surface: &mut Surface) {
        let mut id = NONE;
        for &c in cycle {
            let old = self.corner[c as usize];
            if old != NONE {
                self.doubtful.push(old);
                if id == NONE && self.claimed[old as usize] != self.round && place.stays(c, cycle) {
                    id = old;
                }
            }
        }
        let vertex = place.vertex(cycle);
        if id == NONE {
            id = self.representative.len() as u32;
            self.representative.push(NONE);
            self.claimed.push(0);
            surface.vertices.push(vertex);
        }
        self.claimed[id as usize] = self.round;
        self.representative[id as usize] = cycle[0];
        surface.vertices[id as usize] = vertex;
        self.walked.push(id);
        cycle.iter().for_each(|&c| self.set_corner(c, id, surface));
    }

    fn set_corner(&mut self, c: u32, id: u32, surface: &mut Surface) {
        self.corner[c as usize] = id;
        surface.triangles[c as usize / 3][c as usize % 3] = id;
    }

    fn drop_dead_vertices(&mut self, surface: &mut Surface) {
        let mut doubtful = std::mem::take(&mut self.doubtful);
        doubtful.retain(|&id| self.claimed[id as usize] != self.round);
        // Highest number first: the vertex that takes over a free number is then never dead itself.
        doubtful.sort_unstable_by(|p, q| q.cmp(p));
        doubtful.dedup();
        for &id in &doubtful {
            let last = self.representative.len() as u32 - 1;
            self.representative.swap_remove(id as usize);
            self.claimed.swap_remove(id as usize);
            surface.vertices.swap_remove(id as usize);
            if id == last {
                continue;
            }
            self.walked.iter_mut().filter(|w| **w == last).for_each(|w| *w = id);
            let first = self.representative[id as usize];
            let mut c = first;
            loop {
                self.set_corner(c, id, surface);
                c = self.next_around(c);
                if c == first {
                    break;
                }
            }
        }
        self.doubtful = doubtful;
    }

    /// Looks around every walked vertex for different edges with the same two ends.
    fn find_doubled_edges(&mut self) {
        let mut around = std::mem::take(&mut self.around);
        for i in 0..self.walked.len() {
            around.clear();
            let first = self.representative[self.walked[i] as usize];
            let mut h = first;
            loop {
                around.push((self.corner[next(h) as usize], h.min(self.twin[h as usize])));
                h = self.next_around(h);
                if h == first {
                    break;
                }
            }
            self.doubled.compare(&mut around);
        }
        self.around = around;
    }

    /// Ends a change: divides doubled edges in the middle and their triangles into fans.
    pub(crate) fn divide_doubled_edges(&self, place: &impl Place, surface: &mut Surface) {
        self.doubled.divide(surface, |h| self.twin[h as usize], |corners, of| place.middle(corners, of));
    }
}
