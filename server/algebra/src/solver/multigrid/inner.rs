//! What the inner vertices of [thin](super::thin) cells add to the transfers between levels.

use nalgebra::{Matrix3, Vector3};
use scindo_matter::team::{Team, blocks};

use super::level::{Level, NONE};
use super::matrices::{CellMatrix, LevelMatrices};
use super::step::Step;
use super::thin::INNER;
use crate::operator::Padded;

/// Thin cells per unit of work.
const THIN_BLOCK: usize = 16;

impl LevelMatrices {
    /// Lists the thin cells after an update.
    pub(super) fn list_thin(&mut self) {
        let Self { stored, thin, passed, .. } = self;
        thin.clear();
        let places = (0_u32..).zip(&*stored).filter(|(_, s)| s.cell != NONE && !s.inner.is_empty());
        thin.extend(places.map(|(place, _)| place));
        passed.resize(thin.len(), [[0.0; 4]; INNER]);
    }

    /// x += D e on the inner vertices, beside the trilinear part of the prolongation to this level's finer one.
    pub(super) fn prolong_inner(&mut self, team: &mut Team, level: &Level, e: &[Padded], x: &mut [Padded]) {
        let Self { frame, stored, thin, passed, .. } = self;
        if thin.is_empty() {
            return;
        }
        let (stored, thin) = (&*stored, &*thin);
        team.for_blocks(blocks(passed, THIN_BLOCK), |block, passed| {
            for (i, passed) in passed.iter_mut().enumerate() {
                let of = &stored[thin[block * THIN_BLOCK + i] as usize];
                let R = frame[of.cell as usize].to_rotation_matrix().into_inner();
                let mut u = [0.0; 24];
                for (c, &v) in level.vertices[of.cell as usize].iter().enumerate() {
                    let e = e[v as usize];
                    u[3 * c..3 * c + 3].copy_from_slice(R.tr_mul(&Vector3::new(e[0], e[1], e[2])).as_slice());
                }
                for (passed, rows) in passed.iter_mut().zip(of.inner.change.chunks_exact(3)) {
                    let moved = R * Vector3::from_fn(|k, _| dot(&rows[k], &u));
                    *passed = [moved.x, moved.y, moved.z, 0.0];
                }
            }
        });
        for (&place, passed) in thin.iter().zip(&*passed) {
            for (&v, moved) in stored[place as usize].inner.vertices.iter().zip(passed) {
                (0..3).for_each(|k| x[v as usize][k] += moved[k]);
            }
        }
    }

    /// b += Dᵀ r, beside the trilinear part of the restriction from this level's finer one.
    pub(super) fn restrict_inner(&mut self, team: &mut Team, level: &Level, r: &[Padded], b: &mut [Padded]) {
        let Self { frame, stored, thin, passed, .. } = self;
        if thin.is_empty() {
            return;
        }
        let (stored, thin) = (&*stored, &*thin);
        team.for_blocks(blocks(passed, THIN_BLOCK), |block, passed| {
            for (i, passed) in passed.iter_mut().enumerate() {
                let of = &stored[thin[block * THIN_BLOCK + i] as usize];
                let R = frame[of.cell as usize].to_rotation_matrix().into_inner();
                let mut f = [0.0_f32; 24];
                for (&v, rows) in of.inner.vertices.iter().zip(of.inner.change.chunks_exact(3)) {
                    let r = r[v as usize];
                    let r = R.tr_mul(&Vector3::new(r[0], r[1], r[2]));
                    for (row, r) in rows.iter().zip(r.iter()) {
                        f.iter_mut().zip(row).for_each(|(f, d)| *f += r * d);
                    }
                }
                for c in 0..8 {
                    let f = R * Vector3::new(f[3 * c], f[3 * c + 1], f[3 * c + 2]);
                    passed[c] = [f.x, f.y, f.z, 0.0];
                }
            }
        });
        // One cell after the other: sums do not depend on the number of threads.
        for (&place, passed) in thin.iter().zip(&*passed) {
            for (&v, f) in level.vertices[stored[place as usize].cell as usize].iter().zip(passed) {
                (0..3).for_each(|k| b[v as usize][k] += f[k]);
            }
        }
    }

    /// Calls `visit` with the vertices that carry the coarse cell of fine vertex `v`, and the block of D between them
    /// and `v`, if it is an inner one. `child` is a cell that rests on `v`.
    pub(super) fn for_inner_row(
        &self,
        (level, step): (&Level, &Step),
        (v, child): (u32, usize),
        mut visit: impl FnMut(u32, Matrix3<f32>),
    ) {
        let id = step.parent[child] as usize;
        let CellMatrix::Stored(place) = self.matrix[id] else { return };
        let inner = &self.stored[place as usize].inner;
        let Some(i) = inner.vertices.iter().position(|known| *known == v) else { return };
        let R = self.frame[id].to_rotation_matrix().into_inner();
        for (c, &coarse) in level.vertices[id].iter().enumerate() {
            visit(coarse, inner.block(i, c, &R));
        }
    }
}

/// aᵀb in eight sums, which the compiler computes together.
#[inline]
fn dot(a: &[f32; 24], b: &[f32; 24]) -> f32 {
    let mut sums = [0.0; 8];
    for (a, b) in a.chunks_exact(8).zip(b.chunks_exact(8)) {
        (0..8).for_each(|k| sums[k] += a[k] * b[k]);
    }
    sums.iter().sum()
}
