//! Rotations and internal forces of the cells of a chunk at given positions.

#![allow(unsafe_code)] // vector instructions behind run-time detection, and unchecked gathers

use nalgebra::{Matrix3, Vector3};
use scindo_matter::element::{
    Batched, LANES, Lanes, Mat3, Simd, Vector, Vector8, for_eight, polar_newton, polar_rotation,
};
use scindo_matter::octree::{At, Lattice};
use smallvec::SmallVec;

use super::super::chunks::NO_PIECE;
use super::super::stiffness::UpdateAt;
use super::super::twist::{TwistBatch, TwistCoefficients, twist};
use super::super::{Padded, padded};
use super::batch::{
    Corners, HangingWeights, SectorBatch, distribute, from_cell, interpolate, multiply_sectors, part_of,
    read_matrix, read_weights, scatter, to_cell, transform,
};
use super::chunk::{BatchLanes, CellChunk, LocalVector, MOST_VERTICES, Table};
use super::lane::{CellMatrix, handedness};

/// What only an update needs of a chunk.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct RestChunk {
    /// Lattice points, by local number.
    points: Vec<At>,
    /// Of every batch.
    sides: Vec<RestBatch>,
}

/// Positions [m] by local number, as a [`LocalVector`].
type Positions = SmallVec<[[f64; 4]; MOST_VERTICES]>;

impl RestChunk {
    /// Bytes in use.
    pub(super) fn memory(&self) -> usize {
        size_of_val(&self.points[..]) + size_of_val(&self.sides[..])
    }
}

/// Sides of eight cells.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
struct RestBatch {
    /// 4 δ times the side [m], δ the handedness of the octant: minus the only components of the rest state in
    /// the coordinates of the kernel. 0 in unused lanes.
    span: Lanes,
    /// −1/span.
    inverse: Lanes,
}

impl RestChunk {
    /// The rest state of `chunk`: the lattice point of each vertex and the side of each cell [m] by number.
    pub(super) fn new(chunk: &CellChunk, points: &[At], side: impl Fn(u32) -> f64) -> Self {
        let sides = chunk.lanes.iter().map(|lanes| {
            let mut batch = RestBatch { span: Lanes::default(), inverse: Lanes([-1.0; LANES]) };
            for (lane, &cell) in lanes.cells.iter().enumerate().filter(|(_, cell)| **cell != NO_PIECE) {
                let span = 4.0 * side(cell) as f32 * handedness(lanes.octants[lane]);
                (batch.span.0[lane], batch.inverse.0[lane]) = (span, -1.0 / span);
            }
            batch
        });
        Self { points: chunk.vertices.iter().map(|&v| points[v as usize]).collect(), sides: sides.collect() }
    }

    /// Updates the rotations of `chunk` and writes the internal forces [N] of its vertices, and the twists at the
    /// positions of the tension, where these matter.
    pub(super) fn update(
        &self,
        simd: Simd,
        chunk: &mut CellChunk,
        with: CellTables<'_>,
        at: UpdateAt<'_>,
        f: &mut [Padded],
    ) {
        let UpdateAt { positions, tension } = at;
        let local = local_positions(chunk, positions);
        let start = tension.filter(|tension| tension.damping > 0.0);
        let start = start.map(|tension| (local_positions(chunk, tension.start), tension.damping as f32));
        let start = start.as_ref().map(|(start, damping)| (&start[..], *damping));
        let f = &mut f[..chunk.vertices.len()];
        f.fill([0.0; 4]);
        assert!(local.len() == f.len());
        (chunk.inverted, chunk.twisted) = (0, false);
        let mut pulled = 0;
        for group in &chunk.groups {
            let CellMatrix::Table(t) = group.matrix else { continue };
            let range = group.batches.clone();
            let mut part = Part {
                batches: &mut chunk.batches[range.clone()],
                lanes: &chunk.lanes[range.clone()],
                sides: &self.sides[range],
                weights: &chunk.weights[group.weights.clone()],
                table: &with.tables[usize::from(t)],
                per_scale: 1.0 / with.scale,
                start,
                pulled: 0,
            };
            // SAFETY: local numbers are indices into `vertices`, which is as long as `local` and `f`.
            chunk.inverted += unsafe { update(simd, &mut part, &local, f) };
            pulled |= part.pulled;
        }
        if let (true, Some(tension)) = (pulled != 0, tension) {
            self.find_twists(simd, chunk, with.tables, tension.at, false);
        }
    }

