//! Eight single-precision numbers that are computed together.
//!
//! Kernels are written once over [`Vector8`]. [`Lanes`] is its portable form and the form in memory;
//! on x86-64 the same kernels run on AVX2 registers behind run-time detection. (Leaving it to the
//! compiler to find vectors in plain arrays costs a factor of four.)

#![allow(unsafe_code)] // vector instructions, reached only from functions that enable them

use std::ops::{Add, Mul, Neg, Sub};

/// Number of lanes.
pub const LANES: usize = 8;

/// Eight `f32`, one per element of a batch.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C, align(32))]
pub struct Lanes(
    /// The eight numbers.
    pub [f32; LANES],
);

/// The instruction set the kernels use.
///
/// AVX2 contracts multiply-adds, so the two differ in the last bits; each alone is reproducible.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Simd {
    /// What every machine of the architecture has. Same bits on every such machine.
    Baseline,
    /// AVX2 with fused multiply-add.
    Avx2,
}

impl Simd {
    /// The best set of this machine.
    pub fn detect() -> Self {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma") {
            return Simd::Avx2;
        }
        Simd::Baseline
    }
}

/// Arithmetic on eight lanes.
pub trait Vector8:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Neg<Output = Self>
{
    /// The same number in every lane.
    fn splat(value: f32) -> Self;
    /// From memory.
    fn load(lanes: &Lanes) -> Self;
    /// To memory.
    fn store(self) -> Lanes;
    /// self · b + c, fused where the machine can.
    fn mul_add(self, b: Self, c: Self) -> Self;
    /// 1 / self.
    fn recip(self) -> Self;
    /// √self.
    fn sqrt(self) -> Self;
    /// Eight rows (x, y, z, ·) to the vectors of x, y and z.
    fn transpose(rows: [&[f32; 4]; LANES]) -> [Self; 3];
    /// Vectors of x, y and z to eight rows (x, y, z, 0).
    fn transpose_back(columns: [Self; 3]) -> [[f32; 4]; LANES];
}

impl Vector8 for Lanes {
    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self([value; LANES])
    }

    #[inline(always)]
    fn load(lanes: &Lanes) -> Self {
        *lanes
    }

    #[inline(always)]
    fn store(self) -> Lanes {
        self
    }

    // Never `f32::mul_add`: without the instruction that is a library call.
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        self * b + c
    }

    #[inline(always)]
    fn recip(self) -> Self {
        Self(self.0.map(|v| 1.0 / v))
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.map(f32::sqrt))
    }

    #[inline(always)]
    fn transpose(rows: [&[f32; 4]; LANES]) -> [Self; 3] {
        [0, 1, 2].map(|i| Self(rows.map(|row| row[i])))
    }

    #[inline(always)]
    fn transpose_back([x, y, z]: [Self; 3]) -> [[f32; 4]; LANES] {
        std::array::from_fn(|lane| [x.0[lane], y.0[lane], z.0[lane], 0.0])
    }
}

macro_rules! lanewise {
    ($trait:ident, $method:ident, $op:tt, $intrinsic:ident) => {
        impl $trait for Lanes {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(std::array::from_fn(|i| self.0[i] $op other.0[i]))
            }
        }

        #[cfg(target_arch = "x86_64")]
        impl $trait for avx2::Register {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                // SAFETY: only reached from functions that enable AVX2.
                Self(unsafe { std::arch::x86_64::$intrinsic(self.0, other.0) })
            }
        }
    };
}
lanewise!(Add, add, +, _mm256_add_ps);
lanewise!(Sub, sub, -, _mm256_sub_ps);
lanewise!(Mul, mul, *, _mm256_mul_ps);

impl Neg for Lanes {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(self.0.map(|v| -v))
    }
}

/// Eight lanes in one AVX register.
#[cfg(target_arch = "x86_64")]
pub mod avx2 {
    use std::arch::x86_64::{
        __m256, _mm_loadu_ps, _mm256_castps128_ps256, _mm256_div_ps, _mm256_fmadd_ps, _mm256_insertf128_ps,
        _mm256_set1_ps, _mm256_setzero_ps, _mm256_shuffle_ps, _mm256_sqrt_ps, _mm256_unpackhi_ps,
        _mm256_unpacklo_ps, _mm256_xor_ps,
    };
    use std::ops::Neg;

    use super::{LANES, Lanes, Vector8};

    /// Eight lanes in one AVX register. To be used only inside functions that enable AVX2 and FMA.
    #[derive(Clone, Copy, Debug)]
    #[repr(transparent)]
    pub struct Register(pub(super) __m256);

