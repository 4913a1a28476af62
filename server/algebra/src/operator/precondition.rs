//! What a solver asks of a preconditioner M⁻¹.

use scindo_matter::team::{Team, blocks};

use super::{BLOCK, LinearOperator, Padded, block_of};

/// A symmetric positive semidefinite M⁻¹, 0 in prescribed directions.
///
/// A preconditioner may keep residuals in variables of its own; [`enter`](Self::enter) takes one there, and
/// everything else is given residuals that are there. One that smooths applies the operator `A` itself; the
/// others ignore it.
pub trait Preconditioner {
    /// Whether it applies A. An operator may keep the direction of its last product, so the solver then hands
    /// over every direction as a whole.
    fn uses_operator(&self) -> bool {
        false
    }

    /// Takes a residual (or q = A p) into the variables in which residuals are kept.
    fn enter(&self, r: &mut [Padded]) {
        let _ = r;
    }

    /// z = M⁻¹ r; returns rᵀz. `partial` is scratch with one entry per [`BLOCK`].
    fn apply(
        &mut self,
        team: &mut Team,
        A: &mut dyn LinearOperator,
        r: &[Padded],
        z: &mut [Padded],
        partial: &mut [f64],
    ) -> f64;

    /// x ← x + α p, r ← r − α q, z = M⁻¹ r; returns rᵀz. A preconditioner that works copy by copy does all of
    /// it in one pass.
    fn advance(
        &mut self,
        team: &mut Team,
        A: &mut dyn LinearOperator,
        (alpha, pq): (f32, [&[Padded]; 2]),
        iterate: Iterate<'_>,
    ) -> f64 {
        let Iterate { r, z, partial, .. } = iterate.along(team, alpha, pq);
        self.apply(team, A, r, z, partial)
    }

    /// √(vᵀM⁻¹v) of a vector in the variables of A; `z` and `partial` are scratch. This one allocates.
    fn norm(
        &mut self,
        team: &mut Team,
        A: &mut dyn LinearOperator,
        v: &[Padded],
        z: &mut [Padded],
        partial: &mut [f64],
    ) -> f64 {
        let mut r = v.to_vec();
        self.enter(&mut r);
        self.apply(team, A, &r, z, partial).max(0.0).sqrt()
    }
}

/// What [`Preconditioner::advance`] writes.
#[derive(Debug)]
pub struct Iterate<'a> {
    /// The solution x.
    pub x: &'a mut [Padded],
    /// b − A x, by recurrence.
    pub r: &'a mut [Padded],
    /// z = M⁻¹ r.
    pub z: &'a mut [Padded],
    /// Partial sums of rᵀz.
    pub partial: &'a mut [f64],
}

impl Iterate<'_> {
    /// x ← x + α p, r ← r − α q.
    pub fn along(self, team: &mut Team, alpha: f32, pq: [&[Padded]; 2]) -> Self {
        let (x, r) = (&mut *self.x, &mut *self.r);
        team.for_blocks((blocks(x, BLOCK), blocks(r, BLOCK)), |block, (x, r)| {
            let [p, q] = pq.map(|v| block_of(v, block));
            for ((x, r), (p, q)) in x.iter_mut().zip(r).zip(p.iter().zip(q)) {
                for k in 0..4 {
                    x[k] += alpha * p[k];
                    r[k] -= alpha * q[k];
                }
            }
        });
        self
    }
}
