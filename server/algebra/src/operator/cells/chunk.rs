//! A run of cells with local numbers for its vertices: the unit of work of one thread.

#![allow(unsafe_code)] // unchecked local numbers, made and checked here

use std::array::from_fn;
use std::collections::BTreeMap;
use std::ops::Range;

use nalgebra::Matrix3;
use scindo_matter::element::{Halves, LANES, Lanes, Simd, prefetch};
use smallvec::SmallVec;

use super::super::Padded;
use super::super::chunks::{NO_PIECE, pack};
use super::super::tet_batch::Block6;
use super::super::twist::{TwistBatch, TwistCoefficients};
use super::batch::{self, GroupCells, HangingWeights, SectorBatch, TableLanes};
use super::blocks::{self, BlockTable};
use super::lane::{CellLane, CellMatrix, HANGING_SLOTS, frame, turned};
use super::sectors::hanging_slots;
use super::stored::{self, Entry, STORED, StoredBatch};

/// Vertices of the largest chunks, of 1024 cells that have none in common.
pub(super) const MOST_VERTICES: usize = 0x2000;

/// A vector by local number. It is on the stack: one chunk after the other needs it, so it stays near the core.
pub(super) type LocalVector = SmallVec<[Padded; MOST_VERTICES]>;

/// A table in the forms that the loops read.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct Table {
    /// For products.
    pub lanes: TableLanes,
    /// For diagonal blocks.
    pub blocks: BlockTable,
    /// Constants of twists per μ, where these may be needed.
    pub twists: Option<TwistCoefficients>,
}

/// Batches with the same table, or stored ones; with or without hanging slots.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct Group {
    /// Table or stored.
    pub matrix: CellMatrix,
    /// Batches, counted over all groups of the chunk.
    pub batches: Range<usize>,
    /// Their weights in the chunk's list; empty if no slot hangs.
    pub weights: Range<usize>,
}

/// What the lanes of a batch hold.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct BatchLanes {
    /// Number of every cell, [`NO_PIECE`] in unused lanes.
    pub cells: [u32; LANES],
    /// Octants of the cells.
    pub octants: [u8; LANES],
    /// Hanging slots of the cells.
    pub hanging: [u8; LANES],
}

/// A run of cells in batches.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct CellChunk {
    /// Vertex of every local number, ascending.
    pub vertices: Vec<u32>,
    /// Vector of the last product with a direction, by local number; empty before the first one.
    pub x: Vec<Padded>,
    /// Batches of tables come before stored ones.
    pub groups: Vec<Group>,
    /// Batches with tables.
    pub batches: Vec<SectorBatch>,
    /// Their twists, where they have once mattered.
    pub twists: Vec<TwistBatch>,
    /// Whether these matter now.
    pub twisted: bool,
    /// Batches with matrices of their own; their numbers follow.
    pub stored: Vec<StoredBatch<Lanes>>,
    /// Those in half precision, which come last.
    pub half: Vec<StoredBatch<Halves>>,
    /// Cells of every batch.
    pub lanes: Vec<BatchLanes>,
    /// Sets of hanging slots in the order of `weights`.
    hanging: Vec<[u8; LANES]>,
    pub weights: Vec<HangingWeights>,
    /// Cells with det F ≤ 0 at the last update.
    pub inverted: usize,
}

impl CellChunk {
    /// Arranges the cells `members` in batches; `lane` gives what each of them is.
    pub(super) fn new(members: &[u32], lane: &dyn Fn(u32) -> CellLane) -> Self {
        let cells: Vec<CellLane> = members.iter().map(|&id| lane(id)).collect();
        let (numbers, vertices) = LocalNumbers::of(&cells);
        let mut kinds: BTreeMap<(CellMatrix, bool), Vec<usize>> = BTreeMap::new();
        for (k, cell) in cells.iter().enumerate() {
            kinds.entry((cell.matrix, cell.hanging != 0)).or_default().push(k);
        }
        let mut chunk = Self {
            vertices,
            x: Vec::new(),
            groups: Vec::new(),
            batches: Vec::new(),
            twists: Vec::new(),
            twisted: false,
            stored: Vec::new(),
            half: Vec::new(),
            lanes: Vec::new(),
            hanging: Vec::new(),
            weights: Vec::new(),
            inverted: 0,
        };
        chunk.lanes.reserve_exact(cells.len() / LANES + 2 * kinds.len());
        for ((matrix, hangs), group) in kinds {
            let ids: Vec<[u16; 8]> =
                group.iter().map(|&k| cells[k].vertices.map(|v| numbers.get(v))).collect();
            let members: Vec<(u32, &CellLane)> = group.iter().map(|&k| (members[k], &cells[k])).collect();
            chunk.add_group(matrix, hangs, &members, &ids);
        }
        chunk
    }

