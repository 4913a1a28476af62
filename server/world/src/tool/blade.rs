//! The surface that the edge of a cutting blade sweeps.

use nalgebra::Vector3;
use scindo_physics::cut::BladeSweep;

/// Shortest move that is still cut at the end of an incision [m].
const LEAST_MOVE_M: f64 = 1e-6;

/// Source of incision numbers, shared by everything that cuts. 0 means skin and is never issued.
#[derive(Debug, Clone, Default)]
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
#[derive(Debug, Clone, Default)]
pub struct BladeEdge {
    cutting: Option<Cutting>,
}

#[derive(Debug, Clone)]
struct Cutting {
    incision: u32,
    last: [Vector3<f64>; 2],
    now: [Vector3<f64>; 2],
}

impl BladeEdge {
    /// Feeds the edge [tip, heel] of this step [m], or `None` if the blade does not cut. Returns the sweep to
    /// cut and its incision number once the edge has moved by `least_m` [m], or when the incision ends. The
    /// number stays the same until the blade stops cutting.
    pub fn advance(
        &mut self,
        edge: Option<[Vector3<f64>; 2]>,
        least_m: f64,
        numbers: &mut IncisionNumbers,
    ) -> Option<(BladeSweep, u32)> {
        match (&mut self.cutting, edge) {
            (None, None) => None,
            (None, Some(edge)) => {
                self.cutting = Some(Cutting { incision: numbers.fresh(), last: edge, now: edge });
                None
            }
            (Some(cutting), Some(edge)) => {
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

impl Cutting {
    fn sweep(&mut self, least_m: f64) -> Option<(BladeSweep, u32)> {
        let moved = |i: usize| (self.now[i] - self.last[i]).norm();
        if moved(0).max(moved(1)) < least_m {
            return None;
        }
        let segments = vec![self.last, self.now];
        self.last = self.now;
        Some((BladeSweep { segments }, self.incision))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn an_incision_is_connected_and_keeps_its_number() {
        let edge = |x: f64| Some([Vector3::new(x, 0.0, 0.0), Vector3::new(x, 0.0, 0.04)]);
        let mut numbers = IncisionNumbers::default();
        let mut blade = BladeEdge::default();
        assert!(blade.advance(edge(0.0), 0.001, &mut numbers).is_none());
        assert!(blade.advance(edge(0.0005), 0.001, &mut numbers).is_none());
        let (first, number) = blade.advance(edge(0.0012), 0.001, &mut numbers).unwrap();
        assert_eq!(first.segments, [edge(0.0).unwrap(), edge(0.0012).unwrap()]);
        assert!(blade.advance(edge(0.0015), 0.001, &mut numbers).is_none());
        let (rest, same) = blade.advance(None, 0.001, &mut numbers).unwrap();
        assert_eq!(rest.segments, [edge(0.0012).unwrap(), edge(0.0015).unwrap()]);
        assert_eq!((number, same), (1, 1));
        assert!(blade.advance(None, 0.001, &mut numbers).is_none());
        blade.advance(edge(0.1), 0.001, &mut numbers);
        assert_eq!(blade.advance(edge(0.2), 0.001, &mut numbers).unwrap().1, 2);
    }
}
