//! Eight single-precision numbers that are computed together.
//!
//! Kernels are written once, over [`Vector8`]. [`Lanes`] is its portable implementation and the form in
//! memory. On x86-64 the same kernels run on AVX2 registers, chosen by run-time detection. (Leaving the
//! vectorisation of plain arrays to the compiler costs a factor of four.) Kernels over [`Batched`] compute two batches
//! at once where there is AVX-512, with the same bits.
//!
//! Code over [`Vector`] uses only loops and plain arrays. The closures of `array::map` and `array::from_fn`
//! are compiled without the instruction set of the kernel around them, and a single call that is not inlined
//! costs more than its arithmetic.

#![allow(unsafe_code)] // unchecked rows; vector instructions are in `avx2`

use std::ops::{Add, Mul, Neg, Sub};

use half::f16;

/// Number of lanes.
pub const LANES: usize = 8;

/// Eight `f32`, one per element of a batch.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[repr(C, align(32))]
pub struct Lanes(
    /// The eight numbers.
    pub [f32; LANES],
);

/// Eight numbers in half precision: eleven significant bits, magnitudes up to 65504.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[repr(C, align(16))]
pub struct Halves(
    /// Their bits.
    pub [u16; LANES],
);

/// The instruction set that the kernels use.
///
/// AVX2 contracts multiply-adds, so its results differ from those without it in the last bits. Each alone is
/// reproducible. Those of AVX-512 are those of AVX2.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Simd {
    /// Instructions that every machine of the architecture has. All such machines compute the same bits.
    Baseline,
    /// AVX2 with fused multiply-add and the conversion of half precision.
    Avx2,
    /// The same, and AVX-512 for kernels of which two batches fit into its registers.
    Avx512,
}

/// A state that was computed with instructions that this machine lacks cannot go on with the same bits.
impl<'de> serde::Deserialize<'de> for Simd {
    fn deserialize<D: serde::Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        match bool::deserialize(from)? {
            false => Ok(Self::Baseline),
            true if Self::detect() != Self::Baseline => Ok(Self::detect()),
            true => Err(serde::de::Error::custom(
                "the state was computed with AVX2, which this machine lacks; continue on one that has it",
            )),
        }
    }
}

impl serde::Serialize for Simd {
    fn serialize<S: serde::Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        (*self != Self::Baseline).serialize(to)
    }
}

impl Simd {
    /// The best instruction set of this machine.
    pub fn detect() -> Self {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2")
            && std::arch::is_x86_feature_detected!("fma")
            && std::arch::is_x86_feature_detected!("f16c")
        {
            return if std::arch::is_x86_feature_detected!("avx512f") { Simd::Avx512 } else { Simd::Avx2 };
        }
        Simd::Baseline
    }
}

/// Row numbers of the eight lanes.
pub type Ids = [u16; LANES];

/// Arithmetic on the lanes of one batch or two.
pub trait Vector:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Neg<Output = Self>
{
    /// One bit for every lane.
    const ALL: u16;

    /// The same number in every lane.
    fn splat(value: f32) -> Self;
    /// self · b + c, fused where the machine can.
    fn mul_add(self, b: Self, c: Self) -> Self;
    /// 1 / self.
    fn recip(self) -> Self;
    /// √self.
    fn sqrt(self) -> Self;
    /// The larger one of both; `other` where one is NaN.
    fn max(self, other: Self) -> Self;
    /// One bit per lane, lane 0 lowest: set if the lane is above `threshold`. It is not set for NaN.
    fn above(self, threshold: f32) -> u16;
    /// The lanes of the first batch from `self`, and of the second, if there is one, from `other`.
    fn with_second(self, other: Self) -> Self;
}

/// Vectors over N batches, in which every batch has eight lanes.
pub trait Batched<const N: usize>: Vector {
    /// The lanes of one batch.
    type Part: Vector8;

    /// Reads a field of every batch.
    fn read<B>(from: &[B; N], field: impl Fn(&B) -> &Lanes) -> Self;
    /// The same numbers for every batch.
    fn shared(lanes: &Lanes) -> Self;
    /// Lanes of batch number `batch`.
    fn part(self, batch: usize) -> Self::Part;

