//! The two loops over pieces that a step spends its time in: [`Batches::update`] once,
//! [`Batches::apply`] once per solver iteration.
//!
//! Because the law is isotropic, R K Rᵀ applied to a displacement equals: rotate the *gradients*
//! once per step, g′_a = R g_a; then H = Σ du_a ⊗ g′_a, σ = 2μ sym H + λ tr(H) I, f_a = w V σ g′_a.
//! That is half the arithmetic and half the memory of multiplying by R K Rᵀ, 52 bytes per piece.

#![allow(unsafe_code)] // vector instructions behind run-time detection, and unchecked gathers

use nalgebra::Matrix3;

use super::Padded;
use crate::element::{LANES, Lanes, Mat3, Simd, Vector8, polar_newton, polar_rotation};

/// What an application streams per batch of eight pieces.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
struct Batch {
    /// Rotated gradients g′_1, g′_2, g′_3 [1/m]; g′_0 = −(g′_1 + g′_2 + g′_3).
    g: [[Lanes; 3]; 3],
    /// 2 μ w V s, with s the factor of K̂ in the operator.
    two_mu: Lanes,
    /// λ w V s.
    lambda: Lanes,
    /// Local numbers of the four copies.
    nodes: [[u16; LANES]; 4],
}

/// What only an update needs per batch.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct RestBatch {
    /// Rest gradients g_1, g_2, g_3 [1/m].
    pub g: [[Lanes; 3]; 3],
    /// w V [m³]; 0 in unused lanes.
    pub volume: Lanes,
    /// Rotation R of the last update, also the warm start of the next.
    pub rotation: Mat3<Lanes>,
}

/// Symmetric 3×3 block (xx, xy, xz, 0, yy, yz, zz, 0): the sum of s K̂ over the pieces around a copy.
pub type Block6 = [f32; 8];

/// Constants of one update.
#[derive(Clone, Copy, Debug)]
pub struct Coefficients {
    /// μ [Pa].
    pub mu: f32,
    /// λ [Pa].
    pub lambda: f32,
    /// s, the factor of K̂ in the operator (h² + hβ in a step) [s²].
    pub scale: f32,
    /// Whether pieces rotate (corotational) or keep R = I (linear).
    pub rotates: bool,
}

/// Vectors of one chunk, one entry per local number and one for the waste bin.
pub struct Locals<'a> {
    /// Current positions [m] in double precision.
    pub x: &'a [[f64; 4]],
    /// Out: internal forces f_int [N], added to.
    pub f: &'a mut [Padded],
    /// Out: diagonal blocks of s K̂, added to.
    pub blocks: &'a mut [Block6],
}

/// The batches of one chunk. Their local numbers are checked once, here.
#[derive(Clone, Debug)]
pub struct Batches {
    live: Vec<Batch>,
    rest: Vec<RestBatch>,
    /// Length of the local vectors, the waste bin included.
    n_locals: usize,
}

impl Batches {
    /// Batches with the local numbers `nodes`, all below `n_locals`, and their rest states.
    pub fn new(nodes: &[[[u16; LANES]; 4]], rest: Vec<RestBatch>, n_locals: usize) -> Self {
        assert_eq!(nodes.len(), rest.len());
        assert!(nodes.iter().flatten().flatten().all(|&id| (id as usize) < n_locals));
        let zero = Lanes::default();
        let live = nodes.iter().map(|&nodes| Batch { g: [[zero; 3]; 3], two_mu: zero, lambda: zero, nodes });
        Self { live: live.collect(), rest, n_locals }
    }

    /// Rest states and rotations.
    pub fn rest(&self) -> &[RestBatch] {
        &self.rest
    }

    /// y += s K̂ x. `x` and `y` have one entry per local number and the waste bin.
    pub fn apply(&self, simd: Simd, x: &[Padded], y: &mut [Padded]) {
        assert!(x.len() == self.n_locals && y.len() == self.n_locals);
        match simd {
            #[cfg(target_arch = "x86_64")]
            // SAFETY: `Simd::Avx2` comes from `Simd::detect` only.
            Simd::Avx2 => unsafe { avx2::apply(&self.live, x, y) },
            _ => apply_with::<Lanes>(&self.live, x, y),
        }
    }

    /// Rotations, internal forces, rotated gradients and diagonal blocks at the positions in
    /// `locals`. Returns the number of pieces with det F ≤ 0.
    pub fn update(&mut self, simd: Simd, c: &Coefficients, locals: &mut Locals<'_>) -> usize {
        let n = self.n_locals;
        assert!(locals.x.len() == n && locals.f.len() == n && locals.blocks.len() == n);
        let (rest, live) = (&mut self.rest[..], &mut self.live[..]);
        match simd {
            #[cfg(target_arch = "x86_64")]
            // SAFETY: `Simd::Avx2` comes from `Simd::detect` only.
            Simd::Avx2 => unsafe { avx2::update(c, rest, live, locals) },
            _ => update_with::<Lanes>(c, rest, live, locals),
        }
    }
}

