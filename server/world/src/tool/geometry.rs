//! The geometry of a tool: a core segment with a radius. That of a [compound](super::compound) is its shaft.

use nalgebra::{Isometry3, Point3, Vector3};
use scindo_collision::Capsule;

use crate::inputs::ToolShape;

/// Length of the core from the tip along the shaft [m]; zero for a ball.
pub fn core_length(shape: ToolShape) -> f64 {
    match shape {
        ToolShape::Sphere { .. } => 0.0,
        ToolShape::Capsule { length_m, .. }
        | ToolShape::Blade { length_m, .. }
        | ToolShape::Forceps { length_m, .. }
        | ToolShape::Retractor { length_m, .. }
        | ToolShape::Hook { length_m, .. } => length_m,
    }
}

/// Radius around the core [m]; half the thickness of a blade.
pub fn core_radius(shape: ToolShape) -> f64 {
    match shape {
        ToolShape::Sphere { radius_m }
        | ToolShape::Capsule { radius_m, .. }
        | ToolShape::Forceps { radius_m, .. }
        | ToolShape::Retractor { radius_m, .. }
        | ToolShape::Hook { radius_m, .. } => radius_m,
        ToolShape::Blade { thickness_m, .. } => 0.5 * thickness_m,
    }
}

/// Core segment [tip, heel] in world axes [m].
pub fn core(shape: ToolShape, pose: &Isometry3<f64>) -> [Vector3<f64>; 2] {
    let heel = pose * Point3::new(0.0, 0.0, core_length(shape));
    [pose.translation.vector, heel.coords]
}

/// The tool at `pose` as a capsule in world axes.
pub fn capsule(shape: ToolShape, pose: &Isometry3<f64>) -> Capsule {
    Capsule { core: core(shape, pose), radius: core_radius(shape) }
}

/// Whether a pose may enter the simulation: finite, of unit orientation, within 1000 km.
pub fn is_sane(pose: &Isometry3<f64>) -> bool {
    let p = &pose.translation.vector;
    let q = pose.rotation.coords;
    p.iter().chain(q.iter()).all(|x| x.is_finite()) && p.amax() < 1e6 && (q.norm() - 1.0).abs() < 1e-3
}
