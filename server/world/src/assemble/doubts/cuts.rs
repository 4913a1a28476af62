//! Scheduled cuts that pass beside their body, or come after the end of the run.

use nalgebra::{Unit, Vector3};
use scindo_collision::SurfaceBvh;

use crate::body::{SimBody, bounds};
use crate::quantity::{coordinates, length};
use crate::scene::{CheckedScene, CutPath, CutSpec};

/// How far from the skin, in cells, a point of a path may lie.
const NEAR: f64 = 2.0;

/// Cuts that pass beside their body, as it lies at the start.
pub(super) fn doubts(cuts: &[CutSpec], bodies: &mut [SimBody], doubts: &mut Vec<String>) {
    for (number, cut) in cuts.iter().enumerate() {
        let Some(body) = bodies.get_mut(cut.body) else { continue };
        match &cut.blade {
            CutPath::Sweep(segments) => sweep(number, segments, body, doubts),
            CutPath::Plane { point_m, normal } => plane(number, *point_m, *normal, body, doubts),
            CutPath::Incision { points, depth_m } => path(number, points, *depth_m, body, doubts),
        }
    }
}

fn sweep(number: usize, segments: &[[Vector3<f64>; 2]], body: &SimBody, doubts: &mut Vec<String>) {
    let (low, high) = bounds(body.body.positions());
    let (from, to) = bounds(segments.iter().flatten());
    if (0..3).any(|axis| to[axis] < low[axis] || from[axis] > high[axis]) {
        doubts.push(format!(
            "cut.{number}.sweep_m: reaches from {} to {} m and passes beside body `{}`, which lies from {} to {} m",
            coordinates(&from.into()),
            coordinates(&to.into()),
            body.id,
            coordinates(&low.into()),
            coordinates(&high.into())
        ));
    }
}

fn plane(
    number: usize,
    point: Vector3<f64>,
    normal: Unit<Vector3<f64>>,
    body: &SimBody,
    doubts: &mut Vec<String>,
) {
    let sides = || body.body.positions().iter().map(|x| normal.dot(&(x - point)));
    if sides().all(|side| side > 0.0) || sides().all(|side| side < 0.0) {
        let (low, high) = bounds(body.body.positions());
        doubts.push(format!(
            "cut.{number}.plane: passes {} beside body `{}`, which lies from {} to {} m",
            length(sides().fold(f64::INFINITY, |least, side| least.min(side.abs()))),
            body.id,
            coordinates(&low.into()),
            coordinates(&high.into())
        ));
    }
}

/// The distance of every point of a path to the skin that it should follow.
fn path(number: usize, points: &[Vector3<f64>], depth_m: f64, body: &mut SimBody, doubts: &mut Vec<String>) {
    let (low, high) = bounds(body.body.positions());
    let (id, cell_m) = (body.id.clone(), body.cell_m());
    let (shown, positions) = body.surface_now();
    let Ok(surface) = SurfaceBvh::new(positions, &shown.surface().triangles) else { return };
    let near_m = depth_m.max(NEAR * cell_m);
    let distance = |point: &Vector3<f64>| {
        surface.closest_point(*point, f64::MAX).map_or(f64::INFINITY, |c| (c.point - point).norm())
    };
    let off: Vec<(usize, f64)> =
        points.iter().map(distance).enumerate().filter(|(_, away)| *away > near_m).collect();
    let Some(&(worst, away_m)) = off.iter().max_by(|a, b| a.1.total_cmp(&b.1)) else { return };
    let misses = if off.len() == points.len() {
        "misses the body altogether".to_owned()
    } else {
        format!("leaves the body at {} of its {} points", off.len(), points.len())
    };
    doubts.push(format!(
        "cut.{number}.path_m: {misses}; point {worst}, {}, lies {} from the skin of `{id}`, which reaches from {} to {} m",
        coordinates(&points[worst].into()),
        length(away_m),
        coordinates(&low.into()),
        coordinates(&high.into())
    ));
}

/// Cuts that a run of `end_s` [s] does not reach.
pub fn after_the_end(scene: &CheckedScene, end_s: f64) -> Vec<String> {
    let late = scene.cuts.iter().enumerate().filter(|(_, cut)| cut.at_s >= end_s);
    late.map(|(number, cut)| {
        format!(
            "cut.{number}.at_s: the cut comes at {} s, after the end of the run at {end_s} s; \
             run longer with --seconds, or cut earlier",
            cut.at_s
        )
    })
    .collect()
}
