//! Positions of numbered items in a short list, found without a search.

use crate::storage::reserve::resize_reserving;

/// Position of every item in a list. It is never cleared: a position is valid if the list has the item there.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct Numbering {
    place: Vec<u32>,
}

impl Numbering {
    /// Reserves memory for items with numbers below `n`, and for half as many again.
    pub fn with_capacity(n: usize) -> Self {
        let mut place = Vec::new();
        resize_reserving(&mut place, n, 0);
        Self { place }
    }

    /// Notes the positions of the items of `list` from `first` on.
    pub fn note(&mut self, list: &[u32], first: usize) {
        for (place, &thing) in (first as u32..).zip(&list[first..]) {
            if thing as usize >= self.place.len() {
                resize_reserving(&mut self.place, thing as usize + 1, 0);
            }
            self.place[thing as usize] = place;
        }
    }

    /// Position of `thing` in `list`, all of which must have been noted.
    #[inline]
    pub fn find(&self, list: &[u32], thing: u32) -> Option<usize> {
        let place = *self.place.get(thing as usize)? as usize;
        (list.get(place) == Some(&thing)).then_some(place)
    }

    /// Appends `thing` to `list`, all of which must have been noted, unless it is there. Returns whether
    /// it was appended.
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
        // Another list: positions noted for the first one are not valid in it.
        numbering.note(&[7], 0);
        assert_eq!([9, 7, 4].map(|thing| numbering.find(&[7], thing)), [None, Some(0), None]);
    }
}
