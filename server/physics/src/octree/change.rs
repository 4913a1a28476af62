//! Cuts links and divides leaves, and keeps the vertices right.
//!
//! Both ends of a link that is cut become leaves of the finest level; 2:1 balance follows. New vertices
//! interpolate the leaf they are in, so that displacement and velocity stay the same field, and mass and momentum
//! stay too. A vertex whose leaves come apart is copied.

use std::collections::{BTreeMap, BTreeSet};

use super::build::{child_corner, for_around};
use super::cells::{Cell, CutLink, DIRECTIONS, LinkKey, Octree};
use super::lattice::{At, OUTSIDE};
use super::vertices::{Octants, corner_weights};
use crate::element::MaterialPoint;

/// What a change did to cells and vertices.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OctreeChange {
    /// Cells that are new or have other links, vertices or hanging corners, ascending.
    pub cells: Vec<u32>,
    /// Where each new vertex is in the earlier material; their numbers follow those of the vertices before.
    pub new_vertices: Vec<MaterialPoint>,
    /// Number of links that were whole before and are cut now.
    pub links: usize,
    /// Number of leaves that were divided.
    pub divided: usize,
}

/// A leaf as it was before the change.
#[derive(Clone, Copy, Debug)]
struct Earlier {
    cell: Cell,
    vertices: [u32; 8],
    hanging: u8,
}

/// Leaves as they were before, and what became of those that were divided.
#[derive(Debug, Default)]
struct Division {
    earlier: Vec<Earlier>,
    /// For every leaf that came of one of them, which one it was part of.
    part_of: BTreeMap<u32, usize>,
    /// Leaves that were not divided but may have other vertices now.
    whole: BTreeMap<u32, Earlier>,
}

impl Octree {
    /// Cuts these links; those that lead out of the body stay as they are. A link that was cut before keeps its
    /// incision, and the two cuts nearest to its ends.
    pub fn cut(&mut self, cuts: &[(LinkKey, CutLink)]) -> OctreeChange {
        let mut division = Division::default();
        let mut changed = BTreeSet::new();
        let mut links = 0;
        for &((at, axis), cut) in cuts {
            let mut upper = at;
            upper[usize::from(axis)] += 1;
            if self.map.leaf(at) == OUTSIDE || self.map.leaf(upper) == OUTSIDE {
                continue;
            }
            for end in [at, upper] {
                self.divide_down_to(end, &mut division);
            }
            let (low, high) = (self.map.leaf(at), self.map.leaf(upper));
            let bit = 2 * axis + 1;
            if self.cells[low as usize].cut >> bit & 1 == 0 {
                links += 1;
                self.cells[low as usize].cut |= 1 << bit;
                self.cells[high as usize].cut |= 1 << (bit - 1);
                changed.extend([low, high]);
            }
            self.links.entry((at, axis)).and_modify(|known| known.join(&cut)).or_insert(cut);
        }
        self.follow(division, changed, links)
    }

    /// Divides leaves until those at `at` have sides of 2^level finest cells at most.
    pub fn refine(&mut self, at: &[At], level: u8) -> OctreeChange {
        let mut division = Division::default();
        for &at in at {
            while self.map.leaf(at) != OUTSIDE && self.cells[self.map.leaf(at) as usize].level > level {
                self.divide(self.map.leaf(at), &mut division);
            }
        }
        self.follow(division, BTreeSet::new(), 0)
    }

    fn divide_down_to(&mut self, at: At, division: &mut Division) {
        while self.cells[self.map.leaf(at) as usize].level > 0 {
            self.divide(self.map.leaf(at), division);
        }
    }

