//! Lines where the blades of incisions went over the surface, as far as it has not opened there.
//!
//! A sweep leaves a line on every boundary face of a fragment that it crosses. The line is stored in
//! coordinates of the face, so it moves with the material, from where the blade came down to where it is. A
//! line that continues another almost straight is joined to it, and a line that lies on another is dropped.
//! The number of lines therefore depends on the path of the blade, not on how often it was sampled. When a
//! face is bisected, so are its lines. Where the incision opens, the lips show it, and the lines on the
//! opened face are removed. This includes lines on parts of it that no lip borders, for the cut is straight
//! where the blade was not.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use crate::mesh::TET_FACES;

use crate::cut::topology::crossings::SNAP;
use crate::cut::topology::fragments::{FragmentVertex, Fragments};

/// Largest distance of a line from the path of the blade, as a share of a face: half of the finest skin
/// triangle.
const RESOLUTION: f64 = 1.0 / 64.0;

/// Shortest line, as a share of a face. A crossing this close to a corner is the corner.
const SHORT: f64 = 4.0 * SNAP;

/// Most lines of one incision on a face. A blade that scrubs one place draws no more there.
const MOST: usize = 256;

/// Barycentric coordinates on a face, Σ = 1.
pub(crate) type Place = Vector3<f64>;

#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
struct Line {
    ends: [Place; 2],
    /// Bound on its distance from the path of the blade, which grows as the line is extended.
    off: f64,
}

/// The lines that one incision has drawn on a face. There may be none yet.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
struct Drawing {
    incision: u32,
    /// Number shared by the parts of a face that this incision itself has bisected.
    kin: u32,
    lines: Vec<Line>,
}

/// A line on a boundary face of a fragment.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TraceLine {
    pub incision: u32,
    pub fragment: u32,
    /// Slot of its face: the one opposite this vertex.
    pub face: usize,
    /// Start and end of the line.
    pub ends: [FragmentVertex; 2],
}

/// The bisection of a boundary face.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bisection {
    /// The face (4·fragment + slot) before, and afterwards the part at the first end of the edge.
    pub old: u32,
    /// The part at the other end of the edge.
    pub new: u32,
    /// Corners of the face that the edge joins.
    pub edge: [usize; 2],
    /// Where the edge is bisected, from 0 at its first end to 1.
    pub s: f64,
    /// The incision that bisects it.
    pub incision: u32,
}

/// All lines on boundary faces, keyed by 4·fragment + slot.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(crate) struct Traces {
    of_face: BTreeMap<u32, Vec<Drawing>>,
    kin: u32,
}

impl Traces {
    /// Whether no face has a drawing.
    pub(crate) fn is_empty(&self) -> bool {
        self.of_face.is_empty()
    }

    /// The drawing of an incision on a face, created if there is none.
    fn drawing(&mut self, face: u32, incision: u32) -> &mut Drawing {
        let drawings = self.of_face.entry(face).or_default();
        let known = drawings.iter().position(|drawing| drawing.incision == incision);
        let at = known.unwrap_or_else(|| {
            self.kin += 1;
            drawings.push(Drawing { incision, kin: self.kin, lines: Vec::new() });
            drawings.len() - 1
        });
        &mut drawings[at]
    }

    /// Adds a line to the drawing of an incision on a face (4·fragment + slot).
    pub(crate) fn draw(&mut self, face: u32, incision: u32, ends: [Place; 2]) {
        if (ends[1] - ends[0]).norm() > SHORT {
            self.drawing(face, incision).draw(ends);
        }
    }

    /// Moves all drawings of a face when the face becomes one of another fragment.
    pub(crate) fn move_face(&mut self, from: u32, to: u32) {
        if let Some(drawings) = self.of_face.remove(&from) {
            self.of_face.insert(to, drawings);
        }
    }

