//! What a search looks for: the cost of reaching a bound, never more than that of anything inside it.

use super::aabb::Aabb;
use super::ball::Ball;
use nalgebra::Vector3;

type V = Vector3<f64>;

/// Factor that keeps a rounded bound below the exact one.
const ROUNDED: f64 = 1.0 - 1e-12;

/// A search. A method visits what costs no more than a limit.
pub(crate) trait Probe {
    /// Whether the search looks for what costs least, so that its limit shrinks. It may then visit a triangle
    /// more than once.
    const NEAREST: bool;

    /// Lower bound of the cost of everything in a box. Infinite: out of reach.
    fn to_box(&self, aabb: &Aabb) -> f64;

    /// Lower bound of the cost of everything in a sphere that is not empty.
    fn to_ball(&self, ball: &Ball) -> f64;

    /// A box that holds all places with a cost up to `limit` [m].
    fn region(&self, limit: f64) -> [V; 2];

    /// The limit of a search that reaches `distance` [m] far; only where the limit shrinks.
    fn limit_at(&self, distance: f64) -> f64;
}

/// Everything near the core of a capsule. The cost is the squared distance [m²].
///
/// `NEAREST` tells whether only the nearest is wanted.
pub(crate) struct NearSegment<const NEAREST: bool>(pub [V; 2]);

impl<const NEAREST: bool> Probe for NearSegment<NEAREST> {
    const NEAREST: bool = NEAREST;

    fn to_box(&self, aabb: &Aabb) -> f64 {
        let [lower, upper] = aabb.corners();
        let [a, b] = self.0;
        let (from, to) = (a.inf(&b), a.sup(&b));
        let apart = (lower - to).sup(&(from - upper)).sup(&V::zeros());
        let middle = (a + b) * 0.5;
        let off = (lower - middle).sup(&(middle - upper)).sup(&V::zeros());
        let ball = (off.norm() - (b - a).norm() * 0.5).max(0.0);
        apart.norm_squared().max(ball * ball) * ROUNDED
    }

    fn to_ball(&self, ball: &Ball) -> f64 {
        let [a, b] = self.0;
        let centre = V::from(ball.centre.map(f64::from));
        let t = crate::distance::closest_point_on_segment(centre, a, b);
        let gap = ((a + (b - a) * t - centre).norm() - f64::from(ball.radius)).max(0.0);
        gap * gap * ROUNDED
    }

    fn region(&self, limit: f64) -> [V; 2] {
        let [a, b] = self.0;
        let reach = V::repeat(limit.sqrt());
        [a.inf(&b) - reach, a.sup(&b) + reach]
    }

    fn limit_at(&self, distance: f64) -> f64 {
        distance * distance
    }
}

/// Everything near a point. The cost is the squared distance [m²].
///
/// `NEAREST` tells whether only the nearest is wanted.
pub(crate) struct NearPoint<const NEAREST: bool>(pub V);

impl<const NEAREST: bool> Probe for NearPoint<NEAREST> {
    const NEAREST: bool = NEAREST;

    #[inline]
    fn to_box(&self, aabb: &Aabb) -> f64 {
        let squared = |i: usize| {
            let (below, above) = (f64::from(aabb.min[i]) - self.0[i], self.0[i] - f64::from(aabb.max[i]));
            let gap = if below > above { below } else { above };
            if gap > 0.0 { gap * gap } else { 0.0 }
        };
        (squared(0) + squared(1) + squared(2)) * ROUNDED
    }

    fn to_ball(&self, ball: &Ball) -> f64 {
        let gap = (self.0 - V::from(ball.centre.map(f64::from))).norm() - f64::from(ball.radius);
        if gap > 0.0 { gap * gap * ROUNDED } else { 0.0 }
    }

    fn region(&self, limit: f64) -> [V; 2] {
        let reach = V::repeat(limit.sqrt());
        [self.0 - reach, self.0 + reach]
    }

    fn limit_at(&self, distance: f64) -> f64 {
        distance * distance
    }
}

/// Everything whose box is no farther than a margin [m] from a box along every axis. The cost is zero there.
pub(crate) struct NearBox(pub Aabb, pub f32);

impl Probe for NearBox {
    const NEAREST: bool = false;

    fn to_box(&self, aabb: &Aabb) -> f64 {
        free_if(self.0.within(aabb, self.1))
    }

    fn to_ball(&self, ball: &Ball) -> f64 {
        let gap = |i: usize| (self.0.min[i] - ball.centre[i]).max(ball.centre[i] - self.0.max[i]);
        let slack = (self.1 + ball.radius) * 1.000_001;
        free_if((0..3).all(|i| gap(i) <= slack))
    }

    fn region(&self, _: f64) -> [V; 2] {
        let [lower, upper] = self.0.corners();
        let margin = V::repeat(f64::from(self.1));
        [lower - margin, upper + margin]
    }

    fn limit_at(&self, _: f64) -> f64 {
        0.0
    }
}

/// Everything that a ray along +x from a point can meet. The cost is zero there.
pub(crate) struct RayAlongX(pub V);

impl Probe for RayAlongX {
    const NEAREST: bool = false;

    fn to_box(&self, aabb: &Aabb) -> f64 {
        let p = self.0;
        let [lower, upper] = aabb.corners();
        free_if((1..3).all(|i| p[i] >= lower[i] && p[i] <= upper[i]) && p.x <= upper.x)
    }

    fn to_ball(&self, ball: &Ball) -> f64 {
        let (p, r) = (self.0, f64::from(ball.radius));
        let off = |i: usize| p[i] - f64::from(ball.centre[i]);
        free_if((1..3).all(|i| off(i).abs() <= r) && off(0) <= r)
    }

    fn region(&self, _: f64) -> [V; 2] {
        [self.0, V::new(f64::from(f32::MAX), self.0.y, self.0.z)]
    }

    fn limit_at(&self, _: f64) -> f64 {
        0.0
    }
}

fn free_if(reached: bool) -> f64 {
    if reached { 0.0 } else { f64::INFINITY }
}
