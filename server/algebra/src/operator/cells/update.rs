//! Rotations and internal forces of the cells of a chunk at given positions.

#![allow(unsafe_code)] // vector instructions behind run-time detection, and unchecked gathers

use nalgebra::{Matrix3, Vector3};
use scindo_matter::element::{
    Batched, LANES, Lanes, Mat3, Simd, Vector8, for_eight, polar_newton, polar_rotation,
};
use scindo_matter::octree::{At, Lattice};
use smallvec::SmallVec;

use super::super::chunks::NO_PIECE;
use super::super::{Padded, padded};
use super::batch::{
    Corners, HangingWeights, SectorBatch, TableLanes, distribute, from_cell, interpolate, multiply_sectors,
    part_of, read_matrix, read_weights, scatter, to_cell, transform,
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

    /// Updates the rotations of `chunk` and writes the internal forces [N] of its vertices. `scale` is the s in
    /// the factors of the cells.
    pub(super) fn update(
        &self,
        simd: Simd,
        chunk: &mut CellChunk,
        (tables, scale): (&[Table], f32),
        positions: &[Vector3<f64>],
        f: &mut [Padded],
    ) {
        let mut local = Positions::new();
        local.extend(chunk.vertices.iter().map(|&vertex| {
            let x = &positions[vertex as usize];
            [x.x, x.y, x.z, 0.0]
        }));
        let f = &mut f[..chunk.vertices.len()];
        f.fill([0.0; 4]);
        assert!(local.len() == f.len());
        chunk.inverted = 0;
        for group in &chunk.groups {
            let CellMatrix::Table(t) = group.matrix else { continue };
            let range = group.batches.clone();
            let mut part = Part {
                batches: &mut chunk.batches[range.clone()],
                lanes: &chunk.lanes[range.clone()],
                sides: &self.sides[range],
                weights: &chunk.weights[group.weights.clone()],
                table: &tables[usize::from(t)].lanes,
                per_scale: 1.0 / scale,
            };
            // SAFETY: local numbers are indices into `vertices`, which is as long as `local` and `f`.
            chunk.inverted += unsafe { update(simd, &mut part, &local, f) };
        }
    }

    /// f = K u with displacements u relative to the chunk's first vertex, subtracted in double precision: the
    /// error is relative to the chunk, not to how far the body has moved.
    pub(super) fn linear_forces(
        &self,
        simd: Simd,
        chunk: &mut CellChunk,
        (tables, scale): (&[Table], f32),
        (positions, lattice): (&[Vector3<f64>], &Lattice),
        f: &mut [Padded],
    ) {
        let displacement = |k: usize| positions[chunk.vertices[k] as usize] - lattice.point(self.points[k]);
        let origin = if chunk.vertices.is_empty() { Vector3::zeros() } else { displacement(0) };
        let locals = (0..chunk.vertices.len()).map(|k| padded(&(displacement(k) - origin)));
        let local: LocalVector = locals.collect();
        chunk.apply(simd, tables, &local, f);
        let factor = 1.0 / scale;
        f[..local.len()].as_flattened_mut().iter_mut().for_each(|f| *f *= factor);
    }
}

/// The batches of one group.
struct Part<'a> {
    batches: &'a mut [SectorBatch],
    lanes: &'a [BatchLanes],
    sides: &'a [RestBatch],
    weights: &'a [HangingWeights],
    table: &'a TableLanes,
    /// 1/s.
    per_scale: f32,
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
        let mut u: Corners<V> = [[V::splat(0.0); 8]; 3];
        for_eight!(j => {
            if j > 0 {
                // SAFETY: the caller's promise.
                let edge = unsafe { V::gather_all_edges(x, batch, |batch| [&batch.nodes[0], &batch.nodes[j]]) };
                (u[0][j], u[1][j], u[2][j]) = (edge[0], edge[1], edge[2]);
            }
        });
        let weights: Option<&[HangingWeights; N]> = weights.get(b);
        if let Some(weights) = weights {
            interpolate(&mut u, &read_weights(weights));
        }
        transform(&mut u);
        // F̂ = δ F D: column k is the difference across axis k.
        let inverse = V::read(side, |side: &RestBatch| &side.inverse);
        let mut F = [inverse; 9];
        for i in 0..3 {
            for k in 0..3 {
                F[3 * i + k] = inverse * u[i][1 << k];
            }
        }
        inverted += rotate(&F, batch, lanes);
        // R̂ᵀ x − X in the frame of the cell, then as in a product.
        let R = read_matrix(batch, |batch| &batch.rotation);
        to_cell(&mut u, &R);
        let rest = V::read(batch, |batch| &batch.root) * V::read(side, |side| &side.span);
        for k in 0..3 {
            u[k][1 << k] = u[k][1 << k] + rest;
        }
        multiply_sectors(&mut u, part.table);
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

    use super::{Padded, Part};
    use scindo_matter::element::avx2::Register;

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
