//! From crossings to separated material: bisects the fragments that a sheet cuts completely, then opens the
//! faces along it.
//!
//! An incision cuts a fragment completely when removing the crossed edges disconnects the fragment's vertices
//! off the sheet. Only then are the crossed edges between the parts bisected, in every fragment around them,
//! so the fragment mesh stays conforming. The faces between the halves lie along the sheet. A fragment that
//! the sheet has entered but not left keeps its crossings and waits. The cut therefore lags the blade by at
//! most one element.

use std::collections::VecDeque;

use crate::mesh::{TET_EDGES, TET_FACES};
use crate::storage::reserve::reserved;

use super::bit_marks::{Ascending, BitMarks};
use super::front_elements::{Ahead, FrontElements, Meeting, State};
use crate::cut::drawn::pending::Pending;
use crate::cut::drawn::traces::{Bisection, Traces};
use crate::cut::topology::crossings::{Crossings, EdgeSet, SNAP, edge_key};
use crate::cut::topology::fragments::{FragmentVertex, Fragments, Halves, MAX_FRAGMENTS_PER_ELEMENT, NONE};
use crate::cut::topology::incision_sets::IncisionSets;

/// Mark of fragments that this sweep touched or bisected.
const ACTIVE: u8 = 1;
/// Mark of fragments in the queue, and of the one taken from it last.
const QUEUED: u8 = 2;
/// Mark of fragments that had a crossed edge when last examined.
const CROSSED: u8 = 4;
/// Mark of fragments that were bisected or had a face opened.
const CHANGED: u8 = 8;

/// Work list and result of a separation.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(crate) struct Separator {
    /// Elements with a face opened by this sweep, ascending.
    pub elements: Vec<u32>,
    /// Fragments that were bisected or had a face opened by this sweep.
    pub changed: Vec<u32>,
    /// Boundary faces (4·fragment + slot) that moved from one fragment to another, as [from, to] in the order
    /// of the moves.
    pub moved: Vec<[u32; 2]>,
    /// Number of faces opened.
    pub faces_opened: usize,
    /// Edges that are crossed but not separated.
    pub pending: EdgeSet,
    /// Edges left whole because an element or the body reached its cap of fragments.
    pub refused: EdgeSet,
    queue: VecDeque<u32>,
    /// Fragments that were touched or bisected.
    active: Vec<u32>,
    /// Marks of the fragments: `ACTIVE`, `QUEUED`, `CROSSED`, `CHANGED`.
    marks: BitMarks,
    order: Ascending,
    wedge: Vec<u32>,
    halves: Vec<Halves>,
    /// Incisions with something pending before this sweep.
    waiting: Vec<u32>,
    corners: Vec<(u32, u8)>,
    apexes: Vec<u32>,
}

/// The state that a separation reads and changes.
pub(crate) struct Sheet<'a> {
    /// Fragment mesh.
    pub fragments: &'a mut Fragments,
    /// Table of incision sets.
    pub sets: &'a mut IncisionSets,
    /// Crossings of edges.
    pub crossings: &'a mut Crossings,
    /// Fragments that incisions have entered and not left.
    pub waiting: &'a mut Pending,
    /// Lines that blades drew on the boundary.
    pub traces: &'a mut Traces,
    /// The incision to separate.
    pub incision: u32,
    /// Cap on the fragments of the whole body. An edge whose bisection would exceed it stays whole.
    pub most_fragments: usize,
}

impl Sheet<'_> {
    fn state(&self) -> State<'_> {
        State { fragments: &*self.fragments, sets: &*self.sets, crossings: &*self.crossings }
    }

    fn is_on(&self, v: u32) -> bool {
        self.sets.contains(self.fragments.on[v as usize], self.incision)
    }

    /// Parameter at which the incision crosses the edge (a, b), if it does and neither end lies on it.
    fn crossing(&self, a: u32, b: u32) -> Option<f64> {
        if self.is_on(a) || self.is_on(b) { None } else { self.crossings.get(a, b, self.incision) }
    }
}

impl Separator {
    /// Reserves memory for a cut through a body of `n_elements` elements.
    pub(crate) fn with_capacity(n_elements: usize) -> Self {
        let n = n_elements / 8;
        Self {
            elements: reserved(n, 0),
            changed: reserved(n, 0),
            active: reserved(n, 0),
            marks: BitMarks::with_capacity(n_elements),
            corners: reserved(2 * n, (0, 0)),
            queue: reserved(n, 0).into(),
            ..Self::default()
        }
    }

