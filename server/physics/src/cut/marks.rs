//! Marks on numbered things that are all taken off at once.

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
}
