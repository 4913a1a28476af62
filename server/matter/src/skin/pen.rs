//! Draws on an undivided skin: makes points on its faces, and edges between them.
//!
//! An edge divides no other edge inside a face. It turns those away that cross it, so that a face has no more points than
//! were asked for.
//!
//! # Source
//! Sloan 1993, "A fast algorithm for generating constrained Delaunay triangulations", section 4.

use std::collections::{BTreeSet, VecDeque};

use nalgebra::Vector3;

use super::base::Base;
use super::insert::{SAME, Target};
use super::sheet::{Sheet, following, previous};
use crate::cut::topology::fragments::{FragmentVertex, NONE};

/// Most edges that a way through triangles crosses. Longer ones go around something.
const LONGEST: usize = 16;

/// A part of a path over one boundary face, between two points that an edge of the skin joins.
#[derive(Clone, Copy)]
pub(super) struct Part {
    pub face: u32,
    /// The points.
    pub ends: [u32; 2],
}

/// Draws on a skin.
pub(super) struct Pen<'a> {
    /// The boundary.
    pub base: &'a Base,
    /// The skin.
    pub sheet: &'a mut Sheet,
    /// A half-edge that leaves each point.
    leaving: Vec<u32>,
    /// Points inside each edge of the boundary, with the share of it before them, ascending.
    on_side: Vec<Vec<(f64, u32)>>,
    /// Points of paths.
    used: Vec<bool>,
}

impl<'a> Pen<'a> {
    /// Begins to draw on a skin that is not divided yet.
    pub(super) fn new(base: &'a Base, sheet: &'a mut Sheet) -> Self {
        let on_side = vec![Vec::new(); base.n_edges];
        let mut pen = Self { base, sheet, leaving: Vec::new(), on_side, used: Vec::new() };
        (0..pen.sheet.corners.len() as u32).for_each(|t| pen.renew(t));
        pen
    }

    /// Makes a point at a place of the boundary, which paths may end at and not pass. None if there is one already.
    pub(super) fn point(&mut self, target: &Target) -> Option<u32> {
        let at = Sheet::vertex(self.base, target);
        let before = [self.sheet.points.len(), self.sheet.corners.len()];
        let point = self.sheet.insert_point(self.base, target.f, &at, 0.0);
        if point as usize >= before[0] {
            let face = &self.base.faces[target.f as usize];
            if let Some(side) = (0..3).find(|&k| target.w[(k + 2) % 3] == 0.0) {
                let end = if face.forward[side] { (side + 1) % 3 } else { side };
                let list = &mut self.on_side[face.edges[side] as usize];
                let place = list.partition_point(|(share, _)| *share < target.w[end]);
                list.insert(place, (target.w[end], point));
            }
            // The triangles that were divided lie around the point.
            (before[1]..self.sheet.corners.len()).for_each(|t| self.renew(t as u32));
            let around: Vec<u32> = self.fan(point).collect();
            around.into_iter().for_each(|h| self.renew(h / 3));
        }
        let taken = std::mem::replace(&mut self.used[point as usize], true);
        (!taken).then_some(point)
    }

    /// The point on side `k` of face `f` at this share from its start.
    pub(super) fn point_on_side(&mut self, f: u32, k: usize, share: f64) -> u32 {
        let face = self.base.faces[f as usize];
        let [first, second] = [k, (k + 1) % 3].map(|k| self.sheet.corner_point[face.corners[k] as usize]);
        let (start, end, along) =
            if face.forward[k] { (first, second, share) } else { (second, first, 1.0 - share) };
        let list = &self.on_side[face.edges[k] as usize];
        let place = list.partition_point(|(share, _)| *share < along);
        let before = if place == 0 { (0.0, start) } else { list[place - 1] };
        let after = list.get(place).copied().unwrap_or((1.0, end));
        for (known, point) in [before, after] {
            if (along - known).abs() <= SAME {
                return point;
            }
        }
        let Some(h) = self.half_edge(f, before.1, after.1) else { return before.1 };
        let [a, b] = [face.nodes[k], face.nodes[(k + 1) % 3]].map(FragmentVertex::at_node);
        let at = FragmentVertex::between(&a, &b, share);
        let on_path = self.sheet.chain[h as usize] != NONE;
        let point = self.divide(h, at);
        self.used[point as usize] = on_path;
        self.on_side[face.edges[k] as usize].insert(place, (along, point));
        point
    }

