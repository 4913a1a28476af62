//! Cells with a matrix of their own: coarse levels where children are missing, cut or of different materials.

#![allow(unsafe_code)] // vector instructions behind run-time detection, and unchecked gathers

use std::array::from_ref;

use scindo_matter::element::{Halves, Ids, LANES, Lanes, Mat3, Simd, Vector8, prefetch};
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::super::Padded;
use super::batch::{
    Corners, HangingWeights, distribute, from_cell, gather, interpolate, read_matrix, read_weights, scatter,
    to_cell,
};
use super::interleave::interleave;
use super::sectors::Matrix24;

/// Entries of a stored matrix: the upper triangle, row by row. Row 3 j + i is component i of slot j.
pub const STORED: usize = 300;

/// Place of entry (r, s), r ≤ s, of a stored matrix.
pub const fn stored_entry(r: usize, s: usize) -> usize {
    r * 24 - r * (r + 1) / 2 + s
}

/// One entry of eight matrices.
pub(super) trait Entry: Copy + Default + Serialize + DeserializeOwned {
    /// Largest magnitude that the entries of a matrix are scaled to; `None` leaves them as they are.
    const LARGEST: Option<f32>;

    /// All eight.
    fn load<V: Vector8>(&self) -> V;
    /// The eight numbers of a register.
    fn store<V: Vector8>(all: V) -> Self;
}

impl Entry for Lanes {
    const LARGEST: Option<f32> = None;

    #[inline(always)]
    fn load<V: Vector8>(&self) -> V {
        V::load(self)
    }

    #[inline(always)]
    fn store<V: Vector8>(all: V) -> Self {
        all.store()
    }
}

impl Entry for Halves {
    const LARGEST: Option<f32> = Some(32768.0);

    #[inline(always)]
    fn load<V: Vector8>(&self) -> V {
        V::load_half(self)
    }

    #[inline(always)]
    fn store<V: Vector8>(all: V) -> Self {
        all.store_half()
    }
}

/// Eight cells with their matrices interleaved: 1.2 kB per cell, or half of it.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
#[serde(bound = "")]
#[repr(C)]
pub(super) struct StoredBatch<E: Entry> {
    /// Upper triangles, divided by their scales; 0 in unused lanes.
    #[serde(with = "scindo_matter::storage::saved::array")]
    pub entries: [E; STORED],
    /// Scale of the entries of every cell: a power of two, so that it rounds nothing.
    pub scale: Lanes,
    /// Rotation of every cell.
    pub rotation: Mat3<Lanes>,
    /// Local numbers of the vertices, by slot. Unused lanes have those of the first lane.
    pub nodes: [Ids; 8],
}

impl<E: Entry> StoredBatch<E> {
    /// A batch whose matrices are 0.
    pub(super) fn new(nodes: [Ids; 8]) -> Self {
        let mut rotation = Mat3::<Lanes>::default();
        [0, 4, 8].into_iter().for_each(|i| rotation[i] = Lanes([1.0; LANES]));
        Self { entries: [E::default(); STORED], scale: Lanes([1.0; LANES]), rotation, nodes }
    }

    /// Sets the matrices of all lanes. Entry k of the upper triangle is number `order[k]` of what `from` has.
    pub(super) fn set(&mut self, simd: Simd, from: &[&[f32; STORED]; LANES], order: &[u16; STORED]) {
        match simd {
            #[cfg(target_arch = "x86_64")]
            // SAFETY: both come from `Simd::detect` only.
            Simd::Avx2 | Simd::Avx512 => unsafe { avx2::set(self, from, order) },
            _ => self.set_with::<Lanes>(from, order),
        }
    }

    #[inline(always)]
    fn set_with<V: Vector8>(&mut self, from: &[&[f32; STORED]; LANES], order: &[u16; STORED]) {
        let mut given = [Lanes::default(); STORED];
        interleave::<V, STORED>(from, &mut given);
        let mut inverse = Lanes([1.0; LANES]);
        if let Some(largest) = E::LARGEST {
            let most = largest_of(&given);
            for lane in 0..LANES {
                self.scale.0[lane] = scale(most.0[lane], largest);
                inverse.0[lane] = 1.0 / self.scale.0[lane];
            }
        }
        let inverse = V::load(&inverse);
        for (to, &from) in self.entries.iter_mut().zip(order) {
            *to = E::store(inverse * V::load(&given[usize::from(from)]));
        }
    }

