//! K̂, the stiffness of all pieces: by the tets with rotated gradients, or assembled.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};

use super::chunks::{Gather, NO_PIECE, plan_chunk, region_of_elements};
use super::edges::EdgeBlocks;
use super::kernel::{Batches, Block6, Coefficients, Locals, RestBatch};
use super::rows::direction;
use super::{BLOCK, LinearOperator, Padded, padded};
use crate::cut::Piece;
use crate::element::{LANES, Lanes, Simd};
use crate::material::{Lame, Law};
use crate::mesh::TetMesh;
use crate::team::{Team, blocks, ranges};

/// Most pieces of one chunk: four copies each must leave room in 16-bit local numbers.
const MOST_PIECES: usize = 8192;

/// How K̂ is applied.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OperatorChoice {
    /// Assembled where the stiffness stays the same from step to step (the linear law), by the tets
    /// where it turns with the material.
    #[default]
    Auto,
    /// By the tets: 44 bytes and 130 operations per tet, nothing to assemble.
    MatrixFree,
    /// Assembled: 40 bytes and 36 operations per pair of neighbours (1.2 to 1.6 per tet).
    Assembled,
}

/// s K̂ of a body; also its internal forces and the diagonal blocks of s K̂.
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
    /// Sums of all chunks, rows as in `gather`: s K̂ x or internal forces.
    sums: Vec<Padded>,
    /// Likewise, diagonal blocks of s K̂.
    diagonals: Vec<Block6>,
    choice: OperatorChoice,
    /// What the chunks' stiffness was last made with, and whether it was assembled.
    made_with: Option<(Coefficients, bool)>,
    /// Counts the changes of the stiffness.
    version: u64,
}

