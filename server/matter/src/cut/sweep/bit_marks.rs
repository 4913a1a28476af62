//! Marks on numbered items, cleared all at once, and a sort without comparisons.

use crate::storage::reserve::reserved;

/// Up to eight kinds of marks per item, one bit each. One byte per item keeps the marks of a whole body in
/// the cache. Clearing costs as much as setting did.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(crate) struct BitMarks {
    of: Vec<u8>,
    marked: Vec<u32>,
}

impl BitMarks {
    /// Reserves memory for items below `n`, for half as many again, and for an eighth of them marked at a
    /// time.
    pub(crate) fn with_capacity(n: usize) -> Self {
        Self { of: reserved(n + n / 2, 0), marked: reserved(n / 8, 0) }
    }

    /// Clears all marks. Items are numbered below `n` from now on.
    pub(crate) fn restart(&mut self, n: usize) {
        self.marked.drain(..).for_each(|i| self.of[i as usize] = 0);
        self.of.resize(n, 0);
    }

    /// Sets `mark` on `i` and returns whether it was not set before.
    pub(crate) fn insert(&mut self, i: u32, mark: u8) -> bool {
        let at = i as usize;
        if at >= self.of.len() {
            self.of.resize(at + 1 + at / 8, 0);
        }
        let before = self.of[at];
        if before == 0 {
            self.marked.push(i);
        }
        self.of[at] = before | mark;
        before & mark == 0
    }

    /// Clears `mark` on `i`, which must have been marked before.
    pub(crate) fn remove(&mut self, i: u32, mark: u8) {
        self.of[i as usize] &= !mark;
    }

    /// Whether `mark` is set on `i`, which must have been marked before.
    pub(crate) fn contains(&self, i: u32, mark: u8) -> bool {
        self.of[i as usize] & mark != 0
    }
}

/// Sorts numbers by setting one bit for each, without comparing any.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(crate) struct Ascending {
    bits: Vec<u64>,
}

impl Ascending {
    /// Sorts `numbers` and removes duplicates.
    pub(crate) fn sort(&mut self, numbers: &mut Vec<u32>) {
        let [mut first, mut end] = [self.bits.len(), 0];
        for &i in numbers.iter() {
            let word = i as usize / 64;
            if word >= self.bits.len() {
                self.bits.resize(word + 1, 0);
            }
            self.bits[word] |= 1 << (i % 64);
            (first, end) = (first.min(word), end.max(word + 1));
        }
        numbers.clear();
        for word in first..end {
            let mut bits = std::mem::take(&mut self.bits[word]);
            while bits != 0 {
                numbers.push(64 * word as u32 + bits.trailing_zeros());
                bits &= bits - 1;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_come_out_in_order_and_once() {
        let mut order = Ascending::default();
        for numbers in [vec![], vec![7], vec![200, 3, 64, 63, 3, 200, 0, 129], vec![64, 64]] {
            let mut expected = numbers.clone();
            expected.sort_unstable();
            expected.dedup();
            let mut found = numbers;
            order.sort(&mut found);
            assert_eq!(found, expected);
        }
    }

    #[test]
    fn marks_of_different_kinds_come_and_go_on_their_own() {
        let mut marks = BitMarks::default();
        marks.restart(2);
        assert!(marks.insert(1, 1) && !marks.insert(1, 1) && marks.insert(1, 4));
        marks.remove(1, 1);
        assert!(!marks.contains(1, 1) && marks.contains(1, 4) && marks.insert(1, 1));
        assert!(marks.insert(9, 1));
        marks.remove(9, 1);
        assert!(marks.insert(9, 2));
        marks.restart(12);
        assert!([1, 9].iter().all(|&i| !marks.contains(i, 7)) && marks.insert(9, 2));
    }
}
