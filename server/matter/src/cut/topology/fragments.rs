//! The fragment mesh: a conforming tet mesh inside the elements.
//!
//! A fragment vertex is an affine combination of the nodes of one element. Two fragments are connected
//! through a face exactly when they list each other as neighbours; a cut removes that link and tags both
//! sides. Only a face-connected star of fragments shares a vertex, so lips share no vertex except on the
//! crack front.

use std::collections::BTreeMap;

use crate::mesh::{TET_FACES, TetMesh};
use crate::storage::reserve::reserve_half_again;

use super::incision_sets::IncisionSets;
use super::slot::slot_of;

/// Marks a missing neighbour and the end of a list.
pub(crate) const NONE: u32 = u32::MAX;

/// Most fragments in one element. A bisection that needs more is refused.
///
/// One plane makes at most 6 of 1. A cap of 256 allows some 20 planes through one element, and bounds the
/// memory of a pathological sweep.
pub(crate) const MAX_FRAGMENTS_PER_ELEMENT: u16 = 256;

/// A point of the material: Σ weights · nodes, where all nodes belong to one element.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub(crate) struct FragmentVertex {
    /// Mesh nodes; [`NONE`] in unused slots, which come last.
    pub nodes: [u32; 4],
    /// Weight of each node, Σ = 1.
    pub weights: [f64; 4],
}

impl FragmentVertex {
    /// The vertex at a mesh node.
    pub(crate) fn at_node(node: u32) -> Self {
        Self { nodes: [node, NONE, NONE, NONE], weights: [1.0, 0.0, 0.0, 0.0] }
    }

    /// The point (1 − t) a + t b; `a` and `b` must lie in one element.
    pub(crate) fn between(a: &Self, b: &Self, t: f64) -> Self {
        let mut v = Self { nodes: a.nodes, weights: a.weights.map(|w| (1.0 - t) * w) };
        for (&node, &weight) in b.nodes.iter().zip(&b.weights) {
            if node == NONE {
                break;
            }
            if let Some(slot) = v.nodes.iter().position(|&n| n == node || n == NONE) {
                v.nodes[slot] = node;
                v.weights[slot] += t * weight;
            }
        }
        v
    }

    /// Weight of mesh node `node`, 0 if the vertex does not depend on it.
    pub(crate) fn weight_of(&self, node: u32) -> f64 {
        slot_of(&self.nodes, node).map_or(0.0, |slot| self.weights[slot])
    }
}

/// All fragments of a body, structure of arrays.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(crate) struct Fragments {
    /// Vertices, the first n_nodes at the mesh nodes.
    pub vertices: Vec<FragmentVertex>,
    /// Per vertex the set of incisions it lies on.
    pub on: Vec<u32>,
    /// Vertex ids per fragment, positively oriented. Fragment e < n_elements is the first of
    /// element e.
    pub tets: Vec<[u32; 4]>,
    /// Element each fragment lies in.
    pub element: Vec<u32>,
    /// Piece each fragment belongs to.
    pub piece: Vec<u32>,
    /// Volume of each fragment as a fraction of its element.
    pub fraction: Vec<f64>,
    /// Fragment across the face opposite each vertex, or [`NONE`] on the boundary.
    pub neighbour: Vec<[u32; 4]>,
    /// Tag of each boundary face: 0 skin, else the incision that opened it.
    pub tag: Vec<[u32; 4]>,
    /// Incisions known to run between the two sides of each face, as a set.
    pub along: Vec<[u32; 4]>,
    /// Next fragment of the same element.
    pub next_in_element: Vec<u32>,
    /// Next fragment of the same piece.
    pub next_in_piece: Vec<u32>,
    /// Number of fragments per element.
    pub count: Vec<u16>,
    visited: Vec<[u32; 4]>,
    claimed: Vec<u32>,
    stamp: u32,
    stack: Vec<(u32, u8)>,
    star: Vec<(u32, u8)>,
}

/// The two fragments that the bisection of an edge made of one.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
pub(crate) struct Halves {
    /// The half at end `a` of the edge. It keeps the id of the fragment that was split.
    pub old: u32,
    /// The appended half, at end `b`.
    pub new: u32,
    /// Slot of `a` in the fragment that was split. Its face opposite `a` now belongs to `new`.
    pub slot: u8,
}

