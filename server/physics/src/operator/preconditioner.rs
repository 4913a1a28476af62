//! The inverse of the 3×3 diagonal blocks, one per copy; on degenerate elements in variables in which
//! they are not stiff.

use nalgebra::Matrix3;

use super::{
    BLOCK, Block6, FixedCopy, Held, Iterate, LinearOperator, Padded, Preconditioner, Substitution, Sum,
    block_of, rows,
};
use crate::storage::reserve::resize_reserving;
use crate::team::{Team, blocks};

/// Block-Jacobi preconditioner M⁻¹: one symmetric positive definite 3×3 matrix per copy.
///
/// It makes the solver insensitive to the size of pieces: mass and stiffness of a sliver of 1e-15 of an
/// element are equally small. With a substitution T the blocks are those of TᵀA T, and the preconditioner
/// is T M⁻¹ Tᵀ; residuals are kept as Tᵀr.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct BlockJacobi {
    inverse: Vec<Inverse3>,
    substitution: Substitution,
}

/// The inverse of one symmetric 3×3 block in 32 bytes, which a step streams through once per iteration:
/// rows (xx, xy, yy, 0) and (xz, yz, zz, 0), so that a shuffle of the two is a column.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Inverse3(pub [Padded; 2]);

impl Inverse3 {
    /// M⁻¹ r.
    #[inline(always)]
    pub fn times(&self, r: &Padded) -> Padded {
        // Written as three scaled columns, the form that suits a vector unit.
        let column = |j: usize| -> Padded { self.columns()[j].map(|m| m * r[j]) };
        let (a, b, c) = (column(0), column(1), column(2));
        std::array::from_fn(|i| a[i] + b[i] + c[i])
    }

    /// The columns of M⁻¹.
    #[inline(always)]
    pub fn columns(&self) -> [Padded; 3] {
        let [[xx, xy, yy, _], [xz, yz, zz, _]] = self.0;
        [[xx, xy, xz, 0.0], [xy, yy, yz, 0.0], [xz, yz, zz, 0.0]]
    }
}

impl BlockJacobi {
    /// Makes room for `n` copies.
    pub fn resize(&mut self, n: usize) {
        resize_reserving(&mut self.inverse, n, Inverse3::default());
    }

    /// Changes the variables of the blocks: inverses written from now on must be those of TᵀA T.
    pub fn set_substitution(&mut self, substitution: Substitution) {
        self.substitution = substitution;
    }

    /// The substitution T; empty for T = 1.
    #[inline]
    pub fn substitution(&self) -> &Substitution {
        &self.substitution
    }

    /// The inverses.
    #[inline]
    pub fn inverses(&self) -> &[Inverse3] {
        &self.inverse
    }

    /// The inverses, to be written block by block with [`invert`] and [`Self::set`].
    pub fn inverses_mut(&mut self) -> &mut [Inverse3] {
        &mut self.inverse
    }

    /// Inverts the block `diagonal` of one copy; in the directions `held` the inverse is 0.
    pub fn set(&mut self, copy: usize, diagonal: &Block6, held: Held) {
        self.inverse[copy] = invert_free(diagonal, held);
    }

    /// Inverts `diagonal`; in the fixed directions of `fixed` the inverse is 0.
    pub fn update(&mut self, team: &mut Team, diagonal: &[Block6], fixed: &[FixedCopy]) {
        team.for_blocks(blocks(&mut self.inverse, BLOCK), |block, inverse| {
            for (inverse, diagonal) in inverse.iter_mut().zip(&diagonal[block * BLOCK..]) {
                *inverse = invert(diagonal, [false; 3]);
            }
        });
        for copy in fixed {
            self.inverse[copy.copy as usize] = invert_free(&diagonal[copy.copy as usize], copy.held);
        }
    }

