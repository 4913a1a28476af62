//! Borders of earlier sweeps. A sweep that shares a part of one goes on with that cut.
//!
//! A sweep that ends inside an element leaves it closed. If another incision begins there, each of the two has
//! crossed a part of the element's edges, and neither has cut it apart. Incisions that share a part of their borders, or
//! overlap in a plane, are therefore parts of one cut, in whatever order and direction they were swept: each takes over
//! what earlier parts have crossed and not cut in the elements that it meets itself.
//!
//! A border is a line of the material. It counts where it was given and where the tissue has carried it since. In
//! the first case the sweep is extended to where the border is now.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use nalgebra::Vector3;

use super::blade::BladeSweep;
use super::front::{Front, OVERREACH, barycentric, line_in_tissue, unit};
use super::sweep_triangle::SweepTriangle;
use crate::element::MaterialPoint;

/// Distance between two borders that count as one, over the size of a cell.
const TOLERANCE: f64 = 0.05;

/// Distance, over the size of a cell, by which tissue may have moved since its border was given. A cut at the same
/// place in tissue that has moved farther is another cut.
const MAX_DRIFT: f64 = 2.0;

/// Largest sine of the angle between two borders that are one.
const MAX_SINE: f64 = 0.25;

/// Most borders of a body that are remembered, the latest of all.
const MAX_BORDERS: usize = 1024;

/// A straight part of the border of a sweep.
#[derive(Clone, Copy, Debug)]
pub struct Edge {
    /// Its ends [m].
    ends: [Vector3<f64>; 2],
    /// A point of the sweep beside it [m].
    inner: Vector3<f64>,
    /// Whether further sweeps of the incision begin there.
    is_last: bool,
}

/// The borders of the sweeps through one body.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct Borders {
    lines: VecDeque<Line>,
    /// The cut that an incision is a part of, if it has joined another one: the number of one of its incisions.
    cut_of: BTreeMap<u32, u32>,
}

/// Copies of the tets that may meet the box between two corners [m].
type Near<'a> = dyn Fn(&[Vector3<f64>; 2]) -> Vec<[u32; 4]> + 'a;

/// What a sweep joins.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct Adjoining {
    /// Incisions whose border it shares, ascending.
    pub incisions: Vec<u32>,
    /// All incisions near the sweep that are parts of the same cut, these included, ascending.
    pub parts: Vec<u32>,
    /// Triangles [m] between its border and theirs.
    pub triangles: Vec<SweepTriangle>,
}

/// A border, as far as it lies in tissue.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
struct Line {
    incision: u32,
    /// Whether further sweeps of the incision begin there.
    is_last: bool,
    /// Direction into its sweep where it was given.
    inwards: Vector3<f64>,
    /// Where it was given [m], and the material that was there, in order along it.
    points: Vec<(Vector3<f64>, MaterialPoint)>,
}

/// Sizes that decide what is joined.
#[derive(Clone, Copy, Debug)]
pub struct JoinSizes {
    /// Size of a cell of the body [m].
    pub cell_m: f64,
    /// Distance by which a sweep begins behind the border that it joins [m].
    pub back_m: f64,
}

/// The border of a sweep that continues `front`, with the copies at `x` [m].
pub fn edges(front: Option<&Front>, blade: &BladeSweep, x: &[Vector3<f64>]) -> Vec<Edge> {
    let first = front.map(|front| front.ends(x));
    let mut rows: Vec<[Vector3<f64>; 2]> = first.into_iter().chain(blade.segments.iter().copied()).collect();
    rows.dedup();
    let edge = |ends, inner, is_last| Edge { ends, inner, is_last };
    let sides = rows.windows(2).flat_map(|pair| {
        let [[tip, heel], [next_tip, next_heel]] = [pair[0], pair[1]];
        [edge([tip, next_tip], heel, false), edge([heel, next_heel], tip, false)]
    });
    let mut edges: Vec<Edge> = sides.collect();
    let n = rows.len();
    if let (None, Some(&row)) = (front, rows.first()) {
        edges.push(edge(row, rows[usize::from(n > 1)][0], false));
    }
    if n > 1 {
        edges.push(edge(rows[n - 1], rows[n - 2][0], true));
    }
    edges.retain(|edge| edge.ends[0] != edge.ends[1]);
    edges
}

