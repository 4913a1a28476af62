//! The front of an incision: the last blade position, remembered as points of the material.
//!
//! Tissue moves between two samples of a blade. The last blade position is therefore carried along with the
//! material, and the next sweep starts from there. This keeps the incision connected. Nienhuys, ch. 3.3,
//! reports the gaps that appear otherwise.

use nalgebra::{Matrix3, Vector3};

use crate::element::MaterialPoint;

use super::blade::BladeSweep;
use super::sweep_triangle::SweepTriangle;

/// Number of equal parts of the blade. Where an end of a part is in the air, the nearest material is
/// remembered for it.
const AIR_PARTS: usize = 16;

/// Cap on the points that remember one blade position. On a finer mesh only every n-th point is kept.
const MAX_POINTS: usize = 256;

/// Relative length by which a sweep is extended beyond its border and back over the previous one.
///
/// A blade that ends exactly on the skin, or starts exactly where the last sweep ended, must not
/// miss an edge there by a rounding error. The same order as the snapping of crossings.
pub(super) const OVERREACH: f64 = 1e-6;

/// One remembered point.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
struct FrontPoint {
    /// Position along the blade: 0 at the tip, 1 at the heel.
    s: f64,
    /// The material point that carries it.
    anchor: Anchor,
}

/// A material point, and where it was.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
struct Anchor {
    point: MaterialPoint,
    /// Its position when it was remembered [m].
    at: Vector3<f64>,
}

impl Anchor {
    fn new(copies: [u32; 4], weights: [f64; 4], x: &[Vector3<f64>]) -> Option<Self> {
        let point = MaterialPoint::in_tet(copies, weights);
        let at = point.position(x);
        at.iter().all(|c| c.is_finite()).then_some(Self { point, at })
    }
}

/// The body in which a blade position is remembered.
pub struct Surroundings<'a> {
    /// Copies of the tets the blade may pass through.
    pub near: &'a [[u32; 4]],
    /// Copies of the tets around a copy.
    pub around: &'a dyn Fn(u32) -> Vec<[u32; 4]>,
    /// Position of every copy [m].
    pub x: &'a [Vector3<f64>],
}

/// The remembered front of one incision.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct Front {
    segment: [Vector3<f64>; 2],
    points: Vec<FrontPoint>,
}

impl Front {
    /// Remembers the blade `segment` by the material it passes through: by the points where it enters and
    /// leaves a tet. Between these points the front stays straight, however the body deforms. Parts of the
    /// blade in the air follow the nearest material, so tissue that moves onto the blade is cut from its skin
    /// on.
    pub fn remember(segment: &[Vector3<f64>; 2], body: &Surroundings) -> Self {
        let passages: Vec<[FrontPoint; 2]> =
            body.near.iter().filter_map(|&copies| passage(segment, copies, body.x)).collect();
        let in_tissue = |s: f64| passages.iter().any(|[enter, leave]| enter.s <= s && s <= leave.s);
        let in_air: Vec<usize> = (0..=AIR_PARTS).filter(|&k| !in_tissue(air_place(k))).collect();
        let mut points = passages.concat();
        if !in_air.is_empty() {
            let nearest = nearest_copies(segment, body.x);
            points.extend(in_air.iter().filter_map(|&k| air_point(segment, k, nearest[k]?, body)));
        }
        let mut points = in_order(points);
        // Ends beyond the outermost material follow the nearest remembered point.
        if let (Some(&first), Some(&last)) = (points.first(), points.last()) {
            if first.s > 0.0 {
                points.insert(0, FrontPoint { s: 0.0, ..first });
            }
            if last.s < 1.0 {
                points.push(FrontPoint { s: 1.0, ..last });
            }
        }
        Self { segment: *segment, points }
    }

    /// The two ends of the front at the present positions `x` of the copies [m].
    pub fn ends(&self, x: &[Vector3<f64>]) -> [Vector3<f64>; 2] {
        self.now(x).ends()
    }

    /// The copies that carry it.
    pub fn copies(&self) -> impl Iterator<Item = u32> + '_ {
        self.points.iter().flat_map(|p| p.anchor.point.copies().iter().copied())
    }

    /// Takes new numbers of the copies.
    pub fn renumber(&mut self, number: impl Fn(u32) -> u32) {
        self.points.iter_mut().for_each(|p| p.anchor.point = p.anchor.point.renumbered(&number));
    }

    /// The front at the present positions of the copies: only its two ends if nothing has moved.
    fn now(&self, x: &[Vector3<f64>]) -> Row {
        let shifts: Vec<Vector3<f64>> =
            self.points.iter().map(|p| p.anchor.point.position(x) - p.anchor.at).collect();
        if shifts.iter().all(|shift| *shift == Vector3::zeros()) {
            return Row::straight(&self.segment);
        }
        Row {
            s: self.points.iter().map(|p| p.s).collect(),
            points: self.points.iter().zip(shifts).map(|(p, d)| at(&self.segment, p.s) + d).collect(),
        }
    }
}

