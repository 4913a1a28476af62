//! Arithmetic on one tet per lane.
//!
//! Because the law is isotropic, R K Rᵀ applied to a displacement equals: rotate and scale the
//! *gradients* once per step, g′_a = √(2μ w V s) R g_a; then H = Σ du_a ⊗ g′_a,
//! σ = sym H + λ/2μ tr(H) I, f_a = σ g′_a. That is half the arithmetic and a third of the memory of
//! multiplying by R K Rᵀ: 44 bytes per piece.
//!
//! Loops instead of closures: see [`Vector`]. Closures that only name a field are none of those.

#![allow(unsafe_code)] // unchecked gathers

use nalgebra::Matrix3;
use scindo_matter::element::{
    Batched, Ids, LANES, Lanes, Mat3, Vector, Vector8, polar_newton, polar_rotation,
};

use super::tet_batch::{Batch, Block6, Coefficients, RestBatch};
use super::twist::{self, TwistBatch, TwistCoefficients, read_twist};

/// Three numbers per lane.
pub(super) type Three<V> = [V; 3];

#[inline(always)]
pub(super) fn load<V: Vector8>(l: &[Lanes; 3]) -> [V; 3] {
    [V::load(&l[0]), V::load(&l[1]), V::load(&l[2])]
}

/// Reads three vectors of every batch.
#[inline(always)]
pub(super) fn read<V: Batched<N>, const N: usize, B>(
    from: &[B; N],
    field: impl Fn(&B) -> &[[Lanes; 3]; 3],
) -> [[V; 3]; 3] {
    let mut out = [[V::splat(0.0); 3]; 3];
    for k in 0..3 {
        for i in 0..3 {
            out[k][i] = V::read(from, |b| &field(b)[k][i]);
        }
    }
    out
}

#[inline(always)]
pub(super) fn product<V: Vector>(A: &[[V; 3]; 3], v: &[V; 3]) -> [V; 3] {
    [dot(&A[0], v), dot(&A[1], v), dot(&A[2], v)]
}

#[inline(always)]
pub(super) fn dot<V: Vector>(a: &[V; 3], b: &[V; 3]) -> V {
    a[0].mul_add(b[0], a[1].mul_add(b[1], a[2] * b[2]))
}

/// The vector of corner 0, given that the vectors of all corners sum to 0.
#[inline(always)]
pub(super) fn minus_sum<V: Vector>(v: &[[V; 3]; 3]) -> [V; 3] {
    [-(v[0][0] + v[1][0] + v[2][0]), -(v[0][1] + v[1][1] + v[2][1]), -(v[0][2] + v[1][2] + v[2][2])]
}

/// H_ij = Σ_k d_k,i g_k,j.
#[inline(always)]
pub(super) fn sum_of_outer_products<V: Vector>(d: &[[V; 3]; 3], g: &[[V; 3]; 3]) -> [[V; 3]; 3] {
    let mut H = *d;
    for i in 0..3 {
        for j in 0..3 {
            H[i][j] = d[0][i].mul_add(g[0][j], d[1][i].mul_add(g[1][j], d[2][i] * g[2][j]));
        }
    }
    H
}

/// The vectors from one point to three others.
#[inline(always)]
pub(super) fn edges<V: Vector>(from: Three<V>, a: Three<V>, b: Three<V>, c: Three<V>) -> [Three<V>; 3] {
    let mut d = [a, b, c];
    for k in 0..3 {
        for i in 0..3 {
            d[k][i] = d[k][i] - from[i];
        }
    }
    d
}

