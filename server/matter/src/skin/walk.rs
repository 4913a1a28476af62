//! Turns edges of the cut curve into chains of skin edges.
//!
//! A walk goes straight from one end to the other, over one boundary face. It follows an edge that lies on
//! the line, passes through a corner on the line, or splits the edge it crosses (or, with snapping, moves a
//! corner onto the line). It never crosses an edge of an earlier cut.

use std::collections::VecDeque;

use super::base::Base;
use super::insert::{ON, Target};
use super::sheet::Sheet;
use crate::cut::topology::fragments::{FragmentVertex, NONE};

/// The next step of a walk.
enum Step {
    To(u32),
    /// Across this half-edge, at this parameter from its start.
    Across(u32, f64),
}

impl Sheet {
    /// Points along the cut between two points over face `f`, if that cut was inserted.
    pub(super) fn cut_between(&self, f: u32, from: u32, to: u32) -> Option<Vec<u32>> {
        for &t in &self.over[f as usize] {
            for k in 0..3 {
                let h = 3 * t + k;
                let chain = self.chain[h as usize];
                if chain == NONE || (self.from(h) != from && self.to(h) != from) {
                    continue;
                }
                let points = &self.chains[chain as usize];
                let (i, j) = (points.iter().position(|&p| p == from), points.iter().position(|&p| p == to));
                if let (Some(i), Some(j)) = (i, j) {
                    let mut part = points[i.min(j)..=i.max(j)].to_vec();
                    if i > j {
                        part.reverse();
                    }
                    return Some(part);
                }
            }
        }
        None
    }

    /// Cuts the skin over face `f` along the line between two points.
    pub(super) fn cut_along(&mut self, base: &Base, f: u32, from: u32, to: u32, snapping: f64) {
        if self.cut_between(f, from, to).is_some() {
            return;
        }
        let path = self.straight(base, f, from, to, snapping).unwrap_or_else(|| self.shortest(f, from, to));
        let chain = self.chains.len() as u32;
        for edge in path.windows(2) {
            let Some(h) = self.half_edge(f, edge[0], edge[1]).or_else(|| self.half_edge(f, edge[1], edge[0]))
            else {
                self.conflicts += 1;
                continue;
            };
            let twin = self.twin[h as usize];
            self.conflicts += usize::from(self.chain[h as usize] != NONE);
            self.chain[h as usize] = chain;
            self.chain[twin as usize] = chain;
        }
        self.chains.push(path);
    }

    fn straight(&mut self, base: &Base, f: u32, from: u32, to: u32, snapping: f64) -> Option<Vec<u32>> {
        let mut path = vec![from];
        let mut at = from;
        while at != to {
            at = match self.step(base, f, at, to)? {
                Step::To(p) => p,
                Step::Across(h, s) => {
                    let end = if s < 0.5 { self.from(h) } else { self.to(h) };
                    self.cross(base, f, h, s, if path.contains(&end) { 0.0 } else { snapping })
                }
            };
            if path.contains(&at) {
                return None;
            }
            path.push(at);
        }
        Some(path)
    }

    /// The next step from point `at` towards `to`.
    fn step(&self, base: &Base, f: u32, at: u32, to: u32) -> Option<Step> {
        let fan: Vec<(u32, usize)> = self.over[f as usize]
            .iter()
            .filter_map(|&t| Some((t, self.corners[t as usize].iter().position(|&p| p == at)?)))
            .collect();
        if fan.iter().any(|&(t, _)| self.corners[t as usize].contains(&to)) {
            return Some(Step::To(to));
        }
        let (p, q) = (self.point_on(base, f, at), self.point_on(base, f, to));
        let mut found = None;
        for (t, k) in fan {
            let [a, b] = [1, 2].map(|i| self.corners[t as usize][(k + i) % 3]);
            let [right, left] = [a, b].map(|x| Self::area(&p, &q, &self.point_on(base, f, x)));
            if right > 0.0 || left < 0.0 || right == left {
                continue;
            }
            let s = right / (right - left);
            let h = 3 * t + (k as u32 + 1) % 3;
            let walled = self.chain[h as usize] != NONE || self.face[self.twin[h as usize] as usize / 3] != f;
            let step = match s {
                _ if s <= ON => Step::To(a),
                _ if s >= 1.0 - ON => Step::To(b),
                _ if walled => Step::To(if s < 0.5 { a } else { b }),
                _ => return Some(Step::Across(h, s)),
            };
            found = found.or(Some(step));
        }
        found
    }

    /// Crosses the edge of half-edge `h` and returns the point there.
    fn cross(&mut self, base: &Base, f: u32, h: u32, s: f64, snapping: f64) -> u32 {
        let [a, b] = [self.from(h), self.to(h)];
        let [pa, pb] = [a, b].map(|p| self.points[p as usize]);
        let at = FragmentVertex::between(&pa.at, &pb.at, s);
        let (end, short) = if s < 0.5 { (a, s) } else { (b, 1.0 - s) };
        let w = Self::coordinates(base, f, &at);
        let inside = self.point_on(base, f, end).iter().all(|&w| w > 0.0);
        if short < snapping
            && inside
            && !self.points[end as usize].claimed
            && self.can_move(base, h, end, &Target { f, w })
        {
            let place = self.place_at(base, f, end, &w);
            let point = &mut self.points[end as usize];
            (point.at, point.place) = (at, place);
            return end;
        }
        let point = self.add_point(at, pa.place + (pb.place - pa.place) * s, false);
        self.split_edge(h, point);
        point
    }

    /// The path over the fewest uncut edges, for cases where rounding blocks the straight one.
    fn shortest(&self, f: u32, from: u32, to: u32) -> Vec<u32> {
        let mut before: Vec<(u32, u32)> = vec![(from, NONE)];
        let mut queue = VecDeque::from([from]);
        while let Some(at) = queue.pop_front() {
            if at == to {
                break;
            }
            for h in self.over[f as usize].iter().flat_map(|&t| (0..3).map(move |k| 3 * t + k)) {
                let (p, q) = (self.from(h), self.to(h));
                let next = if p == at {
                    q
                } else if q == at {
                    p
                } else {
                    continue;
                };
                if self.chain[h as usize] == NONE && before.iter().all(|b| b.0 != next) {
                    before.push((next, at));
                    queue.push_back(next);
                }
            }
        }
        let mut path = Vec::new();
        let mut at = to;
        while let Some(&(point, previous)) = before.iter().find(|b| b.0 == at) {
            path.push(point);
            at = previous;
        }
        path.reverse();
        path
    }
}