impl Fragments {
    /// One fragment per element of a checked mesh.
    pub(crate) fn new(mesh: &TetMesh) -> Self {
        let n = mesh.tets.len();
        let mut fragments = Self {
            vertices: (0..mesh.nodes.len() as u32).map(FragmentVertex::at_node).collect(),
            on: vec![IncisionSets::EMPTY; mesh.nodes.len()],
            tets: mesh.tets.clone(),
            element: (0..n as u32).collect(),
            piece: (0..n as u32).collect(),
            fraction: vec![1.0; n],
            neighbour: face_neighbours(&mesh.tets),
            tag: vec![[0; 4]; n],
            along: vec![[IncisionSets::EMPTY; 4]; n],
            next_in_element: vec![NONE; n],
            next_in_piece: vec![NONE; n],
            count: vec![1; n],
            ..Self::default()
        };
        let every_corner: Vec<(u32, u8)> = (0..n as u32).flat_map(|t| (0..4).map(move |k| (t, k))).collect();
        fragments.split_stars(&every_corner, |_, _, _| {});
        fragments.reserve_half_again();
        fragments
    }

    /// Reserves memory for a cut, so that the first cut does not reallocate every array.
    fn reserve_half_again(&mut self) {
        reserve_half_again(&mut self.vertices);
        reserve_half_again(&mut self.on);
        reserve_half_again(&mut self.tets);
        reserve_half_again(&mut self.element);
        reserve_half_again(&mut self.piece);
        reserve_half_again(&mut self.fraction);
        reserve_half_again(&mut self.neighbour);
        reserve_half_again(&mut self.tag);
        reserve_half_again(&mut self.along);
        reserve_half_again(&mut self.next_in_element);
        reserve_half_again(&mut self.next_in_piece);
        reserve_half_again(&mut self.visited);
        reserve_half_again(&mut self.claimed);
    }

    /// Tags boundary faces of the uncut state. `tags` is keyed by their mesh nodes in ascending order.
    pub(crate) fn tag_boundary(&mut self, mesh: &TetMesh, tags: &BTreeMap<[u32; 3], u32>) {
        if tags.is_empty() {
            return;
        }
        for (t, tet) in mesh.tets.iter().enumerate() {
            for k in (0..4).filter(|&k| self.neighbour[t][k] == NONE) {
                let mut nodes = TET_FACES[k].map(|c| tet[c]);
                nodes.sort_unstable();
                self.tag[t][k] = tags.get(&nodes).copied().unwrap_or(0);
            }
        }
    }

