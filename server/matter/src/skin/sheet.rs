//! The skin triangles over the boundary faces, and the operations that split them.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use robust::Coord3D;

use super::base::Base;
use crate::cut::topology::fragments::{FragmentVertex, NONE};

/// Rest position [m] of the skin for a point of the boundary [m] and its outward unit normal.
pub type SkinShape<'a> = dyn FnMut(&Vector3<f64>, &Vector3<f64>) -> Vector3<f64> + 'a;

/// A vertex of the skin.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct Point {
    /// Where it lies on the boundary of the uncut mesh.
    pub at: FragmentVertex,
    /// Rest position [m].
    pub place: Vector3<f64>,
    /// Whether the point represents a fragment vertex. Such a point never moves on the boundary.
    pub claimed: bool,
}

/// Key of a place on the boundary: edge or face, and the bits of the coordinates there.
pub(super) type Claim = (u32, [u64; 3]);

/// A closed triangulation; half-edge 3·t + k runs from corner k to the next of triangle t.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Sheet {
    pub points: Vec<Point>,
    /// Points of each triangle, counter-clockwise seen from outside.
    pub corners: Vec<[u32; 3]>,
    /// Opposite of each half-edge.
    pub twin: Vec<u32>,
    /// Chain of each half-edge where the skin is cut, else [`NONE`].
    pub chain: Vec<u32>,
    /// Boundary face under each triangle.
    pub face: Vec<u32>,
    /// Triangles over each boundary face.
    pub over: Vec<Vec<u32>>,
    /// Boundary faces over which triangles were added since the caller last emptied this list.
    pub split: Vec<u32>,
    /// Points along each inserted edge of the cut curve.
    pub chains: Vec<Vec<u32>>,
    /// Point at each corner of the boundary.
    pub corner_point: Vec<u32>,
    /// Points that represent fragment vertices, by their place.
    pub claims: BTreeMap<Claim, u32>,
    /// Number of skin edges that two parts of the cut curve would share. A conforming cut curve has none.
    pub conflicts: usize,
}

impl Sheet {
    /// Divides every boundary face into `n`² triangles. A point at `flat` [m] on the boundary rests at
    /// `shape(flat, normal)`.
    pub(super) fn new(base: &Base, nodes: &[Vector3<f64>], n: usize, shape: &mut SkinShape<'_>) -> Self {
        let mut sheet = Self {
            corner_point: vec![NONE; base.n_corners],
            over: vec![Vec::new(); base.faces.len()],
            ..Self::default()
        };
        // Points on edges and corners are shared, so the faces meet without gaps.
        let mut on_edge: Vec<Vec<u32>> = vec![Vec::new(); base.n_edges];
        let mut seam: BTreeMap<(u32, usize), u32> = BTreeMap::new();
        for (f, face) in (0u32..).zip(&base.faces) {
            let mut grid: BTreeMap<(usize, usize), u32> = BTreeMap::new();
            for j in 0..=n {
                for i in 0..=n - j {
                    let parts = [n - i - j, i, j];
                    let point = sheet.grid_point(face, parts, n, &mut on_edge);
                    grid.insert((i, j), point);
                }
            }
            for j in 0..n {
                for i in 0..n - j {
                    let (a, b, c) = ((i, j), (i + 1, j), (i, j + 1));
                    sheet.push([a, b, c].map(|p| grid[&p]), f);
                    if i + j + 1 < n {
                        let d = (i + 1, j + 1);
                        sheet.push([b, d, c].map(|p| grid[&p]), f);
                    }
                }
            }
            // Half-edges inside a face find their opposite here, those on its border by their parts of the
            // edge.
            let inner: BTreeMap<(u32, u32), u32> = sheet.over[f as usize]
                .iter()
                .flat_map(|&t| (0..3).map(move |k| 3 * t + k))
                .map(|h| ((sheet.from(h), sheet.to(h)), h))
                .collect();
            for (&(p, q), &h) in &inner {
                match inner.get(&(q, p)) {
                    Some(&twin) => sheet.twin[h as usize] = twin,
                    None => sheet.sew(face, [p, q], h, n, &mut seam),
                }
            }
        }
        // Normals belong to the flat skin, before any point is moved off it.
        let normals = sheet.normals(nodes);
        for (point, normal) in sheet.points.iter_mut().zip(&normals) {
            point.place = shape(&flat(&point.at, nodes), normal);
        }
        sheet.split.clear();
        sheet
    }

