//! Prolongation P and restriction Pᵀ between two levels.
//!
//! A fine vertex moves as its coarse cell does: with the trilinear weights of that cell's corners, and where
//! these hang, of the vertices that carry the cell. Coarse cells that share a fine vertex agree on it. Inner vertices
//! of [thin](super::thin) cells move otherwise; what comes to their trilinear weights is kept there.

use scindo_matter::octree::corner_weights;
use scindo_matter::storage::bits::Bits;
use scindo_matter::storage::jagged::Jagged;
use scindo_matter::team::{Team, blocks};

use super::level::{Level, NONE, place_in, trilinear};
use crate::operator::{BLOCK, Padded};

/// Weights are multiples of 1/32: trilinear ones of 1/8, and a hanging corner divides them among up to four vertices.
const PARTS: f32 = 32.0;
/// Bits of an entry that hold its weight.
const WEIGHT_BITS: u32 = 5;
/// Vertices of a level that has coarser ones, at most: the other bits hold their numbers.
pub(super) const MOST_VERTICES: usize = 1 << (u32::BITS - WEIGHT_BITS);

/// A vertex and its weight, exactly: number · 32 + 32 · weight − 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
struct Entry(u32);

impl Entry {
    fn new((vertex, weight): (u32, f32)) -> Self {
        let entry = Self(vertex << WEIGHT_BITS | ((PARTS * weight) as u32 - 1));
        debug_assert!((entry.vertex(), entry.weight()) == (vertex, weight), "{vertex}: {weight}");
        entry
    }

    #[inline]
    fn vertex(self) -> u32 {
        self.0 >> WEIGHT_BITS
    }

    #[inline]
    fn weight(self) -> f32 {
        ((self.0 & ((1 << WEIGHT_BITS) - 1)) + 1) as f32 / PARTS
    }
}

/// P by rows and by columns.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Transfer {
    rows: Jagged<Entry>,
    columns: Jagged<Entry>,
}

/// Σ w v of a list.
#[inline]
fn sum(list: &[Entry], v: &[Padded]) -> Padded {
    let mut sum = [0.0; 4];
    for entry in list {
        let (v, w) = (v[entry.vertex() as usize], entry.weight());
        (0..4).for_each(|k| sum[k] += w * v[k]);
    }
    sum
}

impl Transfer {
    /// P from `coarse` to `fine`, whose cell i belongs to the coarse cell `parent[i]`.
    pub(super) fn new(fine: &Level, coarse: &Level, parent: &[u32]) -> Self {
        // One cell and corner for every vertex.
        let mut home = vec![NONE; fine.n_vertices];
        for (slot, &v) in (0u32..).zip(fine.vertices.iter().flatten()) {
            let hangs = fine.hanging[slot as usize / 8] >> (slot % 8) & 1 == 1;
            if !hangs && home[v as usize] == NONE {
                home[v as usize] = slot;
            }
        }
        let (mut first, mut entries) = (vec![0], Vec::new());
        for &slot in &home {
            if slot != NONE {
                let (id, c) = (slot as usize / 8, slot as usize % 8);
                entries.extend(carriers(fine, coarse, parent[id], (id, c)).map(Entry::new));
            }
            first.push(entries.len() as u32);
        }
        let rows = Jagged::new(&first, entries);
        let by_column = |visit: &mut dyn FnMut(u32, Entry)| {
            for i in 0..rows.len() {
                rows.get(i).iter().for_each(|e| visit(e.vertex(), Entry::new((i as u32, e.weight()))));
            }
        };
        let columns = Jagged::by_counting(coarse.n_vertices, by_column, Entry::default());
        Self { rows, columns }
    }

    /// Follows a cut that moved the fine `cells`, or the coarse ones that they belong to.
    pub(super) fn follow(
        &mut self,
        fine: &Level,
        coarse: &Level,
        parent: &[u32],
        cells: impl Iterator<Item = u32>,
    ) {
        self.rows.grow(fine.n_vertices);
        self.columns.grow(coarse.n_vertices);
        let mut moved = Bits::new(fine.cells.len());
        moved.extend(cells);
        let stands = |(id, c): &(u32, usize)| fine.hanging[*id as usize] >> c & 1 == 0;
        let corners = moved.iter().flat_map(|id| (0..8).map(move |c| (id, c))).filter(stands);
        let mut done = Bits::new(fine.n_vertices);
        let (mut edits, mut row) = (Vec::new(), Vec::new());
        // One cell and corner for every vertex: the first of these cells.
        for (id, c) in corners {
            let (id, v) = (id as usize, fine.vertices[id as usize][c]);
            if !done.insert(v) {
                continue;
            }
            row.clear();
            row.extend(carriers(fine, coarse, parent[id], (id, c)).map(Entry::new));
            let known = self.rows.get(v as usize);
            if row != known {
                let at_column = |e: &Entry| (e.vertex(), Entry::new((v, e.weight())));
                edits.extend(known.iter().map(at_column).map(|(j, entry)| (j, entry, false)));
                edits.extend(row.iter().map(at_column).map(|(j, entry)| (j, entry, true)));
                self.rows.set(v as usize, &row);
            }
        }
        self.columns.edit(&edits, |entry| entry.vertex());
    }

    /// Fine vertices that rest on coarse vertex `v`, and their weights.
    #[cfg(test)]
    pub(super) fn column(&self, v: usize) -> impl ExactSizeIterator<Item = (u32, f32)> {
        self.columns.get(v).iter().map(|e| (e.vertex(), e.weight()))
    }

    /// Number of fine vertices.
    #[cfg(test)]
    pub(super) fn n_rows(&self) -> usize {
        self.rows.len()
    }

    /// Coarse vertices of fine vertex `v`, and their weights.
    pub(super) fn row(&self, v: usize) -> impl ExactSizeIterator<Item = (u32, f32)> {
        self.rows.get(v).iter().map(|e| (e.vertex(), e.weight()))
    }

    /// Bytes in use.
    pub(super) fn memory(&self) -> usize {
        self.rows.memory() + self.columns.memory()
    }

    /// x = P e.
    pub(super) fn prolong(&self, team: &mut Team, e: &[Padded], x: &mut [Padded]) {
        team.for_blocks(blocks(x, BLOCK), |block, x| {
            for (i, x) in x.iter_mut().enumerate() {
                *x = sum(self.rows.get(block * BLOCK + i), e);
            }
        });
    }

    /// b = Pᵀ r.
    pub(super) fn restrict(&self, team: &mut Team, r: &[Padded], b: &mut [Padded]) {
        team.for_blocks(blocks(b, BLOCK), |block, b| {
            for (i, b) in b.iter_mut().enumerate() {
                *b = sum(self.columns.get(block * BLOCK + i), r);
            }
        });
    }
}

/// Weights of the vertices of coarse cell `parent` in vertex `c` of the fine cell `id`.
pub(super) fn carriers(
    fine: &Level,
    coarse: &Level,
    parent: u32,
    (id, c): (usize, usize),
) -> impl Iterator<Item = (u32, f32)> {
    let parent = parent as usize;
    let cell = &coarse.cells[parent];
    let mut weights = trilinear(place_in(fine, id, c, cell));
    if coarse.hanging[parent] != 0 {
        let of_corners = std::mem::replace(&mut weights, [0.0; 8]);
        for (row, N) in corner_weights(cell, coarse.hanging[parent]).iter().zip(of_corners) {
            weights.iter_mut().zip(row).for_each(|(w, r)| *w += N * *r as f32);
        }
    }
    coarse.vertices[parent].into_iter().zip(weights).filter(|(_, w)| *w != 0.0)
}
