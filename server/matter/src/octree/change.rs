//! Cuts links and divides leaves, and keeps the vertices right.
//!
//! Both ends of a link that is cut become leaves of the finest level; 2:1 balance follows. New vertices
//! interpolate the leaf they are in, so that displacement and velocity stay the same field, and mass and momentum
//! stay too. A vertex whose leaves come apart is copied.

use super::build::{child_corner, for_around};
use super::cells::{Cell, Octree};
use super::lattice::{At, DIRECTIONS, OUTSIDE};
use super::link_map::{CutLink, LinkKey};
use super::vertices::{Octants, corner_weights};
use crate::element::MaterialPoint;

/// What a change did to cells and vertices.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OctreeChange {
    /// Cells that are new or have other links, vertices or hanging corners, ascending.
    pub cells: Vec<u32>,
    /// The leaves that filled their place before, by the vertices of then, which keep their numbers.
    pub earlier: Vec<Leaf>,
    /// Where each new vertex is in the earlier material; their numbers follow those of the vertices before.
    pub new_vertices: Vec<MaterialPoint>,
    /// Number of links that were whole before and are cut now.
    pub links: usize,
    /// Links that are cut now, or cut nearer to an end than before.
    pub moved: Vec<LinkKey>,
    /// Number of leaves that were divided.
    pub divided: usize,
}

/// A leaf with what carries it, now or before a change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Leaf {
    /// Place and size.
    pub cell: Cell,
    /// See [`Octree::vertices`].
    pub vertices: [u32; 8],
    /// See [`Octree::hanging`].
    pub hanging: u8,
}

/// Leaves as they were before, and what became of them.
#[derive(Debug)]
struct History {
    earlier: Vec<Leaf>,
    /// Per leaf one more than the entry of `earlier` that it was part of; 0 if it is as it was.
    part_of: Vec<u32>,
    /// Leaves that have to be told of, in any order.
    changed: Vec<u32>,
    /// Per leaf whether it is among `changed`, and which of its corners are done, one bit each.
    told: Vec<bool>,
    done: Vec<u8>,
    divided: usize,
}

impl History {
    fn new(n: usize) -> Self {
        let (part_of, told, done) = (vec![0; n], vec![false; n], vec![0; n]);
        Self { earlier: Vec::new(), part_of, changed: Vec::new(), told, done, divided: 0 }
    }

    fn tell(&mut self, id: u32) {
        if !std::mem::replace(&mut self.told[id as usize], true) {
            self.changed.push(id);
        }
    }

    /// Number of the entry of `earlier` for leaf `id`; `now` is the leaf, should it be as it was.
    fn keep(&mut self, id: u32, now: Leaf) -> u32 {
        let part_of = &mut self.part_of[id as usize];
        if *part_of == 0 {
            self.earlier.push(now);
            *part_of = self.earlier.len() as u32;
        }
        *part_of
    }
}

impl Octree {
    /// Cuts these links; those that lead out of the body stay as they are. A link that was cut before keeps its
    /// incision, and the two cuts nearest to its ends.
    pub fn cut(&mut self, cuts: &[(LinkKey, CutLink)]) -> OctreeChange {
        let mut history = History::new(self.cells.len());
        let (mut links, mut moved) = (0, Vec::new());
        for &((at, axis), cut) in cuts {
            let mut upper = at;
            upper[usize::from(axis)] += 1;
            if self.map.leaf(at) == OUTSIDE || self.map.leaf(upper) == OUTSIDE {
                continue;
            }
            self.divide_to(at, 0, &mut history);
            let high = self.divide_to(upper, 0, &mut history);
            let low = self.map.leaf(at);
            let bit = 2 * axis + 1;
            if self.cells[low as usize].cut >> bit & 1 == 0 {
                links += 1;
                self.cells[low as usize].cut |= 1 << bit;
                self.cells[high as usize].cut |= 1 << (bit - 1);
                history.tell(low);
                history.tell(high);
            }
            let known = self.links.entry((at, axis)).or_insert_with(|| {
                moved.push((at, axis));
                cut
            });
            if known.join(&cut) {
                moved.push((at, axis));
            }
        }
        OctreeChange { links, moved, ..self.follow(history) }
    }

    /// Divides leaves until those at `at` have sides of 2^level finest cells at most.
    pub fn refine(&mut self, at: &[At], level: u8) -> OctreeChange {
        let mut history = History::new(self.cells.len());
        for &at in at {
            if self.map.leaf(at) != OUTSIDE {
                self.divide_to(at, level, &mut history);
            }
        }
        self.follow(history)
    }

