//! One element cut in two: its stiffness in every basis, and its critical time step.

use nalgebra::{DMatrix, Matrix3, Vector3};
use scindo_physics::material::Lame;
use scindo_physics::mesh::{tet_gradients, tet_volume};

use super::basis::{Enrichment, Side};
use super::error::EnrichmentError;
use super::lumping::Lumping;
use super::pieces::{Piece, bar_pieces, tet_pieces};
use super::spectrum::largest_frequency;

/// A bar or a linear tet cut in two, in its rest configuration and for small strains.
#[derive(Clone, Debug)]
pub struct CutElement {
    /// Stiffness of the uncut element [N/m], (d n) × (d n), direction fastest.
    whole: DMatrix<f64>,
    dimensions: usize,
    mass_kg: f64,
    sides: Vec<Side>,
    pieces: [Piece; 2],
}

impl CutElement {
    /// A bar of length 1, E = A = ρ = 1 (they cancel in all ratios), cut at `c` in (0, 1).
    pub fn unit_bar(c: f64) -> Result<Self, EnrichmentError> {
        Ok(Self {
            whole: DMatrix::from_row_slice(2, 2, &[1.0, -1.0, -1.0, 1.0]),
            dimensions: 1,
            mass_kg: 1.0,
            sides: vec![Side::Left, Side::Right],
            pieces: bar_pieces(c)?,
        })
    }

    /// The tet with `corners` [m], Lamé constants [Pa] and density [kg/m³], cut where the linear
    /// interpolant of `levels` vanishes.
    pub fn tet(
        corners: &[Vector3<f64>; 4],
        lame: Lame,
        density: f64,
        levels: [f64; 4],
    ) -> Result<Self, EnrichmentError> {
        let (sides, pieces) = tet_pieces(levels)?;
        let V = tet_volume(corners).abs();
        let whole = tet_stiffness(corners, lame);
        Ok(Self { whole, dimensions: 3, mass_kg: density * V, sides: sides.to_vec(), pieces })
    }

    /// Number of nodes n: 2 or 4.
    pub fn n_nodes(&self) -> usize {
        self.sides.len()
    }

    /// Mass of the element [kg].
    pub fn mass_kg(&self) -> f64 {
        self.mass_kg
    }

    /// Side of every node.
    pub fn sides(&self) -> &[Side] {
        &self.sides
    }

    /// The pieces [L, R].
    pub fn pieces(&self) -> &[Piece; 2] {
        &self.pieces
    }

    /// K = Σ w P_Hᵀ K_e P_H [N/m], (2 n d) × (2 n d): first all standard degrees of freedom, then all
    /// enriched ones, direction fastest.
    pub fn stiffness(&self, enrichment: Enrichment) -> DMatrix<f64> {
        let (n, d) = (self.n_nodes(), self.dimensions);
        let mut K = DMatrix::zeros(2 * n * d, 2 * n * d);
        for (side, piece) in [Side::Left, Side::Right].into_iter().zip(&self.pieces) {
            let mut P = DMatrix::zeros(n * d, 2 * n * d);
            for (i, &node) in self.sides.iter().enumerate() {
                let [u, a] = enrichment.coefficients(side, node);
                for k in 0..d {
                    P[(i * d + k, i * d + k)] = u;
                    P[(i * d + k, (n + i) * d + k)] = a;
                }
            }
            K += piece.fraction * P.tr_mul(&self.whole) * P;
        }
        K
    }

    /// Largest angular frequency ω_max [rad/s] of K − ω² M.
    pub fn omega_max(&self, enrichment: Enrichment, lumping: Lumping) -> Result<f64, EnrichmentError> {
        // Such a mass has the same frequencies in every basis, for all bases span the same displacements. The
        // basis of copies does not become singular as a piece gets small.
        let enrichment = if lumping.is_of_the_pieces() { Enrichment::Substitution } else { enrichment };
        let M =
            self.mass(enrichment, lumping).kronecker(&DMatrix::identity(self.dimensions, self.dimensions));
        largest_frequency(&self.stiffness(enrichment), &M)
    }

    /// ω_max [rad/s] of the uncut element with masses m/n.
    pub fn uncut_omega_max(&self) -> Result<f64, EnrichmentError> {
        let size = self.whole.nrows();
        largest_frequency(&self.whole, &DMatrix::from_diagonal_element(size, size, self.node_mass()))
    }

    /// Critical time step relative to that of the uncut element with masses m/n.
    pub fn critical_step_ratio(
        &self,
        enrichment: Enrichment,
        lumping: Lumping,
    ) -> Result<f64, EnrichmentError> {
        Ok(self.uncut_omega_max()? / self.omega_max(enrichment, lumping)?)
    }

    fn node_mass(&self) -> f64 {
        self.mass_kg / self.n_nodes() as f64
    }
}

/// K_ij = V (λ g_i g_jᵀ + μ g_j g_iᵀ + μ (g_i·g_j) I) [N/m] of a linear tet with shape function
/// gradients g_i, 12 × 12, direction fastest.
pub fn tet_stiffness(corners: &[Vector3<f64>; 4], lame: Lame) -> DMatrix<f64> {
    let (V, g) = (tet_volume(corners).abs(), tet_gradients(corners));
    let mut K = DMatrix::zeros(12, 12);
    for i in 0..4 {
        for j in 0..4 {
            let block: Matrix3<f64> = lame.lambda * g[i] * g[j].transpose()
                + lame.mu * g[j] * g[i].transpose()
                + Matrix3::from_diagonal_element(lame.mu * g[i].dot(&g[j]));
            K.fixed_view_mut::<3, 3>(3 * i, 3 * j).copy_from(&(V * block));
        }
    }
    K
}
