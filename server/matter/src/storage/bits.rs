//! Sets of numbers, one bit each. For sets of cells in space see [`octree::Bits`](crate::octree::Bits).

/// A set of numbers.
#[derive(Clone, Debug)]
pub struct Bits(Vec<u64>);

/// How many numbers of a set are below a number.
#[derive(Clone, Debug)]
pub struct Ranks<'a> {
    set: &'a Bits,
    /// Numbers of the set before each word.
    before: Vec<u32>,
    count: usize,
}

impl Bits {
    /// The empty set, with room for the numbers below `n`.
    pub fn new(n: usize) -> Self {
        Self(vec![0; n.div_ceil(64)])
    }

    /// Whether number `i` is in the set.
    pub fn has(&self, i: u32) -> bool {
        self.0.get(i as usize / 64).is_some_and(|word| word >> (i % 64) & 1 == 1)
    }

    /// Adds a number; returns whether it was not there.
    pub fn insert(&mut self, i: u32) -> bool {
        if self.0.len() <= i as usize / 64 {
            self.0.resize(i as usize / 64 + 1, 0);
        }
        let (word, bit) = (&mut self.0[i as usize / 64], 1 << (i % 64));
        let new = *word & bit == 0;
        *word |= bit;
        new
    }

    /// Whether all numbers are in `other`, which has room for as many.
    pub fn is_within(&self, other: &Self) -> bool {
        self.0.iter().zip(&other.0).all(|(own, other)| own & !other == 0)
    }

    /// The numbers, ascending.
    pub fn iter(&self) -> impl Iterator<Item = u32> {
        let left = |word: u64| Some(word).filter(|word| *word != 0);
        (0u32..).zip(&self.0).flat_map(move |(w, &word)| {
            let words = std::iter::successors(left(word), move |word| left(word & (word - 1)));
            words.map(move |word| 64 * w + word.trailing_zeros())
        })
    }

    /// The ranks of its numbers.
    pub fn ranks(&self) -> Ranks<'_> {
        let mut count = 0;
        let mut counted = |word: &u64| {
            let before = count;
            count += word.count_ones();
            before
        };
        let before = self.0.iter().map(&mut counted).collect();
        Ranks { set: self, before, count: count as usize }
    }
}

impl Extend<u32> for Bits {
    fn extend<I: IntoIterator<Item = u32>>(&mut self, numbers: I) {
        for i in numbers {
            self.insert(i);
        }
    }
}

impl Ranks<'_> {
    /// Size of the set.
    pub fn count(&self) -> usize {
        self.count
    }

    /// How many numbers of the set are below `i`, which is one of them.
    #[inline]
    pub fn of(&self, i: u32) -> u32 {
        let (word, below) = (self.set.0[i as usize / 64], (1 << (i % 64)) - 1);
        self.before[i as usize / 64] + (word & below).count_ones()
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn a_set_of_bits_is_a_set() {
        let (mut bits, mut known) = (Bits::new(100), BTreeSet::new());
        for round in 0..500_u32 {
            let i = (round.wrapping_mul(2_654_435_761) >> 16) % 1000;
            assert_eq!(bits.insert(i), known.insert(i));
        }
        assert!(bits.iter().eq(known.iter().copied()));
        assert!((0..1200).all(|i| bits.has(i) == known.contains(&i)));
        let ranks = bits.ranks();
        assert_eq!(ranks.count(), known.len());
        assert!(known.iter().enumerate().all(|(rank, i)| ranks.of(*i) == rank as u32));
        let mut part = Bits::new(1000);
        assert!(part.insert(known.iter().copied().next().unwrap_or(0)) && part.is_within(&bits));
        assert!(!bits.is_within(&part));
    }
}
