//! The inner loops of a product: eight cells at once.

#![allow(unsafe_code)] // vector instructions behind run-time detection, and unchecked gathers

use scindo_matter::element::{
    Batched, Ids, LANES, Lanes, Mat3, Simd, Vector, Vector8, for_eight, prefetch_at,
};

use super::super::Padded;
use super::super::twist::{self, TwistBatch, read_twist};
use super::sectors::SectorTable;

/// Eight cells with one table.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
#[repr(C)]
pub(super) struct SectorBatch {
    /// √c R̂ with the factor c of the cell; 0 in unused lanes.
    pub rotation: Mat3<Lanes>,
    /// √c.
    pub root: Lanes,
    /// Local numbers of the vertices, by slot. Unused lanes have those of the first lane.
    pub nodes: [Ids; 8],
}

/// Batches are asked for so many turns before they are needed.
pub(super) const AHEAD: usize = 4;

/// Weights of hanging slots, in the order of [`HANGING_SLOTS`](super::lane::HANGING_SLOTS): ½ or ¼ where the slot hangs, 0 elsewhere.
pub(super) type HangingWeights = [Lanes; 6];

/// A table as the kernel reads it: every entry in all lanes.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct TableLanes(pub [[Lanes; 6]; 8]);

impl TableLanes {
    /// Rounds the entries.
    pub(super) fn new(table: &SectorTable) -> Self {
        Self(table.sectors.map(|sector| sector.map(|s| Lanes([s as f32; LANES]))))
    }
}

/// The corners of eight cells: component, then slot or parity.
pub(super) type Corners<V> = [[V; 8]; 3];

/// The cells of one group, as a product reads them.
#[derive(Clone, Copy)]
pub(super) struct GroupCells<'a> {
    pub batches: &'a [SectorBatch],
    /// Their twists; empty where these do not matter.
    pub twists: &'a [TwistBatch],
    /// Weights of hanging vertices; empty if there are none.
    pub weights: &'a [HangingWeights],
    pub table: &'a TableLanes,
}

/// y += Σ Wᵀ c R̂ S R̂ᵀ W x over the batches. `weights` has an entry per batch, or none if no slot hangs; `twists` has one,
/// or none if twists do not count.
///
/// # Safety
/// All local numbers are below the lengths of `x` and `y`, which are the same.
pub(super) unsafe fn multiply(simd: Simd, cells: GroupCells<'_>, x: &[Padded], y: &mut [Padded]) {
    match simd {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: these come from `Simd::detect` only; the rest is the caller's promise.
        Simd::Avx2 => unsafe { avx2::multiply(cells, x, y) },
        #[cfg(target_arch = "x86_64")]
        // SAFETY: as above.
        Simd::Avx512 => unsafe { avx512::multiply(cells, x, y) },
        // SAFETY: the caller's promise.
        _ => unsafe { multiply_some::<Lanes, 1>(cells, x, y) },
    }
}

/// Products of as many batches as come in runs of N.
///
/// # Safety
/// As for [`multiply`].
#[inline(always)]
unsafe fn multiply_some<V: Batched<N>, const N: usize>(
    cells: GroupCells<'_>,
    x: &[Padded],
    y: &mut [Padded],
) {
    let GroupCells { batches, twists, weights, table } = cells;
    let (batches, twists, weights) = (batches.as_chunks().0, twists.as_chunks().0, weights.as_chunks().0);
    // SAFETY: the caller's promise.
    unsafe {
        match (weights.is_empty(), twists.is_empty()) {
            (true, true) => multiply_with::<V, N, false, false>(batches, twists, weights, table, x, y),
            (true, false) => multiply_with::<V, N, false, true>(batches, twists, weights, table, x, y),
            (false, true) => multiply_with::<V, N, true, false>(batches, twists, weights, table, x, y),
            (false, false) => multiply_with::<V, N, true, true>(batches, twists, weights, table, x, y),
        }
    }
}

