//! K̂, the stiffness of all pieces: by the tets with rotated gradients, or assembled.

use std::borrow::Cow;

use nalgebra::{Matrix3, Vector3};
use scindo_matter::cut::Piece;
use scindo_matter::element::Simd;
use scindo_matter::material::Regions;
use scindo_matter::mesh::TetMesh;
use scindo_matter::storage::numbering::Numbering;
use scindo_matter::storage::reserve::resize_reserving;
use scindo_matter::team::{Team, blocks, ranges};

use super::chunk::{Chunk, NewLane};
use super::chunks::{Gather, NO_PIECE};
use super::groups::Groups;
use super::rows::{self, Sum, gather_direction};
use super::shared_lanes::{LaneChanges, SharedLanes};
use super::stiffness::{
    Direction, ElasticUpdate, OperatorChoice, Place, Stiffness, Tension, UpdateAt, apply,
};
use super::tet_batch::{Block6, Coefficients, EnergyCoefficients};
use super::{BLOCK, LinearOperator, Padded, block_of};

/// Largest number of lanes of one chunk: four copies each must leave room in 16-bit local numbers.
const MOST_LANES: usize = 8192;

/// s K̂ of a body; also its internal forces and the diagonal blocks of s K̂.
#[derive(Debug, serde::Serialize, serde::Deserialize)]
pub struct Elastic {
    simd: Simd,
    /// Which pieces have a lane, and what it integrates.
    shared_lanes: SharedLanes,
    groups: Groups,
    /// Ordered by group; a group has more than one only after very many cuts.
    chunks: Vec<Chunk>,
    gather: Gather,
    /// Sums of all chunks, rows as in `gather`: s K̂ x or internal forces.
    sums: Vec<Padded>,
    /// Likewise, diagonal blocks of s K̂.
    diagonals: Vec<Block6>,
    choice: OperatorChoice,
    /// Coefficients of the last update, and whether the stiffness was assembled.
    made_with: Option<(Coefficients, bool)>,
    /// Counts the changes of the stiffness.
    version: u64,
    /// Scratch of [`Self::follow`].
    numbering: Numbering,
    marks: Marks,
}

impl Elastic {
    /// Arranges `pieces` of `mesh`, all of one material, for the kernels, all rotations at rest.
    pub fn new(simd: Simd, mesh: &TetMesh, pieces: &[Piece], n_copies: usize) -> Self {
        Self::with_regions(simd, (mesh, &Regions::default()), pieces, n_copies)
    }

    /// Likewise with `regions` of other materials, one entry per tetrahedron of `mesh`.
    pub fn with_regions(
        simd: Simd,
        (mesh, regions): (&TetMesh, &Regions),
        pieces: &[Piece],
        n_copies: usize,
    ) -> Self {
        let centre = |e: usize| mesh.corners(e).iter().sum::<Vector3<f64>>() / 4.0;
        let centres: Vec<Vector3<f64>> = (0..mesh.tets.len()).map(centre).collect();
        let groups = Groups::new(&centres, regions);
        let mut members = vec![Some(Vec::new()); groups.len()];
        let mut elastic = Self {
            simd,
            shared_lanes: SharedLanes::new(mesh.tets.len(), pieces),
            groups,
            chunks: Vec::new(),
            gather: Gather::default(),
            sums: Vec::new(),
            diagonals: Vec::new(),
            choice: OperatorChoice::Auto,
            made_with: None,
            version: 0,
            numbering: Numbering::with_capacity(pieces.len()),
            marks: Marks::default(),
        };
        elastic.marks.put_on(&LaneChanges::default(), pieces.len());
        for (p, merged) in (0u32..).zip(elastic.shared_lanes.merged()).filter(|(_, m)| m.count > 0) {
            let group = elastic.groups.of(merged.piece.element);
            members[group]
                .iter_mut()
                .for_each(|m| m.push(NewLane { piece: p, rotation: Matrix3::identity() }));
        }
        elastic.plan(mesh, members);
        elastic.arrange_sums(n_copies);
        elastic
    }

