//! Where the blades of incisions went over the surface, as far as it has not opened there.
//!
//! A sweep leaves a line on every boundary face of a fragment that it crosses, in coordinates of the
//! face: it goes with the material, from where the blade came down to where it is. Lines that go on
//! almost straight are one, and what lies on a line already is not kept twice, so the number of lines
//! follows from the way of the blade and not from that of its samples. When a face is bisected, its
//! lines are. Where the incision opens, the lips show it, and the lines on the face that opened go: also
//! those on parts of it that the lips do not border, for the cut is straight where the blade was not.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use crate::mesh::TET_FACES;

use crate::cut::topology::crossings::SNAP;
use crate::cut::topology::fragments::{FragmentVertex, Fragments};

/// Share of a face by which a line may be off the way of the blade: half of the finest skin triangle.
const RESOLUTION: f64 = 1.0 / 64.0;

/// Share of a face below which a line is none: a crossing this close to a corner is the corner.
const SHORT: f64 = 4.0 * SNAP;

/// Most lines of one incision on a face: a blade that scrubs one place draws no more there.
const MOST: usize = 256;

/// Coordinates on a face, one for each corner, Σ = 1.
pub type Place = Vector3<f64>;

#[derive(Clone, Copy, Debug)]
struct Line {
    ends: [Place; 2],
    /// How far it may be off by now.
    off: f64,
}

/// What an incision has drawn on a face, maybe nothing yet.
#[derive(Clone, Debug)]
struct Drawing {
    incision: u32,
    /// The number that parts of a face share which the incision itself has bisected.
    kin: u32,
    lines: Vec<Line>,
}

/// A line on a boundary face of a fragment.
#[derive(Clone, Copy, Debug)]
pub struct TraceLine {
    /// The incision.
    pub incision: u32,
    /// The fragment.
    pub fragment: u32,
    /// Its face: the one opposite this vertex.
    pub face: usize,
    /// From where to where.
    pub ends: [FragmentVertex; 2],
}

/// The bisection of a boundary face.
#[derive(Clone, Copy, Debug)]
pub struct Bisection {
    /// The face (4·fragment + slot) as it was, and at the first end of the edge.
    pub old: u32,
    /// The one at the other end.
    pub new: u32,
    /// Corners of the face that the edge joins.
    pub edge: [usize; 2],
    /// Where the edge is bisected, from 0 at its first end to 1.
    pub s: f64,
    /// The incision that bisects it.
    pub incision: u32,
}

/// The lines, by boundary face.
#[derive(Clone, Debug, Default)]
pub struct Traces {
    of_face: BTreeMap<u32, Vec<Drawing>>,
    kin: u32,
}

impl Traces {
    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.of_face.is_empty()
    }

    /// What an incision has drawn on a face.
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

    /// Draws a line on a face (4·fragment + slot).
    pub fn draw(&mut self, face: u32, incision: u32, ends: [Place; 2]) {
        if (ends[1] - ends[0]).norm() > SHORT {
            self.drawing(face, incision).draw(ends);
        }
    }

    /// A face has become one of another fragment.
    pub fn move_face(&mut self, from: u32, to: u32) {
        if let Some(drawings) = self.of_face.remove(&from) {
            self.of_face.insert(to, drawings);
        }
    }

    /// A face was bisected from a point on one of its edges to the corner opposite.
    pub fn bisect(&mut self, bisection: &Bisection) {
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

    /// Forgets what an incision that has opened along an edge of this face drew on it.
    pub fn open(&mut self, face: u32, incision: u32, fragments: &Fragments) {
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

    /// All lines, by incision, fragment and face; `is_left` says whether an incision has opened at one of
    /// three vertices of a face and crosses no edge between them any more. Then it left the face where it
    /// came in, and what it drew there is beside its lips; unless it ends there.
    pub fn lines(&self, fragments: &Fragments, is_left: impl Fn([u32; 3], u32) -> bool) -> Vec<TraceLine> {
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
    /// The part of a line at the first or, `beyond`, at the second end of the edge.
    fn part(&self, line: &Line, beyond: bool) -> Option<Line> {
        let ([i, j], s) = (self.edge, self.s);
        // Positive on the side that is wanted.
        let sign = if beyond { -1.0 } else { 1.0 };
        let side = line.ends.map(|p| sign * (p[i] * s - p[j] * (1.0 - s)));
        // The point on the edge takes the place of one end: it is `share` of that and the rest of the other.
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
    /// Whether the way begins or ends inside the face.
    fn ends_inside(&self) -> bool {
        let goes_on = |p: &Place, of: usize| {
            let others = self.lines.iter().enumerate().filter(|(other, _)| *other != of);
            p.min() <= SHORT || others.into_iter().any(|(_, line)| distance(p, &line.ends) <= RESOLUTION)
        };
        self.lines.iter().enumerate().any(|(l, line)| !line.ends.iter().all(|p| goes_on(p, l)))
    }

    /// Draws a line, or makes one longer that it goes on.
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
    /// Becomes longer at end `i`, from a place close to it to another one, unless the way bends there.
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

/// Distance of a place from a line.
fn distance(p: &Place, [a, b]: &[Place; 2]) -> f64 {
    let along = b - a;
    let length_squared = along.norm_squared();
    let s = if length_squared > 0.0 { (along.dot(&(p - a)) / length_squared).clamp(0.0, 1.0) } else { 0.0 };
    (a + along * s - p).norm()
}

/// A place on a face with these corners as a vertex.
fn vertex_at(p: &Place, [a, b, c]: [&FragmentVertex; 3]) -> FragmentVertex {
    let p = p.map(|w| w.max(0.0));
    let ab = p[0] + p[1];
    if ab == 0.0 {
        return *c;
    }
    FragmentVertex::between(&FragmentVertex::between(a, b, p[1] / ab), c, p[2] / (ab + p[2]))
}

/// The part of a line, from 0 to 1, in which quantities that are linear along it, given at its ends, are
/// not negative.
pub fn part_inside(quantities: impl IntoIterator<Item = [f64; 2]>) -> Option<[f64; 2]> {
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

/// The line in which a plane crosses a triangle, given on which side of it the corners are.
pub fn line_across(side: [f64; 3]) -> Option<[Place; 2]> {
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