    /// Finds the twists of `chunk` at other `positions` than those of the update. They count if they matter here, or if
    /// `they_do` elsewhere in the body.
    pub(super) fn find_twists(
        &self,
        simd: Simd,
        chunk: &mut CellChunk,
        tables: &[Table],
        positions: &[Vector3<f64>],
        they_do: bool,
    ) {
        let local = local_positions(chunk, positions);
        chunk.twists.resize(chunk.batches.len(), TwistBatch::default());
        let mut matter = 0;
        for group in &chunk.groups {
            let CellMatrix::Table(t) = group.matrix else { continue };
            let Some(c) = &tables[usize::from(t)].twists else { continue };
            let range = group.batches.clone();
            let (batches, sides) = (&chunk.batches[range.clone()], &self.sides[range.clone()]);
            let weights = &chunk.weights[group.weights.clone()];
            let twists = &mut chunk.twists[range];
            // SAFETY: local numbers are indices into `vertices`, which is as long as `local`.
            matter |= match simd {
                #[cfg(target_arch = "x86_64")]
                // SAFETY: both come from `Simd::detect` only.
                Simd::Avx2 | Simd::Avx512 => unsafe {
                    avx2::find_twists(batches, sides, weights, &local, c, twists)
                },
                // SAFETY: as above.
                _ => unsafe { find_twists_with::<Lanes>(batches, sides, weights, &local, c, twists) },
            };
        }
        chunk.twisted = they_do || matter != 0;
    }

    /// f = K u with displacements u relative to the chunk's first vertex, subtracted in double precision: the
    /// error is relative to the chunk, not to how far the body has moved.
    pub(super) fn linear_forces(
        &self,
        simd: Simd,
        chunk: &mut CellChunk,
        with: CellTables<'_>,
        (positions, lattice): (&[Vector3<f64>], &Lattice),
        f: &mut [Padded],
    ) {
        let displacement = |k: usize| positions[chunk.vertices[k] as usize] - lattice.point(self.points[k]);
        let origin = if chunk.vertices.is_empty() { Vector3::zeros() } else { displacement(0) };
        let locals = (0..chunk.vertices.len()).map(|k| padded(&(displacement(k) - origin)));
        let local: LocalVector = locals.collect();
        chunk.apply(simd, with.tables, false, &local, f);
        let factor = 1.0 / with.scale;
        f[..local.len()].as_flattened_mut().iter_mut().for_each(|f| *f *= factor);
    }
}

/// Tables of the cells, and the s in their factors.
#[derive(Clone, Copy)]
pub(super) struct CellTables<'a> {
    pub tables: &'a [Table],
    pub scale: f32,
}

/// Positions of the vertices of a chunk.
fn local_positions(chunk: &CellChunk, positions: &[Vector3<f64>]) -> Positions {
    let mut local = Positions::new();
    local.extend(chunk.vertices.iter().map(|&vertex| {
        let x = &positions[vertex as usize];
        [x.x, x.y, x.z, 0.0]
    }));
    local
}

/// The batches of one group.
struct Part<'a> {
    batches: &'a mut [SectorBatch],
    lanes: &'a [BatchLanes],
    sides: &'a [RestBatch],
    weights: &'a [HangingWeights],
    table: &'a Table,
    /// 1/s.
    per_scale: f32,
    /// Positions where the step starts, and β/h, if the forces contain those of damping.
    start: Option<(&'a [[f64; 4]], f32)>,
    /// Out: lanes so stretched that their twists may matter.
    pulled: u16,
}

