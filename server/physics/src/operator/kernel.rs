//! The two loops over pieces that a step spends its time in: [`update`] once, [`apply`] once per
//! solver iteration.
//!
//! Because the law is isotropic, R K Rᵀ applied to a displacement equals: rotate the *gradients*
//! once per step, g′_a = R g_a; then H = Σ du_a ⊗ g′_a, σ = 2μ sym H + λ tr(H) I, f_a = w V σ g′_a.
//! That is half the arithmetic and half the memory of multiplying by R K Rᵀ, 52 bytes per piece.

#![allow(unsafe_code)] // vector instructions behind run-time detection, and unchecked gathers

use nalgebra::Matrix3;

use super::Padded;
use crate::element::{LANES, Lanes, Mat3, Simd, polar_newton, polar_rotation};

/// What [`apply`] streams per batch of eight pieces.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Batch {
    /// Rotated gradients g′_1, g′_2, g′_3 [1/m]; g′_0 = −(g′_1 + g′_2 + g′_3).
    pub g: [[Lanes; 3]; 3],
    /// 2 μ w V s, with s the factor of K̂ in the operator.
    pub two_mu: Lanes,
    /// λ w V s.
    pub lambda: Lanes,
    /// Local numbers of the four copies.
    pub nodes: [[u16; LANES]; 4],
}

/// What only [`update`] needs per batch.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct RestBatch {
    /// Rest gradients g_1, g_2, g_3 [1/m].
    pub g: [[Lanes; 3]; 3],
    /// w V [m³]; 0 in unused lanes.
    pub volume: Lanes,
    /// Rotation R of the last update, also the warm start of the next.
    pub rotation: Mat3,
}

/// Sum over the pieces around a copy of the lower triangle (xx, xy, xz, yy, yz, zz, 0, 0) of s K̂.
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

/// y += s K̂ x over `batches`. `x` and `y` have one entry per local number and the waste bin.
pub fn apply(simd: Simd, batches: &[Batch], x: &[Padded], y: &mut [Padded]) {
    assert_eq!(x.len(), y.len());
    match simd {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: `Simd::Avx2` comes from `Simd::detect` only.
        Simd::Avx2 => unsafe { avx2::apply(batches, x, y) },
        _ => apply_with::<Portable>(batches, x, y),
    }
}

/// Rotations, internal forces, rotated gradients and diagonal blocks at the positions in `locals`.
///
/// Returns the number of pieces with det F ≤ 0.
pub fn update(
    simd: Simd,
    c: &Coefficients,
    rest: &mut [RestBatch],
    live: &mut [Batch],
    locals: &mut Locals<'_>,
) -> usize {
    assert_eq!(rest.len(), live.len());
    assert!(locals.x.len() == locals.f.len() && locals.f.len() == locals.blocks.len());
    match simd {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: `Simd::Avx2` comes from `Simd::detect` only.
        Simd::Avx2 => unsafe { avx2::update(c, rest, live, locals) },
        _ => update_with::<Portable>(c, rest, live, locals),
    }
}

/// What differs between instruction sets.
trait Isa {
    const FMA: bool;
    /// Eight registers (x, y, z, ·) to three lane vectors.
    fn transpose(rows: [Padded; LANES]) -> [Lanes; 3];
    /// Three lane vectors to eight registers (x, y, z, 0).
    fn transpose_back(columns: [Lanes; 3]) -> [Padded; LANES];
}

struct Portable;

impl Isa for Portable {
    const FMA: bool = false;

    #[inline(always)]
    fn transpose(rows: [Padded; LANES]) -> [Lanes; 3] {
        [0, 1, 2].map(|i| Lanes(rows.map(|row| row[i])))
    }

    #[inline(always)]
    fn transpose_back([x, y, z]: [Lanes; 3]) -> [Padded; LANES] {
        let mut rows = [[0.0; 4]; LANES];
        for (lane, row) in rows.iter_mut().enumerate() {
            *row = [x.0[lane], y.0[lane], z.0[lane], 0.0];
        }
        rows
    }
}

#[inline(always)]
fn gather<I: Isa>(x: &[Padded], ids: &[u16; LANES]) -> [Lanes; 3] {
    I::transpose(ids.map(|id| x[id as usize]))
}

