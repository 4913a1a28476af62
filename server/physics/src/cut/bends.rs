//! Bends: where a blade turns inside an element, the sheet turns there and not somewhere beside it.
//!
//! Between the edges it crosses a sheet is flat, so that a bend inside an element would be cut off by
//! a chord, and a branch that begins at the bend would end before the lip. Therefore the faces that
//! the blade pierces where it turns get a vertex there, before it goes on: the line of the bend becomes
//! a row of fragment edges, which ends one arm and begins the other.
//!
//! A face (or edge) has at most one such vertex of an incision, as an edge has one crossing: a blade
//! that trembles on the spot divides nothing twice. Where another incision has entered a fragment and
//! not left it yet, what it has crossed stays as it is, and the bend there is flat. So is a curve that
//! turns little from sample to sample; and of an edge that both arms cross the first has it, as ever,
//! so that a body much coarser than the bend still has its outer corners cut off.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use robust::{Coord3D, orient3d};

use crate::mesh::{TET_EDGES, TET_FACES};

use super::crossings::SNAP;
use super::detect::{Deformed, Detector};
use super::fragments::{FragmentVertex, MAX_FRAGMENTS_PER_ELEMENT, NONE};
use super::incision_sets::IncisionSets;
use super::separate::{Separator, Sheet};
use super::sweep_triangle::SweepTriangle;

/// Vertices at bends.
#[derive(Clone, Debug, Default)]
pub struct BendPoints {
    /// Number of the bend, by vertex and incision.
    bend: BTreeMap<[u32; 2], u32>,
    count: u32,
}

/// Where the blade pierces a fragment.
#[derive(Clone, Copy, Debug)]
enum Place {
    Vertex(u32),
    /// Ends, and parameter from the first to the second.
    Edge([u32; 2], f64),
    /// The face opposite this slot, and barycentric coordinates.
    Face(usize, [f64; 3]),
}

impl Separator {
    /// Puts vertices where the blade pierces fragments at a bend.
    pub fn divide_at_bend(
        &mut self,
        bend: &[[Vector3<f64>; 2]],
        detector: &Detector,
        body: &Deformed,
        points: &mut BendPoints,
        sheet: &mut Sheet,
    ) {
        points.count += 1;
        for part in bend {
            let mut waiting: Vec<u32> = Vec::new();
            for p in detector.pieces_near(part) {
                waiting.extend(body.pieces.fragments(p, sheet.fragments));
            }
            while let Some(t) = waiting.pop() {
                for place in pierced(t, part, body, points, sheet) {
                    let first_new = sheet.fragments.tets.len();
                    let Some(m) = self.put_vertex(t, place, sheet) else { continue };
                    points.bend.insert([m, sheet.incision], points.count);
                    if let Place::Vertex(_) = place {
                        continue;
                    }
                    self.run_along_what_was_swept(points, sheet);
                    waiting.extend(self.halves.iter().map(|h| h.old));
                    waiting.extend(first_new as u32..sheet.fragments.tets.len() as u32);
                    break;
                }
            }
        }
    }

    /// The vertex at this place, on the sheet; none where an element would exceed its cap, or where
    /// another incision is pending.
    fn put_vertex(&mut self, t: u32, place: Place, sheet: &mut Sheet) -> Option<u32> {
        let m = match place {
            Place::Vertex(v) => v,
            Place::Edge(ends, s) => self.bisect(t, ends, s, IncisionSets::EMPTY, sheet)?,
            Place::Face(face, weights) => self.divide_face(t, face, weights, sheet)?,
        };
        let on = &mut sheet.fragments.on[m as usize];
        *on = sheet.sets.with(*on, sheet.incision);
        Some(m)
    }

    /// Divides the face of fragment `t` opposite slot `face` in three.
    fn divide_face(&mut self, t: u32, face: usize, weights: [f64; 3], sheet: &mut Sheet) -> Option<u32> {
        let f = &mut *sheet.fragments;
        let [p, q, r] = TET_FACES[face].map(|k| f.tets[t as usize][k]);
        let n = f.neighbour[t as usize][face];
        let sides: Vec<(u32, usize)> = std::iter::once((t, face))
            .chain((n != NONE).then(|| Some((n, f.face_towards(n, t)?))).flatten())
            .collect();
        let two_faces_in_common =
            f.neighbour[t as usize].iter().filter(|&&m| m != NONE && m == n).count() > 1;
        let room = |&(side, _): &(u32, usize)| {
            let e = f.element[side as usize];
            let more = 2 * sides.iter().filter(|s| f.element[s.0 as usize] == e).count();
            usize::from(f.count[e as usize]) + more <= usize::from(MAX_FRAGMENTS_PER_ELEMENT)
        };
        let waits = |&(side, _): &(u32, usize)| {
            let tet = f.tets[side as usize];
            TET_EDGES.iter().any(|&[i, j]| {
                let others = sheet.crossings.of(tet[i], tet[j]).filter(|c| c.0 != sheet.incision);
                let on = |k: usize, s: u32| sheet.sets.contains(f.on[tet[k] as usize], s);
                others.into_iter().any(|(s, _)| !on(i, s) && !on(j, s))
            })
        };
        if two_faces_in_common || !sides.iter().all(room) || sides.iter().any(waits) {
            return None;
        }
        let m = f.vertices.len() as u32;
        let [at_p, at_q, at_r] = [p, q, r].map(|v| f.vertices[v as usize]);
        let pq = FragmentVertex::between(&at_p, &at_q, weights[1] / (weights[0] + weights[1]));
        f.vertices.push(FragmentVertex::between(&pq, &at_r, weights[2]));
        let [on_p, on_q, on_r] = [p, q, r].map(|v| f.on[v as usize]);
        let both = sheet.sets.both(on_p, on_q);
        f.on.push(sheet.sets.both(both, on_r));
        let corners = [p, q, r].into_iter().zip(weights).collect::<Vec<_>>();
        f.divide_face(&sides, &corners, m, &mut self.halves);
        for k in 0..self.halves.len() {
            let h = self.halves[k];
            self.divided(h.old, h.new, h.slot, sheet);
        }
        Some(m)
    }