    /// Joins two points over face `f` by straight edges of the skin and appends them to `parts`. Returns false if a path
    /// bars the way.
    pub(super) fn join(&mut self, f: u32, from: u32, to: u32, parts: &mut Vec<Part>) -> bool {
        let mut at = from;
        while at != to {
            let Some((end, crossed)) = self.ahead(f, at, to) else { return false };
            if !self.turn_away(f, [at, end], crossed) {
                return false;
            }
            parts.push(Part { face: f, ends: [at, end] });
            at = end;
        }
        true
    }

    /// The first point on the line from `at` to `to`, and the edges before it that cross the line. None if one of them
    /// belongs to a path.
    fn ahead(&self, f: u32, at: u32, to: u32) -> Option<(u32, VecDeque<[u32; 2]>)> {
        let sheet = &*self.sheet;
        let coordinates = |point: u32| sheet.point_on(self.base, f, point);
        let (p, q) = (coordinates(at), coordinates(to));
        let left = |point: u32| Sheet::area(&p, &q, &coordinates(point));
        let mut h = NONE;
        for leaving in self.fan(at).filter(|h| sheet.face[*h as usize / 3] == f) {
            let [a, b] = [sheet.to(leaving), sheet.from(previous(leaving))];
            if a == to || b == to {
                return Some((to, VecDeque::new()));
            }
            let [on_right, on_left] = [left(a), left(b)];
            if on_right == 0.0 && on_left > 0.0 {
                return Some((a, VecDeque::new()));
            }
            if on_right < 0.0 && on_left == 0.0 {
                return Some((b, VecDeque::new()));
            }
            if on_right < 0.0 && on_left > 0.0 {
                h = following(leaving);
            }
        }
        let mut crossed = VecDeque::new();
        while h != NONE && crossed.len() <= sheet.over[f as usize].len() {
            let g = sheet.twin[h as usize];
            if sheet.chain[h as usize] != NONE || sheet.face[g as usize / 3] != f {
                return None;
            }
            crossed.push_back([sheet.from(h), sheet.to(h)]);
            let apex = sheet.to(following(g));
            let side = left(apex);
            if apex == to || side == 0.0 {
                return Some((apex, crossed));
            }
            h = if side > 0.0 { following(g) } else { previous(g) };
        }
        None
    }

    /// Turns edges away that cross the line between two points, so that an edge joins these.
    fn turn_away(&mut self, f: u32, ends: [u32; 2], mut crossed: VecDeque<[u32; 2]>) -> bool {
        let mut left = 100 + 10 * crossed.len() * crossed.len();
        while let Some([u, v]) = crossed.pop_front() {
            let Some(h) = self.half_edge(f, u, v) else { return false };
            let [p, q] = [h, self.sheet.twin[h as usize]].map(|h| self.sheet.from(previous(h)));
            let x = |point: u32| self.sheet.point_on(self.base, f, point);
            let apart = |[a, b]: [u32; 2], [c, d]: [u32; 2]| {
                let sides = [c, d].map(|point| Sheet::area(&x(a), &x(b), &x(point)));
                sides[0] * sides[1] < 0.0
            };
            if apart([p, q], [u, v]) {
                let crosses = !ends.contains(&p) && !ends.contains(&q) && apart(ends, [p, q]);
                self.sheet.flip(h);
                let turned = [p, q];
                if crosses {
                    crossed.push_back(turned);
                }
                let triangles = [h / 3, self.sheet.twin[3 * (h as usize / 3) + 2] / 3];
                triangles.into_iter().for_each(|t| self.renew(t));
            } else {
                crossed.push_back([u, v]);
            }
            left -= 1;
            if left == 0 {
                return false;
            }
        }
        self.half_edge(f, ends[0], ends[1]).is_some()
    }

    /// Joins two points by the shortest way through triangles that crosses no path, and returns its parts. None if there is
    /// none nearby. [`Pen::point_on_side`] does not know the points that it makes.
    pub(super) fn lead(&mut self, from: u32, to: u32) -> Option<Vec<Part>> {
        let crossed = self.between(from, to)?;
        let mut parts = Vec::with_capacity(crossed.len() + 1);
        let mut last = from;
        for (face, [a, b]) in crossed {
            let [u, v] = [a, b].map(|point| self.sheet.points[point as usize].at);
            let h = self.half_edge(face, a, b)?;
            let point = self.divide(h, FragmentVertex::between(&u, &v, 0.5));
            parts.push(Part { face, ends: [last, point] });
            last = point;
        }
        let h = self.fan(last).find(|&h| self.sheet.to(h) == to)?;
        parts.push(Part { face: self.sheet.face[h as usize / 3], ends: [last, to] });
        self.is_free(&parts).then_some(parts)
    }