    fn grid_point(
        &mut self,
        face: &super::base::BaseFace,
        parts: [usize; 3],
        n: usize,
        on_edge: &mut [Vec<u32>],
    ) -> u32 {
        let weight = parts.map(|p| p as f64 / n as f64);
        if let Some(k) = (0..3).find(|&k| parts[k] == n) {
            let known = self.corner_point[face.corners[k] as usize];
            if known != NONE {
                return known;
            }
            self.corner_point[face.corners[k] as usize] = self.points.len() as u32;
            return self.add(FragmentVertex::at_node(face.nodes[k]), true);
        }
        if let Some(k) = (0..3).find(|&k| parts[(k + 2) % 3] == 0) {
            let list = &mut on_edge[face.edges[k] as usize];
            list.resize(n - 1, NONE);
            let index = if face.forward[k] { parts[(k + 1) % 3] } else { parts[k] } - 1;
            if list[index] != NONE {
                return list[index];
            }
            list[index] = self.points.len() as u32;
            let (a, b) = (k, (k + 1) % 3);
            let at = FragmentVertex {
                nodes: [face.nodes[a], face.nodes[b], NONE, NONE],
                weights: [weight[a], weight[b], 0.0, 0.0],
            };
            return self.add(at, false);
        }
        let [a, b, c] = face.nodes;
        let at = FragmentVertex { nodes: [a, b, c, NONE], weights: [weight[0], weight[1], weight[2], 0.0] };
        self.add(at, false)
    }

    fn add(&mut self, at: FragmentVertex, claimed: bool) -> u32 {
        self.points.push(Point { at, place: Vector3::zeros(), claimed });
        self.points.len() as u32 - 1
    }

    /// Joins half-edge `h` on the border of its face to its opposite on the neighbouring face.
    fn sew(
        &mut self,
        face: &super::base::BaseFace,
        ends: [u32; 2],
        h: u32,
        n: usize,
        seam: &mut BTreeMap<(u32, usize), u32>,
    ) {
        let [p, q] = ends.map(|p| face.nodes.map(|node| self.points[p as usize].at.weight_of(node)));
        let side = (0..3).find(|&k| p[(k + 2) % 3] == 0.0 && q[(k + 2) % 3] == 0.0).unwrap_or(0);
        let index = (p[(side + 1) % 3] * n as f64).round() as usize;
        let index = if face.forward[side] { index } else { n - 1 - index };
        match seam.remove(&(face.edges[side], index)) {
            Some(twin) => self.link(h, twin),
            None => {
                seam.insert((face.edges[side], index), h);
            }
        }
    }

    /// Area-weighted unit normals of the flat sheet.
    pub(super) fn normals(&self, nodes: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        let mut normals = vec![Vector3::zeros(); self.points.len()];
        for corners in &self.corners {
            let [p, q, r] = corners.map(|p| flat(&self.points[p as usize].at, nodes));
            let area = (q - p).cross(&(r - p));
            corners.iter().for_each(|&p| normals[p as usize] += area);
        }
        normals.iter().map(|n| n.try_normalize(0.0).unwrap_or_default()).collect()
    }

    /// Appends a triangle without neighbours and returns its number.
    pub(super) fn push(&mut self, corners: [u32; 3], face: u32) -> u32 {
        let t = self.corners.len() as u32;
        self.corners.push(corners);
        self.face.push(face);
        self.twin.extend([NONE; 3]);
        self.chain.extend([NONE; 3]);
        self.over[face as usize].push(t);
        self.split.push(face);
        t
    }

