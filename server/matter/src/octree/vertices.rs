//! Vertices of the cells, and hanging corners.
//!
//! Around a lattice point there are eight octants, each in a leaf. Leaves share a vertex there if their octants
//! are connected through linked faces. Cells that only touch in an edge or a point, or along a cut, have
//! vertices of their own. A vertex *hangs* if one of these leaves has the point inside an edge or a face: the
//! displacement there is that of the coarse leaf.
//!
//! # Source
//! Dick, Georgii, Westermann 2011, §6.4; Wang 2001. 2:1 balance across faces, edges and corners makes every
//! cell rest on exactly eight vertices: a hanging corner is the mean of two or four corners of the cell's
//! parent, and these take the places of the hanging ones.

use super::cells::{Cell, Octree};
use super::lattice::{At, OUTSIDE};

/// Marks a corner that hangs, and octants outside the body.
const NONE: u32 = u32::MAX;

/// Octants that have a neighbour along an axis, and that axis.
const PAIRS: [(usize, usize); 12] =
    [(0, 0), (2, 0), (4, 0), (6, 0), (0, 1), (1, 1), (4, 1), (5, 1), (0, 2), (1, 2), (2, 2), (3, 2)];

/// The eight octants around a lattice point and their connection. Bit k of an octant is its side along axis k.
#[derive(Clone, Copy, Debug)]
pub struct Octants {
    /// Leaf of every octant, or [`OUTSIDE`].
    pub leaf: [u32; 8],
    /// Lowest octant that each one is connected to; its own number if it is the lowest.
    pub class: [u8; 8],
}

impl Octree {
    /// The octants around lattice point `p`.
    pub fn octants(&self, p: At) -> Octants {
        let cell_of = |o: usize| [0, 1, 2].map(|k| p[k] - 1 + (o >> k & 1) as i32);
        let mut leaf = [OUTSIDE; 8];
        for (o, leaf) in leaf.iter_mut().enumerate() {
            *leaf = self.map.leaf(cell_of(o));
        }
        let is_linked = |o: usize, axis: usize| {
            let (a, b) = (leaf[o], leaf[o | 1 << axis]);
            let inside = a != OUTSIDE && b != OUTSIDE;
            inside && (a == b || self.cells[a as usize].cut >> (2 * axis + 1) & 1 == 0)
        };
        // Nothing is cut around most points.
        if PAIRS.iter().all(|&(o, axis)| is_linked(o, axis)) {
            return Octants { leaf, class: [0; 8] };
        }
        let mut class = [0, 1, 2, 3, 4, 5, 6, 7];
        for &(o, axis) in PAIRS.iter().filter(|&&(o, axis)| is_linked(o, axis)) {
            let (low, high) = (class[o].min(class[o | 1 << axis]), class[o].max(class[o | 1 << axis]));
            class.iter_mut().filter(|c| **c == high).for_each(|c| *c = low);
        }
        Octants { leaf, class }
    }

    /// Gives every vertex of a new octree its number, in the order of the cells.
    pub(super) fn number_vertices(&mut self) {
        for id in 0..self.cells.len() {
            for c in 0..8 {
                if self.vertices[id][c] == NONE && self.hanging[id] >> c & 1 == 0 {
                    let p = self.cells[id].corner(c);
                    let octants = self.octants(p);
                    let class = octants.class[7 - c];
                    let vertex = self.points.len() as u32;
                    if self.enter(p, &octants, class, vertex) {
                        self.points.push(p);
                    }
                }
            }
        }
        for id in 0..self.cells.len() {
            self.resolve(id);
        }
    }

    /// Enters `vertex` at the corners of one class around `p`, or marks them as hanging. Returns whether the
    /// vertex is free.
    pub(super) fn enter(&mut self, p: At, octants: &Octants, class: u8, vertex: u32) -> bool {
        let members = (0..8).filter(|&o| octants.class[o] == class && octants.leaf[o] != OUTSIDE);
        let hangs = members.clone().any(|o| self.cells[octants.leaf[o] as usize].corner(7 - o) != p);
        for o in members {
            let id = octants.leaf[o] as usize;
            if self.cells[id].corner(7 - o) == p {
                let (bit, c) = (1u8 << (7 - o), 7 - o);
                self.vertices[id][c] = if hangs { NONE } else { vertex };
                if hangs { self.hanging[id] |= bit } else { self.hanging[id] &= !bit }
            }
        }
        !hangs
    }

    /// Replaces the hanging corners of a cell by the vertices of its parent's corners.
    pub(super) fn resolve(&mut self, id: usize) {
        let cell = self.cells[id];
        for c in (0..8).filter(|c| self.hanging[id] >> c & 1 == 1) {
            let p = cell.corner(c);
            let octants = self.octants(p);
            let class = octants.class[7 - c];
            let coarse = (0..8).filter(|&o| octants.class[o] == class && octants.leaf[o] != OUTSIDE);
            let coarse = coarse.map(|o| octants.leaf[o] as usize);
            if let Some(coarse) = coarse.filter(|&leaf| self.cells[leaf].level > cell.level).min() {
                let q = parent_corner(&cell, c);
                if let Some(at) = self.cells[coarse].corner_at(q) {
                    self.vertices[id][c] = self.vertices[coarse][at];
                }
            }
        }
    }
}

/// Corner of the cell's parent in the direction of its corner `c`.
pub fn parent_corner(cell: &Cell, c: usize) -> At {
    let mut parent = *cell;
    parent.level += 1;
    parent.at = cell.at.map(|x| x >> parent.level << parent.level);
    parent.corner(c)
}

/// W of a cell: row c holds the weights of its eight vertices in the displacement of corner c.
pub fn corner_weights(cell: &Cell, hanging: u8) -> [[f64; 8]; 8] {
    let mut W = [[0.0; 8]; 8];
    for (c, row) in W.iter_mut().enumerate() {
        for_weights(cell, hanging, c, |vertex, w| row[vertex] = w);
    }
    W
}

/// Sums of the columns of W: how many corners of a cell each of its eight vertices carries.
#[inline]
pub fn corner_shares(cell: &Cell, hanging: u8) -> [f64; 8] {
    if hanging == 0 {
        return [1.0; 8];
    }
    let mut shares = [0.0; 8];
    (0..8).for_each(|c| for_weights(cell, hanging, c, |vertex, w| shares[vertex] += w));
    shares
}

/// Calls `visit` with the vertices of a cell that carry corner `c`, and their weights.
fn for_weights(cell: &Cell, hanging: u8, c: usize, mut visit: impl FnMut(usize, f64)) {
    if hanging >> c & 1 == 0 {
        return visit(c, 1.0);
    }
    // The corners of the parent's edge or face between the cell's own corner and the one towards c.
    let own = cell.octant();
    let towards = c ^ own;
    let share = 1.0 / f64::from(1 << towards.count_ones());
    (0..8).filter(|s| s & !towards == 0).for_each(|s| visit(own ^ s, share));
}