    /// Divides the drawings of a face bisected from a point on one of its edges to the opposite corner.
    pub(crate) fn bisect(&mut self, bisection: &Bisection) {
        let Bisection { old, new, incision, .. } = *bisection;
        self.drawing(old, incision);
        self.kin += 1;
        let Some(drawings) = self.of_face.get_mut(&old) else { return };
        let mut others = Vec::with_capacity(drawings.len());
        for drawing in drawings.iter_mut() {
            let kin = if drawing.incision == incision { drawing.kin } else { self.kin };
            let lines = drawing.lines.iter().filter_map(|line| bisection.part(line, true)).collect();
            others.push(Drawing { kin, lines, ..*drawing });
            drawing.lines = drawing.lines.iter().filter_map(|line| bisection.part(line, false)).collect();
        }
        self.of_face.insert(new, others);
    }

    /// Removes the lines on a face along whose edge the incision has opened, and on the other parts of that
    /// face.
    pub(crate) fn open(&mut self, face: u32, incision: u32, fragments: &Fragments) {
        let known = self.of_face.get(&face).into_iter().flatten().find(|d| d.incision == incision);
        let Some(kin) = known.map(|drawing| drawing.kin) else { return };
        for t in fragments.of_element(fragments.element[face as usize / 4]) {
            for face in 4 * t..4 * t + 4 {
                if let Some(drawings) = self.of_face.get_mut(&face) {
                    drawings.retain(|drawing| drawing.incision != incision || drawing.kin != kin);
                    if drawings.is_empty() {
                        self.of_face.remove(&face);
                    }
                }
            }
        }
    }

    /// All lines, ordered by incision, fragment and face. `is_left` tells whether an incision has opened at
    /// one of three vertices of a face and no longer crosses an edge between them. The blade then left the
    /// face where it came in, so its lines there lie beside the lips and are omitted, unless the path ends
    /// inside the face.
    pub(crate) fn lines(
        &self,
        fragments: &Fragments,
        is_left: impl Fn([u32; 3], u32) -> bool,
    ) -> Vec<TraceLine> {
        let mut lines = Vec::new();
        for (&face, drawings) in &self.of_face {
            let (fragment, face) = (face / 4, face as usize % 4);
            let vertices = TET_FACES[face].map(|k| fragments.tets[fragment as usize][k]);
            let corners = vertices.map(|v| &fragments.vertices[v as usize]);
            for drawing in drawings {
                let incision = drawing.incision;
                if is_left(vertices, incision) && !drawing.ends_inside() {
                    continue;
                }
                lines.extend(drawing.lines.iter().map(|line| {
                    let ends = line.ends.map(|p| vertex_at(&p, corners));
                    TraceLine { incision, fragment, face, ends }
                }));
            }
        }
        lines.sort_by_key(|line| line.incision);
        lines
    }
}

impl Bisection {
    /// The part of a line at the first end of the edge or, if `beyond`, at the second.
    fn part(&self, line: &Line, beyond: bool) -> Option<Line> {
        let ([i, j], s) = (self.edge, self.s);
        // Positive on the side of the part.
        let sign = if beyond { -1.0 } else { 1.0 };
        let side = line.ends.map(|p| sign * (p[i] * s - p[j] * (1.0 - s)));
        // The point on the edge replaces one end: it is `share` of that end, and the rest of the other.
        let (gone, stays, share) = if beyond { (i, j, 1.0 - s) } else { (j, i, s) };
        let ends = part_inside([side])?.map(|r| line.ends[0].lerp(&line.ends[1], r)).map(|mut p| {
            p[stays] -= p[gone] * (1.0 - share) / share;
            p[gone] /= share;
            p
        });
        ((ends[1] - ends[0]).norm() > SHORT).then_some(Line { ends, ..*line })
    }
}

impl Drawing {
    /// Whether the path begins or ends inside the face.
    fn ends_inside(&self) -> bool {
        let goes_on = |p: &Place, of: usize| {
            let others = self.lines.iter().enumerate().filter(|(other, _)| *other != of);
            p.min() <= SHORT || others.into_iter().any(|(_, line)| distance(p, &line.ends) <= RESOLUTION)
        };
        self.lines.iter().enumerate().any(|(l, line)| !line.ends.iter().all(|p| goes_on(p, l)))
    }

