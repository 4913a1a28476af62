//! Eight lanes in one AVX register.
//!
//! The functions here are inlined into kernels that enable AVX2 and FMA, and F16C if they read half precision;
//! only such kernels may use [`Register`], which is why every `SAFETY` below can rely on it.

#![allow(unsafe_code)] // vector instructions, reached only from functions that enable them

use std::arch::x86_64::{
    __m128, __m128i, __m256, _CMP_GT_OQ, _MM_FROUND_TO_NEAREST_INT, _mm_add_ps, _mm_loadu_ps,
    _mm_loadu_si128, _mm_storeu_ps, _mm256_add_ps, _mm256_castps128_ps256, _mm256_castps256_ps128,
    _mm256_cmp_ps, _mm256_cvtpd_ps, _mm256_cvtph_ps, _mm256_cvtps_ph, _mm256_div_ps, _mm256_extractf128_ps,
    _mm256_fmadd_ps, _mm256_insertf128_ps, _mm256_loadu_pd, _mm256_loadu_ps, _mm256_max_ps,
    _mm256_movemask_ps, _mm256_mul_ps, _mm256_permute2f128_ps, _mm256_set1_ps, _mm256_setzero_ps,
    _mm256_shuffle_ps, _mm256_sqrt_ps, _mm256_storeu_ps, _mm256_sub_pd, _mm256_sub_ps, _mm256_unpackhi_ps,
    _mm256_unpacklo_ps, _mm256_xor_ps,
};
use std::ops::{Add, Mul, Neg, Sub};

use super::lanes::{Halves, Ids, Lanes, Vector, Vector8};

/// Eight lanes in one AVX register, for use only inside functions that enable AVX2 and FMA.
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub struct Register(pub(super) __m256);

macro_rules! lanewise {
    ($trait:ident, $method:ident, $intrinsic:ident) => {
        impl $trait for Register {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                // SAFETY: only reached from functions that enable AVX2.
                Self(unsafe { $intrinsic(self.0, other.0) })
            }
        }
    };
}
lanewise!(Add, add, _mm256_add_ps);
lanewise!(Sub, sub, _mm256_sub_ps);
lanewise!(Mul, mul, _mm256_mul_ps);

impl Neg for Register {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        // SAFETY: only reached from functions that enable AVX2.
        Self(unsafe { _mm256_xor_ps(self.0, _mm256_set1_ps(-0.0)) })
    }
}

impl Vector for Register {
    const ALL: u16 = 0xFF;