    /// First point of half-edge `h`.
    pub(super) fn from(&self, h: u32) -> u32 {
        self.corners[h as usize / 3][h as usize % 3]
    }

    /// Last point of half-edge `h`.
    pub(super) fn to(&self, h: u32) -> u32 {
        self.corners[h as usize / 3][(h as usize + 1) % 3]
    }

    /// Makes two half-edges each other's opposite.
    pub(super) fn link(&mut self, g: u32, h: u32) {
        self.twin[g as usize] = h;
        self.twin[h as usize] = g;
    }

    /// The half-edge from `p` to `q` over face `f`, if there is one.
    pub(super) fn half_edge(&self, f: u32, p: u32, q: u32) -> Option<u32> {
        let half_edges = self.over[f as usize].iter().flat_map(|&t| (0..3).map(move |k| 3 * t + k));
        half_edges.into_iter().find(|&h| self.from(h) == p && self.to(h) == q)
    }

    /// Barycentric coordinates on face `f` of a point of the boundary.
    pub(super) fn coordinates(base: &Base, f: u32, at: &FragmentVertex) -> [f64; 3] {
        base.faces[f as usize].nodes.map(|node| at.weight_of(node))
    }

    /// Barycentric coordinates of skin point `p` on face `f`.
    pub(super) fn point_on(&self, base: &Base, f: u32, p: u32) -> [f64; 3] {
        Self::coordinates(base, f, &self.points[p as usize].at)
    }

    /// Twice the signed area of a triangle on a face, relative to that of the face. The sign is exact.
    pub(super) fn area(p: &[f64; 3], q: &[f64; 3], r: &[f64; 3]) -> f64 {
        let c = |v: &[f64; 3]| Coord3D { x: v[0], y: v[1], z: v[2] };
        robust::orient3d(c(p), c(q), c(r), Coord3D { x: 0.0, y: 0.0, z: 0.0 })
    }

    /// Splits the edge of half-edge `h` at point `w`, in both triangles beside it.
    pub(super) fn split_edge(&mut self, h: u32, w: u32) {
        let (p, q, g, chain) = (self.from(h), self.to(h), self.twin[h as usize], self.chain[h as usize]);
        let (near, far) = (self.halve(h, w), self.halve(g, w));
        self.link(h, far);
        self.link(near, g);
        self.chain[near as usize] = chain;
        self.chain[far as usize] = chain;
        if chain != NONE {
            let points = &mut self.chains[chain as usize];
            let place = points.windows(2).position(|e| e == [p, q] || e == [q, p]);
            points.insert(place.map_or(1, |i| i + 1), w);
        }
    }

    /// Halves the triangle of half-edge `h` at point `w` on that half-edge. Returns the half-edge from `w` to
    /// its old end.
    fn halve(&mut self, h: u32, w: u32) -> u32 {
        let (t, k) = (h / 3, h % 3);
        let [first, second] = [(k + 1) % 3, (k + 2) % 3];
        let mut corners = self.corners[t as usize];
        corners[k as usize] = w;
        let new = self.push(corners, self.face[t as usize]);
        self.corners[t as usize][first as usize] = w;
        let (outer, kept) = (3 * new + first, 3 * t + first);
        self.chain[outer as usize] = self.chain[kept as usize];
        self.link(outer, self.twin[kept as usize]);
        self.chain[kept as usize] = NONE;
        self.link(kept, 3 * new + second);
        3 * new + k
    }

