//! Forces and tangents of laws that are nonlinear in the stretch, for one tet per lane.
//!
//! In the principal axes of F = U diag(σ) Vᵀ the second derivative of an isotropic energy has few entries: A = ∂²ψ/∂σ∂σ
//! couples the three scalings, and every pair of axes has a twist and a flip. Each can be made positive semidefinite by
//! itself, so that the system of a step is. What the tangent and damping give between two corners a and b of a tet is the block
//!
//!   K_ab = w V U B Uᵀ,  B_ij = A_ij g̃_ai g̃_bj + b_ij g̃_aj g̃_bi,  B_ii = A_ii g̃_ai g̃_bi + Σ_m a_im g̃_am g̃_bm
//!
//! with g̃ = Vᵀ∇N, a = ½ (flip + twist), b = ½ (flip − twist). These blocks are summed per pair of copies, so that an
//! application costs the same whatever the law. Lanes that are inverted or nearly flat are left to the law in double
//! precision.
//!
//! # Source
//! Smith, de Goes, Kim 2019, "Analytic eigensystems for isotropic distortion energies", §4; Smith, de Goes, Kim 2018
//! (stable Neo-Hookean).

use nalgebra::{Matrix3, Vector3};
use scindo_matter::element::{LANES, Lanes, Vector, Vector8, polar_rotation, symmetric_eigen};
use scindo_matter::material::{Corotational, Law, Tangent};

use super::law_coefficients::LawCoefficients;
use super::tet_batch::{Batch, Coefficients, PAIRS, RestBatch};
use super::tet_lanes::{
    Three, biot_strain, dot, load, minus_sum, piola_stress, product, sum_of_outer_products,
};

/// Least det F / ‖F‖³ of lanes that are computed in single precision.
const FLAT: f32 = 0.01;
/// Largest ‖F‖² of those.
const LONG: f32 = 100.0;

/// What an update finds for one tet per lane.
pub(super) struct LawTet {
    /// Internal forces [N] on the four corners, those of damping included.
    pub f: [[Lanes; 3]; 4],
    /// s K_ab + rβ K̂_ab of each pair of corners, row by row.
    pub blocks: [[Lanes; 9]; 6],
    /// Number of pieces with det F ≤ 0.
    pub inverted: usize,
}

/// Derivatives of the energy density by the stretches, over μ_L: A by rows (11, 12, 13, 22, 23, 33), and twist and
/// flip of the pair across from each axis.
struct Derivatives<V> {
    A: [V; 6],
    twist: [V; 3],
    flip: [V; 3],
}

/// Rows and columns of A, and where (i, j) is in it.
const AT: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];

/// Deformation of one tet per lane in its principal axes.
struct PrincipalLanes<V> {
    /// Rest gradients of corners 1 to 3 [1/m], and the volume [m³].
    g: [Three<V>; 3],
    volume: V,
    F: [[V; 3]; 3],
    /// FᵀF, by rows as [`AT`] says.
    C: [V; 6],
    /// Stretches, and the axes before and after the deformation.
    sigma: [V; 3],
    v: [[V; 3]; 3],
    u: [[V; 3]; 3],
    cofactor: [[V; 3]; 3],
    /// ‖F‖² and det F.
    square: V,
    J: V,
    /// Lanes that are neither inverted nor nearly flat.
    usable: u16,
}

/// Updates tets with the edges `e` from corner 0: rotations, gradients of damping, forces and blocks.
#[inline(always)]
pub(super) fn update_tet<V: Vector8>(
    c: &Coefficients,
    law: &LawCoefficients,
    e: &[Three<V>; 3],
    rest: &mut RestBatch,
    live: &mut Batch,
) -> LawTet {
    let at = principal(law, e, rest);
    let forces = forces(c, law, &at, rest, live);
    let mut found = LawTet { f: [[Lanes::default(); 3]; 4], blocks: blocks(c, law, &at), inverted: 0 };
    for (f, force) in found.f.iter_mut().flatten().zip(forces.iter().flatten()) {
        *f = force.store();
    }
    if at.usable != V::ALL {
        guarded(c, law, &at, rest, live, &mut found);
    }
    found
}

