//! Bounding spheres in single precision.

use super::aabb::{Aabb, round_up};

/// A sphere around everything that it bounds.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub(crate) struct Ball {
    /// Centre [m].
    pub centre: [f32; 3],
    /// Radius [m]; negative where it is empty.
    pub radius: f32,
}

impl Ball {
    /// The sphere without a point: the neutral element of [`merged`](Self::merged).
    pub const EMPTY: Self = Self { centre: [0.0; 3], radius: -1.0 };

    /// The sphere around the middle of some boxes that holds all of them.
    pub fn around<'a>(boxes: impl Iterator<Item = &'a Aabb> + Clone) -> Self {
        let whole = boxes.clone().fold(Aabb::EMPTY, |sum, aabb| sum.merged(aabb));
        if whole.extents()[0] < 0.0 {
            return Self::EMPTY;
        }
        let centre = whole.centre();
        let far = |aabb: &Aabb, i: usize| {
            let c = f64::from(centre[i]);
            (f64::from(aabb.max[i]) - c).max(c - f64::from(aabb.min[i]))
        };
        let squared = boxes.map(|aabb| (0..3).map(|i| far(aabb, i).powi(2)).sum::<f64>()).fold(0.0, f64::max);
        Self { centre, radius: outer(squared.sqrt()) }
    }

    /// The smallest sphere around two, up to rounding.
    pub fn merged(&self, other: &Self) -> Self {
        if self.radius < 0.0 {
            return *other;
        }
        if other.radius < 0.0 {
            return *self;
        }
        let distance = self.distance(other);
        let [r, s] = [f64::from(self.radius), f64::from(other.radius)];
        if distance + s <= r {
            return *self;
        }
        if distance + r <= s {
            return *other;
        }
        let radius = 0.5 * (distance + r + s);
        let along = if distance > 0.0 { (radius - r) / distance } else { 0.0 };
        let centre = [0, 1, 2].map(|i| {
            let [a, b] = [f64::from(self.centre[i]), f64::from(other.centre[i])];
            (a + (b - a) * along) as f32
        });
        // The centre was rounded, so the radius is measured from where it is now.
        let at = Self { centre, radius: 0.0 };
        Self { centre, radius: outer((at.distance(self) + r).max(at.distance(other) + s)) }
    }

    /// Distance of the centres [m].
    fn distance(&self, other: &Self) -> f64 {
        let squared = |i: usize| (f64::from(self.centre[i]) - f64::from(other.centre[i])).powi(2);
        (squared(0) + squared(1) + squared(2)).sqrt()
    }

    /// Whether boxes inside the two spheres can be as near as `margin` [m] along every axis.
    pub fn within(&self, other: &Self, margin: f32) -> bool {
        // Boxes that are `margin` apart along three axes are up to √3 margin apart.
        let reach = f64::from(self.radius) + f64::from(other.radius) + 1.733 * f64::from(margin);
        self.radius >= 0.0 && other.radius >= 0.0 && self.distance(other) <= reach * (1.0 + 1e-12)
    }

    /// The box around the sphere.
    pub fn aabb(&self) -> Aabb {
        let r = f64::from(self.radius);
        let at = |side: f64| nalgebra::Vector3::from(self.centre.map(|c| f64::from(c) + side * r));
        Aabb::outside([at(-1.0), at(1.0)])
    }

    /// A measure of the surface area [m²], comparable to half the area of a box.
    pub fn half_area(&self) -> f32 {
        let r = self.radius.max(0.0);
        std::f32::consts::TAU * r * r
    }
}

/// A radius that covers the rounding of its computation.
fn outer(radius: f64) -> f32 {
    round_up(radius * (1.0 + 1e-12))
}
