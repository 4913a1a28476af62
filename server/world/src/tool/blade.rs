//! The surface that the edge of a cutting blade sweeps.

use nalgebra::Vector3;
use scindo_physics::cut::{BladeSweep, MAX_SEGMENTS};

/// Shortest move that is still cut at the end of an incision [m].
const LEAST_MOVE_M: f64 = 1e-6;

/// Source of incision numbers, shared by everything that cuts. 0 means skin and is never issued.
#[derive(Debug, Clone, Default, serde::Serialize, serde::Deserialize)]
pub struct IncisionNumbers {
    last: u32,
}

impl IncisionNumbers {
    /// The next unused incision number.
    pub fn fresh(&mut self) -> u32 {
        self.last += 1;
        self.last
    }
}

/// The edge of one blade, and what it has swept since its last cut.
#[derive(Debug, Clone, Default, serde::Serialize, serde::Deserialize)]
pub struct BladeEdge {
    cutting: Option<Cutting>,
}

#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
struct Cutting {
    incision: u32,
    last: [Vector3<f64>; 2],
    /// Places between the last sweep and now.
    passed: Vec<[Vector3<f64>; 2]>,
    now: [Vector3<f64>; 2],
}

impl BladeEdge {
    /// Feeds the edge [tip, heel] of this step [m], or `None` if the blade does not cut, and the places that it `passed`
    /// since the last step. Returns the sweep to
    /// cut and its incision number once the edge has moved by `least_m` [m], or when the incision ends. The
    /// number stays the same until the blade stops cutting.
    pub fn advance(
        &mut self,
        edge: Option<[Vector3<f64>; 2]>,
        passed: impl IntoIterator<Item = [Vector3<f64>; 2]>,
        least_m: f64,
        numbers: &mut IncisionNumbers,
    ) -> Option<(BladeSweep, u32)> {
        match (&mut self.cutting, edge) {
            (None, None) => None,
            (None, Some(edge)) => {
                self.cutting =
                    Some(Cutting { incision: numbers.fresh(), last: edge, passed: Vec::new(), now: edge });
                None
            }
            (Some(cutting), Some(edge)) => {
                let mut passed = passed.into_iter().peekable();
                if passed.peek().is_some() && cutting.now != cutting.last {
                    cutting.pass(cutting.now);
                }
                passed.for_each(|edge| cutting.pass(edge));
                cutting.now = edge;
                cutting.sweep(least_m)
            }
            (Some(cutting), None) => {
                let rest = cutting.sweep(LEAST_MOVE_M);
                self.cutting = None;
                rest
            }
        }
    }
}

/// The edge of a blade that cuts with force: where it has got to, as contact finds after every step.
///
/// Its sweeps have one position each. They begin where the material has carried the last one of the incision, or, for
/// the first, where the edge met the tissue.
#[derive(Debug, Clone, Default, serde::Serialize, serde::Deserialize)]
pub struct PressedEdge {
    incision: Option<u32>,
    /// Where the edge was before it met the tissue, until the first sweep.
    began: Option<[Vector3<f64>; 2]>,
    at: Option<[Vector3<f64>; 2]>,
    /// The way of the foremost part since the last sweep [m].
    moved_m: f64,
    left: bool,
}

impl PressedEdge {
    /// The edge [tip, heel] [m] meets tissue on the way from this place.
    pub fn enter(&mut self, before: [Vector3<f64>; 2]) {
        *self = Self { began: Some(before), ..Self::default() };
    }

    /// The cut of a scalpel [tip below the skin, above it] [m] after a step.
    pub fn draw(&mut self, edge: [Vector3<f64>; 2]) {
        let Some(before) = self.at().copied() else {
            self.enter(edge);
            return self.advance(edge, 0.0);
        };
        let by_m = (0..2).map(|i| (edge[i] - before[i]).norm()).fold(0.0, f64::max);
        self.advance(edge, by_m);
    }

    /// The edge after a step in which its foremost part went on by `by_m` [m].
    pub fn advance(&mut self, edge: [Vector3<f64>; 2], by_m: f64) {
        self.at = Some(edge);
        self.moved_m += by_m;
    }

    /// Where the edge is; `None` while it is in no tissue.
    pub fn at(&self) -> Option<&[Vector3<f64>; 2]> {
        self.at.as_ref().filter(|_| !self.left)
    }

    /// The edge is in no tissue any more.
    pub fn leave(&mut self) {
        self.left = true;
    }