    /// [`Vector8::gather`] with the ids of every batch.
    ///
    /// # Safety
    /// All ids are below the length of `x`.
    unsafe fn gather_all<B>(x: &[[f32; 4]], from: &[B; N], ids: impl Fn(&B) -> &Ids) -> [Self; 3];

    /// [`Vector8::gather_edges`] with two lists of ids of every batch.
    ///
    /// # Safety
    /// All ids are below the length of `x`.
    unsafe fn gather_all_edges<B>(x: &[[f64; 4]], from: &[B; N], ids: impl Fn(&B) -> [&Ids; 2]) -> [Self; 3];

    /// [`Vector8::scatter`] of M vectors of each lane, for one batch after the other. `ids` are those of a batch.
    ///
    /// # Safety
    /// All ids are below the length of `y`.
    #[inline(always)]
    unsafe fn scatter_all<'a, const M: usize>(
        y: &mut [[f32; 4]],
        ids: impl Fn(usize) -> [&'a Ids; M],
        f: &[[Self; 3]; M],
    ) {
        for batch in 0..N {
            let ids = ids(batch);
            for m in 0..M {
                let part = [f[m][0].part(batch), f[m][1].part(batch), f[m][2].part(batch)];
                // SAFETY: the caller's promise.
                unsafe { Self::Part::scatter(y, ids[m], part) };
            }
        }
    }

    /// Writes a field of every batch.
    #[inline(always)]
    fn write<B>(self, to: &mut [B; N], field: impl Fn(&mut B) -> &mut Lanes) {
        for batch in 0..N {
            *field(&mut to[batch]) = self.part(batch).store();
        }
    }
}

impl<V: Vector8> Batched<1> for V {
    type Part = V;

    #[inline(always)]
    fn read<B>(from: &[B; 1], field: impl Fn(&B) -> &Lanes) -> Self {
        V::load(field(&from[0]))
    }

    #[inline(always)]
    fn shared(lanes: &Lanes) -> Self {
        V::load(lanes)
    }

    #[inline(always)]
    fn part(self, _: usize) -> V {
        self
    }

    #[inline(always)]
    unsafe fn gather_all<B>(x: &[[f32; 4]], from: &[B; 1], ids: impl Fn(&B) -> &Ids) -> [Self; 3] {
        // SAFETY: the caller's promise.
        unsafe { V::gather(x, ids(&from[0])) }
    }

    #[inline(always)]
    unsafe fn gather_all_edges<B>(x: &[[f64; 4]], from: &[B; 1], ids: impl Fn(&B) -> [&Ids; 2]) -> [Self; 3] {
        let [from, to] = ids(&from[0]);
        // SAFETY: the caller's promise.
        unsafe { V::gather_edges(x, from, to) }
    }
}

/// Eight lanes and how they lie in memory.
pub trait Vector8: Vector {
    /// Reads eight numbers from memory.
    fn load(lanes: &Lanes) -> Self;
    /// Reads eight numbers in half precision from memory.
    fn load_half(halves: &Halves) -> Self;
    /// Writes eight numbers to memory.
    fn store(self) -> Lanes;
    /// Writes eight numbers to memory in half precision, rounded to nearest.
    fn store_half(self) -> Halves;
    /// The transpose of eight rows.
    fn transposed(rows: [Self; 8]) -> [Self; 8];

    /// Rows `ids` of `x` as vectors of x, y and z.
    ///
    /// # Safety
    /// All `ids` are below the length of `x`.
    unsafe fn gather(x: &[[f32; 4]], ids: &Ids) -> [Self; 3];

    /// Rows `to` minus rows `from` of `x`, subtracted in double precision and then rounded. The error is
    /// relative to the difference, not to the distance from the origin.
    ///
    /// # Safety
    /// All numbers in `from` and `to` are below the length of `x`.
    unsafe fn gather_edges(x: &[[f64; 4]], from: &Ids, to: &Ids) -> [Self; 3];

    /// Adds vectors of x, y and z to the rows `ids` of `y`, lane after lane.
    ///
    /// # Safety
    /// All `ids` are below the length of `y`.
    unsafe fn scatter(y: &mut [[f32; 4]], ids: &Ids, f: [Self; 3]);

    /// Adds (xx, xy, xz, yy, yz, zz) to the rows (xx, xy, xz, 0, yy, yz, zz, 0) `ids` of `y`, lane
    /// after lane.
    ///
    /// # Safety
    /// All `ids` are below the length of `y`.
    unsafe fn scatter_blocks(y: &mut [[f32; 8]], ids: &Ids, block: [Self; 6]);
}

