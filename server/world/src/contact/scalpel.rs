//! A scalpel: it is drawn over the skin, and the wound is as deep as it is pressed.
//!
//! # Source
//! Jeřábková 2007, 4.1.3 and fig. 4.7: cut path on the surface and depth below it make the wound.

use nalgebra::Vector3;
use scindo_physics::skin::{Penetration, incision};

use super::press::Press;
use crate::tool::Tool;
use crate::tool::geometry::core_radius;

/// Least depth of a wound [m].
const LEAST_M: f64 = 1e-5;

/// Where the scalpel cuts now: from its depth below the skin to above it [m]; `None` where it does not press enough.
/// The depth is the way of the hand beyond the skin, f/k, where the toughness J [J/m²] of the body takes J times the
/// tool's width off the force.
pub(super) fn segment(
    tool: &Tool,
    press: &Press,
    toughness: impl Fn(usize) -> f64,
) -> Option<[Vector3<f64>; 2]> {
    let normal = press.normal()?;
    let body = press.bearings().first()?.body;
    let force_n = tool.force_n.dot(&normal) - toughness(body) * 2.0 * core_radius(tool.shape);
    let depth_m = force_n / tool.stiffness_n_m;
    if depth_m.is_nan() || depth_m < LEAST_M {
        return None;
    }
    let share: f64 = press.bearings().iter().map(|bearing| bearing.share).sum();
    let point_m =
        press.bearings().iter().map(|bearing| bearing.point * bearing.share).sum::<Vector3<f64>>() / share;
    incision(&[Penetration { point_m, normal, depth_m }]).segments.pop()
}