    /// Follows a cut: the `changed` pieces (ascending) are new or have other copies or another fraction
    /// than before. A piece that gets a lane of its own inherits the rotation of the lane that had its
    /// material before. Chunks without changes stay as they are. The others are amended, or arranged anew
    /// once they have grown by a quarter.
    pub fn follow(&mut self, mesh: &TetMesh, pieces: &[Piece], changed: &[u32], n_copies: usize) {
        let changes = self.shared_lanes.follow(pieces, changed);
        let group_of = |p: u32| self.groups.of(pieces[p as usize].element);
        let n_groups = self.groups.len();
        let mut affected = vec![false; n_groups];
        changes.amended.iter().for_each(|&p| affected[group_of(p)] = true);
        changes.added.iter().for_each(|&[p, _]| affected[group_of(p)] = true);
        self.marks.put_on(&changes, pieces.len());
        let (sources, rotations) = self.rotations_of(&affected);
        self.numbering.note(&sources, 0);
        let mut added = vec![Vec::new(); n_groups];
        let rotation = |source: u32| {
            let found = self.numbering.find(&sources, source);
            found.map_or_else(Matrix3::identity, |at| rotations[at])
        };
        for &[piece, source] in &changes.added {
            added[group_of(piece)].push(NewLane { piece, rotation: rotation(source) });
        }
        // Chunks with new copies, and their number before; lanes of groups that are arranged anew.
        let (mut grown, mut outgrown) = (Vec::new(), vec![None; n_groups]);
        let merged = self.shared_lanes.merged();
        for (k, chunk) in self.chunks.iter_mut().enumerate().rev().filter(|(_, c)| affected[c.group]) {
            // New lanes go to the last chunk of their group.
            let added = std::mem::take(&mut added[chunk.group]);
            let known = chunk.copies.len();
            if chunk.follow(mesh, merged, &self.marks.amended, &added, &mut self.numbering) {
                grown.push((k, known));
            } else {
                outgrown[chunk.group].get_or_insert_with(Vec::new).extend(added);
            }
        }
        self.marks.take_off(&changes);
        // A chunk that has outgrown its plan takes its whole group along.
        if outgrown.iter().any(Option::is_some) {
            for chunk in &self.chunks {
                if let Some(members) = &mut outgrown[chunk.group] {
                    members.extend(chunk.new_lanes());
                }
            }
            self.plan(mesh, outgrown);
            self.arrange_sums(n_copies);
        } else if self.gather.holds(self.chunks.iter().map(|c| &c.copies[..])) {
            let chunks = &self.chunks;
            let grown = grown.into_iter().map(|(k, known)| (k, &chunks[k].copies[..], known));
            self.gather.append(grown, n_copies);
        } else {
            self.arrange_sums(n_copies);
        }
    }

    /// Divides the carriers `members` of groups into chunks, which replace those there were.
    fn plan(&mut self, mesh: &TetMesh, members: Vec<Option<Vec<NewLane>>>) {
        self.chunks.retain(|chunk| members[chunk.group].is_none());
        let merged = self.shared_lanes.merged();
        for (group, members) in members.into_iter().enumerate() {
            let Some(mut members) = members else { continue };
            members.sort_unstable_by_key(|lane| lane.piece);
            let build = |part| Chunk::new(group, part, mesh, merged);
            self.chunks.extend(members.chunks(MOST_LANES).map(build));
        }
        self.chunks.sort_by_key(|chunk| chunk.group);
    }

    /// Arranges the sums of the present chunks, in the rows that there are if these suffice. Diagonal blocks of chunks that
    /// are not stale move along.
    fn arrange_sums(&mut self, n_copies: usize) {
        let copies = self.chunks.iter().map(|c| &c.copies[..]);
        if self.gather.holds(copies.clone()) {
            self.gather.arrange(copies, n_copies);
        } else {
            self.gather = Gather::new(copies, n_copies);
            self.sums = vec![[0.0; 4]; self.gather.n_rows()];
        }
        // A chunk has other rows also where those of another one now suffice for it.
        let kept = std::mem::replace(&mut self.diagonals, vec![[0.0; 8]; self.gather.n_rows()]);
        for (chunk, &first) in self.chunks.iter_mut().zip(&self.gather.first_row) {
            let (from, to) = (chunk.first_row, first as usize);
            chunk.first_row = to;
            if !chunk.stale {
                let n = chunk.copies.len();
                self.diagonals[to..to + n].copy_from_slice(&kept[from..from + n]);
            }
        }
    }

    /// The marked sources in these groups, and their rotations.
    fn rotations_of(&self, groups: &[bool]) -> (Vec<u32>, Vec<Matrix3<f32>>) {
        let chunks = self.chunks.iter().filter(|chunk| groups[chunk.group]);
        let lanes = chunks.flat_map(|chunk| chunk.lanes().map(move |lane| (chunk, lane)));
        let lanes = lanes.filter(|(_, (p, ..))| self.marks.source[*p as usize]);
        lanes.map(|(chunk, (p, batch, lane))| (p, chunk.rotation(batch, lane))).unzip()
    }

    /// Whether K̂ was assembled at the last update.
    pub fn assembled(&self) -> bool {
        self.made_with.is_some_and(|(_, assembled)| assembled)
    }

    /// Bytes of stiffness that one application streams.
    pub fn bytes(&self) -> usize {
        self.chunks.iter().map(Chunk::bytes).sum()
    }

