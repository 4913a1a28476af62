//! The cells of one octree, or of one level above it, as a linear operator.

use std::collections::BTreeMap;
use std::ops::Range;

use nalgebra::Matrix3;
use scindo_matter::element::Simd;
use scindo_matter::octree::{Cell, morton_code};
use scindo_matter::storage::reserve::resize_reserving;
use scindo_matter::team::{Team, blocks, ranges};

use super::super::chunks::Gather;
use super::super::rows::{self, Sum, gather_direction};
use super::super::stiffness::{Direction, Place};
use super::super::tet_batch::Block6;
use super::super::{BLOCK, LinearOperator, Padded, block_of};
use super::batch::TableLanes;
use super::blocks::BlockTable;
use super::chunk::{CellChunk, Given, LocalVector, Table};
use super::lane::{CellLane, CellMatrix};
use super::sectors::SectorTable;
use super::stored::STORED;

/// Cells per chunk: its vectors stay in the first cache, and a body of a few thousand cells still has work for
/// several threads.
const CHUNK_CELLS: usize = 512;

/// Where a cut arranges more than this part of the chunks anew, all rows are listed again.
const MANY: usize = 4;

/// Σ Wᵀ A W over cells with matrices A, in single precision.
///
/// Everything is computed in two halves, each a pass over all threads: sums of the chunks, then what the
/// vertices gather of them in blocks of 256. The division depends on the cells only.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct CellOperator {
    pub(super) simd: Simd,
    pub(super) tables: Vec<Table>,
    pub(super) chunks: Vec<CellChunk>,
    pub(super) gather: Gather,
    /// Sums of all chunks, rows as in `gather`.
    pub(super) sums: Vec<Padded>,
    /// Likewise, diagonal blocks.
    pub(super) diagonals: Vec<Block6>,
    places: Vec<Place>,
}

/// Some vertices, and what products with their rows and columns need.
#[derive(Clone, Debug, Default)]
pub struct Patch {
    /// Chunks around the vertices, and their entries of `locals`.
    chunks: Vec<(usize, Range<usize>)>,
    /// Local number in the chunk, and number in the patch.
    locals: Vec<(u32, u32)>,
    /// Rows of sums of the vertices, one after the other.
    rows: Vec<u32>,
    /// Entries of `rows` of every vertex.
    first_row: Vec<usize>,
}

impl CellOperator {
    /// Arranges `cells` for the kernels, their rotations I and their stored matrices 0. `order` lists all of them
    /// so that near ones are near, see [`morton_order`].
    pub fn new(
        simd: Simd,
        tables: &[SectorTable],
        cells: &[CellLane],
        order: &[u32],
        n_vertices: usize,
    ) -> Self {
        let lane = |id: u32| cells[id as usize];
        let chunk = |members: &[u32]| {
            let mut members = members.to_vec();
            // As in chunks that are rearranged: cells in one order have the same sums to the bit.
            if members.iter().any(|&id| !matches!(lane(id).matrix, CellMatrix::Table(_))) {
                members.sort_unstable();
            }
            CellChunk::new(&members, &lane)
        };
        let chunks: Vec<CellChunk> = order.chunks(CHUNK_CELLS).map(chunk).collect();
        let gather = Gather::without_room(chunks.iter().map(|chunk| &chunk.vertices[..]), n_vertices);
        let places = vec![Place::default(); cells.len()];
        let (mut sums, mut diagonals) = (Vec::new(), Vec::new());
        resize_reserving(&mut sums, gather.n_rows(), [0.0; 4]);
        resize_reserving(&mut diagonals, gather.n_rows(), [0.0; 8]);
        let mut operator = Self { simd, tables: Vec::new(), chunks, gather, sums, diagonals, places };
        (0..operator.chunks.len()).for_each(|chunk| operator.find_places(chunk));
        operator.set_tables(tables);
        operator
    }

    fn find_places(&mut self, chunk: usize) {
        for (cell, batch, lane) in self.chunks[chunk].places() {
            let place = Place { chunk: chunk as u32, batch: batch as u32, lane: lane as u32 };
            self.places[cell as usize] = place;
        }
    }

    /// Replaces the tables; they keep their numbers.
    pub fn set_tables(&mut self, tables: &[SectorTable]) {
        self.tables.clear();
        self.tables.extend(tables.iter().map(|table| Table {
            lanes: TableLanes::new(table),
            blocks: BlockTable::new(table),
            twists: None,
        }));
    }

    /// Sets the factor c > 0 of every cell with a table; `of` gives it from the number of the cell.
    pub fn set_factors(&mut self, team: &mut Team, of: impl Fn(u32) -> f32 + Sync) {
        team.for_blocks(blocks(&mut self.chunks, 1), |_, chunk| chunk[0].set_factors(&of));
    }

