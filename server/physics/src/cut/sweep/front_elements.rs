//! Elements at the front of an incision, opened a calibrated distance ahead of the blade.
//!
//! A piece is one element with one displacement, so it opens only when the sheet separates it, and nodes open only when
//! all elements around them do. An incision that ends inside elements therefore acts as if it ended about one element
//! before the blade, and the body is too stiff. So the incision goes on in its plane, by a share of the size of the
//! elements. The share is calibrated with beams whose solution is known (`scindo accuracy front`).
//!
//! What the blade has covered is remembered as points of the material, so that many small sweeps cover what one long
//! sweep does, and a blade that trembles covers nothing twice.
//!
//! A piece beside the opened incision, whether the blade or the front ahead of it opened it, is no source from which it
//! goes on: the blade between two lips is inside both of their elements, and would divide the lips.
//!
//! # Limit
//! Nor is a piece that the incision has separated ahead of the blade. A stroke of many small sweeps therefore does not end
//! where one long sweep does, but within a tenth of a cell of that on average.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Matrix4, Vector2, Vector3, Vector4};

use super::detect::Deformed;
use super::sweep_triangle::SweepTriangle;
use crate::assembly::ElementKind;
use crate::cut::topology::crossings::{Crossings, edge_key};
use crate::cut::topology::fragments::{FragmentVertex, Fragments, NONE};
use crate::cut::topology::incision_sets::IncisionSets;
use crate::mesh::{TET_EDGES, TET_FACES};

/// How far an incision goes on ahead of the blade.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum FrontRule {
    /// Not at all: no element is cut before the blade has left it.
    #[default]
    Behind,
    /// As far as makes up for the elements that do not open at its front. Only linear elements are calibrated; others
    /// behave as with [`Behind`](Self::Behind).
    Calibrated,
}

impl FrontRule {
    /// Distance ahead of the blade, over the mean length of an element's edges.
    pub fn reach(self, kind: ElementKind) -> f64 {
        match (self, kind) {
            (Self::Calibrated, ElementKind::Tet4) => LINEAR,
            _ => 0.0,
        }
    }
}

/// Calibrated reach of linear elements.
const LINEAR: f64 = 0.7;

/// Distance from its ends, relative to an edge, that a crossing ahead of the blade keeps.
const MARGIN: f64 = 1e-3;

/// Most points that are remembered of one section before they are replaced by their convex hull.
const MANY: usize = 48;

/// Largest ratio of the extents of points that are taken for a line, across it and along it. The plane of a narrower
/// strip would follow every tremor of the blade.
const LINE: f64 = 0.05;

/// What blades have covered in pieces that they have not left.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct FrontElements {
    /// Points at rest [m] on the border of what is covered, per incision (high half of the key) and piece.
    covered: BTreeMap<u64, Vec<Vector3<f64>>>,
}

/// A sweep and the body that it meets, at the positions at which the sweep began.
#[derive(Clone, Copy)]
pub struct Meeting<'a> {
    /// The body.
    pub body: &'a Deformed<'a>,
    /// What the blade swept.
    pub triangles: &'a [SweepTriangle],
    /// Incision of the sweep.
    pub incision: u32,
}

/// The cut state as far as it is read.
#[derive(Clone, Copy)]
pub struct State<'a> {
    /// Fragment mesh.
    pub fragments: &'a Fragments,
    /// Table of incision sets.
    pub sets: &'a IncisionSets,
    /// Crossings of edges.
    pub crossings: &'a Crossings,
}

/// A crossing: edge, and parameter from its first end.
type Crossing = ([u32; 2], f64);

/// What lies ahead of the blade.
#[derive(Debug, Default)]
pub struct Ahead {
    /// Crossings that are missing.
    pub crossings: Vec<Crossing>,
    /// Fragments around the crossed edges.
    pub fragments: Vec<u32>,
}

impl FrontElements {
    /// Remembers what the sweep covers of piece `p`, unless it has separated it, and returns the crossings within `reach`
    /// ahead of that, over the mean length of the element's edges.
    pub fn look_at(&mut self, p: u32, reach: f64, meeting: &Meeting<'_>, state: State<'_>) -> Ahead {
        let key = u64::from(meeting.incision) << 32 | u64::from(p);
        if is_separated(p, meeting, state) || has_lip(p, meeting, state) {
            if !self.covered.is_empty() {
                self.covered.remove(&key);
            }
            return Ahead::default();
        }
        let new = newly_covered(p, meeting);
        if new.is_empty() {
            return Ahead::default();
        }
        let covered = self.covered.entry(key).or_default();
        covered.extend(new);
        let Some(plane) = Plane::through(covered) else { return Ahead::default() };
        let hull = plane.hull(covered);
        if covered.len() > MANY {
            covered.clone_from(&hull);
        }
        let reach = reach * size(p, meeting);
        let border: Vec<Vector2<f64>> = hull.iter().map(|x| plane.project(x)).collect();
        let near = |x: &Vector3<f64>| distance(&plane.project(x), &border) <= reach;
        // Elements that the blade has not entered may lie within reach too; crossed edges lead to them.
        let mut fragments: Vec<u32> = meeting.body.pieces.fragments(p, state.fragments).collect();
        let (mut crossings, mut wedge) = (Vec::<Crossing>::new(), Vec::new());
        let mut k = 0;
        while let Some(&t) = fragments.get(k) {
            for ([a, b], s) in crossings_ahead(&plane, t, meeting, state, near) {
                if crossings.iter().any(|([c, d], _)| edge_key(*c, *d) == edge_key(a, b)) {
                    continue;
                }
                crossings.push(([a, b], s));
                state.fragments.wedge(t, a, b, &mut wedge);
                wedge.retain(|t| !fragments.contains(t));
                fragments.append(&mut wedge);
            }
            k += 1;
        }
        Ahead { crossings, fragments }
    }
}