/// Forces σ g′_k on the corners k = 1, 2, 3, and on corner 0, of tets with the edges `d` from corner 0, and perhaps with
/// [twists](super::twist): σ = sym H + λ/2μ tr(H) I + [Q w]×.
#[inline(always)]
pub(super) fn forces<V: Vector>(
    g: &[Three<V>; 3],
    d: &[Three<V>; 3],
    ratio: V,
    twists: Option<[V; 6]>,
) -> [Three<V>; 4] {
    let half = V::splat(0.5);
    let H = sum_of_outer_products(d, g);
    let pressure = ratio * (H[0][0] + H[1][1] + H[2][2]);
    let (sxx, syy, szz) = (H[0][0] + pressure, H[1][1] + pressure, H[2][2] + pressure);
    let sxy = half * (H[0][1] + H[1][0]);
    let sxz = half * (H[0][2] + H[2][0]);
    let syz = half * (H[1][2] + H[2][1]);
    let mut sigma = [[sxx, sxy, sxz], [sxy, syy, syz], [sxz, syz, szz]];
    if let Some(Q) = twists {
        let w = [half * (H[2][1] - H[1][2]), half * (H[0][2] - H[2][0]), half * (H[1][0] - H[0][1])];
        let [x, y, z] = twist::times(&Q, &w);
        sigma = [[sxx, sxy - z, sxz + y], [sxy + z, syy, syz - x], [sxz - y, syz + x, szz]];
    }
    let f = [product(&sigma, &g[0]), product(&sigma, &g[1]), product(&sigma, &g[2])];
    [minus_sum(&f), f[0], f[1], f[2]]
}

/// What an update finds for one tet per lane.
#[derive(Clone, Copy)]
pub(super) struct UpdatedTet<V> {
    /// Internal forces [N] on the four corners.
    pub f: [Three<V>; 4],
    /// Diagonal blocks (xx, xy, xz, yy, yz, zz) of s K̂ of the four corners.
    pub blocks: [[V; 6]; 4],
    /// Number of pieces with det F ≤ 0.
    pub inverted: usize,
    /// Lanes so stretched that their twists may matter.
    pub pulled: u16,
}

/// What an update finds.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Found {
    /// Pieces with det F ≤ 0.
    pub inverted: usize,
    /// Whether some are so stretched that twists may matter.
    pub pulled: bool,
}

impl Found {
    /// Adds what was found in one tet per lane.
    #[inline(always)]
    pub(super) fn add<V>(&mut self, tet: &UpdatedTet<V>) {
        self.inverted += tet.inverted;
        self.pulled |= tet.pulled != 0;
    }
}

/// Updates rotations and rotated gradients of tets with the edges `e` from corner 0.
#[inline(always)]
pub(super) fn update_tet<V: Batched<N>, const N: usize>(
    c: &Coefficients,
    e: &[Three<V>; 3],
    rest: &mut [RestBatch; N],
    live: &mut [Batch; N],
) -> UpdatedTet<V> {
    let ratio = V::splat(0.5 * c.lambda / c.mu);
    let g: [Three<V>; 3] = read(rest, |rest| &rest.g);
    let F = sum_of_outer_products(e, &g);
    // The linear law keeps R = I.
    let inverted = if c.rotates { rotate(&F, rest) } else { 0 };
    let R = rotation(rest);
    let two_mu_volume = V::splat(2.0 * c.mu) * V::read(rest, |rest| &rest.volume);
    let mut strain = biot_strain(&F, &R);
    let pulled = match &c.twists {
        Some(twists) => {
            let sharp = V::read(rest, |rest| &rest.sharp);
            twists.matters(twists.bound(&strain), V::splat(1.0), sharp)
        }
        None => 0,
    };
    if c.damping > 0.0 {
        let rate = V::splat(c.damping);
        for i in 0..6 {
            let start = V::read(rest, |rest| &rest.start[i]);
            strain[i] = rate.mul_add(strain[i] - start, strain[i]);
        }
    }
    let P = piola_stress(&strain, &R, two_mu_volume, ratio);
    let f = [product(&P, &g[0]), product(&P, &g[1]), product(&P, &g[2])];
    // R and √(2μ w V s) go into the gradients here, so that an application needs neither.
    let root = (two_mu_volume * V::splat(c.scale)).sqrt();
    let mut turned = [product(&R, &g[0]), product(&R, &g[1]), product(&R, &g[2])];
    for k in 0..3 {
        for i in 0..3 {
            turned[k][i] = turned[k][i] * root;
            turned[k][i].write(live, |b| &mut b.g[k][i]);
        }
    }
    let blocks = [
        block(&minus_sum(&turned), ratio),
        block(&turned[0], ratio),
        block(&turned[1], ratio),
        block(&turned[2], ratio),
    ];
    UpdatedTet { f: [minus_sum(&f), f[0], f[1], f[2]], blocks, inverted, pulled }
}