    /// Adds batches of the cells `members`, on the vertices with the local numbers `ids`.
    fn add_group(&mut self, matrix: CellMatrix, hangs: bool, members: &[(u32, &CellLane)], ids: &[[u16; 8]]) {
        let (first, first_weight) = (self.lanes.len(), self.weights.len());
        let packed = pack(ids, self.vertices.len());
        match matrix {
            CellMatrix::Table(_) => {
                self.batches.reserve_exact(packed.len());
                // So that a step in which twists begin to matter allocates nothing.
                self.twists.reserve_exact(self.batches.len() + packed.len());
            }
            CellMatrix::Stored => self.stored.reserve_exact(packed.len()),
            CellMatrix::Half => self.half.reserve_exact(packed.len()),
        }
        for lanes in packed {
            let mut batch = BatchLanes { cells: [NO_PIECE; LANES], octants: [0; LANES], hanging: [0; LANES] };
            // Unused lanes compute with the first cell and a factor of 0: nothing in them is out of range.
            let of_lane = lanes.map(|k| ids[if k == NO_PIECE { lanes[0] } else { k } as usize]);
            let nodes = from_fn(|j| of_lane.map(|ids| ids[j]));
            let mut sectors = SectorBatch { rotation: Default::default(), root: Lanes::default(), nodes };
            for (lane, &k) in lanes.iter().enumerate().filter(|(_, k)| **k != NO_PIECE) {
                let (id, cell) = members[k as usize];
                batch.cells[lane] = id;
                (batch.octants[lane], batch.hanging[lane]) = (cell.octant, cell.hanging);
                sectors.root.0[lane] = cell.factor.sqrt();
                let frame = frame(cell.octant);
                for k in 0..3 {
                    sectors.rotation[4 * k].0[lane] = frame[k] * cell.factor.sqrt();
                }
            }
            match matrix {
                CellMatrix::Table(_) => self.batches.push(sectors),
                CellMatrix::Stored => self.stored.push(StoredBatch::new(nodes)),
                CellMatrix::Half => self.half.push(StoredBatch::new(nodes)),
            }
            if hangs {
                self.weights.push(weights(&batch.hanging));
                self.hanging.push(batch.hanging);
            }
            self.lanes.push(batch);
        }
        let (batches, weights) = (first..self.lanes.len(), first_weight..self.weights.len());
        self.groups.push(Group { matrix, batches, weights });
    }

    /// Asks for what a product reads first.
    #[inline(always)]
    pub(super) fn ask_for_first(&self) {
        prefetch(self.batches.get(..batch::AHEAD).unwrap_or(&self.batches));
    }

    /// y = s K̂ x, `with_twists` where these matter; `x` has a row for every local number, and `y` perhaps more.
    #[inline(always)]
    pub(super) fn apply(
        &self,
        simd: Simd,
        tables: &[Table],
        with_twists: bool,
        x: &[Padded],
        y: &mut [Padded],
    ) {
        assert!(x.len() == self.vertices.len());
        let twisted = with_twists && self.twisted;
        assert!(!twisted || self.twists.len() == self.batches.len());
        let y = &mut y[..x.len()];
        y.fill([0.0; 4]);
        for group in &self.groups {
            let weights = &self.weights[group.weights.clone()];
            let batches = self.in_list(group);
            // SAFETY: local numbers are indices into `vertices`, which is as long as `x` and `y`.
            unsafe {
                match group.matrix {
                    CellMatrix::Table(t) => {
                        let table = &tables[usize::from(t)].lanes;
                        let twists = if twisted { &self.twists[batches.clone()] } else { &[] };
                        let batches = &self.batches[batches];
                        let cells = GroupCells { batches, twists, weights, table };
                        batch::multiply(simd, cells, x, y);
                    }
                    CellMatrix::Stored => {
                        stored::multiply(simd, &self.stored[batches], weights, x, y);
                    }
                    CellMatrix::Half => stored::multiply(simd, &self.half[batches], weights, x, y),
                }
            }
        }
    }

    /// The vector of products with directions; the first one makes room for it.
    pub(super) fn room(&mut self) -> &mut [Padded] {
        self.x.resize(self.vertices.len(), [0.0; 4]);
        &mut self.x
    }

