//! Two batches of eight lanes in one AVX-512 register.
//!
//! Arithmetic works on both batches at once. Rows are gathered and scattered as for one batch after the other, so all
//! sums have the order, and the bits, that they have with AVX2.
//!
//! The functions here are inlined into kernels that enable AVX-512; only such kernels may use [`Register512`], which
//! is why every `SAFETY` below can rely on it.

#![allow(unsafe_code)] // vector instructions, reached only from functions that enable them

use std::arch::x86_64::{
    __m512, _CMP_GT_OQ, _mm256_castpd_ps, _mm256_castps_pd, _mm256_loadu_ps, _mm512_add_ps,
    _mm512_broadcast_f64x4, _mm512_castpd_ps, _mm512_castps_pd, _mm512_castps_si512, _mm512_castps128_ps512,
    _mm512_castps256_ps512, _mm512_castps512_ps128, _mm512_castps512_ps256, _mm512_castsi512_ps,
    _mm512_cmp_ps_mask, _mm512_div_ps, _mm512_extractf32x4_ps, _mm512_extractf64x4_pd, _mm512_fmadd_ps,
    _mm512_insertf32x4, _mm512_insertf64x4, _mm512_mask_blend_ps, _mm512_max_ps, _mm512_mul_ps,
    _mm512_set1_ps, _mm512_setzero_ps, _mm512_shuffle_ps, _mm512_sqrt_ps, _mm512_sub_ps, _mm512_unpackhi_ps,
    _mm512_unpacklo_ps, _mm512_xor_si512,
};
use std::ops::{Add, Mul, Neg, Sub};

use super::avx2::{Register, add_row, row};
use super::lanes::{Batched, Ids, Lanes, Vector, Vector8};

/// The lanes of two batches, for use only inside functions that enable AVX-512, AVX2 and FMA.
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub struct Register512(__m512);

macro_rules! lanewise {
    ($trait:ident, $method:ident, $intrinsic:ident) => {
        impl $trait for Register512 {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                // SAFETY: only reached from functions that enable AVX-512.
                Self(unsafe { $intrinsic(self.0, other.0) })
            }
        }
    };
}
lanewise!(Add, add, _mm512_add_ps);
lanewise!(Sub, sub, _mm512_sub_ps);
lanewise!(Mul, mul, _mm512_mul_ps);

impl Neg for Register512 {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        // SAFETY: only reached from functions that enable AVX-512.
        Self(unsafe {
            _mm512_castsi512_ps(_mm512_xor_si512(
                _mm512_castps_si512(self.0),
                _mm512_castps_si512(_mm512_set1_ps(-0.0)),
            ))
        })
    }
}

impl Vector for Register512 {
    const ALL: u16 = u16::MAX;