    /// Inverses of the copies of one block of the vector loops.
    #[inline(always)]
    pub fn block(&self, block: usize) -> &[Inverse3] {
        &self.inverse[block * BLOCK..((block + 1) * BLOCK).min(self.inverse.len())]
    }
}

impl Preconditioner for BlockJacobi {
    fn enter(&self, r: &mut [Padded]) {
        self.substitution.fold(r);
    }

    fn apply(
        &mut self,
        team: &mut Team,
        _: &mut dyn LinearOperator,
        r: &[Padded],
        z: &mut [Padded],
        partial: &mut [f64],
    ) -> f64 {
        let M = &*self;
        team.for_blocks((blocks(z, BLOCK), blocks(partial, 1)), |block, (z, partial)| {
            partial[0] = rows::precondition(M.block(block), block_of(r, block), z);
        });
        self.substitution.unfold(z);
        partial.iter().sum()
    }

    fn advance(
        &mut self,
        team: &mut Team,
        _: &mut dyn LinearOperator,
        (alpha, pq): (f32, [&[Padded]; 2]),
        iterate: Iterate<'_>,
    ) -> f64 {
        let Iterate { x, r, z, partial } = iterate;
        let M = &*self;
        let state = (blocks(x, BLOCK), blocks(r, BLOCK), blocks(z, BLOCK), blocks(partial, 1));
        team.for_blocks(state, |block, (x, r, z, partial)| {
            let pq = pq.map(|v| block_of(v, block));
            partial[0] = rows::advance_solution(alpha, pq, M.block(block), [x, r, z]);
        });
        self.substitution.unfold(z);
        partial.iter().sum()
    }

    fn norm(
        &mut self,
        team: &mut Team,
        _: &mut dyn LinearOperator,
        v: &[Padded],
        z: &mut [Padded],
        partial: &mut [f64],
    ) -> f64 {
        let v = if self.substitution.is_empty() {
            v
        } else {
            z.copy_from_slice(v);
            self.substitution.fold(z);
            z
        };
        let M = &*self;
        team.for_blocks(blocks(partial, 1), |block, partial| {
            let mut sum = Sum::default();
            for (v, M) in block_of(v, block).iter().zip(M.block(block)) {
                sum.add(v, &M.times(v));
            }
            partial[0] = sum.total();
        });
        partial.iter().sum::<f64>().max(0.0).sqrt()
    }
}

/// Below this trace the inverse would leave single precision; nothing visible is as light.
const LEAST_TRACE: f64 = 1e-34;

/// Inverse of a symmetric block by cofactors, scaled by its trace so that pieces of any size stay
/// within single precision; a copy without mass and stiffness does not move.
#[inline]
pub fn invert(block: &Block6, fixed: [bool; 3]) -> Inverse3 {
    let [xx, xy, xz, _, yy, yz, zz, _] = block.map(f64::from);
    let trace = xx + yy + zz;
    if !(trace > LEAST_TRACE && trace.is_finite()) {
        return Inverse3::default();
    }
    let s = 1.0 / trace;
    let [xx, xy, xz, yy, yz, zz] = hold([xx, xy, xz, yy, yz, zz].map(|v| v * s), fixed, 1.0);
    // Cofactors; a block that lost its definiteness to rounding falls back to its trace.
    let (cxx, cxy, cxz) = (yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy);
    let (cyy, cyz, czz) = (xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy);
    let det = xx * cxx + xy * cxy + xz * cxz;
    let inverse = if det > 1e-12 {
        let t = s / det;
        [cxx, cxy, cxz, cyy, cyz, czz].map(|c| (c * t) as f32)
    } else {
        let d = (3.0 * s) as f32;
        [d, 0.0, 0.0, d, 0.0, d]
    };
    let [xx, xy, xz, yy, yz, zz] = hold(inverse, fixed, 0.0);
    Inverse3([[xx, xy, yy, 0.0], [xz, yz, zz, 0.0]])
}

