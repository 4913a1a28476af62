//! Mass matrices of a cut element: consistent and lumped.

use nalgebra::DMatrix;

use super::{CutElement, Enrichment, Side};

/// How the mass of a cut element is put on its degrees of freedom; formulas in [`super`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lumping {
    /// Full matrix ∫ρ N_i N_j over standard and enriched functions.
    Consistent,
    /// Row sums, inside the standard and inside the enriched block.
    RowSum,
    /// Diagonal of the consistent matrix, scaled to the mass of the element.
    Hrz,
    /// As [`Hrz`](Self::Hrz), with the enriched block scaled to its own row-sum mass.
    HrzBlockMass,
    /// m/n, and (m/n) times the mean of ψ_i² for enriched degrees of freedom.
    Menouillard,
}

impl Lumping {
    /// All of them, in the order of the table.
    pub const ALL: [Self; 5] =
        [Self::Consistent, Self::RowSum, Self::Hrz, Self::HrzBlockMass, Self::Menouillard];
}

impl CutElement {
    /// Scalar mass matrix M [kg], 2n × 2n, in the order [u_0 … u_n−1, a_0 … a_n−1]; the same for
    /// every direction of space. For substitution u are the copies of side L and a those of side R.
    pub fn mass(&self, enrichment: Enrichment, lumping: Lumping) -> DMatrix<f64> {
        let consistent = self.consistent_mass(enrichment);
        if lumping == Lumping::Consistent {
            return consistent;
        }
        let n = self.n_nodes();
        // The two diagonal blocks and what each of them should weigh.
        let block = |b: usize| consistent.view((b * n, b * n), (n, n));
        let mut lumped = DMatrix::zeros(2 * n, 2 * n);
        let standard_scale = self.mass_kg() / block(0).trace();
        for b in 0..2 {
            let scale = match (enrichment, lumping) {
                (Enrichment::Substitution, _) | (_, Lumping::HrzBlockMass) if b == 1 => {
                    block(b).sum() / block(b).trace()
                }
                (Enrichment::Substitution, _) => block(b).sum() / block(b).trace(),
                _ => standard_scale,
            };
            for i in 0..n {
                lumped[(b * n + i, b * n + i)] = match lumping {
                    Lumping::RowSum => block(b).row(i).sum(),
                    Lumping::Menouillard => self.menouillard(enrichment, i)[b],
                    _ => scale * block(b)[(i, i)],
                };
            }
        }
        lumped
    }

    fn consistent_mass(&self, enrichment: Enrichment) -> DMatrix<f64> {
        let n = self.n_nodes();
        let mut M = DMatrix::zeros(2 * n, 2 * n);
        for (side, piece) in [Side::Left, Side::Right].into_iter().zip(self.pieces()) {
            for i in 0..n {
                let c_i = enrichment.coefficients(side, self.sides()[i]);
                for j in 0..n {
                    let c_j = enrichment.coefficients(side, self.sides()[j]);
                    let m_ij = self.mass_kg() * piece.moments[(i, j)];
                    for (b, d) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                        M[(b * n + i, d * n + j)] += c_i[b] * c_j[d] * m_ij;
                    }
                }
            }
        }
        M
    }

    /// (m/n) (1/|Ω|) ∫ c² dΩ for the two degrees of freedom of node `i`.
    fn menouillard(&self, enrichment: Enrichment, i: usize) -> [f64; 2] {
        let share = self.mass_kg() / self.n_nodes() as f64;
        let mut mass = [0.0; 2];
        for (side, piece) in [Side::Left, Side::Right].into_iter().zip(self.pieces()) {
            let c = enrichment.coefficients(side, self.sides()[i]);
            (0..2).for_each(|b| mass[b] += share * piece.fraction * c[b] * c[b]);
        }
        mass
    }
}
