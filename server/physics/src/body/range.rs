//! Detects bodies that leave any sensible range, by the extent of their connected parts.
//!
//! A part that flies, falls or spins keeps its size, so none of that counts. A part that is drawn out to
//! many times its size is either far too soft for its loads or computed wrongly. Its next step would only
//! be worse. The check is one pass over the positions; it does not allocate while the parts stay.

use nalgebra::Vector3;
use scindo_matter::cut::NewCopy;
use scindo_matter::element::FixedCopy;

use crate::integrator::LooseParts;

/// Largest extent of a part, as a multiple of that at rest or of that of its prescribed positions.
const MOST_STRETCH: f64 = 10.0;
/// Least size of a fragment, as a fraction of the size of the body. Single precision may blow up a crumb
/// without harm.
const LEAST_SIZE: f64 = 0.1;

/// Reference sizes of the connected parts of a body.
#[derive(Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Range {
    /// Of every part: the diagonal of its box at rest, or of its prescribed positions if larger [m].
    size: Vec<f64>,
    /// Boxes of the parts at rest.
    rest: Vec<Bounds>,
    boxes: Vec<Bounds>,
}

/// A part that reaches beyond its range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Beyond {
    /// Its extent over its size.
    pub stretch: f64,
    /// Its reference size [m].
    pub size_m: f64,
}

#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
struct Bounds {
    low: Vector3<f64>,
    high: Vector3<f64>,
}

impl Bounds {
    const NOTHING: Self = Self {
        low: Vector3::new(f64::MAX, f64::MAX, f64::MAX),
        high: Vector3::new(f64::MIN, f64::MIN, f64::MIN),
    };

    #[inline(always)]
    fn add(&mut self, x: &Vector3<f64>) {
        for k in 0..3 {
            self.low[k] = if x[k] < self.low[k] { x[k] } else { self.low[k] };
            self.high[k] = if x[k] > self.high[k] { x[k] } else { self.high[k] };
        }
    }

    /// Length of the diagonal [m]; 0 if empty.
    fn diagonal(&self) -> f64 {
        if self.low.x > self.high.x { 0.0 } else { (self.high - self.low).norm() }
    }
}

impl Range {
    /// Takes reference sizes from `parts`, from the rest positions [m] of their copies and from what is
    /// prescribed.
    pub(super) fn follow(&mut self, rest: &[Vector3<f64>], parts: &LooseParts, fixed: &[FixedCopy]) {
        self.measure(rest, parts);
        self.rest.clone_from(&self.boxes);
        self.find_sizes(rest, parts, fixed);
    }

    /// The same after a cut that made the copies `new` and left the parts as they were.
    pub(super) fn follow_new(
        &mut self,
        rest: &[Vector3<f64>],
        new: &[NewCopy],
        parts: &LooseParts,
        fixed: &[FixedCopy],
    ) {
        for copy in new.iter().map(|new| new.copy as usize) {
            self.rest[parts.of_copy[copy] as usize].add(&rest[copy]);
        }
        self.find_sizes(rest, parts, fixed);
    }

    fn find_sizes(&mut self, rest: &[Vector3<f64>], parts: &LooseParts, fixed: &[FixedCopy]) {
        self.size.clear();
        self.size.extend(self.rest.iter().map(Bounds::diagonal));
        let mut whole = Bounds::NOTHING;
        for bounds in self.rest.iter().filter(|bounds| bounds.diagonal() > 0.0) {
            whole.add(&bounds.low);
            whole.add(&bounds.high);
        }
        let least = LEAST_SIZE * whole.diagonal();
        self.boxes.clear();
        self.boxes.resize(parts.len(), Bounds::NOTHING);
        for f in fixed {
            // Directions that are not prescribed have no known target; their rest position stands in.
            let rest = rest[f.copy as usize];
            let mut at = rest;
            f.held.place(&mut at, &f.position_m);
            self.boxes[parts.of_copy[f.copy as usize] as usize].add(&at);
        }
        for (size, bounds) in self.size.iter_mut().zip(&self.boxes) {
            *size = size.max(bounds.diagonal()).max(least);
        }
    }

