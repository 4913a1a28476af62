//! Linear operators on the copies of a body: K̂ matrix-free, and the system matrix of a step.

pub mod cells;
mod shared_lanes;
mod chunk;
mod chunks;
mod composite_diagonal;
mod elastic;
mod kernel;
mod edges;
mod groups;
mod precondition;
mod inverse;
mod preconditioner;
mod stiff_modes;
mod stiffness;
mod strip_kernel;
mod strips;
mod substitution;
pub mod rows;
mod system;
mod tet_batch;
mod tet_lanes;
mod twist;
mod hyperelastic;
mod law_coefficients;

pub use composite_diagonal::CompositeDiagonal;
pub use elastic::Elastic;
pub use inverse::{Inverse3, invert, invert_free};
pub use precondition::{Iterate, Preconditioner};
pub use preconditioner::BlockJacobi;
pub use rows::Sum;
pub use stiff_modes::{NearPiece, StiffModes, degenerate_elements};
pub use stiffness::{
    Direction, ElasticUpdate, OperatorChoice, Place, Stiffness, Tension, apply, apply_damping,
};
pub use substitution::{Substitutable, Substitution};
pub use system::{Spring, SystemOperator, filter, filter_block};
pub use tet_batch::Block6;

use cells::CellStiffness;
pub use scindo_matter::storage::padded::{Padded, padded, unpadded};
use scindo_matter::storage::saved::saved_as;
use scindo_matter::team::{Team, blocks};

saved_as!(saved_stiffness, Box, Stiffness, Tets(Elastic), Cells(CellStiffness));

/// Copies per block of the vector loops: the unit of work and of summation.
pub const BLOCK: usize = 256;

/// A symmetric linear map on vectors with one [`Padded`] entry per copy.
pub trait LinearOperator: Sync {
    /// y = A x. Both slices have one entry per copy.
    fn apply(&mut self, team: &mut Team, x: &[Padded], y: &mut [Padded]);

    /// First half of a product with `x`; `false`, and nothing is done, if this operator computes products only as a whole.
    fn start(&mut self, _team: &mut Team, _x: &[Padded]) -> bool {
        false
    }

    /// Second half: y = A x of the copies of block number `block`, where `x` has the entries of that block, too. So a
    /// caller uses a product where it is made, without a vector for it.
    fn finish(&self, _block: usize, _x: &[Padded], _y: &mut [Padded]) {}

    /// p ← z + β p (z if β = 0), q = A p, and pᵀq: the use of A in a conjugate-gradient iteration.
    ///
    /// After a call with β = 0, `p` must be the p of the call before, because an operator may keep it.
    /// `partial` is scratch with one entry per [`BLOCK`].
    fn advance(&mut self, team: &mut Team, beta: f32, z: &[Padded], out: Advance<'_>) -> f64 {
        let Advance { p, q, partial } = out;
        team.for_blocks(blocks(p, BLOCK), |block, p| {
            for (p, z) in p.iter_mut().zip(block_of(z, block)) {
                rows::direction(p, z, beta);
            }
        });
        self.apply(team, p, q);
        team.for_blocks(blocks(partial, 1), |block, partial| {
            partial[0] = rows::dot(block_of(p, block), block_of(q, block));
        });
        partial.iter().sum()
    }
}

/// Outputs of [`LinearOperator::advance`].
#[derive(Debug)]
pub struct Advance<'a> {
    /// The direction p.
    pub p: &'a mut [Padded],
    /// q = A p.
    pub q: &'a mut [Padded],
    /// Partial sums of pᵀq.
    pub partial: &'a mut [f64],
}

/// Entries of block number `block` of a vector; the last block may be shorter.
#[inline(always)]
pub fn block_of<T>(v: &[T], block: usize) -> &[T] {
    &v[block * BLOCK..((block + 1) * BLOCK).min(v.len())]
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;