#[inline(always)]
fn principal<V: Vector8>(law: &LawCoefficients, e: &[Three<V>; 3], rest: &RestBatch) -> PrincipalLanes<V> {
    let g: [Three<V>; 3] = [load(&rest.g[0]), load(&rest.g[1]), load(&rest.g[2])];
    let (F, zero) = (sum_of_outer_products(e, &g), V::splat(0.0));
    let mut C = [zero; 6];
    for i in 0..3 {
        for j in i..3 {
            C[AT[i][j]] = F[0][i].mul_add(F[0][j], F[1][i].mul_add(F[1][j], F[2][i] * F[2][j]));
        }
    }
    let (squares, v) = symmetric_eigen(&C);
    let (mut sigma, mut u, mut least) = ([zero; 3], v, V::splat(1e30));
    for k in 0..3 {
        sigma[k] = squares[k].max(zero).sqrt();
        least = -((-least).max(-sigma[k]));
        let Fv = product(&F, &v[k]);
        let over = sigma[k].max(V::splat(1e-6)).recip();
        u[k] = [Fv[0] * over, Fv[1] * over, Fv[2] * over];
    }
    let cofactor = [cross(&F[1], &F[2]), cross(&F[2], &F[0]), cross(&F[0], &F[1])];
    let J = dot(&F[0], &cofactor[0]);
    let square = C[0] + C[3] + C[5];
    let usable = (J - V::splat(FLAT) * square * square.sqrt()).above(0.0)
        & (V::splat(LONG) - square).above(0.0)
        & (least - V::splat(law.least)).above(0.0);
    PrincipalLanes { g, volume: V::load(&rest.volume), F, C, sigma, v, u, cofactor, square, J, usable }
}

/// Forces [N] on the corners. Notes the rotation, and gradients as those of the corotational law, for what damps.
#[inline(always)]
fn forces<V: Vector8>(
    c: &Coefficients,
    law: &LawCoefficients,
    at: &PrincipalLanes<V>,
    rest: &mut RestBatch,
    live: &mut Batch,
) -> [Three<V>; 4] {
    let &PrincipalLanes { ref g, volume, ref u, ref v, .. } = at;
    let mut R = at.F;
    for i in 0..3 {
        for j in 0..3 {
            R[i][j] = u[0][i].mul_add(v[0][j], u[1][i].mul_add(v[1][j], u[2][i] * v[2][j]));
        }
    }
    let (two_mu_volume, ratio) = (V::splat(2.0 * c.mu) * volume, V::splat(0.5 * c.lambda / c.mu));
    let mut P = stress(law, at);
    P.iter_mut().flatten().for_each(|entry| *entry = volume * *entry);
    if c.damping > 0.0 {
        let rate = V::splat(c.damping);
        let mut strain = biot_strain(&at.F, &R);
        for i in 0..6 {
            strain[i] = rate * (strain[i] - V::load(&rest.start[i]));
        }
        let damping = piola_stress(&strain, &R, two_mu_volume, ratio);
        for i in 0..3 {
            for j in 0..3 {
                P[i][j] = P[i][j] + damping[i][j];
            }
        }
    }
    let root = (two_mu_volume * V::splat(c.scale)).sqrt();
    for k in 0..3 {
        let turned = product(&R, &g[k]);
        for i in 0..3 {
            live.g[k][i] = (root * turned[i]).store();
        }
    }
    for (rotation, entry) in rest.rotation.iter_mut().zip(R.iter().flatten()) {
        *rotation = entry.store();
    }
    let forces = [product(&P, &g[0]), product(&P, &g[1]), product(&P, &g[2])];
    [minus_sum(&forces), forces[0], forces[1], forces[2]]
}

/// The blocks of the pairs of corners.
#[inline(always)]
fn blocks<V: Vector8>(c: &Coefficients, law: &LawCoefficients, at: &PrincipalLanes<V>) -> [[Lanes; 9]; 6] {
    let &PrincipalLanes { ref g, volume, .. } = at;
    let (scaling, a, b) = moduli(c, law, at);
    let zero = V::splat(0.0);
    let mut along = [[zero; 3]; 4];
    for k in 0..3 {
        for corner in 0..3 {
            along[corner + 1][k] = dot(&at.v[k], &g[corner]);
        }
        along[0][k] = -(along[1][k] + along[2][k] + along[3][k]);
    }
    let (mut blocks, u) = ([[Lanes::default(); 9]; 6], &at.u);
    for (block, [p, q]) in blocks.iter_mut().zip(PAIRS) {
        let (ga, gb) = (&along[p], &along[q]);
        let mut B = at.F;
        for i in 0..3 {
            for j in 0..3 {
                let scaled = scaling[AT[i][j]] * ga[i];
                B[i][j] = match i == j {
                    true => {
                        let (m, n) = ((i + 1) % 3, (i + 2) % 3);
                        let shear = (a[n] * ga[m]).mul_add(gb[m], (a[m] * ga[n]) * gb[n]);
                        scaled.mul_add(gb[i], shear)
                    }
                    false => scaled.mul_add(gb[j], (b[3 - i - j] * ga[j]) * gb[i]),
                };
            }
        }
        // U B, then (U B) Uᵀ; the rows of u are the columns of U.
        let mut UB = B;
        for r in 0..3 {
            for j in 0..3 {
                UB[r][j] = volume * u[0][r].mul_add(B[0][j], u[1][r].mul_add(B[1][j], u[2][r] * B[2][j]));
            }
        }
        for r in 0..3 {
            for q in 0..3 {
                let entry = UB[r][0].mul_add(u[0][q], UB[r][1].mul_add(u[1][q], UB[r][2] * u[2][q]));
                block[3 * r + q] = entry.store();
            }
        }
    }
    blocks
}