    /// The matrix A of a lane, without its rotation.
    pub(super) fn matrix(&self, lane: usize) -> Matrix24 {
        let mut A = [[0.0; 24]; 24];
        let mut entries = self.entries.iter();
        for r in 0..24 {
            for (s, entry) in (r..24).zip(&mut entries) {
                let entry = f64::from(self.scale.0[lane] * entry.load::<Lanes>().0[lane]);
                (A[r][s], A[s][r]) = (entry, entry);
            }
        }
        A
    }
}

/// The largest magnitude in every lane; numbers that are none do not count.
#[inline(always)]
fn largest_of(entries: &[Lanes; STORED]) -> Lanes {
    let mut most = Lanes::default();
    for entry in entries {
        for lane in 0..LANES {
            let size = entry.0[lane].abs();
            most.0[lane] = if size > most.0[lane] { size } else { most.0[lane] };
        }
    }
    most
}

/// The power of two by which entries up to `most` are divided so that they come close to `largest` from below.
fn scale(most: f32, largest: f32) -> f32 {
    if !(most > f32::MIN_POSITIVE && most.is_finite()) {
        return 1.0;
    }
    // The exponent of `most`, which is less than twice its power of two; inverses stay in range.
    let exponent = |x: f32| (x.to_bits() >> 23) as i32 - 127;
    let wanted = exponent(most) + 1 - exponent(largest);
    f32::from_bits(((wanted.max(-126) + 127) as u32) << 23)
}

/// y += Σ Wᵀ R A Rᵀ W x over the batches; see [`multiply`](super::batch::multiply).
///
/// # Safety
/// All local numbers are below the lengths of `x` and `y`, which are the same.
pub(super) unsafe fn multiply<E: Entry>(
    simd: Simd,
    batches: &[StoredBatch<E>],
    weights: &[HangingWeights],
    x: &[Padded],
    y: &mut [Padded],
) {
    match simd {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: both come from `Simd::detect` only; the rest is the caller's promise.
        Simd::Avx2 | Simd::Avx512 => unsafe { avx2::multiply(batches, weights, x, y) },
        // SAFETY: the caller's promise.
        _ => unsafe { multiply_with::<Lanes, E>(batches, weights, x, y) },
    }
}

/// # Safety
/// As for [`multiply`].
#[inline(always)]
unsafe fn multiply_with<V: Vector8, E: Entry>(
    batches: &[StoredBatch<E>],
    weights: &[HangingWeights],
    x: &[Padded],
    y: &mut [Padded],
) {
    for (b, batch) in batches.iter().enumerate() {
        // SAFETY: the caller's promise.
        let mut u: Corners<V> = unsafe { gather(x, from_ref(batch), |batch| &batch.nodes) };
        let R = read_matrix(from_ref(batch), |batch| &batch.rotation);
        to_cell(&mut u, &R);
        let weights = weights.get(b).map(from_ref);
        if let Some(weights) = weights {
            interpolate(&mut u, &read_weights(weights));
        }
        // The matrix has its rows slot by slot, registers hold u component by component.
        let (mut v, mut f) = ([V::splat(0.0); 24], [V::splat(0.0); 24]);
        for j in 0..8 {
            for i in 0..3 {
                v[3 * j + i] = u[i][j];
            }
        }
        let next = batches.get(b + 1);
        let entries = &batch.entries;
        // The three rows of a vertex at once: fewer passes over f, and sums that do not wait for each other.
        for r in [0, 3, 6, 9, 12, 15, 18, 21] {
            let rows = [stored_entry(r, r), stored_entry(r + 1, r + 1) - 1, stored_entry(r + 2, r + 2) - 2];
            // The same rows of the next batch travel from memory while these are multiplied.
            if let Some(next) = next {
                prefetch(&next.entries[rows[0]..rows[2] + 24 - r]);
            }
            let at = |i: usize, s: usize| rows[i] + s - r;
            let (x, y, z) = (v[r], v[r + 1], v[r + 2]);
            let (xy, xz, yz) = (
                entries[at(0, r + 1)].load::<V>(),
                entries[at(0, r + 2)].load::<V>(),
                entries[at(1, r + 2)].load::<V>(),
            );
            let mut sums = [
                entries[at(0, r)].load::<V>().mul_add(x, xy.mul_add(y, xz.mul_add(z, f[r]))),
                xy.mul_add(x, entries[at(1, r + 1)].load::<V>().mul_add(y, yz.mul_add(z, f[r + 1]))),
                xz.mul_add(x, yz.mul_add(y, entries[at(2, r + 2)].load::<V>().mul_add(z, f[r + 2]))),
            ];
            // Each entry off the diagonal is loaded once and counts twice, the second time for the lower triangle.
            for s in r + 3..24 {
                let (a, b, c) = (
                    entries[at(0, s)].load::<V>(),
                    entries[at(1, s)].load::<V>(),
                    entries[at(2, s)].load::<V>(),
                );
                sums[0] = a.mul_add(v[s], sums[0]);
                sums[1] = b.mul_add(v[s], sums[1]);
                sums[2] = c.mul_add(v[s], sums[2]);
                f[s] = a.mul_add(x, b.mul_add(y, c.mul_add(z, f[s])));
            }
            f[r..r + 3].copy_from_slice(&sums);
        }
        for j in 0..8 {
            for i in 0..3 {
                u[i][j] = f[3 * j + i];
            }
        }
        if let Some(weights) = weights {
            distribute(&mut u, &read_weights(weights));
        }
        // The entries are stored divided by the scale, which costs 24 products here instead of 300 above.
        let scale = V::load(&batch.scale);
        for i in 0..3 {
            for j in 0..8 {
                u[i][j] = scale * u[i][j];
            }
        }
        from_cell(&mut u, &R);
        // SAFETY: the caller's promise.
        unsafe { scatter(y, &batch.nodes, &u) };
    }
}

