//! Closest points between points, segments and triangles, safe for degenerate input.
//!
//! # Source
//! Ericson, Real-Time Collision Detection (2005), §5.1. Triangles without area are treated as their edges,
//! segments without length as points, so every result is finite.

use nalgebra::Vector3;

type V = Vector3<f64>;

/// Closest pair of a segment and a triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SegmentTriangle {
    /// Parameter of the closest point on the segment, 0..=1.
    pub parameter: f64,
    /// The closest point on the segment [m].
    pub on_segment: V,
    /// The closest point on the triangle [m].
    pub on_triangle: V,
    /// Barycentric coordinates of [`Self::on_triangle`].
    pub barycentric: [f64; 3],
    /// Squared distance [m²]; zero when the segment crosses the triangle.
    pub distance_squared: f64,
}

/// The point of a triangle with the given barycentric coordinates [m].
pub fn barycentric_point(triangle: &[V; 3], w: [f64; 3]) -> V {
    triangle[0] * w[0] + triangle[1] * w[1] + triangle[2] * w[2]
}

/// Parameter in 0..=1 of the point of segment `a`–`b` closest to `p`.
pub fn closest_point_on_segment(p: V, a: V, b: V) -> f64 {
    let ab = b - a;
    let length_squared = ab.norm_squared();
    if length_squared <= f64::MIN_POSITIVE {
        return 0.0;
    }
    ((p - a).dot(&ab) / length_squared).clamp(0.0, 1.0)
}

/// Barycentric coordinates of the point of a triangle closest to `p`.
pub fn closest_point_on_triangle(p: V, triangle: &[V; 3]) -> [f64; 3] {
    let [a, b, c] = *triangle;
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(&ap), ac.dot(&ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(&bp), ac.dot(&bp));
    if d3 >= 0.0 && d4 <= d3 {
        return [0.0, 1.0, 0.0];
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(&cp), ac.dot(&cp));
    if d6 >= 0.0 && d5 <= d6 {
        return [0.0, 0.0, 1.0];
    }
    // Twice the area squared times each barycentric coordinate of the projection.
    let va = d3 * d6 - d5 * d4;
    let vb = d5 * d2 - d1 * d6;
    let vc = d1 * d4 - d3 * d2;
    let sum = va + vb + vc;
    let inside = va > 0.0 && vb > 0.0 && vc > 0.0;
    if inside && sum > 1e-14 * ab.norm_squared() * ac.norm_squared() {
        return [va / sum, vb / sum, vc / sum];
    }
    closest_edge_point(p, triangle)
}

/// Barycentric coordinates of the point on the boundary of a triangle closest to `p`.
fn closest_edge_point(p: V, triangle: &[V; 3]) -> [f64; 3] {
    let mut best = [1.0, 0.0, 0.0];
    let mut best_squared = f64::INFINITY;
    for edge in 0..3 {
        let (i, j) = (edge, (edge + 1) % 3);
        let t = closest_point_on_segment(p, triangle[i], triangle[j]);
        let on_edge = triangle[i] + (triangle[j] - triangle[i]) * t;
        let squared = (on_edge - p).norm_squared();
        if squared < best_squared {
            best_squared = squared;
            best = [0.0; 3];
            best[i] = 1.0 - t;
            best[j] = t;
        }
    }
    best
}

/// Parameters in 0..=1 of the closest points of segments `p0`–`p1` and `q0`–`q1`.
pub fn closest_segment_segment(p: [V; 2], q: [V; 2]) -> [f64; 2] {
    let (d1, d2, r) = (p[1] - p[0], q[1] - q[0], p[0] - q[0]);
    let (a, e, f) = (d1.norm_squared(), d2.norm_squared(), d2.dot(&r));
    if a <= f64::MIN_POSITIVE {
        return [0.0, closest_point_on_segment(p[0], q[0], q[1])];
    }
    if e <= f64::MIN_POSITIVE {
        return [closest_point_on_segment(q[0], p[0], p[1]), 0.0];
    }
    let (b, c) = (d1.dot(&d2), d1.dot(&r));
    let denominator = a * e - b * b;
    // Parallel segments: any parameter is valid, and the clamps below choose a pair.
    let mut s =
        if denominator > 1e-14 * a * e { ((b * f - c * e) / denominator).clamp(0.0, 1.0) } else { 0.0 };
    let mut t = (b * s + f) / e;
    if t < 0.0 {
        t = 0.0;
        s = (-c / a).clamp(0.0, 1.0);
    } else if t > 1.0 {
        t = 1.0;
        s = ((b - c) / a).clamp(0.0, 1.0);
    }
    [s, t]
}

/// Closest pair of `segment` and a triangle.
pub fn closest_segment_triangle(segment: [V; 2], triangle: &[V; 3]) -> SegmentTriangle {
    let [a, b] = segment;
    let mut best = pair(segment, triangle, 0.0, closest_point_on_triangle(a, triangle));
    if (b - a).norm_squared() <= f64::MIN_POSITIVE {
        return best;
    }
    if let Some(crossing) = crossing(segment, triangle) {
        return crossing;
    }
    let end = pair(segment, triangle, 1.0, closest_point_on_triangle(b, triangle));
    if end.distance_squared < best.distance_squared {
        best = end;
    }
    for edge in 0..3 {
        let (i, j) = (edge, (edge + 1) % 3);
        let [s, t] = closest_segment_segment(segment, [triangle[i], triangle[j]]);
        let mut w = [0.0; 3];
        w[i] = 1.0 - t;
        w[j] = t;
        let candidate = pair(segment, triangle, s, w);
        if candidate.distance_squared < best.distance_squared {
            best = candidate;
        }
    }
    best
}