#[inline(always)]
fn scatter<I: Isa>(y: &mut [Padded], ids: &[u16; LANES], f: [Lanes; 3]) {
    for (row, &id) in I::transpose_back(f).iter().zip(ids) {
        let y = &mut y[id as usize];
        for i in 0..4 {
            y[i] += row[i];
        }
    }
}

#[inline(always)]
fn apply_with<I: Isa>(batches: &[Batch], x: &[Padded], y: &mut [Padded]) {
    let half = Lanes::splat(0.5);
    for b in batches {
        let u0 = gather::<I>(x, &b.nodes[0]);
        let mut H = [[Lanes::default(); 3]; 3];
        for k in 0..3 {
            let u = gather::<I>(x, &b.nodes[k + 1]);
            for i in 0..3 {
                let d = u[i] - u0[i];
                for j in 0..3 {
                    H[i][j] = if k == 0 { d * b.g[0][j] } else { fma::<I>(d, b.g[k][j], H[i][j]) };
                }
            }
        }
        let pressure = b.lambda * (H[0][0] + H[1][1] + H[2][2]);
        let mu = half * b.two_mu;
        let sxx = fma::<I>(b.two_mu, H[0][0], pressure);
        let syy = fma::<I>(b.two_mu, H[1][1], pressure);
        let szz = fma::<I>(b.two_mu, H[2][2], pressure);
        let sxy = mu * (H[0][1] + H[1][0]);
        let sxz = mu * (H[0][2] + H[2][0]);
        let syz = mu * (H[1][2] + H[2][1]);
        let sigma = [[sxx, sxy, sxz], [sxy, syy, syz], [sxz, syz, szz]];
        let mut f0 = [Lanes::default(); 3];
        for k in 0..3 {
            let f = product::<I>(&sigma, &b.g[k]);
            for i in 0..3 {
                f0[i] = f0[i] - f[i];
            }
            scatter::<I>(y, &b.nodes[k + 1], f);
        }
        scatter::<I>(y, &b.nodes[0], f0);
    }
}

#[inline(always)]
fn fma<I: Isa>(a: Lanes, b: Lanes, c: Lanes) -> Lanes {
    if I::FMA { a.mul_add::<true>(b, c) } else { a.mul_add::<false>(b, c) }
}

#[inline(always)]
fn product<I: Isa>(A: &[[Lanes; 3]; 3], v: &[Lanes; 3]) -> [Lanes; 3] {
    [0, 1, 2].map(|i| fma::<I>(A[i][0], v[0], fma::<I>(A[i][1], v[1], A[i][2] * v[2])))
}

#[inline(always)]
fn update_with<I: Isa>(
    c: &Coefficients,
    rest: &mut [RestBatch],
    live: &mut [Batch],
    locals: &mut Locals<'_>,
) -> usize {
    let mut inverted = 0;
    for (rest, live) in rest.iter_mut().zip(live) {
        let edges = [1, 2, 3].map(|a| edge::<I>(locals.x, &live.nodes[0], &live.nodes[a]));
        let mut F = [Lanes::default(); 9];
        for i in 0..3 {
            for j in 0..3 {
                F[3 * i + j] = fma::<I>(
                    edges[0][i],
                    rest.g[0][j],
                    fma::<I>(edges[1][i], rest.g[1][j], edges[2][i] * rest.g[2][j]),
                );
            }
        }
        if c.rotates {
            inverted += rotate::<I>(&F, rest);
        }
        let R = [
            [rest.rotation[0], rest.rotation[1], rest.rotation[2]],
            [rest.rotation[3], rest.rotation[4], rest.rotation[5]],
            [rest.rotation[6], rest.rotation[7], rest.rotation[8]],
        ];
        let sigma = material_stress::<I>(c, &R, &F, rest.volume);
        let mut f0 = [Lanes::default(); 3];
        for k in 0..3 {
            let f = product::<I>(&R, &product::<I>(&sigma, &rest.g[k]));
            for i in 0..3 {
                f0[i] = f0[i] - f[i];
            }
            scatter::<I>(locals.f, &live.nodes[k + 1], f);
            live.g[k] = product::<I>(&R, &rest.g[k]);
        }
        scatter::<I>(locals.f, &live.nodes[0], f0);

        let stiffness = rest.volume * Lanes::splat(c.scale);
        live.two_mu = Lanes::splat(2.0 * c.mu) * stiffness;
        live.lambda = Lanes::splat(c.lambda) * stiffness;
        let g = &live.g;
        let g0 = [0, 1, 2].map(|i| -(g[0][i] + g[1][i] + g[2][i]));
        for (a, g) in [g0, g[0], g[1], g[2]].iter().enumerate() {
            scatter_block::<I>(locals.blocks, &live.nodes[a], g, live);
        }
    }
    inverted
}