/// Returns the number of cells with det F ≤ 0.
///
/// # Safety
/// All local numbers are below the lengths of `x` and `f`.
unsafe fn update(simd: Simd, part: &mut Part<'_>, x: &[[f64; 4]], f: &mut [Padded]) -> usize {
    match simd {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: these come from `Simd::detect` only; the rest is the caller's promise.
        Simd::Avx2 => unsafe { avx2::update(part, x, f) },
        #[cfg(target_arch = "x86_64")]
        // SAFETY: as above.
        Simd::Avx512 => unsafe { avx512::update(part, x, f) },
        // SAFETY: the caller's promise.
        _ => unsafe { update_with::<Lanes, 1>(part, 0, x, f) },
    }
}

/// The batches from number `first` on, as many as come in runs of N.
///
/// # Safety
/// As for [`update`].
#[inline(always)]
unsafe fn update_with<V: Batched<N>, const N: usize>(
    part: &mut Part<'_>,
    first: usize,
    x: &[[f64; 4]],
    f: &mut [Padded],
) -> usize {
    let mut inverted = 0;
    let batches = part.batches[first..].as_chunks_mut().0;
    let (lanes, sides) = (part.lanes[first..].as_chunks().0, part.sides[first..].as_chunks().0);
    let weights = part.weights.get(first..).unwrap_or_default().as_chunks().0;
    for (b, ((batch, lanes), side)) in batches.iter_mut().zip(lanes).zip(sides).enumerate() {
        let weights: Option<&[HangingWeights; N]> = weights.get(b);
        // SAFETY: the caller's promise.
        let mut u: Corners<V> = unsafe { transformed(batch, weights, x) };
        let inverse = V::read(side, |side: &RestBatch| &side.inverse);
        let F = mean_gradient(&u, inverse);
        inverted += rotate(&F, batch, lanes);
        // R̂ᵀ x − X in the frame of the cell, then as in a product.
        let R = read_matrix(batch, |batch| &batch.rotation);
        to_cell(&mut u, &R);
        let rest = V::read(batch, |batch| &batch.root) * V::read(side, |side| &side.span);
        add_rest(&mut u, rest);
        if let Some(twists) = &part.table.twists {
            part.pulled |= pulled(&u, inverse, V::read(batch, |batch| &batch.root), twists);
        }
        if let Some((start, damping)) = part.start {
            // SAFETY: the caller's promise, and `start` is as long as `x`.
            let mut before: Corners<V> = unsafe { transformed(batch, weights, start) };
            let F = mean_gradient(&before, inverse);
            to_cell(&mut before, &rotation_of(&F, batch, lanes));
            add_rest(&mut before, rest);
            let rate = V::splat(damping);
            for i in 0..3 {
                for_eight!(p => {
                    u[i][p] = rate.mul_add(u[i][p] - before[i][p], u[i][p]);
                });
            }
        }
        multiply_sectors(&mut u, &part.table.lanes);
        from_cell(&mut u, &R);
        let per_scale = V::splat(part.per_scale);
        for i in 0..3 {
            for p in 0..8 {
                u[i][p] = u[i][p] * per_scale;
            }
        }
        transform(&mut u);
        if let Some(weights) = weights {
            distribute(&mut u, &read_weights(weights));
        }
        for k in 0..N {
            // SAFETY: the caller's promise.
            unsafe { scatter(f, &batch[k].nodes, &part_of(&u, k)) };
        }
    }
    inverted
}

/// Takes the edges of the cell away, which lie in the patterns that are linear along one axis.
#[inline(always)]
fn add_rest<V: Vector>(u: &mut Corners<V>, rest: V) {
    for k in 0..3 {
        u[k][1 << k] = u[k][1 << k] + rest;
    }
}