impl Borders {
    /// What a sweep of `incision` with these edges and `triangles` joins, with the copies at `x` [m].
    pub fn join(
        &mut self,
        edges: &[Edge],
        swept: &[SweepTriangle],
        incision: u32,
        x: &[Vector3<f64>],
        reach: JoinSizes,
    ) -> Adjoining {
        let drift_m = MAX_DRIFT * reach.cell_m;
        let [low, high] = bounds(edges.iter().flat_map(|edge| &edge.ends));
        let (low, high) = (low.add_scalar(-drift_m), high.add_scalar(drift_m));
        let (mut joined, mut near, mut triangles) = (BTreeSet::new(), BTreeSet::new(), Vec::new());
        for line in self.lines.iter().filter(|line| line.incision != incision) {
            let now = line.now(x);
            // What has not moved far from the sweep has a point near it.
            let beyond = |k: usize| now.iter().all(|p| p[k] < low[k]) || now.iter().all(|p| p[k] > high[k]);
            if (0..3).any(beyond) {
                continue;
            }
            near.insert(line.incision);
            let given: Vec<Vector3<f64>> = line.points.iter().map(|(given, _)| *given).collect();
            let mut joins = false;
            for edge in edges {
                joins |= edge.joins([&given, &now], reach, &mut triangles);
            }
            if joins || line.is_overlapped([&given, &now], swept, reach, &mut triangles) {
                joined.insert(line.incision);
            }
        }
        let cut = self.cut_of(incision);
        for &other in &joined {
            let cut_of_other = self.cut_of(other);
            self.cut_of.extend([(incision, cut), (other, cut)]);
            self.cut_of.values_mut().filter(|of| **of == cut_of_other).for_each(|of| *of = cut);
        }
        let parts = near.into_iter().filter(|&other| self.cut_of(other) == cut).collect();
        Adjoining { incisions: joined.into_iter().collect(), parts, triangles }
    }

    /// The cut that an incision is a part of: the number of one of its incisions.
    pub fn cut_of(&self, incision: u32) -> u32 {
        self.cut_of.get(&incision).copied().unwrap_or(incision)
    }

    /// Remembers the edges of a sweep of `incision` by the material that they pass through. `near` gives the copies of
    /// the tets that may meet the box between two corners [m].
    pub fn remember(&mut self, edges: &[Edge], incision: u32, near: &Near, x: &[Vector3<f64>]) {
        // Where the incision ended before, it goes on now.
        self.lines.retain(|line| line.incision != incision || !line.is_last);
        for edge in edges {
            let [from, to] = edge.ends;
            let points = line_in_tissue(&edge.ends, &near(&[from.inf(&to), from.sup(&to)]), x);
            if points.len() > 1 {
                let (is_last, inwards) = (edge.is_last, unit(edge.inner - edge.foot(&edge.inner)));
                self.lines.push_back(Line { incision, is_last, inwards, points });
            }
        }
        let spare = self.lines.len().saturating_sub(MAX_BORDERS);
        self.lines.drain(..spare);
    }

    /// The copies that carry them.
    pub fn copies(&self) -> impl Iterator<Item = u32> + '_ {
        self.lines.iter().flat_map(|line| &line.points).flat_map(|(_, point)| point.copies().iter().copied())
    }

    /// Takes new numbers of the copies.
    pub fn renumber(&mut self, number: impl Fn(u32) -> u32) {
        let points = self.lines.iter_mut().flat_map(|line| &mut line.points);
        points.for_each(|(_, point)| *point = point.renumbered(&number));
    }

    /// Where the points of every border are [m].
    pub(crate) fn places(&self, x: &[Vector3<f64>]) -> Vec<Vec<Vector3<f64>>> {
        self.lines.iter().map(|line| line.now(x)).collect()
    }

    /// Binds the borders to the material of another mesh, in which their points are at `places` [m]. Arguments as of
    /// [`remember`](Self::remember).
    pub(crate) fn bind_again(&mut self, places: &[Vec<Vector3<f64>>], near: &Near, x: &[Vector3<f64>]) {
        for (line, places) in self.lines.iter_mut().zip(places) {
            let [low, high] = bounds(places);
            let tets = near(&[low, high]);
            let given = line.points.iter().map(|(given, _)| *given);
            let points =
                given.zip(places).filter_map(|(given, place)| Some((given, deepest(place, &tets, x)?)));
            line.points = points.collect();
        }
        self.lines.retain(|line| line.points.len() > 1);
    }
}

