//! Joins eight leaves into one where the material needs no small cells any more.
//!
//! A coarse leaf is a subspace of its eight parts: vertices vanish, none appear. The numbers of cells and vertices
//! close up in their order, so nothing that is computed with ever meets a vertex without material.
//!
//! # Source
//! Burstedde, Wilcox, Ghattas 2011: p4est, §3 (families, and balance after coarsening). The conditions are those
//! of Dick, Georgii, Westermann 2011, §4.2, read backwards.

use super::build::child_corner;
use super::cells::{Cell, Octree};
use super::change::Leaf;
use super::lattice::{At, OUTSIDE, neighbours};
use crate::element::MaterialPoint;

/// Eight leaves of one level that fill a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Family {
    /// The side of the cell that they fill is 2^level finest cells.
    pub level: u8,
    /// Low corner of that cell, in sides of finest cells.
    pub at: At,
}

/// What a coarsening did to the numbers of cells and vertices. The order of those that stay is kept.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Coarsening {
    /// Families that became one leaf. It has the number of the first, which is the lowest.
    pub joined: usize,
    /// Cells that are new or have other vertices or hanging corners, by their new numbers, ascending.
    pub cells: Vec<u32>,
    /// The leaves that filled their place before, by earlier vertices.
    pub earlier: Vec<Leaf>,
    /// New number of each earlier cell. The first of a family has that of the joined leaf, the others have
    /// [`OUTSIDE`].
    pub cell_of: Vec<u32>,
    /// New number of each earlier vertex, or [`OUTSIDE`] if it vanished.
    pub vertex_of: Vec<u32>,
    /// The vertices that vanished, by their earlier numbers, ascending, and what carries their place in the
    /// material now, by new numbers.
    pub vanished: Vec<(u32, MaterialPoint)>,
}

impl Coarsening {
    /// Keeps the entries of the vertices that stay, in a list with one entry for each earlier vertex.
    pub fn keep<T: Copy>(&self, values: &mut Vec<T>) {
        let mut vertex = self.vertex_of.iter();
        values.retain(|_| vertex.next().is_none_or(|&vertex| vertex != OUTSIDE));
    }

    /// A point of the surface by new numbers of its vertices. One on a vertex that vanished has to be bound anew: its leaf
    /// is among the changed [`cells`](Self::cells).
    pub fn renumbered(&self, point: &MaterialPoint) -> MaterialPoint {
        point.renumbered(|v| Some(self.vertex_of[v as usize]).filter(|v| *v != OUTSIDE).unwrap_or(0))
    }
}

/// A coarsening under way, by earlier numbers.
#[derive(Debug)]
struct Joining {
    /// Per cell whether its vertices or hanging corners changed, and whether it is part of another cell.
    told: Vec<bool>,
    absorbed: Vec<bool>,
    /// The told cells as they were.
    earlier: Vec<Leaf>,
    /// Vertices that vanish, and the leaf inside which they do.
    vanished: Vec<(u32, At, u32)>,
    joined: usize,
}

impl Joining {
    fn tell(&mut self, id: u32, now: Leaf) {
        if !std::mem::replace(&mut self.told[id as usize], true) {
            self.earlier.push(now);
        }
    }
}

impl Octree {
    /// Whether a family may become one leaf: its eight leaves are there, of one material and whole, none is at
    /// the boundary, at another material or at a cut, and 2:1 balance stays.
    pub fn can_join(&self, family: Family) -> bool {
        let Family { level, at } = family;
        let aligned = at.iter().all(|x| x >> level << level == *x);
        if level == 0 || level > self.lattice.levels || !aligned || self.map.leaf(at) == OUTSIDE {
            return false;
        }
        let material = self.cells[self.map.leaf(at) as usize].material;
        let fits = |child: usize| {
            let at = child_corner(at, level, child);
            let leaf = self.map.leaf(at);
            leaf != OUTSIDE && self.cells[leaf as usize] == Cell::new(at, level - 1, material)
        };
        (0..8).all(fits) && self.is_inner(family, material) && self.is_coarse_around(family)
    }

    /// Whether all material next to a family is the same. Leaves beside another one are finest and stay so.
    fn is_inner(&self, Family { level, at }: Family, material: u16) -> bool {
        level > 1
            || (0..8).all(|child| {
                neighbours(child_corner(at, level, child)).iter().all(|&near| {
                    let leaf = self.map.leaf(near);
                    leaf != OUTSIDE && self.cells[leaf as usize].material == material
                })
            })
    }