    /// Diagonal blocks of s K̂, by local number.
    pub(super) fn diagonals(&self, simd: Simd, tables: &[Table], rows: &mut [Block6]) {
        let rows = &mut rows[..self.vertices.len()];
        rows.fill([0.0; 8]);
        for group in &self.groups {
            let hanging = &self.hanging[group.weights.clone()];
            let batches = self.in_list(group);
            match group.matrix {
                CellMatrix::Table(t) => {
                    let table = &tables[usize::from(t)].blocks;
                    // SAFETY: local numbers are indices into `vertices`, which is as long as `rows`.
                    unsafe { blocks::add(simd, &self.batches[batches.clone()], hanging, table, rows) }
                    if self.twisted {
                        blocks::add_twists(
                            &self.batches[batches.clone()],
                            &self.twists[batches],
                            hanging,
                            rows,
                        );
                    }
                }
                CellMatrix::Stored => self.add_stored(simd, &self.stored[batches], group, rows),
                CellMatrix::Half => self.add_stored(simd, &self.half[batches], group, rows),
            }
        }
    }

    fn add_stored<E: Entry>(
        &self,
        simd: Simd,
        batches: &[StoredBatch<E>],
        group: &Group,
        rows: &mut [Block6],
    ) {
        if group.weights.is_empty() {
            // SAFETY: local numbers are indices into `vertices`, which is as long as `rows`.
            return unsafe { blocks::add_stored(simd, batches, rows) };
        }
        for (batch, lanes) in batches.iter().zip(&self.lanes[group.batches.clone()]) {
            for lane in (0..LANES).filter(|&lane| lanes.cells[lane] != NO_PIECE) {
                blocks::add_stored_lane(batch, lanes.hanging[lane], lane, rows);
            }
        }
    }

    /// Where the batches of a group are in the list of its kind.
    #[inline(always)]
    fn in_list(&self, group: &Group) -> Range<usize> {
        let before = match group.matrix {
            CellMatrix::Table(_) => 0,
            CellMatrix::Stored => self.batches.len(),
            CellMatrix::Half => self.batches.len() + self.stored.len(),
        };
        group.batches.start - before..group.batches.end - before
    }

    /// Cell, batch and lane of all lanes in use.
    pub(super) fn places(&self) -> impl Iterator<Item = (u32, usize, usize)> + '_ {
        let lanes = self.lanes.iter().enumerate();
        let lanes = lanes.flat_map(|(b, batch)| batch.cells.iter().enumerate().map(move |(l, &c)| (c, b, l)));
        lanes.filter(|&(cell, ..)| cell != NO_PIECE)
    }

    /// Rotation R of a lane with a table; I for a stored matrix.
    pub(super) fn rotation(&self, batch: usize, lane: usize) -> Matrix3<f32> {
        match self.batches.get(batch) {
            Some(b) => {
                let R = Matrix3::from_fn(|i, j| b.rotation[3 * i + j].0[lane] / b.root.0[lane]);
                turned(&R, self.lanes[batch].octants[lane])
            }
            None => Matrix3::identity(),
        }
    }

    /// Sets the factor c of every cell with a table; `of` gives it from the number of the cell.
    pub(super) fn set_factors(&mut self, of: &impl Fn(u32) -> f32) {
        for (batch, lanes) in self.batches.iter_mut().zip(&self.lanes) {
            for (lane, &cell) in lanes.cells.iter().enumerate().filter(|(_, cell)| **cell != NO_PIECE) {
                let (root, before) = (of(cell).sqrt(), batch.root.0[lane]);
                batch.root.0[lane] = root;
                batch.rotation.iter_mut().for_each(|r| r.0[lane] = r.0[lane] / before * root);
            }
        }
    }

    /// Sets the rotation R of every cell with a table; `of` gives it from the number of the cell.
    pub(super) fn set_rotations(&mut self, of: &impl Fn(u32) -> Matrix3<f32>) {
        for (batch, lanes) in self.batches.iter_mut().zip(&self.lanes) {
            for (lane, &cell) in lanes.cells.iter().enumerate().filter(|(_, cell)| **cell != NO_PIECE) {
                let R = turned(&of(cell), lanes.octants[lane]);
                for i in 0..9 {
                    batch.rotation[i].0[lane] = batch.root.0[lane] * R[(i / 3, i % 3)];
                }
            }
        }
    }

    /// Sets the rotation R of every cell with a stored matrix.
    pub(super) fn set_stored_rotations(&mut self, of: &impl Fn(u32) -> Matrix3<f32>) {
        let lanes = &self.lanes[self.batches.len()..];
        let (single, half) = lanes.split_at(self.stored.len());
        let rotations = self.stored.iter_mut().map(|batch| &mut batch.rotation).zip(single);
        let rotations = rotations.chain(self.half.iter_mut().map(|batch| &mut batch.rotation).zip(half));
        for (rotation, lanes) in rotations {
            for (lane, &cell) in lanes.cells.iter().enumerate().filter(|(_, cell)| **cell != NO_PIECE) {
                let R = of(cell);
                (0..9).for_each(|i| rotation[i].0[lane] = R[(i / 3, i % 3)]);
            }
        }
    }

    /// Sets stored matrices as in [`CellOperator::set_stored`](super::CellOperator::set_stored).
    pub(super) fn set_stored<'a>(
        &mut self,
        simd: Simd,
        order: &[u16; STORED],
        of: &impl Fn(u32) -> Given<'a>,
    ) {
        let (single, half) = self.lanes[self.batches.len()..].split_at(self.stored.len());
        set_matrices(simd, (&mut self.stored, single), order, of);
        set_matrices(simd, (&mut self.half, half), order, of);
    }

    /// Bytes in use: all but stored matrices, and these.
    pub(super) fn memory(&self) -> [usize; 2] {
        let stored = size_of_val(&self.stored[..]) + size_of_val(&self.half[..]);
        let others = size_of_val(&self.vertices[..])
            + size_of_val(&self.x[..])
            + size_of_val(&self.groups[..])
            + size_of_val(&self.batches[..])
            + size_of_val(&self.twists[..])
            + size_of_val(&self.lanes[..])
            + size_of_val(&self.hanging[..])
            + size_of_val(&self.weights[..]);
        [others, stored]
    }

    /// Bytes that one application streams.
    pub(super) fn bytes(&self) -> usize {
        let twist = if self.twisted { size_of::<TwistBatch>() } else { 0 };
        self.batches.len() * (size_of::<SectorBatch>() + twist)
            + size_of_val(&self.stored[..])
            + size_of_val(&self.half[..])
            + self.weights.len() * size_of::<HangingWeights>()
    }
}