    /// Recomputes rotations, rotated gradients, forces and diagonal blocks at `positions` [m] (one
    /// per copy), and writes f_int [N] and the blocks of s K̂. Returns the number of inverted pieces.
    pub fn update_all(
        &mut self,
        team: &mut Team,
        with: &ElasticUpdate,
        positions: &[Vector3<f64>],
        f_int: &mut [Padded],
        diagonal: &mut [Block6],
    ) -> usize {
        let inverted = Stiffness::update(self, team, with, positions, None);
        let elastic = &*self;
        team.for_blocks((blocks(f_int, BLOCK), blocks(diagonal, BLOCK)), |block, (f, diagonal)| {
            elastic.forces(block, f);
            elastic.diagonals(block, diagonal);
        });
        inverted
    }

    /// The chunks' sums and where those of the copies of block number `block` lie in them, two per
    /// copy; the rest comes with [`Self::add_further`].
    #[inline(always)]
    pub(super) fn sums(&self, block: usize) -> (&[[u32; 2]], &[Padded]) {
        (self.gather.pairs(block), &self.sums)
    }

    /// Adds the rows that [`Self::sums`] leaves out to `y`. Returns the change of x·y.
    #[inline(always)]
    pub(super) fn add_further(&self, block: usize, x: &[Padded], y: &mut [Padded]) -> f64 {
        let mut product = Sum::default();
        for (copy, row) in self.gather.further(block) {
            product.add(&x[copy], &self.sums[row]);
            for (y, part) in y[copy].iter_mut().zip(&self.sums[row]) {
                *y += part;
            }
        }
        product.total()
    }

    fn multiply_chunks(&mut self, team: &mut Team, x: &[Padded], with_twists: bool) {
        let simd = self.simd;
        let sums = ranges(&mut self.sums, &self.gather.first_row);
        team.for_blocks((blocks(&mut self.chunks, 1), sums), |_, (chunk, y)| {
            chunk[0].ask_for_stiffness();
            let Chunk { copies, x: local, .. } = &mut chunk[0];
            for (local, &copy) in local.iter_mut().zip(copies.iter()) {
                *local = x[copy as usize];
            }
            chunk[0].apply(simd, with_twists, y);
        });
    }

    /// Rotation of every piece at the last update.
    pub fn rotations(&self) -> Vec<Matrix3<f32>> {
        self.places().iter().map(|&place| self.rotation(place)).collect()
    }

    /// Number of pieces.
    pub fn n_pieces(&self) -> usize {
        self.shared_lanes.of_piece().len()
    }

    /// Number of lanes that are computed with: pieces of one element with the same copies share one.
    pub fn n_lanes(&self) -> usize {
        self.chunks.iter().map(Chunk::n_lanes).sum()
    }
}

