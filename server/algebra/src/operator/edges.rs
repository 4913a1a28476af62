//! The assembled stiffness of one chunk: one 3×3 block per pair of neighbouring copies.
//!
//! K̂ is symmetric and its rows sum to zero (a translation causes no strain), so the blocks above the
//! diagonal suffice: (K̂ u)_a = Σ_b K_ab (u_b − u_a). That is half the memory of block CSR, 40 bytes per
//! pair. In the caches it is a fifth faster than the tets themselves with AVX2, and hardly faster with AVX-512. But it
//! has to be assembled, which only pays where the stiffness stays the same, as with the linear law, or is applied often.

#![allow(unsafe_code)] // vector instructions behind run-time detection, and unchecked gathers

use nalgebra::{Matrix3, Vector3};
use scindo_matter::element::{Ids, LANES, Lanes, Simd, Vector8};

use super::Padded;
use super::chunks::{NO_PIECE, pack};
use super::kernel::Batches;
use super::law_coefficients::LawCoefficients;
use super::tet_batch::{Block6, Coefficients, Locals, PAIRS};

/// Rows and columns of the entries of a diagonal block.
const UPPER: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];

/// Eight pairs of copies.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
#[repr(C)]
struct EdgeBatch {
    /// s K_ab, row by row [kg in a step].
    block: [[Lanes; 3]; 3],
    /// Local numbers of a and b, a < b.
    nodes: [Ids; 2],
}

/// s K̂ of one chunk, assembled. Local numbers are below those of the [`Batches`] it is made from.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct EdgeBlocks {
    batches: Vec<EdgeBatch>,
    /// For every batch of tets, pair of corners and lane: 8 · batch + lane of the pair here, or
    /// [`NO_PIECE`].
    slots: Vec<[[u32; LANES]; 6]>,
    /// Every pair a · 2¹⁶ + b in ascending order, with 8 · batch + lane.
    pairs: Vec<(u32, u32)>,
    n_locals: usize,
}

impl EdgeBlocks {
    /// Lists the pairs of neighbours in `tets`.
    pub(super) fn new(tets: &Batches) -> Self {
        let mut blocks = Self { batches: Vec::new(), slots: Vec::new(), pairs: Vec::new(), n_locals: 1 };
        let lanes = (0..tets.n_batches()).flat_map(|t| (0..LANES).map(move |lane| [t, lane]));
        blocks.follow(tets, lanes);
        blocks
    }

    /// Follows a change: these lanes (batch, lane) of `tets` are new or have other local numbers. New
    /// pairs are appended; pairs that are no longer needed stay, with zeros.
    pub(super) fn follow(&mut self, tets: &Batches, changed: impl Iterator<Item = [usize; 2]>) {
        let [before, waste] = [self.n_locals, tets.n_locals()].map(|n| (n - 1) as u16);
        for id in self.batches.iter_mut().flat_map(|b| b.nodes.as_flattened_mut()).filter(|id| **id == before)
        {
            *id = waste;
        }
        self.n_locals = tets.n_locals();
        self.slots.resize(tets.n_batches(), [[NO_PIECE; LANES]; 6]);
        // New pairs and where they occur, so that equal pairs come together.
        let mut new: Vec<(u32, u32)> = Vec::with_capacity(PAIRS.len() * changed.size_hint().0);
        for [t, lane] in changed {
            let ids = tets.ids(t, lane);
            for (k, [i, j]) in PAIRS.into_iter().enumerate() {
                let pair = u32::from(ids[i].min(ids[j])) << 16 | u32::from(ids[i].max(ids[j]));
                let slot = &mut self.slots[t][k][lane];
                *slot = NO_PIECE;
                // An unused lane has the waste bin in all corners.
                if ids[i] != ids[j] {
                    match self.pairs.binary_search_by_key(&pair, |known| known.0) {
                        Ok(at) => *slot = self.pairs[at].1,
                        Err(_) => new.push((pair, ((PAIRS.len() * t + k) * LANES + lane) as u32)),
                    }
                }
            }
        }
        new.sort_unstable();
        self.append(&new, waste);
    }