    /// Fragments of element `e`, the first one first.
    pub(crate) fn of_element(&self, e: u32) -> impl Iterator<Item = u32> + '_ {
        std::iter::successors(Some(e), |&t| Some(self.next_in_element[t as usize]).filter(|&n| n != NONE))
    }

    /// Slot of vertex `v` in fragment `t`.
    pub(crate) fn slot(&self, t: u32, v: u32) -> Option<usize> {
        slot_of(&self.tets[t as usize], v)
    }

    /// Face of fragment `n` that it shares with `t`.
    pub(crate) fn face_towards(&self, n: u32, t: u32) -> Option<usize> {
        slot_of(&self.neighbour[n as usize], t)
    }

    /// Collects the fragments around vertex `v` that are face-connected with `t`.
    pub(crate) fn star(&self, t: u32, v: u32, out: &mut Vec<u32>) {
        out.clear();
        out.push(t);
        let mut k = 0;
        while k < out.len() {
            let tet = &self.tets[out[k] as usize];
            for (&corner, &n) in tet.iter().zip(&self.neighbour[out[k] as usize]) {
                if corner != v && n != NONE && !out.contains(&n) {
                    out.push(n);
                }
            }
            k += 1;
        }
    }

    /// Collects the fragments around the edge (a, b) that are face-connected with `t`.
    pub(crate) fn wedge(&self, t: u32, a: u32, b: u32, out: &mut Vec<u32>) {
        out.clear();
        out.push(t);
        let mut others = self.tets[t as usize].into_iter().filter(|&v| v != a && v != b);
        let (Some(c), Some(d), None) = (others.next(), others.next(), others.next()) else { return };
        for (mut opposite, mut pivot) in [(c, d), (d, c)] {
            let mut current = t;
            // Leave through the face opposite `opposite`. It contains a, b and `pivot`.
            while let Some(face) = self.slot(current, opposite) {
                let next = self.neighbour[current as usize][face];
                if next == NONE {
                    break;
                }
                if next == t {
                    return;
                }
                out.push(next);
                let Some(back) = self.face_towards(next, current) else { return };
                opposite = pivot;
                pivot = self.tets[next as usize][back];
                current = next;
            }
        }
    }

    /// Walks through the solid wedge around an edge, from one boundary face to the other. The walk starts at
    /// the face of fragment `t` opposite its vertex `face`; the edge runs from its corner `edge` to the next
    /// in the order of [`TET_FACES`]. Returns fragment, face and edge at the far side, where the edge runs
    /// the other way.
    pub(crate) fn around_edge(&self, t: u32, face: usize, edge: usize) -> (u32, usize, usize) {
        let (mut t, corners) = (t as usize, TET_FACES[face]);
        let to = self.tets[t][corners[(edge + 1) % 3]];
        let mut exit = corners[(edge + 2) % 3];
        let mut pivot = self.tets[t][face];
        loop {
            let n = self.neighbour[t][exit];
            if n == NONE {
                break;
            }
            let back = self.face_towards(n, t as u32).unwrap_or(exit);
            let entered = self.tets[n as usize][back];
            let Some(next_exit) = self.slot(n, pivot) else { break };
            (t, exit, pivot) = (n as usize, next_exit, entered);
        }
        let far = TET_FACES[exit].iter().position(|&c| self.tets[t][c] == to);
        (t as u32, exit, far.unwrap_or(0))
    }

    /// Bisects the edge (a, b) at the new vertex `m` in every fragment of its `wedge`. The faces between the
    /// halves are marked as lying `along` the given set of incisions. `halves` receives one entry per
    /// fragment of the wedge.
    pub(crate) fn bisect(
        &mut self,
        wedge: &[u32],
        ends: [u32; 2],
        m: (u32, f64),
        along: u32,
        halves: &mut Vec<Halves>,
    ) {
        halves.clear();
        let first_new = self.tets.len() as u32;
        halves.extend(wedge.iter().zip(first_new..).map(|(&old, new)| Halves { old, new, slot: 0 }));
        let [a, b] = ends;
        let (m, t) = m;
        for k in 0..wedge.len() {
            let Halves { old, new, .. } = halves[k];
            let o = old as usize;
            let (Some(ia), Some(ib)) = (self.slot(old, a), self.slot(old, b)) else { continue };
            halves[k].slot = ia as u8;
            let mut far = self.tets[o];
            far[ia] = m;
            let mut neighbour = self.neighbour[o];
            // Inside the wedge the far half borders its own near half, and the far halves of its neighbours.
            neighbour[ib] = old;
            for (face, n) in neighbour.iter_mut().enumerate() {
                if face != ia && face != ib && *n != NONE {
                    *n = halves.iter().find(|h| h.old == *n).map_or(NONE, |h| h.new);
                }
            }
            let (mut tag, mut along_far) = (self.tag[o], self.along[o]);
            tag[ib] = 0;
            along_far[ib] = along;
            self.push(o, far, neighbour, self.fraction[o] * (1.0 - t));
            self.tag.push(tag);
            self.along.push(along_far);
            // The face opposite `a` goes to the far half, so the fragment behind it gets a new neighbour.
            let outer = neighbour[ia];
            if outer != NONE
                && let Some(back) = self.face_towards(outer, old)
            {
                self.neighbour[outer as usize][back] = new;
            }
            self.tets[o][ib] = m;
            self.fraction[o] *= t;
            self.neighbour[o][ia] = new;
            self.tag[o][ia] = 0;
            self.along[o][ia] = along;
        }
    }

    /// Appends a fragment with the element, piece and lists of fragment `o`, right behind it in the lists.
    fn push(&mut self, o: usize, tet: [u32; 4], neighbour: [u32; 4], fraction: f64) {
        let id = self.tets.len() as u32;
        self.tets.push(tet);
        self.element.push(self.element[o]);
        self.piece.push(self.piece[o]);
        self.fraction.push(fraction);
        self.neighbour.push(neighbour);
        self.next_in_element.push(self.next_in_element[o]);
        self.next_in_element[o] = id;
        self.next_in_piece.push(self.next_in_piece[o]);
        self.next_in_piece[o] = id;
        self.count[self.element[o] as usize] += 1;
    }

    /// Opens the face of fragment `t` opposite its vertex `face`; both sides get the tag.
    pub(crate) fn open(&mut self, t: u32, face: usize, tag: u32) {
        let n = self.neighbour[t as usize][face];
        if n == NONE {
            return;
        }
        if let Some(back) = self.face_towards(n, t) {
            self.neighbour[n as usize][back] = NONE;
            self.tag[n as usize][back] = tag;
        }
        self.neighbour[t as usize][face] = NONE;
        self.tag[t as usize][face] = tag;
    }

    /// Restores the rule that only a face-connected star shares a vertex. Of the stars at the given corners
    /// (fragment, slot) the first keeps the vertex, and each other one gets its own. `renamed(fragments, old
    /// vertex, [fragment, new vertex])` is called for every renamed corner.
    pub(crate) fn split_stars(
        &mut self,
        corners: &[(u32, u8)],
        mut renamed: impl FnMut(&Self, u32, [u32; 2]),
    ) {
        self.stamp += 1;
        self.visited.resize(self.tets.len(), [0; 4]);
        self.claimed.resize(self.vertices.len(), 0);
        for &(t, k) in corners {
            if self.visited[t as usize][k as usize] == self.stamp {
                continue;
            }
            let v = self.tets[t as usize][k as usize];
            self.collect_star(t, k);
            if self.claimed[v as usize] != self.stamp {
                self.claimed[v as usize] = self.stamp;
                continue;
            }
            let copy = self.vertices.len() as u32;
            self.vertices.push(self.vertices[v as usize]);
            self.on.push(self.on[v as usize]);
            self.claimed.push(self.stamp);
            for i in 0..self.star.len() {
                let (t, k) = self.star[i];
                self.tets[t as usize][k as usize] = copy;
                renamed(self, v, [t, copy]);
            }
        }
    }

    /// Fills `self.star` with the corners at the vertex of corner (t, k) that closed faces connect with it,
    /// and marks them as visited.
    fn collect_star(&mut self, t: u32, k: u8) {
        let v = self.tets[t as usize][k as usize];
        self.star.clear();
        self.stack.clear();
        self.visited[t as usize][k as usize] = self.stamp;
        self.stack.push((t, k));
        while let Some((t, k)) = self.stack.pop() {
            self.star.push((t, k));
            for face in (0..4).filter(|&f| f != k as usize) {
                let n = self.neighbour[t as usize][face];
                if n == NONE {
                    continue;
                }
                if let Some(slot) = self.slot(n, v)
                    && self.visited[n as usize][slot] != self.stamp
                {
                    self.visited[n as usize][slot] = self.stamp;
                    self.stack.push((n, slot as u8));
                }
            }
        }
    }
}