impl Stiffness for Elastic {
    /// Every chunk's own sums. Without rotations the stiffness changes only if
    /// `with` or the pieces do; otherwise one application is enough.
    fn update(
        &mut self,
        team: &mut Team,
        with: &ElasticUpdate,
        positions: &[Vector3<f64>],
        tension: Option<&Tension<'_>>,
    ) -> usize {
        let (simd, groups, c) = (self.simd, &self.groups, Coefficients::of(with, with.lame));
        let assembled = match self.choice {
            OperatorChoice::Auto => !c.rotates,
            OperatorChoice::MatrixFree => false,
            OperatorChoice::Assembled => true,
        };
        let all = c.rotates || self.made_with != Some((c, assembled));
        if all || self.chunks.iter().any(|chunk| chunk.stale) {
            self.version += 1;
            self.made_with = Some((c, assembled));
            let first = &self.gather.first_row;
            let sums = (ranges(&mut self.sums, first), ranges(&mut self.diagonals, first));
            team.for_blocks((blocks(&mut self.chunks, 1), sums.0, sums.1), |_, (chunk, y, diagonal)| {
                if all || chunk[0].stale {
                    let c = groups.coefficients(chunk[0].group, with, tension);
                    chunk[0].update(simd, &c, UpdateAt { positions, tension }, y, diagonal);
                    chunk[0].assemble(assembled);
                }
            });
        }
        // All chunks take part where one does: a border between those that do and others would cost iterations.
        if let (Some(tension), true) = (tension, self.chunks.iter().any(Chunk::is_twisted)) {
            let diagonals = ranges(&mut self.diagonals, &self.gather.first_row);
            team.for_blocks((blocks(&mut self.chunks, 1), diagonals), |_, (chunk, diagonal)| {
                if !chunk[0].is_twisted() {
                    let c = groups.coefficients(chunk[0].group, with, Some(tension));
                    chunk[0].twist(simd, &c, tension, diagonal);
                    chunk[0].assemble(assembled);
                }
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

    fn energy(&mut self, team: &mut Team, with: &ElasticUpdate, positions: &[Vector3<f64>]) -> Option<f64> {
        if !with.law.is_hookean() {
            return None;
        }
        let (simd, groups) = (self.simd, &self.groups);
        team.for_blocks(blocks(&mut self.chunks, 1), |_, chunk| {
            let Coefficients { mu, lambda, rotates, .. } = groups.coefficients(chunk[0].group, with, None);
            chunk[0].find_energy(simd, EnergyCoefficients { mu, lambda, rotates }, positions);
        });
        Some(self.chunks.iter().map(|chunk| chunk.energy).sum())
    }

    #[inline(always)]
    fn forces(&self, block: usize, f: &mut [Padded]) {
        f.fill([0.0; 4]);
        self.gather.add(block, &self.sums, f);
    }

    #[inline(always)]
    fn diagonals(&self, block: usize, diagonal: &mut [Block6]) {
        diagonal.fill([0.0; 8]);
        self.gather.add(block, &self.diagonals, diagonal);
    }

    fn multiply(&mut self, team: &mut Team, x: &[Padded]) {
        self.multiply_chunks(team, x, true);
    }

    fn multiply_damping(&mut self, team: &mut Team, x: &[Padded]) {
        self.multiply_chunks(team, x, false);
    }

    fn multiply_direction(&mut self, team: &mut Team, z: &[Padded], beta: f32) {
        let simd = self.simd;
        let sums = ranges(&mut self.sums, &self.gather.first_row);
        team.for_blocks((blocks(&mut self.chunks, 1), sums), |_, (chunk, y)| {
            chunk[0].ask_for_stiffness();
            let Chunk { copies, x: local, .. } = &mut chunk[0];
            gather_direction(local, copies, z, beta);
            chunk[0].apply(simd, true, y);
        });
    }

    #[inline(always)]
    fn add_products(&self, block: usize, y: &mut [Padded]) {
        self.gather.add(block, &self.sums, y);
    }

    #[inline(always)]
    fn advance(&self, block: usize, with: &Direction<'_>, p: &mut [Padded], q: &mut [Padded]) -> f64 {
        let (z, mass) = (block_of(with.z, block), block_of(with.mass, block));
        let inertia = (mass, with.factor);
        let product = rows::advance_direction(z, with.beta, inertia, self.sums(block), [&mut *p, &mut *q]);
        product + self.add_further(block, p, q)
    }

    fn version(&self) -> u64 {
        self.version
    }

    fn set_choice(&mut self, choice: OperatorChoice) {
        self.choice = choice;
    }

    fn is_twisted(&self) -> bool {
        self.chunks.iter().any(Chunk::is_twisted)
    }

    fn choice(&self) -> OperatorChoice {
        self.choice
    }

    fn places(&self) -> Cow<'_, [Place]> {
        let mut places = vec![Place::default(); self.n_pieces()];
        for (chunk, c) in (0u32..).zip(&self.chunks) {
            for (p, batch, lane) in c.lanes() {
                places[p as usize] = Place { chunk, batch: batch as u32, lane: lane as u32 };
            }
        }
        // A carrier precedes the other pieces of its lane.
        for (p, &carrier) in self.shared_lanes.of_piece().iter().enumerate() {
            places[p] = places[carrier as usize];
        }
        Cow::Owned(places)
    }

    #[inline(always)]
    fn rotation(&self, place: Place) -> Matrix3<f32> {
        self.chunks[place.chunk as usize].rotation(place.batch as usize, place.lane as usize)
    }
}

/// Marks of the pieces that a cut concerns; none between cuts.
#[derive(Debug, Default, serde::Serialize, serde::Deserialize)]
struct Marks {
    /// Carriers whose lanes are to be amended.
    amended: Vec<bool>,
    /// Carriers whose rotation new lanes inherit.
    source: Vec<bool>,
}

impl Marks {
    fn put_on(&mut self, changes: &LaneChanges, n_pieces: usize) {
        resize_reserving(&mut self.amended, n_pieces, false);
        resize_reserving(&mut self.source, n_pieces, false);
        self.set(changes, true);
    }

    fn take_off(&mut self, changes: &LaneChanges) {
        self.set(changes, false);
    }

    fn set(&mut self, changes: &LaneChanges, mark: bool) {
        changes.amended.iter().for_each(|&p| self.amended[p as usize] = mark);
        let sources = changes.added.iter().map(|added| added[1]).filter(|&source| source != NO_PIECE);
        sources.for_each(|source| self.source[source as usize] = mark);
    }
}

impl LinearOperator for Elastic {
    fn apply(&mut self, team: &mut Team, x: &[Padded], y: &mut [Padded]) {
        apply(self, team, x, y);
    }
}
