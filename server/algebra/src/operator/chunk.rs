//! One chunk of the stiffness: the lanes of the pieces of one group, their local vectors, and how
//! they follow a cut.

use nalgebra::{Matrix3, Vector3};
use scindo_matter::element::{LANES, Simd};
use scindo_matter::mesh::TetMesh;
use scindo_matter::storage::numbering::Numbering;
use scindo_matter::storage::reserve::resize_reserving;

use super::chunks::{NO_PIECE, pack, plan_chunk};
use super::edges::EdgeBlocks;
use super::kernel::Batches;
use super::shared_lanes::Merged;
use super::stiffness::{Tension, UpdateAt};
use super::strips::{AS_IN_MESH, Corners, corners_of};
use super::tet_batch::{Block6, Coefficients, EnergyCoefficients, Locals, RestBatch};
use super::tet_lanes::Found;
use super::{Padded, padded};

#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct Chunk {
    /// Group of its elements.
    pub group: usize,
    /// Numbers of lanes and copies when the chunk was planned; `n_lanes` is the present number.
    planned: [usize; 2],
    n_lanes: usize,
    /// Copy of every local number, ascending. The last local number is the waste bin of unused lanes.
    pub copies: Vec<u32>,
    pieces: Vec<[u32; LANES]>,
    /// Order of the corners in every lane of the batches of strips, which come first.
    corners: Vec<[Corners; LANES]>,
    batches: Batches,
    positions: Vec<[f64; 4]>,
    /// Vector that the stiffness is applied to, by local number.
    pub x: Vec<Padded>,
    /// Rest positions [m].
    rest: Vec<Vector3<f64>>,
    /// The assembled stiffness, if it is in use.
    edges: Option<EdgeBlocks>,
    /// Whether it is the tangent of a law that is nonlinear in the stretch.
    own_tangent: bool,
    /// Lanes (batch, lane) that have changed since it was assembled.
    unassembled: Vec<[usize; 2]>,
    /// Pieces with det F ≤ 0 at the last update.
    pub inverted: usize,
    /// Energy [J] when it was last asked for.
    pub energy: f64,
    /// Whether the chunk was planned or amended since the last update.
    pub stale: bool,
    /// First row of its sums among those of all chunks.
    pub first_row: usize,
}

/// A carrier (a piece that gets a lane), and the rotation to start with.
#[derive(Clone, Copy, Debug)]
pub(super) struct NewLane {
    /// Index of the carrier.
    pub piece: u32,
    /// Rotation R that its lane starts with.
    pub rotation: Matrix3<f32>,
}

impl Chunk {
    /// Arranges the carriers `members` (ascending) in batches.
    pub(super) fn new(group: usize, members: &[NewLane], mesh: &TetMesh, merged: &[Merged]) -> Self {
        let pieces: Vec<u32> = members.iter().map(|lane| lane.piece).collect();
        let plan = plan_chunk(&pieces, |p| merged[p as usize].piece.copies);
        // Spare capacity for what cuts add before the next plan.
        let mut rest = Vec::with_capacity(plan.pieces.len() + plan.pieces.len() / 4 + 1);
        for (b, lanes) in plan.pieces.iter().enumerate() {
            let mut batch = RestBatch::empty();
            for (lane, &p) in lanes.iter().enumerate().filter(|(_, p)| **p != NO_PIECE) {
                let rotation = pieces.binary_search(&p).ok().map(|at| &members[at].rotation);
                let corners = corners_of(&plan.corners, b, lane);
                batch.set(lane, mesh, (&merged[p as usize], corners), rotation);
            }
            rest.push(batch);
        }
        let n = plan.copies.len() + 1;
        let (mut x, mut positions) = (Vec::new(), Vec::new());
        resize_reserving(&mut x, n, [0.0; 4]);
        resize_reserving(&mut positions, n, [0.0; 4]);
        Self {
            group,
            batches: Batches::new(&plan.nodes, rest, n, plan.corners.len()),
            corners: plan.corners,
            pieces: plan.pieces,
            rest: rest_positions(&plan.copies, &pieces, mesh, merged),
            edges: None,
            own_tangent: false,
            unassembled: Vec::new(),
            planned: [members.len(), plan.copies.len()],
            n_lanes: members.len(),
            copies: plan.copies,
            positions,
            x,
            inverted: 0,
            energy: 0.0,
            stale: true,
            first_row: 0,
        }
    }

