//! Material points by their present positions.

use nalgebra::{Matrix3, Vector3};
use scindo_matter::element::MaterialPoint;

/// A barycentric coordinate down to which a point still counts as inside.
const INSIDE: f64 = -1e-6;

/// The box around some points.
pub(crate) struct Bounds;

impl Bounds {
    /// Its corners [m]; `None` without points, or where one of them is not finite.
    pub(crate) fn of(points: &[Vector3<f64>]) -> Option<[Vector3<f64>; 2]> {
        let finite = points.iter().all(|p| p.iter().all(|c| c.is_finite()));
        let (first, rest) = points.split_first().filter(|_| finite)?;
        Some(rest.iter().fold([*first; 2], |[low, high], p| [low.inf(p), high.sup(p)]))
    }
}

/// The material point at `point` [m] in the tetrahedron in which it lies deepest, of those that `accept` takes by
/// their number and the barycentric coordinates; of equals the first. `None` outside all of them.
pub(crate) fn deepest_of(
    tets: impl Iterator<Item = [u32; 4]>,
    x: &[Vector3<f64>],
    point: &Vector3<f64>,
    accept: impl Fn(usize, [f64; 4]) -> bool,
) -> Option<MaterialPoint> {
    let mut best: Option<(f64, MaterialPoint)> = None;
    for (k, copies) in tets.enumerate() {
        let corners = copies.map(|c| x[c as usize]);
        let low = corners.iter().fold(corners[0], |low, p| low.inf(p));
        let high = corners.iter().fold(corners[0], |high, p| high.sup(p));
        if (0..3).any(|k| point[k] < low[k] || point[k] > high[k]) {
            continue;
        }
        let Some(inside) = barycentric(&corners, point) else { continue };
        let depth = inside.into_iter().fold(f64::INFINITY, f64::min);
        if depth >= INSIDE && best.is_none_or(|(most, _)| depth > most) && accept(k, inside) {
            best = Some((depth, MaterialPoint::in_tet(copies, inside)));
        }
    }
    best.map(|(_, found)| found)
}

/// Barycentric coordinates of a point in a tetrahedron; `None` where it has no volume.
pub(crate) fn barycentric(x: &[Vector3<f64>; 4], point: &Vector3<f64>) -> Option<[f64; 4]> {
    let edges = Matrix3::from_columns(&[x[1] - x[0], x[2] - x[0], x[3] - x[0]]);
    let inner = edges.try_inverse()? * (point - x[0]);
    inner.iter().all(|c| c.is_finite()).then(|| [1.0 - inner.sum(), inner.x, inner.y, inner.z])
}