/// A blade position as a polyline: points, and where along the blade each of them is.
#[derive(Clone, Debug, PartialEq)]
struct Row {
    s: Vec<f64>,
    points: Vec<Vector3<f64>>,
}

impl Row {
    fn straight(segment: &[Vector3<f64>; 2]) -> Self {
        Self { s: vec![0.0, 1.0], points: segment.to_vec() }
    }

    fn ends(&self) -> [Vector3<f64>; 2] {
        [self.points[0], self.points[self.points.len() - 1]]
    }

    /// Points of this row at the positions of `other` along the blade. Both rows are straight or have the
    /// same positions.
    fn at_places_of(&self, other: &Row) -> Vec<Vector3<f64>> {
        if self.s == other.s {
            return self.points.clone();
        }
        other.s.iter().map(|&s| at(&self.ends(), s)).collect()
    }
}

/// Triangles of a sweep that continues `front`, overreach included.
pub fn sweep_triangles(front: Option<&Front>, blade: &BladeSweep, x: &[Vector3<f64>]) -> Vec<SweepTriangle> {
    sweep_from_behind(front, blade, x, 0.0)
}

/// The same, beginning `back_m` [m] behind the front.
pub fn sweep_from_behind(
    front: Option<&Front>,
    blade: &BladeSweep,
    x: &[Vector3<f64>],
    back_m: f64,
) -> Vec<SweepTriangle> {
    let mut rows: Vec<Row> = Vec::with_capacity(blade.segments.len() + 1);
    rows.extend(front.map(|f| f.now(x)));
    rows.extend(blade.segments.iter().map(Row::straight));
    rows.dedup();
    let drawn = rows.clone();
    overreach(&mut rows, if front.is_some() { back_m } else { 0.0 });
    let mut triangles = Vec::with_capacity(2 * rows.iter().map(|r| r.s.len()).sum::<usize>());
    for (pair, drawn) in rows.windows(2).zip(drawn.windows(2)) {
        let [quads, drawn] = [pair, drawn].map(quads);
        for ([a, b, c, d], [p, q, r, s]) in quads.into_iter().zip(drawn) {
            let triangle = |[a, b, c]: [Vector3<f64>; 3], drawn| {
                SweepTriangle::new(a, b, c).map(|triangle| triangle.with_drawn(drawn))
            };
            triangles.extend(triangle([a, b, c], [p, q, r]));
            triangles.extend(triangle([a, c, d], [p, r, s]));
        }
    }
    triangles
}

/// Quadrilaterals swept between two rows, one for each pair of neighbouring points.
fn quads(pair: &[Row]) -> Vec<[Vector3<f64>; 4]> {
    let (from, to) = (&pair[0].points, pair[1].at_places_of(&pair[0]));
    (1..from.len()).map(|k| [from[k - 1], from[k], to[k], to[k - 1]]).collect()
}

/// Widens every row at both ends, and extends the sweep before its first row, by at least `back_m` [m], and beyond its
/// last.
fn overreach(rows: &mut [Row], back_m: f64) {
    let length = |r: &Row| (r.ends()[1] - r.ends()[0]).norm();
    let reach = OVERREACH * rows.iter().map(length).fold(0.0, f64::max);
    let n = rows.len();
    if n < 2 {
        return;
    }
    let push = |row: &Row, away: &Row, reach: f64| -> Vec<Vector3<f64>> {
        let away = away.at_places_of(row);
        row.points.iter().zip(&away).map(|(p, q)| p + unit(p - q) * reach).collect()
    };
    let first = push(&rows[0], &rows[1], reach.max(back_m));
    let last = push(&rows[n - 1], &rows[n - 2], reach);
    rows[0].points = first;
    rows[n - 1].points = last;
    for row in rows {
        let p = &mut row.points;
        let end = p.len() - 1;
        let (tip, heel) = (unit(p[0] - p[1]) * reach, unit(p[end] - p[end - 1]) * reach);
        p[0] += tip;
        p[end] += heel;
    }
}

/// Sorts points along the blade, and keeps one where tets next to each other leave and enter.
fn in_order(mut points: Vec<FrontPoint>) -> Vec<FrontPoint> {
    points.sort_by(|p, q| p.s.total_cmp(&q.s));
    points.dedup_by(|q, p| q.s - p.s < 1e-9);
    let stride = points.len().div_ceil(MAX_POINTS).max(1);
    points.into_iter().step_by(stride).collect()
}