/// # Safety
/// As for [`multiply`].
#[inline(always)]
unsafe fn multiply_with<V: Batched<N>, const N: usize, const HANGING: bool, const TWISTED: bool>(
    batches: &[[SectorBatch; N]],
    twists: &[[TwistBatch; N]],
    weights: &[[HangingWeights; N]],
    table: &TableLanes,
    x: &[Padded],
    y: &mut [Padded],
) {
    for (b, batch) in batches.iter().enumerate() {
        prefetch_at(batches, b + AHEAD / N);
        if HANGING {
            prefetch_at(weights, b + AHEAD / N);
        }
        // Rotations act on components, all other steps on slots: they commute.
        // SAFETY: the caller's promise.
        let mut u: Corners<V> = unsafe { gather(x, batch, |batch| &batch.nodes) };
        let R = read_matrix(batch, |batch| &batch.rotation);
        to_cell(&mut u, &R);
        if HANGING {
            interpolate(&mut u, &read_weights(&weights[b]));
        }
        transform(&mut u);
        if TWISTED {
            let torque = torque(&u, &read_twist(&twists[b]));
            multiply_sectors(&mut u, table);
            add_torque(&mut u, &torque);
        } else {
            multiply_sectors(&mut u, table);
        }
        transform(&mut u);
        if HANGING {
            distribute(&mut u, &read_weights(&weights[b]));
        }
        from_cell(&mut u, &R);
        for k in 0..N {
            // SAFETY: the caller's promise.
            unsafe { scatter(y, &batch[k].nodes, &part_of(&u, k)) };
        }
    }
}

// Loops instead of closures below: see `Vector`. Closures that only name a field are none of those.

/// # Safety
/// All local numbers are below the length of `x`.
#[inline(always)]
pub(super) unsafe fn gather<V: Batched<N>, const N: usize, B>(
    x: &[Padded],
    from: &[B; N],
    nodes: impl Fn(&B) -> &[Ids; 8],
) -> Corners<V> {
    // Written out: a loop over slots would keep everything in memory.
    // SAFETY: the caller's promise.
    let [a, b, c, d, e, f, g, h] = unsafe {
        [
            V::gather_all(x, from, |batch| &nodes(batch)[0]),
            V::gather_all(x, from, |batch| &nodes(batch)[1]),
            V::gather_all(x, from, |batch| &nodes(batch)[2]),
            V::gather_all(x, from, |batch| &nodes(batch)[3]),
            V::gather_all(x, from, |batch| &nodes(batch)[4]),
            V::gather_all(x, from, |batch| &nodes(batch)[5]),
            V::gather_all(x, from, |batch| &nodes(batch)[6]),
            V::gather_all(x, from, |batch| &nodes(batch)[7]),
        ]
    };
    [
        [a[0], b[0], c[0], d[0], e[0], f[0], g[0], h[0]],
        [a[1], b[1], c[1], d[1], e[1], f[1], g[1], h[1]],
        [a[2], b[2], c[2], d[2], e[2], f[2], g[2], h[2]],
    ]
}

/// # Safety
/// All local numbers are below the length of `y`.
#[inline(always)]
pub(super) unsafe fn scatter<V: Vector8>(y: &mut [Padded], nodes: &[Ids; 8], f: &Corners<V>) {
    for_eight!(j => {
        // SAFETY: the caller's promise.
        unsafe { V::scatter(y, &nodes[j], [f[0][j], f[1][j], f[2][j]]) };
    });
}

/// The corners of one batch.
#[inline(always)]
pub(super) fn part_of<V: Batched<N>, const N: usize>(u: &Corners<V>, batch: usize) -> Corners<V::Part> {
    let mut out = [[V::Part::splat(0.0); 8]; 3];
    for i in 0..3 {
        for_eight!(j => {
            out[i][j] = u[i][j].part(batch);
        });
    }
    out
}

