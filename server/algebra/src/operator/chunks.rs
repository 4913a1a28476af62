//! Division of chunks, which fit the first-level cache, into batches of eight pieces. As far as possible the pieces of a batch share no copy, so that no sum waits for the one
//! before.
//!
//! The division depends on the mesh only, never on the number of threads. Every chunk sums into
//! vectors of its own; copies on the border of chunks are then added up in chunk order.

use scindo_matter::element::{Ids, LANES};
use scindo_matter::storage::reserve::resize_reserving;

use super::BLOCK;
use super::strips::{Corners, NODES as STRIP_NODES, TETS as STRIP_TETS, find_strips};

/// Number of batches kept open while pieces are packed, one bit each; more of them separate neighbours
/// better.
const OPEN_BATCHES: usize = 32;

/// Marks a lane without a piece.
pub(super) const NO_PIECE: u32 = u32::MAX;

/// The pieces of one chunk in batches, with local numbers for their copies.
#[derive(Clone, Debug)]
pub(super) struct ChunkPlan {
    /// Copy of every local number, ascending. One more number, `copies.len()`, is the waste bin: unused
    /// lanes read and write there.
    pub copies: Vec<u32>,
    /// Order of the corners in every lane of the batches of strips. These are the first ones, six for every pair of
    /// batches of strips.
    pub corners: Vec<[Corners; LANES]>,
    /// Piece in every lane of every batch, or [`NO_PIECE`].
    pub pieces: Vec<[u32; LANES]>,
    /// Local numbers of the four copies of every lane.
    pub nodes: Vec<[Ids; 4]>,
}

/// Packs the pieces `chunk`, ascending ids, into batches and numbers their copies.
pub(super) fn plan_chunk(chunk: &[u32], copies_of: impl Fn(u32) -> [u32; 4]) -> ChunkPlan {
    let held: Vec<[u32; 4]> = chunk.iter().map(|&p| copies_of(p)).collect();
    let mut copies = held.as_flattened().to_vec();
    copies.sort_unstable();
    copies.dedup();
    let waste = copies.len() as u16;
    let local = |copy: &u32| copies.binary_search(copy).map_or(waste, |l| l as u16);
    let held: Vec<[u16; 4]> = held.iter().map(|held| held.each_ref().map(local)).collect();
    let mut plan = ChunkPlan { copies, corners: Vec::new(), pieces: Vec::new(), nodes: Vec::new() };
    let mut single = vec![true; held.len()];
    plan.add_strips(&held, &mut single);
    let rest: Vec<u32> = (0..held.len() as u32).filter(|&item| single[item as usize]).collect();
    let rest_held: Vec<[u16; 4]> = rest.iter().map(|&item| held[item as usize]).collect();
    for batch in pack(&rest_held, plan.copies.len()) {
        let mut ids = [[waste; LANES]; 4];
        let mut pieces = batch;
        for (lane, item) in pieces.iter_mut().enumerate().filter(|(_, item)| **item != NO_PIECE) {
            *item = rest[*item as usize];
            set_lane(&mut ids, lane, &held[*item as usize]);
        }
        plan.pieces.push(pieces);
        plan.nodes.push(ids);
    }
    for piece in plan.pieces.as_flattened_mut().iter_mut().filter(|p| **p != NO_PIECE) {
        *piece = chunk[*piece as usize];
    }
    plan
}

impl ChunkPlan {
    /// Adds as many full pairs of batches of strips as there are among `held`. Their pieces are `single` no longer.
    fn add_strips(&mut self, held: &[[u16; 4]], single: &mut [bool]) {
        let strips = find_strips(held);
        let nodes: Vec<[u16; STRIP_NODES]> = strips.iter().map(|strip| strip.nodes).collect();
        let mut full = pack(&nodes, self.copies.len());
        full.retain(|lanes| !lanes.contains(&NO_PIECE));
        for pair in full.as_chunks::<2>().0 {
            for t in 0..STRIP_TETS {
                for lanes in pair {
                    let strips = lanes.map(|strip| &strips[strip as usize]);
                    let tets = strips.map(|strip| strip.tets[t]);
                    let mut ids = [[0; LANES]; 4];
                    for (lane, strip) in strips.iter().enumerate() {
                        set_lane(&mut ids, lane, &strip.nodes[t..t + 4]);
                    }
                    tets.iter().for_each(|&tet| single[tet as usize] = false);
                    self.corners.push(std::array::from_fn(|l| strips[l].corners(t, &held[tets[l] as usize])));
                    self.pieces.push(tets);
                    self.nodes.push(ids);
                }
            }
        }
    }
}