/// Mean length [m] of the edges of a piece's element at rest.
fn size(p: u32, meeting: &Meeting<'_>) -> f64 {
    let mesh = meeting.body.mesh;
    let nodes = mesh.tets[meeting.body.pieces.pieces[p as usize].element as usize];
    let x = nodes.map(|n| mesh.nodes[n as usize]);
    TET_EDGES.iter().map(|&[i, j]| (x[i] - x[j]).norm()).sum::<f64>() / 6.0
}

/// Whether the incision divides piece `p`: whether faces that it does not open no longer join all of its fragments.
fn is_separated(p: u32, meeting: &Meeting<'_>, state: State<'_>) -> bool {
    let f = state.fragments;
    let members: Vec<u32> = meeting.body.pieces.fragments(p, f).collect();
    let opens = |t: u32, face: usize| {
        let corners = TET_FACES[face].map(|k| f.tets[t as usize][k]);
        state.sets.contains(f.along[t as usize][face], meeting.incision)
            && corners.iter().all(|&v| state.is_on(v, meeting.incision))
    };
    let mut reached = vec![members[0]];
    let mut k = 0;
    while let Some(&t) = reached.get(k) {
        for (face, &n) in f.neighbour[t as usize].iter().enumerate() {
            if n != NONE && f.piece[n as usize] == p && !reached.contains(&n) && !opens(t, face) {
                reached.push(n);
            }
        }
        k += 1;
    }
    reached.len() < members.len()
}

/// Whether piece `p` lies beside the incision, where that has opened before.
fn has_lip(p: u32, meeting: &Meeting<'_>, state: State<'_>) -> bool {
    let f = state.fragments;
    let is_lip = |t: u32, face: usize| {
        f.neighbour[t as usize][face] == NONE
            && state.sets.contains(f.along[t as usize][face], meeting.incision)
    };
    meeting.body.pieces.fragments(p, f).any(|t| (0..4).any(|face| is_lip(t, face)))
}

impl State<'_> {
    fn is_on(&self, v: u32, incision: u32) -> bool {
        self.sets.contains(self.fragments.on[v as usize], incision)
    }
}

fn rest_position(body: &Deformed<'_>, vertex: &FragmentVertex) -> Vector3<f64> {
    let held = vertex.nodes.iter().zip(vertex.weights).filter(|(node, _)| **node != NONE);
    held.map(|(&node, weight)| body.mesh.nodes[node as usize] * weight).sum()
}

/// Corners [m], at rest, of the parts of the sweep's triangles inside the element of piece `p`, as it is deformed.
fn newly_covered(p: u32, meeting: &Meeting<'_>) -> Vec<Vector3<f64>> {
    let Meeting { body, triangles, .. } = meeting;
    let piece = &body.pieces.pieces[p as usize];
    let x = piece.copies.map(|c| body.x[c as usize]);
    let rest = body.mesh.tets[piece.element as usize].map(|n| body.mesh.nodes[n as usize]);
    let (low, high) = x.iter().fold((x[0], x[0]), |(low, high), x| (low.inf(x), high.sup(x)));
    let Some(to_barycentric) = Matrix4::from_columns(&x.map(|x| x.push(1.0))).try_inverse() else {
        return Vec::new();
    };
    let mut points = Vec::new();
    for triangle in triangles.iter().filter(|triangle| triangle.overlaps(&low, &high)) {
        let corners = triangle.corners.map(|corner| to_barycentric * corner.push(1.0));
        let inside = inside_tet(corners.to_vec());
        points.extend(inside.iter().map(|w| (0..4).map(|k| rest[k] * w[k]).sum::<Vector3<f64>>()));
    }
    points.retain(|point| point.iter().all(|c| c.is_finite()));
    points
}