#[cfg(target_arch = "x86_64")]
mod avx2 {
    //! The same loop compiled for AVX2 and FMA.

    use super::{Entry, HangingWeights, LANES, Padded, STORED, StoredBatch};
    use scindo_matter::element::avx2::Register;

    /// # Safety
    /// The machine has AVX2, FMA and F16C.
    #[target_feature(enable = "avx2,fma,f16c")]
    pub(super) unsafe fn set<E: Entry>(
        batch: &mut StoredBatch<E>,
        from: &[&[f32; STORED]; LANES],
        order: &[u16; STORED],
    ) {
        batch.set_with::<Register>(from, order);
    }

    /// # Safety
    /// As for [`super::multiply`].
    #[target_feature(enable = "avx2,fma,f16c")]
    pub(super) unsafe fn multiply<E: Entry>(
        batches: &[StoredBatch<E>],
        weights: &[HangingWeights],
        x: &[Padded],
        y: &mut [Padded],
    ) {
        // SAFETY: the caller's promise.
        unsafe { super::multiply_with::<Register, E>(batches, weights, x, y) };
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    /// A batch in which one lane has a matrix. The order of what is given is turned round.
    fn with_lane(simd: Simd, lane: usize, entries: &[f32; STORED]) -> StoredBatch<Halves> {
        let mut given = *entries;
        given.reverse();
        let mut from = [&[0.0; STORED]; LANES];
        from[lane] = &given;
        let mut batch = StoredBatch::new([[0; LANES]; 8]);
        batch.set(simd, &from, &std::array::from_fn(|k| (STORED - 1 - k) as u16));
        batch
    }

    /// Whatever their unit, entries keep eleven bits, or their error is below 2⁻³⁹ of the largest entry.
    #[test]
    fn half_precision_keeps_eleven_bits_in_any_unit() {
        let entries: [f32; STORED] = std::array::from_fn(|i| {
            let x = ((i * 7919 + 13) % 1009) as f32 / 504.5 - 1.0;
            x * [1.0, 1e-3, 1e-6, 1e-10][i % 4]
        });
        let largest = f64::from(entries.iter().fold(0.0_f32, |largest, entry| largest.max(entry.abs())));
        for unit in [1e-35_f32, 1e-20, 1e-3, 1.0, 1e12, 1e37] {
            let scaled = entries.map(|entry| unit * entry);
            for simd in [Simd::Baseline, Simd::detect()] {
                let batch = with_lane(simd, 3, &scaled);
                let (found, none) = (batch.matrix(3), batch.matrix(2));
                for r in 0..24 {
                    for s in r..24 {
                        let expected = f64::from(scaled[stored_entry(r, s)]);
                        let error = (found[r][s] - expected).abs();
                        let allowed =
                            (expected.abs() / 2048.0).max(f64::from(unit) * largest / 2.0_f64.powi(39));
                        assert!(error <= allowed, "{simd:?}, {unit:e}: {expected:e} {:e}", found[r][s]);
                        assert_eq!((found[s][r], none[r][s]), (found[r][s], 0.0));
                    }
                }
            }
        }
    }

    #[test]
    fn matrices_without_a_scale_stay_what_they_are() {
        assert_eq!(scale(0.0, 32768.0), 1.0);
        assert_eq!(scale(f32::INFINITY, 32768.0), 1.0);
        for simd in [Simd::Baseline, Simd::detect()] {
            let batch = with_lane(simd, 0, &[f32::NAN; STORED]);
            assert!(batch.matrix(0)[5][7].is_nan());
            assert_eq!(batch.matrix(1), [[0.0; 24]; 24]);
        }
    }
}
