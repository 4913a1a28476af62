//! Draws the edges of a surface on the boundary of the elements, so that the skin is divided along them.
//!
//! Every vertex of the surface becomes a skin point where it lands. Every edge goes from one of them to the other in
//! the plane that holds both and the normal of the surface, over as many boundary faces as lie between them. Where it
//! would meet another edge, the boundary is folded as seen from the surface. Such an edge goes between the others at the
//! end, on any way that is free, or is left out.
//!
//! # Source
//! Jiao, Heath 2004, "Overlaying surface meshes, part I: algorithms": the common refinement of two surfaces.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use super::base::Base;
use super::insert::{ON, Target};
use super::own::{Landing, OwnEdge, OwnSurface};
use super::pen::{Part, Pen};
use super::sheet::Sheet;

/// Longest way of an edge over the boundary, relative to the edge. Longer ones go around something.
const DETOUR: f64 = 4.0;

/// The edges of a surface on the skin.
pub(super) struct Overlay {
    /// Edges of the surface.
    pub edges: Vec<OwnEdge>,
    /// Skin points along each edge, from its first to its second vertex; empty for edges that are left out.
    pub paths: Vec<Vec<u32>>,
}

impl Overlay {
    /// Divides an undivided skin along all edges of a surface. The boundary has its nodes at `nodes` [m].
    ///
    /// Half-edges of the skin along an edge have its number as their `chain`; [`Sheet::forget_chains`] takes it away.
    pub(super) fn new(base: &Base, nodes: &[Vector3<f64>], own: &OwnSurface<'_>, sheet: &mut Sheet) -> Self {
        let map = Map { base, nodes, across: base.across() };
        let mut pen = Pen::new(base, sheet);
        let landed = land(&map, &mut pen, own.landings);
        let edges = own.edges();
        pen.sheet.chains = vec![Vec::new(); edges.len()];
        let mut left_out = Vec::new();
        for (number, edge) in (0u32..).zip(&edges) {
            let [Some(from), Some(to)] = edge.ends.map(|v| landed[v as usize].as_ref()) else { continue };
            let up = edge.beside.iter().flatten().map(|&t| own.area_normal(t)).sum();
            let [a, b] = edge.ends.map(|v| own.vertices[v as usize]);
            let way = map.way([from, to], &up, (b - a).norm());
            match way.and_then(|way| draw(&mut pen, [from, to], &way)) {
                Some(parts) => pen.mark(number, &parts),
                None => left_out.push((number, [from.point, to.point])),
            }
        }
        // What the others leave between them is room enough in most places.
        for (number, [from, to]) in left_out {
            if let Some(parts) = pen.lead(from, to) {
                pen.mark(number, &parts);
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
    /// Where it lies [m].
    at: Vector3<f64>,
    /// The boundary faces that it lies on.
    faces: Vec<u32>,
}

/// Makes a skin point where each vertex lands. Of two vertices at one place the second has none.
fn land(map: &Map<'_>, pen: &mut Pen<'_>, landings: &[Option<Landing>]) -> Vec<Option<Landed>> {
    let key = |mut nodes: [u32; 3]| {
        nodes.sort_unstable();
        nodes
    };
    let by_nodes: BTreeMap<[u32; 3], u32> =
        (0..).zip(&map.base.faces).map(|(f, face)| (key(face.nodes), f)).collect();
    let at_corners = map.base.faces_at_corners();
    let mut land = |landing: &Landing| {
        let f = *by_nodes.get(&key(landing.nodes))?;
        let face = &map.base.faces[f as usize];
        let weight = |node| landing.nodes.iter().position(|n| *n == node).map_or(0.0, |k| landing.weights[k]);
        let w = face.nodes.map(weight).map(|w| if w <= ON { 0.0 } else { w });
        let sum: f64 = w.iter().sum();
        let w = w.map(|w| w / sum);
        let faces = match (0..3).filter(|&k| w[k] == 0.0).collect::<Vec<_>>()[..] {
            [] => vec![f],
            [k] => map.across[face.edges[(k + 1) % 3] as usize].to_vec(),
            _ => at_corners[face.corners[Vector3::from(w).iamax()] as usize].clone(),
        };
        let point = pen.point(&Target { f, w })?;
        Some(Landed { point, at: pen.sheet.flat(point, map.nodes), faces })
    };
    landings.iter().map(|landing| landing.as_ref().and_then(&mut land)).collect()
}

/// Divides the skin along a way between two vertices and returns its parts. None if it meets another edge.
fn draw(pen: &mut Pen<'_>, [from, to]: [&Landed; 2], way: &Way) -> Option<Vec<Part>> {
    let mut straight = Vec::with_capacity(way.crossings.len() + 1);
    let mut last = from.point;
    for crossing in &way.crossings {
        let point = pen.point_on_side(crossing.face, crossing.side, crossing.share);
        if point != last {
            straight.push((crossing.face, last, point));
        }
        last = point;
        if point == to.point {
            break;
        }
    }
    if last != to.point {
        straight.push((way.end, last, to.point));
    }
    let mut parts = Vec::with_capacity(straight.len());
    let drawn = straight.into_iter().all(|(face, from, to)| pen.join(face, from, to, &mut parts));
    (drawn && pen.is_free(&parts)).then_some(parts)
}

/// The boundary, to find ways on.
struct Map<'a> {
    base: &'a Base,
    nodes: &'a [Vector3<f64>],
    /// The two faces at each edge.
    across: Vec<[u32; 2]>,
}

/// The way of an edge over the boundary.
struct Way {
    crossings: Vec<Crossing>,
    /// The last face.
    end: u32,
}

/// A crossing from one boundary face to the next.
struct Crossing {
    /// The face that is left.
    face: u32,
    side: usize,
    /// Where, as a share of that side.
    share: f64,
}

/// A plane through `p` [m] with the unit normal `m`.
struct Plane {
    p: Vector3<f64>,
    m: Vector3<f64>,
}

impl Map<'_> {
    /// The way of an edge of `length` [m] with the fewest crossings. `up` is the normal of the surface.
    fn way(&self, [from, to]: [&Landed; 2], up: &Vector3<f64>, length: f64) -> Option<Way> {
        let plane = Plane { p: from.at, m: (to.at - from.at).cross(up).try_normalize(0.0)? };
        let longest = DETOUR * length.max((to.at - from.at).norm());
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
            // Around a corner in the plane, whose neighbours are all on one side, the way comes back without a length.
            if face == start {
                return None;
            }
        }
        Some(Way { crossings, end: face })
    }
}