fn pair(segment: [V; 2], triangle: &[V; 3], parameter: f64, w: [f64; 3]) -> SegmentTriangle {
    let on_segment = segment[0] + (segment[1] - segment[0]) * parameter;
    let on_triangle = barycentric_point(triangle, w);
    SegmentTriangle {
        parameter,
        on_segment,
        on_triangle,
        barycentric: w,
        distance_squared: (on_segment - on_triangle).norm_squared(),
    }
}

/// The point where a segment passes through the interior of a triangle, if it does.
fn crossing(segment: [V; 2], triangle: &[V; 3]) -> Option<SegmentTriangle> {
    let [a, b] = segment;
    let normal = (triangle[1] - triangle[0]).cross(&(triangle[2] - triangle[0]));
    let (da, db) = ((a - triangle[0]).dot(&normal), (b - triangle[0]).dot(&normal));
    if da * db > 0.0 || da == db {
        return None;
    }
    let parameter = da / (da - db);
    let point = a + (b - a) * parameter;
    let area_squared = normal.norm_squared();
    let weight = |i: usize| {
        let (p, q) = (triangle[(i + 1) % 3], triangle[(i + 2) % 3]);
        (q - p).cross(&(point - p)).dot(&normal) / area_squared
    };
    let w = [weight(0), weight(1), weight(2)];
    if !w.iter().all(|&x| (0.0..=1.0).contains(&x)) {
        return None;
    }
    let mut hit = pair(segment, triangle, parameter, w);
    hit.distance_squared = 0.0;
    hit.on_triangle = point;
    hit.on_segment = point;
    Some(hit)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn point() -> impl Strategy<Value = V> {
        [-1.0..1.0, -1.0..1.0, -1.0..1.0].prop_map(|[x, y, z]: [f64; 3]| V::new(x, y, z))
    }

    /// Smallest squared distance over a grid of barycentric coordinates and segment parameters.
    fn sampled(segment: [V; 2], triangle: &[V; 3], n: usize) -> f64 {
        let mut best = f64::INFINITY;
        for i in 0..=n {
            for j in 0..=(n - i) {
                let (u, v) = (i as f64 / n as f64, j as f64 / n as f64);
                let p = barycentric_point(triangle, [1.0 - u - v, u, v]);
                let t = closest_point_on_segment(p, segment[0], segment[1]);
                let q = segment[0] + (segment[1] - segment[0]) * t;
                best = best.min((p - q).norm_squared());
            }
        }
        best
    }

    proptest! {
        #[test]
        fn segment_to_triangle_is_the_smallest_distance(
            a in point(), b in point(), t in [point(), point(), point()]
        ) {
            let found = closest_segment_triangle([a, b], &t);
            let reference = sampled([a, b], &t, 40).sqrt();
            let distance = found.distance_squared.sqrt();
            prop_assert!(distance <= reference + 1e-12);
            prop_assert!(distance >= reference - 0.08, "{distance} < {reference}");
            prop_assert!(found.barycentric.iter().all(|w| (-1e-12..=1.0 + 1e-12).contains(w)));
        }

        #[test]
        fn point_to_triangle_is_the_smallest_distance(
            p in point(), t in [point(), point(), point()]
        ) {
            let found = barycentric_point(&t, closest_point_on_triangle(p, &t));
            let reference = sampled([p, p], &t, 60).sqrt();
            prop_assert!((found - p).norm() <= reference + 1e-12);
            prop_assert!((found - p).norm() >= reference - 0.05);
        }
    }

    #[test]
    fn triangles_without_area_and_segments_without_length_stay_finite() {
        let x = V::x();
        let needle = [V::zeros(), x, x * 0.5];
        let w = closest_point_on_triangle(V::new(0.25, 1.0, 0.0), &needle);
        assert!((barycentric_point(&needle, w) - x * 0.25).norm() < 1e-15);
        let dot = [V::y(); 3];
        assert_eq!(barycentric_point(&dot, closest_point_on_triangle(V::zeros(), &dot)), V::y());
        let found = closest_segment_triangle([V::zeros(), V::zeros()], &dot);
        assert_eq!(found.distance_squared, 1.0);
        let found = closest_segment_triangle([V::zeros(), V::z()], &needle);
        assert_eq!(found.distance_squared, 0.0);
    }

    #[test]
    fn a_segment_through_a_triangle_touches_it_where_it_passes() {
        let t = [V::zeros(), V::x(), V::y()];
        let found = closest_segment_triangle([V::new(0.25, 0.25, -1.0), V::new(0.25, 0.25, 3.0)], &t);
        assert_eq!(found.distance_squared, 0.0);
        assert!((found.parameter - 0.25).abs() < 1e-15);
        assert!((found.barycentric[0] - 0.5).abs() < 1e-15);
    }
}
