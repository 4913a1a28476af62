//! The links that a blade crosses in the deformed body.
//!
//! A link runs from the centre of its lower cell to the centre of the face, and on to the centre of the upper
//! cell. Each half bends with its own leaf. Along it the trilinear map of the leaf is linear, so a half is a
//! straight segment in the deformed body too.
//!
//! # Source
//! Dick, Georgii, Westermann 2011, §4.3.

use nalgebra::{Matrix3, Vector3};
use smallvec::SmallVec;

use super::cells::Octree;
use super::change::OctreeChange;
use super::lattice::{At, OUTSIDE};
use super::link_map::{CutLink, LinkKey};
use super::vertices::corner_weights;
use crate::cut::{BladeSweep, CutError, SweepTriangle, sweep_triangles};
use crate::team::{Team, blocks};

/// Leaves whose triangles are selected together.
const RUN: usize = 64;

/// A point whose distance from a triangle is below this part of another one may be on either side of it by rounding.
const NEAR: f64 = 1e-6;

/// Rounding of the corners of parts of a leaf, relative to coordinates.
const ROUNDING: f64 = 1e-14;

/// Corner positions of a leaf [m].
type Corners = [Vector3<f64>; 8];

/// A search for crossed links.
struct Search<'a> {
    octree: &'a Octree,
    x: &'a [Vector3<f64>],
    incision: u32,
    found: &'a mut Vec<(LinkKey, CutLink)>,
}

impl Octree {
    /// The links that the triangles of a sweep cross with the vertices at `x` [m], in order.
    #[cfg(test)]
    pub(crate) fn crossed_links(
        &self,
        x: &[Vector3<f64>],
        triangles: &[SweepTriangle],
        incision: u32,
    ) -> Vec<(LinkKey, CutLink)> {
        let leaves = self.leaves_near(x, &swept_box(triangles));
        self.crossed_links_in(&mut Team::alone(), &leaves, x, (triangles, incision))
    }

    /// Cuts the links that these blades cross with the vertices at `x` [m], one incision each, numbered from 1 on. Where
    /// blades are many this costs less than one cut after the other: leaves and vertices change once.
    ///
    /// # Errors
    /// A sweep that cannot be cut along.
    pub fn cut_along(
        &mut self,
        team: &mut Team,
        x: &[Vector3<f64>],
        blades: &[BladeSweep],
    ) -> Result<OctreeChange, CutError> {
        let mut all = Vec::new();
        for (incision, blade) in (1..).zip(blades) {
            blade.check()?;
            let triangles = sweep_triangles(None, blade, x);
            let leaves = self.leaves_near(x, &swept_box(&triangles));
            all.append(&mut self.crossed_links_in(team, &leaves, x, (&triangles, incision)));
        }
        // A link that several blades cross keeps the incision of the first; the order is that of the blades.
        Ok(self.cut(&all))
    }

    /// The same among the links of some leaves, which hold all that may meet the triangles.
    pub fn crossed_links_in(
        &self,
        team: &mut Team,
        leaves: &[u32],
        x: &[Vector3<f64>],
        (triangles, incision): (&[SweepTriangle], u32),
    ) -> Vec<(LinkKey, CutLink)> {
        let all: Vec<&SweepTriangle> = triangles.iter().collect();
        let mut of_runs: Vec<Vec<(LinkKey, CutLink)>> = vec![Vec::new(); leaves.len().div_ceil(RUN)];
        team.for_blocks(blocks(&mut of_runs, 1), |k, found| {
            let run = &leaves[k * RUN..leaves.len().min((k + 1) * RUN)];
            let near = among(
                &all,
                &bounds(run.iter().flat_map(|&id| self.vertices[id as usize].map(|v| x[v as usize]))),
            );
            if !near.is_empty() {
                let mut search = Search { octree: self, x, incision, found: &mut found[0] };
                run.iter().for_each(|&id| search.leaf(id, &near));
            }
        });
        let mut found = of_runs.concat();
        found.sort_by_key(|(key, _)| *key);
        found.dedup_by(|next, first| {
            let same = next.0 == first.0;
            if same {
                first.1.join(&next.1);
            }
            same
        });
        found
    }