/// Inverse of a symmetric block in the free directions, 0 in those of `held`: P (P A P + s H)⁻¹ P.
pub fn invert_free(block: &Block6, held: Held) -> Inverse3 {
    if let Some(axes) = held.axes() {
        return invert(block, axes);
    }
    let [xx, xy, xz, _, yy, yz, zz, _] = block.map(f64::from);
    let trace = xx + yy + zz;
    if !(trace > LEAST_TRACE && trace.is_finite()) {
        return Inverse3::default();
    }
    let A = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz) / trace;
    let definite = held.filter_block(&A, 1.0).cholesky().map(|factor| factor.inverse());
    let inverse = definite.unwrap_or(Matrix3::identity() * 3.0) / trace;
    let M = held.filter_block(&inverse, 0.0).map(|m| m as f32);
    Inverse3([[M.m11, M.m12, M.m22, 0.0], [M.m13, M.m23, M.m33, 0.0]])
}

/// A symmetric block (xx, xy, xz, yy, yz, zz) without the rows and columns of the fixed directions, which
/// have this diagonal instead.
#[inline(always)]
fn hold<T: Copy + From<u8>>(
    [mut xx, mut xy, mut xz, mut yy, mut yz, mut zz]: [T; 6],
    fixed: [bool; 3],
    diagonal: T,
) -> [T; 6] {
    let zero = T::from(0);
    if fixed[0] {
        (xx, xy, xz) = (diagonal, zero, zero);
    }
    if fixed[1] {
        (yy, xy, yz) = (diagonal, zero, zero);
    }
    if fixed[2] {
        (zz, xz, yz) = (diagonal, zero, zero);
    }
    [xx, xy, xz, yy, yz, zz]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inverts_from_planet_to_sliver_and_respects_fixed_axes() {
        for size in [1e20_f32, 1.0, 1e-25] {
            let block = [4.0, 1.0, 0.5, 0.0, 3.0, -0.2, 5.0, 0.0].map(|v| v * size);
            let columns = invert(&block, [false; 3]).columns();
            let A = Matrix3::new(4.0, 1.0, 0.5, 1.0, 3.0, -0.2, 0.5, -0.2, 5.0);
            let B = Matrix3::from_fn(|i, j| columns[j][i] * size);
            assert!((A * B - Matrix3::identity()).norm() < 1e-6);
            let columns = invert(&block, [true, false, false]).columns();
            assert_eq!(columns[0], [0.0; 4]);
            let det = 3.0 * 5.0 - 0.2 * 0.2;
            assert!((columns[1][1] * size - 5.0 / det).abs() < 1e-6);
            assert!((columns[2][1] * size - 0.2 / det).abs() < 1e-6);
        }
    }

    #[test]
    fn respects_inclined_directions_at_any_size() {
        let held = Held::along(nalgebra::Vector3::new(1.0, -2.0, 0.5)).unwrap();
        let A = Matrix3::new(4.0, 1.0, 0.5, 1.0, 3.0, -0.2, 0.5, -0.2, 5.0);
        for size in [1e20_f32, 1.0, 1e-25] {
            let block = [4.0, 1.0, 0.5, 0.0, 3.0, -0.2, 5.0, 0.0].map(|v| v * size);
            let columns = invert_free(&block, held).columns();
            let M = Matrix3::from_fn(|i, j| f64::from(columns[j][i] * size));
            let P = held.filter();
            assert!((M * P * A * P - P).norm() < 1e-6 && (held.projection() * M).norm() < 1e-6);
        }
        assert_eq!(invert_free(&[f32::NAN; 8], held), Inverse3::default());
    }

    #[test]
    fn nothing_and_nonsense_stay_put() {
        for block in [[0.0; 8], [f32::NAN; 8], [f32::INFINITY; 8], [-1.0; 8], [1e-40; 8]] {
            assert_eq!(invert(&block, [false; 3]), Inverse3::default());
        }
    }
}
