//! Draws the edges of a surface on the boundary of the elements, so that the skin is divided along them.
//!
//! Every vertex of the surface becomes a skin point where it lands. Every edge goes from one of them to the other in
//! the plane that holds both and the normal of the surface, over as many boundary faces as lie between them. Where it
//! would meet another edge, the boundary is folded as seen from the surface, and the edge is left out.
//!
//! # Source
//! Jiao, Heath 2004, "Overlaying surface meshes, part I: algorithms": the common refinement of two surfaces.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use super::base::Base;
use super::insert::{ON, Target};
use super::own::{OwnEdge, OwnSurface};
use super::sheet::Sheet;
use crate::cut::topology::fragments::NONE;

/// Longest way of an edge over the boundary, relative to the edge. Longer ones go around something.
const DETOUR: f64 = 4.0;

/// The edges of a surface on the skin.
pub struct Overlay {
    /// Edges of the surface.
    pub edges: Vec<OwnEdge>,
    /// Skin points along each edge, from its first to its second vertex; empty for edges that are left out.
    pub paths: Vec<Vec<u32>>,
}

impl Overlay {
    /// Divides an undivided skin along all edges of a surface. The boundary has its nodes at `nodes` [m].
    ///
    /// Half-edges of the skin along an edge have its number as their `chain`; [`Sheet::forget_chains`] takes it away.
    pub fn new(base: &Base, nodes: &[Vector3<f64>], own: &OwnSurface<'_>, sheet: &mut Sheet) -> Self {
        let edges = own.edges();
        let mut across = vec![[NONE; 2]; base.n_edges];
        for (f, face) in (0u32..).zip(&base.faces) {
            for (&edge, &forward) in face.edges.iter().zip(&face.forward) {
                across[edge as usize][usize::from(forward)] = f;
            }
        }
        let mut pen =
            Pen { base, nodes, sheet, across, faces_at: vec![Vec::new(); base.n_corners], used: Vec::new() };
        for (f, face) in (0u32..).zip(&base.faces) {
            face.corners.iter().for_each(|&corner| pen.faces_at[corner as usize].push(f));
        }
        let landed = pen.land(own);
        pen.sheet.chains = vec![Vec::new(); edges.len()];
        for (number, edge) in (0u32..).zip(&edges) {
            let [Some(from), Some(to)] = edge.ends.map(|v| landed[v as usize].as_ref()) else { continue };
            let up = edge.beside.iter().flatten().map(|&t| own.area_normal(t)).sum();
            let length = own.vertices[edge.ends[0] as usize] - own.vertices[edge.ends[1] as usize];
            if let Some(path) = pen.draw([from, to], up, length.norm()) {
                pen.mark(number, &path);
            }
        }
        let paths = std::mem::take(&mut pen.sheet.chains);
        Self { edges, paths }
    }
}

/// A vertex of the surface on the boundary.
struct Landed {
    /// Its skin point.
    point: u32,
    /// The boundary faces that it lies on.
    faces: Vec<u32>,
}

/// A crossing from one boundary face to the next.
struct Crossing {
    /// The face that is left.
    face: u32,
    /// Its side.
    side: usize,
    /// Where, as a share of that side.
    share: f64,
}

/// Draws on the skin.
struct Pen<'a> {
    base: &'a Base,
    nodes: &'a [Vector3<f64>],
    sheet: &'a mut Sheet,
    /// The two faces at each edge of the boundary.
    across: Vec<[u32; 2]>,
    /// The faces at each corner of the boundary.
    faces_at: Vec<Vec<u32>>,
    /// Skin points at vertices or on edges that have been drawn.
    used: Vec<bool>,
}

