//! What a body can meet in a step, judged by its nodes alone.
//!
//! Surfaces need not follow bodies that meet nothing, so this looks at nodes only. No point of a surface moves farther
//! than the nodes that carry it, times the sum of their absolute weights.

use nalgebra::Vector3;
use scindo_physics::element::MaterialPoint;

use super::{MARGIN_CELLS, PairContacts, TouchSettings};
use crate::body::SimBody;

/// The box of nothing.
pub(super) const NOWHERE: [Vector3<f64>; 2] = [
    Vector3::new(f64::INFINITY, f64::INFINITY, f64::INFINITY),
    Vector3::new(-f64::INFINITY, -f64::INFINITY, -f64::INFINITY),
];

/// What one body can meet in a step.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
pub(super) struct Watch {
    /// Nothing of it can touch itself.
    pub apart: bool,
    /// It can touch no other body.
    pub alone: bool,
    /// The box that its nodes pass through [m].
    bounds: [Vector3<f64>; 2],
}

impl Watch {
    /// Whether it can touch anything.
    pub(super) fn may_meet(&self) -> bool {
        !self.apart || !self.alone
    }

    fn overlaps(&self, other: &Self) -> bool {
        let ([low, high], [from, to]) = (&self.bounds, &other.bounds);
        (0..3).all(|k| low[k] <= to[k] && from[k] <= high[k])
    }
}

impl PairContacts {
    /// Whether body number `body` may touch another body or itself in the step that was last [watched](Self::watch).
    pub fn may_meet(&self, body: usize) -> bool {
        self.watch.get(body).is_none_or(Watch::may_meet)
    }

    /// Finds which bodies may touch anything in a step of `h` seconds.
    pub fn watch(&mut self, bodies: &[SimBody], (h, settings): (f64, TouchSettings)) {
        self.same = self.follow(bodies);
        self.own.resize_with(if settings.itself { bodies.len() } else { 0 }, Default::default);
        self.watch.clear();
        for (i, body) in bodies.iter().enumerate() {
            let (x, v) = (body.body.positions(), body.body.velocities());
            let (cell_m, spread) = (self.cells[i], self.spreads[i]);
            let margin = MARGIN_CELLS * cell_m;
            let apart = self.own.get_mut(i).is_none_or(|own| {
                let fastest = longest(v.iter().copied());
                own.meet_the_joined(self.meets_joined);
                own.is_apart((x, spread), self.same, (margin + 2.0 * h * spread * fastest, cell_m))
            });
            let bounds = if settings.others { passed((x, v), h, (spread, margin)) } else { NOWHERE };
            self.watch.push(Watch { apart, alone: true, bounds });
        }
        for a in 0..self.watch.len() {
            let meets = |b: usize| a != b && self.watch[a].overlaps(&self.watch[b]);
            self.watch[a].alone = !(settings.others && (0..self.watch.len()).any(meets));
        }
    }
}

/// The largest length; not a number where one is none.
pub(super) fn longest(vectors: impl Iterator<Item = Vector3<f64>>) -> f64 {
    // Squares are ordered as their bits are, and whole numbers are compared faster.
    let squares = vectors.map(|v| v.norm_squared().to_bits());
    f64::from_bits(squares.max().unwrap_or(0)).sqrt()
}

/// The largest sum of absolute weights of a point of the surface.
pub(super) fn spread(body: &SimBody) -> f64 {
    let of = |point: &MaterialPoint| point.weights().iter().map(|w| w.abs()).sum();
    body.body.surface().vertices.iter().map(of).fold(1.0, f64::max)
}

/// The box that the surface over nodes at x [m] with the velocities v [m/s] passes through within `h` seconds, `margin`
/// [m] wider.
fn passed(
    (x, v): (&[Vector3<f64>], &[Vector3<f64>]),
    h: f64,
    (spread, margin): (f64, f64),
) -> [Vector3<f64>; 2] {
    let grow = |[low, high]: [Vector3<f64>; 2], (x, v): (&Vector3<f64>, &Vector3<f64>)| {
        let to = x + h * v;
        [low.inf(x).inf(&to), high.sup(x).sup(&to)]
    };
    let [low, high] = x.iter().zip(v).fold(NOWHERE, grow);
    // Weights of which some are negative reach beyond the nodes.
    let beyond = (high - low).map(|extent| 0.5 * (spread - 1.0) * extent.max(0.0) + margin);
    [low - beyond, high + beyond]
}
