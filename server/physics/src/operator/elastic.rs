//! K̂, the stiffness of all pieces with rotated gradients, never assembled.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};

use super::chunks::{Gather, NO_PIECE, plan_chunk, region_of_elements};
use super::kernel::{Batches, Block6, Coefficients, Locals, RestBatch};
use super::{BLOCK, LinearOperator, Padded};
use crate::cut::Piece;
use crate::element::{LANES, Lanes, Simd};
use crate::material::{Lame, Law};
use crate::mesh::TetMesh;
use crate::team::{Team, blocks};

/// Most pieces of one chunk: four copies each must leave room in 16-bit local numbers.
const MOST_PIECES: usize = 8192;

/// s K̂ of a body, matrix-free; also its internal forces and the diagonal blocks of s K̂.
#[derive(Debug)]
pub struct Elastic {
    simd: Simd,
    n_pieces: usize,
    /// Region of every element; cuts do not change it.
    region_of_element: Vec<u32>,
    n_regions: usize,
    /// Ordered by region; a region has more than one only after very many cuts.
    chunks: Vec<Chunk>,
    gather: Gather,
}

#[derive(Clone, Debug)]
struct Chunk {
    region: usize,
    copies: Vec<u32>,
    pieces: Vec<[u32; LANES]>,
    batches: Batches,
    positions: Vec<[f64; 4]>,
    x: Vec<Padded>,
    y: Vec<Padded>,
    blocks: Vec<Block6>,
    inverted: usize,
}

/// What an update is made with.
#[derive(Clone, Copy, Debug)]
pub struct ElasticUpdate {
    /// Elastic constants.
    pub lame: Lame,
    /// The law: decides whether pieces rotate.
    pub law: Law,
    /// s, the factor of K̂ [s²].
    pub scale: f64,
}

impl Elastic {
    /// Arranges `pieces` of `mesh` for the kernels, all rotations at rest.
    pub fn new(simd: Simd, mesh: &TetMesh, pieces: &[Piece], n_copies: usize) -> Self {
        let centre = |e: usize| mesh.corners(e).iter().sum::<Vector3<f64>>() / 4.0;
        let centres: Vec<Vector3<f64>> = (0..mesh.tets.len()).map(centre).collect();
        let (region_of_element, n_regions) = region_of_elements(&centres);
        let mut elastic = Self {
            simd,
            n_pieces: 0,
            region_of_element,
            n_regions,
            chunks: Vec::new(),
            gather: Gather::default(),
        };
        elastic.follow(mesh, &[], pieces, n_copies);
        elastic
    }

    /// Rearranges the chunks in which pieces differ from what they were `before` a cut. A new piece
    /// inherits its rotation from a piece its element had before.
    pub fn follow(&mut self, mesh: &TetMesh, before: &[Piece], pieces: &[Piece], n_copies: usize) {
        let region_of = |piece: &Piece| self.region_of_element[piece.element as usize] as usize;
        let mut changed = vec![false; self.n_regions];
        for (p, piece) in pieces.iter().enumerate() {
            changed[region_of(piece)] |= before.get(p) != Some(piece);
        }
        let mut members = vec![Vec::new(); self.n_regions];
        for (p, piece) in pieces.iter().enumerate().filter(|(_, piece)| changed[region_of(piece)]) {
            members[region_of(piece)].push(p as u32);
        }
        let rotations = inherited(&self.rotations(), before, pieces);
        self.chunks.retain(|chunk| !changed[chunk.region]);
        for (region, members) in members.iter().enumerate() {
            let build = |part| Chunk::new(region, part, mesh, pieces, &rotations);
            self.chunks.extend(members.chunks(MOST_PIECES).map(build));
        }
        self.chunks.sort_by_key(|chunk| chunk.region);
        self.gather = Gather::new(self.chunks.iter().map(|c| &c.copies[..]), n_copies);
        self.n_pieces = pieces.len();
    }

    /// Recomputes rotations, rotated gradients, forces and diagonal blocks at `positions` [m] (one
    /// per copy), and writes f_int [N] and the blocks of s K̂. Returns the number of inverted pieces.
    pub fn update(
        &mut self,
        team: &mut Team,
        with: &ElasticUpdate,
        positions: &[Vector3<f64>],
        f_int: &mut [Padded],
        diagonal: &mut [Block6],
    ) -> usize {
        let (simd, c) = (self.simd, coefficients(with));
        team.for_blocks(blocks(&mut self.chunks, 1), |_, chunk| chunk[0].update(simd, &c, positions));
        let (chunks, gather) = (&self.chunks, &self.gather);
        team.for_blocks((blocks(f_int, BLOCK), blocks(diagonal, BLOCK)), |block, (f, diagonal)| {
            for (i, (f, diagonal)) in f.iter_mut().zip(diagonal).enumerate() {
                (*f, *diagonal) = ([0.0; 4], [0.0; 8]);
                for &(k, l) in gather.of(block * BLOCK + i) {
                    let chunk = &chunks[k as usize];
                    add(f, &chunk.y[l as usize]);
                    for (sum, part) in diagonal.iter_mut().zip(&chunk.blocks[l as usize]) {
                        *sum += part;
                    }
                }
            }
        });
        self.chunks.iter().map(|chunk| chunk.inverted).sum()
    }

