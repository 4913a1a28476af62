//! The inner loops of a product: eight cells at once.

#![allow(unsafe_code)] // vector instructions behind run-time detection, and unchecked gathers

use super::super::Padded;
use super::lane::HANGING_SLOTS;
use super::sectors::SectorTable;
use crate::element::{Ids, LANES, Lanes, Mat3, Simd, Vector8};

/// Eight cells with one table.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct SectorBatch {
    /// √c R̂ with the factor c of the cell; 0 in unused lanes.
    pub rotation: Mat3<Lanes>,
    /// √c.
    pub root: Lanes,
    /// Local numbers of the vertices, by slot. Unused lanes have those of the first lane.
    pub nodes: [Ids; 8],
}

/// Weights of hanging slots, in the order of [`HANGING_SLOTS`]: ½ or ¼ where the slot hangs, 0 elsewhere.
pub type HangingWeights = [Lanes; 6];

/// A table as the kernel reads it: every entry in all lanes.
#[derive(Clone, Debug)]
pub struct TableLanes(pub [[Lanes; 6]; 8]);

impl TableLanes {
    /// Rounds the entries.
    pub fn new(table: &SectorTable) -> Self {
        Self(table.sectors.map(|sector| sector.map(|s| Lanes([s as f32; LANES]))))
    }
}

/// The corners of eight cells: component, then slot or parity.
pub type Corners<V> = [[V; 8]; 3];

/// y += Σ Wᵀ c R̂ S R̂ᵀ W x over the batches. `weights` has an entry per batch, or none if no slot hangs.
///
/// # Safety
/// All local numbers are below the lengths of `x` and `y`, which are the same.
pub unsafe fn multiply(
    simd: Simd,
    batches: &[SectorBatch],
    weights: &[HangingWeights],
    table: &TableLanes,
    x: &[Padded],
    y: &mut [Padded],
) {
    match simd {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: `Simd::Avx2` comes from `Simd::detect` only; the rest is the caller's promise.
        Simd::Avx2 => unsafe {
            if weights.is_empty() {
                avx2::multiply::<false>(batches, weights, table, x, y);
            } else {
                avx2::multiply::<true>(batches, weights, table, x, y);
            }
        },
        // SAFETY: the caller's promise.
        _ => unsafe {
            if weights.is_empty() {
                multiply_with::<Lanes, false>(batches, weights, table, x, y);
            } else {
                multiply_with::<Lanes, true>(batches, weights, table, x, y);
            }
        },
    }
}

/// # Safety
/// As for [`multiply`].
#[inline(always)]
unsafe fn multiply_with<V: Vector8, const HANGING: bool>(
    batches: &[SectorBatch],
    weights: &[HangingWeights],
    table: &TableLanes,
    x: &[Padded],
    y: &mut [Padded],
) {
    for (b, batch) in batches.iter().enumerate() {
        // SAFETY: the caller's promise.
        let mut u: Corners<V> = unsafe { gather(x, &batch.nodes) };
        if HANGING {
            interpolate(&mut u, &weights[b]);
        }
        transform(&mut u);
        to_cell(&mut u, &batch.rotation);
        multiply_sectors(&mut u, table);
        from_cell(&mut u, &batch.rotation);
        transform(&mut u);
        if HANGING {
            distribute(&mut u, &weights[b]);
        }
        // SAFETY: the caller's promise.
        unsafe { scatter(y, &batch.nodes, &u) };
    }
}

// Loops instead of closures below: see `Vector8`.

/// # Safety
/// All local numbers are below the length of `x`.
#[inline(always)]
pub unsafe fn gather<V: Vector8>(x: &[Padded], nodes: &[Ids; 8]) -> Corners<V> {
    let mut u = [[V::splat(0.0); 8]; 3];
    for j in 0..8 {
        // SAFETY: the caller's promise.
        let row = unsafe { V::gather(x, &nodes[j]) };
        for i in 0..3 {
            u[i][j] = row[i];
        }
    }
    u
}

/// # Safety
/// All local numbers are below the length of `y`.
#[inline(always)]
pub unsafe fn scatter<V: Vector8>(y: &mut [Padded], nodes: &[Ids; 8], f: &Corners<V>) {
    for j in 0..8 {
        // SAFETY: the caller's promise.
        unsafe { V::scatter(y, &nodes[j], [f[0][j], f[1][j], f[2][j]]) };
    }
}

