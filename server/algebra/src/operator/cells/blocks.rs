//! Diagonal blocks of the cells, eight cells at once.

#![allow(unsafe_code)] // vector instructions behind run-time detection, and unchecked rows

use nalgebra::Matrix3;
use scindo_matter::element::{Ids, LANES, Lanes, Simd, Vector8};

use super::super::tet_batch::Block6;
use super::super::twist::{self, TwistBatch, read_twist};
use super::batch::SectorBatch;
use super::interleave::interleave;
use super::sectors::{ENTRY, Matrix24, SectorTable, diagonal_blocks, hanging_slots};
use super::stored::{Entry, StoredBatch, stored_entry};

/// Diagonal blocks (xx, xy, xz, yy, yz, zz) of a table in the frame of a cell, by the set of hanging slots.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct BlockTable(#[serde(with = "scindo_matter::storage::saved::arrays")] Vec<[f32; BLOCKS]>);

/// Entries of the blocks of all slots, one block after the other.
const BLOCKS: usize = 48;

impl BlockTable {
    /// The blocks of all sets of slots 1 … 6.
    pub(super) fn new(table: &SectorTable) -> Self {
        let K = table.matrix();
        let of = |set: u8| {
            let blocks = rounded(&K, set << 1);
            std::array::from_fn(|k| blocks[k / 6][k % 6])
        };
        Self((0..64).map(of).collect())
    }

    /// Blocks of a cell whose slots `hanging` hang.
    fn of(&self, hanging: u8) -> &[f32; BLOCKS] {
        &self.0[usize::from(hanging >> 1 & 63)]
    }
}

fn rounded(K: &Matrix24, hanging: u8) -> [[f32; 6]; 8] {
    diagonal_blocks(K, hanging).map(|block| block.map(|b| b as f32))
}

/// Adds the blocks of Wᵀ c R̂ S R̂ᵀ W of the batches to the rows of their vertices. `hanging` has the sets of
/// hanging slots of every batch, or is empty if no slot hangs.
///
/// # Safety
/// All local numbers are below the length of `rows`.
pub(super) unsafe fn add(
    simd: Simd,
    batches: &[SectorBatch],
    hanging: &[[u8; LANES]],
    table: &BlockTable,
    rows: &mut [Block6],
) {
    match simd {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: both come from `Simd::detect` only; the rest is the caller's promise.
        Simd::Avx2 | Simd::Avx512 => unsafe { avx2::add(batches, hanging, table, rows) },
        // SAFETY: the caller's promise.
        _ => unsafe { add_with::<Lanes>(batches, hanging, table, rows) },
    }
}

/// # Safety
/// As for [`add`].
#[inline(always)]
unsafe fn add_with<V: Vector8>(
    batches: &[SectorBatch],
    hanging: &[[u8; LANES]],
    table: &BlockTable,
    rows: &mut [Block6],
) {
    for (b, batch) in batches.iter().enumerate() {
        let R: [[V; 3]; 3] = [load(&batch.rotation, 0), load(&batch.rotation, 1), load(&batch.rotation, 2)];
        match hanging.get(b) {
            // SAFETY: the caller's promise.
            None => unsafe { add_plain(&R, table.of(0), &batch.nodes, rows) },
            Some(hanging) => {
                let mut from = [table.of(0); LANES];
                for lane in 0..LANES {
                    from[lane] = table.of(hanging[lane]);
                }
                let mut blocks = [Lanes::default(); BLOCKS];
                interleave::<V, BLOCKS>(&from, &mut blocks);
                for (block, ids) in blocks.as_chunks().0.iter().zip(&batch.nodes) {
                    // SAFETY: the caller's promise.
                    unsafe { V::scatter_blocks(rows, ids, turned(&R, block)) };
                }
            }
        }
    }
}