    /// Carrier, batch and lane of all lanes in use.
    pub(super) fn lanes(&self) -> impl Iterator<Item = (u32, usize, usize)> + '_ {
        let lanes = self.pieces.iter().enumerate();
        let lanes = lanes.flat_map(|(b, lanes)| lanes.iter().enumerate().map(move |(l, &p)| (p, b, l)));
        lanes.filter(|&(p, ..)| p != NO_PIECE)
    }

    /// All lanes in use with their rotations, to be arranged anew.
    pub(super) fn new_lanes(&self) -> impl Iterator<Item = NewLane> + '_ {
        self.lanes().map(|(piece, b, l)| NewLane { piece, rotation: self.rotation(b, l) })
    }

    /// Rotation of a lane at the last update.
    pub(super) fn rotation(&self, batch: usize, lane: usize) -> Matrix3<f32> {
        let rotation = &self.batches.rest()[batch].rotation;
        Matrix3::from_fn(|i, j| rotation[3 * i + j].0[lane])
    }

    /// Amends copies and fractions of the carriers marked in `is_amended`, and gives the `added` ones
    /// lanes. Copies new to the chunk are new to the body, so `copies` stays in order. Returns `false`
    /// and does nothing if the chunk has grown so much that packing and numbering it anew pays.
    pub(super) fn follow(
        &mut self,
        mesh: &TetMesh,
        merged: &[Merged],
        is_amended: &[bool],
        added: &[NewLane],
        numbering: &mut Numbering,
    ) -> bool {
        let amended: Vec<(u32, usize, usize)> =
            self.lanes().filter(|&(p, ..)| is_amended[p as usize]).collect();
        let known = self.copies.len();
        // All chunks share the numbering, so it first has to learn the list of this one.
        numbering.note(&self.copies, 0);
        // Copies that are new to the chunk, and their nodes.
        let mut new: Vec<(u32, u32)> = Vec::new();
        for p in amended.iter().map(|lane| lane.0).chain(added.iter().map(|lane| lane.piece)) {
            let piece = &merged[p as usize].piece;
            let held = piece.copies.into_iter().zip(mesh.tets[piece.element as usize]);
            new.extend(held.filter(|&(copy, _)| numbering.insert(&mut self.copies, copy)));
        }
        // They were appended only to be numbered; a refusal must leave no trace.
        self.copies.truncate(known);
        let [planned_lanes, planned_copies] = self.planned;
        let n_copies = known + new.len();
        if self.n_lanes + added.len() > planned_lanes + planned_lanes / 4
            || n_copies > planned_copies + planned_copies / 2
        {
            return false;
        }
        new.sort_unstable();
        self.copies.extend(new.iter().map(|n| n.0));
        self.rest.extend(new.iter().map(|n| mesh.nodes[n.1 as usize]));
        debug_assert!(self.copies.is_sorted());
        // Sorting has moved the new copies from the places that were noted for them.
        numbering.note(&self.copies, known);
        let n = n_copies + 1;
        let copies = &self.copies;
        let locals = |p: u32| {
            let local = |copy| numbering.find(copies, copy).unwrap_or(n - 1) as u16;
            merged[p as usize].piece.copies.map(local)
        };
        let held: Vec<[u16; 4]> = added.iter().map(|new| locals(new.piece)).collect();
        let places = free_lanes(&mut self.pieces, added, &held, n);
        self.batches.grow(self.pieces.len(), n);
        // An assembled stiffness is not made anew for these lanes: it takes them in when it is assembled next.
        for (p, batch, lane) in amended {
            let (ids, corners) = (locals(p), corners_of(&self.corners, batch, lane));
            self.batches.set_nodes(batch, lane, corners.map(|c| ids[c as usize]));
            self.batches.rest_mut(batch).set_volume(lane, mesh, &merged[p as usize]);
            self.unassembled.push([batch, lane]);
        }
        // Batches of strips are full, so the corners of new lanes have the order of the mesh.
        for (([batch, lane], ids), NewLane { piece, rotation }) in places.into_iter().zip(held).zip(added) {
            self.batches.set_nodes(batch, lane, ids);
            self.batches.rest_mut(batch).set(
                lane,
                mesh,
                (&merged[*piece as usize], AS_IN_MESH),
                Some(rotation),
            );
            self.unassembled.push([batch, lane]);
        }
        self.n_lanes += added.len();
        self.stale = true;
        self.positions.resize(n, [0.0; 4]);
        self.x.resize(n, [0.0; 4]);
        true
    }

    /// Bytes of stiffness that one application streams.
    pub(super) fn bytes(&self) -> usize {
        self.edges.as_ref().map_or_else(|| self.batches.bytes(), EdgeBlocks::bytes)
    }

    /// Number of lanes in use.
    pub(super) fn n_lanes(&self) -> usize {
        self.n_lanes
    }

    /// Assembles the stiffness of the last update, or drops the assembled one if it is not `wanted`. A law with a tangent
    /// of its own has assembled it already.
    pub(super) fn assemble(&mut self, wanted: bool) {
        if self.own_tangent {
            return;
        }
        let Self { edges, batches, unassembled, .. } = self;
        match edges {
            _ if !wanted => *edges = None,
            None => edges.insert(EdgeBlocks::new(batches)).assemble(batches),
            Some(edges) => {
                if !unassembled.is_empty() {
                    edges.follow(batches, unassembled.iter().copied());
                }
                edges.assemble(batches);
            }
        }
        unassembled.clear();
    }

    /// The part of its rows that the chunk uses.
    fn used<'a, T>(&self, rows: &'a mut [T]) -> &'a mut [T] {
        &mut rows[..self.x.len()]
    }

    /// Asks for the stiffness that [`Self::apply`] reads first, before x is gathered.
    #[inline(always)]
    pub(super) fn ask_for_stiffness(&self) {
        if self.edges.is_none() {
            self.batches.ask_for_first();
        }
    }

    /// y = s K̂ x, `with_twists` or as damping has it; `y` may have more rows than the chunk uses.
    #[inline(always)]
    pub(super) fn apply(&self, simd: Simd, with_twists: bool, y: &mut [Padded]) {
        let y = self.used(y);
        y.fill([0.0; 4]);
        // The assembled stiffness contains the twists, or it is the tangent of another law.
        match &self.edges {
            Some(edges) if with_twists || !(self.own_tangent || self.batches.is_twisted()) => {
                edges.apply(simd, &self.x, y)
            }
            _ => self.batches.apply(simd, with_twists, &self.x, y),
        }
    }

    /// y = K̂ u with displacements u relative to the chunk's first copy, subtracted in double
    /// precision: the error is relative to the chunk, not to how far the body has moved.
    pub(super) fn linear_forces(
        &mut self,
        simd: Simd,
        scale: f32,
        positions: &[Vector3<f64>],
        y: &mut [Padded],
    ) {
        let displacement = |copy: u32, rest: &Vector3<f64>| positions[copy as usize] - rest;
        let held = self.copies.iter().zip(&self.rest);
        let origin =
            held.clone().next().map_or_else(Vector3::zeros, |(&copy, rest)| displacement(copy, rest));
        for (local, (&copy, rest)) in self.x.iter_mut().zip(held) {
            *local = padded(&(displacement(copy, rest) - origin));
        }
        let y = self.used(y);
        self.apply(simd, false, y);
        let factor = 1.0 / scale;
        for f in y.iter_mut().flatten() {
            *f *= factor;
        }
    }

    /// Reads the positions of the chunk's copies.
    fn gather(&mut self, positions: &[Vector3<f64>]) {
        for (local, &copy) in self.positions.iter_mut().zip(&self.copies) {
            let x = &positions[copy as usize];
            *local = [x.x, x.y, x.z, 0.0];
        }
    }

    /// Updates rotations, gradients, internal forces `f` and diagonal blocks, and twists at the positions of the tension.
    pub(super) fn update(
        &mut self,
        simd: Simd,
        c: &Coefficients,
        at: UpdateAt<'_>,
        f: &mut [Padded],
        diagonal: &mut [Block6],
    ) {
        let UpdateAt { positions, tension } = at;
        if let Some(tension) = tension.filter(|_| c.damping > 0.0) {
            self.gather(tension.start);
            self.batches.note_start(simd, &self.positions);
        }
        self.gather(positions);
        let (f, diagonal) = (self.used(f), self.used(diagonal));
        f.fill([0.0; 4]);
        diagonal.fill([0.0; 8]);
        let mut locals = Locals { x: &self.positions, f, blocks: diagonal };
        self.stale = false;
        if let Some(law) = &c.law {
            let edges = self.edges.get_or_insert_with(|| EdgeBlocks::new(&self.batches));
            if !self.unassembled.is_empty() {
                edges.follow(&self.batches, self.unassembled.drain(..));
            }
            self.inverted = edges.update(&mut self.batches, simd, (c, law), &mut locals);
            self.own_tangent = true;
            return;
        }
        let Found { inverted, pulled } = self.batches.update(simd, c, &mut locals);
        (self.inverted, self.own_tangent) = (inverted, false);
        if let (true, Some(twists), Some(tension)) = (pulled, &c.twists, tension) {
            self.gather(tension.at);
            self.batches.find_twists(simd, twists, &self.positions, diagonal, false);
        }
    }

    /// Whether twists count since the last update.
    pub(super) fn is_twisted(&self) -> bool {
        self.batches.is_twisted()
    }

    /// Lets twists count that do not matter here, but elsewhere in the body.
    pub(super) fn twist(
        &mut self,
        simd: Simd,
        c: &Coefficients,
        tension: &Tension<'_>,
        diagonal: &mut [Block6],
    ) {
        let Some(twists) = &c.twists else { return };
        self.gather(tension.at);
        let diagonal = self.used(diagonal);
        self.batches.find_twists(simd, twists, &self.positions, diagonal, true);
    }

    /// Computes the energy with the rotations of the last update.
    pub(super) fn find_energy(&mut self, simd: Simd, c: EnergyCoefficients, positions: &[Vector3<f64>]) {
        let held = self.copies.iter().zip(&self.rest);
        for (local, (&copy, rest)) in self.positions.iter_mut().zip(held) {
            let u = positions[copy as usize] - rest;
            *local = [u.x, u.y, u.z, 0.0];
        }
        self.energy = self.batches.energy(simd, c, &self.positions);
    }
}