    /// Gives the pairs `new` (ascending, each as often as it occurs, with the place in `slots`) lanes.
    fn append(&mut self, new: &[(u32, u32)], waste: u16) {
        let same = |p: &(u32, u32), q: &(u32, u32)| p.0 == q.0;
        let ends = |pair: u32| [(pair >> 16) as u16, pair as u16];
        let pairs: Vec<[u16; 2]> = new.chunk_by(same).map(|same| ends(same[0].0)).collect();
        let mut slot_of_pair = vec![NO_PIECE; pairs.len()];
        for batch in pack(&pairs, self.n_locals) {
            let mut ids = [[waste; LANES]; 2];
            for (lane, &pair) in batch.iter().enumerate().filter(|(_, p)| **p != NO_PIECE) {
                slot_of_pair[pair as usize] = (LANES * self.batches.len() + lane) as u32;
                for end in 0..2 {
                    ids[end][lane] = pairs[pair as usize][end];
                }
            }
            self.batches.push(EdgeBatch { block: [[Lanes::default(); 3]; 3], nodes: ids });
        }
        let places = self.slots.as_flattened_mut().as_flattened_mut();
        for (same, &slot) in new.chunk_by(same).zip(&slot_of_pair) {
            same.iter().for_each(|&(_, place)| places[place as usize] = slot);
            self.pairs.push((same[0].0, slot));
        }
        self.pairs.sort(); // two runs that are in order
    }

    /// Sums the blocks of the tets as they are in `tets`: with the gradients g′ of the kernel,
    /// K_ab = ½ (g′_a·g′_b I + g′_b g′_aᵀ) + λ/2μ g′_a g′_bᵀ, and −½ [g′_a]× Q [g′_b]× with twists.
    pub(super) fn assemble(&mut self, tets: &Batches) {
        self.clear();
        for (t, slots) in self.slots.iter().enumerate() {
            for lane in 0..LANES {
                let (g, ids) = tets.gradients(t, lane);
                for (slots, [i, j]) in slots.iter().zip(PAIRS) {
                    if slots[lane] == NO_PIECE {
                        continue;
                    }
                    let (a, b) = if ids[i] < ids[j] { (&g[i], &g[j]) } else { (&g[j], &g[i]) };
                    let half_dot = 0.5 * (a[0] * b[0] + a[1] * b[1] + a[2] * b[2]);
                    let slot = slots[lane] as usize;
                    let block = &mut self.batches[slot / LANES].block;
                    for r in 0..3 {
                        for s in 0..3 {
                            let entry = &mut block[r][s].0[slot % LANES];
                            *entry += 0.5 * b[r] * a[s] + tets.ratio() * a[r] * b[s];
                            *entry += if r == s { half_dot } else { 0.0 };
                        }
                    }
                    let Some([xx, xy, xz, yy, yz, zz]) = tets.twist(t, lane) else { continue };
                    let Q = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
                    let [cross_a, cross_b] = [a, b].map(|g| Vector3::from(*g).cross_matrix());
                    let twist = cross_a * Q * cross_b * -0.5;
                    for (r, s) in (0..9).map(|k| (k / 3, k % 3)) {
                        block[r][s].0[slot % LANES] += twist[(r, s)];
                    }
                }
            }
        }
    }

    /// Updates `tets` of a law that is nonlinear in the stretch, whose tangent is summed here. Returns the number of pieces
    /// with det F ≤ 0.
    pub(super) fn update(
        &mut self,
        tets: &mut Batches,
        simd: Simd,
        c: (&Coefficients, &LawCoefficients),
        locals: &mut Locals<'_>,
    ) -> usize {
        self.clear();
        let mut inverted = 0;
        tets.begin_law(c.0, locals);
        for t in 0..tets.n_batches() {
            let tet = tets.update_law(simd, c, t, locals);
            inverted += tet.inverted;
            self.add(tets, t, &tet.blocks);
        }
        self.add_diagonals(locals.blocks);
        inverted
    }

    /// Sets all blocks to 0.
    fn clear(&mut self) {
        for batch in &mut self.batches {
            batch.block = [[Lanes::default(); 3]; 3];
        }
    }

