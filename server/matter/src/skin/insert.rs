//! Turns vertices of the cut curve into skin points.
//!
//! A vertex is recognised by its place, to the bit, because all copies of a fragment vertex share it. A new
//! vertex takes over a grid point that lies there (or, with snapping, near there). Otherwise it splits an
//! edge or a triangle.

use std::cmp::Ordering;

use super::base::Base;
use super::sheet::{Claim, Sheet};
use crate::cut::topology::fragments::{FragmentVertex, NONE};

/// Share of a triangle or edge below which a point counts as lying on the border.
///
/// Far above rounding of coordinates (1e-16), far below what shows.
pub(super) const ON: f64 = 1e-9;

/// Share below which two vertices are the same point, e.g. one crossing on both lips of an older cut.
pub(super) const SAME: f64 = 1e-12;

/// Where a new point is inserted.
enum Spot {
    /// At an existing point.
    Point(u32),
    /// On a half-edge, at this parameter from its start.
    Edge(u32, f64),
    /// Inside a triangle, at these barycentric coordinates.
    Inside(u32, [f64; 3]),
}

impl Sheet {
    /// The skin point that represents a fragment vertex over face `f`. `snapping` in [0, 0.5] is the relative
    /// distance within which a corner is moved instead of splitting its triangle.
    pub(super) fn insert_point(&mut self, base: &Base, f: u32, at: &FragmentVertex, snapping: f64) -> u32 {
        let face = &base.faces[f as usize];
        let w = Self::coordinates(base, f, at);
        if let Some(k) = (0..3).find(|&k| w[(k + 1) % 3] == 0.0 && w[(k + 2) % 3] == 0.0) {
            return self.corner_point[face.corners[k] as usize];
        }
        // Edges are shared by two faces, so a vertex on one is claimed in the direction of the edge, not of
        // the face.
        let side = (0..3).find(|&k| w[(k + 2) % 3] == 0.0);
        let claim: Claim = match side {
            Some(k) => {
                let (a, b) = if face.forward[k] { (k, (k + 1) % 3) } else { ((k + 1) % 3, k) };
                (2 * face.edges[k], [w[a].to_bits(), w[b].to_bits(), 0])
            }
            None => (2 * f + 1, w.map(f64::to_bits)),
        };
        if let Some(&known) = self.claims.get(&claim) {
            return known;
        }
        let spot = match side {
            Some(k) => self.spot_on_side(base, f, k, &w, snapping),
            None => self.spot_inside(base, f, &w, snapping),
        };
        let point = match spot {
            Spot::Point(p) if self.points[p as usize].claimed => p,
            Spot::Point(p) => {
                let place = self.place_at(base, f, p, &w);
                let point = &mut self.points[p as usize];
                (point.at, point.place, point.claimed) = (*at, place, true);
                p
            }
            Spot::Edge(h, s) => {
                let [a, b] = [self.from(h), self.to(h)].map(|p| self.points[p as usize].place);
                let point = self.add_point(*at, a + (b - a) * s, true);
                self.split_edge(h, point);
                point
            }
            Spot::Inside(t, share) => {
                let places = self.corners[t as usize].map(|p| self.points[p as usize].place);
                let point = self.add_point(*at, (0..3).map(|k| places[k] * share[k]).sum(), true);
                self.split_triangle(t, point);
                point
            }
        };
        self.claims.insert(claim, point);
        point
    }

    /// Where to insert a point on side `k` of the face.
    fn spot_on_side(&self, base: &Base, f: u32, k: usize, w: &[f64; 3], snapping: f64) -> Spot {
        let along = |w: &[f64; 3]| w[(k + 1) % 3] / (w[k] + w[(k + 1) % 3]);
        let mut best = (f64::INFINITY, NONE, 0.0);
        for h in self.over[f as usize].iter().flat_map(|&t| (0..3).map(move |k| 3 * t + k)) {
            let [p, q] = [self.from(h), self.to(h)].map(|p| self.point_on(base, f, p));
            if p[(k + 2) % 3] == 0.0 && q[(k + 2) % 3] == 0.0 {
                let s = (along(w) - along(&p)) / (along(&q) - along(&p));
                let outside = (-s).max(s - 1.0).max(0.0);
                if outside < best.0 {
                    best = (outside, h, s.clamp(0.0, 1.0));
                }
            }
        }
        let (_, h, s) = best;
        let (end, short) = if s < 0.5 { (self.from(h), s) } else { (self.to(h), 1.0 - s) };
        let free = !self.points[end as usize].claimed;
        if short <= SAME {
            return Spot::Point(end);
        }
        if free && (short <= ON || (short < snapping && self.can_move(base, h, end, &Target { f, w: *w }))) {
            return Spot::Point(end);
        }
        Spot::Edge(h, s)
    }

