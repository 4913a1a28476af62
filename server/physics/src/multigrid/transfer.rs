//! Prolongation P and restriction Pᵀ between two levels.
//!
//! A fine vertex moves as its coarse cell does: with the trilinear weights of that cell's corners, and where
//! these hang, of the vertices that carry the cell. Coarse cells that share a fine vertex agree on it.

use super::level::{Level, NONE, place_in, trilinear};
use crate::octree::corner_weights;
use crate::operator::{BLOCK, Padded};
use crate::team::{Team, blocks};

/// P by rows and by columns.
#[derive(Clone, Debug, Default)]
pub struct Transfer {
    rows: Lists,
    columns: Lists,
}

/// Lists of weighted numbers, one after the other.
#[derive(Clone, Debug, Default)]
struct Lists {
    first: Vec<u32>,
    entries: Vec<(u32, f32)>,
}

impl Lists {
    #[inline]
    fn get(&self, i: usize) -> &[(u32, f32)] {
        &self.entries[self.first[i] as usize..self.first[i + 1] as usize]
    }

    /// Σ w v of list `i`.
    #[inline]
    fn sum(&self, i: usize, v: &[Padded]) -> Padded {
        let mut sum = [0.0; 4];
        for &(j, w) in self.get(i) {
            let v = v[j as usize];
            (0..4).for_each(|k| sum[k] += w * v[k]);
        }
        sum
    }

    fn transposed(&self, n: usize) -> Self {
        let mut first = vec![0_u32; n + 1];
        self.entries.iter().for_each(|e| first[e.0 as usize + 1] += 1);
        for i in 0..n {
            first[i + 1] += first[i];
        }
        let mut next = first.clone();
        let mut entries = vec![(0, 0.0); self.entries.len()];
        for i in 0..self.first.len() - 1 {
            for &(j, w) in self.get(i) {
                entries[next[j as usize] as usize] = (i as u32, w);
                next[j as usize] += 1;
            }
        }
        Self { first, entries }
    }
}

impl Transfer {
    /// P from `coarse` to `fine`, whose cell i belongs to the coarse cell `parent[i]`.
    pub fn new(fine: &Level, coarse: &Level, parent: &[u32]) -> Self {
        // One cell and corner for every vertex.
        let mut home = vec![NONE; fine.n_vertices];
        for (slot, &v) in (0u32..).zip(fine.vertices.iter().flatten()) {
            let hangs = fine.hanging[slot as usize / 8] >> (slot % 8) & 1 == 1;
            if !hangs && home[v as usize] == NONE {
                home[v as usize] = slot;
            }
        }
        let mut rows = Lists { first: vec![0], entries: Vec::new() };
        for &slot in &home {
            if slot != NONE {
                let (id, c) = (slot as usize / 8, slot as usize % 8);
                rows.entries.extend(carriers(fine, coarse, parent[id], (id, c)));
            }
            rows.first.push(rows.entries.len() as u32);
        }
        let columns = rows.transposed(coarse.n_vertices);
        Self { rows, columns }
    }

    /// Number of fine vertices.
    #[cfg(test)]
    pub fn n_rows(&self) -> usize {
        self.rows.first.len() - 1
    }

    /// Coarse vertices of fine vertex `v`, and their weights.
    pub fn row(&self, v: usize) -> &[(u32, f32)] {
        self.rows.get(v)
    }

    /// Bytes in use.
    pub fn memory(&self) -> usize {
        let of = |lists: &Lists| size_of_val(&lists.first[..]) + size_of_val(&lists.entries[..]);
        of(&self.rows) + of(&self.columns)
    }

    /// x += P e.
    pub fn prolong(&self, team: &mut Team, e: &[Padded], x: &mut [Padded]) {
        team.for_blocks(blocks(x, BLOCK), |block, x| {
            for (i, x) in x.iter_mut().enumerate() {
                let sum = self.rows.sum(block * BLOCK + i, e);
                (0..4).for_each(|k| x[k] += sum[k]);
            }
        });
    }

    /// b = Pᵀ r.
    pub fn restrict(&self, team: &mut Team, r: &[Padded], b: &mut [Padded]) {
        team.for_blocks(blocks(b, BLOCK), |block, b| {
            for (i, b) in b.iter_mut().enumerate() {
                *b = self.columns.sum(block * BLOCK + i, r);
            }
        });
    }
}

/// Weights of the vertices of coarse cell `parent` in vertex `c` of the fine cell `id`.
pub fn carriers(
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
