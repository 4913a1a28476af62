//! Spare capacity of vectors, for what cuts add.
//!
//! Memory that was never written to has no pages yet, and a cut made within milliseconds would wait for
//! each of them. So spare capacity is written to when it is reserved.

/// Resizes `v` to `n` entries. If it has to move, it gets spare capacity for half as many again.
pub fn resize_reserving<T: Clone>(v: &mut Vec<T>, n: usize, value: T) {
    if n > v.capacity() {
        v.reserve_exact(n + n / 2 - v.len());
        v.resize(n + n / 2, value.clone());
    }
    v.resize(n, value);
}

/// Replaces all entries of `v`. If it has to move, it gets spare capacity for half as many again.
pub fn refill<T: Clone>(v: &mut Vec<T>, mut entries: impl ExactSizeIterator<Item = T>) {
    v.clear();
    if entries.len() > v.capacity()
        && let Some(first) = entries.next()
    {
        let n = entries.len() + 1;
        resize_reserving(v, n, first);
        v.truncate(1);
    }
    v.extend(entries);
}

/// Adds spare capacity for half as many entries again.
pub fn reserve_half_again<T: Copy>(entries: &mut Vec<T>) {
    let n = entries.len();
    if let Some(&last) = entries.last() {
        entries.reserve_exact(n / 2);
        entries.resize(n + n / 2, last);
        entries.truncate(n);
    }
}

/// An empty vector with spare capacity for `n` entries.
pub fn reserved<T: Copy>(n: usize, entry: T) -> Vec<T> {
    let mut entries = Vec::new();
    entries.resize(n, entry);
    entries.clear();
    entries
}
