//! Cells, vertices and links of one level.

use std::collections::HashMap;

use scindo_matter::octree::{At, Cell, Octree, parent_corner};
use scindo_matter::storage::disjoint::{find, join};
use scindo_matter::storage::jagged::Jagged;

pub(super) const NONE: u32 = u32::MAX;

/// Two cells that share material across a face: the lower one, the upper one, and the axis between them.
pub(super) type Link = (u32, u32, u8);

/// The cells of one level, and the vertices they rest on.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Level {
    /// Cells; several may be at one position. `cut` is not used.
    pub cells: Vec<Cell>,
    /// Whether each cell is a leaf of the octree and not merged.
    pub leaf: Vec<bool>,
    /// The eight vertices that carry each cell, as in [`Octree::vertices`].
    pub vertices: Vec<[u32; 8]>,
    /// Which corners of each cell hang, one bit per corner.
    pub hanging: Vec<u8>,
    /// Number of vertices.
    pub n_vertices: usize,
    /// 8 · cell + corner, by vertex: where it carries a cell, ascending. Empty on the finest level, unless it is
    /// [asked for](Self::list_slots).
    pub slots: Jagged<u32>,
    /// 8 · cell + direction, by cell: the cells that links lead to. Empty on the finest level, whose links the
    /// octree knows.
    pub links: Jagged<u32>,
}

/// A coarser level, and what it was made of.
#[derive(Debug)]
pub(super) struct Coarsened {
    pub level: Level,
    pub links: Vec<Link>,
    /// The coarse cell of every fine cell.
    pub parent: Vec<u32>,
}

/// These links of `n` cells in ascending order, each once: first by the lower cell, in two passes, then the few of
/// each one.
fn in_order(links: impl Iterator<Item = Link> + Clone, n: usize) -> Vec<Link> {
    let mut first = vec![0_u32; n + 1];
    links.clone().for_each(|(a, ..)| first[a as usize + 1] += 1);
    for i in 0..n {
        first[i + 1] += first[i];
    }
    let mut next = first.clone();
    let mut out = vec![(0, 0, 0); first[n] as usize];
    for link in links {
        let place = &mut next[link.0 as usize];
        out[*place as usize] = link;
        *place += 1;
    }
    for range in first.windows(2) {
        out[range[0] as usize..range[1] as usize].sort_unstable();
    }
    out.dedup();
    out
}

impl Level {
    /// Bytes in use.
    pub(super) fn memory(&self) -> usize {
        size_of_val(&self.cells[..])
            + size_of_val(&self.leaf[..])
            + size_of_val(&self.vertices[..])
            + size_of_val(&self.hanging[..])
            + self.slots.memory()
            + self.links.memory()
    }

    /// The finest level: the leaves of an octree, with its vertices.
    pub(super) fn finest(octree: &Octree) -> (Self, Vec<Link>) {
        let mut links = Vec::new();
        octree.for_links(|low, high, axis| links.push((low, high, axis as u8)));
        let level = Self {
            cells: octree.cells().iter().map(|cell| Cell { cut: 0, ..*cell }).collect(),
            leaf: vec![true; octree.cells().len()],
            vertices: octree.vertices().to_vec(),
            hanging: octree.hanging().to_vec(),
            n_vertices: octree.n_vertices(),
            ..Self::default()
        };
        (level, links)
    }

    /// Merges the cells of side 2^size block by block; larger ones stay as they are.
    ///
    /// Cells of a block become one if links inside the block connect them. Without `duplicates` all cells of a
    /// block become one: the coarse level does not see cuts inside it.
    pub(super) fn coarsened(&self, links: &[Link], size: u8, duplicates: bool) -> Coarsened {
        let block = |id: u32| self.cells[id as usize].at.map(|x| x >> (size + 1));
        let merges = |id: u32| self.cells[id as usize].level == size;
        let mut root: Vec<u32> = (0..self.cells.len() as u32).collect();
        for &(a, b, _) in links {
            if merges(a) && merges(b) && block(a) == block(b) {
                join(&mut root, a, b);
            }
        }
        if !duplicates {
            let mut first: HashMap<At, u32> = HashMap::new();
            for id in (0..self.cells.len() as u32).filter(|&id| merges(id)) {
                let other = *first.entry(block(id)).or_insert(id);
                join(&mut root, other, id);
            }
        }
        // The smallest member represents a component, so coarse cells keep the order of the fine ones.
        let mut parent: Vec<u32> = Vec::with_capacity(self.cells.len());
        let mut level = Self::default();
        for id in 0..self.cells.len() as u32 {
            let first = find(&mut root, id);
            if first < id {
                parent.push(parent[first as usize]);
                continue;
            }
            parent.push(level.cells.len() as u32);
            let cell = self.cells[id as usize];
            if merges(id) {
                let at = cell.at.map(|x| x >> (size + 1) << (size + 1));
                level.cells.push(Cell { at, level: size + 1, ..cell });
                level.leaf.push(false);
            } else {
                level.cells.push(cell);
                level.leaf.push(true);
            }
        }
        let coarse = links.iter().map(|&(a, b, axis)| (parent[a as usize], parent[b as usize], axis));
        let links = in_order(coarse.filter(|&(a, b, _)| a != b), level.cells.len());
        level.number_vertices(&links);
        level.list_slots();
        level.list_links(&links);
        Coarsened { level, links, parent }
    }