    #[inline(always)]
    fn splat(value: f32) -> Self {
        // SAFETY: only reached from functions that enable AVX2.
        Self(unsafe { _mm256_set1_ps(value) })
    }

    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        // SAFETY: only reached from functions that enable FMA.
        Self(unsafe { _mm256_fmadd_ps(self.0, b.0, c.0) })
    }

    #[inline(always)]
    fn recip(self) -> Self {
        // SAFETY: only reached from functions that enable AVX2.
        Self(unsafe { _mm256_div_ps(_mm256_set1_ps(1.0), self.0) })
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        // SAFETY: only reached from functions that enable AVX2.
        Self(unsafe { _mm256_sqrt_ps(self.0) })
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        // SAFETY: only reached from functions that enable AVX2.
        Self(unsafe { _mm256_max_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn above(self, threshold: f32) -> u16 {
        // SAFETY: only reached from functions that enable AVX2.
        unsafe { _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_GT_OQ>(self.0, _mm256_set1_ps(threshold))) as u16 }
    }

    #[inline(always)]
    fn with_second(self, _: Self) -> Self {
        self
    }
}

impl Vector8 for Register {
    #[inline(always)]
    fn load(lanes: &Lanes) -> Self {
        // SAFETY: both are 32 bytes of plain f32.
        Self(unsafe { _mm256_loadu_ps(lanes.0.as_ptr()) })
    }

    #[inline(always)]
    fn load_half(halves: &Halves) -> Self {
        // SAFETY: 16 bytes; only reached from functions that enable F16C.
        Self(unsafe { _mm256_cvtph_ps(_mm_loadu_si128(halves.0.as_ptr().cast())) })
    }

    #[inline(always)]
    fn store(self) -> Lanes {
        // SAFETY: both are 32 bytes of plain f32.
        unsafe { std::mem::transmute::<__m256, Lanes>(self.0) }
    }

    #[inline(always)]
    fn store_half(self) -> Halves {
        // SAFETY: both are 16 bytes; only reached from functions that enable F16C.
        unsafe {
            let halves = _mm256_cvtps_ph::<_MM_FROUND_TO_NEAREST_INT>(self.0);
            std::mem::transmute::<__m128i, Halves>(halves)
        }
    }

    #[inline(always)]
    fn transposed([a, b, c, d, e, f, g, h]: [Self; 8]) -> [Self; 8] {
        // SAFETY: only reached from functions that enable AVX2.
        unsafe {
            let [a, b, c, d] = quarters([a.0, b.0, c.0, d.0]);
            let [e, f, g, h] = quarters([e.0, f.0, g.0, h.0]);
            [
                Self(_mm256_permute2f128_ps::<0x20>(a, e)),
                Self(_mm256_permute2f128_ps::<0x20>(b, f)),
                Self(_mm256_permute2f128_ps::<0x20>(c, g)),
                Self(_mm256_permute2f128_ps::<0x20>(d, h)),
                Self(_mm256_permute2f128_ps::<0x31>(a, e)),
                Self(_mm256_permute2f128_ps::<0x31>(b, f)),
                Self(_mm256_permute2f128_ps::<0x31>(c, g)),
                Self(_mm256_permute2f128_ps::<0x31>(d, h)),
            ]
        }
    }

    #[inline(always)]
    unsafe fn gather(x: &[[f32; 4]], ids: &Ids) -> [Self; 3] {
        // SAFETY: the caller keeps `ids` below the length; rows hold four numbers each.
        unsafe {
            columns([
                pair(row(x, ids[0]), row(x, ids[4])),
                pair(row(x, ids[1]), row(x, ids[5])),
                pair(row(x, ids[2]), row(x, ids[6])),
                pair(row(x, ids[3]), row(x, ids[7])),
            ])
        }
    }

    #[inline(always)]
    unsafe fn gather_edges(x: &[[f64; 4]], from: &Ids, to: &Ids) -> [Self; 3] {
        // SAFETY: the caller keeps the numbers below the length; rows hold four numbers each.
        unsafe {
            columns([
                pair(edge(x, from[0], to[0]), edge(x, from[4], to[4])),
                pair(edge(x, from[1], to[1]), edge(x, from[5], to[5])),
                pair(edge(x, from[2], to[2]), edge(x, from[6], to[6])),
                pair(edge(x, from[3], to[3]), edge(x, from[7], to[7])),
            ])
        }
    }

    #[inline(always)]
    unsafe fn scatter(y: &mut [[f32; 4]], ids: &Ids, [x, y_, z]: [Self; 3]) {
        // SAFETY: the caller keeps `ids` below the length; rows hold four numbers each.
        unsafe {
            let rows = rows(x.0, y_.0, z.0);
            for k in 0..4 {
                add_row(y, ids[k], _mm256_castps256_ps128(rows[k]));
            }
            for k in 0..4 {
                add_row(y, ids[k + 4], _mm256_extractf128_ps::<1>(rows[k]));
            }
        }
    }

    #[inline(always)]
    unsafe fn scatter_blocks(y: &mut [[f32; 8]], ids: &Ids, [xx, xy, xz, yy, yz, zz]: [Self; 6]) {
        // SAFETY: the caller keeps `ids` below the length; rows hold eight numbers each.
        unsafe {
            let (low, high) = (rows(xx.0, xy.0, xz.0), rows(yy.0, yz.0, zz.0));
            for k in 0..4 {
                add_block(y, ids[k], _mm256_permute2f128_ps::<0x20>(low[k], high[k]));
            }
            for k in 0..4 {
                add_block(y, ids[k + 4], _mm256_permute2f128_ps::<0x31>(low[k], high[k]));
            }
        }
    }
}

#[inline(always)]
pub(super) unsafe fn row(x: &[[f32; 4]], id: u16) -> __m128 {
    // SAFETY: the caller keeps `id` below the length; a row holds four numbers.
    unsafe { _mm_loadu_ps(x.as_ptr().add(id as usize).cast()) }
}

#[inline(always)]
unsafe fn edge(x: &[[f64; 4]], from: u16, to: u16) -> __m128 {
    // SAFETY: the caller keeps the numbers below the length; a row holds four numbers.
    unsafe {
        let p = _mm256_loadu_pd(x.as_ptr().add(from as usize).cast());
        let q = _mm256_loadu_pd(x.as_ptr().add(to as usize).cast());
        _mm256_cvtpd_ps(_mm256_sub_pd(q, p))
    }
}

#[inline(always)]
pub(super) unsafe fn add_row(y: &mut [[f32; 4]], id: u16, part: __m128) {
    // SAFETY: the caller keeps `id` below the length; a row holds four numbers.
    unsafe {
        let row = y.as_mut_ptr().add(id as usize).cast();
        _mm_storeu_ps(row, _mm_add_ps(_mm_loadu_ps(row), part));
    }
}

#[inline(always)]
unsafe fn add_block(y: &mut [[f32; 8]], id: u16, part: __m256) {
    // SAFETY: the caller keeps `id` below the length; a row holds eight numbers.
    unsafe {
        let row = y.as_mut_ptr().add(id as usize).cast();
        _mm256_storeu_ps(row, _mm256_add_ps(_mm256_loadu_ps(row), part));
    }
}

#[inline(always)]
unsafe fn pair(low: __m128, high: __m128) -> __m256 {
    // SAFETY: only reached from functions that enable AVX2.
    unsafe { _mm256_insertf128_ps::<1>(_mm256_castps128_ps256(low), high) }
}

/// Transposes pairs of rows (0 | 4), (1 | 5), (2 | 6), (3 | 7) of four numbers into their first three
/// columns.
#[inline(always)]
unsafe fn columns(rows: [__m256; 4]) -> [Register; 3] {
    // SAFETY: only reached from functions that enable AVX2.
    let [x, y, z, _] = unsafe { quarters(rows) };
    [Register(x), Register(y), Register(z)]
}

/// Transposes each half of four rows: of row k, entries k and k + 4 of all four.
#[inline(always)]
unsafe fn quarters([a, b, c, d]: [__m256; 4]) -> [__m256; 4] {
    // SAFETY: only reached from functions that enable AVX2.
    unsafe {
        let (low_ab, high_ab) = (_mm256_unpacklo_ps(a, b), _mm256_unpackhi_ps(a, b));
        let (low_cd, high_cd) = (_mm256_unpacklo_ps(c, d), _mm256_unpackhi_ps(c, d));
        [
            _mm256_shuffle_ps::<0x44>(low_ab, low_cd),
            _mm256_shuffle_ps::<0xEE>(low_ab, low_cd),
            _mm256_shuffle_ps::<0x44>(high_ab, high_cd),
            _mm256_shuffle_ps::<0xEE>(high_ab, high_cd),
        ]
    }
}

/// Transposes three columns into pairs of rows (x, y, z, 0): (0 | 4), (1 | 5), (2 | 6), (3 | 7).
#[inline(always)]
unsafe fn rows(x: __m256, y: __m256, z: __m256) -> [__m256; 4] {
    // SAFETY: only reached from functions that enable AVX2.
    unsafe { quarters([x, y, z, _mm256_setzero_ps()]) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::element::{LANES, Simd};

    const N: usize = 11;

    /// Results of every method for some rows, to compare registers with plain lanes.
    #[inline(always)]
    fn everything<V: Vector8>(x: &[[f32; 4]; N], ids: &[Ids; 2]) -> (Vec<Lanes>, Vec<u16>, Vec<f32>) {
        let wide: Vec<[f64; 4]> = x.iter().map(|r| [r[0] + 1e6, r[1], r[2], 0.0].map(f64::from)).collect();
        // SAFETY: the test's ids are below N.
        let ([a, b, c], e) = unsafe { (V::gather(x, &ids[0]), V::gather_edges(&wide, &ids[0], &ids[1])) };
        let value = (a.mul_add(b, -c) - a).sqrt().recip() + V::splat(2.0) * b;
        let (mut f, mut blocks) = ([[0.5; 4]; N], [[0.25; 8]; N]);
        // SAFETY: as above.
        unsafe {
            V::scatter(&mut f, &ids[1], [a, b, c]);
            V::scatter_blocks(&mut blocks, &ids[1], [a, b, c, c, b, a]);
        }
        let lanes = [a, b, c, e[0], e[1], e[2], value].into_iter();
        let lanes =
            lanes.chain(V::transposed([a, b, c, e[0], e[1], e[2], value, a + b])).map(V::store).collect();
        let mask = vec![a.above(4.5), V::splat(f32::NAN).above(0.0)];
        (lanes, mask, f.iter().flatten().chain(blocks.iter().flatten()).copied().collect())
    }

    #[target_feature(enable = "avx2,fma")]
    fn in_registers(x: &[[f32; 4]; N], ids: &[Ids; 2]) -> (Vec<Lanes>, Vec<u16>, Vec<f32>) {
        everything::<Register>(x, ids)
    }

    #[test]
    fn registers_do_what_lanes_do() {
        if Simd::detect() == Simd::Baseline {
            return;
        }
        let x: [[f32; 4]; N] = std::array::from_fn(|i| {
            let t = i as f32;
            [1.0 + t, 10.0 + (0.7 * t).sin(), 2.0 - 0.1 * t, 0.0]
        });
        // A row may occur in several lanes.
        let ids = [[0, 3, 10, 1, 7, 7, 2, 5], [4, 4, 4, 9, 8, 0, 10, 6]];
        // SAFETY: the instructions were detected.
        let (lanes, mask, rows) = unsafe { in_registers(&x, &ids) };
        let (expected_lanes, expected_mask, expected_rows) = everything::<Lanes>(&x, &ids);
        assert_eq!((mask, rows), (expected_mask, expected_rows));
        for (a, b) in lanes.iter().zip(&expected_lanes) {
            assert!(a.0.iter().zip(&b.0).all(|(a, b)| (a - b).abs() < 1e-5), "{a:?} {b:?}");
        }
        let picked: [f32; LANES] = std::array::from_fn(|lane| x[ids[0][lane] as usize][1]);
        assert_eq!(lanes[1].0, picked);
    }
}