    /// The part furthest beyond its range after a step from `before` to `after` [m], if it grew in that
    /// step: a body that starts ruined may recover.
    pub(super) fn beyond(
        &mut self,
        before: &[Vector3<f64>],
        after: &[Vector3<f64>],
        parts: &LooseParts,
    ) -> Option<Beyond> {
        self.measure(after, parts);
        let (now, at) = self.worst()?;
        self.measure(before, parts);
        let then = self.boxes[at].diagonal() / self.size[at];
        (now > then).then_some(Beyond { stretch: now, size_m: self.size[at] })
    }

    /// The largest stretch of a part beyond its range, and the index of that part.
    fn worst(&self) -> Option<(f64, usize)> {
        let stretch = |(part, (bounds, size)): (usize, (&Bounds, &f64))| (bounds.diagonal() / size, part);
        let stretches = self.boxes.iter().zip(&self.size).enumerate().map(stretch);
        // A body without extent has no reference size.
        let beyond = stretches.filter(|(s, part)| *s > MOST_STRETCH && self.size[*part] > 0.0);
        beyond.max_by(|a, b| a.0.total_cmp(&b.0))
    }

    fn measure(&mut self, x: &[Vector3<f64>], parts: &LooseParts) {
        self.boxes.clear();
        self.boxes.resize(parts.len(), Bounds::NOTHING);
        match &mut self.boxes[..] {
            [one] => {
                let mut bounds = *one;
                x.iter().for_each(|x| bounds.add(x));
                *one = bounds;
            }
            boxes => x.iter().zip(&parts.of_copy).for_each(|(x, &part)| boxes[part as usize].add(x)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use scindo_matter::element::Held;

    /// Two edges of 1 m, held at their first ends.
    fn two_edges() -> (Vec<Vector3<f64>>, LooseParts, Range) {
        let rest = vec![Vector3::zeros(), Vector3::x(), Vector3::zeros(), Vector3::y()];
        let parts = LooseParts { of_copy: vec![0, 0, 1, 1], mass: vec![1.0; 2], free: vec![false, true] };
        let mut range = Range::default();
        range.follow(&rest, &parts, &[FixedCopy { copy: 0, held: Held::FULLY, position_m: [0.0; 3] }]);
        (rest, parts, range)
    }

    #[test]
    fn parts_may_go_anywhere_but_not_out_of_shape() {
        let (rest, parts, mut range) = two_edges();
        let mut x = rest.clone();
        x[2..].iter_mut().for_each(|x| x.z -= 1e6);
        assert_eq!(range.beyond(&rest, &x, &parts), None, "it fell");
        x[1].x = 9.9;
        assert_eq!(range.beyond(&rest, &x, &parts), None);
        x[1].x = 40.0;
        let beyond = range.beyond(&rest, &x, &parts);
        assert_eq!(beyond, Some(Beyond { stretch: 40.0, size_m: 1.0 }));
        assert_eq!(range.beyond(&x, &x, &parts), None, "it does not grow");
        let mut smaller = x.clone();
        smaller[1].x = 30.0;
        assert_eq!(range.beyond(&x, &smaller, &parts), None, "it recovers");
    }

    #[test]
    fn what_is_drawn_out_by_its_supports_may_be() {
        let (rest, parts, mut range) = two_edges();
        let at =
            |copy, x| FixedCopy { copy, held: Held::Axes([true, false, false]), position_m: [x, 0.0, 0.0] };
        range.follow(&rest, &parts, &[at(0, 0.0), at(1, 25.0)]);
        let mut x = rest.clone();
        x[1].x = 25.0;
        assert_eq!(range.beyond(&rest, &x, &parts), None);
        x[1].y = 300.0;
        assert!(range.beyond(&rest, &x, &parts).is_some());
    }
}
