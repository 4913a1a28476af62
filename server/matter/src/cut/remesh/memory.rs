//! What an incision has crossed but not cut yet, and the nodes on its cut surface.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use super::complex::Complex;

/// Nodes of an edge in ascending order.
pub type EdgeKey = [u32; 2];

/// Where a sweep crosses an edge. It is a point of the material and moves with it.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Crossing {
    /// Parameter along the edge, from its lower node.
    pub t: f64,
    /// Whether the lower node of the edge lies below the sweep, against its normal.
    pub upwards: bool,
    /// Unit normal of the sweep there, in the present configuration.
    pub normal: Vector3<f64>,
}

/// Tolerance, relative to the length of an edge, within which the edge counts as halved. It only allows for
/// rounding.
const HALVED: f64 = 1e-9;

/// The record of one cut: an incision, or several that have joined.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Memory {
    /// Crossings of edges neither end of which lies on the cut surface.
    pub crossings: BTreeMap<EdgeKey, Crossing>,
    /// Nodes of the cut surface, and the unit normal of the sweep there when they were cut.
    pub on: BTreeMap<u32, Vector3<f64>>,
}

impl Crossing {
    /// The end of the edge that the crossing is closest to. If it is halved, the end below the sweep, as
    /// if that were a little lower: all halved edges of a sweep choose nodes on the same side, and the
    /// material between them is not pressed flat from both.
    pub fn near(&self, edge: &EdgeKey) -> u32 {
        let first = if (self.t - 0.5).abs() <= HALVED { self.upwards } else { self.t < 0.5 };
        edge[usize::from(!first)]
    }

    /// The same crossing of the edge the other way round.
    pub fn turned(self) -> Self {
        Self { t: 1.0 - self.t, upwards: !self.upwards, ..self }
    }

    /// Where it is now [m].
    pub fn point(&self, edge: &EdgeKey, complex: &Complex) -> Vector3<f64> {
        let [a, b] = edge.map(|n| complex.x_of(n));
        a + (b - a) * self.t
    }
}

impl Memory {
    /// Updates the record after node `from` was duplicated as `to` for the elements `tets`.
    pub fn duplicate(&mut self, complex: &Complex, from: u32, to: u32, tets: &[u32]) {
        if let Some(&normal) = self.on.get(&from) {
            self.on.insert(to, normal);
        }
        let mut more = Vec::new();
        for (edge, crossing) in &self.crossings {
            let Some(at) = edge.iter().position(|&n| n == from) else { continue };
            let other = edge[1 - at];
            if tets.iter().any(|&t| complex.tet(t).contains(&other)) {
                // The new node has the highest number of all, so it comes second in the edge.
                more.push(([other, to], if at == 0 { crossing.turned() } else { *crossing }));
            }
        }
        self.crossings.extend(more);
    }

    /// The record of a cut with two parts. Where both cross an edge, this one counts.
    pub fn joined(mut self, later: Self) -> Self {
        later
            .crossings
            .into_iter()
            .for_each(|(edge, crossing)| _ = self.crossings.entry(edge).or_insert(crossing));
        self.settle(later.on.into_iter());
        self
    }

    /// Removes the crossings that a new cut surface has settled: those of edges at its nodes.
    pub fn settle(&mut self, nodes: impl Iterator<Item = (u32, Vector3<f64>)>) {
        self.on.extend(nodes);
        let on = &self.on;
        self.crossings.retain(|edge, _| !edge.iter().any(|n| on.contains_key(n)));
    }

    /// Removes edges that the mesh no longer has, and renumbers the nodes. `number` of a removed node is
    /// `None`, or that of the node it was merged with.
    pub fn renumber(&mut self, complex: &Complex, number: impl Fn(u32) -> Option<u32>) {
        let crossings = std::mem::take(&mut self.crossings);
        for ([a, b], crossing) in crossings {
            let there = complex.around(a).iter().any(|&t| complex.tet(t).contains(&b));
            if let (true, Some(a), Some(b)) = (there, number(a), number(b)) {
                let (edge, crossing) = if a < b { ([a, b], crossing) } else { ([b, a], crossing.turned()) };
                self.crossings.insert(edge, crossing);
            }
        }
        self.on = self.on.iter().filter_map(|(&n, &normal)| Some((number(n)?, normal))).collect();
    }
}