/// Writes Q of tets with the edges `e` from corner 0 at the positions that twists belong to, turned by the rotations of
/// the last update. Returns the lanes in which it matters.
#[inline(always)]
pub(super) fn update_twist<V: Batched<N>, const N: usize>(
    c: &TwistCoefficients,
    e: &[Three<V>; 3],
    rest: &[RestBatch; N],
    to: &mut [TwistBatch; N],
) -> u16 {
    let g: [Three<V>; 3] = read(rest, |rest| &rest.g);
    let (Q, most) = twist::twist(&sum_of_outer_products(e, &g), c);
    let Q = twist::turned(&Q, &rotation(rest));
    let factor = V::splat(c.factor());
    for i in 0..6 {
        (factor * Q[i]).write(to, |to| &mut to.q[i]);
    }
    let one = V::splat(1.0);
    c.matters(most, one, V::read(rest, |rest| &rest.sharp))
}

/// Diagonal blocks of the twists of the four corners.
#[inline(always)]
pub(super) fn twist_blocks<V: Batched<N>, const N: usize>(
    live: &[Batch; N],
    twists: &[TwistBatch; N],
) -> [[V; 6]; 4] {
    let g: [Three<V>; 3] = read(live, |b| &b.g);
    let Q = read_twist(twists);
    [
        twist::block(&Q, &minus_sum(&g)),
        twist::block(&Q, &g[0]),
        twist::block(&Q, &g[1]),
        twist::block(&Q, &g[2]),
    ]
}

/// R of every batch.
#[inline(always)]
fn rotation<V: Batched<N>, const N: usize>(rest: &[RestBatch; N]) -> [Three<V>; 3] {
    let mut R = [[V::splat(0.0); 3]; 3];
    for i in 0..3 {
        for j in 0..3 {
            R[i][j] = V::read(rest, |rest| &rest.rotation[3 * i + j]);
        }
    }
    R
}

/// ½ (|g|² I + g gᵀ) + λ/2μ g gᵀ, the diagonal block of one copy; g contains √(2μ w V s).
#[inline(always)]
fn block<V: Vector>(g: &Three<V>, ratio: V) -> [V; 6] {
    let half = V::splat(0.5);
    let outer = half + ratio;
    let isotropic = half * dot(g, g);
    let t = [outer * g[0], outer * g[1], outer * g[2]];
    [
        t[0].mul_add(g[0], isotropic),
        t[0] * g[1],
        t[0] * g[2],
        t[1].mul_add(g[1], isotropic),
        t[1] * g[2],
        t[2].mul_add(g[2], isotropic),
    ]
}

/// Notes the strain of tets with the edges `e` from corner 0.
#[inline(always)]
pub(super) fn note_start<V: Vector8>(e: &[Three<V>; 3], rest: &mut [RestBatch; 1]) {
    let F = sum_of_outer_products(e, &read(rest, |rest| &rest.g));
    let held = rest[0].rotation;
    rotate(&F, rest);
    let strain = biot_strain(&F, &rotation(rest));
    rest[0].rotation = held;
    for i in 0..6 {
        rest[0].start[i] = strain[i].store();
    }
}

/// Updates the rotation of every used lane; returns how many have det F ≤ 0.
#[inline(always)]
fn rotate<V: Batched<N>, const N: usize>(F: &[[V; 3]; 3], rest: &mut [RestBatch; N]) -> usize {
    let F = [F[0][0], F[0][1], F[0][2], F[1][0], F[1][1], F[1][2], F[2][0], F[2][1], F[2][2]];
    let (R, trusted) = polar_newton(&F);
    // Lanes that Newton's method cannot handle are rare and leave the hot loop.
    if trusted == V::ALL {
        for i in 0..9 {
            R[i].write(rest, |rest| &mut rest.rotation[i]);
        }
        return 0;
    }
    let mut inverted = 0;
    for batch in 0..N {
        let (mut stored_F, mut stored_R) = ([Lanes::default(); 9], [Lanes::default(); 9]);
        for i in 0..9 {
            (stored_F[i], stored_R[i]) = (F[i].part(batch).store(), R[i].part(batch).store());
        }
        inverted += rotate_guarded(&stored_F, &stored_R, trusted >> (8 * batch), &mut rest[batch]);
    }
    inverted
}

