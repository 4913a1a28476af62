//! Symmetric 24×24 matrices of single cells.

use nalgebra::Matrix3;

use crate::operator::cells::Matrix24;

/// Entries of a packed matrix: the upper triangle by columns.
pub const PACKED: usize = 300;

/// A packed symmetric matrix: entry (i, j), i ≤ j, at j (j + 1)/2 + i.
pub type Packed = [f32; PACKED];

/// A matrix by columns; row and column 3 c + i belong to vertex c and component i.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dense(pub [[f32; 24]; 24]);

impl Default for Dense {
    fn default() -> Self {
        Self([[0.0; 24]; 24])
    }
}

impl Dense {
    /// The matrix that `packed` holds.
    pub fn unpacked(packed: &Packed) -> Self {
        let mut out = Self::default();
        let mut entry = 0;
        for j in 0..24 {
            for i in 0..=j {
                (out.0[j][i], out.0[i][j]) = (packed[entry], packed[entry]);
                entry += 1;
            }
        }
        out
    }

    /// The same in double precision.
    pub fn wide(&self) -> Matrix24 {
        self.0.map(|column| column.map(f64::from))
    }

    /// Its upper triangle.
    pub fn packed(&self) -> Packed {
        let mut out = [0.0; PACKED];
        let mut entry = 0;
        for j in 0..24 {
            out[entry..=entry + j].copy_from_slice(&self.0[j][..=j]);
            entry += j + 1;
        }
        out
    }

    /// Q A Qᵀ, with the rotation `Q` on every vertex.
    pub fn rotated(&self, Q: &Matrix3<f32>) -> Self {
        self.times_rotation(Q).transposed().times_rotation(Q)
    }

    /// A Qᵀ.
    fn times_rotation(&self, Q: &Matrix3<f32>) -> Self {
        let mut out = Self::default();
        for c in 0..8 {
            for k in 0..3 {
                for l in 0..3 {
                    add(&mut out.0[3 * c + k], Q[(k, l)], &self.0[3 * c + l]);
                }
            }
        }
        out
    }

    /// Tᵀ A T, where row c of `T` has the weights of the new vertices in the old vertex c.
    pub fn carried(&self, T: &[[f32; 8]; 8]) -> Self {
        self.times_weights(T).transposed().times_weights(T)
    }

    /// A T.
    fn times_weights(&self, T: &[[f32; 8]; 8]) -> Self {
        let mut out = Self::default();
        for (c, row) in T.iter().enumerate() {
            for (b, &w) in row.iter().enumerate().filter(|(_, w)| **w != 0.0) {
                for k in 0..3 {
                    add(&mut out.0[3 * b + k], w, &self.0[3 * c + k]);
                }
            }
        }
        out
    }

    fn transposed(&self) -> Self {
        let mut out = Self::default();
        for j in 0..24 {
            for i in 0..24 {
                out.0[i][j] = self.0[j][i];
            }
        }
        out
    }

    /// Sets rows and columns of the `fixed` components of vertex `c` to 0.
    pub fn hold(&mut self, c: usize, fixed: u8) {
        for r in (0..3).filter(|i| fixed >> i & 1 == 1).map(|i| 3 * c + i) {
            self.0[r] = [0.0; 24];
            self.0.iter_mut().for_each(|column| column[r] = 0.0);
        }
    }

    /// Adds `m` to the diagonal of vertex `c`.
    pub fn add_mass(&mut self, c: usize, m: f32) {
        (3 * c..3 * c + 3).for_each(|r| self.0[r][r] += m);
    }

    /// Adds another matrix.
    pub fn add(&mut self, other: &Self) {
        self.0.iter_mut().zip(&other.0).for_each(|(a, b)| add(a, 1.0, b));
    }

    /// A u.
    #[inline]
    pub fn times(&self, u: &[f32; 24]) -> [f32; 24] {
        let mut out = [0.0; 24];
        for j in 0..24 {
            add(&mut out, u[j], &self.0[j]);
        }
        out
    }

    /// Block of vertices `a` and `b`.
    pub fn block(&self, a: usize, b: usize) -> Matrix3<f32> {
        Matrix3::from_fn(|i, j| self.0[3 * b + j][3 * a + i])
    }
}

/// A u of a packed matrix.
#[inline]
pub fn times_packed(A: &Packed, u: &[f32; 24]) -> [f32; 24] {
    let mut out = [0.0; 24];
    let mut first = 0;
    for j in 0..24 {
        let column = &A[first..=first + j];
        let mut sum = 0.0;
        for i in 0..j {
            out[i] += u[j] * column[i];
            sum += u[i] * column[i];
        }
        out[j] += sum + u[j] * column[j];
        first += j + 1;
    }
    out
}

/// Rows 3 c … 3 c + 2 of A u of a packed matrix.
#[inline]
pub fn rows_packed(A: &Packed, c: usize, u: &[f32; 24]) -> [f32; 3] {
    [0, 1, 2].map(|i| {
        let r = 3 * c + i;
        (0..24).map(|j| A[at(r.min(j), r.max(j))] * u[j]).sum()
    })
}

/// Place of entry (i, j), i ≤ j, of a packed matrix.
pub const fn at(i: usize, j: usize) -> usize {
    j * (j + 1) / 2 + i
}

#[inline]
fn add(y: &mut [f32; 24], a: f32, x: &[f32; 24]) {
    y.iter_mut().zip(x).for_each(|(y, x)| *y += a * x);
}
