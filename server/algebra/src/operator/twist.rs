//! What the stress of stretched material adds to its stiffness: the twists of the corotational law.
//!
//! The second derivative of the law's energy is R K Rᵀ plus Σ λ_k T_k T_kᵀ over the three twists T_k, which turn the
//! material against its rotation R. With the principal stretches s_i and the stresses T_i = 2μ (s_i − 1) + λ Σ (s − 1),
//!
//!   λ_k = (T_i + T_j) / (s_i + s_j) for the axis v_k across from i and j, at least 0.
//!
//! In the material's frame that is Q = Σ λ_k v_k v_kᵀ: with the curl w = ½ ∇ × u of a displacement in the frame of R,
//! the energy per volume is wᵀ Q w. Without it, what tension holds would be integrated explicitly: stretched tissue would
//! shake for ever in steps that are long for it. Compression is left out, so that Q never makes the system indefinite.
//!
//! Q belongs to the positions x_n at the start of a step, while R is that of the predictor. The predictor is stretched by
//! ½ (ω h)² wherever material turns; taken there, Q would act as additional mass.
//!
//! # Source
//! Smith, de Goes, Kim 2019, "Analytic eigensystems for isotropic distortion energies" (twists and their eigenvalues).

use scindo_matter::element::{Batched, Lanes, Vector, symmetric_eigen};
use scindo_matter::material::{Corotational, Lame};

/// n = s λ_k² |∇N|² / (ρ E) below which Q is left out. Without it, steps have been seen to shake from n = 0.34 on.
const NOTABLE: f64 = 0.04;
/// s λ_k |∇N|² / ρ below which a step is stable without Q, whatever the thickness.
const STABLE: f64 = 4.0 / 3.0;

/// Q of eight elements, times their factor in the operator.
#[derive(Clone, Copy, Debug, Default, serde::Serialize, serde::Deserialize)]
#[repr(C)]
pub(super) struct TwistBatch {
    /// xx, xy, xz, yy, yz, zz.
    pub q: [Lanes; 6],
}

/// Constants of the twists of elements of one material.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct TwistCoefficients {
    /// μ [Pa].
    mu: f32,
    /// λ [Pa].
    lambda: f32,
    /// s over the factor of K̂ in the operator, s + rβ: damping has no twists.
    share: f32,
    /// √(s/(0.04 ρ E)) [m/Pa].
    notable: f32,
    /// ¾ s/ρ [m²/Pa].
    stable: f32,
}

impl TwistCoefficients {
    /// Those for a factor `s` [s²] of forces, `scale` of K̂, and a density [kg/m³]. Without inertia the density is 0, and
    /// twists count everywhere.
    pub(super) fn new(lame: Lame, density: f64, s: f64, scale: f64) -> Self {
        let Lame { mu, lambda } = lame;
        let E = mu * (3.0 * lambda + 2.0 * mu) / (lambda + mu);
        // Both stay in the range of single precision, so that no product is 0 · ∞.
        let bounded = |x: f64| x.min(1e30) as f32;
        Self {
            mu: mu as f32,
            lambda: lambda as f32,
            share: (s / scale) as f32,
            notable: bounded((s / (NOTABLE * density * E)).sqrt()),
            stable: bounded(s / (STABLE * density)),
        }
    }

    /// s/(2μ (s + rβ)): Q times this goes with the gradients g′ of tets, which contain √(2μ w V (s + rβ)).
    pub(super) fn factor(&self) -> f32 {
        self.share / (2.0 * self.mu)
    }

    /// s/(16 μ (s + rβ)): Q times this goes with Walsh–Hadamard coordinates of cells, which contain √c. A cell of side a
    /// has the mean gradient û/4a, the volume a³ and c = μ a (s + rβ).
    pub(super) fn cell_factor(&self) -> f32 {
        self.share / (16.0 * self.mu)
    }

    /// More than the largest λ_k of material with this strain of the predictor [Pa], if it is not crushed: the largest
    /// T_i + T_j is at most ⅔ tr T + √⅔ ‖dev T‖.
    #[inline(always)]
    pub(super) fn bound<V: Vector>(&self, strain: &[V; 6]) -> V {
        let [xx, xy, xz, yy, yz, zz] = *strain;
        let (a, b, c) = (xx - yy, yy - zz, zz - xx);
        let shear = V::splat(2.0) * xy.mul_add(xy, xz.mul_add(xz, yz * yz));
        let deviator = V::splat(1.0 / 3.0).mul_add(a.mul_add(a, b.mul_add(b, c * c)), shear);
        let two_thirds = V::splat(2.0 / 3.0);
        // tr T = (2μ + 3λ) tr ε, dev T = 2μ dev ε.
        let trace = V::splat(2.0 * self.mu + 3.0 * self.lambda) * (xx + yy + zz);
        let stress = V::splat(2.0 * self.mu) * (two_thirds * deviator).sqrt();
        two_thirds.mul_add(trace, stress).max(V::splat(0.0))
    }