    /// The sweep to cut and its incision number: once the edge went on by `least_m` [m], and when the incision ends
    /// because the blade left the tissue or does not cut any more (`cuts`).
    pub fn take(
        &mut self,
        cuts: bool,
        least_m: f64,
        numbers: &mut IncisionNumbers,
    ) -> Option<(BladeSweep, u32)> {
        let ends = self.left || !cuts;
        let least_m = if ends { LEAST_MOVE_M } else { least_m };
        let found = match self.at {
            Some(edge) if self.moved_m >= least_m => {
                self.moved_m = 0.0;
                let incision = *self.incision.get_or_insert_with(|| numbers.fresh());
                let segments = self.began.take().into_iter().chain([edge]).collect();
                Some((BladeSweep { segments }, incision))
            }
            _ => None,
        };
        if ends {
            *self = Self::default();
        }
        found
    }
}

impl Cutting {
    fn pass(&mut self, edge: [Vector3<f64>; 2]) {
        if self.passed.len() < MAX_SEGMENTS - 2 {
            self.passed.push(edge);
        }
    }

    fn sweep(&mut self, least_m: f64) -> Option<(BladeSweep, u32)> {
        let moved =
            |edge: &[Vector3<f64>; 2]| (0..2).map(|i| (edge[i] - self.last[i]).norm()).fold(0.0, f64::max);
        if self.passed.iter().chain([&self.now]).map(moved).fold(0.0, f64::max) < least_m {
            return None;
        }
        let mut segments = vec![self.last];
        segments.append(&mut self.passed);
        segments.push(self.now);
        self.last = self.now;
        Some((BladeSweep { segments }, self.incision))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn a_pressed_edge_sweeps_from_the_skin_to_where_it_left() {
        let edge = |x: f64| [Vector3::new(x, 0.0, 0.0), Vector3::new(x, 0.0, 0.04)];
        let mut numbers = IncisionNumbers::default();
        let mut blade = PressedEdge::default();
        let mut take = |blade: &mut PressedEdge, cuts| {
            blade.take(cuts, 0.001, &mut numbers).map(|(sweep, number)| (sweep.segments, number))
        };
        assert_eq!(take(&mut blade, true), None);
        blade.enter(edge(-0.001));
        blade.advance(edge(0.0), 0.0);
        assert_eq!(take(&mut blade, true), None, "it only presses");
        blade.advance(edge(0.0012), 0.0012);
        assert_eq!(take(&mut blade, true), Some((vec![edge(-0.001), edge(0.0012)], 1)));
        blade.advance(edge(0.0017), 0.0005);
        assert_eq!(take(&mut blade, true), None);
        blade.leave();
        assert_eq!(take(&mut blade, true), Some((vec![edge(0.0017)], 1)), "the rest");
        assert_eq!(take(&mut blade, false), None);
        blade.enter(edge(0.1));
        blade.advance(edge(0.102), 0.002);
        assert_eq!(take(&mut blade, false), Some((vec![edge(0.1), edge(0.102)], 2)), "another incision");
    }

    #[test]
    fn an_incision_is_connected_and_keeps_its_number() {
        let edge = |x: f64| Some([Vector3::new(x, 0.0, 0.0), Vector3::new(x, 0.0, 0.04)]);
        let mut numbers = IncisionNumbers::default();
        let mut blade = BladeEdge::default();
        assert!(blade.advance(edge(0.0), [], 0.001, &mut numbers).is_none());
        assert!(blade.advance(edge(0.0005), [], 0.001, &mut numbers).is_none());
        let (first, number) = blade.advance(edge(0.0012), [], 0.001, &mut numbers).unwrap();
        assert_eq!(first.segments, [edge(0.0).unwrap(), edge(0.0012).unwrap()]);
        assert!(blade.advance(edge(0.0015), [], 0.001, &mut numbers).is_none());
        let (rest, same) = blade.advance(None, [], 0.001, &mut numbers).unwrap();
        assert_eq!(rest.segments, [edge(0.0012).unwrap(), edge(0.0015).unwrap()]);
        assert_eq!((number, same), (1, 1));
        assert!(blade.advance(None, [], 0.001, &mut numbers).is_none());
        blade.advance(edge(0.1), [], 0.001, &mut numbers);
        assert_eq!(blade.advance(edge(0.2), [], 0.001, &mut numbers).unwrap().1, 2);
        // What happened between two steps counts, also where the blade is back at its place.
        let between = [0.21, 0.22].map(|x| edge(x).unwrap());
        let (sweep, _) = blade.advance(edge(0.2), between, 0.001, &mut numbers).unwrap();
        assert_eq!(sweep.segments, [0.2, 0.21, 0.22, 0.2].map(|x| edge(x).unwrap()));
    }
}