/// Links tets across faces that exactly two of them have, seen from opposite sides.
fn face_neighbours(tets: &[[u32; 4]]) -> Vec<[u32; 4]> {
    let mut faces: Vec<([u32; 3], u32, bool)> = Vec::with_capacity(4 * tets.len());
    for (t, tet) in tets.iter().enumerate() {
        for (k, face) in TET_FACES.iter().enumerate() {
            let (key, even) = sorted(face.map(|c| tet[c]));
            faces.push((key, (4 * t + k) as u32, even));
        }
    }
    faces.sort_unstable();
    let mut neighbour = vec![[NONE; 4]; tets.len()];
    for users in faces.chunk_by(|p, q| p.0 == q.0) {
        if let &[(_, p, p_even), (_, q, q_even)] = users
            && p_even != q_even
        {
            neighbour[p as usize / 4][p as usize % 4] = q / 4;
            neighbour[q as usize / 4][q as usize % 4] = p / 4;
        }
    }
    neighbour
}

/// The ids in ascending order, and whether that took an even permutation.
fn sorted([mut a, mut b, mut c]: [u32; 3]) -> ([u32; 3], bool) {
    let mut even = true;
    if a > b {
        (a, b, even) = (b, a, !even);
    }
    if b > c {
        (b, c, even) = (c, b, !even);
    }
    if a > b {
        (a, b, even) = (b, a, !even);
    }
    ([a, b, c], even)
}