/// The matrix of a cell.
#[derive(Clone, Copy, Debug)]
pub struct Given<'a> {
    /// Its upper triangle.
    pub entries: &'a [f32; STORED],
    /// Whether it is another one than before.
    pub changed: bool,
}

/// Sets matrices of these batches as in [`CellChunk::set_stored`].
fn set_matrices<'a, E: Entry>(
    simd: Simd,
    (batches, lanes): (&mut [StoredBatch<E>], &[BatchLanes]),
    order: &[u16; STORED],
    of: &impl Fn(u32) -> Given<'a>,
) {
    for (batch, lanes) in batches.iter_mut().zip(lanes) {
        let mut from = [&[0.0; STORED]; LANES];
        let mut any = false;
        for (from, &cell) in from.iter_mut().zip(&lanes.cells).filter(|(_, cell)| **cell != NO_PIECE) {
            let given = of(cell);
            *from = given.entries;
            any |= given.changed;
        }
        // Lanes beside a changed one get what they had.
        if any {
            batch.set(simd, &from, order);
        }
    }
}

/// Local numbers by vertex: a table with open addressing.
struct LocalNumbers {
    /// Vertex and local number; [`NO_PIECE`] marks free entries.
    entries: Vec<(u32, u16)>,
    /// 32 minus the binary logarithm of the number of entries.
    shift: u32,
}

impl LocalNumbers {
    /// Numbers the vertices of `cells` in ascending order. Returns the vertices, too.
    fn of(cells: &[CellLane]) -> (Self, Vec<u32>) {
        // At least twice as many entries as there can be vertices.
        let bits = (16 * cells.len()).max(2).next_power_of_two().ilog2();
        let mut table = Self { entries: vec![(NO_PIECE, 0); 1 << bits], shift: u32::BITS - bits };
        let mut vertices = Vec::with_capacity(2 * cells.len());
        for vertex in cells.iter().flat_map(|cell| cell.vertices) {
            let place = table.place(vertex);
            let entry = &mut table.entries[place];
            if entry.0 == NO_PIECE {
                entry.0 = vertex;
                vertices.push(vertex);
            }
        }
        vertices.sort_unstable();
        for (local, &vertex) in vertices.iter().enumerate() {
            let place = table.place(vertex);
            table.entries[place].1 = local as u16;
        }
        (table, vertices)
    }

    fn get(&self, vertex: u32) -> u16 {
        self.entries[self.place(vertex)].1
    }

    /// Where `vertex` is, or would be.
    fn place(&self, vertex: u32) -> usize {
        let mut place = (vertex.wrapping_mul(0x9e37_79b9) >> self.shift) as usize;
        while self.entries[place].0 != vertex && self.entries[place].0 != NO_PIECE {
            place = (place + 1) % self.entries.len();
        }
        place
    }
}

fn weights(hanging: &[u8; LANES]) -> HangingWeights {
    HANGING_SLOTS.map(|j| {
        Lanes(hanging.map(|hanging| if hanging >> j & 1 == 1 { hanging_slots(j).1 as f32 } else { 0.0 }))
    })
}
