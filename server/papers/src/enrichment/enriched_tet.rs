//! Forces and tangent of a linear tet cut in two, in blocks of u and a as in the papers.

use nalgebra::{Matrix3, Vector3};
use scindo_physics::material::{Lame, Law, SignedSvd, Tangent};
use scindo_physics::mesh::{tet_gradients, tet_volume};

use super::basis::{Enrichment, Side};
use super::cut_element::tet_stiffness;
use super::error::EnrichmentError;

/// One vector per node for the standard and for the added degrees of freedom.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UA {
    /// Standard degrees of freedom u_i, or the forces f_i on them.
    pub u: [Vector3<f64>; 4],
    /// Added degrees of freedom a_i, or the forces f_i^a on them.
    pub a: [Vector3<f64>; 4],
}

/// J^X with its four blocks of 4 × 4 nodes [N/m].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EnrichedTangent {
    /// J^uu.
    pub uu: [[Matrix3<f64>; 4]; 4],
    /// J^ua.
    pub ua: [[Matrix3<f64>; 4]; 4],
    /// J^au.
    pub au: [[Matrix3<f64>; 4]; 4],
    /// J^aa.
    pub aa: [[Matrix3<f64>; 4]; 4],
}

/// An enriched linear tet: Jeřábková 2007 §§3.1.2–3.1.4 and 3.3, Schoch et al. 2013 §4.3, with their
/// misprints corrected.
///
/// Ψ_ai and Ψ_bi are the values of ψ_i above (H = +1) and below the cut, p_aj = p_0j + u_j + Ψ_aj a_j (3.25),
/// and p_bj alike (3.26). A piece is an element of volume V_a or V_b with its nodes at p_a or p_b. With f_ai,
/// the force of the whole element in that position on its node i,
///
///   f_i = V_a/V f_ai + V_b/V f_bi,  f_i^a = V_a/V Ψ_ai f_ai + V_b/V Ψ_bi f_bi
///
/// | law | f_ai | ∂f_ai/∂p_aj | equations |
/// |---|---|---|---|
/// | linear | Σ_j K_ij (p_aj − p_0j) | K_ij | (3.15)–(3.18), (3.48), (3.49); Schoch (54)–(57) |
/// | corotational | R_a Σ_j K_ij (R_aᵀ p_aj − p_0j) | R_a K_ij R_aᵀ | (3.24), (3.27), (3.53)–(3.56); Schoch (69)–(71) |
/// | St. Venant–Kirchhoff | V F_a S_a β_i | by the chain rule | (3.34), (3.35), (3.57), (3.58) |
///
/// Corrected: the sum of (3.23) runs over all 2n degrees of freedom and p_0 of a is 0; (2.27), (3.33) need
/// the dyad F = I + Σ u_i ⊗ β_i; S Fᵀ of (3.31), (3.34)–(3.36) is the transpose of the first Piola–Kirchhoff
/// stress F S, and f_i = V F S β_i; H_j in Schoch's (61) second case is −1; the conditions of Schoch's (71)
/// are swapped. R K Rᵀ of (3.51) is not the derivative of the corotational force. It is the part with the
/// rotation held, which is positive semidefinite.
///
/// For [`Enrichment::Substitution`] u and a are the copies of the two sides; see
/// [`Enrichment::coefficients`].
#[derive(Clone, Debug)]
pub struct EnrichedTet {
    rest: [Vector3<f64>; 4],
    beta: [Vector3<f64>; 4],
    K: [[Matrix3<f64>; 4]; 4],
    volume: f64,
    lame: Lame,
    sides: [Side; 4],
    /// Volume fractions of sides L and R.
    fractions: [f64; 2],
}