    /// Where to insert a point inside the face.
    fn spot_inside(&self, base: &Base, f: u32, w: &[f64; 3], snapping: f64) -> Spot {
        let mut best = (f64::NEG_INFINITY, NONE, [0.0; 3]);
        for &t in &self.over[f as usize] {
            let share = self.shares(base, f, t, w);
            let depth = share.iter().copied().fold(f64::INFINITY, f64::min);
            if depth > best.0 {
                best = (depth, t, share);
            }
        }
        let (_, t, share) = best;
        let near = (0..3).max_by(|&i, &j| share[i].total_cmp(&share[j])).unwrap_or(0);
        let point = self.corners[t as usize][near];
        // A point on the border of the face belongs to two faces and must not move.
        let inside = self.point_on(base, f, point).iter().all(|&w| w > 0.0);
        let gap = 1.0 - share[near];
        if inside && gap <= SAME {
            return Spot::Point(point);
        }
        if inside && !self.points[point as usize].claimed {
            let h = 3 * t + near as u32;
            if gap <= ON || (gap < snapping && self.can_move(base, h, point, &Target { f, w: *w })) {
                return Spot::Point(point);
            }
        }
        // Next an edge, preferably one of an existing cut.
        let opposite = |k: usize| 3 * t + (k as u32 + 1) % 3;
        let within =
            |k: &usize| share[*k] <= ON && self.face[self.twin[opposite(*k) as usize] as usize / 3] == f;
        let rank = |k: &usize| (self.chain[opposite(*k) as usize] == NONE, share[*k]);
        let thin =
            (0..3).filter(within).min_by(|i, j| rank(i).partial_cmp(&rank(j)).unwrap_or(Ordering::Equal));
        if let Some(k) = thin {
            let (a, b) = (share[(k + 1) % 3].max(0.0), share[(k + 2) % 3].max(0.0));
            return Spot::Edge(opposite(k), if a + b > 0.0 { b / (a + b) } else { 0.5 });
        }
        Spot::Inside(t, share)
    }

    /// Barycentric coordinates in triangle `t` of a point of face `f`. They are −∞ where the triangle has no
    /// area.
    pub(super) fn shares(&self, base: &Base, f: u32, t: u32, w: &[f64; 3]) -> [f64; 3] {
        let [p, q, r] = self.corners[t as usize].map(|p| self.point_on(base, f, p));
        let parts = [Self::area(w, &q, &r), Self::area(&p, w, &r), Self::area(&p, &q, w)];
        let sum: f64 = parts.iter().sum();
        if sum > 0.0 { parts.map(|a| a / sum) } else { [f64::NEG_INFINITY; 3] }
    }

    /// Rest position of point `p` after a move to `w` on face `f`: the skin as it is there now.
    pub(super) fn place_at(&self, base: &Base, f: u32, p: u32, w: &[f64; 3]) -> nalgebra::Vector3<f64> {
        let mut best = (f64::NEG_INFINITY, self.points[p as usize].place);
        for &t in &self.over[f as usize] {
            if !self.corners[t as usize].contains(&p) {
                continue;
            }
            let share = self.shares(base, f, t, w);
            let depth = share.iter().copied().fold(f64::INFINITY, f64::min);
            if depth > best.0 {
                let places = self.corners[t as usize].map(|p| self.points[p as usize].place);
                best = (depth, (0..3).map(|k| places[k] * share[k]).sum());
            }
        }
        best.1
    }

    /// Whether the point at corner `h` may move to the target. No triangle may turn over, and no cut may run
    /// through the point.
    pub(super) fn can_move(&self, base: &Base, h: u32, point: u32, target: &Target) -> bool {
        let at = Sheet::vertex(base, target);
        let start = if self.from(h) == point { h } else { h / 3 * 3 + (h + 1) % 3 };
        self.around(start).iter().all(|&g| {
            let (t, k) = (g as usize / 3, g as usize % 3);
            let f = self.face[t];
            let on_cut = self.chain[g as usize] != NONE || self.chain[self.twin[g as usize] as usize] != NONE;
            let [q, r] = [1, 2].map(|i| self.point_on(base, f, self.corners[t][(k + i) % 3]));
            let moved = Self::coordinates(base, f, &at);
            let before = Self::area(&self.point_on(base, f, point), &q, &r);
            !on_cut && Self::area(&moved, &q, &r) > 0.05 * before
        })
    }

    /// The target as a combination of mesh nodes.
    pub(super) fn vertex(base: &Base, target: &Target) -> FragmentVertex {
        let mut at = FragmentVertex { nodes: [NONE; 4], weights: [0.0; 4] };
        let parts = base.faces[target.f as usize].nodes.into_iter().zip(target.w).filter(|(_, w)| *w != 0.0);
        for (slot, (node, weight)) in parts.enumerate() {
            (at.nodes[slot], at.weights[slot]) = (node, weight);
        }
        at
    }
}

/// A place on a boundary face.
pub(super) struct Target {
    pub f: u32,
    /// Barycentric coordinates on the face.
    pub w: [f64; 3],
}