/// Gives one lane these local numbers.
fn set_lane(ids: &mut [Ids; 4], lane: usize, numbers: &[u16]) {
    for (ids, &number) in ids.iter_mut().zip(numbers) {
        ids[lane] = number;
    }
}

/// First-fit packing of `items`, local numbers below `n_locals`, into batches without a common number,
/// over a short list of open batches. Lanes hold item numbers. The items left at the end are packed
/// regardless of their numbers, which is correct because lanes are summed one after the other.
pub(super) fn pack<const N: usize>(items: &[[u16; N]], n_locals: usize) -> Vec<[u32; LANES]> {
    let mut packing = Packing {
        full: Vec::with_capacity(items.len() / LANES + OPEN_BATCHES),
        batches: [[NO_PIECE; LANES]; OPEN_BATCHES],
        open: Vec::with_capacity(OPEN_BATCHES),
        free: (0..OPEN_BATCHES as u8).rev().collect(),
        held_by: vec![0; n_locals],
    };
    for (item, numbers) in (0u32..).zip(items) {
        packing.put(item, numbers, items);
    }
    let Packing { mut full, batches, open, .. } = packing;
    let left: Vec<u32> =
        open.iter().flat_map(|&(slot, n)| &batches[slot as usize][..n as usize]).copied().collect();
    full.extend(left.chunks(LANES).map(|items| {
        let mut lanes = [NO_PIECE; LANES];
        lanes[..items.len()].copy_from_slice(items);
        lanes
    }));
    full
}

/// State of a packing.
struct Packing {
    full: Vec<[u32; LANES]>,
    batches: [[u32; LANES]; OPEN_BATCHES],
    /// Slot and number of items of the open batches, the oldest first.
    open: Vec<(u8, u8)>,
    /// Slots that are not in use.
    free: Vec<u8>,
    /// For every local number one bit for each slot whose batch holds it.
    held_by: Vec<u32>,
}

impl Packing {
    fn put<const N: usize>(&mut self, item: u32, numbers: &[u16; N], items: &[[u16; N]]) {
        let taken = numbers.iter().fold(0, |taken, &n| taken | self.held_by[n as usize]);
        let at = match self.open.iter().position(|(slot, _)| taken >> slot & 1 == 0) {
            Some(at) => at,
            None => {
                if self.open.len() == OPEN_BATCHES {
                    self.close(0, items);
                }
                let slot = self.free.pop().unwrap_or(0);
                self.open.push((slot, 0));
                self.open.len() - 1
            }
        };
        let (slot, n) = &mut self.open[at];
        self.batches[*slot as usize][*n as usize] = item;
        *n += 1;
        numbers.iter().for_each(|&number| self.held_by[number as usize] |= 1 << *slot);
        if *n as usize == LANES {
            self.close(at, items);
        }
    }

    fn close<const N: usize>(&mut self, at: usize, items: &[[u16; N]]) {
        let (slot, n) = self.open.remove(at);
        let batch = std::mem::replace(&mut self.batches[slot as usize], [NO_PIECE; LANES]);
        for &item in &batch[..n as usize] {
            for &number in &items[item as usize] {
                self.held_by[number as usize] &= !(1 << slot);
            }
        }
        self.full.push(batch);
        self.free.push(slot);
    }
}

/// Rows of the chunks' sums of every copy, in chunk order, within one vector for all chunks. Row 0 of
/// that vector is always 0.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Gather {
    /// First row of every chunk's own sums, and the end. A chunk has rows for its copies, for the waste
    /// bin and for copies that cuts add.
    pub first_row: Vec<u32>,
    /// Two rows per copy, row 0 where there are fewer: nearly all copies have no more.
    pairs: Vec<[u32; 2]>,
    /// (copy, row) of all further rows, in order.
    further: Vec<(u32, u32)>,
    /// `further` of the copies in block b are [first_further[b], first_further[b + 1]).
    first_further: Vec<u32>,
}

