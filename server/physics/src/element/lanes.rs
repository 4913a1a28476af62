//! Eight single-precision numbers that are computed together.
//!
//! Plain arrays: the compiler turns the loops into vector instructions of whatever set is enabled
//! around them, so the same source serves the portable and the AVX2 path.

use std::ops::{Add, AddAssign, Mul, Neg, Sub};

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

impl Lanes {
    /// The same number in every lane.
    #[inline(always)]
    pub fn splat(value: f32) -> Self {
        Self([value; LANES])
    }

    /// self · b + c, fused where `FMA` (never call it fused without the instruction: that is a
    /// library call).
    #[inline(always)]
    pub fn mul_add<const FMA: bool>(self, b: Self, c: Self) -> Self {
        let mut out = c;
        for i in 0..LANES {
            out.0[i] = if FMA { self.0[i].mul_add(b.0[i], c.0[i]) } else { self.0[i] * b.0[i] + c.0[i] };
        }
        out
    }

    /// 1 / self.
    #[inline(always)]
    pub fn recip(self) -> Self {
        Self(self.0.map(|v| 1.0 / v))
    }

    /// √self.
    #[inline(always)]
    pub fn sqrt(self) -> Self {
        Self(self.0.map(f32::sqrt))
    }

    /// |self|.
    #[inline(always)]
    pub fn abs(self) -> Self {
        Self(self.0.map(f32::abs))
    }
}

macro_rules! lanewise {
    ($trait:ident, $method:ident, $op:tt) => {
        impl $trait for Lanes {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                let mut out = self;
                for i in 0..LANES {
                    out.0[i] = self.0[i] $op other.0[i];
                }
                out
            }
        }
    };
}
lanewise!(Add, add, +);
lanewise!(Sub, sub, -);
lanewise!(Mul, mul, *);

impl AddAssign for Lanes {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Neg for Lanes {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(self.0.map(|v| -v))
    }
}