    fn list_links(&mut self, links: &[Link]) {
        let by_cell = |visit: &mut dyn FnMut(u32, u32)| {
            for &(low, high, axis) in links {
                let d = 2 * u32::from(axis);
                visit(low, 8 * high + d + 1);
                visit(high, 8 * low + d);
            }
        };
        self.links = Jagged::by_counting(self.cells.len(), by_cell, 0);
    }

    /// Joins corners over linked faces to vertices. Where a larger cell is linked that has the point inside an
    /// edge or a face, the corners hang on that cell.
    ///
    /// Cells that touch larger ones are leaves on every level but the finest, because of 2:1 balance, and links
    /// of leaves that are not finest are never cut. So the vertices of the larger cell are those that the
    /// parent's corners have.
    fn number_vertices(&mut self, links: &[Link]) {
        let slot = |id: u32, c: usize| 8 * id + c as u32;
        let mut root: Vec<u32> = (0..8 * self.cells.len() as u32).collect();
        let mut witnesses: Vec<(u32, u32)> = Vec::new();
        for &(low, high, axis) in links {
            let (a, b) = (self.cells[low as usize], self.cells[high as usize]);
            let bit = 1 << axis;
            if a.level == b.level {
                for c in (0..8).filter(|c| c & bit != 0) {
                    join(&mut root, slot(low, c), slot(high, c ^ bit));
                }
                continue;
            }
            let (small, big, side) = if a.level < b.level { (low, high, bit) } else { (high, low, 0) };
            for c in (0..8).filter(|c| c & bit == side) {
                let p = self.cells[small as usize].corner(c);
                match self.corner_at(big, p) {
                    Some(k) => {
                        join(&mut root, slot(small, c), slot(big, k));
                    }
                    None => witnesses.push((slot(small, c), big)),
                }
            }
        }
        let mut hangs_on = vec![NONE; root.len()];
        for (slot, big) in witnesses {
            let class = find(&mut root, slot) as usize;
            hangs_on[class] = hangs_on[class].min(big);
        }
        let mut number = vec![NONE; root.len()];
        self.vertices = vec![[NONE; 8]; self.cells.len()];
        self.hanging = vec![0; self.cells.len()];
        for id in 0..self.cells.len() {
            for c in 0..8 {
                let class = find(&mut root, slot(id as u32, c)) as usize;
                if hangs_on[class] != NONE {
                    self.hanging[id] |= 1 << c;
                    continue;
                }
                if number[class] == NONE {
                    number[class] = self.n_vertices as u32;
                    self.n_vertices += 1;
                }
                self.vertices[id][c] = number[class];
            }
        }
        for id in 0..self.cells.len() {
            for c in (0..8).filter(|c| self.hanging[id] >> c & 1 == 1) {
                let big = hangs_on[find(&mut root, slot(id as u32, c)) as usize];
                let q = parent_corner(&self.cells[id], c);
                if let Some(k) = self.corner_at(big, q) {
                    self.vertices[id][c] = self.vertices[big as usize][k];
                }
            }
        }
    }

    /// The corner of cell `id` at the lattice point `p`.
    pub(super) fn corner_at(&self, id: u32, p: At) -> Option<usize> {
        self.cells[id as usize].corner_at(p)
    }

    /// Lists the [slots](Self::slots).
    pub(super) fn list_slots(&mut self) {
        let vertices = &self.vertices;
        let slots = |visit: &mut dyn FnMut(u32, u32)| {
            (0u32..).zip(vertices.iter().flatten()).for_each(|(slot, &v)| visit(v, slot));
        };
        self.slots = Jagged::by_counting(self.n_vertices, slots, 0);
    }

    /// Whether the [slots](Self::slots) are listed.
    pub(super) fn has_slots(&self) -> bool {
        !self.slots.is_empty()
    }

    /// Where vertex `v` carries cells: cell and corner.
    #[inline]
    pub(super) fn slots_of(&self, v: usize) -> impl Iterator<Item = (usize, usize)> {
        self.slots.get(v).iter().map(|&slot| (slot as usize / 8, slot as usize % 8))
    }

    /// Lattice point of vertex `c` of cell `id`.
    pub(super) fn vertex_point(&self, id: usize, c: usize) -> At {
        let cell = &self.cells[id];
        if self.hanging[id] >> c & 1 == 1 { parent_corner(cell, c) } else { cell.corner(c) }
    }
}

/// Trilinear weights of the corners of a cell at a point in halves of its side, 0 … 2 along each axis.
pub(super) fn trilinear(at: [i32; 3]) -> [f32; 8] {
    std::array::from_fn(|b| {
        (0..3).map(|k| 0.5 * (if b >> k & 1 == 1 { at[k] } else { 2 - at[k] }) as f32).product()
    })
}

/// Where vertex `c` of the fine cell `id` is in its coarse cell, in halves of the coarse side.
pub(super) fn place_in(fine: &Level, id: usize, c: usize, coarse: &Cell) -> [i32; 3] {
    let p = fine.vertex_point(id, c);
    [0, 1, 2].map(|k| (2 * (p[k] - coarse.at[k])) >> coarse.level)
}
