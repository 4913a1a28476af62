//! Where incisions cross fragment edges that are not separated yet.
//!
//! There is one parameter per edge and incision. It is computed once, by the first crossing, and shared by
//! every fragment around the edge. It is the same in the rest and in the deformed configuration, because the
//! map is affine on a piece.

use crate::storage::reserve::reserve_half_again;
use std::collections::hash_map::Entry;
use std::collections::{HashMap, HashSet};
use std::hash::{BuildHasherDefault, Hasher};

/// A crossing closer than this to an end of its edge, relative to the edge, is the end itself.
///
/// Two crossings closer than this would make slivers that carry nothing but rounding errors. It is
/// far above rounding (1e-16) and far below what a blade resolves.
pub(crate) const SNAP: f64 = 1e-6;

/// Multiplicative hash of an edge key. The keys come from this program, so they need no defence against
/// flooding.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct EdgeHasher(u64);

impl Hasher for EdgeHasher {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, bytes: &[u8]) {
        for &b in bytes {
            self.write_u64(u64::from(b));
        }
    }

    fn write_u64(&mut self, key: u64) {
        self.0 = (self.0.rotate_left(5) ^ key).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        self.0 ^= self.0 >> 32;
    }
}

/// Set of edge keys.
pub(crate) type EdgeSet = HashSet<u64, BuildHasherDefault<EdgeHasher>>;

/// The key of the edge between two vertices, independent of their order.
pub(crate) fn edge_key(a: u32, b: u32) -> u64 {
    u64::from(a.min(b)) << 32 | u64::from(a.max(b))
}

/// Crossings of edges that are not separated yet.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(crate) struct Crossings {
    by_edge: HashMap<u64, OfEdge, BuildHasherDefault<EdgeHasher>>,
    /// Per vertex whether an edge at it was ever crossed; vertices beyond the end have none. Most vertices in
    /// question lie on a sheet and have no such edge, which saves a look into the table.
    at_vertex: Vec<bool>,
}

/// The crossings of one edge: incision, and parameter from the vertex with the smaller id.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
struct OfEdge {
    first: (u32, f64),
    /// All crossings but the first. Hardly any edge has them.
    further: Vec<(u32, f64)>,
}

impl Crossings {
    /// Reserves memory for a cut through a body of `n_nodes` nodes.
    pub(crate) fn with_capacity(n_nodes: usize) -> Self {
        let mut crossings = Self { at_vertex: vec![false; n_nodes], ..Self::default() };
        crossings.by_edge.reserve(n_nodes / 8);
        reserve_half_again(&mut crossings.at_vertex);
        crossings
    }

    /// Whether any edge at vertex `v` was ever crossed.
    pub(crate) fn reach(&self, v: u32) -> bool {
        self.at_vertex.get(v as usize) == Some(&true)
    }

    fn of_edge(&self, a: u32, b: u32) -> Option<&OfEdge> {
        if self.reach(a) && self.reach(b) { self.by_edge.get(&edge_key(a, b)) } else { None }
    }

    /// Parameter from `a` to `b` at which the incision crosses the edge.
    pub(crate) fn get(&self, a: u32, b: u32, incision: u32) -> Option<f64> {
        let OfEdge { first, further } = self.of_edge(a, b)?;
        let t = if first.0 == incision { first.1 } else { further.iter().find(|c| c.0 == incision)?.1 };
        Some(if a < b { t } else { 1.0 - t })
    }

    /// All crossings of the edge, with parameters from the vertex with the smaller id.
    pub(crate) fn of(&self, a: u32, b: u32) -> impl Iterator<Item = (u32, f64)> + '_ {
        let found = self.of_edge(a, b);
        found.into_iter().flat_map(|of| std::iter::once(of.first).chain(of.further.iter().copied()))
    }

    /// Records a crossing at `t` from `a` to `b`. An earlier crossing by the same incision stays.
    pub(crate) fn insert(&mut self, a: u32, b: u32, incision: u32, t: f64) {
        let t = if a < b { t } else { 1.0 - t };
        let last = a.max(b) as usize;
        if last >= self.at_vertex.len() {
            self.at_vertex.resize(last + 1, false);
        }
        [a, b].iter().for_each(|&v| self.at_vertex[v as usize] = true);
        match self.by_edge.entry(edge_key(a, b)) {
            Entry::Vacant(none) => {
                none.insert(OfEdge { first: (incision, t), further: Vec::new() });
            }
            Entry::Occupied(mut of) => {
                let OfEdge { first, further } = of.get_mut();
                if first.0 != incision && further.iter().all(|c| c.0 != incision) {
                    further.push((incision, t));
                }
            }
        }
    }

    /// Gives the edge (new, other) the crossings of the edge (old, other).
    pub(crate) fn inherit(&mut self, old: u32, new: u32, other: u32) {
        let Some(of) = self.of_edge(old, other) else { return };
        let OfEdge { first, further } = of.clone(); // hardly ever with more than nothing in `further`
        for (incision, t) in std::iter::once(first).chain(further) {
            self.insert(new, other, incision, if old < other { t } else { 1.0 - t });
        }
    }
}