/// Gives the carriers `added` lanes: first those that are empty (only the last batch has any), then new
/// batches. `held` are the local numbers of their copies, below `n_locals`. Returns batch and lane of each.
fn free_lanes(
    batches: &mut Vec<[u32; LANES]>,
    added: &[NewLane],
    held: &[[u16; 4]],
    n_locals: usize,
) -> Vec<[usize; 2]> {
    let mut places = Vec::with_capacity(added.len());
    let last = batches.len().saturating_sub(1);
    let empty = batches.last_mut().into_iter().flatten().enumerate().filter(|(_, p)| **p == NO_PIECE);
    for ((l, lane), new) in empty.zip(added) {
        *lane = new.piece;
        places.push([last, l]);
    }
    let first = places.len();
    places.resize(added.len(), [0; 2]);
    for mut lanes in pack(&held[first..], n_locals) {
        for (l, lane) in lanes.iter_mut().enumerate().filter(|(_, p)| **p != NO_PIECE) {
            let k = first + *lane as usize;
            places[k] = [batches.len(), l];
            *lane = added[k].piece;
        }
        batches.push(lanes);
    }
    places
}

/// Rest position of each of `copies` (ascending), all of which belong to pieces in `members`.
fn rest_positions(copies: &[u32], members: &[u32], mesh: &TetMesh, merged: &[Merged]) -> Vec<Vector3<f64>> {
    let mut rest = vec![Vector3::zeros(); copies.len()];
    for piece in members.iter().map(|&p| &merged[p as usize].piece) {
        for (copy, &node) in piece.copies.iter().zip(&mesh.tets[piece.element as usize]) {
            if let Ok(local) = copies.binary_search(copy) {
                rest[local] = mesh.nodes[node as usize];
            }
        }
    }
    rest
}
