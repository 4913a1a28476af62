//! The front of an incision: where the blade was last, remembered as points of the material.
//!
//! Tissue moves between two samples of a blade. Taking the last blade position along with the
//! material and sweeping on from there keeps the incision in one piece (Nienhuys, ch. 3.3, reports
//! the gaps that appear otherwise).

use nalgebra::{Matrix3, Vector3};

use super::blade::BladeSweep;
use super::sweep_triangle::SweepTriangle;

/// Points the last blade position is remembered by, less one. Between them the front is straight.
const PARTS: usize = 8;

/// Relative length by which a sweep reaches beyond its border and back over the last one.
///
/// A blade that ends exactly on the skin, or starts exactly where the last sweep ended, must not
/// miss an edge there by a rounding error. The same order as the snapping of crossings.
const OVERREACH: f64 = 1e-6;

/// One remembered point.
#[derive(Clone, Copy, Debug)]
struct FrontPoint {
    /// Where the blade was [m].
    world: Vector3<f64>,
    /// The material around it.
    anchor: Option<Anchor>,
}

/// A material point, possibly outside of its tet: Σ weights · x\[copies\].
#[derive(Clone, Copy, Debug)]
struct Anchor {
    copies: [u32; 4],
    weights: [f64; 4],
    at: Vector3<f64>,
}

impl Anchor {
    fn position(&self, x: &[Vector3<f64>]) -> Vector3<f64> {
        self.copies.iter().zip(&self.weights).map(|(&c, &w)| x[c as usize] * w).sum()
    }
}

/// The remembered front of one incision.
#[derive(Clone, Debug, Default)]
pub struct Front {
    points: Vec<FrontPoint>,
}

/// The body a blade position is remembered in.
pub struct Surroundings<'a> {
    /// Copies of the tets the blade may pass through.
    pub near: &'a [[u32; 4]],
    /// Copies of the tets around a copy.
    pub around: &'a dyn Fn(u32) -> Vec<[u32; 4]>,
    /// Position of every copy [m].
    pub x: &'a [Vector3<f64>],
}

impl Front {
    /// Remembers the blade `segment` by the material it passes through. Parts of it in the air go
    /// with the nearest material, so that tissue which moves onto the blade is cut from its skin on.
    pub fn remember(segment: &[Vector3<f64>; 2], body: &Surroundings) -> Self {
        let worlds: Vec<Vector3<f64>> = (0..=PARTS).map(|k| along(segment, k)).collect();
        let mut anchors: Vec<Option<Anchor>> = worlds.iter().map(|p| anchor(p, body.near, body.x)).collect();
        if anchors.iter().all(Option::is_none) {
            anchors = nearest_copies(segment, body.x)
                .iter()
                .zip(&worlds)
                .map(|(copy, p)| nearest_anchor(p, &(body.around)((*copy)?), body.x))
                .collect();
        }
        let known: Vec<usize> = (0..=PARTS).filter(|&k| anchors[k].is_some()).collect();
        let of = |k: usize| anchors[*known.iter().min_by_key(|n| n.abs_diff(k))?];
        let points = worlds.iter().enumerate().map(|(k, &world)| FrontPoint { world, anchor: of(k) });
        Self { points: points.collect() }
    }

    /// The front where the material is now, and whether it has moved at all.
    fn now(&self, x: &[Vector3<f64>]) -> (Vec<Vector3<f64>>, bool) {
        let mut moved = false;
        let points = self.points.iter().map(|p| {
            let shift = p.anchor.map_or(Vector3::zeros(), |a| a.position(x) - a.at);
            moved |= shift != Vector3::zeros();
            p.world + shift
        });
        (points.collect(), moved)
    }
}

/// Triangles of a sweep that continues `front`, with the overreach applied.
pub fn sweep_triangles(front: Option<&Front>, blade: &BladeSweep, x: &[Vector3<f64>]) -> Vec<SweepTriangle> {
    let mut rows: Vec<Vec<Vector3<f64>>> = Vec::with_capacity(blade.segments.len() + 1);
    if let Some((points, moved)) = front.filter(|f| !f.points.is_empty()).map(|f| f.now(x)) {
        rows.push(if moved { points } else { vec![points[0], points[PARTS]] });
    }
    rows.extend(blade.segments.iter().map(|s| s.to_vec()));
    rows.dedup();
    overreach(&mut rows);
    let mut triangles = Vec::with_capacity(2 * rows.len() + 2 * PARTS);
    for pair in rows.windows(2) {
        let (from, to) = (&pair[0], resampled(&pair[1], pair[0].len()));
        for k in 1..from.len() {
            triangles.extend(SweepTriangle::new(from[k - 1], from[k], to[k]));
            triangles.extend(SweepTriangle::new(from[k - 1], to[k], to[k - 1]));
        }
    }
    triangles
}