/// x_a − x_0 in double precision, rounded: the rounding error is relative to the edge, not to the
/// distance from the origin.
#[inline(always)]
fn edge<I: Isa>(x: &[[f64; 4]], from: &[u16; LANES], to: &[u16; LANES]) -> [Lanes; 3] {
    let mut rows = [[0.0; 4]; LANES];
    for lane in 0..LANES {
        let (p, q) = (&x[from[lane] as usize], &x[to[lane] as usize]);
        for i in 0..4 {
            rows[lane][i] = (q[i] - p[i]) as f32;
        }
    }
    I::transpose(rows)
}

/// Updates the rotation of every used lane; returns how many have det F ≤ 0.
#[inline(always)]
fn rotate<I: Isa>(F: &Mat3, rest: &mut RestBatch) -> usize {
    let (R, trusted) = if I::FMA { polar_newton::<true>(F) } else { polar_newton::<false>(F) };
    if trusted == [true; LANES] {
        rest.rotation = R;
        return 0;
    }
    rotate_guarded(F, &R, trusted, rest)
}

#[cold]
#[inline(never)]
fn rotate_guarded(F: &Mat3, R: &Mat3, trusted: [bool; LANES], rest: &mut RestBatch) -> usize {
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
fn material_stress<I: Isa>(
    c: &Coefficients,
    R: &[[Lanes; 3]; 3],
    F: &Mat3,
    volume: Lanes,
) -> [[Lanes; 3]; 3] {
    let S = |i: usize, j: usize| fma::<I>(R[0][i], F[j], fma::<I>(R[1][i], F[3 + j], R[2][i] * F[6 + j]));
    let one = Lanes::splat(1.0);
    let (exx, eyy, ezz) = (S(0, 0) - one, S(1, 1) - one, S(2, 2) - one);
    let (two_exy, two_exz, two_eyz) = (S(0, 1) + S(1, 0), S(0, 2) + S(2, 0), S(1, 2) + S(2, 1));
    let mu = Lanes::splat(c.mu) * volume;
    let two_mu = mu + mu;
    let pressure = Lanes::splat(c.lambda) * volume * (exx + eyy + ezz);
    let (sxy, sxz, syz) = (mu * two_exy, mu * two_exz, mu * two_eyz);
    [
        [fma::<I>(two_mu, exx, pressure), sxy, sxz],
        [sxy, fma::<I>(two_mu, eyy, pressure), syz],
        [sxz, syz, fma::<I>(two_mu, ezz, pressure)],
    ]
}

/// Adds w V s [μ (|g|² I + g gᵀ) + λ g gᵀ], the diagonal block of one copy.
#[inline(always)]
fn scatter_block<I: Isa>(blocks: &mut [Block6], ids: &[u16; LANES], g: &[Lanes; 3], b: &Batch) {
    let mu = Lanes::splat(0.5) * b.two_mu;
    let outer = mu + b.lambda;
    let isotropic = mu * fma::<I>(g[0], g[0], fma::<I>(g[1], g[1], g[2] * g[2]));
    let t = [outer * g[0], outer * g[1], outer * g[2]];
    let entries = [
        fma::<I>(t[0], g[0], isotropic),
        t[0] * g[1],
        t[0] * g[2],
        fma::<I>(t[1], g[1], isotropic),
        t[1] * g[2],
        fma::<I>(t[2], g[2], isotropic),
    ];
    let low = I::transpose_back([entries[0], entries[1], entries[2]]);
    let high = I::transpose_back([entries[3], entries[4], entries[5]]);
    for lane in 0..LANES {
        let block = &mut blocks[ids[lane] as usize];
        for i in 0..3 {
            block[i] += low[lane][i];
            block[3 + i] += high[lane][i];
        }
    }
}

#[cfg(target_arch = "x86_64")]
mod avx2 {
    //! The same loops compiled for AVX2 and FMA, with transpositions in registers.

    use std::arch::x86_64::{
        __m256, _mm_loadu_ps, _mm256_castps128_ps256, _mm256_insertf128_ps, _mm256_setzero_ps,
        _mm256_shuffle_ps, _mm256_unpackhi_ps, _mm256_unpacklo_ps,
    };

    use super::{Batch, Coefficients, Isa, LANES, Lanes, Locals, Padded, RestBatch};

    #[target_feature(enable = "avx2,fma")]
    pub fn apply(batches: &[Batch], x: &[Padded], y: &mut [Padded]) {
        super::apply_with::<Avx2>(batches, x, y);
    }

    #[target_feature(enable = "avx2,fma")]
    pub fn update(
        c: &Coefficients,
        rest: &mut [RestBatch],
        live: &mut [Batch],
        locals: &mut Locals<'_>,
    ) -> usize {
        super::update_with::<Avx2>(c, rest, live, locals)
    }

    struct Avx2;

    impl Isa for Avx2 {
        const FMA: bool = true;

        #[inline(always)]
        fn transpose(rows: [Padded; LANES]) -> [Lanes; 3] {
            // SAFETY: only reached from the two functions above, which enable AVX2.
            unsafe {
                let pair = |low: usize, high: usize| {
                    let low = _mm256_castps128_ps256(_mm_loadu_ps(rows[low].as_ptr()));
                    _mm256_insertf128_ps::<1>(low, _mm_loadu_ps(rows[high].as_ptr()))
                };
                let (r04, r15, r26, r37) = (pair(0, 4), pair(1, 5), pair(2, 6), pair(3, 7));
                let (xy01, xy23) = (_mm256_unpacklo_ps(r04, r15), _mm256_unpacklo_ps(r26, r37));
                let (zw01, zw23) = (_mm256_unpackhi_ps(r04, r15), _mm256_unpackhi_ps(r26, r37));
                [
                    lanes(_mm256_shuffle_ps::<0x44>(xy01, xy23)),
                    lanes(_mm256_shuffle_ps::<0xEE>(xy01, xy23)),
                    lanes(_mm256_shuffle_ps::<0x44>(zw01, zw23)),
                ]
            }
        }

        #[inline(always)]
        fn transpose_back([x, y, z]: [Lanes; 3]) -> [Padded; LANES] {
            // SAFETY: only reached from the two functions above, which enable AVX2.
            unsafe {
                let (x, y, z, w) = (register(x), register(y), register(z), _mm256_setzero_ps());
                let (xy0145, xy2367) = (_mm256_unpacklo_ps(x, y), _mm256_unpackhi_ps(x, y));
                let (zw0145, zw2367) = (_mm256_unpacklo_ps(z, w), _mm256_unpackhi_ps(z, w));
                let [r0, r4] = halves(_mm256_shuffle_ps::<0x44>(xy0145, zw0145));
                let [r1, r5] = halves(_mm256_shuffle_ps::<0xEE>(xy0145, zw0145));
                let [r2, r6] = halves(_mm256_shuffle_ps::<0x44>(xy2367, zw2367));
                let [r3, r7] = halves(_mm256_shuffle_ps::<0xEE>(xy2367, zw2367));
                [r0, r1, r2, r3, r4, r5, r6, r7]
            }
        }
    }

    #[inline(always)]
    fn lanes(register: __m256) -> Lanes {
        // SAFETY: both are 32 bytes of plain f32.
        unsafe { std::mem::transmute::<__m256, Lanes>(register) }
    }

    #[inline(always)]
    fn register(lanes: Lanes) -> __m256 {
        // SAFETY: both are 32 bytes of plain f32.
        unsafe { std::mem::transmute::<Lanes, __m256>(lanes) }
    }

    #[inline(always)]
    fn halves(register: __m256) -> [Padded; 2] {
        // SAFETY: both are 32 bytes of plain f32.
        unsafe { std::mem::transmute::<__m256, [Padded; 2]>(register) }
    }
}