    /// Whether every leaf that touches a family has half the side of the joined leaf at least.
    fn is_coarse_around(&self, Family { level, at }: Family) -> bool {
        if level < 2 {
            return true;
        }
        // Leaves that touch the family now have a quarter of the side at least.
        let quarter = 1 << (level - 2);
        let inner = |i: i32| (0..4).contains(&i);
        (-1..5).all(|k| {
            (-1..5).all(|j| {
                (-1..5).all(|i| {
                    let near = [at[0] + i * quarter, at[1] + j * quarter, at[2] + k * quarter];
                    let leaf = if inner(i) && inner(j) && inner(k) { OUTSIDE } else { self.map.leaf(near) };
                    leaf == OUTSIDE || self.cells[leaf as usize].level + 1 >= level
                })
            })
        })
    }

    /// Joins these families where that [is allowed](Self::can_join) at their turn, small ones first. `stays`
    /// tells whether a vertex has to stay, given its number and the vertices that would carry its place; a
    /// family with such a vertex stays too.
    pub fn coarsen(
        &mut self,
        families: &[Family],
        stays: &dyn Fn(u32, &MaterialPoint) -> bool,
    ) -> Coarsening {
        let n = self.cells.len();
        let (told, absorbed) = (vec![false; n], vec![false; n]);
        let mut joining = Joining { told, absorbed, earlier: Vec::new(), vanished: Vec::new(), joined: 0 };
        let mut families = families.to_vec();
        families.sort_unstable();
        for family in families {
            if self.can_join(family) && !self.any_stays(family, stays) {
                self.join(family, &mut joining);
            }
        }
        self.close_up(joining)
    }

    /// Calls `visit` with every vertex of a family that vanishes when it is joined, and its lattice point.
    fn for_vanishing(&self, Family { level, at }: Family, mut visit: impl FnMut(u32, At)) {
        let side = 1 << level;
        for child in 0..8 {
            let id = self.map.leaf(child_corner(at, level, child)) as usize;
            for c in (0..8).filter(|c| self.hanging[id] >> c & 1 == 0) {
                let p = self.cells[id].corner(c);
                if !(0..3).all(|k| p[k] == at[k] || p[k] == at[k] + side) {
                    visit(self.vertices[id][c], p);
                }
            }
        }
    }

    /// The eight vertices at the corners of a family; they belong to its leaves, because 2:1 balance lets none
    /// of these corners hang.
    fn corners_of(&self, Family { level, at }: Family) -> [u32; 8] {
        [0, 1, 2, 3, 4, 5, 6, 7].map(|c| self.vertices[self.map.leaf(child_corner(at, level, c)) as usize][c])
    }

    fn any_stays(&self, family: Family, stays: &dyn Fn(u32, &MaterialPoint) -> bool) -> bool {
        let corners = self.corners_of(family);
        let mut any = false;
        self.for_vanishing(family, |vertex, p| {
            let xi = local(&family, p);
            let N = |c: usize| -> f64 {
                (0..3).map(|k| if c >> k & 1 == 1 { xi[k] } else { 1.0 - xi[k] }).product()
            };
            let carriers = (0..8).map(|c| (corners[c], N(c))).filter(|(_, N)| *N != 0.0);
            any |= stays(vertex, &MaterialPoint::new(carriers));
        });
        any
    }

    fn join(&mut self, family: Family, joining: &mut Joining) {
        let Family { level, at } = family;
        let parts = [0, 1, 2, 3, 4, 5, 6, 7].map(|child| self.map.leaf(child_corner(at, level, child)));
        let id = parts[0];
        let first = joining.vanished.len();
        self.for_vanishing(family, |vertex, p| joining.vanished.push((vertex, p, id)));
        // Several parts have a vertex in common.
        let mut new = joining.vanished.split_off(first);
        new.sort_unstable();
        new.dedup();
        joining.vanished.append(&mut new);
        let corners = self.corners_of(family);
        let material = self.cells[id as usize].material;
        for part in parts {
            joining.tell(part, self.now(part));
            joining.absorbed[part as usize] = part != id;
        }
        self.cells[id as usize] = Cell::new(at, level, material);
        (self.vertices[id as usize], self.hanging[id as usize]) = (corners, 0);
        self.map.set(at, level, id);
        joining.joined += 1;
        // Around all 27 points: corners of the leaf, and points inside its edges and faces, where others hang now.
        let half = 1 << (level - 1);
        for k in 0..27 {
            let p = [at[0] + k % 3 * half, at[1] + k / 3 % 3 * half, at[2] + k / 9 * half];
            let octants = self.octants(p);
            let Some(own) = (0..8).find(|&o| octants.leaf[o] == id) else { continue };
            for &leaf in octants.leaf.iter().filter(|leaf| **leaf != OUTSIDE) {
                joining.tell(leaf, self.now(leaf));
            }
            let c = 7 - own;
            let vertex = if self.cells[id as usize].corner(c) == p { corners[c] } else { OUTSIDE };
            self.enter(p, &octants, octants.class[own], vertex);
        }
    }