    /// Divides a leaf into eight; its number becomes that of the first. Coarser leaves around it are divided
    /// before, so that 2:1 balance stays.
    fn divide(&mut self, id: u32, division: &mut Division) {
        let cell = self.cells[id as usize];
        let unit = cell.at.map(|x| x >> cell.level);
        let mut coarser = Vec::new();
        for_around(unit, |near| coarser.push(near.map(|x| x << cell.level)));
        for at in coarser {
            while self.map.leaf(at) != OUTSIDE && self.cells[self.map.leaf(at) as usize].level > cell.level {
                self.divide(self.map.leaf(at), division);
            }
        }
        let earlier = match division.part_of.get(&id) {
            Some(&earlier) => earlier,
            None => {
                division.earlier.push(self.now(id));
                division.earlier.len() - 1
            }
        };
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
                self.cells.len() as u32 - 1
            };
            self.map.set(part.at, part.level, number);
            division.part_of.insert(number, earlier);
        }
    }

    /// Finds the vertices anew around the leaves that were divided and those in `changed`.
    fn follow(&mut self, mut division: Division, mut changed: BTreeSet<u32>, links: usize) -> OctreeChange {
        changed.extend(division.part_of.keys());
        let points: BTreeSet<At> = changed
            .iter()
            .flat_map(|&id| (0..8).map(move |c| (id, c)))
            .map(|(id, c)| self.cells[id as usize].corner(c))
            .collect();
        let mut new_vertices = Vec::new();
        let mut to_resolve = changed.clone();
        for &p in &points {
            self.follow_point(p, &mut division, &mut new_vertices, &mut to_resolve);
        }
        // Corners that hang on a coarse leaf follow the vertices of that leaf.
        let coarse: Vec<Cell> =
            to_resolve.iter().map(|&id| self.cells[id as usize]).filter(|cell| cell.level > 0).collect();
        for cell in coarse {
            self.for_smaller_around(&cell, |id| {
                to_resolve.insert(id);
            });
        }
        for &id in &to_resolve {
            self.resolve(id as usize);
        }
        let divided = division.earlier.len();
        OctreeChange { cells: to_resolve.into_iter().collect(), new_vertices, links, divided }
    }

    /// Gives the classes of leaves around lattice point `p` their vertices. The first class keeps a vertex that
    /// several had in common.
    fn follow_point(
        &mut self,
        p: At,
        division: &mut Division,
        new_vertices: &mut Vec<MaterialPoint>,
        touched: &mut BTreeSet<u32>,
    ) {
        let octants = self.octants(p);
        for &id in octants.leaf.iter().filter(|&&leaf| leaf != OUTSIDE) {
            if !division.part_of.contains_key(&id) {
                division.whole.entry(id).or_insert_with(|| self.now(id));
            }
        }
        // What every class was carried by before, found before anything is entered.
        let mut classes: Vec<(u8, MaterialPoint)> = Vec::with_capacity(8);
        for o in (0..8).filter(|&o| octants.class[o] == o as u8 && octants.leaf[o] != OUTSIDE) {
            if let Some(point) = self.earlier_point(p, &octants, o as u8, division) {
                classes.push((o as u8, point));
            }
        }
        let mut kept: Vec<u32> = Vec::with_capacity(8);
        for (class, point) in classes {
            let known = point.copies().first().copied().filter(|_| point.weights() == [1.0]);
            let vertex = match known {
                Some(known) if !kept.contains(&known) => known,
                _ => self.points.len() as u32,
            };
            if self.enter(p, &octants, class, vertex) {
                if vertex as usize == self.points.len() {
                    self.points.push(p);
                    new_vertices.push(point);
                } else {
                    kept.push(vertex);
                }
            }
        }
        touched.extend(octants.leaf.iter().filter(|&&leaf| leaf != OUTSIDE));
    }

    /// Point `p` in the material of a class as it was before.
    fn earlier_point(
        &self,
        p: At,
        octants: &Octants,
        class: u8,
        division: &Division,
    ) -> Option<MaterialPoint> {
        let mut found: Option<MaterialPoint> = None;
        for o in (0..8).filter(|&o| octants.class[o] == class && octants.leaf[o] != OUTSIDE) {
            let id = octants.leaf[o];
            let part = division.part_of.get(&id).map(|&part| division.earlier[part]);
            let earlier = part.or_else(|| division.whole.get(&id).copied()).unwrap_or_else(|| self.now(id));
            let point = earlier.carriers(p);
            if point.copies().len() == 1 {
                return Some(point);
            }
            found = found.or(Some(point));
        }
        found
    }

    fn now(&self, id: u32) -> Earlier {
        let id = id as usize;
        Earlier { cell: self.cells[id], vertices: self.vertices[id], hanging: self.hanging[id] }
    }

    /// Calls `visit` for the leaves of half the side that touch `cell`.
    fn for_smaller_around(&self, cell: &Cell, mut visit: impl FnMut(u32)) {
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

impl Earlier {
    /// The carriers of lattice point `p`, which is in the cell or on its border.
    fn carriers(&self, p: At) -> MaterialPoint {
        if let Some(c) = (0..8).find(|&c| self.hanging >> c & 1 == 0 && self.cell.corner(c) == p) {
            return MaterialPoint::new([(self.vertices[c], 1.0)]);
        }
        let side = f64::from(self.cell.side());
        self.at([0, 1, 2].map(|k| f64::from(p[k] - self.cell.at[k]) / side))
    }

    fn at(&self, xi: [f64; 3]) -> MaterialPoint {
        let N: [f64; 8] = std::array::from_fn(|c| {
            (0..3).map(|k| if c >> k & 1 == 1 { xi[k] } else { 1.0 - xi[k] }).product()
        });
        let mut weights = [0.0; 8];
        for (row, N) in corner_weights(&self.cell, self.hanging).iter().zip(N) {
            weights.iter_mut().zip(row).for_each(|(w, r)| *w += N * r);
        }
        MaterialPoint::new(self.vertices.into_iter().zip(weights).filter(|(_, w)| *w != 0.0))
    }
}

impl CutLink {
    /// Adds another cut of the same link: the cuts nearest to the two ends count.
    pub(super) fn join(&mut self, other: &CutLink) {
        if other.at[0] < self.at[0] {
            (self.at[0], self.normal[0]) = (other.at[0], other.normal[0]);
        }
        if other.at[1] > self.at[1] {
            (self.at[1], self.normal[1]) = (other.at[1], other.normal[1]);
        }
    }
}
