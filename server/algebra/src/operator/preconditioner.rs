//! The inverse of the 3×3 diagonal blocks, one per copy; on degenerate elements in variables in which
//! they are not stiff.

use scindo_matter::element::{FixedCopy, Held};
use scindo_matter::storage::reserve::resize_reserving;
use scindo_matter::team::{Team, blocks};

use super::{
    BLOCK, Block6, Inverse3, Iterate, LinearOperator, Padded, Preconditioner, Substitution, Sum, block_of,
    invert, invert_free, rows,
};

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
