//! Symmetric 24×24 matrices of single cells.

use nalgebra::{Matrix3, Vector3};

use crate::operator::Held;
use crate::operator::cells::Matrix24;

/// Entries of a packed matrix: the upper triangle by columns.
pub const PACKED: usize = 300;

/// A packed symmetric matrix: entry (i, j), i ≤ j, at j (j + 1)/2 + i.
pub type Packed = [f32; PACKED];

/// Stiffness of a prescribed inclined direction over the largest one of its vertex: far above the rounding of single
/// precision, far below what slows corrections.
const HELD_STIFFNESS: f32 = 1e-3;

/// A matrix by columns; row and column 3 c + i belong to vertex c and component i.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Dense(pub [[f32; 24]; 24]);

impl Default for Dense {
    fn default() -> Self {
        Self([[0.0; 24]; 24])
    }
}

impl Dense {
    /// The matrix that `packed` holds.
    #[inline(always)]
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
    #[inline(always)]
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
    #[inline(always)]
    pub fn rotated(&self, Q: &Matrix3<f32>) -> Self {
        self.times_rotation(Q).transposed().times_rotation(Q)
    }

    /// A Qᵀ.
    #[inline(always)]
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
    #[inline(always)]
    pub fn carried(&self, T: &[[f32; 8]; 8]) -> Self {
        self.times_weights(T).transposed().times_weights(T)
    }

    /// A T.
    #[inline(always)]
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

    #[inline(always)]
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

    /// Filters the prescribed directions of vertex `c`: A ← P A P + s H, with a small stiffness s that keeps the
    /// block definite whatever single precision makes of P A P. More stiffness only makes corrections smaller.
    pub fn filter(&mut self, c: usize, held: &Held) {
        let size = (3 * c..3 * c + 3).map(|r| self.0[r][r]).fold(0.0, f32::max);
        let (P, H) = (held.filter().map(|p| p as f32), held.projection().map(|h| h as f32));
        let own = 3 * c..3 * c + 3;
        for column in &mut self.0 {
            let v = Vector3::from_fn(|k, _| column[3 * c + k]);
            column[own.clone()].copy_from_slice((P * v).as_slice());
        }
        for r in 0..24 {
            let v = P * Vector3::from_fn(|k, _| self.0[3 * c + k][r]);
            (0..3).for_each(|k| self.0[3 * c + k][r] = v[k]);
        }
        for (i, j) in own.clone().flat_map(|i| own.clone().map(move |j| (i, j))) {
            self.0[j][i] += HELD_STIFFNESS * size * H[(i - 3 * c, j - 3 * c)];
        }
    }

    /// Adds `m` to the diagonal of vertex `c`.
    pub fn add_mass(&mut self, c: usize, m: f32) {
        (3 * c..3 * c + 3).for_each(|r| self.0[r][r] += m);
    }

    /// Adds another matrix.
    #[inline(always)]
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

#[inline(always)]
fn add(y: &mut [f32; 24], a: f32, x: &[f32; 24]) {
    y.iter_mut().zip(x).for_each(|(y, x)| *y += a * x);
}