    /// Divides each of these leaves into eight, and coarser leaves around them as 2:1 balance asks.
    pub fn divide_leaves(&mut self, leaves: &[u32]) -> OctreeChange {
        let mut history = History::new(self.cells.len());
        // Numbers change their meaning as leaves are divided.
        let asked: Vec<(At, u8)> = leaves
            .iter()
            .filter_map(|&id| self.cells.get(id as usize))
            .filter_map(|cell| Some((cell.at, cell.level.checked_sub(1)?)))
            .collect();
        for (at, level) in asked {
            self.divide_to(at, level, &mut history);
        }
        self.follow(history)
    }

    /// Divides leaves until that at `at` has sides of 2^level at most; returns it.
    fn divide_to(&mut self, at: At, level: u8, history: &mut History) -> u32 {
        loop {
            let leaf = self.map.leaf(at);
            if self.cells[leaf as usize].level <= level {
                return leaf;
            }
            self.divide(leaf, history);
        }
    }

    /// Divides a leaf into eight; its number becomes that of the first. Coarser leaves around it are divided
    /// before, so that 2:1 balance stays.
    fn divide(&mut self, id: u32, history: &mut History) {
        let cell = self.cells[id as usize];
        let unit = cell.at.map(|x| x >> cell.level);
        let mut around = [[0; 3]; 27];
        let mut n = 0;
        for_around(unit, |near| {
            around[n] = near.map(|x| x << cell.level);
            n += 1;
        });
        for at in around {
            while self.map.leaf(at) != OUTSIDE && self.cells[self.map.leaf(at) as usize].level > cell.level {
                self.divide(self.map.leaf(at), history);
            }
        }
        let earlier = history.keep(id, self.now(id));
        history.divided += 1;
        for child in 0..8 {
            let at = child_corner(cell.at, cell.level, child);
            let part = Cell { at, level: cell.level - 1, cut: 0, material: cell.material };
            let number = if child == 0 {
                self.cells[id as usize] = part;
                (self.vertices[id as usize], self.hanging[id as usize]) = ([OUTSIDE; 8], 0);
                id
            } else {
                self.cells.push(part);
                self.vertices.push([OUTSIDE; 8]);
                self.hanging.push(0);
                history.part_of.push(earlier);
                history.told.push(false);
                history.done.push(0);
                self.cells.len() as u32 - 1
            };
            self.map.set(part.at, part.level, number);
            history.tell(number);
        }
    }

    /// Finds the vertices anew around the leaves that were told of.
    fn follow(&mut self, mut history: History) -> OctreeChange {
        let mut new_vertices = Vec::new();
        // The list grows by leaves around; only the corners of those at first are examined.
        for k in 0..history.changed.len() {
            let id = history.changed[k] as usize;
            for c in 0..8 {
                if history.done[id] >> c & 1 == 0 {
                    self.follow_point(self.cells[id].corner(c), &mut history, &mut new_vertices);
                }
            }
        }
        // Corners that hang on a coarse leaf follow the vertices of that leaf.
        for k in 0..history.changed.len() {
            let cell = self.cells[history.changed[k] as usize];
            if cell.level > 0 && !self.stale {
                self.for_smaller_around(&cell, |id| {
                    history.keep(id, self.now(id));
                    history.tell(id);
                });
            }
        }
        for &id in &history.changed {
            if self.hanging[id as usize] != 0 {
                self.resolve(id as usize);
            }
        }
        let History { mut changed, divided, earlier, .. } = history;
        changed.sort_unstable();
        OctreeChange { cells: changed, earlier, new_vertices, divided, ..OctreeChange::default() }
    }

    /// Gives the classes of leaves around lattice point `p` their vertices. The first class keeps a vertex that
    /// several had in common.
    fn follow_point(&mut self, p: At, history: &mut History, new_vertices: &mut Vec<MaterialPoint>) {
        let octants = self.octants(p);
        for (o, &id) in octants.leaf.iter().enumerate().filter(|(_, leaf)| **leaf != OUTSIDE) {
            history.keep(id, self.now(id));
            history.tell(id);
            if self.cells[id as usize].corner(7 - o) == p {
                history.done[id as usize] |= 1 << (7 - o);
            }
        }
        // What every class was carried by before, found before anything is entered.
        let mut classes = [(0u8, Carrier::New(MaterialPoint::default())); 8];
        let mut n = 0;
        for o in (0..8).filter(|&o| octants.class[o] == o as u8 && octants.leaf[o] != OUTSIDE) {
            classes[n] = (o as u8, self.earlier_carrier(p, &octants, o as u8, history));
            n += 1;
        }
        let mut kept = [OUTSIDE; 8];
        for k in 0..n {
            let (class, carrier) = classes[k];
            let next = self.points.len() as u32;
            let (vertex, point) = match carrier {
                Carrier::Vertex(known) if !kept.contains(&known) => (known, None),
                Carrier::Vertex(known) => (next, Some(MaterialPoint::new([(known, 1.0)]))),
                Carrier::New(point) => (next, Some(point)),
            };
            if self.enter(p, &octants, class, vertex) {
                match point {
                    Some(point) => {
                        self.points.push(p);
                        new_vertices.push(point);
                    }
                    None => kept[k] = vertex,
                }
            }
        }
    }

