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
//! The front opens elements before the blade reaches them. The blade between their lips is inside both of them, and would
//! divide the lips. So it counts where it is seen from the middle between the lips, and the incision goes on in the plane
//! that it has there.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Matrix4, Vector2, Vector3, Vector4};

use super::detect::Deformed;
use super::sweep_triangle::SweepTriangle;
use crate::cut::topology::crossings::{Crossings, edge_key};
use crate::cut::topology::fragments::{FragmentVertex, Fragments, NONE};
use crate::cut::topology::incision_sets::IncisionSets;
use crate::element::ElementKind;
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
pub(crate) struct FrontElements {
    /// Points at rest [m] on the border of what is covered, per incision (high half of the key) and piece.
    covered: BTreeMap<u64, Vec<Vector3<f64>>>,
}

/// A sweep and the body that it meets, at the positions at which the sweep began.
#[derive(Clone, Copy)]
pub(crate) struct Meeting<'a> {
    pub body: &'a Deformed<'a>,
    /// What the blade swept.
    pub triangles: &'a [SweepTriangle],
    /// Incision of the sweep.
    pub incision: u32,
}

/// The cut state as far as it is read.
#[derive(Clone, Copy)]
pub(crate) struct State<'a> {
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
pub(crate) struct Ahead {
    /// Crossings that are missing.
    pub crossings: Vec<Crossing>,
    /// Fragments around the crossed edges.
    pub fragments: Vec<u32>,
}

impl FrontElements {
    /// Remembers what the sweep covers of piece `p`, unless it has separated it, and returns the crossings within `reach`
    /// ahead of that, over the mean length of the element's edges.
    pub(crate) fn look_at(&mut self, p: u32, reach: f64, meeting: &Meeting<'_>, state: State<'_>) -> Ahead {
        let e = meeting.body.pieces.pieces[p as usize].element;
        let key = key(meeting.incision, p);
        if is_parted(e, meeting, state) {
            self.covered.remove(&key);
            return Ahead::default();
        }
        if is_separated(p, meeting, state) {
            if let Some(covered) = self.covered.remove(&key) {
                self.covered.entry(key_between(meeting.incision, e)).or_default().extend(covered);
            }
            return Ahead::default();
        }
        let x = meeting.body.pieces.pieces[p as usize].copies.map(|c| meeting.body.x[c as usize]);
        let new = newly_covered((e, x), meeting);
        if new.is_empty() {
            return Ahead::default();
        }
        let covered = self.covered.entry(key).or_default();
        covered.extend(new);
        let Some(plane) = Plane::through(covered) else { return Ahead::default() };
        let border = shorten(covered, &plane);
        let from = meeting.body.pieces.fragments(p, state.fragments).collect();
        ahead((&plane, &border), from, reach * size(e, meeting), meeting, state, |_| true)
    }

    /// The same between the lips of element `e`, if the incision has parted it: ahead of the blade in the plane of the
    /// lips, among elements that are not parted.
    pub(crate) fn look_between(
        &mut self,
        e: u32,
        reach: f64,
        meeting: &Meeting<'_>,
        state: State<'_>,
    ) -> Ahead {
        let Some(lips) = lips(e, meeting, state) else { return Ahead::default() };
        let pieces = lips.map(|p| meeting.body.pieces.pieces[p as usize].copies);
        let x = [0, 1, 2, 3]
            .map(|k| 0.5 * pieces.iter().map(|c| meeting.body.x[c[k] as usize]).sum::<Vector3<f64>>());
        let new = newly_covered((e, x), meeting);
        if new.is_empty() {
            return Ahead::default();
        }
        let covered = self.covered.entry(key_between(meeting.incision, e)).or_default();
        covered.extend(new);
        let f = state.fragments;
        let members: Vec<u32> = lips.iter().flat_map(|&p| meeting.body.pieces.fragments(p, f)).collect();
        let on =
            members.iter().flat_map(|&t| f.tets[t as usize]).filter(|&v| state.is_on(v, meeting.incision));
        let rim: Vec<Vector3<f64>> =
            on.map(|v| rest_position(meeting.body, &f.vertices[v as usize])).collect();
        let Some(plane) = Plane::through(&rim) else { return Ahead::default() };
        let border = shorten(covered, &plane);
        let is_whole = |t: u32| !is_parted(f.element[t as usize], meeting, state);
        let beside = members.iter().flat_map(|&t| f.neighbour[t as usize]).filter(|&n| n != NONE);
        let mut from: Vec<u32> = beside.filter(|&n| f.element[n as usize] != e && is_whole(n)).collect();
        from.sort_unstable();
        from.dedup();
        ahead((&plane, &border), from, reach * size(e, meeting), meeting, state, is_whole)
    }

