//! Proximity queries: the closest point of a surface, and all triangles near a capsule.

use crate::Capsule;
use crate::broad::BroadPhase;
use crate::broad::probe::{NearPoint, NearSegment, Probe};
use crate::distance::{
    SegmentTriangle, barycentric_point, closest_point_on_triangle, closest_segment_triangle,
};
use crate::surface_bvh::SurfaceBvh;
use nalgebra::Vector3;

type V = Vector3<f64>;

/// The point of a surface closest to a query point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClosestPoint {
    /// The triangle it lies on.
    pub triangle: u32,
    /// Barycentric coordinates on that triangle.
    pub barycentric: [f64; 3],
    /// Position of the point [m].
    pub point: V,
    /// Outward unit normal: the face's, or the angle-weighted mean at an edge or a vertex.
    pub normal: V,
    /// Distance to the query point [m], negative inside.
    ///
    /// Where two sheets of a surface overlap or coincide, as the lips of a closed cut do, the sign given by
    /// the nearest sheet may be wrong. [`SurfaceBvh::contains`] is not affected.
    pub signed_distance: f64,
}

/// A triangle within reach of a capsule.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NearTriangle {
    /// Index of the triangle.
    pub triangle: u32,
    /// Closest points of the capsule's core and the triangle.
    pub closest: SegmentTriangle,
    /// Distance from the core to the triangle [m].
    pub distance: f64,
}

impl SurfaceBvh {
    /// The point of the surface closest to `p` [m], no farther than `reach` [m]. Of triangles that are equally
    /// close it names the first.
    pub fn closest_point(&self, p: V, reach: f64) -> Option<ClosestPoint> {
        self.closest_point_where(p, reach, |_| true)
    }

    /// The point closest to `p` [m] on the triangles that `accept` takes, no farther than `reach` [m].
    pub fn closest_point_where(
        &self,
        p: V,
        reach: f64,
        accept: impl Fn(u32) -> bool,
    ) -> Option<ClosestPoint> {
        let distance = |t| accept(t).then(|| self.closest_on(t, p));
        let (triangle, w) = self.nearest(&NearPoint::<true>(p), reach, distance)?;
        Some(self.closest(p, triangle, w))
    }

    /// The point closest to `p` [m] on these triangles, no farther than `reach` [m]: as
    /// [`closest_point_where`](Self::closest_point_where) accepts them, without a search. They come with a lower bound of
    /// their distance [m], ascending, so that only the first of them are measured.
    pub fn closest_point_among(
        &self,
        p: V,
        reach: f64,
        triangles: impl Iterator<Item = (f64, u32)>,
    ) -> Option<ClosestPoint> {
        let mut best: Option<(f64, u32, [f64; 3])> = None;
        let mut least = limit(reach);
        for (bound, t) in triangles {
            if bound > 0.0 && bound * bound > least {
                break;
            }
            if NearPoint::<true>(p).to_box(&self.boxes()[t as usize]) > least {
                continue;
            }
            let (squared, w) = self.closest_on(t, p);
            let better = best.is_none_or(|(_, first, _)| squared < least || squared == least && t < first);
            if squared <= least && better {
                (least, best) = (squared, Some((squared, t, w)));
            }
        }
        best.map(|(_, triangle, w)| self.closest(p, triangle, w))
    }

    /// Squared distance [m²] from `p` to a triangle, and the barycentric coordinates of the closest point.
    fn closest_on(&self, t: u32, p: V) -> (f64, [f64; 3]) {
        let triangle = self.triangle(t);
        let w = closest_point_on_triangle(p, &triangle);
        ((barycentric_point(&triangle, w) - p).norm_squared(), w)
    }

    fn closest(&self, p: V, triangle: u32, w: [f64; 3]) -> ClosestPoint {
        let point = barycentric_point(&self.triangle(triangle), w);
        let normal = self.normal_at(triangle, w);
        let distance = (p - point).norm();
        let inside = (p - point).dot(&normal) < 0.0;
        let signed_distance = if inside { -distance } else { distance };
        ClosestPoint { triangle, barycentric: w, point, normal, signed_distance }
    }

    /// The triangle closest to the core of `capsule`, no farther from it than radius + `reach` [m]. Of triangles
    /// that are equally close it names the first.
    pub fn closest_triangle(&self, capsule: &Capsule, reach: f64) -> Option<NearTriangle> {
        let distance = |t: u32| {
            let closest = closest_segment_triangle(capsule.core, &self.triangle(t));
            Some((closest.distance_squared, closest))
        };
        let (triangle, closest) =
            self.nearest(&NearSegment::<true>(capsule.core), capsule.radius + reach, distance)?;
        Some(NearTriangle { triangle, closest, distance: closest.distance_squared.sqrt() })
    }

