//! One triangle of a swept blade and exact tests against segments.
//!
//! Signs come from Shewchuk's adaptive predicate. A segment end is therefore on one side, on the other, or
//! exactly on the plane, and all triangles of a sweep agree about a shared border. Borders count as inside,
//! so a segment through the seam of two triangles is never missed.

use nalgebra::Vector3;
use robust::Coord3D;

use crate::cut::drawn::traces::part_inside;

/// Relative error allowed for distances from a plane before a box counts as entirely on one side. It is four
/// orders of magnitude above that of double precision.
const ROUNDING: f64 = 1e-12;

/// A triangle in the deformed configuration [m], with its bounds.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
pub struct SweepTriangle {
    /// Corners [m].
    pub corners: [Vector3<f64>; 3],
    /// Corners of the part that the blade itself swept [m], in the same plane.
    pub drawn: [Vector3<f64>; 3],
    /// Smallest corner of the bounding box [m].
    pub low: Vector3<f64>,
    /// Largest corner of the bounding box [m].
    pub high: Vector3<f64>,
    /// Twice the area [m²].
    pub double_area: f64,
    /// (q − p) × (r − p) [m²].
    normal: Vector3<f64>,
    /// |q − p| |r − p| [m²], the scale of rounding in `normal`.
    scale: f64,
    /// Whether signs are exact. Only a test of the tests clears it.
    pub exact: bool,
}

impl SweepTriangle {
    /// The triangle, or none if it has no area.
    pub fn new(p: Vector3<f64>, q: Vector3<f64>, r: Vector3<f64>) -> Option<Self> {
        let normal = (q - p).cross(&(r - p));
        let double_area = normal.norm();
        (double_area > 0.0).then(|| Self {
            normal,
            scale: (q - p).norm() * (r - p).norm(),
            corners: [p, q, r],
            drawn: [p, q, r],
            low: p.inf(&q).inf(&r),
            high: p.sup(&q).sup(&r),
            double_area,
            exact: true,
        })
    }

    /// The same triangle, of which the blade itself swept only the part `drawn`. The rest is overreach.
    pub fn with_drawn(self, drawn: [Vector3<f64>; 3]) -> Self {
        Self { drawn, ..self }
    }

    /// Six times the signed volume of the tetrahedron spanned with `x` [m³]. The sign is exact.
    pub fn side(&self, x: &Vector3<f64>) -> f64 {
        let [p, q, r] = &self.corners;
        self.orient(p, q, r, x)
    }

    /// Whether the line through `a` and `b` meets the triangle, its border included. The two points must lie
    /// on different sides of the plane, or one of them on it.
    pub fn holds_line(&self, a: &Vector3<f64>, b: &Vector3<f64>) -> bool {
        let [p, q, r] = &self.corners;
        let s = [self.orient(a, b, p, q), self.orient(a, b, q, r), self.orient(a, b, r, p)];
        s.iter().all(|&v| v >= 0.0) || s.iter().all(|&v| v <= 0.0)
    }

    /// Whether the segment from `a` to `b` meets the triangle, borders included. A segment inside the
    /// plane does not count.
    pub fn meets(&self, a: &Vector3<f64>, b: &Vector3<f64>) -> bool {
        let (low, high) = (a.inf(b), a.sup(b));
        if !self.overlaps(&low, &high) {
            return false;
        }
        let (s, t) = (self.side(a), self.side(b));
        let apart = (s <= 0.0 && t >= 0.0) || (s >= 0.0 && t <= 0.0);
        apart && (s != 0.0 || t != 0.0) && self.holds_line(a, b)
    }