    /// Marks the faces just made whose vertices lie on the sheet: there the blade has been before it
    /// turned.
    fn run_along_what_was_swept(&self, points: &BendPoints, sheet: &mut Sheet) {
        let made: Vec<u32> = self.halves.iter().flat_map(|h| [h.old, h.new]).collect();
        for &t in &made {
            for (face, corners) in TET_FACES.iter().enumerate() {
                let vertices = corners.map(|k| sheet.fragments.tets[t as usize][k]);
                let bend = |v: u32| points.bend.get(&[v, sheet.incision]);
                let [a, b, c] = vertices.map(bend);
                // Three bends lie in no plane.
                let flat = a.is_none() || b.is_none() || c.is_none() || a == b || b == c || c == a;
                let inside = made.contains(&sheet.fragments.neighbour[t as usize][face]);
                if inside && flat && vertices.iter().all(|&v| sheet.is_on(v)) {
                    let along = &mut sheet.fragments.along[t as usize][face];
                    *along = sheet.sets.with(*along, sheet.incision);
                }
            }
        }
    }
}

/// Where the blade pierces the boundary of fragment `t`, except where the incision has a bend already.
fn pierced(
    t: u32,
    blade: &[Vector3<f64>; 2],
    body: &Deformed,
    points: &BendPoints,
    sheet: &Sheet,
) -> Vec<Place> {
    let f = &*sheet.fragments;
    let tet = f.tets[t as usize];
    let x = tet.map(|v| body.vertex(f, f.piece[t as usize], v));
    let bent = tet.map(|v| points.bend.contains_key(&[v, sheet.incision]));
    let mut places = Vec::new();
    for (face, corners) in TET_FACES.iter().enumerate() {
        if corners.iter().any(|&k| bent[k]) {
            continue;
        }
        let Some(weights) = barycentric(blade, &corners.map(|k| x[k])) else { continue };
        let inner: Vec<usize> = (0..3).filter(|&k| weights[k] > 0.0).collect();
        let v = |k: usize| tet[corners[inner[k]]];
        places.push(match inner.len() {
            1 => Place::Vertex(v(0)),
            2 => Place::Edge([v(0), v(1)], weights[inner[1]]),
            _ => Place::Face(face, weights),
        });
    }
    places
}

/// Barycentric coordinates of the point where the blade passes through a triangle, its border included
/// with all that is [`SNAP`] from it; the sum is one, those on the border are zero.
fn barycentric([tip, heel]: &[Vector3<f64>; 2], corners: &[Vector3<f64>; 3]) -> Option<[f64; 3]> {
    let [p, q, r] = corners;
    let triangle = SweepTriangle::new(*p, *q, *r)?;
    // Parts of a bent blade meet in the faces of elements: none of these may be missed.
    let (from, to) = (triangle.side(tip), triangle.side(heel));
    if !(-SNAP..=1.0 + SNAP).contains(&(from / (from - to))) {
        return None;
    }
    let at = |v: &Vector3<f64>| Coord3D { x: v.x, y: v.y, z: v.z };
    let around = |p, q| orient3d(at(tip), at(heel), at(p), at(q));
    let volumes = [around(q, r), around(r, p), around(p, q)];
    let sum: f64 = volumes.iter().sum();
    // A blade in the plane of the triangle passes through its edges, which have other faces.
    if sum.abs() <= SNAP * triangle.double_area * (heel - tip).norm() {
        return None;
    }
    let weights = volumes.map(|v| v / sum);
    if weights.iter().any(|w| *w < -SNAP) {
        return None;
    }
    let weights = weights.map(|w| if w > SNAP { w } else { 0.0 });
    let sum: f64 = weights.iter().sum();
    Some(weights.map(|w| w / sum))
}
