//! Cells with a matrix of their own: coarse levels where children are missing, cut or of different materials.

#![allow(unsafe_code)] // vector instructions behind run-time detection, and unchecked gathers

use super::super::Padded;
use super::batch::{Corners, HangingWeights, distribute, from_cell, gather, interpolate, scatter, to_cell};
use super::sectors::Matrix24;
use crate::element::{Ids, LANES, Lanes, Mat3, Simd, Vector8};

/// Entries of a stored matrix: the upper triangle, row by row. Row 3 j + i is component i of slot j.
pub const STORED: usize = 300;

/// Place of entry (r, s), r ≤ s, of a stored matrix.
pub const fn stored_entry(r: usize, s: usize) -> usize {
    r * 24 - r * (r + 1) / 2 + s
}

/// Eight cells with their matrices interleaved: 1.2 kB per cell.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
#[repr(C)]
pub struct StoredBatch {
    /// Upper triangles; 0 in unused lanes.
    #[serde(with = "crate::storage::saved::array")]
    pub entries: [Lanes; STORED],
    /// Rotation of every cell.
    pub rotation: Mat3<Lanes>,
    /// Local numbers of the vertices, by slot. Unused lanes have those of the first lane.
    pub nodes: [Ids; 8],
}

impl StoredBatch {
    /// A batch whose matrices are 0.
    pub fn new(nodes: [Ids; 8]) -> Self {
        let mut rotation = Mat3::<Lanes>::default();
        [0, 4, 8].into_iter().for_each(|i| rotation[i] = Lanes([1.0; LANES]));
        Self { entries: [Lanes([0.0; LANES]); STORED], rotation, nodes }
    }

    /// The matrix A of a lane, without its rotation.
    pub fn matrix(&self, lane: usize) -> Matrix24 {
        let mut A = [[0.0; 24]; 24];
        let mut entries = self.entries.iter();
        for r in 0..24 {
            for (s, entry) in (r..24).zip(&mut entries) {
                (A[r][s], A[s][r]) = (f64::from(entry.0[lane]), f64::from(entry.0[lane]));
            }
        }
        A
    }
}

/// y += Σ Wᵀ R A Rᵀ W x over the batches; see [`multiply`](super::batch::multiply).
///
/// # Safety
/// All local numbers are below the lengths of `x` and `y`, which are the same.
pub unsafe fn multiply(
    simd: Simd,
    batches: &[StoredBatch],
    weights: &[HangingWeights],
    x: &[Padded],
    y: &mut [Padded],
) {
    match simd {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: `Simd::Avx2` comes from `Simd::detect` only; the rest is the caller's promise.
        Simd::Avx2 => unsafe { avx2::multiply(batches, weights, x, y) },
        // SAFETY: the caller's promise.
        _ => unsafe { multiply_with::<Lanes>(batches, weights, x, y) },
    }
}

/// # Safety
/// As for [`multiply`].
#[inline(always)]
unsafe fn multiply_with<V: Vector8>(
    batches: &[StoredBatch],
    weights: &[HangingWeights],
    x: &[Padded],
    y: &mut [Padded],
) {
    for (b, batch) in batches.iter().enumerate() {
        // SAFETY: the caller's promise.
        let mut u: Corners<V> = unsafe { gather(x, &batch.nodes) };
        to_cell(&mut u, &batch.rotation);
        if let Some(weights) = weights.get(b) {
            interpolate(&mut u, weights);
        }
        let (mut v, mut f) = ([V::splat(0.0); 24], [V::splat(0.0); 24]);
        for j in 0..8 {
            for i in 0..3 {
                v[3 * j + i] = u[i][j];
            }
        }
        let mut at = 0;
        for r in 0..24 {
            let mut sum = V::load(&batch.entries[at]).mul_add(v[r], f[r]);
            at += 1;
            for s in r + 1..24 {
                let entry = V::load(&batch.entries[at]);
                at += 1;
                sum = entry.mul_add(v[s], sum);
                f[s] = entry.mul_add(v[r], f[s]);
            }
            f[r] = sum;
        }
        for j in 0..8 {
            for i in 0..3 {
                u[i][j] = f[3 * j + i];
            }
        }
        if let Some(weights) = weights.get(b) {
            distribute(&mut u, weights);
        }
        from_cell(&mut u, &batch.rotation);
        // SAFETY: the caller's promise.
        unsafe { scatter(y, &batch.nodes, &u) };
    }
}

#[cfg(target_arch = "x86_64")]
mod avx2 {
    //! The same loop compiled for AVX2 and FMA.

    use super::{HangingWeights, Padded, StoredBatch};
    use crate::element::avx2::Register;

    /// # Safety
    /// As for [`super::multiply`].
    #[target_feature(enable = "avx2,fma")]
    pub unsafe fn multiply(
        batches: &[StoredBatch],
        weights: &[HangingWeights],
        x: &[Padded],
        y: &mut [Padded],
    ) {
        // SAFETY: the caller's promise.
        unsafe { super::multiply_with::<Register>(batches, weights, x, y) };
    }
}
