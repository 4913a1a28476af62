//! Where the members of a short list are, out of very many numbered things.

use crate::reserve::resize_reserving;

/// The place of things in a list. It is never cleared: a place counts if the list has the thing there.
#[derive(Clone, Debug, Default)]
pub struct Numbering {
    place: Vec<u32>,
}

impl Numbering {
    /// Room for things with numbers below `n`, and half as many again.
    pub fn with_capacity(n: usize) -> Self {
        let mut place = Vec::new();
        resize_reserving(&mut place, n, 0);
        Self { place }
    }

    /// Takes down where the things of `list` from `first` on are.
    pub fn note(&mut self, list: &[u32], first: usize) {
        for (place, &thing) in (first as u32..).zip(&list[first..]) {
            if thing as usize >= self.place.len() {
                resize_reserving(&mut self.place, thing as usize + 1, 0);
            }
            self.place[thing as usize] = place;
        }
    }

    /// Where the thing is in `list`, all of which was noted.
    #[inline]
    pub fn find(&self, list: &[u32], thing: u32) -> Option<usize> {
        let place = *self.place.get(thing as usize)? as usize;
        (list.get(place) == Some(&thing)).then_some(place)
    }

    /// Appends the thing to `list`, all of which was noted, unless it is in it; says whether it was not.
    pub fn insert(&mut self, list: &mut Vec<u32>, thing: u32) -> bool {
        if self.find(list, thing).is_some() {
            return false;
        }
        list.push(thing);
        self.note(list, list.len() - 1);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_what_is_in_the_list_and_nothing_else() {
        let mut numbering = Numbering::default();
        let mut list = vec![9, 4];
        numbering.note(&list, 0);
        assert!(numbering.insert(&mut list, 7) && !numbering.insert(&mut list, 4));
        assert_eq!(list, [9, 4, 7]);
        let found = [9, 4, 7, 0, 100].map(|thing| numbering.find(&list, thing));
        assert_eq!(found, [Some(0), Some(1), Some(2), None, None]);
        // Another list: what was noted for the first one does not count.
        numbering.note(&[7], 0);
        assert_eq!([9, 7, 4].map(|thing| numbering.find(&[7], thing)), [None, Some(0), None]);
    }
}
