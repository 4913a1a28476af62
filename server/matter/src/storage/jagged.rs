//! Lists of different lengths in one vector, each of which can be replaced.

use super::bits::Bits;
use super::reserve::reserve_half_again;

/// Lists by number. One that has grown moves to the end of the vector and leaves a gap; gaps are closed when they
/// take up more than a half.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct Jagged<T> {
    /// Begin and end of every list.
    ranges: Vec<[u32; 2]>,
    entries: Vec<T>,
    /// Entries that belong to no list.
    unused: usize,
}

/// Fewer gaps than this many entries stay.
const LEAST_GAPS: usize = 4096;

/// New lists have room for this fraction of their entries again.
const SPARE: usize = 8;

impl<T: Copy> Jagged<T> {
    /// Lists one after the other: list i has the entries `first[i]` … `first[i + 1]` − 1.
    pub fn new(first: &[u32], entries: Vec<T>) -> Self {
        let ranges = first.windows(2).map(|ends| [ends[0], ends[1]]).collect();
        Self { ranges, entries, unused: 0 }
    }

    /// Counts `n` lists, then fills them: `visit` is called twice and gives number and entry, in the order in which
    /// a list holds them.
    pub fn by_counting(n: usize, visit: impl Fn(&mut dyn FnMut(u32, T)), none: T) -> Self {
        let mut first = vec![0_u32; n + 1];
        visit(&mut |list, _| first[list as usize + 1] += 1);
        for i in 0..n {
            first[i + 1] += first[i];
        }
        let mut next = first.clone();
        // Spare capacity for the first changes, so that they need not move all of it.
        let (used, spare) = (first[n] as usize, first[n] as usize / SPARE);
        let mut entries = vec![none; used + spare];
        entries.truncate(used);
        visit(&mut |list, entry| {
            let place = &mut next[list as usize];
            entries[*place as usize] = entry;
            *place += 1;
        });
        Self::new(&first, entries)
    }

    /// Number of lists.
    pub fn len(&self) -> usize {
        self.ranges.len()
    }

    /// Whether there are no lists.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// List `i`.
    #[inline]
    pub fn get(&self, i: usize) -> &[T] {
        let [begin, end] = self.ranges[i];
        &self.entries[begin as usize..end as usize]
    }

    /// Adds empty lists until there are `n`.
    pub fn grow(&mut self, n: usize) {
        self.ranges.resize(n.max(self.ranges.len()), [0; 2]);
    }

    /// Replaces list `i`.
    pub fn set(&mut self, i: usize, list: &[T]) {
        let [begin, end] = self.ranges[i];
        let known = (end - begin) as usize;
        let begin = if list.len() <= known {
            self.unused += known - list.len();
            let begin = begin as usize;
            self.entries[begin..begin + list.len()].copy_from_slice(list);
            begin
        } else {
            self.unused += known;
            if self.entries.len() + list.len() > self.entries.capacity() {
                reserve_half_again(&mut self.entries);
            }
            let begin = self.entries.len();
            self.entries.extend_from_slice(list);
            begin
        };
        self.ranges[i] = [begin as u32, (begin + list.len()) as u32];
        if self.unused > LEAST_GAPS && self.unused > self.entries.len() / 2 {
            self.close_gaps();
        }
    }

    /// Applies `edits`: each names a list, an entry, and whether the entry comes to the list or leaves it. Lists are
    /// ordered by `key`, which tells entries of a list apart; one that comes replaces one with its key.
    pub fn edit(&mut self, edits: &[(u32, T, bool)], key: impl Fn(&T) -> u32) {
        let Some(&none) = edits.first() else { return };
        let mut lists = Bits::new(self.len());
        lists.extend(edits.iter().map(|edit| edit.0));
        let ranks = lists.ranks();
        let by_list = |visit: &mut dyn FnMut(u32, (u32, T, bool))| {
            edits.iter().for_each(|edit| visit(ranks.of(edit.0), *edit));
        };
        let of_lists = Jagged::by_counting(ranks.count(), by_list, none);
        let (mut edits, mut list) = (Vec::new(), Vec::new());
        for rank in 0..of_lists.len() {
            edits.clear();
            edits.extend_from_slice(of_lists.get(rank));
            edits.sort_unstable_by_key(|edit: &(u32, T, bool)| key(&edit.1));
            let i = edits[0].0 as usize;
            list.clear();
            let is_edited = |entry: &T| edits.binary_search_by_key(&key(entry), |edit| key(&edit.1)).is_ok();
            list.extend(self.get(i).iter().filter(|entry| !is_edited(entry)));
            list.extend(edits.iter().filter(|edit| edit.2).map(|edit| edit.1));
            list.sort_unstable_by_key(&key);
            self.set(i, &list);
        }
    }

    fn close_gaps(&mut self) {
        let mut entries = Vec::with_capacity(self.entries.len());
        for range in &mut self.ranges {
            let begin = entries.len() as u32;
            entries.extend_from_slice(&self.entries[range[0] as usize..range[1] as usize]);
            *range = [begin, entries.len() as u32];
        }
        (self.entries, self.unused) = (entries, 0);
    }

    /// Bytes in use.
    pub fn memory(&self) -> usize {
        size_of_val(&self.ranges[..]) + size_of_val(&self.entries[..])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_that_change_many_times_are_those_of_a_vector_of_vectors() {
        let mut known: Vec<Vec<u32>> = (0..50).map(|i| (0..i % 7).collect()).collect();
        let mut lists = Jagged::by_counting(
            50,
            |out| (0..50).for_each(|i| (0..i % 7).for_each(|entry| out(i, entry))),
            0,
        );
        let mut most = 0;
        for round in 0..20_000_u32 {
            let i = (round.wrapping_mul(2_654_435_761) >> 16) as usize % known.len();
            let list: Vec<u32> = (0..(round / 3) % 11).map(|k| k + round).collect();
            lists.set(i, &list);
            known[i] = list;
            if round % 1000 == 0 {
                known.push(Vec::new());
                lists.grow(known.len());
            }
            most = most.max(lists.entries.len());
        }
        assert_eq!(lists.len(), known.len());
        assert!(known.iter().enumerate().all(|(i, list)| lists.get(i) == &list[..]));
        // Without closing gaps there would be 50,000 entries and more.
        assert!(most < 2 * (LEAST_GAPS + 1000), "{most} entries");
    }

    #[test]
    fn edits_keep_lists_in_order() {
        let mut lists = Jagged::new(&[0, 3, 5], vec![(1, 'a'), (4, 'b'), (9, 'c'), (2, 'd'), (3, 'e')]);
        let edits = [
            (1, (0, 'f'), true),
            (0, (4, 'g'), true),
            (0, (4, 'b'), false),
            (0, (9, 'c'), false),
            (1, (7, 'h'), true),
        ];
        lists.edit(&edits, |entry| entry.0);
        assert_eq!(lists.get(0), [(1, 'a'), (4, 'g')]);
        assert_eq!(lists.get(1), [(0, 'f'), (2, 'd'), (3, 'e'), (7, 'h')]);
    }
}