    /// Separates what the sheet cuts completely, among the `touched` fragments and their neighbours. If it has a `front`,
    /// it first goes on ahead of the blade, by the given reach; `near` are the pieces that the blade may be in.
    pub(crate) fn run(
        &mut self,
        (touched, near): (&[u32], &[u32]),
        front: Option<(&mut FrontElements, f64, Meeting<'_>)>,
        sheet: &mut Sheet,
    ) {
        self.elements.clear();
        self.changed.clear();
        self.moved.clear();
        self.pending.clear();
        self.refused.clear();
        self.faces_opened = 0;
        self.queue.clear();
        sheet.waiting.incisions(&mut self.waiting);
        self.marks.restart(sheet.fragments.tets.len());
        self.active.clear();
        touched.iter().for_each(|&t| self.look_at_later(t));
        self.bisect_queued(sheet);
        if let Some((front, reach, meeting)) = front {
            self.go_ahead((front, near), reach, &meeting, sheet);
        }
        self.open_faces(sheet);
        self.count_pending(sheet);
    }

    /// Bisects queued fragments, and those that this queues, until the sheet cuts none of them completely.
    fn bisect_queued(&mut self, sheet: &mut Sheet) {
        while let Some(t) = self.queue.pop_front() {
            while let Some((a, b, s)) = self.edge_to_bisect(t, sheet) {
                if !self.bisect(t, [a, b], s, sheet) {
                    self.refused.insert(edge_key(a, b));
                }
            }
            self.marks.remove(t, QUEUED);
        }
    }

    /// Crosses edges ahead of the blade, from the pieces with active fragments and between the lips that the blade is
    /// `near`.
    fn go_ahead(
        &mut self,
        (front, near): (&mut FrontElements, &[u32]),
        reach: f64,
        meeting: &Meeting<'_>,
        sheet: &mut Sheet,
    ) {
        let mut pieces: Vec<u32> = self.active.iter().map(|&t| sheet.fragments.piece[t as usize]).collect();
        self.order.sort(&mut pieces);
        for p in pieces {
            let ahead = front.look_at(p, reach, meeting, sheet.state());
            self.cross(ahead, sheet);
        }
        let of = |&p: &u32| meeting.body.pieces.pieces[p as usize].element;
        let mut elements: Vec<u32> = near.iter().map(of).collect();
        self.order.sort(&mut elements);
        for &e in &elements {
            let ahead = front.look_between(e, reach, meeting, sheet.state());
            self.cross(ahead, sheet);
        }
        front.leave(sheet.incision, &elements);
    }

    /// Adds crossings ahead of the blade.
    fn cross(&mut self, ahead: Ahead, sheet: &mut Sheet) {
        if ahead.crossings.is_empty() {
            return;
        }
        for ([a, b], s) in ahead.crossings {
            sheet.crossings.insert(a, b, sheet.incision, s);
        }
        ahead.fragments.into_iter().for_each(|t| self.look_at_later(t));
        self.bisect_queued(sheet);
    }

    /// Queues fragment `t`, unless it is queued already.
    fn look_at_later(&mut self, t: u32) {
        if self.marks.insert(t, ACTIVE) {
            self.active.push(t);
        }
        if self.marks.insert(t, QUEUED) {
            self.queue.push_back(t);
        }
    }

    /// A crossed edge between two parts of fragment `t`, if the sheet cuts the fragment completely. If there
    /// is none, only the bisection of an edge it shares with another fragment can change `t`.
    fn edge_to_bisect(&mut self, t: u32, sheet: &Sheet) -> Option<(u32, u32, f64)> {
        let tet = sheet.fragments.tets[t as usize];
        let mut part = [0usize, 1, 2, 3];
        let mut crossed = [None; 6];
        let on = tet.map(|v| sheet.is_on(v));
        for (k, [i, j]) in TET_EDGES.into_iter().enumerate() {
            if on[i] || on[j] {
                continue;
            }
            crossed[k] = sheet.crossings.get(tet[i], tet[j], sheet.incision);
            if crossed[k].is_none() {
                let (keep, drop) = (part[i], part[j]);
                part.iter_mut().filter(|p| **p == drop).for_each(|p| *p = keep);
            }
        }
        if crossed == [None; 6] {
            self.marks.remove(t, CROSSED);
            return None;
        }
        self.marks.insert(t, CROSSED);
        TET_EDGES.into_iter().zip(crossed).find_map(|([i, j], s)| {
            let s = s.filter(|_| part[i] != part[j])?;
            (!self.refused.contains(&edge_key(tet[i], tet[j]))).then_some((tet[i], tet[j], s))
        })
    }

    /// Bisects the edge (a, b) at `s` in all fragments around it. Returns `false` if the element or the body
    /// would exceed its cap.
    fn bisect(&mut self, t: u32, [a, b]: [u32; 2], s: f64, sheet: &mut Sheet) -> bool {
        let fragments = &mut *sheet.fragments;
        fragments.wedge(t, a, b, &mut self.wedge);
        // The cheap bound comes first: only elements that could reach their cap have their share of the wedge
        // counted.
        let full = |e: u32| {
            let (present, most) = (fragments.count[e as usize], usize::from(MAX_FRAGMENTS_PER_ELEMENT));
            let more = || self.wedge.iter().filter(|&&w| fragments.element[w as usize] == e).count();
            usize::from(present) + self.wedge.len() > most && usize::from(present) + more() > most
        };
        let room = fragments.tets.len() + self.wedge.len() <= sheet.most_fragments;
        if !room || self.wedge.iter().any(|&w| full(fragments.element[w as usize])) {
            return false;
        }
        let m = fragments.vertices.len() as u32;
        let [at_a, at_b] = [a, b].map(|v| fragments.vertices[v as usize]);
        fragments.vertices.push(FragmentVertex::between(&at_a, &at_b, s));
        // The new vertex lies on every incision that holds both ends of the edge, and on this one.
        let both = sheet.sets.both(fragments.on[a as usize], fragments.on[b as usize]);
        fragments.on.push(sheet.sets.with(both, sheet.incision));
        let along = sheet.sets.with(IncisionSets::EMPTY, sheet.incision);
        fragments.bisect(&self.wedge, [a, b], (m, s), along, &mut self.halves);
        // A bisection may complete the cut of any fragment of the wedge, so all are examined again.
        for k in 0..self.halves.len() {
            let h = self.halves[k];
            sheet.waiting.inherit(&self.waiting, h.old, h.new);
            for t in [h.old, h.new] {
                self.look_at_later(t);
                if self.marks.insert(t, CHANGED) {
                    self.changed.push(t);
                }
            }
            if sheet.fragments.neighbour[h.new as usize][h.slot as usize] == NONE {
                self.moved.push([h.old, h.new].map(|t| 4 * t + u32::from(h.slot)));
            }
        }
        self.pass_on_lines(m, s, sheet);
        self.pass_on_crossings([a, b], m, s, sheet);
        true
    }

    /// Divides the lines on bisected boundary faces among the two halves.
    fn pass_on_lines(&self, m: u32, s: f64, sheet: &mut Sheet) {
        let f = &*sheet.fragments;
        for &Halves { old, new, slot } in &self.halves {
            let a = slot as usize;
            let Some(b) = f.slot(old, m) else { continue };
            for (face, corners) in TET_FACES.iter().enumerate() {
                if face == b || f.neighbour[new as usize][face] != NONE {
                    continue;
                }
                let [old, new] = [old, new].map(|t| 4 * t + face as u32);
                let edge = [a, b].map(|k| corners.iter().position(|&c| c == k));
                match edge {
                    [Some(i), Some(j)] => {
                        let incision = sheet.incision;
                        sheet.traces.bisect(&Bisection { old, new, edge: [i, j], s, incision });
                    }
                    _ => sheet.traces.move_face(old, new),
                }
            }
        }
    }

    /// Divides the crossings of *other* incisions on (a, b) among its halves. A new edge from `m` into a
    /// fragment gets one where the line of an incision across a face passes through it.
    fn pass_on_crossings(&mut self, [a, b]: [u32; 2], m: u32, s: f64, sheet: &mut Sheet) {
        let incision = sheet.incision;
        let others: Vec<u32> =
            sheet.crossings.of(a, b).map(|c| c.0).filter(|&other| other != incision).collect();
        for &other in &others {
            let Some(t) = sheet.crossings.get(a, b, other) else { continue };
            if (t - s).abs() <= SNAP {
                let on = &mut sheet.fragments.on[m as usize];
                *on = sheet.sets.with(*on, other);
            } else if t < s {
                sheet.crossings.insert(a, m, other, t / s);
            } else {
                sheet.crossings.insert(m, b, other, (t - s) / (1.0 - s));
            }
        }
        // New edges lead from m to the vertices of the wedge other than a and b.
        self.apexes.clear();
        for h in &self.halves {
            for v in sheet.fragments.tets[h.old as usize] {
                if v != a && v != m && !self.apexes.contains(&v) {
                    self.apexes.push(v);
                }
            }
        }
        for &c in &self.apexes {
            let mut pending = others.clone(); // hardly ever with anything in it
            for end in [a, b] {
                pending.extend(sheet.crossings.of(end, c).map(|x| x.0).filter(|&o| o != incision));
            }
            pending.sort_unstable();
            pending.dedup();
            for other in pending {
                let on = |v: u32| sheet.sets.contains(sheet.fragments.on[v as usize], other);
                if !on(m)
                    && !on(c)
                    && let Some(r) = crossing_of_median(sheet.crossings, [a, b, c, m], s, other)
                {
                    sheet.crossings.insert(m, c, other, r);
                }
            }
        }
    }

    /// Opens every face of the active fragments that the incision runs along and whose three vertices lie on
    /// it. Each lip then gets its own vertices.
    fn open_faces(&mut self, sheet: &mut Sheet) {
        self.corners.clear();
        for &t in &self.active {
            for (face, corners) in TET_FACES.iter().enumerate() {
                let along = sheet.fragments.along[t as usize][face];
                let n = sheet.fragments.neighbour[t as usize][face];
                if n == NONE || !sheet.sets.contains(along, sheet.incision) {
                    continue;
                }
                let tet = sheet.fragments.tets[t as usize];
                if !corners.iter().all(|&k| sheet.is_on(tet[k])) {
                    continue;
                }
                let back = sheet.fragments.face_towards(n, t);
                sheet.fragments.open(t, face, sheet.incision);
                self.faces_opened += 1;
                // Both sides changed, and the stars at their corners may have fallen apart.
                for (t, face) in [(t, Some(face)), (n, back)] {
                    if self.marks.insert(t, CHANGED) {
                        self.changed.push(t);
                    }
                    self.elements.push(sheet.fragments.element[t as usize]);
                    self.corners.extend((0..4u8).filter(|&k| Some(k as usize) != face).map(|k| (t, k)));
                }
            }
        }
        self.order.sort(&mut self.elements);
        // A vertex split from another one still has the crossings of the edges it took over.
        let crossings = &mut *sheet.crossings;
        sheet.fragments.split_stars(&self.corners, |fragments, old, [t, new]| {
            if crossings.reach(old) {
                let others = fragments.tets[t as usize].into_iter().filter(|&v| v != new);
                others.for_each(|v| crossings.inherit(old, new, v));
            }
        });
    }

    fn count_pending(&mut self, sheet: &mut Sheet) {
        for &t in &self.active {
            let mut crossed = false;
            if self.marks.contains(t, CROSSED) {
                let tet = sheet.fragments.tets[t as usize];
                for [a, b] in TET_EDGES.map(|[i, j]| [tet[i], tet[j]]) {
                    if sheet.crossing(a, b).is_some() {
                        self.pending.insert(edge_key(a, b));
                        crossed = true;
                    }
                }
            }
            sheet.waiting.set(sheet.incision, t, crossed);
        }
    }
}

/// Where an incision crosses the new edge (m, c) of the triangle (a, b, c), with m = (1 − s) a + s b. It must
/// cross it if it enters through the half on the side of `a` and leaves through the half on the side of `b`.
/// Returns the parameter, from m to c, of the straight line between the two crossings.
fn crossing_of_median(crossings: &Crossings, [a, b, c, m]: [u32; 4], s: f64, incision: u32) -> Option<f64> {
    let only = |p: Option<[f64; 3]>, q: Option<[f64; 3]>| match (p, q) {
        (Some(x), None) | (None, Some(x)) => Some(x),
        _ => None,
    };
    // Barycentric coordinates in (a, b, c).
    let on_am = crossings.get(a, m, incision).map(|t| [1.0 - t * s, t * s, 0.0]);
    let on_mb = crossings.get(m, b, incision).map(|t| [(1.0 - s) * (1.0 - t), s + t * (1.0 - s), 0.0]);
    let on_ac = crossings.get(a, c, incision).map(|t| [1.0 - t, 0.0, t]);
    let on_bc = crossings.get(b, c, incision).map(|t| [0.0, 1.0 - t, t]);
    let (p, q) = (only(on_am, on_ac)?, only(on_mb, on_bc)?);
    // Signed distance from the line m–c, positive on the side of a.
    let distance = |x: &[f64; 3]| x[0] * s - x[1] * (1.0 - s);
    let (from, to) = (distance(&p), distance(&q));
    let ratio = from / (from - to);
    let r = p[2] + ratio * (q[2] - p[2]);
    (r > SNAP && r < 1.0 - SNAP).then_some(r)
}