#[inline(always)]
fn gather<V: Vector8>(x: &[Padded], ids: &[u16; LANES]) -> [V; 3] {
    // SAFETY: local numbers are below the length of local vectors, checked by `Batches`.
    V::transpose(std::array::from_fn(|lane| unsafe { x.get_unchecked(ids[lane] as usize) }))
}

#[inline(always)]
fn scatter<V: Vector8>(y: &mut [Padded], ids: &[u16; LANES], f: [V; 3]) {
    for (row, &id) in V::transpose_back(f).iter().zip(ids) {
        // SAFETY: local numbers are below the length of local vectors, checked by `Batches`.
        let y = unsafe { y.get_unchecked_mut(id as usize) };
        for i in 0..4 {
            y[i] += row[i];
        }
    }
}

#[inline(always)]
fn load<V: Vector8, const N: usize>(lanes: &[Lanes; N]) -> [V; N] {
    std::array::from_fn(|i| V::load(&lanes[i]))
}

#[inline(always)]
fn apply_with<V: Vector8>(batches: &[Batch], x: &[Padded], y: &mut [Padded]) {
    let half = V::splat(0.5);
    for b in batches {
        let g: [[V; 3]; 3] = [load(&b.g[0]), load(&b.g[1]), load(&b.g[2])];
        let u0 = gather::<V>(x, &b.nodes[0]);
        let mut H = [[half; 3]; 3];
        for k in 0..3 {
            let u = gather::<V>(x, &b.nodes[k + 1]);
            for i in 0..3 {
                let d = u[i] - u0[i];
                for j in 0..3 {
                    H[i][j] = if k == 0 { d * g[0][j] } else { d.mul_add(g[k][j], H[i][j]) };
                }
            }
        }
        let two_mu = V::load(&b.two_mu);
        let mu = half * two_mu;
        let pressure = V::load(&b.lambda) * (H[0][0] + H[1][1] + H[2][2]);
        let sxx = two_mu.mul_add(H[0][0], pressure);
        let syy = two_mu.mul_add(H[1][1], pressure);
        let szz = two_mu.mul_add(H[2][2], pressure);
        let sxy = mu * (H[0][1] + H[1][0]);
        let sxz = mu * (H[0][2] + H[2][0]);
        let syz = mu * (H[1][2] + H[2][1]);
        let sigma = [[sxx, sxy, sxz], [sxy, syy, syz], [sxz, syz, szz]];
        let f = [product(&sigma, &g[0]), product(&sigma, &g[1]), product(&sigma, &g[2])];
        scatter_forces(y, &b.nodes, f);
    }
}

/// Adds f_1, f_2, f_3 and f_0 = −(f_1 + f_2 + f_3).
#[inline(always)]
fn scatter_forces<V: Vector8>(y: &mut [Padded], nodes: &[[u16; LANES]; 4], f: [[V; 3]; 3]) {
    let f0 = std::array::from_fn(|i| -(f[0][i] + f[1][i] + f[2][i]));
    scatter(y, &nodes[0], f0);
    for (k, f) in f.into_iter().enumerate() {
        scatter(y, &nodes[k + 1], f);
    }
}

#[inline(always)]
fn product<V: Vector8>(A: &[[V; 3]; 3], v: &[V; 3]) -> [V; 3] {
    std::array::from_fn(|i| A[i][0].mul_add(v[0], A[i][1].mul_add(v[1], A[i][2] * v[2])))
}

#[inline(always)]
fn update_with<V: Vector8>(
    c: &Coefficients,
    rest: &mut [RestBatch],
    live: &mut [Batch],
    locals: &mut Locals<'_>,
) -> usize {
    let mut inverted = 0;
    for (rest, live) in rest.iter_mut().zip(live) {
        let g: [[V; 3]; 3] = [load(&rest.g[0]), load(&rest.g[1]), load(&rest.g[2])];
        let e: [[V; 3]; 3] = std::array::from_fn(|k| edge(locals.x, &live.nodes[0], &live.nodes[k + 1]));
        let F: Mat3<V> = std::array::from_fn(|ij| {
            let (i, j) = (ij / 3, ij % 3);
            e[0][i].mul_add(g[0][j], e[1][i].mul_add(g[1][j], e[2][i] * g[2][j]))
        });
        if c.rotates {
            inverted += rotate(&F, rest);
        }
        let r: Mat3<V> = load(&rest.rotation);
        let R = [[r[0], r[1], r[2]], [r[3], r[4], r[5]], [r[6], r[7], r[8]]];
        let volume = V::load(&rest.volume);
        let sigma = material_stress(c, &R, &F, volume);
        let f = std::array::from_fn(|k| product(&R, &product(&sigma, &g[k])));
        scatter_forces(locals.f, &live.nodes, f);

        let stiffness = volume * V::splat(c.scale);
        let (mu, lambda) = (V::splat(c.mu) * stiffness, V::splat(c.lambda) * stiffness);
        (live.two_mu, live.lambda) = ((mu + mu).store(), lambda.store());
        let g: [[V; 3]; 3] = std::array::from_fn(|k| product(&R, &g[k]));
        let g0 = std::array::from_fn(|i| -(g[0][i] + g[1][i] + g[2][i]));
        for (a, g) in [g0, g[0], g[1], g[2]].iter().enumerate() {
            scatter_block(locals.blocks, &live.nodes[a], g, mu, lambda);
        }
        live.g = g.map(|g| g.map(V::store));
    }
    inverted
}

