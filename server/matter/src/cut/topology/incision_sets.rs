//! Sets of incision ids, each stored once and named by a number.
//!
//! Nearly every vertex and face lies on no incision or on one. A table of the few distinct sets keeps the
//! record per vertex at four bytes.

use std::collections::BTreeMap;

/// Table of distinct sets. A set is identified by its index here.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub(crate) struct IncisionSets {
    sets: Vec<Vec<u32>>,
    /// Per set its member if it has exactly one, else 0, which is no incision.
    only: Vec<u32>,
    ids: BTreeMap<Vec<u32>, u32>,
    /// The incision last added to the empty set, and the set of it alone.
    latest: [u32; 2],
}

impl Default for IncisionSets {
    fn default() -> Self {
        let ids = BTreeMap::from([(Vec::new(), Self::EMPTY)]);
        Self { sets: vec![Vec::new()], only: vec![0], ids, latest: [0, Self::EMPTY] }
    }
}

impl IncisionSets {
    /// The empty set.
    pub(crate) const EMPTY: u32 = 0;

    /// Whether the incision is in the set.
    #[inline]
    pub(crate) fn contains(&self, set: u32, incision: u32) -> bool {
        match set {
            Self::EMPTY => false,
            _ if self.only[set as usize] != 0 => self.only[set as usize] == incision,
            _ => self.sets[set as usize].contains(&incision),
        }
    }

    /// The set with the incision added to it.
    pub(crate) fn with(&mut self, set: u32, incision: u32) -> u32 {
        if self.contains(set, incision) {
            return set;
        }
        if set == Self::EMPTY {
            // The same incision is asked for again and again while its sweep is separated.
            if self.latest[0] != incision {
                self.latest = [incision, self.id_of(vec![incision])];
            }
            return self.latest[1];
        }
        let mut members = self.sets[set as usize].clone();
        members.push(incision);
        members.sort_unstable();
        self.id_of(members)
    }

    /// The intersection of two sets.
    pub(crate) fn both(&mut self, p: u32, q: u32) -> u32 {
        if p == q || p == Self::EMPTY {
            return p;
        }
        if q == Self::EMPTY {
            return q;
        }
        let other = &self.sets[q as usize];
        let members = self.sets[p as usize].iter().copied().filter(|s| other.contains(s)).collect();
        self.id_of(members)
    }

    fn id_of(&mut self, members: Vec<u32>) -> u32 {
        if let Some(&id) = self.ids.get(&members) {
            return id;
        }
        let id = self.sets.len() as u32;
        self.sets.push(members.clone());
        self.only.push(if let [only] = members[..] { only } else { 0 });
        self.ids.insert(members, id);
        id
    }
}
