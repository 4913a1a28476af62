//! An incision along a path on a body's skin, to a depth.

use nalgebra::Vector3;
use scindo_collision::SurfaceBvh;
use scindo_physics::cut::BladeSweep;
use scindo_physics::skin::{Penetration, incision};

use crate::body::SimBody;

/// Most places of the blade between two points of the path.
const MAX_PLACES: usize = 16;

/// The blade that cuts `depth_m` [m] into the skin of `body` as it is now, along the skin near `points`
/// [m]; it is placed at least every `spacing_m` [m] where that takes few places.
///
/// # Errors
/// Where the body has no surface.
pub(super) fn incision_along(
    body: &mut SimBody,
    points: &[Vector3<f64>],
    depth_m: f64,
    spacing_m: f64,
) -> Result<BladeSweep, String> {
    let (shown, positions) = body.surface_now();
    let surface =
        SurfaceBvh::new(positions, &shown.surface().triangles).map_err(|error| error.to_string())?;
    let mut path = Vec::new();
    for pair in points.windows(2) {
        let places = ((pair[1] - pair[0]).norm() / spacing_m).ceil().clamp(1.0, MAX_PLACES as f64) as usize;
        let from = usize::from(!path.is_empty());
        for place in from..=places {
            let near = pair[0] + (pair[1] - pair[0]) * (place as f64 / places as f64);
            let closest = surface.closest_point(near, f64::MAX);
            let Some(c) = closest else { return Err("the body has no surface to cut into".into()) };
            path.push(Penetration { point_m: c.point, normal: c.normal, depth_m });
        }
    }
    Ok(incision(&path))
}