/// Adds the blocks of the twists of the batches, which are few: only stretched chunks have them. `hanging` as in [`add`].
pub(super) fn add_twists(
    batches: &[SectorBatch],
    twists: &[TwistBatch],
    hanging: &[[u8; LANES]],
    rows: &mut [Block6],
) {
    for (b, (batch, twist)) in batches.iter().zip(twists).enumerate() {
        let Q = read_twist::<Lanes, 1>(std::array::from_ref(twist));
        let R: [[Lanes; 3]; 3] =
            [0, 3, 6].map(|i| [batch.rotation[i], batch.rotation[i + 1], batch.rotation[i + 2]]);
        let sums = match hanging.get(b) {
            None => corner_signs(&[0; LANES]),
            Some(hanging) => corner_signs(hanging),
        };
        for (ids, g) in batch.nodes.iter().zip(&sums) {
            let [xx, xy, xz, yy, yz, zz] = twist::turned(&twist::block(&Q, g), &R);
            for lane in 0..LANES {
                let row = &mut rows[usize::from(ids[lane])];
                let block = [xx, xy, xz, Lanes::default(), yy, yz, zz, Lanes::default()];
                row.iter_mut().zip(block).for_each(|(sum, entry)| *sum += entry.0[lane]);
            }
        }
    }
}

/// For every slot Σ W (±1, ±1, ±1) over the corners that its vertex carries: 4 a times the mean gradient of its shape
/// function in a cell of side a.
fn corner_signs(hanging: &[u8; LANES]) -> [[Lanes; 3]; 8] {
    let mut sums = [[Lanes::default(); 3]; 8];
    for (lane, &hanging) in hanging.iter().enumerate() {
        for j in 0..8 {
            let (slots, weight) = if hanging >> j & 1 == 1 { hanging_slots(j) } else { (1 << j, 1.0) };
            for (v, k) in (0..24).map(|vk| (vk / 3, vk % 3)).filter(|(v, _)| slots >> v & 1 == 1) {
                sums[v][k].0[lane] += if j >> k & 1 == 1 { -weight as f32 } else { weight as f32 };
            }
        }
    }
    sums
}

#[inline(always)]
fn load<V: Vector8>(R: &[Lanes; 9], i: usize) -> [V; 3] {
    [V::load(&R[3 * i]), V::load(&R[3 * i + 1]), V::load(&R[3 * i + 2])]
}

/// R B Rᵀ.
#[inline(always)]
fn turned<V: Vector8>(R: &[[V; 3]; 3], B: &[Lanes; 6]) -> [V; 6] {
    let mut RB = *R;
    for i in 0..3 {
        for j in 0..3 {
            let (x, y, z) = (V::load(&B[ENTRY[0][j]]), V::load(&B[ENTRY[1][j]]), V::load(&B[ENTRY[2][j]]));
            RB[i][j] = R[i][0].mul_add(x, R[i][1].mul_add(y, R[i][2] * z));
        }
    }
    let mut out = [V::splat(0.0); 6];
    for i in 0..3 {
        for j in i..3 {
            out[ENTRY[i][j]] = RB[i][0].mul_add(R[j][0], RB[i][1].mul_add(R[j][1], RB[i][2] * R[j][2]));
        }
    }
    out
}

/// Adds the blocks of eight cells without hanging corners. `B` begins with the block of slot 0. Those of other slots
/// differ from it by the signs of reflections only, so those of opposite slots are equal.
///
/// # Safety
/// All local numbers are below the length of `rows`.
#[inline(always)]
unsafe fn add_plain<V: Vector8>(R: &[[V; 3]; 3], B: &[f32; BLOCKS], nodes: &[Ids; 8], rows: &mut [Block6]) {
    // The parts of the diagonal and of the entries xy, xz, yz of B.
    let mut parts = [[V::splat(0.0); 6]; 4];
    for i in 0..3 {
        for j in i..3 {
            let e = ENTRY[i][j];
            let (xx, yy, zz) = (R[i][0] * R[j][0], R[i][1] * R[j][1], R[i][2] * R[j][2]);
            parts[0][e] = V::splat(B[0]).mul_add(xx, V::splat(B[3]).mul_add(yy, V::splat(B[5]) * zz));
            for (k, [l, m, entry]) in [[0, 1, 1], [0, 2, 2], [1, 2, 4]].into_iter().enumerate() {
                parts[k + 1][e] = V::splat(B[entry]) * R[i][l].mul_add(R[j][m], R[i][m] * R[j][l]);
            }
        }
    }
    for j in 0..4 {
        let signs = [(j ^ j >> 1) & 1, (j ^ j >> 2) & 1, (j >> 1 ^ j >> 2) & 1];
        let mut block = parts[0];
        for (k, odd) in signs.into_iter().enumerate() {
            for e in 0..6 {
                let part = parts[k + 1][e];
                block[e] = if odd == 1 { block[e] - part } else { block[e] + part };
            }
        }
        // SAFETY: the caller's promise.
        unsafe {
            V::scatter_blocks(rows, &nodes[j], block);
            V::scatter_blocks(rows, &nodes[7 - j], block);
        }
    }
}