    impl Neg for Register {
        type Output = Self;
        #[inline(always)]
        fn neg(self) -> Self {
            // SAFETY: only reached from functions that enable AVX2.
            Self(unsafe { _mm256_xor_ps(self.0, _mm256_set1_ps(-0.0)) })
        }
    }

    impl Vector8 for Register {
        #[inline(always)]
        fn splat(value: f32) -> Self {
            // SAFETY: only reached from functions that enable AVX2.
            Self(unsafe { _mm256_set1_ps(value) })
        }

        #[inline(always)]
        fn load(lanes: &Lanes) -> Self {
            // SAFETY: both are 32 bytes of plain f32.
            Self(unsafe { std::mem::transmute::<Lanes, __m256>(*lanes) })
        }

        #[inline(always)]
        fn store(self) -> Lanes {
            // SAFETY: both are 32 bytes of plain f32.
            unsafe { std::mem::transmute::<__m256, Lanes>(self.0) }
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
        fn transpose(rows: [&[f32; 4]; LANES]) -> [Self; 3] {
            // SAFETY: only reached from functions that enable AVX2; rows hold four numbers each.
            unsafe {
                let pair = |low: usize, high: usize| {
                    let low = _mm256_castps128_ps256(_mm_loadu_ps(rows[low].as_ptr()));
                    _mm256_insertf128_ps::<1>(low, _mm_loadu_ps(rows[high].as_ptr()))
                };
                let (r04, r15, r26, r37) = (pair(0, 4), pair(1, 5), pair(2, 6), pair(3, 7));
                let (xy01, xy23) = (_mm256_unpacklo_ps(r04, r15), _mm256_unpacklo_ps(r26, r37));
                let (zw01, zw23) = (_mm256_unpackhi_ps(r04, r15), _mm256_unpackhi_ps(r26, r37));
                [
                    Self(_mm256_shuffle_ps::<0x44>(xy01, xy23)),
                    Self(_mm256_shuffle_ps::<0xEE>(xy01, xy23)),
                    Self(_mm256_shuffle_ps::<0x44>(zw01, zw23)),
                ]
            }
        }

        #[inline(always)]
        fn transpose_back([x, y, z]: [Self; 3]) -> [[f32; 4]; LANES] {
            // SAFETY: only reached from functions that enable AVX2.
            unsafe {
                let (x, y, z, w) = (x.0, y.0, z.0, _mm256_setzero_ps());
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
    fn halves(register: __m256) -> [[f32; 4]; 2] {
        // SAFETY: both are 32 bytes of plain f32.
        unsafe { std::mem::transmute::<__m256, [[f32; 4]; 2]>(register) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn transposition_goes_there_and_back() {
        let rows: [[f32; 4]; LANES] =
            std::array::from_fn(|i| [i as f32, 10.0 + i as f32, 20.0 + i as f32, 9.0]);
        let columns = Lanes::transpose(std::array::from_fn(|i| &rows[i]));
        assert_eq!(columns[1].0, [10.0, 11.0, 12.0, 13.0, 14.0, 15.0, 16.0, 17.0]);
        let back = Lanes::transpose_back(columns);
        assert!(back.iter().zip(&rows).all(|(b, r)| b[..3] == r[..3] && b[3] == 0.0));
    }

    #[cfg(target_arch = "x86_64")]
    #[test]
    fn registers_do_what_lanes_do() {
        #[target_feature(enable = "avx2,fma")]
        fn run(rows: &[[f32; 4]; LANES]) -> ([Lanes; 3], [[f32; 4]; LANES], Lanes) {
            let columns = avx2::Register::transpose(std::array::from_fn(|i| &rows[i]));
            let [x, y, z] = columns;
            let value = (x.mul_add(y, -z) - x).sqrt().recip() + avx2::Register::splat(2.0) * y;
            (columns.map(Vector8::store), avx2::Register::transpose_back(columns), value.store())
        }
        if Simd::detect() == Simd::Avx2 {
            let rows: [[f32; 4]; LANES] = std::array::from_fn(|i| [5.0 + i as f32, 10.0, 2.0, 9.0]);
            // SAFETY: the instructions were detected.
            let (columns, back, value) = unsafe { run(&rows) };
            let [x, y, z] = Lanes::transpose(std::array::from_fn(|i| &rows[i]));
            assert_eq!(columns, [x, y, z]);
            assert_eq!(back, Lanes::transpose_back([x, y, z]));
            let expected = (x.mul_add(y, -z) - x).sqrt().recip() + Lanes::splat(2.0) * y;
            assert!(value.0.iter().zip(expected.0).all(|(a, b)| (a - b).abs() < 1e-5));
        }
    }
}