    /// Forgets what the blade of `incision` covers between lips, except in the elements `near` it, in ascending order.
    pub(crate) fn leave(&mut self, incision: u32, near: &[u32]) {
        let is_old = |key: &u64| {
            let (of, at) = ((key >> 32) as u32, *key as u32);
            of == incision && at & BETWEEN != 0 && near.binary_search(&(at & !BETWEEN)).is_err()
        };
        self.covered.retain(|key, _| !is_old(key));
    }
}

/// Marks keys of elements, whose lips the blade is between, among those of pieces.
const BETWEEN: u32 = 1 << 31;

fn key(incision: u32, p: u32) -> u64 {
    u64::from(incision) << 32 | u64::from(p)
}

fn key_between(incision: u32, e: u32) -> u64 {
    key(incision, e | BETWEEN)
}

/// The border of what is covered, in a plane. Points within it are forgotten where there are many.
fn shorten(covered: &mut Vec<Vector3<f64>>, plane: &Plane) -> Vec<Vector2<f64>> {
    let hull = plane.hull(covered);
    if covered.len() > MANY {
        covered.clone_from(&hull);
    }
    hull.iter().map(|x| plane.project(x)).collect()
}

/// Crossings of the plane within `reach` [m] of the border, from the fragments `fragments` on, and in those alone that
/// `may_change`.
fn ahead(
    (plane, border): (&Plane, &[Vector2<f64>]),
    mut fragments: Vec<u32>,
    reach: f64,
    meeting: &Meeting<'_>,
    state: State<'_>,
    may_change: impl Fn(u32) -> bool,
) -> Ahead {
    let near = |x: &Vector3<f64>| distance(&plane.project(x), border) <= reach;
    // Elements that the blade has not entered may lie within reach too; crossed edges lead to them.
    let (mut crossings, mut wedge) = (Vec::<Crossing>::new(), Vec::new());
    let mut k = 0;
    while let Some(&t) = fragments.get(k) {
        for ([a, b], s) in crossings_ahead(plane, t, meeting, state, near) {
            if crossings.iter().any(|([c, d], _)| edge_key(*c, *d) == edge_key(a, b)) {
                continue;
            }
            state.fragments.wedge(t, a, b, &mut wedge);
            if !wedge.iter().all(|&t| may_change(t)) {
                continue;
            }
            crossings.push(([a, b], s));
            wedge.retain(|t| !fragments.contains(t));
            fragments.append(&mut wedge);
        }
        k += 1;
    }
    Ahead { crossings, fragments }
}

/// Mean length [m] of the edges of element `e` at rest.
fn size(e: u32, meeting: &Meeting<'_>) -> f64 {
    let mesh = meeting.body.mesh;
    let x = mesh.tets[e as usize].map(|n| mesh.nodes[n as usize]);
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

/// Whether the incision has parted element `e`.
fn is_parted(e: u32, meeting: &Meeting<'_>, state: State<'_>) -> bool {
    meeting.body.pieces.of_element(e).filter(|&p| has_lip(p, meeting, state)).nth(1).is_some()
}

/// The two pieces of element `e` that the incision has parted; `None` if it has not, or if there are more.
fn lips(e: u32, meeting: &Meeting<'_>, state: State<'_>) -> Option<[u32; 2]> {
    let mut beside = meeting.body.pieces.of_element(e).filter(|&p| has_lip(p, meeting, state));
    let lips = [beside.next()?, beside.next()?];
    beside.next().is_none().then_some(lips)
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

/// Corners [m], at rest, of the parts of the sweep's triangles inside element `e`, whose nodes are at `x` [m].
fn newly_covered((e, x): (u32, [Vector3<f64>; 4]), meeting: &Meeting<'_>) -> Vec<Vector3<f64>> {
    let Meeting { body, triangles, .. } = meeting;
    let rest = body.mesh.tets[e as usize].map(|n| body.mesh.nodes[n as usize]);
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