/// W: displacements of the corners from those of the vertices.
#[inline(always)]
pub fn interpolate<V: Vector8>(u: &mut Corners<V>, weights: &HangingWeights) {
    for i in 0..3 {
        let v = u[i];
        for (k, &j) in HANGING_SLOTS.iter().enumerate() {
            let weight = V::load(&weights[k]);
            let mut between = v[0] - v[j];
            if k >= 3 {
                for s in [1, 2, 4] {
                    if s & j != 0 {
                        between = between + (v[s] - v[j]);
                    }
                }
            }
            u[i][j] = weight.mul_add(between, v[j]);
        }
    }
}

/// Wᵀ: forces on the vertices from those on the corners.
#[inline(always)]
pub fn distribute<V: Vector8>(f: &mut Corners<V>, weights: &HangingWeights) {
    let (minus, minus_three) = (V::splat(-1.0), V::splat(-3.0));
    for i in 0..3 {
        let g = f[i];
        for (k, &j) in HANGING_SLOTS.iter().enumerate() {
            let share = V::load(&weights[k]) * g[j];
            f[i][0] = f[i][0] + share;
            if k < 3 {
                f[i][j] = minus.mul_add(share, f[i][j]);
            } else {
                f[i][j] = minus_three.mul_add(share, f[i][j]);
                for s in [1, 2, 4] {
                    if s & j != 0 {
                        f[i][s] = f[i][s] + share;
                    }
                }
            }
        }
    }
}

/// û_p = Σ_j (−1)^{|j & p|} u_j, in place.
#[inline(always)]
pub fn transform<V: Vector8>(u: &mut Corners<V>) {
    for i in 0..3 {
        for bit in [1, 2, 4] {
            for j in 0..8 {
                if j & bit == 0 {
                    let (a, b) = (u[i][j], u[i][j | bit]);
                    u[i][j] = a + b;
                    u[i][j | bit] = a - b;
                }
            }
        }
    }
}

/// √c R̂ᵀ u.
#[inline(always)]
pub fn to_cell<V: Vector8>(u: &mut Corners<V>, R: &Mat3<Lanes>) {
    for p in 0..8 {
        let v = [u[0][p], u[1][p], u[2][p]];
        for i in 0..3 {
            let (a, b, c) = (V::load(&R[i]), V::load(&R[3 + i]), V::load(&R[6 + i]));
            u[i][p] = a.mul_add(v[0], b.mul_add(v[1], c * v[2]));
        }
    }
}

/// √c R̂ f.
#[inline(always)]
pub fn from_cell<V: Vector8>(f: &mut Corners<V>, R: &Mat3<Lanes>) {
    for p in 0..8 {
        let v = [f[0][p], f[1][p], f[2][p]];
        for i in 0..3 {
            let (a, b, c) = (V::load(&R[3 * i]), V::load(&R[3 * i + 1]), V::load(&R[3 * i + 2]));
            f[i][p] = a.mul_add(v[0], b.mul_add(v[1], c * v[2]));
        }
    }
}

/// S û.
#[inline(always)]
pub fn multiply_sectors<V: Vector8>(u: &mut Corners<V>, table: &TableLanes) {
    for q in 0..8 {
        let [xx, xy, xz, yy, yz, zz] = &table.0[q];
        let (xx, xy, xz) = (V::load(xx), V::load(xy), V::load(xz));
        let (yy, yz, zz) = (V::load(yy), V::load(yz), V::load(zz));
        let (a, b, c) = (u[0][q ^ 1], u[1][q ^ 2], u[2][q ^ 4]);
        u[0][q ^ 1] = xx.mul_add(a, xy.mul_add(b, xz * c));
        u[1][q ^ 2] = xy.mul_add(a, yy.mul_add(b, yz * c));
        u[2][q ^ 4] = xz.mul_add(a, yz.mul_add(b, zz * c));
    }
}

#[cfg(target_arch = "x86_64")]
mod avx2 {
    //! The same loop compiled for AVX2 and FMA.

    use super::{HangingWeights, Padded, SectorBatch, TableLanes};
    use crate::element::avx2::Register;

    /// # Safety
    /// As for [`super::multiply`].
    #[target_feature(enable = "avx2,fma")]
    pub unsafe fn multiply<const HANGING: bool>(
        batches: &[SectorBatch],
        weights: &[HangingWeights],
        table: &TableLanes,
        x: &[Padded],
        y: &mut [Padded],
    ) {
        // SAFETY: the caller's promise.
        unsafe { super::multiply_with::<Register, HANGING>(batches, weights, table, x, y) };
    }
}
