//! Arrays of which a change copies only the neighbourhood, as pages.

/// Entries of a page. Neighbours mostly have close numbers, so a change of one is a change of many.
const PAGE: usize = 32;

/// Changes to an array that is kept elsewhere, and entries appended to it.
#[derive(Clone, Debug)]
pub(super) struct Paged<T> {
    /// A page is `None` as long as nothing on it has changed.
    pages: Vec<Option<Vec<T>>>,
    len: usize,
}

impl<T: Clone> Paged<T> {
    /// No change to an array of this length.
    pub(super) fn new(len: usize) -> Self {
        Self { pages: vec![None; len.div_ceil(PAGE)], len }
    }

    /// Number of entries, including those appended.
    pub(super) fn len(&self) -> usize {
        self.len
    }

    /// Number of entries copied or appended so far.
    pub(super) fn copied(&self) -> usize {
        self.pages.iter().flatten().map(Vec::len).sum()
    }

    /// Entry `i`; `None` if it is as it was.
    pub(super) fn get(&self, i: u32) -> Option<&T> {
        let page = self.pages[i as usize / PAGE].as_ref()?;
        page.get(i as usize % PAGE)
    }

    /// Entry `i`, to be changed. `before` gives the entries as they were.
    pub(super) fn change(&mut self, i: u32, before: impl Fn(u32) -> T) -> &mut T {
        let (page, at) = (i as usize / PAGE, i as usize % PAGE);
        &mut self.page(page, before)[at]
    }

    /// Appends an entry.
    pub(super) fn push(&mut self, entry: T, before: impl Fn(u32) -> T) {
        let page = self.len / PAGE;
        if page == self.pages.len() {
            self.pages.push(Some(Vec::with_capacity(PAGE)));
        }
        self.page(page, before).push(entry);
        self.len += 1;
    }

    /// Removes the last entry, which must have been appended.
    pub(super) fn pop(&mut self) {
        if let Some(Some(page)) = self.pages.last_mut() {
            page.pop();
            self.len -= 1;
            if self.len.is_multiple_of(PAGE) {
                self.pages.pop();
            }
        }
    }

    fn page(&mut self, page: usize, before: impl Fn(u32) -> T) -> &mut Vec<T> {
        let entries = page * PAGE..self.len.min((page + 1) * PAGE);
        self.pages[page].get_or_insert_with(|| entries.map(|i| before(i as u32)).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changed_and_appended_entries_are_those_of_a_plain_array() {
        for len in [0, 31, 32, 33, 1000] {
            let whole: Vec<u32> = (0..len as u32).map(|i| 7 * i).collect();
            let before = |i: u32| whole[i as usize];
            let (mut paged, mut plain) = (Paged::new(len), whole.clone());
            for k in 0..200u32 {
                if k % 3 == 0 {
                    paged.push(k, before);
                    plain.push(k);
                } else if k % 7 == 0 {
                    paged.pop();
                    plain.pop();
                } else {
                    let i = 13 * k % plain.len() as u32;
                    *paged.change(i, before) += k;
                    plain[i as usize] += k;
                }
            }
            assert_eq!(paged.len(), plain.len());
            let entry = |i: u32| paged.get(i).copied().unwrap_or_else(|| before(i));
            assert!((0u32..).zip(&plain).all(|(i, &value)| entry(i) == value), "length {len}");
        }
    }

    #[test]
    fn one_change_copies_one_page() {
        let mut paged = Paged::new(100_000);
        *paged.change(70_000, |i| i) = 1;
        assert_eq!((paged.copied(), paged.get(70_000), paged.get(40_000)), (PAGE, Some(&1), None));
    }
}