    /// Leaves that may meet the box between two corners [m] with the vertices at `x` [m], ascending.
    pub fn leaves_near(&self, x: &[Vector3<f64>], [low, high]: &[Vector3<f64>; 2]) -> Vec<u32> {
        let codes: Vec<u8> = x.iter().map(|p| beyond(p, low, high)).collect();
        let may_meet = |vertices: &[u32; 8]| vertices.iter().fold(!0, |all, &v| all & codes[v as usize]) == 0;
        (0u32..).zip(&self.vertices).filter(|(_, vertices)| may_meet(vertices)).map(|(id, _)| id).collect()
    }

    /// Those of these leaves that may meet the box between two corners [m], as [`leaves_near`](Self::leaves_near).
    pub fn leaves_near_of(
        &self,
        leaves: &[u32],
        x: &[Vector3<f64>],
        [low, high]: &[Vector3<f64>; 2],
    ) -> Vec<u32> {
        let may_meet = |id: &u32| {
            let code = |v: &u32| beyond(&x[*v as usize], low, high);
            self.vertices[*id as usize].iter().fold(!0, |all, v| all & code(v)) == 0
        };
        leaves.iter().copied().filter(may_meet).collect()
    }

    /// Positions of the corners of leaf `id` [m].
    pub fn corners(&self, id: u32, x: &[Vector3<f64>]) -> [Vector3<f64>; 8] {
        let id = id as usize;
        let carriers = self.vertices[id].map(|v| x[v as usize]);
        if self.hanging[id] == 0 {
            return carriers;
        }
        corner_weights(&self.cells[id], self.hanging[id])
            .map(|row| row.iter().zip(&carriers).filter(|(w, _)| **w != 0.0).map(|(w, x)| *w * x).sum())
    }
}

impl Search<'_> {
    /// Searches all links in leaf `id`.
    fn leaf(&mut self, id: u32, triangles: &[&SweepTriangle]) {
        let corners = self.octree.corners(id, self.x);
        let cell = self.octree.cells[id as usize];
        self.part(&corners, cell.at, cell.level, triangles);
    }

    /// Searches the links in a part of a leaf: a cube of 2^level finest cells with these corners.
    fn part(&mut self, corners: &Corners, at: At, level: u8, triangles: &[&SweepTriangle]) {
        let near = among(triangles, &bounds(corners.iter().copied()));
        if near.is_empty() {
            return;
        }
        if level == 0 {
            return self.finest(corners, at, &near);
        }
        let half = 1 << (level - 1);
        for child in 0..8 {
            let part: Corners = std::array::from_fn(|c| {
                let xi = [0, 1, 2].map(|k| 0.5 * f64::from((child >> k & 1) as u8 + (c >> k & 1) as u8));
                interpolate(corners, xi)
            });
            let at = [0, 1, 2].map(|k| at[k] + half * (child >> k & 1));
            self.part(&part, at, level - 1, &near);
        }
    }

    /// Searches the six halves of links in a finest cell.
    fn finest(&mut self, corners: &Corners, at: At, triangles: &[&SweepTriangle]) {
        let leaf = self.octree.leaf(at) as usize;
        let plain = self.octree.cells[leaf].level == 0 && self.octree.hanging[leaf] == 0;
        let centre = interpolate(corners, [0.5; 3]);
        let sides: SmallVec<[f64; 8]> = triangles.iter().map(|triangle| triangle.side(&centre)).collect();
        for d in 0..6 {
            let (axis, up) = (d / 2, d % 2 == 1);
            // The middle of the face as this cell sees it. Cells that hang together agree on it but for rounding.
            let mut own = [0.5; 3];
            own[axis] = f64::from(u8::from(up));
            let own = interpolate(corners, own);
            let ahead = |(triangle, s): (&&SweepTriangle, &f64)| {
                let t = triangle.side(&own);
                (*s >= 0.0) == (t >= 0.0) && t.abs() > NEAR * s.abs()
            };
            if triangles.iter().zip(&sides).all(ahead) {
                continue;
            }
            let beyond = Octree::across(at, d);
            let near = self.octree.leaf(beyond);
            if near == OUTSIDE {
                continue;
            }
            // The lower cell decides where the middle of the face is, so that both halves end in one point. Two
            // finest cells without hanging corners have the same one, to the bit.
            let near = near as usize;
            let same = plain && self.octree.cells[near].level == 0 && self.octree.hanging[near] == 0;
            let lower = if up { at } else { beyond };
            let face = if same {
                own
            } else {
                let mut xi = [0.5; 3];
                xi[axis] = 1.0;
                self.position(lower, xi)
            };
            for triangle in triangles {
                let Some(fraction) = crossing(triangle, &centre, &face) else { continue };
                let along = if up { 0.5 * fraction } else { 1.0 - 0.5 * fraction };
                let normal = rest_normal(corners, triangle);
                let cut = CutLink { at: [along; 2], normal: [normal; 2], incision: self.incision };
                self.found.push(((lower, axis as u8), cut));
            }
        }
    }

    /// Position [m] of the point with local coordinates `xi` in the finest cell `at`.
    fn position(&self, at: At, xi: [f64; 3]) -> Vector3<f64> {
        let id = self.octree.leaf(at);
        let cell = &self.octree.cells[id as usize];
        let side = f64::from(cell.side());
        let in_leaf = [0, 1, 2].map(|k| (f64::from(at[k] - cell.at[k]) + xi[k]) / side);
        interpolate(&self.octree.corners(id, self.x), in_leaf)
    }
}