impl Line {
    fn now(&self, x: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        self.points.iter().map(|(_, point)| point.position(x)).collect()
    }

    /// Whether a sweep in the same plane passes over a part of it, by where it was `given` or by where it is `now` [m]: the
    /// two overlap there. Adds the triangles between the two places.
    fn is_overlapped(
        &self,
        [given, now]: [&[Vector3<f64>]; 2],
        swept: &[SweepTriangle],
        reach: JoinSizes,
        triangles: &mut Vec<SweepTriangle>,
    ) -> bool {
        let tolerance_m = TOLERANCE * reach.cell_m;
        for line in [given, now] {
            let directions = [self.inwards, unit(line[line.len() - 1] - line[0])];
            let lies_in =
                |p: &Vector3<f64>| swept.iter().any(|triangle| holds(triangle, p, directions, tolerance_m));
            let stayed = |k: usize| (now[k] - given[k]).norm() <= MAX_DRIFT * reach.cell_m;
            let is_covered =
                |k: &usize| lies_in(&line[k - 1].lerp(&line[*k], 0.5)) && stayed(k - 1) && stayed(*k);
            let covered: Vec<usize> = (1..line.len()).filter(is_covered).collect();
            let length =
                |line: &[Vector3<f64>]| line.windows(2).map(|ends| (ends[1] - ends[0]).norm()).sum::<f64>();
            let covered_m: f64 = covered.iter().map(|&k| length(&line[k - 1..=k])).sum();
            if covered_m <= tolerance_m.min(0.5 * length(line)) {
                continue;
            }
            for k in covered {
                let [a, b, c, d] = [given[k - 1], now[k - 1], now[k], given[k]];
                if (b - a).norm().max((c - d).norm()) > OVERREACH * (d - a).norm() {
                    triangles.extend(SweepTriangle::new(a, b, c));
                    triangles.extend(SweepTriangle::new(a, c, d));
                }
            }
            return true;
        }
        false
    }
}

/// Whether a point [m] lies in a triangle that has these directions, within a tolerance [m].
fn holds(
    triangle: &SweepTriangle,
    p: &Vector3<f64>,
    directions: [Vector3<f64>; 2],
    tolerance_m: f64,
) -> bool {
    let [a, b, c] = triangle.corners;
    let n = (b - a).cross(&(c - a)) / triangle.double_area;
    let is_inside = |[from, to]: [Vector3<f64>; 2]| n.cross(&(to - from)).dot(&(p - from)) >= 0.0;
    n.dot(&(p - a)).abs() <= tolerance_m
        && directions.iter().all(|along| n.dot(along).abs() <= MAX_SINE)
        && [[a, b], [b, c], [c, a]].into_iter().all(is_inside)
}

impl Edge {
    /// Whether it shares a part of a border, by where that was `given` or by where it is `now` [m]. Adds the triangles
    /// between the edge and the border as it is now.
    fn joins(
        &self,
        [given, now]: [&[Vector3<f64>]; 2],
        reach: JoinSizes,
        triangles: &mut Vec<SweepTriangle>,
    ) -> bool {
        let tolerance_m = TOLERANCE * reach.cell_m;
        for line in [given, now].into_iter().filter(|line| self.is_along(line)) {
            let mut shared = Vec::new();
            for k in 1..line.len() {
                let Some(part) = self.part_beside([line[k - 1], line[k]], tolerance_m) else { continue };
                let ends =
                    part.map(|s| [self.foot(&line[k - 1].lerp(&line[k], s)), now[k - 1].lerp(&now[k], s)]);
                if ends.iter().all(|[foot, now]| (now - foot).norm() <= MAX_DRIFT * reach.cell_m) {
                    shared.push(ends);
                }
            }
            let length_m: f64 = shared.iter().map(|[[from, _], [to, _]]| (to - from).norm()).sum();
            if length_m > tolerance_m.min(0.5 * self.length()) {
                shared.iter().for_each(|ends| self.reach_for(ends, reach.back_m, triangles));
                return true;
            }
        }
        false
    }

