//! Broad and narrow phase over deforming surfaces.
//!
//! A [`SurfaceBvh`] holds the triangles of one closed surface, arranged by one of the [methods](Method) of
//! broad phase: a tree of boxes, an octree, a tree of spheres, a spatial hash, or the hierarchy of parry3d. It is refitted in place whenever
//! the surface moved, and after a cut only the changed triangles are arranged anew. It answers three queries for a
//! rigid tool: the closest point and its side, the triangles near a capsule, and the first
//! impact of a moving capsule on the moving surface. Spheres, probes and blades are all capsules: a core
//! segment and a radius. Two queries serve contact between surfaces: the pairs of triangles that are near each
//! other, of one surface with itself and of two surfaces.
//!
//! The crate knows surfaces and capsules, but no bodies, tissue or forces. Positions are in metres. Boxes are
//! `f32`, the format in which surfaces arrive. Distances are computed in `f64`, because the lips of a cut contain
//! triangles so thin that single precision has no normal for them.
//!
//! Order of the modules: conversions, distances between two primitives, methods of broad phase, the surface,
//! proximity queries, impacts, pairs of triangles.

mod convert;
mod distance;
mod broad;
mod stars;
mod surface_bvh;
mod closest;
mod winding;
mod sweep;
mod pairs;

pub use broad::Method;
pub use closest::{ClosestPoint, NearTriangle};
pub use distance::{
    SegmentTriangle, barycentric_point, closest_point_on_segment, closest_point_on_triangle,
    closest_segment_segment, closest_segment_triangle,
};
pub use surface_bvh::{SurfaceBvh, SurfaceError};
pub use sweep::{CapsuleMotion, Impact, SWEEP_TOLERANCE_M};

use nalgebra::Vector3;

/// A segment swept by a sphere: the shape of every rigid tool. A core with equal ends is a sphere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Capsule {
    /// The two ends of the core segment [m].
    pub core: [Vector3<f64>; 2],
    /// Radius around the core [m].
    pub radius: f64,
}

impl Capsule {
    /// The point of the core at `parameter` in 0..=1 [m], 0 at the first end.
    pub fn core_point(&self, parameter: f64) -> Vector3<f64> {
        self.core[0] + (self.core[1] - self.core[0]) * parameter
    }
}
