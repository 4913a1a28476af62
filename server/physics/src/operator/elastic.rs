//! K̂, the stiffness of all pieces: by the tets with rotated gradients, or assembled.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};

use super::chunks::{Gather, NO_PIECE, pack, plan_chunk, region_of_elements};
use super::edges::EdgeBlocks;
use super::kernel::{Batches, Block6, Coefficients, Locals, RestBatch};
use super::rows::gather_direction;
use super::{BLOCK, LinearOperator, Padded, padded};
use crate::cut::Piece;
use crate::element::{LANES, Lanes, Mat3, Simd};
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
    /// Pieces and copies there were when the chunk was planned, and the present number of pieces.
    planned: [usize; 2],
    n_pieces: usize,
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
        elastic.n_pieces = pieces.len();
        elastic.plan(mesh, pieces, &vec![true; n_regions], &[]);
        elastic.arrange_sums(n_copies);
        elastic
    }

    /// Follows a cut: the `changed` pieces (ascending) are new or have other copies or another fraction
    /// than before. A new piece inherits its rotation from the first of them that its element had
    /// before. Chunks without changed pieces stay as they are, the others are amended, and arranged anew
    /// once they have grown by a quarter.
    pub fn follow(&mut self, mesh: &TetMesh, pieces: &[Piece], changed: &[u32], n_copies: usize) {
        let region_of = |p: u32| self.region_of_element[pieces[p as usize].element as usize] as usize;
        let (old, new): (Vec<u32>, Vec<u32>) = changed.iter().partition(|p| (**p as usize) < self.n_pieces);
        let mut is_changed = vec![false; self.n_pieces];
        old.iter().for_each(|&p| is_changed[p as usize] = true);
        let mut added = vec![Vec::new(); self.n_regions];
        new.iter().for_each(|&p| added[region_of(p)].push(p));
        let mut affected = vec![false; self.n_regions];
        changed.iter().for_each(|&p| affected[region_of(p)] = true);
        let inherited = self.rotations_by_element(&is_changed, pieces);
        let mut outgrown = vec![false; self.n_regions];
        for chunk in self.chunks.iter_mut().rev().filter(|chunk| affected[chunk.region]) {
            // New pieces go to the last chunk of their region.
            let added = std::mem::take(&mut added[chunk.region]);
            outgrown[chunk.region] |= !chunk.follow(mesh, pieces, &is_changed, &added, &inherited);
        }
        self.n_pieces = pieces.len();
        if outgrown.contains(&true) {
            let mut rotations = self.rotations();
            for p in new {
                if let Some(R) = inherited.get(&pieces[p as usize].element) {
                    rotations[p as usize] = *R;
                }
            }
            self.plan(mesh, pieces, &outgrown, &rotations);
        }
        self.arrange_sums(n_copies);
    }

    /// Divides the pieces of these regions into chunks.
    fn plan(&mut self, mesh: &TetMesh, pieces: &[Piece], regions: &[bool], rotations: &[Matrix3<f32>]) {
        let mut members = vec![Vec::new(); self.n_regions];
        for (p, piece) in (0u32..).zip(pieces) {
            let region = self.region_of_element[piece.element as usize] as usize;
            if regions[region] {
                members[region].push(p);
            }
        }
        self.chunks.retain(|chunk| !regions[chunk.region]);
        for (region, members) in members.iter().enumerate() {
            let build = |part| Chunk::new(region, part, mesh, pieces, rotations);
            self.chunks.extend(members.chunks(MOST_PIECES).map(build));
        }
        self.chunks.sort_by_key(|chunk| chunk.region);
    }

    fn arrange_sums(&mut self, n_copies: usize) {
        self.gather = Gather::new(self.chunks.iter().map(|c| &c.copies[..]), n_copies);
        self.sums = vec![[0.0; 4]; self.gather.n_rows()];
        self.diagonals = vec![[0.0; 8]; self.gather.n_rows()];
        self.made_with = None;
    }

    /// Rotation of the first changed piece of every element that has one.
    fn rotations_by_element(&self, is_changed: &[bool], pieces: &[Piece]) -> BTreeMap<u32, Matrix3<f32>> {
        let mut first: BTreeMap<u32, (u32, Matrix3<f32>)> = BTreeMap::new();
        for chunk in &self.chunks {
            for (p, batch, lane) in chunk.lanes().filter(|&(p, ..)| is_changed[p as usize]) {
                let found = (p, chunk.rotation(batch, lane));
                let first = first.entry(pieces[p as usize].element).or_insert(found);
                if p < first.0 {
                    *first = found;
                }
            }
        }
        first.into_iter().map(|(element, (_, R))| (element, R)).collect()
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
            gather_direction(local, copies, z, beta);
            chunk[0].apply(simd, y);
        });
    }

    /// Second half: s K̂ x of the copies of block number `block`, added to `y`.
    #[inline(always)]
    pub(super) fn add_sums(&self, block: usize, y: &mut [Padded]) {
        self.gather.add(block, &self.sums, y);
    }

    /// The chunks' sums and where those of the copies of block number `block` lie in them, two per
    /// copy; the rest comes with [`Self::add_further`].
    #[inline(always)]
    pub(super) fn sums(&self, block: usize) -> (&[[u32; 2]], &[Padded]) {
        (self.gather.pairs(block), &self.sums)
    }

    /// Adds what [`Self::sums`] leaves out to `y`; says whether there was any.
    #[inline(always)]
    pub(super) fn add_further(&self, block: usize, y: &mut [Padded]) -> bool {
        self.gather.add_further(block, &self.sums, y)
    }

    /// Rotation of every piece at the last update.
    pub fn rotations(&self) -> Vec<Matrix3<f32>> {
        let mut rotations = vec![Matrix3::identity(); self.n_pieces];
        for chunk in &self.chunks {
            for (p, batch, lane) in chunk.lanes() {
                rotations[p as usize] = chunk.rotation(batch, lane);
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
        // Room for what cuts add before the next plan.
        let mut rest = Vec::with_capacity(plan.pieces.len() + plan.pieces.len() / 4 + 1);
        rest.extend(plan.pieces.iter().map(|lanes| rest_batch(lanes, mesh, pieces, rotations)));
        let n = plan.copies.len() + 1;
        Self {
            region,
            batches: Batches::new(&plan.nodes, rest, n),
            pieces: plan.pieces,
            rest: rest_positions(&plan.copies, members, mesh, pieces),
            edges: None,
            planned: [members.len(), plan.copies.len()],
            n_pieces: members.len(),
            copies: plan.copies,
            positions: vec![[0.0; 4]; n],
            x: vec![[0.0; 4]; n],
            inverted: 0,
        }
    }

    /// Piece, batch and lane of all pieces.
    fn lanes(&self) -> impl Iterator<Item = (u32, usize, usize)> + '_ {
        let lanes = self.pieces.iter().enumerate();
        let lanes = lanes.flat_map(|(b, lanes)| lanes.iter().enumerate().map(move |(l, &p)| (p, b, l)));
        lanes.filter(|&(p, ..)| p != NO_PIECE)
    }

    fn rotation(&self, batch: usize, lane: usize) -> Matrix3<f32> {
        let rotation = &self.batches.rest()[batch].rotation;
        Matrix3::from_fn(|i, j| rotation[3 * i + j].0[lane])
    }

    /// Amends the copies and fractions of changed pieces and appends the pieces `added`. Copies that
    /// are new to the chunk are new altogether, so that `copies` stays in order. Says `false` and does
    /// nothing if the chunk has grown so much that packing and numbering anew pays.
    fn follow(
        &mut self,
        mesh: &TetMesh,
        pieces: &[Piece],
        is_changed: &[bool],
        added: &[u32],
        rotations: &BTreeMap<u32, Matrix3<f32>>,
    ) -> bool {
        let changed: Vec<(u32, usize, usize)> =
            self.lanes().filter(|&(p, ..)| is_changed[p as usize]).collect();
        let amended = || changed.iter().map(|c| c.0).chain(added.iter().copied());
        let old_waste = self.copies.len() as u16;
        let mut new: Vec<(u32, u32)> = amended()
            .map(|p| &pieces[p as usize])
            .flat_map(|piece| piece.copies.into_iter().zip(mesh.tets[piece.element as usize]))
            .filter(|(copy, _)| self.copies.binary_search(copy).is_err())
            .collect();
        new.sort_unstable();
        new.dedup();
        let [planned_pieces, planned_copies] = self.planned;
        let n_copies = self.copies.len() + new.len();
        if self.n_pieces + added.len() > planned_pieces + planned_pieces / 4
            || n_copies > planned_copies + planned_copies / 2
        {
            return false;
        }
        self.copies.extend(new.iter().map(|n| n.0));
        self.rest.extend(new.iter().map(|n| mesh.nodes[n.1 as usize]));
        debug_assert!(self.copies.is_sorted());
        let waste = self.copies.len() as u16;
        let local = |copy: &u32| self.copies.binary_search(copy).map_or(waste, |l| l as u16);
        let (mut nodes, mut rest) = std::mem::take(&mut self.batches).into_parts();
        for id in nodes.iter_mut().flatten().flatten().filter(|id| **id == old_waste) {
            *id = waste;
        }
        let mut places = changed;
        places.extend(free_lanes(&mut self.pieces, added, pieces));
        nodes.resize(self.pieces.len(), [[waste; LANES]; 4]);
        rest.resize(self.pieces.len(), empty_batch());
        for (p, batch, lane) in places {
            let piece = &pieces[p as usize];
            for (ids, copy) in nodes[batch].iter_mut().zip(&piece.copies) {
                ids[lane] = local(copy);
            }
            let known = rotations.get(&piece.element).filter(|_| p as usize >= is_changed.len());
            set_lane(&mut rest[batch], lane, mesh, piece, known);
        }
        let n = self.copies.len() + 1;
        self.batches = Batches::new(&nodes, rest, n);
        self.n_pieces += added.len();
        self.edges = None;
        self.positions.resize(n, [0.0; 4]);
        self.x.resize(n, [0.0; 4]);
        true
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

/// Gives the pieces `added` lanes: first those that are empty (only the last batch has any), then new
/// batches. Returns piece, batch and lane of each.
fn free_lanes(batches: &mut Vec<[u32; LANES]>, added: &[u32], pieces: &[Piece]) -> Vec<(u32, usize, usize)> {
    let mut places = Vec::with_capacity(added.len());
    let mut added = added.iter();
    let last = batches.len().saturating_sub(1);
    for (l, lane) in batches.last_mut().into_iter().flatten().enumerate().filter(|(_, p)| **p == NO_PIECE) {
        let Some(&p) = added.next() else { return places };
        *lane = p;
        places.push((p, last, l));
    }
    let added = added.as_slice();
    let held: Vec<[u32; 4]> = added.iter().map(|&p| pieces[p as usize].copies).collect();
    for mut lanes in pack(&held) {
        for (l, lane) in lanes.iter_mut().enumerate().filter(|(_, p)| **p != NO_PIECE) {
            *lane = added[*lane as usize];
            places.push((*lane, batches.len(), l));
        }
        batches.push(lanes);
    }
    places
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
    let mut rest = empty_batch();
    for (lane, &p) in lanes.iter().enumerate().filter(|(_, p)| **p != NO_PIECE) {
        set_lane(&mut rest, lane, mesh, &pieces[p as usize], rotations.get(p as usize));
    }
    rest
}

/// A batch without pieces: no volume, no rotation.
fn empty_batch() -> RestBatch {
    let mut rotation: Mat3<Lanes> = Default::default();
    for i in 0..3 {
        rotation[4 * i] = Lanes([1.0; LANES]);
    }
    RestBatch { g: Default::default(), volume: Lanes::default(), rotation }
}

/// Gradients and volume of a piece, and its rotation if that is known.
fn set_lane(
    rest: &mut RestBatch,
    lane: usize,
    mesh: &TetMesh,
    piece: &Piece,
    rotation: Option<&Matrix3<f32>>,
) {
    let e = piece.element as usize;
    let g = mesh.gradients(e);
    for k in 0..3 {
        for i in 0..3 {
            rest.g[k][i].0[lane] = g[k + 1][i] as f32;
        }
    }
    rest.volume.0[lane] = (piece.fraction * mesh.volume(e)) as f32;
    if let Some(R) = rotation {
        for i in 0..9 {
            rest.rotation[i].0[lane] = R[(i / 3, i % 3)];
        }
    }
}