    /// Splits triangle `t` into three around point `w`.
    pub(super) fn split_triangle(&mut self, t: u32, w: u32) {
        let [p, q, r] = self.corners[t as usize];
        let f = self.face[t as usize];
        let (second, third) = (self.push([q, r, w], f), self.push([r, p, w], f));
        for (outer, old) in [(3 * second, 3 * t + 1), (3 * third, 3 * t + 2)] {
            self.chain[outer as usize] = self.chain[old as usize];
            self.link(outer, self.twin[old as usize]);
            self.chain[old as usize] = NONE;
        }
        self.corners[t as usize] = [p, q, w];
        self.link(3 * t + 1, 3 * second + 2);
        self.link(3 * second + 1, 3 * third + 2);
        self.link(3 * third + 1, 3 * t + 2);
    }

    /// Turns the edge of half-edge `h`, so that it joins the other two corners of its triangles. They keep their numbers;
    /// the edge becomes the last half-edge of each.
    pub(super) fn flip(&mut self, h: u32) {
        let g = self.twin[h as usize];
        let (t, s) = (h / 3, g / 3);
        let (u, v) = (self.from(h), self.to(h));
        let outer = [previous(h), following(g), previous(g), following(h)];
        let (p, q) = (self.from(outer[0]), self.from(outer[2]));
        let (twins, chains) = (outer.map(|h| self.twin[h as usize]), outer.map(|h| self.chain[h as usize]));
        self.corners[t as usize] = [p, u, q];
        self.corners[s as usize] = [q, v, p];
        let inner = [3 * t, 3 * t + 1, 3 * s, 3 * s + 1];
        for ((h, twin), chain) in inner.into_iter().zip(twins).zip(chains) {
            // Two of the outer sides may be each other's opposite.
            let twin = outer.iter().position(|h| *h == twin).map_or(twin, |k| inner[k]);
            self.link(h, twin);
            self.chain[h as usize] = chain;
        }
        self.link(3 * t + 2, 3 * s + 2);
        self.chain[3 * t as usize + 2] = NONE;
        self.chain[3 * s as usize + 2] = NONE;
    }

    /// All half-edges that leave the first point of `h`.
    pub(super) fn around(&self, h: u32) -> Vec<u32> {
        self.fan(h).take(self.corners.len() + 1).collect()
    }

    /// The same, one after the other.
    pub(super) fn fan(&self, h: u32) -> impl Iterator<Item = u32> {
        let next = move |&g: &u32| Some(self.twin[previous(g) as usize]).filter(|g| *g != h);
        std::iter::successors(Some(h), next)
    }

    /// Where point `p` lies on the boundary itself [m], without the shape of the skin.
    pub(super) fn flat(&self, p: u32, nodes: &[Vector3<f64>]) -> Vector3<f64> {
        flat(&self.points[p as usize].at, nodes)
    }

    /// Forgets all chains and what points represent, except at corners of the boundary: an uncut skin that is divided
    /// in any way.
    pub(super) fn forget_chains(&mut self) {
        self.chain.fill(NONE);
        self.chains.clear();
        self.claims.clear();
        self.split.clear();
        self.points.iter_mut().for_each(|point| point.claimed = false);
        for &corner in &self.corner_point {
            self.points[corner as usize].claimed = true;
        }
    }

    /// Adds a point and returns its number.
    pub(super) fn add_point(&mut self, at: FragmentVertex, place: Vector3<f64>, claimed: bool) -> u32 {
        self.points.push(Point { at, place, claimed });
        self.points.len() as u32 - 1
    }
}

/// The next half-edge around the same triangle.
pub(super) fn following(h: u32) -> u32 {
    h / 3 * 3 + (h + 1) % 3
}

/// The previous half-edge around the same triangle.
pub(super) fn previous(h: u32) -> u32 {
    h / 3 * 3 + (h + 2) % 3
}

/// The point on the boundary itself [m], without the shape of the skin.
fn flat(at: &FragmentVertex, nodes: &[Vector3<f64>]) -> Vector3<f64> {
    at.nodes.iter().zip(&at.weights).filter(|(n, _)| **n != NONE).map(|(&n, &w)| nodes[n as usize] * w).sum()
}