    /// Extends the line that this one continues, or adds a new line.
    fn draw(&mut self, mut ends: [Place; 2]) {
        let joints = (0..self.lines.len()).flat_map(|l| [(l, 1, 0), (l, 1, 1), (l, 0, 0), (l, 0, 1)]);
        let gap = |&(l, i, j): &(usize, usize, usize)| (self.lines[l].ends[i] - ends[j]).norm();
        let closest =
            joints.min_by(|p, q| gap(p).total_cmp(&gap(q))).filter(|joint| gap(joint) <= RESOLUTION);
        if let Some((l, i, j)) = closest {
            if self.lines[l].go_on(i, &ends[j], &ends[1 - j]) {
                return;
            }
            ends[j] = self.lines[l].ends[i];
        }
        let lies_on = |line: &Line| ends.iter().all(|p| distance(p, &line.ends) <= RESOLUTION);
        if self.lines.len() < MOST && !self.lines.iter().any(lies_on) {
            self.lines.push(Line { ends, off: 0.0 });
        }
    }
}

impl Line {
    /// Extends the line at end `i` to `to`, unless the path bends there. `from` lies close to that end.
    fn go_on(&mut self, i: usize, from: &Place, to: &Place) -> bool {
        let (end, other) = (self.ends[i], self.ends[1 - i]);
        let longer = [other, *to];
        let off = self.off + distance(&end, &longer).max(distance(from, &longer));
        let goes_on = off <= RESOLUTION && (to - other).norm() > (end - other).norm();
        if goes_on {
            (self.ends[i], self.off) = (*to, off);
        }
        goes_on
    }
}

/// Distance of a place from a line, as a share of the face.
fn distance(p: &Place, [a, b]: &[Place; 2]) -> f64 {
    let along = b - a;
    let length_squared = along.norm_squared();
    let s = if length_squared > 0.0 { (along.dot(&(p - a)) / length_squared).clamp(0.0, 1.0) } else { 0.0 };
    (a + along * s - p).norm()
}

/// The fragment vertex at a place on the face with these corners.
fn vertex_at(p: &Place, [a, b, c]: [&FragmentVertex; 3]) -> FragmentVertex {
    let p = p.map(|w| w.max(0.0));
    let ab = p[0] + p[1];
    if ab == 0.0 {
        return *c;
    }
    FragmentVertex::between(&FragmentVertex::between(a, b, p[1] / ab), c, p[2] / (ab + p[2]))
}

/// The part of a line, as parameters from 0 to 1, where all given quantities are ≥ 0. Each quantity is linear
/// along the line and is given at its two ends.
pub(crate) fn part_inside(quantities: impl IntoIterator<Item = [f64; 2]>) -> Option<[f64; 2]> {
    let (mut from, mut to) = (0.0f64, 1.0f64);
    for [p, q] in quantities {
        match (p < 0.0, q < 0.0) {
            (true, true) => return None,
            (true, false) => from = from.max(p / (p - q)),
            (false, true) => to = to.min(p / (p - q)),
            (false, false) => {}
        }
    }
    (from < to).then_some([from, to])
}