#[cold]
#[inline(never)]
fn rotate_guarded(F: &Mat3<Lanes>, R: &Mat3<Lanes>, trusted: u16, rest: &mut RestBatch) -> usize {
    let mut inverted = 0;
    for lane in 0..LANES {
        if trusted >> lane & 1 == 1 {
            for i in 0..9 {
                rest.rotation[i].0[lane] = R[i].0[lane];
            }
        } else if rest.volume.0[lane] > 0.0 {
            let F = Matrix3::from_fn(|i, j| f64::from(F[3 * i + j].0[lane]));
            let warm = Matrix3::from_fn(|i, j| f64::from(rest.rotation[3 * i + j].0[lane]));
            let R = polar_rotation(&F, &warm);
            for i in 0..9 {
                rest.rotation[i].0[lane] = R[(i / 3, i % 3)] as f32;
            }
            inverted += if F.determinant() <= 0.0 { rest.pieces[lane] as usize } else { 0 };
        }
    }
    inverted
}

/// ε = sym(RᵀF) − I, as (xx, xy, xz, yy, yz, zz).
#[inline(always)]
pub(super) fn biot_strain<V: Vector>(F: &[[V; 3]; 3], R: &[[V; 3]; 3]) -> [V; 6] {
    // RᵀF column by column
    let mut S = *F;
    for i in 0..3 {
        for j in 0..3 {
            S[i][j] = R[0][i].mul_add(F[0][j], R[1][i].mul_add(F[1][j], R[2][i] * F[2][j]));
        }
    }
    let (one, half) = (V::splat(1.0), V::splat(0.5));
    let (xy, xz, yz) = (S[0][1] + S[1][0], S[0][2] + S[2][0], S[1][2] + S[2][1]);
    [S[0][0] - one, half * xy, half * xz, S[1][1] - one, half * yz, S[2][2] - one]
}

/// w V P = w V R (2μ ε + λ tr(ε) I).
#[inline(always)]
pub(super) fn piola_stress<V: Vector>(
    strain: &[V; 6],
    R: &[[V; 3]; 3],
    two_mu_volume: V,
    ratio: V,
) -> [[V; 3]; 3] {
    let [xx, xy, xz, yy, yz, zz] = *strain;
    let pressure = ratio * (xx + yy + zz);
    let (sxx, syy, szz) =
        (two_mu_volume * (xx + pressure), two_mu_volume * (yy + pressure), two_mu_volume * (zz + pressure));
    let (sxy, sxz, syz) = (two_mu_volume * xy, two_mu_volume * xz, two_mu_volume * yz);
    let sigma = [[sxx, sxy, sxz], [sxy, syy, syz], [sxz, syz, szz]]; // symmetric: rows are columns
    let mut P = sigma;
    for i in 0..3 {
        for j in 0..3 {
            P[i][j] = dot(&R[i], &sigma[j]);
        }
    }
    P
}

/// Edges from corner 0 of every tet, at the positions `x`.
#[inline(always)]
pub(super) fn tet_edges<V: Batched<N>, const N: usize>(x: &[[f64; 4]], live: &[Batch; N]) -> [Three<V>; 3] {
    // SAFETY: local numbers are below the length of local vectors, checked by `Batches`.
    unsafe {
        [
            V::gather_all_edges(x, live, |b| [&b.nodes[0], &b.nodes[1]]),
            V::gather_all_edges(x, live, |b| [&b.nodes[0], &b.nodes[2]]),
            V::gather_all_edges(x, live, |b| [&b.nodes[0], &b.nodes[3]]),
        ]
    }
}

/// Adds diagonal blocks of copies of one batch.
#[inline(always)]
pub(super) fn scatter_block<V: Batched<N>, const N: usize>(
    to: &mut [Block6],
    ids: &Ids,
    block: &[V; 6],
    batch: usize,
) {
    let mut part = [V::Part::splat(0.0); 6];
    for i in 0..6 {
        part[i] = block[i].part(batch);
    }
    // SAFETY: local numbers are below the length of local vectors, checked by `Batches`.
    unsafe { V::Part::scatter_blocks(to, ids, part) }
}