/// Unit normal at rest of the plane of a triangle in a cube with these corners: ∝ Fᵀ n.
fn rest_normal(corners: &Corners, triangle: &SweepTriangle) -> Vector3<f64> {
    let [p, q, r] = triangle.corners;
    let normal = (q - p).cross(&(r - p));
    // Columns of F up to a factor: mean edges along the axes.
    let edge = |k: usize| -> Vector3<f64> {
        (0..8).map(|c| if c >> k & 1 == 1 { corners[c] } else { -corners[c] }).sum()
    };
    let F = Matrix3::from_columns(&[edge(0), edge(1), edge(2)]);
    (F.transpose() * normal).try_normalize(0.0).unwrap_or_else(|| normal.normalize())
}

/// Fraction of the way from `a` to `b` where it crosses the triangle. A point in the plane counts as above it.
fn crossing(triangle: &SweepTriangle, a: &Vector3<f64>, b: &Vector3<f64>) -> Option<f64> {
    if !triangle.overlaps(&a.inf(b), &a.sup(b)) {
        return None;
    }
    let (s, t) = (triangle.side(a), triangle.side(b));
    ((s >= 0.0) != (t >= 0.0) && triangle.holds_line(a, b)).then(|| s / (s - t))
}

/// The triangles that may pass through a box. Both cells at a face keep a triangle in it, however their corners were
/// rounded: which half of the link it crosses is decided later.
fn among<'a>(
    triangles: &[&'a SweepTriangle],
    [low, high]: &[Vector3<f64>; 2],
) -> SmallVec<[&'a SweepTriangle; 8]> {
    let margin = Vector3::repeat(ROUNDING * low.amax().max(high.amax()));
    let (low, high) = (low - margin, high + margin);
    triangles.iter().filter(|t| t.overlaps(&low, &high) && t.may_cross(&low, &high)).copied().collect()
}

/// One bit for each face of the box between two corners that `p` is beyond.
fn beyond(p: &Vector3<f64>, low: &Vector3<f64>, high: &Vector3<f64>) -> u8 {
    (0..3).fold(0, |code, k| code | u8::from(p[k] < low[k]) << k | u8::from(p[k] > high[k]) << (3 + k))
}

/// Corners of the smallest box around the triangles of a sweep [m].
pub fn swept_box(triangles: &[SweepTriangle]) -> [Vector3<f64>; 2] {
    bounds(triangles.iter().flat_map(|t| [t.low, t.high]))
}

fn bounds(points: impl Iterator<Item = Vector3<f64>>) -> [Vector3<f64>; 2] {
    let empty = [Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY)];
    points.fold(empty, |[low, high], p| [low.inf(&p), high.sup(&p)])
}

fn interpolate(corners: &Corners, xi: [f64; 3]) -> Vector3<f64> {
    let mut x = *corners;
    // Along one axis after the other; at the ends the corners come out to the bit.
    for k in 0..3 {
        for c in 0..4 >> k {
            let (a, b) = (x[2 * c], x[2 * c + 1]);
            x[c] = if xi[k] == 0.0 {
                a
            } else if xi[k] == 1.0 {
                b
            } else {
                a * (1.0 - xi[k]) + b * xi[k]
            };
        }
    }
    x[0]
}
