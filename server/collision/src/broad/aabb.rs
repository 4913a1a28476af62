//! Axis-aligned boxes in single precision.

use nalgebra::Vector3;

/// An axis-aligned box, with its lower and upper corner [m].
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub(crate) struct Aabb {
    /// Lower corner.
    pub min: [f32; 3],
    /// Upper corner.
    pub max: [f32; 3],
}

impl Aabb {
    /// The box without a point: the neutral element of [`merged`](Self::merged).
    pub(crate) const EMPTY: Self = Self { min: [f32::MAX; 3], max: [f32::MIN; 3] };

    /// The smallest box around both.
    #[inline(always)]
    pub(crate) fn merged(&self, other: &Self) -> Self {
        Self { min: lower(self.min, other.min), max: upper(self.max, other.max) }
    }

    /// Whether the boxes are no farther apart than `margin` [m] along every axis.
    ///
    /// Rounding is monotone, so with a `margin` that was rounded up no pair is missed; with margin zero the
    /// answer is exact.
    #[inline(always)]
    pub(crate) fn within(&self, other: &Self, margin: f32) -> bool {
        let near = |i: usize| (self.min[i] - other.max[i] <= margin) & (other.min[i] - self.max[i] <= margin);
        near(0) & near(1) & near(2)
    }

    /// [`within`](Self::within) without rounding.
    pub(crate) fn within_exactly(&self, other: &Self, margin: f64) -> bool {
        let gap = |low: f32, high: f32| f64::from(low) - f64::from(high);
        (0..3).all(|i| gap(self.min[i], other.max[i]) <= margin && gap(other.min[i], self.max[i]) <= margin)
    }

    /// Centre [m].
    #[inline(always)]
    pub(crate) fn centre(&self) -> [f32; 3] {
        [0, 1, 2].map(|i| 0.5 * self.min[i] + 0.5 * self.max[i])
    }

    /// Edge lengths [m]; negative where it is empty.
    #[inline(always)]
    pub(crate) fn extents(&self) -> [f32; 3] {
        [0, 1, 2].map(|i| self.max[i] - self.min[i])
    }

    /// Half the surface area [m²]; 0 where it is empty.
    #[inline(always)]
    pub(crate) fn half_area(&self) -> f32 {
        let [x, y, z] = self.extents();
        if x < 0.0 { 0.0 } else { x * y + y * z + z * x }
    }

    /// Lower and upper corner in double precision [m].
    pub(crate) fn corners(&self) -> [Vector3<f64>; 2] {
        [self.min, self.max].map(|p| Vector3::from(p.map(f64::from)))
    }

    /// The smallest box with these corners in single precision [m].
    pub(crate) fn outside([min, max]: [Vector3<f64>; 2]) -> Self {
        Self { min: [0, 1, 2].map(|i| round_down(min[i])), max: [0, 1, 2].map(|i| round_up(max[i])) }
    }
}

/// Smaller of each coordinate.
#[inline(always)]
pub(crate) fn lower(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [0, 1, 2].map(|i| if a[i] < b[i] { a[i] } else { b[i] })
}

/// Larger of each coordinate.
#[inline(always)]
pub(crate) fn upper(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [0, 1, 2].map(|i| if a[i] > b[i] { a[i] } else { b[i] })
}

/// The smallest number of single precision that is at least `x`.
pub(crate) fn round_up(x: f64) -> f32 {
    let near = x as f32;
    if f64::from(near) < x { near.next_up() } else { near }
}

/// The largest number of single precision that is at most `x`.
pub(crate) fn round_down(x: f64) -> f32 {
    -round_up(-x)
}
