//! A V-cycle as the preconditioner of conjugate gradients.

use scindo_matter::team::{Team, blocks};

use super::cycle::Multigrid;
use crate::operator::{BLOCK, Inverse3, LinearOperator, Padded, Preconditioner, block_of, rows};

/// M⁻¹ = V, one cycle from 0.
#[derive(Debug)]
pub struct Cycle<'a> {
    /// Hierarchy and operators.
    pub multigrid: &'a mut Multigrid,
    /// Inverse diagonal blocks of A on the finest level.
    pub inverse: &'a [Inverse3],
    /// A bound of the largest eigenvalue of D⁻¹A there, if terms were added to A since the update; else 0.
    pub largest: f64,
}

impl Preconditioner for Cycle<'_> {
    fn uses_operator(&self) -> bool {
        true
    }

    fn apply(
        &mut self,
        team: &mut Team,
        A: &mut dyn LinearOperator,
        r: &[Padded],
        z: &mut [Padded],
        partial: &mut [f64],
    ) -> f64 {
        self.multigrid.cycle(team, A, (self.inverse, self.largest), r, z);
        let z = &*z;
        team.for_blocks(blocks(partial, 1), |block, partial: &mut [f64]| {
            partial[0] = rows::dot(block_of(r, block), block_of(z, block));
        });
        debug_assert_eq!(partial.len(), r.len().div_ceil(BLOCK));
        partial.iter().sum()
    }

    fn norm(
        &mut self,
        team: &mut Team,
        A: &mut dyn LinearOperator,
        v: &[Padded],
        z: &mut [Padded],
        partial: &mut [f64],
    ) -> f64 {
        self.apply(team, A, v, z, partial).max(0.0).sqrt()
    }
}
