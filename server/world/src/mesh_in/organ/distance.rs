//! Signed distances [m] to simple solids, negative inside, and operations that combine them.

use nalgebra::Vector3;

/// A point with these coordinates.
pub(super) fn at(x: f64, y: f64, z: f64) -> Vector3<f64> {
    Vector3::new(x, y, z)
}

/// Distance to an ellipsoid to first order (Quilez). It is exact on the surface.
pub(super) fn ellipsoid(x: &Vector3<f64>, centre: Vector3<f64>, radii: Vector3<f64>) -> f64 {
    let p = x - centre;
    let k0 = p.component_div(&radii).norm();
    let k1 = p.component_div(&radii.component_mul(&radii)).norm();
    if k1 > 0.0 { k0 * (k0 - 1.0) / k1 } else { -radii.min() }
}

/// Distance to a line from `a` to `b` of the given radius.
pub(super) fn capsule(x: &Vector3<f64>, a: Vector3<f64>, b: Vector3<f64>, radius: f64) -> f64 {
    cone(x, (a, radius), (b, radius))
}

/// Distance to a line from `a` to `b` whose radius changes from `a.1` to `b.1`. It is accurate enough for
/// slender ones.
pub(super) fn cone(x: &Vector3<f64>, a: (Vector3<f64>, f64), b: (Vector3<f64>, f64)) -> f64 {
    let along = b.0 - a.0;
    let t = ((x - a.0).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
    (x - a.0 - t * along).norm() - (a.1 + t * (b.1 - a.1))
}

/// Signed distance to the half-space below the plane through `point` with this normal.
pub(super) fn half_space(x: &Vector3<f64>, point: Vector3<f64>, normal: Vector3<f64>) -> f64 {
    (x - point).dot(&normal.normalize())
}

/// Distance to a ring in the plane z = `centre.z`.
pub(super) fn ring(x: &Vector3<f64>, centre: Vector3<f64>, radius: f64, thickness: f64) -> f64 {
    let p = x - centre;
    (p.xy().norm() - radius).hypot(p.z) - thickness
}

/// Union with a fillet about `blend` [m] wide (polynomial smooth minimum).
pub(super) fn smooth_union(f: f64, g: f64, blend: f64) -> f64 {
    let h = (1.0 - (f - g).abs() / blend).max(0.0);
    f.min(g) - 0.25 * blend * h * h
}

/// `f` without `g`, with the new edge rounded.
pub(super) fn smooth_cut(f: f64, g: f64, blend: f64) -> f64 {
    -smooth_union(-f, g, blend)
}

/// Intersection of `f` and `g`, with the new edge rounded.
pub(super) fn smooth_overlap(f: f64, g: f64, blend: f64) -> f64 {
    -smooth_union(-f, -g, blend)
}