impl Gather {
    /// Bytes in use.
    pub(super) fn memory(&self) -> usize {
        size_of_val(&self.first_row[..])
            + size_of_val(&self.pairs[..])
            + size_of_val(&self.further[..])
            + size_of_val(&self.first_further[..])
    }

    /// Lists the rows of every copy. Every chunk gets rows for as many copies again.
    pub(super) fn new<'a>(chunks: impl Iterator<Item = &'a [u32]> + Clone, n_copies: usize) -> Self {
        Self::with_rows(chunks, n_copies, |n| 2 * n + 1)
    }

    /// Lists the rows of every copy; chunks have rows for the copies they have now and no more.
    pub(super) fn without_room<'a>(chunks: impl Iterator<Item = &'a [u32]> + Clone, n_copies: usize) -> Self {
        Self::with_rows(chunks, n_copies, |n| n)
    }

    fn with_rows<'a>(
        chunks: impl Iterator<Item = &'a [u32]> + Clone,
        n_copies: usize,
        rows_of: impl Fn(u32) -> u32,
    ) -> Self {
        let mut gather = Self { first_row: vec![1], ..Self::default() };
        let mut row = 1;
        for copies in chunks.clone() {
            row += rows_of(copies.len() as u32);
            gather.first_row.push(row);
        }
        gather.arrange(chunks, n_copies);
        gather
    }

    /// Lists the rows of every copy anew; chunks keep their rows.
    pub(super) fn arrange<'a>(&mut self, chunks: impl Iterator<Item = &'a [u32]>, n_copies: usize) {
        self.pairs.clear();
        self.further.clear();
        self.append(chunks.zip(0..).map(|(copies, chunk)| (chunk, copies, 0)), n_copies);
    }

    /// Adds copies to chunks, each given by its number, its copies and the index of the first new one.
    pub(super) fn append<'a>(
        &mut self,
        chunks: impl Iterator<Item = (usize, &'a [u32], usize)>,
        n_copies: usize,
    ) {
        resize_reserving(&mut self.pairs, n_copies, [0; 2]);
        for (chunk, copies, known) in chunks {
            let first = self.first_row[chunk];
            for (row, &copy) in (first..).zip(copies).skip(known) {
                let [a, b] = &mut self.pairs[copy as usize];
                let mut row = row;
                // Rows are kept in order, although chunks may come in any order.
                for place in [a, b] {
                    if *place == 0 || row < *place {
                        std::mem::swap(&mut row, place);
                    }
                }
                if row != 0 {
                    self.further.push((copy, row));
                }
            }
        }
        self.further.sort_unstable();
        self.find_blocks(n_copies);
    }

    /// Finds where the further rows of every block begin.
    fn find_blocks(&mut self, n_copies: usize) {
        let before = |b: usize| self.further.partition_point(|&(copy, _)| (copy as usize) < b * BLOCK) as u32;
        self.first_further.clear();
        self.first_further.extend((0..=n_copies.div_ceil(BLOCK)).map(before));
    }

    /// Number of rows of a chunk.
    pub(super) fn room(&self, chunk: usize) -> usize {
        (self.first_row[chunk + 1] - self.first_row[chunk]) as usize
    }

    /// Adds a chunk without copies and with `room` rows behind all others.
    pub(super) fn add_chunk(&mut self, room: usize) {
        self.first_row.push((self.n_rows() + room) as u32);
    }

    /// Replaces the copies of some chunks; each is given with its copies `before`, none for those that had no copies,
    /// and those it has `now`. The rest keeps its rows.
    pub(super) fn replace<'a>(
        &mut self,
        before: impl Iterator<Item = (usize, &'a [u32])>,
        now: impl Iterator<Item = (usize, &'a [u32])>,
        n_copies: usize,
    ) {
        resize_reserving(&mut self.pairs, n_copies, [0; 2]);
        // Rows by copy, with those that go away marked.
        let first = &self.first_row;
        let rows = |(chunk, copies): (usize, &'a [u32])| copies.iter().copied().zip(first[chunk]..);
        let mut changed: Vec<(u32, u32, bool)> =
            before.flat_map(rows).map(|(copy, row)| (copy, row, false)).collect();
        changed.extend(now.flat_map(rows).map(|(copy, row)| (copy, row, true)));
        changed.sort_unstable();
        let (mut further, mut list) = (Vec::new(), Vec::new());
        let mut kept = 0;
        for changed in changed.chunk_by(|a, b| a.0 == b.0) {
            let copy = changed[0].0;
            let begin = kept + self.further[kept..].partition_point(|f| f.0 < copy);
            let end = begin + self.further[begin..].partition_point(|f| f.0 == copy);
            further.extend_from_slice(&self.further[kept..begin]);
            list.clear();
            let known =
                self.pairs[copy as usize].into_iter().chain(self.further[begin..end].iter().map(|f| f.1));
            let stays = |row: &u32| *row != 0 && changed.iter().all(|c| c.1 != *row);
            list.extend(known.filter(stays).chain(changed.iter().filter(|c| c.2).map(|c| c.1)));
            list.sort_unstable();
            self.pairs[copy as usize] = [0, 1].map(|i| list.get(i).copied().unwrap_or(0));
            further.extend(list.iter().skip(2).map(|&row| (copy, row)));
            kept = end;
        }
        further.extend_from_slice(&self.further[kept..]);
        self.further = further;
        self.find_blocks(n_copies);
    }

    /// Whether the rows of every chunk still suffice for its copies and the waste bin.
    pub(super) fn holds<'a>(&self, chunks: impl ExactSizeIterator<Item = &'a [u32]>) -> bool {
        let rooms = self.first_row.windows(2).map(|bounds| (bounds[1] - bounds[0]) as usize);
        rooms.len() == chunks.len() && rooms.zip(chunks).all(|(room, copies)| copies.len() < room)
    }

    /// Number of rows.
    pub(super) fn n_rows(&self) -> usize {
        self.first_row.last().map_or(1, |&end| end as usize)
    }

    /// Adds the sums of the copies of block number `block` to `out`.
    #[inline(always)]
    pub(super) fn add<const N: usize>(&self, block: usize, rows: &[[f32; N]], out: &mut [[f32; N]]) {
        for (out, &[a, b]) in out.iter_mut().zip(self.pairs(block)) {
            let (a, b) = (&rows[a as usize], &rows[b as usize]);
            for i in 0..N {
                out[i] += a[i] + b[i];
            }
        }
        for (copy, row) in self.further(block) {
            for (out, part) in out[copy].iter_mut().zip(&rows[row]) {
                *out += part;
            }
        }
    }

    /// Adds the rows of `copy` to `out`. `further` is 0 at first, and is kept from one call to the next with a higher
    /// number.
    pub(super) fn rows_of(&self, copy: u32, further: &mut usize, out: &mut Vec<u32>) {
        out.extend(self.pairs[copy as usize].into_iter().filter(|row| *row != 0));
        *further += self.further[*further..].partition_point(|f| f.0 < copy);
        out.extend(self.further[*further..].iter().take_while(|f| f.0 == copy).map(|f| f.1));
    }

    /// The first two rows of every copy of block number `block`; row 0 where there are fewer.
    #[inline(always)]
    pub(super) fn pairs(&self, block: usize) -> &[[u32; 2]] {
        &self.pairs[block * BLOCK..((block + 1) * BLOCK).min(self.pairs.len())]
    }

    /// The rows that [`Self::pairs`] leaves out: copy within the block, and row.
    #[inline(always)]
    pub(super) fn further(&self, block: usize) -> impl Iterator<Item = (usize, usize)> {
        let further = self.first_further[block] as usize..self.first_further[block + 1] as usize;
        self.further[further].iter().map(move |&(copy, row)| (copy as usize - block * BLOCK, row as usize))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    use super::super::groups::Groups;
    use super::super::strips::corners_of;
    use scindo_matter::cut::Piece;
    use scindo_matter::material::Regions;
    use scindo_matter::mesh::{BoxPattern, box_mesh};

    #[test]
    fn every_piece_is_in_one_lane_and_few_batches_share_a_copy() {
        let pattern = BoxPattern::Tet5 { parity: false };
        let mesh = box_mesh(Vector3::zeros(), Vector3::new(1.0, 0.2, 0.2), [40, 8, 8], pattern);
        let pieces: Vec<Piece> = (0..mesh.tets.len())
            .map(|e| Piece { element: e as u32, fraction: 1.0, copies: mesh.tets[e] })
            .collect();
        let centres: Vec<_> =
            (0..mesh.tets.len()).map(|e| mesh.corners(e).iter().sum::<Vector3<f64>>() / 4.0).collect();
        let groups = Groups::new(&centres, &Regions::default());
        let plans: Vec<ChunkPlan> = (0..groups.len())
            .map(|k| (0..pieces.len() as u32).filter(|&p| groups.of(p) == k).collect::<Vec<u32>>())
            .map(|chunk| plan_chunk(&chunk, |p| pieces[p as usize].copies))
            .collect();
        let mut seen = vec![0; pieces.len()];
        let (mut batches, mut shared, mut in_strips) = (0, 0, 0);
        for plan in &plans {
            batches += plan.pieces.len();
            in_strips += plan.corners.len() * LANES;
            assert_eq!(plan.corners.len() % 6, 0);
            for (b, (lanes, nodes)) in plan.pieces.iter().zip(&plan.nodes).enumerate() {
                let mut used: Vec<u32> = Vec::new();
                for lane in 0..LANES {
                    if lanes[lane] != NO_PIECE {
                        seen[lanes[lane] as usize] += 1;
                        for (a, ids) in nodes.iter().enumerate() {
                            let copy = plan.copies[ids[lane] as usize];
                            let corner = corners_of(&plan.corners, b, lane)[a] as usize;
                            assert_eq!(copy, pieces[lanes[lane] as usize].copies[corner]);
                            shared += usize::from(used.contains(&copy));
                            used.push(copy);
                        }
                    }
                }
            }
        }
        assert!(seen.iter().all(|&n| n == 1));
        assert!(batches * LANES < pieces.len() + LANES * plans.len(), "{batches} batches");
        assert!(in_strips as f64 > 0.9 * pieces.len() as f64, "{in_strips} pieces in strips");
        assert!(shared < pieces.len() / 10, "{shared} copies are shared within batches");
        let gather = Gather::new(plans.iter().map(|p| &p.copies[..]), mesh.nodes.len());
        let mut rows = vec![[0.0_f32; 2]; gather.n_rows()];
        let mut expected = vec![[0.0_f32; 2]; mesh.nodes.len()];
        for (k, plan) in plans.iter().enumerate() {
            for (l, &copy) in plan.copies.iter().enumerate() {
                let part = [1.0, (k * copy as usize) as f32];
                rows[gather.first_row[k] as usize + l] = part;
                (0..2).for_each(|i| expected[copy as usize][i] += part[i]);
            }
        }
        let mut sums = vec![[0.0_f32; 2]; mesh.nodes.len()];
        for (block, sums) in sums.chunks_mut(BLOCK).enumerate() {
            gather.add(block, &rows, sums);
        }
        assert_eq!(sums, expected);
    }

    #[test]
    fn copies_that_are_added_to_chunks_come_where_they_would_have_been_listed() {
        let before: [&[u32]; 3] = [&[0, 1, 2], &[1, 2, 3], &[1, 2, 3]];
        let after: [&[u32]; 3] = [&[0, 1, 2, 4, 5, 6], &[1, 2, 3, 5], &[1, 2, 3, 4, 5]];
        let mut gather = Gather::new(before.into_iter(), 4);
        assert!(gather.holds(after.into_iter()) && !gather.holds(before.into_iter().take(2)));
        assert!(!gather.holds([&[0; 7], before[1], before[2]].into_iter()));
        let mut listed = gather.clone();
        listed.arrange(after.into_iter(), 7);
        gather.append([2, 0, 1].into_iter().map(|k| (k, after[k], 3)), 7);
        assert_eq!((&gather.pairs, &gather.further), (&listed.pairs, &listed.further));
        assert_eq!(gather.first_further, listed.first_further);
        assert_eq!(gather.pairs[5], [gather.first_row[0] + 4, gather.first_row[1] + 3]);
        assert_eq!(gather.further.last(), Some(&(5, gather.first_row[2] + 4)));
    }
}
