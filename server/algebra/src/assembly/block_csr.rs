//! Sparse matrices of 3×3 blocks in compressed row storage.

use nalgebra::{Matrix3, Vector3};
use scindo_matter::team::{Team, blocks};

/// Rows per task of a parallel product.
const ROWS: usize = 256;

/// A square sparse matrix of 3×3 blocks, one block row per node.
///
/// The columns of a row are sorted, and every row stores its diagonal block.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct BlockCsr<T> {
    /// Block row i is `first[i]..first[i + 1]`; length n_rows + 1.
    pub first: Vec<u32>,
    /// Block column of every block.
    pub columns: Vec<u32>,
    /// The blocks, each row-major: entry (i, j) at 3 i + j.
    pub blocks: Vec<[T; 9]>,
}

impl<T: Copy + Default> BlockCsr<T> {
    /// A zero matrix whose row i has the columns `rows[i]` and the diagonal.
    pub fn with_rows(rows: Vec<Vec<u32>>) -> Self {
        let mut matrix = Self { first: vec![0], ..Self::default() };
        for (i, mut row) in (0u32..).zip(rows) {
            row.push(i);
            row.sort_unstable();
            row.dedup();
            matrix.columns.extend_from_slice(&row);
            matrix.first.push(matrix.columns.len() as u32);
        }
        matrix.blocks = vec![[T::default(); 9]; matrix.columns.len()];
        matrix
    }

    /// Number of block rows.
    pub fn n_rows(&self) -> usize {
        self.first.len().saturating_sub(1)
    }

    /// Range of row `i` in [`columns`](Self::columns) and [`blocks`](Self::blocks).
    #[inline]
    pub fn row(&self, i: usize) -> std::ops::Range<usize> {
        self.first[i] as usize..self.first[i + 1] as usize
    }

    /// Index of block (i, j) in [`blocks`](Self::blocks), if it is stored.
    pub fn position(&self, i: usize, j: u32) -> Option<usize> {
        let row = self.row(i);
        self.columns[row.clone()].binary_search(&j).ok().map(|k| row.start + k)
    }

    /// Sets every block to zero.
    pub fn clear(&mut self) {
        self.blocks.fill([T::default(); 9]);
    }

    /// Whether both matrices store the same blocks (i, j).
    pub fn same_pattern<U>(&self, other: &BlockCsr<U>) -> bool {
        self.first == other.first && self.columns == other.columns
    }
}

impl BlockCsr<f64> {
    /// Block (i, j), zero if it is not stored.
    pub fn block(&self, i: usize, j: u32) -> Matrix3<f64> {
        self.position(i, j).map_or_else(Matrix3::zeros, |k| Matrix3::from_row_slice(&self.blocks[k]))
    }

    /// The diagonal block of row `i`.
    pub fn diagonal(&self, i: usize) -> Matrix3<f64> {
        self.block(i, i as u32)
    }

    /// y = A x.
    pub fn multiply(&self, x: &[Vector3<f64>], y: &mut [Vector3<f64>]) {
        for (i, y) in y.iter_mut().enumerate() {
            *y = self.row_times(i, x);
        }
    }

    /// y = A x on all threads of a team; the same bits as [`multiply`](Self::multiply).
    pub fn multiply_by(&self, team: &mut Team, x: &[Vector3<f64>], y: &mut [Vector3<f64>]) {
        team.for_blocks(blocks(y, ROWS), |block, y| {
            for (i, y) in y.iter_mut().enumerate() {
                *y = self.row_times(block * ROWS + i, x);
            }
        });
    }

    /// Row `i` of A x.
    #[inline(always)]
    pub fn row_times(&self, i: usize, x: &[Vector3<f64>]) -> Vector3<f64> {
        let mut y = [0.0; 3];
        let row = self.row(i);
        for (A, &j) in self.blocks[row.clone()].iter().zip(&self.columns[row]) {
            let x = &x[j as usize];
            for k in 0..3 {
                y[k] += A[3 * k] * x.x + A[3 * k + 1] * x.y + A[3 * k + 2] * x.z;
            }
        }
        y.into()
    }

    /// xᵀ A y.
    pub fn bilinear(&self, x: &[Vector3<f64>], y: &[Vector3<f64>]) -> f64 {
        x.iter().enumerate().map(|(i, x)| x.dot(&self.row_times(i, y))).sum()
    }

    /// A ← A + s B; both have the same pattern.
    pub fn add_scaled(&mut self, s: f64, other: &Self) {
        debug_assert!(self.same_pattern(other));
        for (a, b) in self.blocks.iter_mut().zip(&other.blocks) {
            for (a, b) in a.iter_mut().zip(b) {
                *a += s * b;
            }
        }
    }

    /// A ← A + s diag(d), with d one number per node.
    pub fn add_diagonal(&mut self, s: f64, d: &[f64]) {
        for (i, d) in d.iter().enumerate() {
            self.add_to_diagonal(i, &Matrix3::from_diagonal_element(s * d));
        }
    }

    /// Adds `block` to the diagonal block of row `i`.
    pub fn add_to_diagonal(&mut self, i: usize, block: &Matrix3<f64>) {
        if let Some(k) = self.position(i, i as u32) {
            for r in 0..3 {
                for c in 0..3 {
                    self.blocks[k][3 * r + c] += block[(r, c)];
                }
            }
        }
    }

    /// Rounds to single precision. The pattern is copied only if that of `single` differs.
    pub fn to_f32(&self, single: &mut BlockCsr<f32>) {
        if !self.same_pattern(single) {
            single.first.clone_from(&self.first);
            single.columns.clone_from(&self.columns);
            single.blocks.resize(self.blocks.len(), [0.0; 9]);
        }
        for (s, d) in single.blocks.iter_mut().zip(&self.blocks) {
            *s = d.map(|d| d as f32);
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn sample() -> BlockCsr<f64> {
        let mut A = BlockCsr::with_rows(vec![vec![2, 1, 1], vec![0], vec![0]]);
        for (k, block) in A.blocks.iter_mut().enumerate() {
            *block = std::array::from_fn(|e| (k * 9 + e) as f64);
        }
        A
    }

    #[test]
    fn rows_are_sorted_and_have_their_diagonal() {
        let A = sample();
        assert_eq!(A.first, [0, 3, 5, 7]);
        assert_eq!(A.columns, [0, 1, 2, 0, 1, 0, 2]);
        assert_eq!(A.position(2, 1), None);
        assert_eq!(A.diagonal(1)[(1, 2)], 41.0);
    }

    #[test]
    fn products_agree_with_dense_ones_for_any_team() {
        let A = sample();
        let x = [Vector3::new(1.0, -2.0, 0.5), Vector3::new(0.3, 0.2, 0.1), Vector3::new(2.0, 1.0, -1.0)];
        let (mut y, mut z) = ([Vector3::zeros(); 3], [Vector3::zeros(); 3]);
        A.multiply(&x, &mut y);
        for i in 0..3 {
            let dense: Vector3<f64> = (0..3).map(|j| A.block(i, j) * x[j as usize]).sum();
            assert!((dense - y[i]).norm() < 1e-12);
        }
        A.multiply_by(&mut Team::new(2).unwrap(), &x, &mut z);
        assert_eq!(y, z);
        let mut single = BlockCsr::default();
        A.to_f32(&mut single);
        assert!(A.same_pattern(&single) && single.blocks[6][8] == 62.0);
    }
}