/// W: displacements of the corners from those of the vertices.
#[inline(always)]
pub(super) fn interpolate<V: Vector>(u: &mut Corners<V>, weights: &[V; 6]) {
    let [w1, w2, w4, w3, w5, w6] = *weights;
    let minus_three = V::splat(-3.0);
    for i in 0..3 {
        let [v0, v1, v2, v3, v4, v5, v6, v7] = u[i];
        let (v01, v24) = (v0 + v1, v2 + v4);
        u[i] = [
            v0,
            w1.mul_add(v0 - v1, v1),
            w2.mul_add(v0 - v2, v2),
            w3.mul_add(minus_three.mul_add(v3, v01 + v2), v3),
            w4.mul_add(v0 - v4, v4),
            w5.mul_add(minus_three.mul_add(v5, v01 + v4), v5),
            w6.mul_add(minus_three.mul_add(v6, v0 + v24), v6),
            v7,
        ];
    }
}

/// Wᵀ: forces on the vertices from those on the corners.
#[inline(always)]
pub(super) fn distribute<V: Vector>(f: &mut Corners<V>, weights: &[V; 6]) {
    let [w1, w2, w4, w3, w5, w6] = *weights;
    let minus_three = V::splat(-3.0);
    for i in 0..3 {
        let [g0, g1, g2, g3, g4, g5, g6, g7] = f[i];
        let (s1, s2, s4) = (w1 * g1, w2 * g2, w4 * g4);
        let (s3, s5, s6) = (w3 * g3, w5 * g5, w6 * g6);
        f[i] = [
            g0 + (s1 + s2) + (s4 + s3) + (s5 + s6),
            (g1 - s1) + (s3 + s5),
            (g2 - s2) + (s3 + s6),
            minus_three.mul_add(s3, g3),
            (g4 - s4) + (s5 + s6),
            minus_three.mul_add(s5, g5),
            minus_three.mul_add(s6, g6),
            g7,
        ];
    }
}

/// Weights of every batch.
#[inline(always)]
pub(super) fn read_weights<V: Batched<N>, const N: usize>(weights: &[HangingWeights; N]) -> [V; 6] {
    let mut out = [V::splat(0.0); 6];
    for k in 0..6 {
        out[k] = V::read(weights, |weights| &weights[k]);
    }
    out
}

/// û_p = Σ_j (−1)^{|j & p|} u_j, in place.
#[inline(always)]
pub(super) fn transform<V: Vector>(u: &mut Corners<V>) {
    for i in 0..3 {
        let [a, b, c, d, e, f, g, h] = u[i];
        let (a, b, c, d) = (a + b, a - b, c + d, c - d);
        let (e, f, g, h) = (e + f, e - f, g + h, g - h);
        let (a, b, c, d) = (a + c, b + d, a - c, b - d);
        let (e, f, g, h) = (e + g, f + h, e - g, f - h);
        u[i] = [a + e, b + f, c + g, d + h, a - e, b - f, c - g, d - h];
    }
}

/// √c R̂ᵀ u.
#[inline(always)]
pub(super) fn to_cell<V: Vector>(u: &mut Corners<V>, R: &Mat3<V>) {
    let [xx, xy, xz, yx, yy, yz, zx, zy, zz] = *R;
    for_eight!(p => {
        let (x, y, z) = (u[0][p], u[1][p], u[2][p]);
        u[0][p] = xx.mul_add(x, yx.mul_add(y, zx * z));
        u[1][p] = xy.mul_add(x, yy.mul_add(y, zy * z));
        u[2][p] = xz.mul_add(x, yz.mul_add(y, zz * z));
    });
}

/// √c R̂ f.
#[inline(always)]
pub(super) fn from_cell<V: Vector>(f: &mut Corners<V>, R: &Mat3<V>) {
    let [xx, xy, xz, yx, yy, yz, zx, zy, zz] = *R;
    for_eight!(p => {
        let (x, y, z) = (f[0][p], f[1][p], f[2][p]);
        f[0][p] = xx.mul_add(x, xy.mul_add(y, xz * z));
        f[1][p] = yx.mul_add(x, yy.mul_add(y, yz * z));
        f[2][p] = zx.mul_add(x, zy.mul_add(y, zz * z));
    });
}