#[derive(Clone, Debug)]
struct Chunk {
    region: usize,
    copies: Vec<u32>,
    pieces: Vec<[u32; LANES]>,
    batches: Batches,
    positions: Vec<[f64; 4]>,
    x: Vec<Padded>,
    /// Rest positions [m], for laws without rotation.
    rest: Vec<Vector3<f64>>,
    /// The assembled stiffness, where that is in use.
    edges: Option<EdgeBlocks>,
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
            sums: Vec::new(),
            diagonals: Vec::new(),
            choice: OperatorChoice::Auto,
            made_with: None,
            version: 0,
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
        self.sums = vec![[0.0; 4]; self.gather.n_rows()];
        self.diagonals = vec![[0.0; 8]; self.gather.n_rows()];
        self.n_pieces = pieces.len();
        self.made_with = None;
    }

    /// Chooses how K̂ is applied from the next update on. The choices differ in the last bits.
    pub fn set_choice(&mut self, choice: OperatorChoice) {
        self.choice = choice;
    }

    /// How K̂ is to be applied.
    pub fn choice(&self) -> OperatorChoice {
        self.choice
    }

    /// Rises with every change of the stiffness: the diagonal blocks of an update are the same as
    /// those of an earlier one with the same version.
    pub fn version(&self) -> u64 {
        self.version
    }

    /// Whether K̂ was assembled at the last update.
    pub fn assembled(&self) -> bool {
        self.made_with.is_some_and(|(_, assembled)| assembled)
    }

    /// Bytes of stiffness that one application streams.
    pub fn bytes(&self) -> usize {
        let bytes = |c: &Chunk| c.edges.as_ref().map_or_else(|| c.batches.bytes(), EdgeBlocks::bytes);
        self.chunks.iter().map(bytes).sum()
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
        let inverted = self.update_chunks(team, with, positions);
        let elastic = &*self;
        team.for_blocks((blocks(f_int, BLOCK), blocks(diagonal, BLOCK)), |block, (f, diagonal)| {
            elastic.forces(block, f);
            elastic.diagonals(block, diagonal);
        });
        inverted
    }

    /// First half of an update: every chunk's own sums. Without rotations the stiffness changes only
    /// if `with` or the pieces do, and what is left to do is one application.
    pub(crate) fn update_chunks(
        &mut self,
        team: &mut Team,
        with: &ElasticUpdate,
        positions: &[Vector3<f64>],
    ) -> usize {
        let (simd, c) = (self.simd, coefficients(with));
        let assembled = match self.choice {
            OperatorChoice::Auto => !c.rotates,
            OperatorChoice::MatrixFree => false,
            OperatorChoice::Assembled => true,
        };
        if c.rotates || self.made_with != Some((c, assembled)) {
            self.version += 1;
            self.made_with = Some((c, assembled));
            let first = &self.gather.first_row;
            let sums = (ranges(&mut self.sums, first), ranges(&mut self.diagonals, first));
            team.for_blocks((blocks(&mut self.chunks, 1), sums.0, sums.1), |_, (chunk, y, diagonal)| {
                chunk[0].update(simd, &c, positions, y, diagonal);
                chunk[0].assemble(assembled);
            });
        }
        if !c.rotates {
            let sums = ranges(&mut self.sums, &self.gather.first_row);
            team.for_blocks((blocks(&mut self.chunks, 1), sums), |_, (chunk, y)| {
                chunk[0].linear_forces(simd, c.scale, positions, y);
            });
        }
        self.chunks.iter().map(|chunk| chunk.inverted).sum()
    }

    /// Second half: internal forces [N] on the copies of block number `block`.
    #[inline(always)]
    pub(crate) fn forces(&self, block: usize, f: &mut [Padded]) {
        f.fill([0.0; 4]);
        self.gather.add(block, &self.sums, f);
    }

    /// Second half: diagonal blocks of s K̂ of the copies of block number `block`.
    #[inline(always)]
    pub(crate) fn diagonals(&self, block: usize, diagonal: &mut [Block6]) {
        diagonal.fill([0.0; 8]);
        self.gather.add(block, &self.diagonals, diagonal);
    }

    /// First half of an application: every chunk's own sums of s K̂ x.
    pub(super) fn apply_chunks(&mut self, team: &mut Team, x: &[Padded]) {
        let simd = self.simd;
        let sums = ranges(&mut self.sums, &self.gather.first_row);
        team.for_blocks((blocks(&mut self.chunks, 1), sums), |_, (chunk, y)| {
            let Chunk { copies, x: local, .. } = &mut chunk[0];
            for (local, &copy) in local.iter_mut().zip(copies.iter()) {
                *local = x[copy as usize];
            }
            chunk[0].apply(simd, y);
        });
    }

    /// The same with x ← z + β x, where x is that of the last application (nothing if β = 0).
    pub(super) fn apply_chunks_to_direction(&mut self, team: &mut Team, z: &[Padded], beta: f32) {
        let simd = self.simd;
        let sums = ranges(&mut self.sums, &self.gather.first_row);
        team.for_blocks((blocks(&mut self.chunks, 1), sums), |_, (chunk, y)| {
            let Chunk { copies, x: local, .. } = &mut chunk[0];
            for (local, &copy) in local.iter_mut().zip(copies.iter()) {
                direction(local, &z[copy as usize], beta);
            }
            chunk[0].apply(simd, y);
        });
    }

    /// Second half: s K̂ x of the copies of block number `block`, added to `y`.
    #[inline(always)]
    pub(super) fn add_sums(&self, block: usize, y: &mut [Padded]) {
        self.gather.add(block, &self.sums, y);
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
            y.fill([0.0; 4]);
            elastic.add_sums(block, y);
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
            rest: rest_positions(&plan.copies, members, mesh, pieces),
            edges: None,
            copies: plan.copies,
            positions: vec![[0.0; 4]; n],
            x: vec![[0.0; 4]; n],
            inverted: 0,
        }
    }

    /// Assembles the stiffness of the last update, or forgets what was assembled before.
    fn assemble(&mut self, wanted: bool) {
        let waste = self.copies.len() as u16;
        if wanted {
            let Self { edges, batches, .. } = self;
            edges.get_or_insert_with(|| EdgeBlocks::new(&batches.nodes(), waste)).assemble(batches);
        } else {
            self.edges = None;
        }
    }

    /// y = s K̂ x.
    #[inline(always)]
    fn apply(&self, simd: Simd, y: &mut [Padded]) {
        y.fill([0.0; 4]);
        match &self.edges {
            Some(edges) => edges.apply(simd, &self.x, y),
            None => self.batches.apply(simd, &self.x, y),
        }
    }

    /// y = K̂ u with displacements u relative to the chunk's first copy, subtracted in double
    /// precision: the error is relative to the chunk, not to how far the body has moved.
    fn linear_forces(&mut self, simd: Simd, scale: f32, positions: &[Vector3<f64>], y: &mut [Padded]) {
        let displacement = |copy: u32, rest: &Vector3<f64>| positions[copy as usize] - rest;
        let held = self.copies.iter().zip(&self.rest);
        let origin =
            held.clone().next().map_or_else(Vector3::zeros, |(&copy, rest)| displacement(copy, rest));
        for (local, (&copy, rest)) in self.x.iter_mut().zip(held) {
            *local = padded(&(displacement(copy, rest) - origin));
        }
        self.apply(simd, y);
        let factor = 1.0 / scale;
        for f in y.iter_mut().flatten() {
            *f *= factor;
        }
    }

    /// Rotations, gradients, internal forces `f` and diagonal blocks.
    fn update(
        &mut self,
        simd: Simd,
        c: &Coefficients,
        positions: &[Vector3<f64>],
        f: &mut [Padded],
        diagonal: &mut [Block6],
    ) {
        for (local, &copy) in self.positions.iter_mut().zip(&self.copies) {
            let x = &positions[copy as usize];
            *local = [x.x, x.y, x.z, 0.0];
        }
        f.fill([0.0; 4]);
        diagonal.fill([0.0; 8]);
        let mut locals = Locals { x: &self.positions, f, blocks: diagonal };
        self.inverted = self.batches.update(simd, c, &mut locals);
    }
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

/// Rest position of each of `copies` (ascending), all of which belong to pieces in `members`.
fn rest_positions(copies: &[u32], members: &[u32], mesh: &TetMesh, pieces: &[Piece]) -> Vec<Vector3<f64>> {
    let mut rest = vec![Vector3::zeros(); copies.len()];
    for piece in members.iter().map(|&p| &pieces[p as usize]) {
        for (copy, &node) in piece.copies.iter().zip(&mesh.tets[piece.element as usize]) {
            if let Ok(local) = copies.binary_search(copy) {
                rest[local] = mesh.nodes[node as usize];
            }
        }
    }
    rest
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