impl Pen<'_> {
    /// Makes a skin point where each vertex lands. Of two vertices at one place the second has none.
    fn land(&mut self, own: &OwnSurface<'_>) -> Vec<Option<Landed>> {
        let key = |mut nodes: [u32; 3]| {
            nodes.sort_unstable();
            nodes
        };
        let by_nodes: BTreeMap<[u32; 3], u32> =
            (0..).zip(&self.base.faces).map(|(f, face)| (key(face.nodes), f)).collect();
        let mut landed = Vec::with_capacity(own.vertices.len());
        for landing in own.landings {
            landed.push(landing.as_ref().and_then(|landing| {
                let f = *by_nodes.get(&key(landing.nodes))?;
                let at =
                    |node| landing.nodes.iter().position(|n| *n == node).map_or(0.0, |k| landing.weights[k]);
                let w = self.base.faces[f as usize].nodes.map(at);
                let w = w.map(|w| if w <= ON { 0.0 } else { w });
                let sum: f64 = w.iter().sum();
                let point = self.insert(&Target { f, w: w.map(|w| w / sum) });
                let taken = std::mem::replace(&mut self.used[point as usize], true);
                (!taken).then(|| Landed { point, faces: self.faces_of(f, point) })
            }));
        }
        landed
    }

    /// The skin point at a place of the boundary.
    fn insert(&mut self, target: &Target) -> u32 {
        let at = Sheet::vertex(self.base, target);
        let before = self.sheet.points.len();
        let point = self.sheet.insert_point(self.base, target.f, &at, 0.0);
        self.used.resize(self.sheet.points.len(), false);
        if point as usize >= before {
            self.used[point as usize] = self.on_path(target.f, point);
        }
        point
    }

    /// Whether an edge that has been drawn runs through a new point over face `f`.
    fn on_path(&self, f: u32, point: u32) -> bool {
        let sheet = &*self.sheet;
        let mut sides = sheet.over[f as usize].iter().flat_map(|&t| 3 * t..3 * t + 3);
        sides.any(|h| sheet.chain[h as usize] != NONE && (sheet.from(h) == point || sheet.to(h) == point))
    }

    /// The faces that a skin point over face `f` lies on.
    fn faces_of(&self, f: u32, point: u32) -> Vec<u32> {
        let face = &self.base.faces[f as usize];
        let w = self.sheet.point_on(self.base, f, point);
        let zero: Vec<usize> = (0..3).filter(|&k| w[k] == 0.0).collect();
        match zero[..] {
            [] => vec![f],
            [k] => self.across[face.edges[(k + 1) % 3] as usize].to_vec(),
            _ => {
                let k = (0..3).find(|&k| w[k] != 0.0).unwrap_or(0);
                self.faces_at[face.corners[k] as usize].clone()
            }
        }
    }

    /// Divides the skin along an edge of `length` [m] and returns its parts, or nothing if the edge finds no way or meets
    /// another edge. `up` is the normal of the surface.
    fn draw(&mut self, [from, to]: [&Landed; 2], up: Vector3<f64>, length: f64) -> Option<Vec<Part>> {
        let way = self.way([from, to], up, length)?;
        let mut straight = Vec::with_capacity(way.crossings.len() + 1);
        let mut last = from.point;
        for crossing in &way.crossings {
            let mut w = [0.0; 3];
            w[crossing.side] = 1.0 - crossing.share;
            w[(crossing.side + 1) % 3] = crossing.share;
            let point = self.insert(&Target { f: crossing.face, w });
            if point != last {
                straight.push(Part { face: crossing.face, ends: [last, point] });
            }
            last = point;
            if point == to.point {
                break;
            }
        }
        if last != to.point {
            straight.push(Part { face: way.end, ends: [last, to.point] });
        }
        let mut parts = Vec::with_capacity(straight.len());
        for Part { face, ends: [from, to] } in straight {
            let points = self.sheet.straight(self.base, face, from, to, 0.0)?;
            self.used.resize(self.sheet.points.len(), false);
            parts.extend(points.windows(2).map(|ends| Part { face, ends: [ends[0], ends[1]] }));
        }
        self.is_free(&parts).then_some(parts)
    }

    /// Whether a path meets no other path, nor itself.
    fn is_free(&self, parts: &[Part]) -> bool {
        let mut inner: Vec<u32> = parts[1..].iter().map(|part| part.ends[0]).collect();
        let apart = inner.iter().all(|&point| !self.used[point as usize]);
        inner.sort_unstable();
        let simple = inner.windows(2).all(|pair| pair[0] != pair[1]);
        let unmarked =
            |part: &Part| part.side(self.sheet).is_some_and(|h| self.sheet.chain[h as usize] == NONE);
        apart && simple && parts.iter().all(unmarked)
    }

    /// Marks the parts of a path as edge `number`.
    fn mark(&mut self, number: u32, parts: &[Part]) {
        for part in parts {
            let Some(h) = part.side(self.sheet) else { continue };
            self.sheet.chain[h as usize] = number;
            self.sheet.chain[self.sheet.twin[h as usize] as usize] = number;
            part.ends.iter().for_each(|&point| self.used[point as usize] = true);
        }
        let ends = parts.iter().map(|part| part.ends[1]);
        self.sheet.chains[number as usize] =
            parts.iter().take(1).map(|part| part.ends[0]).chain(ends).collect();
    }

    /// The way of an edge over the boundary with the fewest crossings.
    fn way(&self, [from, to]: [&Landed; 2], up: Vector3<f64>, length: f64) -> Option<Way> {
        let [p, q] = [from, to].map(|landed| self.sheet.flat(landed.point, self.nodes));
        let plane = Plane { p, m: (q - p).cross(&up).try_normalize(0.0)? };
        let longest = DETOUR * length.max((q - p).norm());
        let ways = from.faces.iter().filter_map(|&start| self.way_from(start, &to.faces, &plane, longest));
        ways.min_by_key(|way| way.crossings.len())
    }

    /// The way from a point of face `start` to one of the faces `ends`, along a plane to whose normal it keeps left. Where
    /// the plane meets a corner of the boundary, the corner counts as left of it.
    fn way_from(&self, start: u32, ends: &[u32], plane: &Plane, longest: f64) -> Option<Way> {
        let (mut face, mut crossings) = (start, Vec::new());
        let (mut last, mut gone) = (plane.p, 0.0);
        while !ends.contains(&face) {
            let corners = self.base.faces[face as usize].nodes.map(|node| self.nodes[node as usize]);
            let right = corners.map(|x| plane.m.dot(&(x - plane.p)));
            let side = (0..3).find(|&k| right[k] > 0.0 && right[(k + 1) % 3] <= 0.0)?;
            let next = (side + 1) % 3;
            let share = right[side] / (right[side] - right[next]);
            let here = corners[side].lerp(&corners[next], share);
            gone += (here - last).norm();
            if gone > longest {
                return None;
            }
            last = here;
            crossings.push(Crossing { face, side, share });
            let [a, b] = self.across[self.base.faces[face as usize].edges[side] as usize];
            face = if a == face { b } else { a };
        }
        Some(Way { crossings, end: face })
    }
}

/// A plane through `p` [m] with the unit normal `m`.
struct Plane {
    p: Vector3<f64>,
    m: Vector3<f64>,
}

/// The way of an edge over the boundary.
struct Way {
    crossings: Vec<Crossing>,
    /// The last face.
    end: u32,
}

/// A straight part of an edge over a boundary face, between two skin points.
#[derive(Clone, Copy)]
struct Part {
    face: u32,
    ends: [u32; 2],
}

impl Part {
    /// A half-edge of the skin along it.
    fn side(&self, sheet: &Sheet) -> Option<u32> {
        let [a, b] = self.ends;
        sheet.half_edge(self.face, a, b).or_else(|| sheet.half_edge(self.face, b, a))
    }
}