/// û at the positions `x`, relative to those of slot 0.
///
/// # Safety
/// All local numbers are below the length of `x`.
#[inline(always)]
unsafe fn transformed<V: Batched<N>, const N: usize>(
    batch: &[SectorBatch; N],
    weights: Option<&[HangingWeights; N]>,
    x: &[[f64; 4]],
) -> Corners<V> {
    let mut u: Corners<V> = [[V::splat(0.0); 8]; 3];
    for_eight!(j => {
        if j > 0 {
            // SAFETY: the caller's promise.
            let edge = unsafe { V::gather_all_edges(x, batch, |batch| [&batch.nodes[0], &batch.nodes[j]]) };
            (u[0][j], u[1][j], u[2][j]) = (edge[0], edge[1], edge[2]);
        }
    });
    if let Some(weights) = weights {
        interpolate(&mut u, &read_weights(weights));
    }
    transform(&mut u);
    u
}

/// F̂ = δ F D: column k is the difference across axis k.
#[inline(always)]
fn mean_gradient<V: Vector>(u: &Corners<V>, inverse: V) -> Mat3<V> {
    let mut F = [inverse; 9];
    for i in 0..3 {
        for k in 0..3 {
            F[3 * i + k] = inverse * u[i][1 << k];
        }
    }
    F
}

/// Lanes whose twists may matter, by the strain at the predictor: û is √c times that over `inverse`.
#[inline(always)]
fn pulled<V: Vector>(u: &Corners<V>, inverse: V, root: V, twists: &TwistCoefficients) -> u16 {
    let half = inverse * V::splat(0.5);
    let strain = [
        inverse * u[0][1],
        half * (u[0][2] + u[1][1]),
        half * (u[0][4] + u[2][1]),
        inverse * u[1][2],
        half * (u[1][4] + u[2][2]),
        inverse * u[2][4],
    ];
    twists.matters(twists.bound(&strain), root, sharpness(inverse, root))
}

/// c/a³ of cells of side a.
#[inline(always)]
fn sharpness<V: Vector>(inverse: V, root: V) -> V {
    let per_side = V::splat(4.0) * inverse.max(-inverse);
    root * root * per_side * per_side * per_side
}

/// Finds the twists at the positions `x`. Returns the lanes in which they matter.
///
/// # Safety
/// All local numbers are below the length of `x`.
#[inline(always)]
unsafe fn find_twists_with<V: Vector8>(
    batches: &[SectorBatch],
    sides: &[RestBatch],
    weights: &[HangingWeights],
    x: &[[f64; 4]],
    c: &TwistCoefficients,
    twists: &mut [TwistBatch],
) -> u16 {
    let (batches, sides) = (batches.as_chunks::<1>().0, sides.as_chunks::<1>().0);
    let (weights, twists) = (weights.as_chunks::<1>().0, twists.as_chunks_mut::<1>().0);
    let (one, factor) = (V::splat(1.0), V::splat(c.cell_factor()));
    let mut matter = 0;
    for (b, ((batch, side), to)) in batches.iter().zip(sides).zip(twists).enumerate() {
        // SAFETY: the caller's promise.
        let u: Corners<V> = unsafe { transformed(batch, weights.get(b), x) };
        let inverse = V::read(side, |side: &RestBatch| &side.inverse);
        let F = mean_gradient(&u, inverse);
        let (Q, most) = twist(&[[F[0], F[1], F[2]], [F[3], F[4], F[5]], [F[6], F[7], F[8]]], c);
        for i in 0..6 {
            (factor * Q[i]).write(to, |to: &mut TwistBatch| &mut to.q[i]);
        }
        matter |= c.matters(most, one, sharpness(inverse, V::read(batch, |batch| &batch.root)));
    }
    matter
}

/// √c R̂ of other gradients than those of the last update.
#[inline(always)]
fn rotation_of<V: Batched<N>, const N: usize>(
    F: &Mat3<V>,
    batches: &mut [SectorBatch; N],
    lanes: &[BatchLanes; N],
) -> Mat3<V> {
    let held: Mat3<V> = read_matrix(batches, |batch| &batch.rotation);
    rotate(F, batches, lanes);
    let found = read_matrix(batches, |batch| &batch.rotation);
    for i in 0..9 {
        held[i].write(batches, |batch| &mut batch.rotation[i]);
    }
    found
}