    /// The triangle with the smallest squared distance [m²] of all within `reach` [m] of a segment or a point, and
    /// what was found with the distance.
    fn nearest<T>(
        &self,
        probe: &impl Probe,
        reach: f64,
        distance: impl Fn(u32) -> Option<(f64, T)>,
    ) -> Option<(u32, T)> {
        let limit = limit(reach);
        let mut best: Option<(f64, u32, T)> = None;
        self.index().search(self.boxes(), probe, limit, |t, now| {
            let Some((squared, value)) = distance(t) else { return };
            let better = best
                .as_ref()
                .is_none_or(|(least, first, _)| squared < *least || squared == *least && t < *first);
            if squared <= limit && better {
                best = Some((squared, t, value));
                *now = now.min(squared);
            }
        });
        best.map(|(_, t, value)| (t, value))
    }

    /// Visits every triangle no farther from the surface of `capsule` than `reach` [m], once each. The order is
    /// the same in every run.
    pub fn triangles_near(&self, capsule: &Capsule, reach: f64, mut visit: impl FnMut(NearTriangle)) {
        let limit = capsule.radius + reach;
        let squared = limit * limit;
        self.index().search(self.boxes(), &NearSegment::<false>(capsule.core), squared, |triangle, _| {
            let closest = closest_segment_triangle(capsule.core, &self.triangle(triangle));
            if closest.distance_squared <= squared {
                let distance = closest.distance_squared.sqrt();
                visit(NearTriangle { triangle, closest, distance });
            }
        });
    }

    /// Visits every triangle that `accept` takes and that is no farther from `p` [m] than `reach` [m], with its
    /// distance [m], once each. The order is the same in every run.
    pub fn triangles_near_point(
        &self,
        p: V,
        reach: f64,
        accept: impl Fn(u32) -> bool,
        mut visit: impl FnMut(u32, f64),
    ) {
        let limit = reach * reach;
        self.index().search(self.boxes(), &NearPoint::<false>(p), limit, |triangle, _| {
            if !accept(triangle) {
                return;
            }
            let (squared, _) = self.closest_on(triangle, p);
            if squared <= limit {
                visit(triangle, squared.sqrt());
            }
        });
    }

    /// Outward unit normal at a point of a triangle. Inside the triangle it is that of the face, on edges and
    /// corners the pseudo-normal, which separates inside from outside everywhere on a closed surface.
    ///
    /// # Source
    /// Bærentzen and Aanæs, Signed distance computation using the angle weighted pseudonormal
    /// (2005).
    pub fn normal_at(&self, triangle: u32, barycentric: [f64; 3]) -> V {
        let corners = self.corners(triangle);
        let sum = match barycentric.map(|w| w > 0.0) {
            [true, true, true] => self.area_normal(triangle),
            [true, false, false] => self.vertex_normal(corners[0]),
            [false, true, false] => self.vertex_normal(corners[1]),
            [false, false, true] => self.vertex_normal(corners[2]),
            [true, true, false] => self.edge_normal(corners[0], corners[1]),
            [false, true, true] => self.edge_normal(corners[1], corners[2]),
            _ => self.edge_normal(corners[2], corners[0]),
        };
        let vertex_mean = || corners.iter().map(|&v| self.vertex_normal(v)).sum::<V>();
        unit(sum)
            .or_else(|| unit(self.area_normal(triangle)))
            .or_else(|| unit(vertex_mean()))
            .unwrap_or_else(V::z)
    }

    /// Outward normal of a triangle, with a length of twice the area [m²].
    pub fn area_normal(&self, triangle: u32) -> V {
        let [a, b, c] = self.triangle(triangle);
        (b - a).cross(&(c - a))
    }

    fn edge_normal(&self, i: u32, j: u32) -> V {
        self.star(i).filter(|&t| self.corners(t).contains(&j)).filter_map(|t| unit(self.area_normal(t))).sum()
    }

    /// Normal of a vertex: those of its triangles, weighted by their angles there. Its length says nothing.
    fn vertex_normal(&self, v: u32) -> V {
        let weighted = |t: u32| {
            let corners = self.corners(t);
            let at = corners.iter().position(|&c| c == v)?;
            let p = self.triangle(t);
            let (e, f) = (p[(at + 1) % 3] - p[at], p[(at + 2) % 3] - p[at]);
            Some(unit(e.cross(&f))? * e.angle(&f))
        };
        self.star(v).filter_map(weighted).sum()
    }
}

/// The largest squared distance within `reach`. It is rounded up, so that what is exactly within reach is found.
fn limit(reach: f64) -> f64 {
    (reach * reach * 1.000_001).min(f64::MAX)
}

fn unit(v: V) -> Option<V> {
    v.try_normalize(f64::MIN_POSITIVE.sqrt())
}