    /// The part of a segment in the plane, as parameters from 0 to 1, that lies in the area the blade itself
    /// swept.
    pub fn part_of(&self, segment: &[Vector3<f64>; 2]) -> Option<[f64; 2]> {
        let [p, q, r] = self.drawn;
        let normal = (q - p).cross(&(r - p));
        if normal == Vector3::zeros() {
            return None;
        }
        part_inside([[p, q], [q, r], [r, p]].map(|[a, b]| {
            let inward = normal.cross(&(b - a));
            segment.map(|x| inward.dot(&(x - a)))
        }))
    }

    /// Whether the bounding box overlaps the box between `low` and `high`.
    pub fn overlaps(&self, low: &Vector3<f64>, high: &Vector3<f64>) -> bool {
        (0..3).all(|k| self.low[k] <= high[k] && low[k] <= self.high[k])
    }

    /// Whether the plane may pass through a box. It is false only where every point of the box is on one
    /// side, whatever the rounding.
    pub fn may_cross(&self, low: &Vector3<f64>, high: &Vector3<f64>) -> bool {
        let half = (high - low) * 0.5;
        let from = low + half - self.corners[0];
        let distance = self.normal.dot(&from).abs();
        let reach = self.normal.abs().dot(&half);
        let rounding = ROUNDING * self.scale * (from.lp_norm(1) + half.lp_norm(1));
        distance.partial_cmp(&(reach + rounding)) != Some(std::cmp::Ordering::Greater)
    }

    fn orient(&self, p: &Vector3<f64>, q: &Vector3<f64>, r: &Vector3<f64>, x: &Vector3<f64>) -> f64 {
        if !self.exact {
            return -(q - p).cross(&(r - p)).dot(&(x - p));
        }
        let c = |v: &Vector3<f64>| Coord3D { x: v.x, y: v.y, z: v.z };
        robust::orient3d(c(p), c(q), c(r), c(x))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn a_segment_through_the_seam_of_two_triangles_meets_both() {
        let p = |x: f64, y: f64| Vector3::new(x, y, 0.0);
        let first = SweepTriangle::new(p(0.0, 0.0), p(1.0, 0.0), p(1.0, 1.0)).unwrap();
        let second = SweepTriangle::new(p(0.0, 0.0), p(1.0, 1.0), p(0.0, 1.0)).unwrap();
        for s in [0.0, 0.1, 1.0 / 3.0, 1.0] {
            let (a, b) = (Vector3::new(s, s, -0.3), Vector3::new(s, s, 0.7));
            assert!(first.meets(&a, &b) && second.meets(&a, &b), "at {s}");
        }
        assert!(!first.meets(&Vector3::new(0.2, 0.8, -1.0), &Vector3::new(0.2, 0.8, 1.0)));
    }

    #[test]
    fn a_box_that_may_not_cross_has_no_corner_on_the_other_side() {
        let mut state = 7u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 40) as f64 / f64::from(1 << 24)
        };
        let mut point = |scale: f64| Vector3::new(random(), random(), random()) * scale;
        let mut apart = 0;
        for k in 0..20_000 {
            let flat = if k % 4 == 0 { 1e-9 } else { 1.0 };
            let p = point(1.0);
            let Some(t) = SweepTriangle::new(p, p + point(1.0), p + point(flat)) else { continue };
            let (a, b) = (point(1.0), point(0.2));
            let (low, high) = (a, a + b);
            if t.may_cross(&low, &high) {
                continue;
            }
            apart += 1;
            let corners =
                (0..8).map(|c| Vector3::from_fn(|i, _| if c >> i & 1 == 0 { low[i] } else { high[i] }));
            let sides: Vec<f64> = corners.map(|x| t.side(&x)).collect();
            assert!(sides.iter().all(|s| *s > 0.0) || sides.iter().all(|s| *s < 0.0), "{t:?} {sides:?}");
        }
        assert!(apart > 5_000, "{apart}");
    }

    #[test]
    fn a_triangle_without_area_is_none() {
        let p = Vector3::new(1.0, 2.0, 3.0);
        assert!(SweepTriangle::new(p, p, Vector3::x()).is_none());
    }
}
