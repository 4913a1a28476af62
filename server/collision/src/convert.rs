//! Conversions between this workspace's vectors and parry's.

use nalgebra::Vector3;
use parry3d::bounding_volume::Aabb;
use parry3d::math::Vector;

/// A surface position as an `f64` vector [m].
pub(crate) fn widen(p: [f32; 3]) -> Vector3<f64> {
    Vector3::new(f64::from(p[0]), f64::from(p[1]), f64::from(p[2]))
}

/// A vector of parry as an `f64` vector [m].
pub(crate) fn from_parry(v: Vector) -> Vector3<f64> {
    Vector3::new(f64::from(v.x), f64::from(v.y), f64::from(v.z))
}

/// The smallest axis-aligned box around some surface positions.
pub(crate) fn aabb_of(points: impl IntoIterator<Item = [f32; 3]>) -> Aabb {
    let mut mins = Vector::splat(f32::MAX);
    let mut maxs = Vector::splat(f32::MIN);
    for p in points {
        let p = Vector::new(p[0], p[1], p[2]);
        mins = mins.min(p);
        maxs = maxs.max(p);
    }
    Aabb::new(mins, maxs)
}

/// Whether two boxes are no farther apart than `margin` [m] along every axis.
pub(crate) fn boxes_within(a: &Aabb, b: &Aabb, margin: f64) -> bool {
    // Rounding must not separate boxes that touch, so the differences are taken in `f64`, where they are exact.
    let gap = |low: f32, high: f32| f64::from(low) - f64::from(high);
    (0..3).all(|axis| gap(a.mins[axis], b.maxs[axis]) <= margin && gap(b.mins[axis], a.maxs[axis]) <= margin)
}