    /// Sets the rotation R of every cell with a table; `of` gives it from the number of the cell.
    pub fn set_rotations(&mut self, team: &mut Team, of: impl Fn(u32) -> Matrix3<f32> + Sync) {
        team.for_blocks(blocks(&mut self.chunks, 1), |_, chunk| chunk[0].set_rotations(&of));
    }

    /// Sets stored matrices: `of` gives that of the cell with the given number. Entry k of the upper triangle, row by
    /// row, is number `order[k]` of what it gives. Row 3 j + i is component i of slot j.
    pub fn set_stored<'a>(
        &mut self,
        team: &mut Team,
        order: &[u16; STORED],
        of: impl Fn(u32) -> Given<'a> + Sync,
    ) {
        let simd = self.simd;
        team.for_blocks(blocks(&mut self.chunks, 1), |_, chunk| chunk[0].set_stored(simd, order, &of));
    }

    /// Sets the rotation R of every cell with a stored matrix A, which then stands for R A Rᵀ.
    pub fn set_stored_rotations(&mut self, team: &mut Team, of: impl Fn(u32) -> Matrix3<f32> + Sync) {
        team.for_blocks(blocks(&mut self.chunks, 1), |_, chunk| chunk[0].set_stored_rotations(&of));
    }

    /// Takes other tables, matrices and hanging slots for the cells that `changed` names; their vertices stay. `lane`
    /// gives what each cell is now. Returns which chunks were arranged anew: these forget rotations and stored matrices.
    pub fn rearrange(
        &mut self,
        team: &mut Team,
        lane: impl Fn(u32) -> CellLane + Sync,
        changed: impl Fn(u32) -> bool + Sync,
    ) -> Vec<usize> {
        let is_changed = |chunk: &CellChunk| chunk.places().any(|(cell, ..)| changed(cell));
        let renewed: Vec<usize> = (0..self.chunks.len()).filter(|&k| is_changed(&self.chunks[k])).collect();
        team.for_blocks(blocks(&mut self.chunks, 1), |k, chunk| {
            if renewed.binary_search(&k).is_ok() {
                chunk[0] = CellChunk::new(&members(&chunk[0]), &lane);
            }
        });
        renewed.iter().for_each(|&k| self.find_places(k));
        renewed
    }

    /// Follows a cut after which there are `n_cells` cells on `n_vertices` vertices. The cells in `changed`, ascending,
    /// are new or have other vertices or hanging slots; `lane` gives what each of them and of their neighbours in
    /// a chunk is now, and `source` an earlier cell near a new one. Returns which chunks were arranged anew,
    /// ascending: these forget factors, rotations and stored matrices.
    pub fn follow(
        &mut self,
        changed: &[u32],
        [n_cells, n_vertices]: [usize; 2],
        lane: &dyn Fn(u32) -> CellLane,
        source: &dyn Fn(u32) -> u32,
    ) -> Vec<usize> {
        let known = self.places.len();
        // A new cell joins the chunk of an earlier one near it, so that chunks stay compact and most of them untouched.
        let mut of_chunk: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for &id in changed {
            let new = id as usize >= known;
            let chunk = self.places[if new { source(id) } else { id } as usize].chunk;
            let held = of_chunk.entry(chunk).or_insert_with(|| members(&self.chunks[chunk as usize]));
            if new {
                held.push(id);
            }
        }
        resize_reserving(&mut self.places, n_cells, Place::default());
        let mut left = Vec::with_capacity(of_chunk.len());
        let mut arranged = Vec::with_capacity(of_chunk.len());
        for (chunk, mut members) in of_chunk {
            members.sort_unstable();
            left.push((chunk as usize, std::mem::take(&mut self.chunks[chunk as usize])));
            // A chunk that has grown is divided.
            let size = if members.len() > 2 * CHUNK_CELLS { CHUNK_CELLS } else { members.len() };
            arranged.extend(members.chunks(size).map(|members| CellChunk::new(members, lane)));
        }
        // Each goes where it has room for its sums, and else behind all others.
        let mut free: Vec<usize> =
            (0..self.chunks.len()).filter(|&k| self.chunks[k].vertices.is_empty()).collect();
        let mut renewed: Vec<usize> = left.iter().map(|(chunk, _)| *chunk).collect();
        let directed = left.iter().any(|(_, chunk)| !chunk.x.is_empty());
        for mut chunk in arranged {
            // Room for directions is made here, where the others have theirs: the next product then allocates nothing.
            if directed {
                chunk.room();
            }
            let room = |&k: &usize| self.gather.room(k) >= chunk.vertices.len();
            let at = match free.iter().position(room) {
                Some(found) => free.remove(found),
                None => {
                    self.gather.add_chunk(chunk.vertices.len() + chunk.vertices.len() / 8);
                    self.chunks.push(CellChunk::default());
                    self.chunks.len() - 1
                }
            };
            self.chunks[at] = chunk;
            renewed.push(at);
        }
        renewed.sort_unstable();
        renewed.dedup();
        renewed.iter().for_each(|&chunk| self.find_places(chunk));
        // Editing the lists of rows pays only where few chunks have changed.
        if MANY * renewed.len() > self.chunks.len() {
            self.gather.arrange(self.chunks.iter().map(|chunk| &chunk.vertices[..]), n_vertices);
        } else {
            let before = left.iter().map(|(chunk, left)| (*chunk, &left.vertices[..]));
            let now = renewed.iter().map(|&chunk| (chunk, &self.chunks[chunk].vertices[..]));
            self.gather.replace(before, now, n_vertices);
        }
        let rows = self.gather.n_rows();
        resize_reserving(&mut self.sums, rows, [0.0; 4]);
        resize_reserving(&mut self.diagonals, rows, [0.0; 8]);
        renewed
    }

    /// The cells of a chunk.
    pub fn members(&self, chunk: usize) -> impl Iterator<Item = u32> {
        self.chunks[chunk].places().map(|(cell, ..)| cell)
    }

    /// Number of tables.
    pub fn n_tables(&self) -> usize {
        self.tables.len()
    }

    /// First half of the diagonal blocks.
    pub fn update_diagonals(&mut self, team: &mut Team) {
        let Self { simd, tables, chunks, gather, diagonals, .. } = self;
        let rows = ranges(diagonals, &gather.first_row);
        team.for_blocks((blocks(chunks, 1), rows), |_, (chunk, rows)| {
            chunk[0].diagonals(*simd, tables, rows);
        });
    }

    /// Second half: adds the diagonal blocks of the vertices of block number `block`.
    #[inline(always)]
    pub fn add_diagonals(&self, block: usize, diagonal: &mut [Block6]) {
        self.gather.add(block, &self.diagonals, diagonal);
    }

    /// First half of a product with `x`.
    pub fn multiply(&mut self, team: &mut Team, x: &[Padded]) {
        self.multiply_chunks(team, x, true);
    }

    /// The same, `with_twists` or without.
    pub(super) fn multiply_chunks(&mut self, team: &mut Team, x: &[Padded], with_twists: bool) {
        self.for_chunks(team, |simd, tables, chunk, y| {
            chunk.ask_for_first();
            let mut local = LocalVector::new();
            local.extend(chunk.vertices.iter().map(|&vertex| x[vertex as usize]));
            chunk.apply(simd, tables, with_twists, &local, y);
        });
    }

    /// The same with x ← z + β x, where x is that of the last product with a direction (nothing if β = 0).
    pub fn multiply_direction(&mut self, team: &mut Team, z: &[Padded], beta: f32) {
        self.for_chunks(team, |simd, tables, chunk, y| {
            chunk.ask_for_first();
            chunk.room();
            gather_direction(&mut chunk.x, &chunk.vertices, z, beta);
            chunk.apply(simd, tables, true, &chunk.x, y);
        });
    }

    fn for_chunks(
        &mut self,
        team: &mut Team,
        multiply: impl Fn(Simd, &[Table], &mut CellChunk, &mut [Padded]) + Sync,
    ) {
        let Self { simd, tables, chunks, gather, sums, .. } = self;
        let sums = ranges(sums, &gather.first_row);
        team.for_blocks((blocks(chunks, 1), sums), |_, (chunk, y)| multiply(*simd, tables, &mut chunk[0], y));
    }

    /// The part of the operator around `vertices`, ascending: the rows and columns of these. `cells` are all around
    /// them.
    pub fn patch(&self, cells: impl Iterator<Item = u32>, vertices: &[u32]) -> Patch {
        let mut taken = vec![false; self.chunks.len()];
        cells.for_each(|id| taken[self.places[id as usize].chunk as usize] = true);
        let mut patch = Patch { first_row: vec![0], ..Patch::default() };
        let mut further = 0;
        for chunk in (0..self.chunks.len()).filter(|&chunk| taken[chunk]) {
            let begin = patch.locals.len();
            let mut known = 0;
            for (local, vertex) in (0u32..).zip(&self.chunks[chunk].vertices) {
                known += vertices[known..].partition_point(|v| v < vertex);
                if vertices.get(known) == Some(vertex) {
                    patch.locals.push((local, known as u32));
                }
            }
            patch.chunks.push((chunk, begin..patch.locals.len()));
        }
        for &vertex in vertices {
            self.gather.rows_of(vertex, &mut further, &mut patch.rows);
            patch.first_row.push(patch.rows.len());
        }
        patch
    }

    /// y = A x on a patch, in the order of its vertices.
    pub fn multiply_patch(&mut self, patch: &Patch, x: &[Padded], y: &mut [Padded]) {
        let Self { simd, tables, chunks, gather, sums, .. } = self;
        for (chunk, locals) in &patch.chunks {
            let held = &chunks[*chunk];
            let mut local_x = LocalVector::from_elem([0.0; 4], held.vertices.len());
            for &(local, i) in &patch.locals[locals.clone()] {
                local_x[local as usize] = x[i as usize];
            }
            let y = &mut sums[gather.first_row[*chunk] as usize..];
            held.apply(*simd, tables, true, &local_x, y);
        }
        for (y, ends) in y.iter_mut().zip(patch.first_row.windows(2)) {
            *y = [0.0; 4];
            for &row in &patch.rows[ends[0]..ends[1]] {
                y.iter_mut().zip(&sums[row as usize]).for_each(|(y, part)| *y += part);
            }
        }
    }

    /// Second half: the product at the vertices of block number `block`, added to `y`.
    #[inline(always)]
    pub fn add_products(&self, block: usize, y: &mut [Padded]) {
        self.gather.add(block, &self.sums, y);
    }

    /// Second half after [`multiply_direction`](Self::multiply_direction): p ← z + β p, q = A p with the masses,
    /// and the share of the block in pᵀq.
    #[inline(always)]
    pub fn advance(&self, block: usize, with: &Direction<'_>, p: &mut [Padded], q: &mut [Padded]) -> f64 {
        let (z, mass) = (block_of(with.z, block), block_of(with.mass, block));
        let sums = (self.gather.pairs(block), &self.sums[..]);
        let product = rows::advance_direction(z, with.beta, (mass, with.factor), sums, [&mut *p, &mut *q]);
        let mut further = Sum::default();
        for (vertex, row) in self.gather.further(block) {
            further.add(&p[vertex], &self.sums[row]);
            q[vertex].iter_mut().zip(&self.sums[row]).for_each(|(q, part)| *q += part);
        }
        product + further.total()
    }

    /// Where every cell is kept.
    pub fn places(&self) -> &[Place] {
        &self.places
    }

    /// Rotation R of a cell; I for a stored matrix.
    #[inline(always)]
    pub fn rotation(&self, place: Place) -> Matrix3<f32> {
        self.chunks[place.chunk as usize].rotation(place.batch as usize, place.lane as usize)
    }

    /// Bytes in use: all but stored matrices, and these.
    pub fn memory(&self) -> [usize; 2] {
        let chunks = self.chunks.iter().map(CellChunk::memory);
        let [others, stored] = chunks.fold([0, 0], |[a, b], [c, d]| [a + c, b + d]);
        let vectors = size_of_val(&self.sums[..]) + size_of_val(&self.diagonals[..]);
        [others + self.gather.memory() + vectors + size_of_val(&self.places[..]), stored]
    }

    /// Bytes of stiffness that one application streams.
    pub fn bytes(&self) -> usize {
        self.chunks.iter().map(CellChunk::bytes).sum()
    }

    /// Lanes per cell (some are unused), and rows of sums per vertex of `n_vertices` (chunks share some).
    pub fn overheads(&self, n_vertices: usize) -> [f64; 2] {
        let lanes: usize = self.chunks.iter().map(|chunk| chunk.lanes.len()).sum();
        let cells = self.places.len().max(1);
        [
            (lanes * scindo_matter::element::LANES) as f64 / cells as f64,
            self.gather.n_rows() as f64 / n_vertices as f64,
        ]
    }
}

impl LinearOperator for CellOperator {
    fn apply(&mut self, team: &mut Team, x: &[Padded], y: &mut [Padded]) {
        self.multiply(team, x);
        let operator = &*self;
        team.for_blocks(blocks(y, BLOCK), |block, y| {
            y.fill([0.0; 4]);
            operator.add_products(block, y);
        });
    }
}

/// The cells of a chunk, ascending.
fn members(chunk: &CellChunk) -> Vec<u32> {
    let mut members: Vec<u32> = chunk.places().map(|(cell, ..)| cell).collect();
    members.sort_unstable();
    members
}

/// Numbers of the cells along Morton's curve.
pub fn morton_order(cells: &[Cell]) -> Vec<u32> {
    let mut order: Vec<u32> = (0..cells.len() as u32).collect();
    order.sort_by_cached_key(|&id| (morton_code(cells[id as usize].at), id));
    order
}