/// Clips a convex polygon in barycentric coordinates to the tetrahedron (Sutherland, Hodgman 1974).
fn inside_tet(mut polygon: Vec<Vector4<f64>>) -> Vec<Vector4<f64>> {
    for k in 0..4 {
        let mut kept = Vec::with_capacity(polygon.len() + 1);
        for (i, p) in polygon.iter().enumerate() {
            let q = &polygon[(i + 1) % polygon.len()];
            if p[k] >= 0.0 {
                kept.push(*p);
            }
            if (p[k] >= 0.0) != (q[k] >= 0.0) {
                kept.push(p.lerp(q, p[k] / (p[k] - q[k])));
            }
        }
        polygon = kept;
    }
    polygon
}

/// Where the plane crosses edges of fragment `t` that the incision does not cross yet, at points that are `near`.
fn crossings_ahead(
    plane: &Plane,
    t: u32,
    meeting: &Meeting<'_>,
    state: State<'_>,
    near: impl Fn(&Vector3<f64>) -> bool,
) -> Vec<Crossing> {
    let tet = state.fragments.tets[t as usize];
    let rest = tet.map(|v| rest_position(meeting.body, &state.fragments.vertices[v as usize]));
    let side = rest.map(|x| plane.distance(&x));
    let on = tet.map(|v| state.is_on(v, meeting.incision));
    let apart = |&[i, j]: &[usize; 2]| !on[i] && !on[j] && side[i] * side[j] < 0.0;
    let is_new = |[i, j]: &[usize; 2]| state.crossings.get(tet[*i], tet[*j], meeting.incision).is_none();
    let ahead = |[i, j]: [usize; 2]| {
        let s = side[i] / (side[i] - side[j]);
        near(&rest[i].lerp(&rest[j], s)).then(|| ([tet[i], tet[j]], s.clamp(MARGIN, 1.0 - MARGIN)))
    };
    TET_EDGES.into_iter().filter(apart).filter(is_new).filter_map(ahead).collect()
}

/// The plane that points lie in, with two directions along it.
#[derive(Clone, Copy, Debug)]
struct Plane {
    middle: Vector3<f64>,
    along: [Vector3<f64>; 2],
    normal: Vector3<f64>,
}

impl Plane {
    /// The plane with the least squares of distances from all points; `None` if they hardly span one.
    fn through(points: &[Vector3<f64>]) -> Option<Self> {
        let middle = points.iter().sum::<Vector3<f64>>() / points.len() as f64;
        let spread: Matrix3<f64> = points.iter().map(|p| (p - middle) * (p - middle).transpose()).sum();
        let eigen = spread.symmetric_eigen();
        let mut order = [0, 1, 2];
        order.sort_by(|&i, &j| eigen.eigenvalues[j].total_cmp(&eigen.eigenvalues[i]));
        let [u, v, n] = order.map(|k| eigen.eigenvectors.column(k).into_owned());
        let [long, wide] = [order[0], order[1]].map(|k| eigen.eigenvalues[k].max(0.0).sqrt());
        (wide > LINE * long).then_some(Self { middle, along: [u, v], normal: n })
    }

    /// Signed distance [m].
    fn distance(&self, x: &Vector3<f64>) -> f64 {
        self.normal.dot(&(x - self.middle))
    }

    fn project(&self, x: &Vector3<f64>) -> Vector2<f64> {
        let d = x - self.middle;
        Vector2::new(self.along[0].dot(&d), self.along[1].dot(&d))
    }

    /// Those points that span the convex hull of their projections, in order around it (Andrew 1979).
    fn hull(&self, points: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        let mut flat: Vec<(Vector2<f64>, Vector3<f64>)> =
            points.iter().map(|p| (self.project(p), *p)).collect();
        flat.sort_by(|p, q| p.0.x.total_cmp(&q.0.x).then(p.0.y.total_cmp(&q.0.y)));
        let chain = |points: &mut dyn Iterator<Item = &(Vector2<f64>, Vector3<f64>)>| {
            let mut chain: Vec<(Vector2<f64>, Vector3<f64>)> = Vec::new();
            for p in points {
                while let [.., a, b] = &chain[..]
                    && (b.0 - a.0).perp(&(p.0 - b.0)) <= 0.0
                {
                    chain.pop();
                }
                chain.push(*p);
            }
            chain.pop(); // the other chain begins with it
            chain
        };
        let (below, above) = (chain(&mut flat.iter()), chain(&mut flat.iter().rev()));
        below.into_iter().chain(above).map(|(_, p)| p).collect()
    }
}

/// Distance [m] of a point from a convex polygon, 0 inside.
fn distance(x: &Vector2<f64>, polygon: &[Vector2<f64>]) -> f64 {
    let edges = || (0..polygon.len()).map(|i| (polygon[i], polygon[(i + 1) % polygon.len()]));
    if edges().all(|(p, q)| (q - p).perp(&(x - p)) >= 0.0) {
        return 0.0;
    }
    let from_edge = |(p, q): (Vector2<f64>, Vector2<f64>)| {
        let along = ((x - p).dot(&(q - p)) / (q - p).norm_squared()).clamp(0.0, 1.0);
        (x - p.lerp(&q, along)).norm()
    };
    edges().map(from_edge).fold(f64::INFINITY, f64::min)
}
