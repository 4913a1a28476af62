//! Bounding spheres in single precision.

use super::aabb::Aabb;

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
    pub(crate) const EMPTY: Self = Self { centre: [0.0; 3], radius: -1.0 };

    /// The sphere around the middle of some boxes that holds all of them.
    #[inline(always)]
    pub(crate) fn around<'a>(boxes: impl Iterator<Item = &'a Aabb> + Clone) -> Self {
        let whole = boxes.clone().fold(Aabb::EMPTY, |sum, aabb| sum.merged(aabb));
        if whole.extents()[0] < 0.0 {
            return Self::EMPTY;
        }
        let centre = whole.centre();
        let far = |aabb: &Aabb| {
            let along = |i: usize| larger(aabb.max[i] - centre[i], centre[i] - aabb.min[i]);
            let [x, y, z] = [along(0), along(1), along(2)];
            x * x + y * y + z * z
        };
        Self { centre, radius: outer(boxes.fold(0.0, |farthest, aabb| larger(farthest, far(aabb))).sqrt()) }
    }

    /// The smallest sphere around two, up to rounding.
    #[inline(always)]
    pub(crate) fn merged(&self, other: &Self) -> Self {
        if self.radius < 0.0 {
            return *other;
        }
        if other.radius < 0.0 {
            return *self;
        }
        let apart = [0, 1, 2].map(|i| other.centre[i] - self.centre[i]);
        let distance = outer((apart[0] * apart[0] + apart[1] * apart[1] + apart[2] * apart[2]).sqrt());
        let [r, s] = [self.radius, other.radius];
        if distance + s <= r {
            return *self;
        }
        if distance + r <= s {
            return *other;
        }
        let radius = 0.5 * (distance + r + s);
        let along = (radius - r) / distance;
        if !along.is_finite() {
            return Self { centre: self.centre, radius: f32::INFINITY }; // squares beyond single precision
        }
        let centre = [0, 1, 2].map(|i| self.centre[i] + apart[i] * along);
        // The centre was rounded by a unit in the last place of each coordinate at most.
        let rounded = centre.iter().map(|c| c.abs()).sum::<f32>() * f32::EPSILON;
        Self { centre, radius: outer(radius) + rounded }
    }

    /// Distance of the centres [m].
    pub(crate) fn distance(&self, other: &Self) -> f64 {
        let squared = |i: usize| (f64::from(self.centre[i]) - f64::from(other.centre[i])).powi(2);
        (squared(0) + squared(1) + squared(2)).sqrt()
    }

    /// Whether boxes inside the two spheres can be as near as `margin` [m] along every axis.
    pub(crate) fn within(&self, other: &Self, margin: f32) -> bool {
        // Boxes that are `margin` apart along three axes are up to √3 margin apart.
        let reach = f64::from(self.radius) + f64::from(other.radius) + 1.733 * f64::from(margin);
        self.radius >= 0.0 && other.radius >= 0.0 && self.distance(other) <= reach * (1.0 + 1e-12)
    }

    /// The box around the sphere.
    pub(crate) fn aabb(&self) -> Aabb {
        let r = f64::from(self.radius);
        let at = |side: f64| nalgebra::Vector3::from(self.centre.map(|c| f64::from(c) + side * r));
        Aabb::outside([at(-1.0), at(1.0)])
    }

    /// A measure of the surface area [m²], comparable to half the area of a box.
    #[inline(always)]
    pub(crate) fn half_area(&self) -> f32 {
        let r = self.radius.max(0.0);
        std::f32::consts::TAU * r * r
    }
}

/// Enlarges a length by more than it was rounded, and by more than its squares lose below single precision.
#[inline(always)]
fn outer(length: f32) -> f32 {
    length * (1.0 + 3e-6) + 2e-19
}

#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}