impl Vector for Lanes {
    const ALL: u16 = 0xFF;

    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self([value; LANES])
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
    fn max(self, other: Self) -> Self {
        Self(std::array::from_fn(|l| if self.0[l] > other.0[l] { self.0[l] } else { other.0[l] }))
    }

    #[inline(always)]
    fn above(self, threshold: f32) -> u16 {
        (0..LANES).fold(0, |bits, lane| bits | u16::from(self.0[lane] > threshold) << lane)
    }

    #[inline(always)]
    fn with_second(self, _: Self) -> Self {
        self
    }
}

impl Vector8 for Lanes {
    #[inline(always)]
    fn load(lanes: &Lanes) -> Self {
        *lanes
    }

    fn load_half(halves: &Halves) -> Self {
        Self(halves.0.map(|bits| f16::from_bits(bits).to_f32()))
    }

    #[inline(always)]
    fn store(self) -> Lanes {
        self
    }

    fn store_half(self) -> Halves {
        Halves(self.0.map(|number| f16::from_f32(number).to_bits()))
    }

    #[inline(always)]
    fn transposed(rows: [Self; 8]) -> [Self; 8] {
        let mut out = rows;
        for i in 0..LANES {
            for j in 0..LANES {
                out[j].0[i] = rows[i].0[j];
            }
        }
        out
    }

    #[inline(always)]
    unsafe fn gather(x: &[[f32; 4]], ids: &Ids) -> [Self; 3] {
        let mut columns = [Self::default(); 3];
        for (lane, &id) in ids.iter().enumerate() {
            // SAFETY: the caller keeps `ids` below the length.
            let row = unsafe { x.get_unchecked(id as usize) };
            for i in 0..3 {
                columns[i].0[lane] = row[i];
            }
        }
        columns
    }

    #[inline(always)]
    unsafe fn gather_edges(x: &[[f64; 4]], from: &Ids, to: &Ids) -> [Self; 3] {
        let mut columns = [Self::default(); 3];
        for lane in 0..LANES {
            // SAFETY: the caller keeps the numbers below the length.
            let (p, q) =
                unsafe { (x.get_unchecked(from[lane] as usize), x.get_unchecked(to[lane] as usize)) };
            for i in 0..3 {
                columns[i].0[lane] = (q[i] - p[i]) as f32;
            }
        }
        columns
    }

    #[inline(always)]
    unsafe fn scatter(y: &mut [[f32; 4]], ids: &Ids, f: [Self; 3]) {
        for (lane, &id) in ids.iter().enumerate() {
            // SAFETY: the caller keeps `ids` below the length.
            let row = unsafe { y.get_unchecked_mut(id as usize) };
            for i in 0..3 {
                row[i] += f[i].0[lane];
            }
        }
    }

    #[inline(always)]
    unsafe fn scatter_blocks(y: &mut [[f32; 8]], ids: &Ids, block: [Self; 6]) {
        for (lane, &id) in ids.iter().enumerate() {
            // SAFETY: the caller keeps `ids` below the length.
            let row = unsafe { y.get_unchecked_mut(id as usize) };
            for (entry, &at) in block.iter().zip(&[0, 1, 2, 4, 5, 6]) {
                row[at] += entry.0[lane];
            }
        }
    }
}

macro_rules! lanewise {
    ($trait:ident, $method:ident, $op:tt) => {
        impl $trait for Lanes {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(std::array::from_fn(|i| self.0[i] $op other.0[i]))
            }
        }
    };
}
lanewise!(Add, add, +);
lanewise!(Sub, sub, -);
lanewise!(Mul, mul, *);

impl Neg for Lanes {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(self.0.map(|v| -v))
    }
}

/// Repeats a block for the numbers 0 … 7. The compiler leaves a loop with so long a body rolled, and then keeps
/// the arrays that it indexes in memory.
#[macro_export]
macro_rules! for_eight {
    ($k:ident => $body:block) => {
        $crate::for_eight!($k => $body, 0 1 2 3 4 5 6 7)
    };
    ($k:ident => $body:block, $($number:literal)*) => {
        $({
            let $k: usize = $number;
            $body
        })*
    };
}