/// The points [m] where a segment enters and leaves the tets `near`, and their material, in order along it.
pub(super) fn line_in_tissue(
    segment: &[Vector3<f64>; 2],
    near: &[[u32; 4]],
    x: &[Vector3<f64>],
) -> Vec<(Vector3<f64>, MaterialPoint)> {
    let passages = near.iter().filter_map(|&copies| passage(segment, copies, x));
    in_order(passages.flatten().collect()).iter().map(|p| (p.anchor.at, p.anchor.point)).collect()
}

fn at([tip, heel]: &[Vector3<f64>; 2], s: f64) -> Vector3<f64> {
    if s == 1.0 { *heel } else { tip + (heel - tip) * s }
}

pub(super) fn unit(v: Vector3<f64>) -> Vector3<f64> {
    v.try_normalize(0.0).unwrap_or_default()
}

/// Where the segment enters and leaves a tet, if it passes through.
fn passage(segment: &[Vector3<f64>; 2], copies: [u32; 4], x: &[Vector3<f64>]) -> Option<[FrontPoint; 2]> {
    let [from, to] = [barycentric(&segment[0], &copies, x)?, barycentric(&segment[1], &copies, x)?];
    let (mut enter, mut leave) = (0.0f64, 1.0f64);
    for (a, b) in from.iter().zip(&to) {
        let zero = a / (a - b);
        if *a < 0.0 && *b < 0.0 {
            return None;
        } else if *a < 0.0 {
            enter = enter.max(zero);
        } else if *b < 0.0 {
            leave = leave.min(zero);
        }
    }
    if enter.partial_cmp(&leave) != Some(std::cmp::Ordering::Less) {
        return None;
    }
    let point = |s: f64| {
        let weights = std::array::from_fn(|k| from[k] + (to[k] - from[k]) * s);
        Some(FrontPoint { s, anchor: Anchor::new(copies, weights, x)? })
    };
    Some([point(enter)?, point(leave)?])
}

/// Position along the blade of division `k`.
fn air_place(k: usize) -> f64 {
    k as f64 / AIR_PARTS as f64
}

/// The front point for division `k` in the air: it follows the closest material around the closest copy.
fn air_point(segment: &[Vector3<f64>; 2], k: usize, nearest: u32, body: &Surroundings) -> Option<FrontPoint> {
    let s = air_place(k);
    Some(FrontPoint { s, anchor: nearest_anchor(&at(segment, s), &(body.around)(nearest), body.x)? })
}

/// For each division of the blade the closest copy among those whose foot on the blade rounds to it.
fn nearest_copies([tip, heel]: &[Vector3<f64>; 2], x: &[Vector3<f64>]) -> [Option<u32>; AIR_PARTS + 1] {
    let axis = heel - tip;
    let length_squared = axis.norm_squared();
    let mut best = [(f64::INFINITY, None); AIR_PARTS + 1];
    for (copy, p) in (0u32..).zip(x) {
        let s =
            if length_squared > 0.0 { ((p - tip).dot(&axis) / length_squared).clamp(0.0, 1.0) } else { 0.0 };
        let distance_squared = (p - (tip + axis * s)).norm_squared();
        let slot = &mut best[(s * AIR_PARTS as f64).round() as usize];
        if distance_squared < slot.0 {
            *slot = (distance_squared, Some(copy));
        }
    }
    best.map(|b| b.1)
}

/// The material point of these tets closest to a point outside them.
fn nearest_anchor(point: &Vector3<f64>, tets: &[[u32; 4]], x: &[Vector3<f64>]) -> Option<Anchor> {
    let mut best: Option<(f64, Anchor)> = None;
    for &copies in tets {
        let Some(weights) = barycentric(point, &copies, x) else { continue };
        let inside = weights.map(|w| w.max(0.0));
        let sum: f64 = inside.iter().sum();
        let Some(anchor) = Anchor::new(copies, inside.map(|w| w / sum), x) else { continue };
        let distance = (anchor.at - point).norm();
        if distance.is_finite() && best.as_ref().is_none_or(|b| distance < b.0) {
            best = Some((distance, anchor));
        }
    }
    best.map(|b| b.1)
}

/// Barycentric coordinates of a point with respect to a tet. The point may lie outside.
pub(super) fn barycentric(point: &Vector3<f64>, copies: &[u32; 4], x: &[Vector3<f64>]) -> Option<[f64; 4]> {
    let [o, a, b, c] = copies.map(|c| x[c as usize]);
    let w = Matrix3::from_columns(&[a - o, b - o, c - o]).try_inverse()? * (point - o);
    Some([1.0 - w.sum(), w.x, w.y, w.z])
}
