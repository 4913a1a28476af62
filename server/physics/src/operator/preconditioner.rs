//! The inverse of the 3×3 diagonal blocks, one per copy.

use super::{BLOCK, Block6, FixedCopy, Padded};
use crate::team::{Team, blocks};

/// Block-Jacobi preconditioner M⁻¹: one symmetric positive definite 3×3 matrix per copy.
///
/// It makes the solver blind to the size of pieces: a sliver of 1e-15 of an element has a mass and
/// a stiffness that are small alike.
#[derive(Clone, Debug, Default)]
pub struct BlockJacobi {
    /// Columns of the inverse blocks.
    inverse: Vec<[Padded; 3]>,
}

impl BlockJacobi {
    /// Makes room for `n` copies.
    pub fn resize(&mut self, n: usize) {
        self.inverse.resize(n, [[0.0; 4]; 3]);
    }

    /// Inverts `diagonal`; in the fixed directions of `fixed` the inverse is 0.
    pub fn update(&mut self, team: &mut Team, diagonal: &[Block6], fixed: &[FixedCopy]) {
        team.for_blocks(blocks(&mut self.inverse, BLOCK), |block, inverse| {
            for (inverse, diagonal) in inverse.iter_mut().zip(&diagonal[block * BLOCK..]) {
                *inverse = invert(diagonal, [false; 3]);
            }
        });
        for copy in fixed {
            self.inverse[copy.copy as usize] = invert(&diagonal[copy.copy as usize], copy.axes);
        }
    }

    /// z = M⁻¹ r for one copy.
    #[inline(always)]
    pub fn solve(&self, copy: usize, r: &Padded) -> Padded {
        let [a, b, c] = &self.inverse[copy];
        let mut z = [0.0; 4];
        for i in 0..4 {
            z[i] = a[i] * r[0] + b[i] * r[1] + c[i] * r[2];
        }
        z
    }
}

/// Inverse of a symmetric block by cofactors, scaled by its trace so that pieces of any size stay
/// within single precision; a copy without mass and stiffness does not move.
fn invert(block: &Block6, fixed: [bool; 3]) -> [Padded; 3] {
    let [xx, xy, xz, _, yy, yz, zz, _] = *block;
    let mut a = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]].map(|row| row.map(f64::from));
    let trace = a[0][0] + a[1][1] + a[2][2];
    if !(trace > 0.0 && trace.is_finite()) {
        return [[0.0; 4]; 3];
    }
    for i in 0..3 {
        for j in 0..3 {
            a[i][j] /= trace;
            if fixed[i] || fixed[j] {
                a[i][j] = f64::from(u8::from(i == j));
            }
        }
    }
    let minor = |i: usize, j: usize| {
        let (p, q, r, s) = ((i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3);
        a[p][r] * a[q][s] - a[p][s] * a[q][r]
    };
    let det = a[0][0] * minor(0, 0) + a[0][1] * minor(0, 1) + a[0][2] * minor(0, 2);
    let mut columns = [[0.0; 4]; 3];
    for i in 0..3 {
        for j in 0..3 {
            if !(fixed[i] || fixed[j]) {
                // A block that lost its definiteness to rounding falls back to its trace.
                let inverse = if det > 1e-12 { minor(i, j) / det } else { 3.0 * f64::from(u8::from(i == j)) };
                columns[j][i] = (inverse / trace) as f32;
            }
        }
    }
    columns
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;

    #[test]
    fn inverts_from_planet_to_sliver_and_respects_fixed_axes() {
        for size in [1e20_f32, 1.0, 1e-25] {
            let block = [4.0, 1.0, 0.5, 0.0, 3.0, -0.2, 5.0, 0.0].map(|v| v * size);
            let columns = invert(&block, [false; 3]);
            let A = Matrix3::new(4.0, 1.0, 0.5, 1.0, 3.0, -0.2, 0.5, -0.2, 5.0);
            let B = Matrix3::from_fn(|i, j| columns[j][i] * size);
            assert!((A * B - Matrix3::identity()).norm() < 1e-6);
            let columns = invert(&block, [true, false, false]);
            assert_eq!(columns[0], [0.0; 4]);
            let det = 3.0 * 5.0 - 0.2 * 0.2;
            assert!((columns[1][1] * size - 5.0 / det).abs() < 1e-6);
            assert!((columns[2][1] * size - 0.2 / det).abs() < 1e-6);
        }
    }

    #[test]
    fn nothing_and_nonsense_stay_put() {
        for block in [[0.0; 8], [f32::NAN; 8], [f32::INFINITY; 8], [-1.0; 8]] {
            assert_eq!(invert(&block, [false; 3]), [[0.0; 4]; 3]);
        }
    }
}