/// Adds the blocks of R A Rᵀ of stored matrices without hanging slots.
///
/// # Safety
/// All local numbers are below the length of `rows`.
pub(super) unsafe fn add_stored<E: Entry>(simd: Simd, batches: &[StoredBatch<E>], rows: &mut [Block6]) {
    match simd {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: both come from `Simd::detect` only; the rest is the caller's promise.
        Simd::Avx2 | Simd::Avx512 => unsafe { avx2::add_stored(batches, rows) },
        // SAFETY: the caller's promise.
        _ => unsafe { add_stored_with::<Lanes, E>(batches, rows) },
    }
}

/// # Safety
/// As for [`add_stored`].
#[inline(always)]
unsafe fn add_stored_with<V: Vector8, E: Entry>(batches: &[StoredBatch<E>], rows: &mut [Block6]) {
    for batch in batches {
        let R: [[V; 3]; 3] = [load(&batch.rotation, 0), load(&batch.rotation, 1), load(&batch.rotation, 2)];
        let scale = V::load(&batch.scale);
        for (j, ids) in batch.nodes.iter().enumerate() {
            let mut B = [Lanes::default(); 6];
            for (B, (r, s)) in B.iter_mut().zip([(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)]) {
                *B = (scale * batch.entries[stored_entry(3 * j + r, 3 * j + s)].load::<V>()).store();
            }
            // SAFETY: the caller's promise.
            unsafe { V::scatter_blocks(rows, ids, turned(&R, &B)) };
        }
    }
}

/// The same of one lane whose slots `hanging` hang: blocks of R Wᵀ A W Rᵀ.
pub(super) fn add_stored_lane<E: Entry>(
    batch: &StoredBatch<E>,
    hanging: u8,
    lane: usize,
    rows: &mut [Block6],
) {
    let R = Matrix3::from_fn(|i, j| batch.rotation[3 * i + j].0[lane]);
    for ([xx, xy, xz, yy, yz, zz], ids) in rounded(&batch.matrix(lane), hanging).into_iter().zip(&batch.nodes)
    {
        let block = R * Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz) * R.transpose();
        let row = &mut rows[usize::from(ids[lane])];
        for (at, (i, j)) in [(0, (0, 0)), (1, (0, 1)), (2, (0, 2)), (4, (1, 1)), (5, (1, 2)), (6, (2, 2))] {
            row[at] += block[(i, j)];
        }
    }
}

#[cfg(target_arch = "x86_64")]
mod avx2 {
    //! The same loop compiled for AVX2 and FMA.

    use super::{Block6, BlockTable, Entry, LANES, SectorBatch, StoredBatch};
    use scindo_matter::element::avx2::Register;

    /// # Safety
    /// As for [`super::add`].
    #[target_feature(enable = "avx2,fma")]
    pub(super) unsafe fn add(
        batches: &[SectorBatch],
        hanging: &[[u8; LANES]],
        table: &BlockTable,
        rows: &mut [Block6],
    ) {
        // SAFETY: the caller's promise.
        unsafe { super::add_with::<Register>(batches, hanging, table, rows) };
    }

    /// # Safety
    /// As for [`super::add_stored`].
    #[target_feature(enable = "avx2,fma,f16c")]
    pub(super) unsafe fn add_stored<E: Entry>(batches: &[StoredBatch<E>], rows: &mut [Block6]) {
        // SAFETY: the caller's promise.
        unsafe { super::add_stored_with::<Register, E>(batches, rows) };
    }
}