    /// One bit for every lane in which a largest λ_k matters, given as `most`/`per`, with the largest |∇N|² `sharp` [1/m²].
    #[inline(always)]
    pub(super) fn matters<V: Vector>(&self, most: V, per: V, sharp: V) -> u16 {
        let notable = V::splat(self.notable) * most;
        let first = (notable * notable).mul_add(sharp, -(per * per)).above(0.0);
        first & (V::splat(self.stable) * most).mul_add(sharp, -per).above(0.0)
    }
}

/// Q and its largest eigenvalue at the deformation gradient `F`, in the frame of the material [Pa].
#[inline(always)]
pub(super) fn twist<V: Vector>(F: &[[V; 3]; 3], c: &TwistCoefficients) -> ([V; 6], V) {
    let (zero, one) = (V::splat(0.0), V::splat(1.0));
    let mut C = [zero; 6];
    for (entry, [i, j]) in ENTRIES.into_iter().enumerate() {
        C[entry] = F[0][i].mul_add(F[0][j], F[1][i].mul_add(F[1][j], F[2][i] * F[2][j]));
    }
    let (squares, v) = symmetric_eigen(&C);
    let s = [squares[0].max(zero).sqrt(), squares[1].max(zero).sqrt(), squares[2].max(zero).sqrt()];
    let theta = s[0] + s[1] + s[2] - V::splat(3.0);
    let pressure = V::splat(2.0 * c.lambda) * theta;
    let (mut Q, mut most) = ([zero; 6], zero);
    for k in 0..3 {
        let sum = s[(k + 1) % 3] + s[(k + 2) % 3];
        let stress = V::splat(2.0 * c.mu).mul_add(sum - one - one, pressure);
        let lambda = stress.max(zero) * sum.max(V::splat(Corotational::LEAST_STRETCHES as f32)).recip();
        most = most.max(lambda);
        for (entry, [i, j]) in ENTRIES.into_iter().enumerate() {
            Q[entry] = (lambda * v[k][i]).mul_add(v[k][j], Q[entry]);
        }
    }
    (Q, most)
}

/// Q of every batch.
#[inline(always)]
pub(super) fn read_twist<V: Batched<N>, const N: usize>(from: &[TwistBatch; N]) -> [V; 6] {
    let mut Q = [V::splat(0.0); 6];
    for i in 0..6 {
        Q[i] = V::read(from, |from| &from.q[i]);
    }
    Q
}

/// Rows and columns of the entries of a symmetric matrix.
pub(super) const ENTRIES: [[usize; 2]; 6] = [[0, 0], [0, 1], [0, 2], [1, 1], [1, 2], [2, 2]];

/// R Q Rᵀ.
#[inline(always)]
pub(super) fn turned<V: Vector>(Q: &[V; 6], R: &[[V; 3]; 3]) -> [V; 6] {
    let rows = [[Q[0], Q[1], Q[2]], [Q[1], Q[3], Q[4]], [Q[2], Q[4], Q[5]]];
    let mut RQ = *R;
    for i in 0..3 {
        for j in 0..3 {
            RQ[i][j] = R[i][0].mul_add(rows[0][j], R[i][1].mul_add(rows[1][j], R[i][2] * rows[2][j]));
        }
    }
    let mut out = *Q;
    for (entry, [i, j]) in ENTRIES.into_iter().enumerate() {
        out[entry] = RQ[i][0].mul_add(R[j][0], RQ[i][1].mul_add(R[j][1], RQ[i][2] * R[j][2]));
    }
    out
}

/// Q w.
#[inline(always)]
pub(super) fn times<V: Vector>(Q: &[V; 6], w: &[V; 3]) -> [V; 3] {
    [
        Q[0].mul_add(w[0], Q[1].mul_add(w[1], Q[2] * w[2])),
        Q[1].mul_add(w[0], Q[3].mul_add(w[1], Q[4] * w[2])),
        Q[2].mul_add(w[0], Q[4].mul_add(w[1], Q[5] * w[2])),
    ]
}

/// ½ [g]×ᵀ Q [g]×, the block of wᵀ Q w for a node whose displacement u has the curl w = ½ g × u.
#[inline(always)]
pub(super) fn block<V: Vector>(Q: &[V; 6], g: &[V; 3]) -> [V; 6] {
    let half = V::splat(0.5);
    let [x, y, z] = [half * g[0], half * g[1], half * g[2]];
    // Rows of Q times the columns of [g]×: (0, z, −y), (−z, 0, x), (y, −x, 0).
    let (c0, c1, c2) =
        ([V::splat(0.0), g[2], -g[1]], [-g[2], V::splat(0.0), g[0]], [g[1], -g[0], V::splat(0.0)]);
    let (q0, q1, q2) = (times(Q, &c0), times(Q, &c1), times(Q, &c2));
    [
        z.mul_add(q0[1], -(y * q0[2])),
        z.mul_add(q1[1], -(y * q1[2])),
        z.mul_add(q2[1], -(y * q2[2])),
        x.mul_add(q1[2], -(z * q1[0])),
        x.mul_add(q2[2], -(z * q2[0])),
        y.mul_add(q2[0], -(x * q2[1])),
    ]
}