/// What the tangent and damping are in principal axes: the scalings, and a and b. Each part of the tangent is positive
/// semidefinite if that is asked for; damping is Hooke's law in the same axes.
#[inline(always)]
fn moduli<V: Vector8>(
    c: &Coefficients,
    law: &LawCoefficients,
    at: &PrincipalLanes<V>,
) -> ([V; 6], [V; 3], [V; 3]) {
    let zero = V::splat(0.0);
    let Derivatives { A, twist, flip } = derivatives(law, at);
    let (s, damped) = (V::splat(law.s * law.lame.mu as f32), V::splat(law.damped));
    let mut scaling = A.map(|entry| s * entry);
    let floor = if law.definite { zero } else { V::splat(f32::MIN) };
    if law.definite {
        scaling = [zero; 6];
        let (values, axes) = symmetric_eigen(&A);
        for k in 0..3 {
            let value = s * values[k].max(zero);
            for i in 0..3 {
                for j in i..3 {
                    scaling[AT[i][j]] = (value * axes[k][i]).mul_add(axes[k][j], scaling[AT[i][j]]);
                }
            }
        }
    }
    let (hooke_mu, hooke_lambda) = (damped * V::splat(c.mu), damped * V::splat(c.lambda));
    let half = V::splat(0.5);
    let (mut a, mut b) = (twist, twist);
    for k in 0..3 {
        let (twist, flip) = (s * twist[k].max(floor), s * flip[k].max(floor));
        a[k] = half.mul_add(flip + twist, hooke_mu);
        b[k] = half.mul_add(flip - twist, hooke_mu);
    }
    for i in 0..3 {
        for j in i..3 {
            let hooke = if i == j { hooke_mu + hooke_mu + hooke_lambda } else { hooke_lambda };
            scaling[AT[i][j]] = scaling[AT[i][j]] + hooke;
        }
    }
    (scaling, a, b)
}

/// P [Pa].
#[inline(always)]
fn stress<V: Vector>(law: &LawCoefficients, at: &PrincipalLanes<V>) -> [[V; 3]; 3] {
    let &PrincipalLanes { ref F, ref C, ref cofactor, square, J, .. } = at;
    let one = V::splat(1.0);
    let (mu, lambda) = (V::splat(law.mu), V::splat(law.lambda));
    let mut P = *F;
    match law.law {
        Law::NeoHookean => {
            let shear = mu * square * (square + one).recip();
            let pressure = lambda * (J - one - V::splat(law.offset));
            for i in 0..3 {
                for j in 0..3 {
                    P[i][j] = shear.mul_add(F[i][j], pressure * cofactor[i][j]);
                }
            }
        }
        _ => {
            let half = V::splat(0.5);
            let pressure = lambda * half * (square - V::splat(3.0));
            let mut S = *F;
            for i in 0..3 {
                for j in 0..3 {
                    let entry = mu * C[AT[i][j]];
                    S[i][j] = if i == j { entry - mu + pressure } else { entry };
                }
            }
            for i in 0..3 {
                for j in 0..3 {
                    P[i][j] = dot(&F[i], &S[j]);
                }
            }
        }
    }
    P
}