/// Widens every row at both ends, moves the first row back and the last one on.
fn overreach(rows: &mut [Vec<Vector3<f64>>]) {
    let reach = OVERREACH * rows.iter().map(|r| (r[r.len() - 1] - r[0]).norm()).fold(0.0, f64::max);
    let n = rows.len();
    if n < 2 {
        return;
    }
    let push = |row: &[Vector3<f64>], away: &[Vector3<f64>]| -> Vec<Vector3<f64>> {
        let away = resampled(away, row.len());
        row.iter().zip(&away).map(|(p, q)| p + unit(p - q) * reach).collect()
    };
    let first = push(&rows[0], &rows[1]);
    let last = push(&rows[n - 1], &rows[n - 2]);
    rows[0] = first;
    rows[n - 1] = last;
    for row in rows {
        let end = row.len() - 1;
        let (tip, heel) = (unit(row[0] - row[1]) * reach, unit(row[end] - row[end - 1]) * reach);
        row[0] += tip;
        row[end] += heel;
    }
}

/// The row with `n` points: itself, or its straight line from end to end.
fn resampled(row: &[Vector3<f64>], n: usize) -> Vec<Vector3<f64>> {
    if row.len() == n {
        return row.to_vec();
    }
    let (tip, heel) = (row[0], row[row.len() - 1]);
    (0..n).map(|k| tip + (heel - tip) * (k as f64 / (n - 1) as f64)).collect()
}

fn along(segment: &[Vector3<f64>; 2], k: usize) -> Vector3<f64> {
    let [tip, heel] = segment;
    if k == PARTS { *heel } else { tip + (heel - tip) * (k as f64 / PARTS as f64) }
}

fn unit(v: Vector3<f64>) -> Vector3<f64> {
    v.try_normalize(0.0).unwrap_or_default()
}

/// The tet that holds the point, if any; the best one where several touch it.
fn anchor(point: &Vector3<f64>, tets: &[[u32; 4]], x: &[Vector3<f64>]) -> Option<Anchor> {
    let mut best: Option<(f64, Anchor)> = None;
    for copies in tets {
        let corners = copies.map(|c| x[c as usize]);
        let inside = (0..3).all(|k| {
            let (low, high) = corners
                .iter()
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), c| (l.min(c[k]), h.max(c[k])));
            low <= point[k] && point[k] <= high
        });
        if !inside {
            continue;
        }
        let Some(a) = bind(point, copies, x) else { continue };
        let least = a.weights.iter().copied().fold(f64::INFINITY, f64::min);
        if least >= -1e-9 && best.as_ref().is_none_or(|b| least > b.0) {
            best = Some((least, a));
        }
    }
    best.map(|b| b.1)
}

/// For each remembered point the copy closest to the blade in that stretch, if there is one.
fn nearest_copies([tip, heel]: &[Vector3<f64>; 2], x: &[Vector3<f64>]) -> [Option<u32>; PARTS + 1] {
    let axis = heel - tip;
    let length_squared = axis.norm_squared();
    let mut best = [(f64::INFINITY, None); PARTS + 1];
    for (copy, p) in (0u32..).zip(x) {
        let s =
            if length_squared > 0.0 { ((p - tip).dot(&axis) / length_squared).clamp(0.0, 1.0) } else { 0.0 };
        let distance_squared = (p - (tip + axis * s)).norm_squared();
        let slot = &mut best[(s * PARTS as f64).round() as usize];
        if distance_squared < slot.0 {
            *slot = (distance_squared, Some(copy));
        }
    }
    best.map(|b| b.1)
}

/// The material point of these tets closest to a point outside of them.
fn nearest_anchor(point: &Vector3<f64>, tets: &[[u32; 4]], x: &[Vector3<f64>]) -> Option<Anchor> {
    let mut best: Option<(f64, Anchor)> = None;
    for copies in tets {
        let Some(mut a) = bind(point, copies, x) else { continue };
        a.weights = a.weights.map(|w| w.max(0.0));
        let sum: f64 = a.weights.iter().sum();
        a.weights = a.weights.map(|w| w / sum);
        a.at = a.position(x);
        let distance = (a.at - point).norm();
        if distance.is_finite() && best.as_ref().is_none_or(|b| distance < b.0) {
            best = Some((distance, a));
        }
    }
    best.map(|b| b.1)
}

/// Barycentric weights of the point in the tet, which may lie outside of it.
fn bind(point: &Vector3<f64>, copies: &[u32; 4], x: &[Vector3<f64>]) -> Option<Anchor> {
    let [o, a, b, c] = copies.map(|c| x[c as usize]);
    let w = Matrix3::from_columns(&[a - o, b - o, c - o]).try_inverse()? * (point - o);
    let mut anchor = Anchor { copies: *copies, weights: [1.0 - w.sum(), w.x, w.y, w.z], at: *point };
    anchor.at = anchor.position(x);
    anchor.at.iter().all(|c| c.is_finite()).then_some(anchor)
}
