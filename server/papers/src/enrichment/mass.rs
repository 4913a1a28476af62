//! Mass matrices of a cut element: consistent and lumped.

use nalgebra::{DMatrix, Matrix2, Vector2};

use super::basis::{Enrichment, Side};
use super::cut_element::CutElement;
use super::error::EnrichmentError;
use super::lumping::Lumping;

impl CutElement {
    /// Scalar mass matrix M [kg], 2n × 2n, in the order [u_0 … u_n−1, a_0 … a_n−1]; the same for
    /// every direction of space. For substitution u are the copies of side L and a those of side R.
    pub fn mass(&self, enrichment: Enrichment, lumping: Lumping) -> DMatrix<f64> {
        let consistent = self.consistent_mass(enrichment);
        if lumping == Lumping::Consistent {
            return consistent;
        }
        if lumping == Lumping::Copies {
            return self.copy_mass(enrichment);
        }
        let n = self.n_nodes();
        // The two diagonal blocks, and below the mass that each should have.
        let block = |b: usize| consistent.view((b * n, b * n), (n, n));
        let mut lumped = DMatrix::zeros(2 * n, 2 * n);
        let standard_scale = self.mass_kg() / block(0).trace();
        for b in 0..2 {
            let keeps_its_mass = match enrichment {
                Enrichment::Substitution => true,
                _ => lumping == Lumping::HrzBlockMass && b == 1,
            };
            let scale = if keeps_its_mass { block(b).sum() / block(b).trace() } else { standard_scale };
            // The m of the printed formula. For substitution it is the mass of the piece.
            let m = if enrichment == Enrichment::Substitution { block(b).sum() } else { self.mass_kg() };
            for i in 0..n {
                lumped[(b * n + i, b * n + i)] = match lumping {
                    Lumping::HrzAsPrinted => m * block(b)[(i, i)] / block(b).row(i).sum(),
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

    fn copy_mass(&self, enrichment: Enrichment) -> DMatrix<f64> {
        let n = self.n_nodes();
        let mut M = DMatrix::zeros(2 * n, 2 * n);
        for (side, piece) in [Side::Left, Side::Right].into_iter().zip(self.pieces()) {
            for i in 0..n {
                let c = enrichment.coefficients(side, self.sides()[i]);
                let m = self.mass_kg() * piece.moments.row(i).sum();
                for (b, d) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                    M[(b * n + i, d * n + i)] += c[b] * c[d] * m;
                }
            }
        }
        M
    }

    /// Inertia [kg] of the two pieces L and R against translation of each as a whole, 2 × 2. It should be the
    /// diagonal matrix of their masses.
    ///
    /// A rigid translation of the pieces by d_L, d_R is q = T d in the degrees of freedom of the basis, so
    /// the inertia is Tᵀ M T.
    pub fn piece_inertia(&self, enrichment: Enrichment, lumping: Lumping) -> Matrix2<f64> {
        let n = self.n_nodes();
        let mut T = DMatrix::zeros(2 * n, 2);
        for i in 0..n {
            let [left, right] =
                [Side::Left, Side::Right].map(|side| enrichment.coefficients(side, self.sides()[i]));
            // [u, a] with left·[u, a] = d_L and right·[u, a] = d_R.
            let det = left[0] * right[1] - left[1] * right[0];
            (T[(i, 0)], T[(i, 1)]) = (right[1] / det, -left[1] / det);
            (T[(n + i, 0)], T[(n + i, 1)]) = (-right[0] / det, left[0] / det);
        }
        let inertia = T.tr_mul(&self.mass(enrichment, lumping)) * T;
        Matrix2::new(inertia[(0, 0)], inertia[(0, 1)], inertia[(1, 0)], inertia[(1, 1)])
    }

    /// Accelerations of the pieces L and R in free fall, relative to g: under their true weights, with the
    /// inertia that the mass matrix gives them. They should be 1.
    pub fn free_fall(&self, enrichment: Enrichment, lumping: Lumping) -> Result<[f64; 2], EnrichmentError> {
        let weight = Vector2::from_fn(|p, _| self.mass_kg() * self.pieces()[p].fraction);
        let inertia = self.piece_inertia(enrichment, lumping);
        let pivot = EnrichmentError::SingularMass { pivot: 0, value: inertia.determinant() };
        inertia.try_inverse().map(|inverse| (inverse * weight).into()).ok_or(pivot)
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
