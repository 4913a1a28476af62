//! Block-Jacobi with a coarse space.

use scindo_matter::element::FixedCopy;
use scindo_matter::team::{Team, blocks};

use super::space::CoarseSpace;
use crate::operator::{
    BLOCK, BlockJacobi, Iterate, LinearOperator, Padded, Preconditioner, block_of, filter, rows,
};

/// M⁻¹ = T (D⁻¹ + P A_c⁻¹ Pᵀ) Tᵀ, with the substitution T of degenerate elements. Residuals are kept as Tᵀr.
///
/// Copies that T moves relative to others have no part in P, so the coarse space moves them along with the others.
/// Without a coarse space this is block-Jacobi, at its cost.
pub struct TwoLevel<'a> {
    /// D⁻¹ and T.
    pub jacobi: &'a mut BlockJacobi,
    /// The coarse space.
    pub coarse: Option<&'a mut CoarseSpace>,
    /// Prescribed directions, in which M⁻¹ is 0.
    pub fixed: &'a [FixedCopy],
}

impl TwoLevel<'_> {
    /// z = M⁻¹ r by the coarse space and D⁻¹; returns rᵀz.
    fn correct(
        (jacobi, coarse, fixed): (&BlockJacobi, &mut CoarseSpace, &[FixedCopy]),
        team: &mut Team,
        r: &[Padded],
        z: &mut [Padded],
        partial: &mut [f64],
    ) -> f64 {
        let energy = coarse.solve(team, r);
        let P = &coarse.interpolation;
        team.for_blocks((blocks(z, BLOCK), blocks(partial, 1)), |block, (z, partial)| {
            partial[0] = rows::precondition(jacobi.block(block), block_of(r, block), z);
            for (i, z) in z.iter_mut().enumerate() {
                let u = P.displacement(block * BLOCK + i);
                (0..4).for_each(|k| z[k] += u[k]);
            }
        });
        jacobi.substitution().unfold(z);
        // r is 0 there, so the products with it do not change.
        filter(fixed, z);
        partial.iter().sum::<f64>() + energy
    }
}

impl Preconditioner for TwoLevel<'_> {
    fn enter(&self, r: &mut [Padded]) {
        self.jacobi.enter(r);
    }

    fn apply(
        &mut self,
        team: &mut Team,
        A: &mut dyn LinearOperator,
        r: &[Padded],
        z: &mut [Padded],
        partial: &mut [f64],
    ) -> f64 {
        match &mut self.coarse {
            Some(coarse) => Self::correct((self.jacobi, coarse, self.fixed), team, r, z, partial),
            None => self.jacobi.apply(team, A, r, z, partial),
        }
    }

    fn advance(
        &mut self,
        team: &mut Team,
        A: &mut dyn LinearOperator,
        (alpha, pq): (f32, [&[Padded]; 2]),
        iterate: Iterate<'_>,
    ) -> f64 {
        let Some(coarse) = &mut self.coarse else {
            return self.jacobi.advance(team, A, (alpha, pq), iterate);
        };
        let Iterate { r, z, partial, .. } = iterate.along(team, alpha, pq);
        Self::correct((self.jacobi, coarse, self.fixed), team, r, z, partial)
    }

    fn norm(
        &mut self,
        team: &mut Team,
        A: &mut dyn LinearOperator,
        v: &[Padded],
        z: &mut [Padded],
        partial: &mut [f64],
    ) -> f64 {
        let by_blocks = self.jacobi.norm(team, A, v, z, partial);
        let Some(coarse) = &mut self.coarse else { return by_blocks };
        z.copy_from_slice(v);
        self.jacobi.enter(z);
        let energy = coarse.solve(team, z);
        (by_blocks * by_blocks + energy.max(0.0)).sqrt()
    }
}
