//! Broad and narrow phase over deforming surfaces.
//!
//! A [`SurfaceBvh`] holds the triangles of one closed surface in a bounding volume hierarchy
//! (parry3d's), built once per topology and refitted in place whenever the surface moved. It
//! answers what a rigid tool needs to know: the closest point and the side it lies on, the
//! triangles near a capsule, and the first impact of a capsule that moves while the surface
//! moves. Spheres, probes and blades are all capsules: a core segment and a radius.
//!
//! The crate knows surfaces and capsules, not bodies, tissue or forces. Positions are metres.
//! The tree stores `f32`, as surfaces arrive; distances are computed in `f64`, because the lips
//! of a cut hold triangles so thin that single precision has no normal for them.
//!
//! Order of the modules: conversions, distances between two primitives, the tree, what is near,
//! what will be hit.

mod convert;
mod distance;
mod surface_bvh;
mod closest;
mod winding;
mod sweep;

pub use closest::{ClosestPoint, NearTriangle};
pub use distance::{
    SegmentTriangle, barycentric_point, closest_point_on_segment, closest_point_on_triangle,
    closest_segment_segment, closest_segment_triangle,
};
pub use surface_bvh::{SurfaceBvh, SurfaceError};
pub use sweep::{CapsuleMotion, Impact, SWEEP_TOLERANCE_M};

use nalgebra::Vector3;

/// A segment swept by a sphere: the shape of every rigid tool. Equal ends make a sphere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Capsule {
    /// The two ends of the core segment [m].
    pub core: [Vector3<f64>; 2],
    /// Radius around the core [m].
    pub radius: f64,
}

impl Capsule {
    /// The point of the core at `parameter` in 0..=1 [m].
    pub fn core_point(&self, parameter: f64) -> Vector3<f64> {
        self.core[0] + (self.core[1] - self.core[0]) * parameter
    }
}
