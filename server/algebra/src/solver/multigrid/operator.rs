//! Products with the operator of a level, and its diagonal blocks.
//!
//! A product has two halves, as everywhere: first every cell computes what it adds to its eight vertices, then the
//! vertices gather it in a fixed order.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use scindo_matter::octree::Cell;

use super::dense::{Rows, at, rows_packed, times, times_at, times_packed};
use super::galerkin::Galerkin;
use super::level::Level;
use super::matrices::{CellMatrix, LevelMatrices};
#[cfg(test)]
use crate::operator::{BLOCK, Inverse3, invert};
use crate::operator::{Block6, Padded};
#[cfg(test)]
use scindo_matter::team::{Team, blocks};

/// Cells per unit of work.
#[cfg(test)]
const CELLS: usize = 64;

/// What every cell adds to its eight vertices.
#[cfg(test)]
pub(super) type CellProducts = Vec<[Padded; 8]>;

/// One level: its cells and their matrices.
#[derive(Clone, Copy, Debug)]
pub(super) struct LevelOperator<'a> {
    /// The cells.
    pub level: &'a Level,
    pub matrices: &'a LevelMatrices,
    /// Matrices of kinds of cells.
    pub shared: &'a [Rows],
}

impl Galerkin {
    /// The operator of level `l`. On the finest level prescribed directions are not filtered out.
    pub(super) fn operator<'a>(&'a self, level: &'a Level, l: usize) -> LevelOperator<'a> {
        LevelOperator { level, matrices: &self.levels[l], shared: &self.rows }
    }
}

impl LevelOperator<'_> {
    /// y = A x, cell by cell: what the kernels are tested against. `products` is scratch with one entry per cell.
    #[cfg(test)]
    pub(super) fn apply(&self, team: &mut Team, x: &[Padded], y: &mut [Padded], products: &mut CellProducts) {
        team.for_blocks(blocks(products, CELLS), |block, products| {
            for (i, product) in products.iter_mut().enumerate() {
                *product = self.product(block * CELLS + i, x);
            }
        });
        let products = &*products;
        team.for_blocks(blocks(y, BLOCK), |block, y| {
            for (i, y) in y.iter_mut().enumerate() {
                let v = block * BLOCK + i;
                let mass = self.matrices.mass[v];
                *y = x[v].map(|x| mass * x);
                for (cell, c) in self.level.slots_of(v) {
                    let part = &products[cell][c];
                    (0..3).for_each(|k| y[k] += part[k]);
                }
            }
        });
    }

    /// What cell `id` adds to its vertices, lumped mass of leaves not included.
    #[inline]
    fn product(&self, id: usize, x: &[Padded]) -> [Padded; 8] {
        let R = matrix(&self.matrices.frame[id]);
        let vertices = &self.level.vertices[id];
        let mut u = vertices.map(|v| x[v as usize]);
        let f = match self.matrices.matrix[id] {
            CellMatrix::Stored(place) => {
                times_packed(&self.matrices.stored[place as usize].matrix, &into_frame(&R, &u))
            }
            CellMatrix::Shared(kind) => {
                self.interpolate(id, &mut u);
                times(&self.shared[kind as usize], &into_frame(&R, &u))
            }
        };
        let mut f = out_of_frame(&R, &f);
        if matches!(self.matrices.matrix[id], CellMatrix::Shared(_)) {
            self.distribute(id, &mut f);
        }
        f
    }

    /// Corners from vertices.
    #[inline]
    fn interpolate(&self, id: usize, u: &mut [Padded; 8]) {
        let hanging = self.level.hanging[id];
        if hanging != 0 {
            let known = *u;
            for_hanging(&self.level.cells[id], hanging, |c, between, share| {
                u[c] = [0.0; 4];
                between.for_each(|b| (0..3).for_each(|k| u[c][k] += share * known[b][k]));
            });
        }
    }

    /// Vertices from corners, the transpose.
    #[inline]
    fn distribute(&self, id: usize, f: &mut [Padded; 8]) {
        let hanging = self.level.hanging[id];
        if hanging != 0 {
            let known = *f;
            for_hanging(&self.level.cells[id], hanging, |c, _, _| f[c] = [0.0; 4]);
            for_hanging(&self.level.cells[id], hanging, |c, between, share| {
                between.for_each(|b| (0..3).for_each(|k| f[b][k] += share * known[c][k]));
            });
        }
    }

    /// A x at vertex `v` alone.
    pub(super) fn row(&self, v: usize, x: &[Padded]) -> [f32; 3] {
        let mass = self.matrices.mass[v];
        let mut sum = [0, 1, 2].map(|k| mass * x[v][k]);
        for (id, c) in self.level.slots_of(v) {
            // Stored matrices are over the vertices themselves, whether corners hang or not.
            let interpolates =
                self.level.hanging[id] != 0 && matches!(self.matrices.matrix[id], CellMatrix::Shared(_));
            let part = if interpolates {
                let [a, b, d, _] = self.product(id, x)[c];
                [a, b, d]
            } else {
                self.corner_product(id, c, x)
            };
            (0..3).for_each(|k| sum[k] += part[k]);
        }
        sum
    }

    fn corner_product(&self, id: usize, c: usize, x: &[Padded]) -> [f32; 3] {
        let R = matrix(&self.matrices.frame[id]);
        let u = into_frame(&R, &self.level.vertices[id].map(|v| x[v as usize]));
        let f = match self.matrices.matrix[id] {
            CellMatrix::Stored(place) => rows_packed(&self.matrices.stored[place as usize].matrix, c, &u),
            CellMatrix::Shared(kind) => times_at(&self.shared[kind as usize], c, &u),
        };
        (R * Vector3::from(f)).into()
    }

    /// Inverses of the diagonal blocks; 0 in directions without stiffness and mass. `fixed` gives the prescribed
    /// directions of a vertex, one bit each. What the kernels are tested against.
    #[cfg(test)]
    pub(super) fn invert_diagonal(
        &self,
        team: &mut Team,
        fixed: impl Fn(usize) -> u8 + Sync,
        out: &mut [Inverse3],
    ) {
        team.for_blocks(blocks(out, BLOCK), |block, out| {
            for (i, out) in out.iter_mut().enumerate() {
                let v = block * BLOCK + i;
                let block = self.diagonal(v);
                let fixed = fixed(v);
                let held = [(0, 0), (1, 4), (2, 6)].map(|(k, at)| fixed >> k & 1 == 1 || block[at] == 0.0);
                *out = invert(&block, held);
            }
        });
    }

    /// Diagonal block of vertex `v`.
    pub(super) fn diagonal(&self, v: usize) -> Block6 {
        let mut sum = Matrix3::identity() * self.matrices.mass[v];
        for (id, c) in self.level.slots_of(v) {
            let R = matrix(&self.matrices.frame[id]);
            let hanging = self.level.hanging[id];
            let block = match self.matrices.matrix[id] {
                CellMatrix::Stored(place) => {
                    let A = &self.matrices.stored[place as usize].matrix;
                    Matrix3::from_fn(|i, j| A[at(3 * c + i, 3 * c + j)])
                }
                CellMatrix::Shared(kind) => {
                    let A = &self.shared[kind as usize];
                    if hanging == 0 {
                        block_of(A, c, c)
                    } else {
                        let mut weights = [0.0; 8];
                        weights[c] = f32::from(u8::from(hanging >> c & 1 == 0));
                        for_hanging(&self.level.cells[id], hanging, |corner, mut between, share| {
                            if between.any(|b| b == c) {
                                weights[corner] = share;
                            }
                        });
                        let mut block = Matrix3::zeros();
                        for (a, wa) in weights.iter().enumerate().filter(|(_, w)| **w != 0.0) {
                            for (b, wb) in weights.iter().enumerate().filter(|(_, w)| **w != 0.0) {
                                block += block_of(A, a, b) * (wa * wb);
                            }
                        }
                        block
                    }
                }
            };
            sum += R * block * R.transpose();
        }
        let s = |i: usize, j: usize| sum[(i, j)];
        [s(0, 0), s(0, 1), s(0, 2), 0.0, s(1, 1), s(1, 2), s(2, 2), 0.0]
    }
}