    #[inline(always)]
    fn splat(value: f32) -> Self {
        // SAFETY: only reached from functions that enable AVX-512.
        Self(unsafe { _mm512_set1_ps(value) })
    }

    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        // SAFETY: only reached from functions that enable AVX-512.
        Self(unsafe { _mm512_fmadd_ps(self.0, b.0, c.0) })
    }

    #[inline(always)]
    fn recip(self) -> Self {
        // SAFETY: only reached from functions that enable AVX-512.
        Self(unsafe { _mm512_div_ps(_mm512_set1_ps(1.0), self.0) })
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        // SAFETY: only reached from functions that enable AVX-512.
        Self(unsafe { _mm512_sqrt_ps(self.0) })
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        // SAFETY: only reached from functions that enable AVX-512.
        Self(unsafe { _mm512_max_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn above(self, threshold: f32) -> u16 {
        // SAFETY: only reached from functions that enable AVX-512.
        unsafe { _mm512_cmp_ps_mask::<_CMP_GT_OQ>(self.0, _mm512_set1_ps(threshold)) }
    }

    #[inline(always)]
    fn with_second(self, other: Self) -> Self {
        // SAFETY: only reached from functions that enable AVX-512.
        Self(unsafe { _mm512_mask_blend_ps(0xFF00, self.0, other.0) })
    }
}

impl Batched<2> for Register512 {
    type Part = Register;

    #[inline(always)]
    fn read<B>(from: &[B; 2], field: impl Fn(&B) -> &Lanes) -> Self {
        pair(Register::load(field(&from[0])), Register::load(field(&from[1])))
    }

    #[inline(always)]
    fn shared(lanes: &Lanes) -> Self {
        // SAFETY: 32 bytes of plain f32; only reached from functions that enable AVX-512.
        Self(unsafe {
            _mm512_castpd_ps(_mm512_broadcast_f64x4(_mm256_castps_pd(_mm256_loadu_ps(lanes.0.as_ptr()))))
        })
    }

    #[inline(always)]
    fn part(self, batch: usize) -> Register {
        // SAFETY: only reached from functions that enable AVX-512.
        Register(unsafe {
            if batch == 0 {
                _mm512_castps512_ps256(self.0)
            } else {
                _mm256_castpd_ps(_mm512_extractf64x4_pd::<1>(_mm512_castps_pd(self.0)))
            }
        })
    }

    #[inline(always)]
    unsafe fn gather_all<B>(x: &[[f32; 4]], from: &[B; 2], ids: impl Fn(&B) -> &Ids) -> [Self; 3] {
        let (first, second) = (ids(&from[0]), ids(&from[1]));
        // SAFETY: the caller keeps the numbers below the length; rows hold four numbers each.
        let [x, y, z, _] = unsafe {
            quarters([
                rows_512(x, [first[0], first[4], second[0], second[4]]),
                rows_512(x, [first[1], first[5], second[1], second[5]]),
                rows_512(x, [first[2], first[6], second[2], second[6]]),
                rows_512(x, [first[3], first[7], second[3], second[7]]),
            ])
        };
        [Self(x), Self(y), Self(z)]
    }

    #[inline(always)]
    unsafe fn scatter_all<'a, const M: usize>(
        y: &mut [[f32; 4]],
        ids: impl Fn(usize) -> [&'a Ids; M],
        f: &[[Self; 3]; M],
    ) {
        let (first, second) = (ids(0), ids(1));
        // SAFETY: the caller keeps the numbers below the length; rows hold four numbers each.
        unsafe {
            let mut rows = [[_mm512_setzero_ps(); 4]; M];
            for m in 0..M {
                rows[m] = quarters([f[m][0].0, f[m][1].0, f[m][2].0, _mm512_setzero_ps()]);
            }
            for m in 0..M {
                for k in 0..4 {
                    add_row(y, first[m][k], _mm512_castps512_ps128(rows[m][k]));
                }
                for k in 0..4 {
                    add_row(y, first[m][k + 4], _mm512_extractf32x4_ps::<1>(rows[m][k]));
                }
            }
            for m in 0..M {
                for k in 0..4 {
                    add_row(y, second[m][k], _mm512_extractf32x4_ps::<2>(rows[m][k]));
                }
                for k in 0..4 {
                    add_row(y, second[m][k + 4], _mm512_extractf32x4_ps::<3>(rows[m][k]));
                }
            }
        }
    }

    #[inline(always)]
    unsafe fn gather_all_edges<B>(x: &[[f64; 4]], from: &[B; 2], ids: impl Fn(&B) -> [&Ids; 2]) -> [Self; 3] {
        let ([first, second], [third, fourth]) = (ids(&from[0]), ids(&from[1]));
        // SAFETY: the caller's promise.
        let ([a, b, c], [d, e, f]) =
            unsafe { (Register::gather_edges(x, first, second), Register::gather_edges(x, third, fourth)) };
        [pair(a, d), pair(b, e), pair(c, f)]
    }
}

/// Four rows of four numbers, one after the other.
#[inline(always)]
unsafe fn rows_512(x: &[[f32; 4]], ids: [u16; 4]) -> __m512 {
    // SAFETY: the caller keeps `ids` below the length; only reached from functions that enable AVX-512.
    unsafe {
        let rows = _mm512_castps128_ps512(row(x, ids[0]));
        let rows = _mm512_insertf32x4::<1>(rows, row(x, ids[1]));
        let rows = _mm512_insertf32x4::<2>(rows, row(x, ids[2]));
        _mm512_insertf32x4::<3>(rows, row(x, ids[3]))
    }
}

/// Transposes each quarter of four rows: of row k, entries k, k + 4, k + 8 and k + 12 of all four.
#[inline(always)]
unsafe fn quarters([a, b, c, d]: [__m512; 4]) -> [__m512; 4] {
    // SAFETY: only reached from functions that enable AVX-512.
    unsafe {
        let (low_ab, high_ab) = (_mm512_unpacklo_ps(a, b), _mm512_unpackhi_ps(a, b));
        let (low_cd, high_cd) = (_mm512_unpacklo_ps(c, d), _mm512_unpackhi_ps(c, d));
        [
            _mm512_shuffle_ps::<0x44>(low_ab, low_cd),
            _mm512_shuffle_ps::<0xEE>(low_ab, low_cd),
            _mm512_shuffle_ps::<0x44>(high_ab, high_cd),
            _mm512_shuffle_ps::<0xEE>(high_ab, high_cd),
        ]
    }
}

/// The lanes of one batch, then those of another.
#[inline(always)]
fn pair(first: Register, second: Register) -> Register512 {
    // SAFETY: only reached from functions that enable AVX-512.
    Register512(unsafe {
        let wide = _mm512_castps_pd(_mm512_castps256_ps512(first.0));
        _mm512_castpd_ps(_mm512_insertf64x4::<1>(wide, _mm256_castps_pd(second.0)))
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use nalgebra::{Matrix3, Rotation3, Vector3};

    use super::*;
    use crate::element::{LANES, Mat3, Simd, polar_newton};

    type Turned = (Mat3<Lanes>, u16);

    #[target_feature(enable = "avx2,fma")]
    fn alone(F: &Mat3<Lanes>) -> Turned {
        let (mut X, mut out) = ([Register::splat(0.0); 9], [Lanes::default(); 9]);
        X.iter_mut().zip(F).for_each(|(x, f)| *x = Register::load(f));
        let (R, trusted) = polar_newton(&X);
        out.iter_mut().zip(R).for_each(|(out, r)| *out = r.store());
        (out, trusted)
    }

    #[target_feature(enable = "avx512f,avx2,fma")]
    fn together(F: &[Mat3<Lanes>; 2]) -> [Turned; 2] {
        let mut X = [Register512::splat(0.0); 9];
        X.iter_mut().enumerate().for_each(|(i, x)| *x = Register512::read(F, |F| &F[i]));
        let (R, trusted) = polar_newton(&X);
        [0, 1].map(|batch| (R.map(|r| r.part(batch).store()), trusted >> (8 * batch) & 0xFF))
    }

    /// Whatever the stretches of its neighbour, a batch has the rotations that it has alone, to the last bit.
    #[test]
    fn a_batch_turns_as_if_it_were_alone() {
        if Simd::detect() != Simd::Avx512 {
            return;
        }
        let batch = |stretch: f64, seed: usize| {
            let mut F = [Lanes::default(); 9];
            for lane in 0..LANES {
                let t = (seed * LANES + lane) as f64;
                let turn = Rotation3::new(Vector3::new(t.sin(), (2.3 * t).cos(), (0.7 * t).sin()) * 2.0);
                let stretched = Vector3::new(1.0 + stretch * t.cos(), 1.0 - 0.5 * stretch * t.sin(), 1.0);
                let gradient = turn.matrix() * Matrix3::from_diagonal(&stretched);
                (0..9).for_each(|i| F[i].0[lane] = gradient[(i / 3, i % 3)] as f32);
            }
            F
        };
        // Three, four and five iterations, and lanes that are not to be trusted.
        let stretches = [0.0, 0.02, 0.3, 0.8, 1.2];
        for (i, &first) in stretches.iter().enumerate() {
            for (j, &second) in stretches.iter().enumerate() {
                let pair = [batch(first, 2 * i + 1), batch(second, 2 * j)];
                // SAFETY: the instructions were detected.
                let (both, each) = unsafe { (together(&pair), pair.map(|F| alone(&F))) };
                let bits =
                    |of: [Turned; 2]| of.map(|(R, trusted)| (R.map(|r| r.0.map(f32::to_bits)), trusted));
                assert_eq!(bits(both), bits(each), "{first} beside {second}");
            }
        }
    }
}
