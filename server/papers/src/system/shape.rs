//! A smooth solid in the shape of a sitting animal with two ears.
//!
//! It takes the place of the Stanford bunny, which is not part of the program: union of blobs with rounded
//! transitions, and about as many cells.

use nalgebra::Vector3;
use scindo_physics::octree::Shape;

type V = Vector3<f64>;

/// Width of the transition between blobs, in widths of the solid.
const ROUND: f64 = 0.035;
/// Step of the differences that give normals.
const DIFFERENCE: f64 = 1e-5;
/// Bisections for a crossing.
const BISECTIONS: usize = 30;

/// Centre and semi-axes of an ellipsoid.
const ELLIPSOIDS: [([f64; 3], [f64; 3]); 9] = [
    ([0.600, 0.330, 0.387], [0.315, 0.300, 0.290]), // trunk
    ([0.330, 0.360, 0.387], [0.220, 0.290, 0.235]), // chest
    ([0.235, 0.600, 0.387], [0.185, 0.165, 0.165]), // head
    ([0.100, 0.555, 0.387], [0.095, 0.085, 0.090]), // snout
    ([0.720, 0.230, 0.190], [0.210, 0.215, 0.170]), // thigh
    ([0.720, 0.230, 0.584], [0.210, 0.215, 0.170]), // thigh
    ([0.930, 0.260, 0.387], [0.070, 0.080, 0.080]), // tail
    ([0.240, 0.070, 0.240], [0.170, 0.075, 0.085]), // paw
    ([0.240, 0.070, 0.534], [0.170, 0.075, 0.085]), // paw
];
/// Ends and radii of an ear.
const EARS: [([f64; 3], [f64; 3], f64, f64); 2] = [
    ([0.270, 0.700, 0.310], [0.500, 0.935, 0.190], 0.060, 0.050),
    ([0.270, 0.700, 0.464], [0.500, 0.935, 0.584], 0.060, 0.050),
];

/// The solid; 1 m wide, upright along y, standing on y = 0.
#[derive(Clone, Copy, Debug, Default)]
pub struct Animal;

impl Animal {
    /// About the distance from the surface [m], negative inside.
    pub fn distance(p: &V) -> f64 {
        let ellipsoids = ELLIPSOIDS.iter().map(|(centre, axes)| {
            let q = (p - V::from(*centre)).component_div(&V::from(*axes));
            let (a, b) = (q.norm(), q.component_div(&V::from(*axes)).norm());
            if b > 0.0 { a * (a - 1.0) / b } else { -axes[0] }
        });
        let ears = EARS.iter().map(|(a, b, from, to)| {
            let (a, b) = (V::from(*a), V::from(*b));
            let t = ((p - a).dot(&(b - a)) / (b - a).norm_squared()).clamp(0.0, 1.0);
            (p - a - t * (b - a)).norm() - (from + t * (to - from))
        });
        let blobs = ellipsoids.chain(ears).fold(f64::INFINITY, smooth_minimum);
        blobs.max(-p.y)
    }
}

/// The smaller of two distances, rounded where they are about the same.
fn smooth_minimum(a: f64, b: f64) -> f64 {
    if a.is_infinite() {
        return b;
    }
    let near = (ROUND - (a - b).abs()).max(0.0) / ROUND;
    a.min(b) - 0.25 * ROUND * near * near
}

impl Shape for Animal {
    fn bounds(&self) -> [V; 2] {
        [V::zeros(), V::new(1.0, 0.987, 0.774)]
    }

    fn contains(&self, p: &V) -> bool {
        Self::distance(p) < 0.0
    }

    fn crossing(&self, a: &V, b: &V) -> Option<(f64, V)> {
        let leaves = self.contains(a);
        if leaves == self.contains(b) {
            return None;
        }
        let at = |t: f64| a + t * (b - a);
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (low + high);
            if self.contains(&at(middle)) == leaves { low = middle } else { high = middle }
        }
        let p = at(0.5 * (low + high));
        let rise = |k: usize| {
            let step = V::ith(k, DIFFERENCE);
            Self::distance(&(p + step)) - Self::distance(&(p - step))
        };
        let normal = V::from_fn(|k, _| rise(k));
        Some((0.5 * (low + high), normal.try_normalize(0.0).unwrap_or_else(V::y)))
    }
}

/// Another solid, moved and scaled so that its bounds begin at the origin and its longest side is 1 m.
pub struct Placed<'a> {
    solid: &'a dyn Shape,
    low: V,
    longest: f64,
}

impl<'a> Placed<'a> {
    /// Places `solid`.
    pub fn new(solid: &'a dyn Shape) -> Self {
        let [low, high] = solid.bounds();
        Self { solid, low, longest: (high - low).max() }
    }

    fn there(&self, p: &V) -> V {
        self.low + self.longest * p
    }
}

impl Shape for Placed<'_> {
    fn bounds(&self) -> [V; 2] {
        self.solid.bounds().map(|p| (p - self.low) / self.longest)
    }

    fn contains(&self, p: &V) -> bool {
        self.solid.contains(&self.there(p))
    }

    fn contains_row(&self, point: &dyn Fn(usize) -> V, inside: &mut [bool]) {
        self.solid.contains_row(&|i| self.there(&point(i)), inside);
    }

    fn crossing(&self, a: &V, b: &V) -> Option<(f64, V)> {
        self.solid.crossing(&self.there(a), &self.there(b))
    }
}