    /// What carried point `p` in the material of a class before.
    fn earlier_carrier(&self, p: At, octants: &Octants, class: u8, history: &History) -> Carrier {
        let mut within = None;
        for o in (0..8).filter(|&o| octants.class[o] == class && octants.leaf[o] != OUTSIDE) {
            let earlier = &history.earlier[history.part_of[octants.leaf[o] as usize] as usize - 1];
            match earlier.cell.corner_at(p).filter(|c| earlier.hanging >> c & 1 == 0) {
                Some(c) => return Carrier::Vertex(earlier.vertices[c]),
                None => within = within.or(Some(earlier)),
            }
        }
        Carrier::New(within.map_or_else(MaterialPoint::default, |earlier| earlier.carriers(p)))
    }

    /// A leaf with what carries it.
    pub fn now(&self, id: u32) -> Leaf {
        let id = id as usize;
        Leaf { cell: self.cells[id], vertices: self.vertices[id], hanging: self.hanging[id] }
    }

    /// Calls `visit` for the leaves of half the side that touch `cell`.
    pub(super) fn for_smaller_around(&self, cell: &Cell, mut visit: impl FnMut(u32)) {
        let half = cell.side() / 2;
        for k in -1..3 {
            for j in -1..3 {
                for i in -1..3 {
                    let inside = [i, j, k].iter().all(|d| (0..2).contains(d));
                    let at = [cell.at[0] + i * half, cell.at[1] + j * half, cell.at[2] + k * half];
                    let leaf = if inside { OUTSIDE } else { self.map.leaf(at) };
                    if leaf != OUTSIDE && self.cells[leaf as usize].level + 1 == cell.level {
                        visit(leaf);
                    }
                }
            }
        }
    }

    /// The finest cell on the other side of a link.
    pub fn across(at: At, d: usize) -> At {
        [0, 1, 2].map(|k| at[k] + DIRECTIONS[d][k])
    }

    /// The point with local coordinates `xi` (0 … 1 along each axis) in leaf `id`, carried by its vertices.
    pub fn point_in(&self, id: u32, xi: [f64; 3]) -> MaterialPoint {
        self.now(id).at(xi)
    }
}

/// What carries a lattice point.
#[derive(Clone, Copy, Debug)]
enum Carrier {
    /// A vertex of its own.
    Vertex(u32),
    /// The vertices of a leaf that it lies within.
    New(MaterialPoint),
}

impl Leaf {
    /// The carriers of lattice point `p`, which is in the cell or on its border.
    fn carriers(&self, p: At) -> MaterialPoint {
        let side = f64::from(self.cell.side());
        self.at([0, 1, 2].map(|k| f64::from(p[k] - self.cell.at[k]) / side))
    }

    fn at(&self, xi: [f64; 3]) -> MaterialPoint {
        let N: [f64; 8] = std::array::from_fn(|c| {
            (0..3).map(|k| if c >> k & 1 == 1 { xi[k] } else { 1.0 - xi[k] }).product()
        });
        if self.hanging == 0 {
            return MaterialPoint::new(self.vertices.into_iter().zip(N).filter(|(_, w)| *w != 0.0));
        }
        let mut weights = [0.0; 8];
        for (row, N) in corner_weights(&self.cell, self.hanging).iter().zip(N) {
            weights.iter_mut().zip(row).for_each(|(w, r)| *w += N * r);
        }
        MaterialPoint::new(self.vertices.into_iter().zip(weights).filter(|(_, w)| *w != 0.0))
    }
}

impl CutLink {
    /// Adds another cut of the same link: the cuts nearest to the two ends count. Returns whether it is one of
    /// them.
    pub(super) fn join(&mut self, other: &CutLink) -> bool {
        let before = self.at;
        if other.at[0] < self.at[0] {
            (self.at[0], self.normal[0]) = (other.at[0], other.normal[0]);
        }
        if other.at[1] > self.at[1] {
            (self.at[1], self.normal[1]) = (other.at[1], other.normal[1]);
        }
        self.at != before
    }
}