impl EnrichedTet {
    /// The tet with `corners` [m] whose nodes are on `sides` of the cut. The part `above` = V_a/V of its
    /// volume lies above the cut (side R, H = +1).
    pub fn new(
        corners: &[Vector3<f64>; 4],
        lame: Lame,
        sides: [Side; 4],
        above: f64,
    ) -> Result<Self, EnrichmentError> {
        if !(above > 0.0 && above < 1.0) || sides.iter().all(|&side| side == sides[0]) {
            return Err(EnrichmentError::NotCut);
        }
        let K = tet_stiffness(corners, lame);
        let block = |i: usize, j: usize| K.fixed_view::<3, 3>(3 * i, 3 * j).into_owned();
        Ok(Self {
            rest: *corners,
            beta: tet_gradients(corners),
            K: std::array::from_fn(|i| std::array::from_fn(|j| block(i, j))),
            volume: tet_volume(corners).abs(),
            lame,
            sides,
            fractions: [1.0 - above, above],
        })
    }

    /// f^X [N]: internal forces on u and on a at the displacements `q` [m].
    pub fn forces(&self, enrichment: Enrichment, law: Law, q: &UA) -> UA {
        let mut f = UA { u: [Vector3::zeros(); 4], a: [Vector3::zeros(); 4] };
        for (side, w) in self.pieces() {
            let f_piece = self.piece_forces(law, &self.positions(enrichment, side, q));
            for i in 0..4 {
                let [u, a] = enrichment.coefficients(side, self.sides[i]);
                f.u[i] += w * u * f_piece[i];
                f.a[i] += w * a * f_piece[i];
            }
        }
        f
    }

    /// J^X = ∂f^X/∂(u, a) [N/m] at the displacements `q` [m]. For the corotational law the rotations are
    /// held.
    pub fn tangent(&self, enrichment: Enrichment, law: Law, q: &UA) -> EnrichedTangent {
        let zero = [[Matrix3::zeros(); 4]; 4];
        let mut J = EnrichedTangent { uu: zero, ua: zero, au: zero, aa: zero };
        for (side, w) in self.pieces() {
            let J_piece = self.piece_tangent(law, &self.positions(enrichment, side, q));
            for i in 0..4 {
                let [u_i, a_i] = enrichment.coefficients(side, self.sides[i]);
                for j in 0..4 {
                    let [u_j, a_j] = enrichment.coefficients(side, self.sides[j]);
                    let block = w * J_piece[i][j];
                    J.uu[i][j] += u_i * u_j * block;
                    J.ua[i][j] += u_i * a_j * block;
                    J.au[i][j] += a_i * u_j * block;
                    J.aa[i][j] += a_i * a_j * block;
                }
            }
        }
        J
    }

    fn pieces(&self) -> [(Side, f64); 2] {
        [(Side::Left, self.fractions[0]), (Side::Right, self.fractions[1])]
    }

    /// (3.25), (3.26): node positions [m] of the piece on `side`.
    fn positions(&self, enrichment: Enrichment, side: Side, q: &UA) -> [Vector3<f64>; 4] {
        std::array::from_fn(|j| {
            let [u, a] = enrichment.coefficients(side, self.sides[j]);
            self.rest[j] + u * q.u[j] + a * q.a[j]
        })
    }

    fn deformation_gradient(&self, p: &[Vector3<f64>; 4]) -> Matrix3<f64> {
        (0..4).map(|i| p[i] * self.beta[i].transpose()).sum()
    }

    /// f_i of the whole element with its nodes at `p` [m].
    fn piece_forces(&self, law: Law, p: &[Vector3<f64>; 4]) -> [Vector3<f64>; 4] {
        let warped = |R: Matrix3<f64>| -> [Vector3<f64>; 4] {
            let local: [Vector3<f64>; 4] = std::array::from_fn(|j| R.transpose() * p[j] - self.rest[j]);
            std::array::from_fn(|i| R * (0..4).map(|j| self.K[i][j] * local[j]).sum::<Vector3<f64>>())
        };
        match law {
            Law::Linear => warped(Matrix3::identity()),
            Law::Corotational => warped(SignedSvd::new(&self.deformation_gradient(p)).rotation()),
            Law::StVenantKirchhoff => {
                let F = self.deformation_gradient(p);
                let FS = F * self.second_piola_kirchhoff(&F);
                self.beta.map(|beta| self.volume * FS * beta)
            }
            // The papers have no formulas of their own for any other law.
            _ => {
                let P = law.stress(&self.deformation_gradient(p), self.lame);
                self.beta.map(|beta| self.volume * P * beta)
            }
        }
    }