/// The line in which a plane crosses a triangle, from values proportional to the signed distances
/// of its corners.
pub(crate) fn line_across(side: [f64; 3]) -> Option<[Place; 2]> {
    let edges = [(0, 1), (1, 2), (2, 0)].into_iter().filter(|&(i, j)| side[i] * side[j] < 0.0);
    let edges = edges.map(|(i, j)| {
        let mut place = Place::zeros();
        (place[i], place[j]) = (side[j] / (side[j] - side[i]), side[i] / (side[i] - side[j]));
        place
    });
    let corners = (0..3).filter(|&k| side[k] == 0.0).map(|k| Place::ith(k, 1.0));
    let mut places = edges.chain(corners);
    match (places.next(), places.next(), places.next()) {
        (Some(from), Some(to), None) => Some([from, to]),
        _ => None,
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::cut::CutMesh;
    use crate::mesh::{BoxPattern, box_mesh};
    use crate::testing::v;

    fn fragments() -> Fragments {
        let mesh = box_mesh(Vector3::zeros(), Vector3::repeat(1.0), [1; 3], BoxPattern::Tet6);
        CutMesh::new(mesh).unwrap().fragments
    }

    /// A place with these first two coordinates.
    fn at(x: f64, y: f64) -> Place {
        v(x, y, 1.0 - x - y)
    }

    #[test]
    fn the_number_of_lines_does_not_follow_from_that_of_the_samples() {
        let fragments = fragments();
        for samples in [3, 30, 3000] {
            let mut traces = Traces::default();
            // Straight on, then round a corner, back and forth there, and on.
            let way = |s: f64| if s < 0.5 { at(0.1 + s, 0.1) } else { at(0.6, s - 0.4) };
            let mut draw = |s: f64, t: f64| traces.draw(3, 1, [way(s), way(t)]);
            for k in 0..samples {
                let [s, t] = [k, k + 1].map(|k| 0.9 * f64::from(k) / f64::from(samples));
                draw(s, t);
                if k % 2 == 0 {
                    draw(t, (t - 0.01).max(0.0));
                    draw((t - 0.01).max(0.0), t);
                }
            }
            let lines = traces.lines(&fragments, |_, _| false);
            assert!(lines.len() <= 4, "{} lines of {samples} samples", lines.len());
            let drawn = &traces.of_face[&3][0].lines;
            for k in 0..=90 {
                let place = way(0.01 * f64::from(k));
                let off = drawn.iter().map(|line| distance(&place, &line.ends)).fold(f64::INFINITY, f64::min);
                assert!(samples == 3 || off <= 2.0 * RESOLUTION, "{off} at {k} of {samples}");
            }
        }
    }

    #[test]
    fn a_blade_that_left_a_face_where_it_came_in_left_no_line_beside_the_lips() {
        let fragments = fragments();
        let mut traces = Traces::default();
        traces.draw(3, 1, [at(0.0, 0.5), at(0.3, 0.3)]);
        traces.draw(3, 1, [at(0.3, 0.3), at(0.6, 0.0)]);
        assert_eq!(traces.lines(&fragments, |_, _| false).len(), 2);
        assert!(traces.lines(&fragments, |_, _| true).is_empty());
        // It is there: shown with the way to it.
        traces.draw(3, 1, [at(0.0, 0.8), at(0.1, 0.6)]);
        assert_eq!(traces.lines(&fragments, |_, _| true).len(), 3);
    }

    #[test]
    fn a_bisected_face_has_its_lines_in_two_parts() {
        let mut traces = Traces::default();
        traces.draw(4, 1, [at(0.7, 0.1), at(0.1, 0.7)]);
        traces.bisect(&Bisection { old: 4, new: 9, edge: [0, 1], s: 0.25, incision: 2 });
        let [old, new] = [4, 9].map(|face| &traces.of_face[&face][0]);
        assert_ne!(old.kin, new.kin);
        let [old, new] = [old, new].map(|drawing| drawing.lines[0]);
        // The point on the edge, and places in the parts as places in the whole.
        let m = at(0.75, 0.25);
        let whole = |p: &Place, a: Place, b: Place| a * p[0] + b * p[1] + at(0.0, 0.0) * p[2];
        let old_ends = old.ends.map(|p| whole(&p, at(1.0, 0.0), m));
        let new_ends = new.ends.map(|p| whole(&p, m, at(0.0, 1.0)));
        assert!((old_ends[0] - at(0.7, 0.1)).norm() < 1e-15 && (new_ends[1] - at(0.1, 0.7)).norm() < 1e-15);
        assert!((old_ends[1] - new_ends[0]).norm() < 1e-15 && (old_ends[1] - at(0.6, 0.2)).norm() < 1e-15);
    }
}