/// Calls `visit` with every hanging corner, the vertices between which it lies, and the weight of each.
#[inline]
fn for_hanging(cell: &Cell, hanging: u8, mut visit: impl FnMut(usize, Between, f32)) {
    let own = cell.octant();
    for c in (0..8).filter(|c| hanging >> c & 1 == 1) {
        let towards = c ^ own;
        visit(c, Between { own, towards, next: 0 }, 1.0 / (1 << towards.count_ones()) as f32);
    }
}

/// The corners of the parent's edge or face between `own` and `own ^ towards`.
struct Between {
    own: usize,
    towards: usize,
    next: usize,
}

impl Iterator for Between {
    type Item = usize;

    fn next(&mut self) -> Option<usize> {
        while self.next < 8 {
            let s = self.next;
            self.next += 1;
            if s & !self.towards == 0 {
                return Some(self.own ^ s);
            }
        }
        None
    }
}

/// Block of vertices `a` and `b`.
fn block_of(A: &Rows, a: usize, b: usize) -> Matrix3<f32> {
    Matrix3::from_fn(|i, j| A[3 * a + i][3 * b + j])
}

#[inline]
fn matrix(frame: &UnitQuaternion<f32>) -> Matrix3<f32> {
    frame.to_rotation_matrix().into_inner()
}

/// Rᵀ u of every vertex.
#[inline]
fn into_frame(R: &Matrix3<f32>, u: &[Padded; 8]) -> [f32; 24] {
    let mut out = [0.0; 24];
    for (c, u) in u.iter().enumerate() {
        for k in 0..3 {
            out[3 * c + k] = R[(0, k)] * u[0] + R[(1, k)] * u[1] + R[(2, k)] * u[2];
        }
    }
    out
}

/// R f of every vertex.
#[inline]
fn out_of_frame(R: &Matrix3<f32>, f: &[f32; 24]) -> [Padded; 8] {
    std::array::from_fn(|c| {
        let f = &f[3 * c..3 * c + 3];
        let row = |i: usize| R[(i, 0)] * f[0] + R[(i, 1)] * f[1] + R[(i, 2)] * f[2];
        [row(0), row(1), row(2), 0.0]
    })
}