    /// ∂f_i/∂p_j of the whole element with its nodes at `p` [m].
    fn piece_tangent(&self, law: Law, p: &[Vector3<f64>; 4]) -> [[Matrix3<f64>; 4]; 4] {
        let F = self.deformation_gradient(p);
        let each = |block: &dyn Fn(usize, usize) -> Matrix3<f64>| {
            std::array::from_fn(|i| std::array::from_fn(|j| block(i, j)))
        };
        match law {
            Law::Linear => self.K,
            Law::Corotational => {
                let R = SignedSvd::new(&F).rotation();
                each(&|i, j| R * self.K[i][j] * R.transpose())
            }
            Law::StVenantKirchhoff => {
                let (S, FFt) = (self.second_piola_kirchhoff(&F), F * F.transpose());
                let Lame { mu, lambda } = self.lame;
                each(&|i, j| {
                    let (g_i, g_j) = (self.beta[i], self.beta[j]);
                    let (F_i, F_j) = (F * g_i, F * g_j);
                    let material = lambda * F_i * F_j.transpose()
                        + mu * F_j * F_i.transpose()
                        + mu * g_i.dot(&g_j) * FFt;
                    self.volume * (material + Matrix3::from_diagonal_element(g_i.dot(&(S * g_j))))
                })
            }
            _ => {
                let A = law.tangent(&F, self.lame, Tangent::Exact);
                each(&|i, j| {
                    Matrix3::from_fn(|r, c| {
                        let of = |k: usize, l: usize| {
                            self.beta[i][k] * A[(r + 3 * k, c + 3 * l)] * self.beta[j][l]
                        };
                        self.volume * (0..9).map(|kl| of(kl / 3, kl % 3)).sum::<f64>()
                    })
                })
            }
        }
    }