    /// First half of an application: every chunk's own sums of s K̂ x.
    pub(super) fn apply_chunks(&mut self, team: &mut Team, x: &[Padded]) {
        let simd = self.simd;
        team.for_blocks(blocks(&mut self.chunks, 1), |_, chunk| {
            let Chunk { copies, batches, x: local, y, .. } = &mut chunk[0];
            for (local, &copy) in local.iter_mut().zip(copies.iter()) {
                *local = x[copy as usize];
            }
            y.fill([0.0; 4]);
            batches.apply(simd, local, y);
        });
    }

    /// Second half: (s K̂ x) of copy `c`, added to `sum`.
    #[inline(always)]
    pub(super) fn add_sums(&self, c: usize, sum: &mut Padded) {
        for &(k, l) in self.gather.of(c) {
            add(sum, &self.chunks[k as usize].y[l as usize]);
        }
    }

    /// Rotation of every piece at the last update.
    pub fn rotations(&self) -> Vec<Matrix3<f32>> {
        let mut rotations = vec![Matrix3::identity(); self.n_pieces];
        for chunk in &self.chunks {
            for (lanes, rest) in chunk.pieces.iter().zip(chunk.batches.rest()) {
                for (lane, &p) in lanes.iter().enumerate().filter(|(_, p)| **p != NO_PIECE) {
                    rotations[p as usize] = Matrix3::from_fn(|i, j| rest.rotation[3 * i + j].0[lane]);
                }
            }
        }
        rotations
    }

    /// Number of pieces.
    pub fn n_pieces(&self) -> usize {
        self.n_pieces
    }
}

impl LinearOperator for Elastic {
    fn apply(&mut self, team: &mut Team, x: &[Padded], y: &mut [Padded]) {
        self.apply_chunks(team, x);
        let elastic = &*self;
        team.for_blocks(blocks(y, BLOCK), |block, y| {
            for (i, y) in y.iter_mut().enumerate() {
                *y = [0.0; 4];
                elastic.add_sums(block * BLOCK + i, y);
            }
        });
    }
}

impl Chunk {
    fn new(
        region: usize,
        members: &[u32],
        mesh: &TetMesh,
        pieces: &[Piece],
        rotations: &[Matrix3<f32>],
    ) -> Self {
        let plan = plan_chunk(members, pieces);
        let rest = plan.pieces.iter().map(|lanes| rest_batch(lanes, mesh, pieces, rotations)).collect();
        let n = plan.copies.len() + 1;
        Self {
            region,
            batches: Batches::new(&plan.nodes, rest, n),
            pieces: plan.pieces,
            copies: plan.copies,
            positions: vec![[0.0; 4]; n],
            x: vec![[0.0; 4]; n],
            y: vec![[0.0; 4]; n],
            blocks: vec![[0.0; 8]; n],
            inverted: 0,
        }
    }

    fn update(&mut self, simd: Simd, c: &Coefficients, positions: &[Vector3<f64>]) {
        for (local, &copy) in self.positions.iter_mut().zip(&self.copies) {
            let x = &positions[copy as usize];
            *local = [x.x, x.y, x.z, 0.0];
        }
        self.y.fill([0.0; 4]);
        self.blocks.fill([0.0; 8]);
        let mut locals = Locals { x: &self.positions, f: &mut self.y, blocks: &mut self.blocks };
        self.inverted = self.batches.update(simd, c, &mut locals);
    }
}

#[inline(always)]
fn add(sum: &mut Padded, part: &Padded) {
    *sum = std::array::from_fn(|i| sum[i] + part[i]);
}

/// Rotation of every present piece: its own if it existed before, else that of the first piece its
/// element had before, else none.
fn inherited(known: &[Matrix3<f32>], before: &[Piece], pieces: &[Piece]) -> Vec<Matrix3<f32>> {
    let mut first = BTreeMap::new();
    for piece in pieces.iter().skip(before.len()) {
        first.insert(piece.element, Matrix3::identity());
    }
    for (piece, R) in before.iter().zip(known).rev() {
        if let Some(first) = first.get_mut(&piece.element) {
            *first = *R;
        }
    }
    let new = |piece: &Piece| first.get(&piece.element).copied().unwrap_or_else(Matrix3::identity);
    known.iter().copied().take(before.len()).chain(pieces.iter().skip(before.len()).map(new)).collect()
}

fn coefficients(with: &ElasticUpdate) -> Coefficients {
    Coefficients {
        mu: with.lame.mu as f32,
        lambda: with.lame.lambda as f32,
        scale: with.scale as f32,
        rotates: with.law.rotates(),
    }
}

fn rest_batch(
    lanes: &[u32; LANES],
    mesh: &TetMesh,
    pieces: &[Piece],
    rotations: &[Matrix3<f32>],
) -> RestBatch {
    let mut rest =
        RestBatch { g: Default::default(), volume: Lanes::default(), rotation: Default::default() };
    for (lane, &p) in lanes.iter().enumerate() {
        let R = rotations.get(p as usize).copied().unwrap_or_else(Matrix3::identity);
        for i in 0..9 {
            rest.rotation[i].0[lane] = R[(i / 3, i % 3)];
        }
        if p == NO_PIECE {
            continue;
        }
        let piece = &pieces[p as usize];
        let e = piece.element as usize;
        let g = mesh.gradients(e);
        for k in 0..3 {
            for i in 0..3 {
                rest.g[k][i].0[lane] = g[k + 1][i] as f32;
            }
        }
        rest.volume.0[lane] = (piece.fraction * mesh.volume(e)) as f32;
    }
    rest
}