/// Derivatives at the stretches `s`, over μ_L.
#[inline(always)]
fn derivatives<V: Vector>(law: &LawCoefficients, at: &PrincipalLanes<V>) -> Derivatives<V> {
    let &PrincipalLanes { sigma: ref s, square, J, .. } = at;
    let (zero, one, two) = (V::splat(0.0), V::splat(1.0), V::splat(2.0));
    let over = 1.0 / law.lame.mu as f32;
    let (mu, lambda) = (V::splat(law.mu * over), V::splat(law.lambda * over));
    let (mut A, mut twist, mut flip) = ([zero; 6], [zero; 3], [zero; 3]);
    match law.law {
        Law::NeoHookean => {
            let q = (square + one).recip();
            let (shear, growth) = (mu * square * q, two * mu * q * q);
            let pressure = lambda * (J - one - V::splat(law.offset));
            let areas = [s[1] * s[2], s[2] * s[0], s[0] * s[1]];
            for i in 0..3 {
                for j in i..3 {
                    let entry = (growth * s[i]).mul_add(s[j], (lambda * areas[i]) * areas[j]);
                    A[AT[i][j]] = if i == j { entry + shear } else { pressure.mul_add(s[3 - i - j], entry) };
                }
                twist[i] = pressure.mul_add(s[i], shear);
                flip[i] = shear - pressure * s[i];
            }
        }
        _ => {
            let half = V::splat(0.5);
            let pressure = lambda * half * (square - V::splat(3.0));
            for i in 0..3 {
                for j in i..3 {
                    let entry = (lambda * s[i]) * s[j];
                    // 2μ (σ² + e) + λ tr E with e = ½ (σ² − 1).
                    let own = mu * (V::splat(3.0) * s[i] * s[i] - one) + pressure;
                    A[AT[i][j]] = if i == j { entry + own } else { entry };
                }
                let (p, q) = (s[(i + 1) % 3], s[(i + 2) % 3]);
                let (squares, product) = (p.mul_add(p, q * q), p * q);
                twist[i] = mu.mul_add(squares - product - one, pressure);
                flip[i] = mu.mul_add(squares + product - one, pressure);
            }
        }
    }
    Derivatives { A, twist, flip }
}

#[inline(always)]
fn cross<V: Vector>(a: &[V; 3], b: &[V; 3]) -> [V; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// The stress of Hooke's law, in a turned frame, of the strain since the start of a step.
fn rate_of_strain(
    law: &LawCoefficients,
    F: &Matrix3<f64>,
    R: &Matrix3<f64>,
    [xx, xy, xz, yy, yz, zz]: [f64; 6],
) -> Matrix3<f64> {
    let turned = R.transpose() * F;
    let start = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
    let strain = 0.5 * (turned + turned.transpose()) - Matrix3::identity() - start;
    R * (2.0 * law.lame.mu * strain + Matrix3::from_diagonal_element(law.lame.lambda * strain.trace()))
}

/// Computes the lanes that are not `usable` by the law in double precision.
#[cold]
#[inline(never)]
fn guarded<V: Vector8>(
    c: &Coefficients,
    law: &LawCoefficients,
    at: &PrincipalLanes<V>,
    rest: &mut RestBatch,
    live: &mut Batch,
    found: &mut LawTet,
) {
    let F = at.F.map(|row| row.map(|entry| entry.store()));
    for lane in (0..LANES).filter(|lane| at.usable >> lane & 1 == 0) {
        let volume = f64::from(rest.volume.0[lane]);
        let zero = volume <= 0.0;
        let F = match zero {
            true => Matrix3::identity(),
            false => Matrix3::from_fn(|i, j| f64::from(F[i][j].0[lane])),
        };
        let R = polar_rotation(&F, &Matrix3::identity());
        let inner = [0, 1, 2].map(|k| Vector3::from_fn(|i, _| f64::from(rest.g[k][i].0[lane])));
        let g = [-(inner[0] + inner[1] + inner[2]), inner[0], inner[1], inner[2]];
        let start = rest.start.map(|strain| f64::from(strain.0[lane]));
        let P = law.law.stress(&F, law.lame) + f64::from(c.damping) * rate_of_strain(law, &F, &R, start);
        let which = if law.definite { Tangent::Projected } else { Tangent::Exact };
        let tangent = f64::from(law.s) * law.law.tangent(&F, law.lame, which)
            + f64::from(law.damped) * Corotational(law.lame).tangent(&F, Tangent::Held);
        for (f, g) in found.f.iter_mut().zip(&g) {
            let force = volume * P * g;
            (0..3).for_each(|i| f[i].0[lane] = force[i] as f32);
        }
        for (block, [p, q]) in found.blocks.iter_mut().zip(PAIRS) {
            for r in 0..3 {
                for s in 0..3 {
                    let mut entry = 0.0;
                    for m in 0..3 {
                        for n in 0..3 {
                            entry += tangent[(r + 3 * m, s + 3 * n)] * g[p][m] * g[q][n];
                        }
                    }
                    block[3 * r + s].0[lane] = (volume * entry) as f32;
                }
            }
        }
        let root = (2.0 * law.lame.mu * volume * f64::from(c.scale)).sqrt();
        for k in 0..3 {
            let turned = root * R * inner[k];
            for i in 0..3 {
                live.g[k][i].0[lane] = turned[i] as f32;
                (0..3).for_each(|j| rest.rotation[3 * i + j].0[lane] = R[(i, j)] as f32);
            }
        }
        if !zero && F.determinant() <= 0.0 {
            found.inverted += rest.pieces[lane] as usize;
        }
    }
}
