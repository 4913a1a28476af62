//! Cells with a matrix of their own: coarse levels where children are missing, cut or of different materials.

#![allow(unsafe_code)] // vector instructions behind run-time detection, and unchecked gathers

use std::array::from_ref;

use super::super::Padded;
use super::batch::{
    Corners, HangingWeights, distribute, from_cell, gather, interpolate, read_matrix, read_weights, scatter,
    to_cell,
};
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
        // SAFETY: both come from `Simd::detect` only; the rest is the caller's promise.
        Simd::Avx2 | Simd::Avx512 => unsafe { avx2::multiply(batches, weights, x, y) },
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
        let mut u: Corners<V> = unsafe { gather(x, from_ref(batch), |batch| &batch.nodes) };
        let R = read_matrix(from_ref(batch), |batch| &batch.rotation);
        to_cell(&mut u, &R);
        let weights = weights.get(b).map(from_ref);
        if let Some(weights) = weights {
            interpolate(&mut u, &read_weights(weights));
        }
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
            if let Some(next) = next {
                let lines = next.entries[rows[0]..rows[2] + 24 - r].chunks(2);
                lines.for_each(|line| V::prefetch(&line[0]));
            }
            let entry = |i: usize, s: usize| &entries[rows[i] + s - r];
            let (x, y, z) = (v[r], v[r + 1], v[r + 2]);
            let (xy, xz, yz) = (V::load(entry(0, r + 1)), V::load(entry(0, r + 2)), V::load(entry(1, r + 2)));
            let mut sums = [
                V::load(entry(0, r)).mul_add(x, xy.mul_add(y, xz.mul_add(z, f[r]))),
                xy.mul_add(x, V::load(entry(1, r + 1)).mul_add(y, yz.mul_add(z, f[r + 1]))),
                xz.mul_add(x, yz.mul_add(y, V::load(entry(2, r + 2)).mul_add(z, f[r + 2]))),
            ];
            for s in r + 3..24 {
                let (a, b, c) = (V::load(entry(0, s)), V::load(entry(1, s)), V::load(entry(2, s)));
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
        from_cell(&mut u, &R);
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