/// Updates the rotation of every used lane; returns how many have det F ≤ 0.
#[inline(always)]
fn rotate<V: Batched<N>, const N: usize>(
    F: &Mat3<V>,
    batches: &mut [SectorBatch; N],
    lanes: &[BatchLanes; N],
) -> usize {
    let (R, trusted) = polar_newton(F);
    let root = V::read(batches, |batch| &batch.root);
    // Lanes that Newton's method cannot handle are rare and leave the hot loop.
    if trusted == V::ALL {
        for i in 0..9 {
            (root * R[i]).write(batches, |batch| &mut batch.rotation[i]);
        }
        return 0;
    }
    let mut inverted = 0;
    for k in 0..N {
        let (mut stored_F, mut stored_R) = ([Lanes::default(); 9], [Lanes::default(); 9]);
        for i in 0..9 {
            (stored_F[i], stored_R[i]) = (F[i].part(k).store(), (root * R[i]).part(k).store());
        }
        inverted += rotate_guarded(&stored_F, &stored_R, trusted >> (8 * k), &mut batches[k], &lanes[k]);
    }
    inverted
}

#[cold]
#[inline(never)]
fn rotate_guarded(
    F: &Mat3<Lanes>,
    turned: &Mat3<Lanes>,
    trusted: u16,
    batch: &mut SectorBatch,
    lanes: &BatchLanes,
) -> usize {
    let mut inverted = 0;
    for lane in (0..LANES).filter(|&lane| lanes.cells[lane] != NO_PIECE) {
        let root = batch.root.0[lane];
        if trusted >> lane & 1 == 1 {
            for i in 0..9 {
                batch.rotation[i].0[lane] = turned[i].0[lane];
            }
        } else {
            let F = Matrix3::from_fn(|i, j| f64::from(F[3 * i + j].0[lane]));
            let warm = Matrix3::from_fn(|i, j| f64::from(batch.rotation[3 * i + j].0[lane] / root));
            let R = polar_rotation(&F, &warm);
            for i in 0..9 {
                batch.rotation[i].0[lane] = root * R[(i / 3, i % 3)] as f32;
            }
            inverted += usize::from(F.determinant() <= 0.0);
        }
    }
    inverted
}

#[cfg(target_arch = "x86_64")]
mod avx2 {
    //! The same loop compiled for AVX2 and FMA.

    use super::{HangingWeights, Padded, Part, RestBatch, SectorBatch, TwistBatch, TwistCoefficients};
    use scindo_matter::element::avx2::Register;

    /// # Safety
    /// As for [`super::find_twists_with`].
    #[target_feature(enable = "avx2,fma")]
    pub(super) unsafe fn find_twists(
        batches: &[SectorBatch],
        sides: &[RestBatch],
        weights: &[HangingWeights],
        x: &[[f64; 4]],
        c: &TwistCoefficients,
        twists: &mut [TwistBatch],
    ) -> u16 {
        // SAFETY: the caller's promise.
        unsafe { super::find_twists_with::<Register>(batches, sides, weights, x, c, twists) }
    }

    /// # Safety
    /// As for [`super::update`].
    #[target_feature(enable = "avx2,fma")]
    pub(super) unsafe fn update(part: &mut Part<'_>, x: &[[f64; 4]], f: &mut [Padded]) -> usize {
        // SAFETY: the caller's promise.
        unsafe { super::update_with::<Register, 1>(part, 0, x, f) }
    }
}

#[cfg(target_arch = "x86_64")]
mod avx512 {
    //! The same loop for two batches at once; one that is left over takes AVX2.

    use super::{Padded, Part};
    use scindo_matter::element::avx2::Register;
    use scindo_matter::element::avx512::Register512;

    /// # Safety
    /// As for [`super::update`].
    #[target_feature(enable = "avx512f,avx2,fma")]
    pub(super) unsafe fn update(part: &mut Part<'_>, x: &[[f64; 4]], f: &mut [Padded]) -> usize {
        let pairs = part.batches.len() / 2 * 2;
        // SAFETY: the caller's promise.
        unsafe {
            super::update_with::<Register512, 2>(part, 0, x, f)
                + super::update_with::<Register, 1>(part, pairs, x, f)
        }
    }
}
