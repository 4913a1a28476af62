//! Marks on numbered things: a set that is cleared at once, and a set that is read out in order.

/// A set of numbers; clearing it costs nothing.
#[derive(Clone, Debug, Default)]
pub struct Marks {
    stamp: u32,
    of: Vec<u32>,
}

impl Marks {
    /// Takes off all marks; the numbers are below `n` from now on.
    pub fn restart(&mut self, n: usize) {
        self.stamp += 1;
        self.of.resize(n, 0);
    }

    /// Marks `i`; says whether it had no mark.
    pub fn insert(&mut self, i: u32) -> bool {
        let i = i as usize;
        if i >= self.of.len() {
            self.of.resize(i + 1 + i / 8, 0);
        }
        std::mem::replace(&mut self.of[i], self.stamp) != self.stamp
    }

    /// Takes off the mark of `i`.
    pub fn remove(&mut self, i: u32) {
        if let Some(mark) = self.of.get_mut(i as usize) {
            *mark = 0;
        }
    }

    /// Whether `i` has a mark.
    pub fn contains(&self, i: u32) -> bool {
        self.of.get(i as usize) == Some(&self.stamp)
    }
}

/// Puts numbers in order by setting a bit for each, without comparing any.
#[derive(Clone, Debug, Default)]
pub struct Ascending {
    bits: Vec<u64>,
}

impl Ascending {
    /// Sorts `numbers` and leaves each once.
    pub fn sort(&mut self, numbers: &mut Vec<u32>) {
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
    fn a_mark_that_was_taken_off_can_be_set_again() {
        let mut marks = Marks::default();
        marks.restart(2);
        assert!(marks.insert(1) && !marks.insert(1) && marks.contains(1) && !marks.contains(0));
        marks.remove(1);
        assert!(!marks.contains(1) && marks.insert(1) && marks.insert(9) && marks.contains(9));
        marks.restart(2);
        assert!(!marks.contains(1) && !marks.contains(9) && marks.insert(1));
    }
}
