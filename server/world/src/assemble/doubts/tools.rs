//! Tools whose size is not that of a hand's, or whose path meets nothing.

use nalgebra::Vector3;

use super::longest_side;
use crate::body::{SimBody, bounds};
use crate::inputs::{ToolMode, ToolShape};
use crate::quantity::length;
use crate::scene::ToolSpec;

/// A blade may be so many times as long as the longest body.
const BLADE: f64 = 10.0;
/// Places looked at between two points of a path.
const PLACES: usize = 16;

/// Doubts about `tools` among `bodies` as they lie at the start.
pub(super) fn doubts(tools: &[ToolSpec], bodies: &[SimBody], doubts: &mut Vec<String>) {
    let longest_m = bodies.iter().map(longest_side).fold(0.0, f64::max);
    if bodies.is_empty() {
        return;
    }
    for tool in tools {
        let at = format!("tool.{}", tool.id);
        size(&at, tool, longest_m, doubts);
        reach(&at, tool, bodies, doubts);
    }
}

fn size(at: &str, tool: &ToolSpec, longest_m: f64, doubts: &mut Vec<String>) {
    let (key, size_m, allowed_m) = match tool.shape {
        ToolShape::Sphere { radius_m } => ("sphere.radius_m", radius_m, longest_m),
        ToolShape::Capsule { radius_m, .. } => ("capsule.radius_m", radius_m, longest_m),
        ToolShape::Blade { length_m, .. } => ("blade.length_m", length_m, BLADE * longest_m),
        ToolShape::Forceps { opening_m, .. } => ("forceps.opening_m", opening_m, longest_m),
        ToolShape::Retractor { radius_m, .. } => ("retractor.radius_m", radius_m, longest_m),
        ToolShape::Hook { radius_m, .. } => ("hook.radius_m", radius_m, longest_m),
    };
    if size_m > allowed_m {
        doubts.push(format!(
            "{at}.shape.{key}: {} is more than the length of the longest body ({}); is it in metres?",
            length(size_m),
            length(longest_m)
        ));
    }
}

/// A scripted tool that comes near no body.
fn reach(at: &str, tool: &ToolSpec, bodies: &[SimBody], doubts: &mut Vec<String>) {
    let acts = |mode: ToolMode| mode != ToolMode::Hover;
    if !tool.path.iter().any(|point| acts(point.mode)) {
        return;
    }
    let (radius_m, shaft_m) = match tool.shape {
        ToolShape::Sphere { radius_m } => (radius_m, 0.0),
        ToolShape::Capsule { radius_m, length_m } => (radius_m, length_m),
        ToolShape::Blade { length_m, thickness_m } => (thickness_m, length_m),
        ToolShape::Forceps { radius_m, length_m, opening_m, .. } => (radius_m + 0.5 * opening_m, length_m),
        ToolShape::Retractor { radius_m, length_m, width_m, .. } => (radius_m + 0.5 * width_m, length_m),
        ToolShape::Hook { radius_m, length_m, reach_m, .. } => (radius_m + reach_m, length_m),
    };
    let boxes: Vec<_> = bodies.iter().map(|body| bounds(body.body.positions())).collect();
    let mut nearest_m = f64::INFINITY;
    let mut look = |tip: Vector3<f64>, toward: Vector3<f64>| {
        for place in 0..=PLACES {
            let point = tip + toward * (shaft_m * place as f64 / PLACES as f64);
            let away = |(low, high): &(Vector3<f64>, Vector3<f64>)| (point - point.sup(low).inf(high)).norm();
            nearest_m = boxes.iter().map(away).fold(nearest_m, f64::min);
        }
    };
    for pair in tool.path.windows(2).filter(|pair| acts(pair[0].mode) || acts(pair[1].mode)) {
        for place in 0..=PLACES {
            let s = place as f64 / PLACES as f64;
            look(pair[0].tip_m.lerp(&pair[1].tip_m, s), pair[0].toward.lerp(&pair[1].toward, s));
        }
    }
    if let [only] = &tool.path[..] {
        look(only.tip_m, only.toward.into_inner());
    }
    if nearest_m > radius_m {
        doubts.push(format!(
            "{at}.path: the tool never comes nearer than {} to the initial position of a body; check the path, \
            which is in metres",
            length(nearest_m - radius_m)
        ));
    }
}