    /// The edges that [`Pen::lead`] crosses, each with the face on the near side of it.
    fn between(&self, from: u32, to: u32) -> Option<Vec<(u32, [u32; 2])>> {
        let sheet = &*self.sheet;
        if self.fan(from).any(|h| sheet.to(h) == to && sheet.chain[h as usize] == NONE) {
            return Some(Vec::new());
        }
        // Half-edges that are crossed, each with its predecessor in the list and their number up to there.
        let mut crossed: Vec<(u32, usize, usize)> = Vec::new();
        let mut seen = BTreeSet::new();
        let free = |h: &u32| sheet.chain[*h as usize] == NONE;
        crossed.extend(self.fan(from).map(following).filter(free).map(|h| (h, usize::MAX, 1)));
        let mut next = 0;
        while let Some(&(h, _, number)) = crossed.get(next) {
            let g = sheet.twin[h as usize];
            if sheet.to(following(g)) == to {
                let step = |&at: &usize| Some(crossed[at].1).filter(|at| *at != usize::MAX);
                let way = std::iter::successors(Some(next), step).map(|at| crossed[at].0);
                let way = way.map(|h| (sheet.face[h as usize / 3], [sheet.from(h), sheet.to(h)]));
                let mut way: Vec<_> = way.collect();
                way.reverse();
                return Some(way);
            }
            if number < LONGEST && seen.insert(g / 3) {
                let further = [following(g), previous(g)].into_iter().filter(free);
                crossed.extend(further.map(|h| (h, next, number + 1)));
            }
            next += 1;
        }
        None
    }

    /// Whether a path passes no point of another path, nor one of its own points twice, and runs along no other.
    pub(super) fn is_free(&self, parts: &[Part]) -> bool {
        let mut inner: Vec<u32> = parts[1..].iter().map(|part| part.ends[0]).collect();
        let apart = inner.iter().all(|&point| !self.used[point as usize]);
        inner.sort_unstable();
        let simple = inner.windows(2).all(|pair| pair[0] != pair[1]);
        let side = |part: &Part| self.half_edge(part.face, part.ends[0], part.ends[1]);
        apart
            && simple
            && parts.iter().all(|part| side(part).is_some_and(|h| self.sheet.chain[h as usize] == NONE))
    }

    /// Marks a path as chain `number` of the skin.
    pub(super) fn mark(&mut self, number: u32, parts: &[Part]) {
        for part in parts {
            let Some(h) = self.half_edge(part.face, part.ends[0], part.ends[1]) else { continue };
            self.sheet.chain[h as usize] = number;
            self.sheet.chain[self.sheet.twin[h as usize] as usize] = number;
            part.ends.iter().for_each(|&point| self.used[point as usize] = true);
        }
        let ends = parts.iter().map(|part| part.ends[1]);
        self.sheet.chains[number as usize] =
            parts.iter().take(1).map(|part| part.ends[0]).chain(ends).collect();
    }

    /// The half-edge from one point to another of which a side lies over face `f`.
    fn half_edge(&self, f: u32, from: u32, to: u32) -> Option<u32> {
        let sheet = &*self.sheet;
        let over = |h: u32| sheet.face[h as usize / 3] == f;
        self.fan(from).find(|&h| sheet.to(h) == to && (over(h) || over(sheet.twin[h as usize])))
    }

    /// All half-edges that leave a point.
    fn fan(&self, point: u32) -> impl Iterator<Item = u32> {
        self.sheet.fan(self.leaving[point as usize])
    }

    /// Divides the edge of half-edge `h` at a new point.
    fn divide(&mut self, h: u32, at: FragmentVertex) -> u32 {
        let new = self.sheet.corners.len() as u32;
        let divided = [h / 3, self.sheet.twin[h as usize] / 3, new, new + 1];
        let point = self.sheet.add_point(at, Vector3::zeros(), true);
        self.sheet.split_edge(h, point);
        divided.into_iter().for_each(|t| self.renew(t));
        point
    }

    /// Takes the corners of a triangle that is new or was changed.
    fn renew(&mut self, t: u32) {
        let points = self.sheet.points.len();
        self.leaving.resize(points, NONE);
        self.used.resize(points, false);
        (3 * t..3 * t + 3).for_each(|h| self.leaving[self.sheet.from(h) as usize] = h);
    }
}