    /// S = λ tr(E) I + 2μ E [Pa].
    fn second_piola_kirchhoff(&self, F: &Matrix3<f64>) -> Matrix3<f64> {
        let E = 0.5 * (F.transpose() * F - Matrix3::identity());
        2.0 * self.lame.mu * E + Matrix3::from_diagonal_element(self.lame.lambda * E.trace())
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    const LAME: Lame = Lame { mu: 1.1e3, lambda: 2.3e3 };
    const SIDES: [Side; 4] = [Side::Left, Side::Right, Side::Left, Side::Right];
    const ABOVE: f64 = 0.3;
    const PAPERS: [Law; 3] = [Law::Linear, Law::Corotational, Law::StVenantKirchhoff];

    fn tet() -> EnrichedTet {
        let v = Vector3::new;
        let corners = [v(0.0, 0.0, 0.0), v(1.0, 0.1, 0.0), v(0.2, 0.9, 0.1), v(0.1, 0.2, 1.1)];
        EnrichedTet::new(&corners, LAME, SIDES, ABOVE).unwrap()
    }

    /// Displacements without symmetry, with rotated and stretched pieces.
    fn state() -> UA {
        let wave = |k: usize| Vector3::from_fn(|r, _| 0.35 * ((7 * k + 3 * r) as f64 * 1.7).sin());
        UA { u: std::array::from_fn(wave), a: std::array::from_fn(|i| wave(i + 4)) }
    }

    fn sign(i: usize) -> f64 {
        SIDES[i].sign()
    }

    /// Thesis (3.19)–(3.22); Schoch (58)–(61) with H_j = −1 in the second case of (61).
    #[test]
    fn shifted_stiffness_has_the_blocks_of_the_papers() {
        let tet = tet();
        let J = tet.tangent(Enrichment::ShiftedHeaviside, Law::Linear, &state());
        let case = |i: usize| if sign(i) > 0.0 { -(1.0 - ABOVE) } else { ABOVE };
        for i in 0..4 {
            for j in 0..4 {
                let K = tet.K[i][j];
                let aa = if sign(i) != sign(j) { 0.0 } else { case(i).abs() };
                for (found, factor) in
                    [(J.uu[i][j], 1.0), (J.ua[i][j], case(j)), (J.au[i][j], case(i)), (J.aa[i][j], aa)]
                {
                    assert!((found - factor * K).norm() < 1e-12 * K.norm());
                }
            }
        }
    }

    /// Thesis (3.28)–(3.30) and (3.36) with F S in place of S Fᵀ; Schoch (71) with its conditions
    /// exchanged and x_0j at the end.
    #[test]
    fn shifted_forces_have_the_cases_of_the_papers() {
        let (tet, q) = (tet(), state());
        let p_a: [Vector3<f64>; 4] = std::array::from_fn(|j| {
            tet.rest[j] + q.u[j] + if sign(j) > 0.0 { Vector3::zeros() } else { q.a[j] }
        });
        let p_b: [Vector3<f64>; 4] = std::array::from_fn(|j| {
            tet.rest[j] + q.u[j] - if sign(j) > 0.0 { q.a[j] } else { Vector3::zeros() }
        });
        for law in PAPERS {
            let f = tet.forces(Enrichment::ShiftedHeaviside, law, &q);
            let (f_a, f_b) = (tet.piece_forces(law, &p_a), tet.piece_forces(law, &p_b));
            for i in 0..4 {
                let standard = ABOVE * f_a[i] + (1.0 - ABOVE) * f_b[i];
                let added = if sign(i) > 0.0 { -(1.0 - ABOVE) * f_b[i] } else { ABOVE * f_a[i] };
                assert!((f.u[i] - standard).norm() + (f.a[i] - added).norm() < 1e-10);
            }
        }
    }

    /// The forces in the papers' formulas are those of the laws: f_i = V P β_i with P of [`Law`]. The papers
    /// mean plain St. Venant–Kirchhoff; no stretch of this state is below the point of continuation.
    #[test]
    fn forces_are_those_of_the_laws() {
        let tet = tet();
        let p: [Vector3<f64>; 4] = std::array::from_fn(|j| tet.rest[j] + 0.3 * state().u[j]);
        let F = tet.deformation_gradient(&p);
        for law in Law::ALL {
            let P = law.stress(&F, LAME);
            for (f, beta) in tet.piece_forces(law, &p).iter().zip(&tet.beta) {
                assert!((f - tet.volume * P * beta).norm() < 1e-9 * P.norm(), "{law:?}");
            }
        }
    }

    /// J^X is the derivative of f^X. The corotational law is tested in the unstrained state.
    #[test]
    fn tangent_is_the_derivative_of_the_forces() {
        let tet = tet();
        for enrichment in Enrichment::ALL {
            for law in Law::ALL {
                let mut q = state();
                if law == Law::Corotational {
                    q = UA { u: [Vector3::zeros(); 4], a: [Vector3::zeros(); 4] };
                }
                let J = tet.tangent(enrichment, law, &q);
                let h = 1e-6;
                for (j, r) in (0..24).map(|k| (k / 3, k % 3)) {
                    let moved = |h: f64| {
                        let mut q = q;
                        if j < 4 {
                            q.u[j][r] += h
                        } else {
                            q.a[j - 4][r] += h
                        }
                        tet.forces(enrichment, law, &q)
                    };
                    let (plus, minus) = (moved(h), moved(-h));
                    for i in 0..4 {
                        let du = (plus.u[i] - minus.u[i]) / (2.0 * h);
                        let da = (plus.a[i] - minus.a[i]) / (2.0 * h);
                        let (Ju, Ja) =
                            if j < 4 { (J.uu[i][j], J.au[i][j]) } else { (J.ua[i][j - 4], J.aa[i][j - 4]) };
                        let error = (du - Ju.column(r)).norm() + (da - Ja.column(r)).norm();
                        assert!(error < 1e-4, "{enrichment:?} {law:?}: {error}");
                    }
                }
            }
        }
    }

    #[test]
    fn an_element_that_is_not_cut_is_refused() {
        let corners = tet().rest;
        assert!(EnrichedTet::new(&corners, LAME, [Side::Left; 4], 0.3).is_err());
        assert!(EnrichedTet::new(&corners, LAME, SIDES, 1.0).is_err());
    }
}
