//! Prolongation P and restriction Pᵀ between two levels.
//!
//! A fine vertex moves as its coarse cell does: with the trilinear weights of that cell's corners, and where
//! these hang, of the vertices that carry the cell. Coarse cells that share a fine vertex agree on it.

use super::level::{Level, NONE, place_in, trilinear};
use crate::lists::jagged::Jagged;
use crate::octree::corner_weights;
use crate::operator::{BLOCK, Padded};
use crate::team::{Team, blocks};

/// P by rows and by columns.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct Transfer {
    rows: Jagged<(u32, f32)>,
    columns: Jagged<(u32, f32)>,
}

/// Σ w v of a list.
#[inline]
fn sum(list: &[(u32, f32)], v: &[Padded]) -> Padded {
    let mut sum = [0.0; 4];
    for &(j, w) in list {
        let v = v[j as usize];
        (0..4).for_each(|k| sum[k] += w * v[k]);
    }
    sum
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
        let (mut first, mut entries) = (vec![0], Vec::new());
        for &slot in &home {
            if slot != NONE {
                let (id, c) = (slot as usize / 8, slot as usize % 8);
                entries.extend(carriers(fine, coarse, parent[id], (id, c)));
            }
            first.push(entries.len() as u32);
        }
        let rows = Jagged::new(&first, entries);
        let by_column = |visit: &mut dyn FnMut(u32, (u32, f32))| {
            for i in 0..rows.len() {
                rows.get(i).iter().for_each(|&(j, w)| visit(j, (i as u32, w)));
            }
        };
        let columns = Jagged::by_counting(coarse.n_vertices, by_column, (0, 0.0));
        Self { rows, columns }
    }

    /// Follows a cut that changed the rows of the fine `vertices`, ascending.
    pub fn follow(&mut self, fine: &Level, coarse: &Level, parent: &[u32], vertices: &[u32]) {
        self.rows.grow(fine.n_vertices);
        self.columns.grow(coarse.n_vertices);
        let (mut edits, mut row) = (Vec::new(), Vec::new());
        for &v in vertices {
            let stands = |(id, c): &(usize, usize)| fine.hanging[*id] >> c & 1 == 0;
            let home = fine.slots_of(v as usize).find(stands);
            row.clear();
            row.extend(home.into_iter().flat_map(|(id, c)| carriers(fine, coarse, parent[id], (id, c))));
            let known = self.rows.get(v as usize);
            if row != known {
                edits.extend(known.iter().map(|&(j, w)| (j, (v, w), false)));
                edits.extend(row.iter().map(|&(j, w)| (j, (v, w), true)));
                self.rows.set(v as usize, &row);
            }
        }
        self.columns.edit(&mut edits, |entry| entry.0);
    }

    /// Fine vertices that rest on coarse vertex `v`, and their weights.
    #[cfg(test)]
    pub fn column(&self, v: usize) -> &[(u32, f32)] {
        self.columns.get(v)
    }

    /// Number of fine vertices.
    #[cfg(test)]
    pub fn n_rows(&self) -> usize {
        self.rows.len()
    }

    /// Coarse vertices of fine vertex `v`, and their weights.
    pub fn row(&self, v: usize) -> &[(u32, f32)] {
        self.rows.get(v)
    }

    /// Bytes in use.
    pub fn memory(&self) -> usize {
        self.rows.memory() + self.columns.memory()
    }

    /// x += P e.
    pub fn prolong(&self, team: &mut Team, e: &[Padded], x: &mut [Padded]) {
        team.for_blocks(blocks(x, BLOCK), |block, x| {
            for (i, x) in x.iter_mut().enumerate() {
                let sum = sum(self.rows.get(block * BLOCK + i), e);
                (0..4).for_each(|k| x[k] += sum[k]);
            }
        });
    }

    /// b = Pᵀ r.
    pub fn restrict(&self, team: &mut Team, r: &[Padded], b: &mut [Padded]) {
        team.for_blocks(blocks(b, BLOCK), |block, b| {
            for (i, b) in b.iter_mut().enumerate() {
                *b = sum(self.columns.get(block * BLOCK + i), r);
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