    /// Drops absorbed cells and vanished vertices, and resolves hanging corners.
    fn close_up(&mut self, mut joining: Joining) -> Coarsening {
        if joining.joined == 0 {
            let numbers = |n: usize| (0..n as u32).collect();
            let (cell_of, vertex_of) = (numbers(self.cells.len()), numbers(self.points.len()));
            return Coarsening { cell_of, vertex_of, ..Coarsening::default() };
        }
        // Corners that hang on a coarse leaf follow the vertices of that leaf.
        let is_left = |id: &usize| joining.told[*id] && !joining.absorbed[*id];
        let changed: Vec<usize> = (0..joining.told.len()).filter(is_left).collect();
        for id in changed {
            let cell = self.cells[id];
            if cell.level > 0 {
                self.for_smaller_around(&cell, |id| joining.tell(id, self.now(id)));
            }
        }
        let Joining { mut told, absorbed, earlier, mut vanished, joined } = joining;
        // Corners are resolved by old numbers, while absorbed cells are still in their places.
        for id in 0..told.len() {
            told[id] &= !absorbed[id];
            if told[id] && self.hanging[id] != 0 {
                self.resolve(id);
            }
        }
        // The leaf in which a vertex vanished may have been joined since.
        vanished.sort_unstable();
        let vertices_before = self.points.len();
        let places: Vec<MaterialPoint> = vanished
            .iter()
            .map(|&(_, p, id)| {
                let cell = self.cells[id as usize];
                let leaf = if absorbed[id as usize] { self.map.leaf(cell.at) } else { id };
                let cell = self.cells[leaf as usize];
                self.point_in(leaf, local(&Family { level: cell.level, at: cell.at }, p))
            })
            .collect();

        // From here on numbers close up; all that needs the old ones has been computed.
        let mut gone = vec![false; vertices_before];
        vanished.iter().for_each(|(vertex, ..)| gone[*vertex as usize] = true);
        let (cell_of, vertex_of) = (numbers_of(&absorbed), numbers_of(&gone));
        let mut cells = Vec::new();
        let mut new = 0;
        for id in (0..absorbed.len()).filter(|&id| !absorbed[id]) {
            let cell = self.cells[id];
            // Cells only move down, over absorbed ones, so nothing is overwritten before it is read.
            if new != id {
                self.cells[new] = cell;
                self.vertices[new] = self.vertices[id];
                self.hanging[new] = self.hanging[id];
                self.map.set(cell.at, cell.level, new as u32);
            }
            self.vertices[new] = self.vertices[new].map(|v| vertex_of[v as usize]);
            if told[id] {
                cells.push(new as u32);
            }
            new += 1;
        }
        self.cells.truncate(new);
        self.vertices.truncate(new);
        self.hanging.truncate(new);
        let mut vertex = vertex_of.iter();
        self.points.retain(|_| vertex.next().is_none_or(|&vertex| vertex != OUTSIDE));
        let renumber = |(&(vertex, ..), place): (&(u32, At, u32), MaterialPoint)| {
            (vertex, place.renumbered(|v| vertex_of[v as usize]))
        };
        let vanished = vanished.iter().zip(places).map(renumber).collect();
        Coarsening { joined, cells, earlier, cell_of, vertex_of, vanished }
    }
}

/// Numbers of the entries that are not marked, in order; [`OUTSIDE`] for the others.
fn numbers_of(marked: &[bool]) -> Vec<u32> {
    let mut next = 0;
    let number = |&marked: &bool| {
        next += u32::from(!marked);
        if marked { OUTSIDE } else { next - 1 }
    };
    marked.iter().map(number).collect()
}

/// Local coordinates 0 … 1 of lattice point `p` in a cell.
fn local(cell: &Family, p: At) -> [f64; 3] {
    let side = f64::from(1u32 << cell.level);
    [0, 1, 2].map(|k| f64::from(p[k] - cell.at[k]) / side)
}