    fn length(&self) -> f64 {
        (self.ends[1] - self.ends[0]).norm()
    }

    fn along(&self) -> Vector3<f64> {
        unit(self.ends[1] - self.ends[0])
    }

    /// The closest point [m] on the line through the edge.
    fn foot(&self, p: &Vector3<f64>) -> Vector3<f64> {
        let along = self.along();
        self.ends[0] + along * along.dot(&(p - self.ends[0]))
    }

    /// Whether it has the direction of a line [m].
    fn is_along(&self, line: &[Vector3<f64>]) -> bool {
        let chord = unit(line[line.len() - 1] - line[0]);
        chord != Vector3::zeros() && chord.cross(&self.along()).norm() <= MAX_SINE
    }

    /// The part of a segment [m] beside the edge, as parameters from 0 to 1, if it lies within the tolerance [m].
    fn part_beside(&self, [p, q]: [Vector3<f64>; 2], tolerance_m: f64) -> Option<[f64; 2]> {
        let place = |x: &Vector3<f64>| self.along().dot(&(x - self.ends[0]));
        let (from, to) = (place(&p), place(&q));
        let [s, t] = [0.0, self.length()].map(|end| (end - from) / (to - from));
        let part = [s.min(t).max(0.0), s.max(t).min(1.0)];
        let is_near = |s: f64| {
            let x = p.lerp(&q, s);
            (x - self.foot(&x)).norm() <= tolerance_m
        };
        (part[0] < part[1] && part.iter().all(|&s| is_near(s))).then_some(part)
    }

    /// Adds the triangles from two points of the edge to the border, and over it by `back_m` [m]. `ends` holds each
    /// point, and where the border is now [m].
    fn reach_for(&self, ends: &[[Vector3<f64>; 2]; 2], back_m: f64, triangles: &mut Vec<SweepTriangle>) {
        let reach = OVERREACH * self.length();
        let beside = self.along() * reach;
        let inwards = self.inner - self.foot(&self.inner);
        let over = unit(inwards) * -back_m.max(reach);
        let [[a, b], [c, d]] = *ends;
        let moved = [b - a, d - c].iter().any(|drift| drift.norm() > reach);
        let sign = if (c - a).dot(&beside) < 0.0 { -1.0 } else { 1.0 };
        let (first, last) = (-beside * sign, beside * sign);
        let mut quad = |[a, b, c, d]: [Vector3<f64>; 4]| {
            triangles.extend(SweepTriangle::new(a, b, c));
            triangles.extend(SweepTriangle::new(a, c, d));
        };
        if moved {
            quad([a + first, b + first, d + last, c + last]);
        }
        if moved || back_m > 0.0 {
            quad([b + first, b + first + over, d + last + over, d + last]);
        }
    }
}

/// Corners [m] of the box around points [m].
pub(crate) fn bounds<'a>(points: impl IntoIterator<Item = &'a Vector3<f64>>) -> [Vector3<f64>; 2] {
    let none = [Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY)];
    points.into_iter().fold(none, |[low, high], p| [low.inf(p), high.sup(p)])
}

/// The material at a place [m]: that of the tet which holds it deepest inside.
fn deepest(place: &Vector3<f64>, tets: &[[u32; 4]], x: &[Vector3<f64>]) -> Option<MaterialPoint> {
    let depth = |weights: &[f64; 4]| weights.iter().copied().fold(f64::INFINITY, f64::min);
    let inside = tets.iter().filter_map(|tet| Some((*tet, barycentric(place, tet, x)?)));
    let best = inside.max_by(|(_, p), (_, q)| depth(p).total_cmp(&depth(q)))?;
    Some(MaterialPoint::in_tet(best.0, best.1))
}