/// The rotation of every batch.
#[inline(always)]
pub(super) fn read_matrix<V: Batched<N>, const N: usize, B>(
    from: &[B; N],
    field: impl Fn(&B) -> &Mat3<Lanes>,
) -> Mat3<V> {
    let mut out = [V::splat(0.0); 9];
    for i in 0..9 {
        out[i] = V::read(from, |batch| &field(batch)[i]);
    }
    out
}

/// S û.
#[inline(always)]
pub(super) fn multiply_sectors<V: Batched<N>, const N: usize>(u: &mut Corners<V>, table: &TableLanes) {
    for_eight!(q => {
        let [xx, xy, xz, yy, yz, zz] = &table.0[q];
        let (xx, xy, xz) = (V::shared(xx), V::shared(xy), V::shared(xz));
        let (yy, yz, zz) = (V::shared(yy), V::shared(yz), V::shared(zz));
        let (a, b, c) = (u[0][q ^ 1], u[1][q ^ 2], u[2][q ^ 4]);
        u[0][q ^ 1] = xx.mul_add(a, xy.mul_add(b, xz * c));
        u[1][q ^ 2] = xy.mul_add(a, yy.mul_add(b, yz * c));
        u[2][q ^ 4] = xz.mul_add(a, yz.mul_add(b, zz * c));
    });
}

/// Q ω, where ω is half the curl of the mean gradient of û.
#[inline(always)]
fn torque<V: Vector>(u: &Corners<V>, Q: &[V; 6]) -> [V; 3] {
    let half = V::splat(0.5);
    twist::times(Q, &[half * (u[2][2] - u[1][4]), half * (u[0][4] - u[2][1]), half * (u[1][1] - u[0][2])])
}

/// Adds the forces of Q ω.
#[inline(always)]
fn add_torque<V: Vector>(u: &mut Corners<V>, torque: &[V; 3]) {
    let [x, y, z] = *torque;
    (u[2][2], u[1][4]) = (u[2][2] + x, u[1][4] - x);
    (u[0][4], u[2][1]) = (u[0][4] + y, u[2][1] - y);
    (u[1][1], u[0][2]) = (u[1][1] + z, u[0][2] - z);
}

#[cfg(target_arch = "x86_64")]
mod avx2 {
    //! The same loop compiled for AVX2 and FMA.

    use super::{GroupCells, Padded};
    use scindo_matter::element::avx2::Register;

    /// # Safety
    /// As for [`super::multiply`].
    #[target_feature(enable = "avx2,fma")]
    pub(super) unsafe fn multiply(cells: GroupCells<'_>, x: &[Padded], y: &mut [Padded]) {
        // SAFETY: the caller's promise.
        unsafe { super::multiply_some::<Register, 1>(cells, x, y) };
    }
}

#[cfg(target_arch = "x86_64")]
mod avx512 {
    //! The same loop for two batches at once; one that is left over takes AVX2.

    use super::{GroupCells, Padded};
    use scindo_matter::element::avx2::Register;
    use scindo_matter::element::avx512::Register512;

    /// # Safety
    /// As for [`super::multiply`].
    #[target_feature(enable = "avx512f,avx2,fma")]
    pub(super) unsafe fn multiply(cells: GroupCells<'_>, x: &[Padded], y: &mut [Padded]) {
        // SAFETY: the caller's promise.
        unsafe { super::multiply_some::<Register512, 2>(cells, x, y) };
        if cells.batches.len() % 2 == 1 {
            let last = GroupCells {
                batches: &cells.batches[cells.batches.len() - 1..],
                twists: &cells.twists[cells.twists.len().saturating_sub(1)..],
                weights: &cells.weights[cells.weights.len().saturating_sub(1)..],
                table: cells.table,
            };
            // SAFETY: the caller's promise.
            unsafe { super::multiply_some::<Register, 1>(last, x, y) };
        }
    }
}