/// x_a − x_0 in double precision, rounded: the rounding error is relative to the edge, not to the
/// distance from the origin.
#[inline(always)]
fn edge<V: Vector8>(x: &[[f64; 4]], from: &[u16; LANES], to: &[u16; LANES]) -> [V; 3] {
    let rows: [Padded; LANES] = std::array::from_fn(|lane| {
        // SAFETY: local numbers are below the length of local vectors, checked by `Batches`.
        let (p, q) = unsafe { (x.get_unchecked(from[lane] as usize), x.get_unchecked(to[lane] as usize)) };
        std::array::from_fn(|i| (q[i] - p[i]) as f32)
    });
    V::transpose(std::array::from_fn(|lane| &rows[lane]))
}

/// Updates the rotation of every used lane; returns how many have det F ≤ 0.
#[inline(always)]
fn rotate<V: Vector8>(F: &Mat3<V>, rest: &mut RestBatch) -> usize {
    let (R, trusted) = polar_newton(F);
    if trusted == [true; LANES] {
        rest.rotation = R.map(V::store);
        return 0;
    }
    rotate_guarded(&F.map(V::store), &R.map(V::store), trusted, rest)
}

#[cold]
#[inline(never)]
fn rotate_guarded(F: &Mat3<Lanes>, R: &Mat3<Lanes>, trusted: [bool; LANES], rest: &mut RestBatch) -> usize {
    let mut inverted = 0;
    for (lane, trusted) in trusted.into_iter().enumerate() {
        if trusted {
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
            inverted += usize::from(F.determinant() <= 0.0);
        }
    }
    inverted
}

/// w V (2μ ε + λ tr(ε) I) with ε = sym(RᵀF) − I, in the frame of the material.
#[inline(always)]
fn material_stress<V: Vector8>(c: &Coefficients, R: &[[V; 3]; 3], F: &Mat3<V>, volume: V) -> [[V; 3]; 3] {
    let S = |i: usize, j: usize| R[0][i].mul_add(F[j], R[1][i].mul_add(F[3 + j], R[2][i] * F[6 + j]));
    let one = V::splat(1.0);
    let (exx, eyy, ezz) = (S(0, 0) - one, S(1, 1) - one, S(2, 2) - one);
    let (two_exy, two_exz, two_eyz) = (S(0, 1) + S(1, 0), S(0, 2) + S(2, 0), S(1, 2) + S(2, 1));
    let mu = V::splat(c.mu) * volume;
    let two_mu = mu + mu;
    let pressure = V::splat(c.lambda) * volume * (exx + eyy + ezz);
    let (sxy, sxz, syz) = (mu * two_exy, mu * two_exz, mu * two_eyz);
    [
        [two_mu.mul_add(exx, pressure), sxy, sxz],
        [sxy, two_mu.mul_add(eyy, pressure), syz],
        [sxz, syz, two_mu.mul_add(ezz, pressure)],
    ]
}

/// Adds μ (|g|² I + g gᵀ) + λ g gᵀ, the diagonal block of one copy; μ and λ contain w V s.
#[inline(always)]
fn scatter_block<V: Vector8>(blocks: &mut [Block6], ids: &[u16; LANES], g: &[V; 3], mu: V, lambda: V) {
    let outer = mu + lambda;
    let isotropic = mu * g[0].mul_add(g[0], g[1].mul_add(g[1], g[2] * g[2]));
    let t = [outer * g[0], outer * g[1], outer * g[2]];
    let low = V::transpose_back([t[0].mul_add(g[0], isotropic), t[0] * g[1], t[0] * g[2]]);
    let high = V::transpose_back([t[1].mul_add(g[1], isotropic), t[1] * g[2], t[2].mul_add(g[2], isotropic)]);
    for lane in 0..LANES {
        let block = &mut blocks[ids[lane] as usize];
        for i in 0..4 {
            block[i] += low[lane][i];
            block[4 + i] += high[lane][i];
        }
    }
}

#[cfg(target_arch = "x86_64")]
mod avx2 {
    //! The same loops compiled for AVX2 and FMA.

    use super::{Batch, Coefficients, Locals, Padded, RestBatch};
    use crate::element::avx2::Register;

    #[target_feature(enable = "avx2,fma")]
    pub fn apply(batches: &[Batch], x: &[Padded], y: &mut [Padded]) {
        super::apply_with::<Register>(batches, x, y);
    }

    #[target_feature(enable = "avx2,fma")]
    pub fn update(
        c: &Coefficients,
        rest: &mut [RestBatch],
        live: &mut [Batch],
        locals: &mut Locals<'_>,
    ) -> usize {
        super::update_with::<Register>(c, rest, live, locals)
    }
}