    /// Adds the blocks K_ij, row by row, of every pair of corners i < j of batch number `t` of `tets`.
    fn add(&mut self, tets: &Batches, t: usize, blocks: &[[Lanes; 9]; 6]) {
        for ((slots, [i, j]), from) in self.slots[t].iter().zip(PAIRS).zip(blocks) {
            for lane in (0..LANES).filter(|&lane| slots[lane] != NO_PIECE) {
                let (ids, slot) = (tets.ids(t, lane), slots[lane] as usize);
                let block = &mut self.batches[slot / LANES].block;
                for r in 0..3 {
                    for s in 0..3 {
                        // K_ji is the transpose of K_ij.
                        let entry = if ids[i] < ids[j] { 3 * r + s } else { 3 * s + r };
                        block[r][s].0[slot % LANES] += from[entry].0[lane];
                    }
                }
            }
        }
    }

    /// Adds the diagonal blocks: minus the sum of the others of their rows.
    fn add_diagonals(&self, to: &mut [Block6]) {
        for batch in &self.batches {
            for lane in 0..LANES {
                for (end, ids) in batch.nodes.iter().enumerate() {
                    let diagonal = &mut to[ids[lane] as usize];
                    for (place, (r, s)) in [0, 1, 2, 4, 5, 6].into_iter().zip(UPPER) {
                        let (r, s) = if end == 0 { (r, s) } else { (s, r) };
                        diagonal[place] -= batch.block[r][s].0[lane];
                    }
                }
            }
        }
    }

    /// y += s K̂ x. `x` and `y` have one entry per local number and the waste bin.
    pub(super) fn apply(&self, simd: Simd, x: &[Padded], y: &mut [Padded]) {
        assert!(x.len() == self.n_locals && y.len() == self.n_locals);
        match simd {
            #[cfg(target_arch = "x86_64")]
            // SAFETY: both come from `Simd::detect` only.
            Simd::Avx2 | Simd::Avx512 => unsafe { avx2::apply(&self.batches, x, y) },
            _ => apply_with::<Lanes>(&self.batches, x, y),
        }
    }

    /// Bytes that one application streams.
    pub(super) fn bytes(&self) -> usize {
        self.batches.len() * size_of::<EdgeBatch>()
    }
}

// Loops instead of closures: see `Vector`.
#[inline(always)]
fn apply_with<V: Vector8>(batches: &[EdgeBatch], x: &[Padded], y: &mut [Padded]) {
    for batch in batches {
        // SAFETY: local numbers are below the length of local vectors: they are those of tets.
        let (mut d, from) = unsafe { (V::gather(x, &batch.nodes[1]), V::gather(x, &batch.nodes[0])) };
        for i in 0..3 {
            d[i] = d[i] - from[i];
        }
        let (mut f, mut back) = (d, d);
        for i in 0..3 {
            let [k0, k1, k2] = &batch.block[i];
            let (k0, k1, k2) = (V::load(k0), V::load(k1), V::load(k2));
            f[i] = k0.mul_add(d[0], k1.mul_add(d[1], k2 * d[2]));
            if i == 0 {
                let minus = -d[0];
                back = [k0 * minus, k1 * minus, k2 * minus];
            } else {
                let minus = -d[i];
                back = [k0.mul_add(minus, back[0]), k1.mul_add(minus, back[1]), k2.mul_add(minus, back[2])];
            }
        }
        // SAFETY: as above.
        unsafe {
            V::scatter(y, &batch.nodes[0], f);
            V::scatter(y, &batch.nodes[1], back);
        }
    }
}

#[cfg(target_arch = "x86_64")]
mod avx2 {
    //! The same loop compiled for AVX2 and FMA.

    use super::{EdgeBatch, Padded};
    use scindo_matter::element::avx2::Register;

    #[target_feature(enable = "avx2,fma")]
    pub(super) fn apply(batches: &[EdgeBatch], x: &[Padded], y: &mut [Padded]) {
        super::apply_with::<Register>(batches, x, y);
    }
}
