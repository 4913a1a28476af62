//! Skin triangles and lips sewn into one closed surface.
//!
//! Surface triangle i is skin triangle i, surface vertex p is skin point p; lips and the further
//! vertices of points that a cut divided stand behind them and are made anew with every change, as is
//! the skin that touches the cut curve or whose elements got new copies. The rest stays.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use super::base::Base;
use super::border::Borders;
use super::embedding::Misfit;
use super::lips::{Corner, Lips};
use super::sheet::Sheet;
use crate::cut::fragments::{FragmentVertex, NONE};
use crate::cut::{CutMesh, Surface, SurfaceVertex};

/// What sewing remembers of the skin.
#[derive(Clone, Debug, Default)]
pub struct Seams {
    /// Piece of each skin triangle.
    piece: Vec<u32>,
    /// Opposite of each half-edge of the skin that is cut: one of a lip.
    seam: Vec<u32>,
    /// Piece of each boundary face and its copies; where the face is cut, of one of its parts.
    known: Vec<(u32, [u32; 4])>,
    /// Round in which each half-edge of the skin was numbered.
    round: Vec<u32>,
    now: u32,
    taken: Vec<u32>,
    /// Skin triangles made anew in the last round.
    renewed: usize,
}

/// What is sewn.
pub struct Cloth<'a> {
    /// The body.
    pub cut: &'a CutMesh,
    /// Boundary of the uncut body.
    pub base: &'a Base,
    /// The skin.
    pub sheet: &'a Sheet,
    /// The cut curve.
    pub borders: &'a Borders,
}

impl Seams {
    /// Skin triangles that the last change made anew.
    pub fn renewed(&self) -> usize {
        self.renewed
    }

    /// Brings `surface` up to date; where skin and lips do not fit, it is not usable.
    pub fn sew(&mut self, cloth: &Cloth, surface: &mut Surface) -> Result<(), Misfit> {
        let sheet = cloth.sheet;
        self.now += 1;
        self.piece.resize(sheet.corners.len(), NONE);
        self.seam.resize(sheet.twin.len(), NONE);
        self.round.resize(sheet.twin.len(), 0);
        self.taken.resize(sheet.points.len(), 0);
        self.known.resize(cloth.base.faces.len(), (NONE, [NONE; 4]));
        let renewed = self.find_pieces(cloth).ok_or(Misfit::NoPiece)?;
        self.renewed = renewed.len();
        let lips = Lips::new(cloth.cut, sheet, cloth.borders, &mut self.seam).ok_or(Misfit::NoChain)?;
        let cut_edges_are_sewn = renewed
            .iter()
            .flat_map(|&t| 3 * t..3 * t + 3)
            .all(|h| sheet.chain[h as usize] == NONE || self.seam[h as usize] != NONE);
        if !cut_edges_are_sewn || lips.twin.contains(&NONE) {
            return Err(Misfit::OpenSeam);
        }
        self.number(cloth, &lips, &renewed, surface);
        split_doubled_edges(self, cloth, &lips, &renewed, surface);
        Ok(())
    }

    /// Pieces of the skin triangles that may have changed; returns those triangles.
    fn find_pieces(&mut self, cloth: &Cloth) -> Option<Vec<u32>> {
        let Cloth { cut, base, sheet, borders } = cloth;
        let mut faces = borders.faces(sheet);
        for (f, known) in (0u32..).zip(&mut self.known) {
            let e = base.faces[f as usize].element;
            let piece = if cut.fragments.count[e as usize] == 1 { e } else { piece_under(cloth, f, e)? };
            let present = (piece, cut.pieces()[piece as usize].copies);
            if *known != present {
                *known = present;
                faces.insert(f);
            }
        }
        let mut stack = Vec::new();
        for &f in &faces {
            sheet.over[f as usize].iter().for_each(|&t| self.piece[t as usize] = NONE);
        }
        for border in &borders.edges {
            for &h in &border.chain {
                self.piece[h as usize / 3] = cut.fragments.piece[border.skin.0 as usize];
                stack.push(h / 3);
            }
        }
        while let Some(t) = stack.pop() {
            for h in 3 * t..3 * t + 3 {
                let next = sheet.twin[h as usize] / 3;
                let same_face = sheet.face[next as usize] == sheet.face[t as usize];
                if same_face && sheet.chain[h as usize] == NONE && self.piece[next as usize] == NONE {
                    self.piece[next as usize] = self.piece[t as usize];
                    stack.push(next);
                }
            }
        }
        let mut renewed = Vec::new();
        for &f in &faces {
            for &t in &sheet.over[f as usize] {
                if self.piece[t as usize] == NONE {
                    self.piece[t as usize] = self.known[f as usize].0;
                }
                renewed.push(t);
            }
        }
        renewed.sort_unstable();
        Some(renewed)
    }

    fn twin(&self, cloth: &Cloth, lips: &Lips, h: u32) -> u32 {
        if h >= lips.first {
            lips.twin[(h - lips.first) as usize]
        } else if cloth.sheet.chain[h as usize] == NONE {
            cloth.sheet.twin[h as usize]
        } else {
            self.seam[h as usize]
        }
    }

    fn piece_of(&self, lips: &Lips, h: u32) -> u32 {
        if h >= lips.first { lips.piece[((h - lips.first) / 3) as usize] } else { self.piece[h as usize / 3] }
    }

    /// Numbers the cycles of corners around the renewed triangles and the lips: the first cycle at every
    /// skin point has its number.
    fn number(&mut self, cloth: &Cloth, lips: &Lips, renewed: &[u32], surface: &mut Surface) {
        let sheet = cloth.sheet;
        let unbound = SurfaceVertex { copies: [0; 4], weights: [0.0; 4] };
        surface.vertices.resize(sheet.points.len(), unbound);
        surface.triangles.resize(sheet.corners.len(), [NONE; 3]);
        surface.triangles.resize(sheet.corners.len() + lips.corners.len(), [NONE; 3]);
        surface.tags.resize(sheet.corners.len(), 0);
        renewed.iter().for_each(|&t| surface.tags[t as usize] = 0);
        surface.tags.extend(&lips.tag);
        for triangle in &mut surface.triangles[sheet.corners.len()..] {
            *triangle = [NONE; 3];
        }
        let mut cycle = Vec::new();
        let on_skin = renewed.iter().flat_map(|&t| 3 * t..3 * t + 3);
        for first in on_skin.chain(lips.first..lips.first + lips.twin.len() as u32) {
            let numbered = match first < lips.first {
                true => self.round[first as usize] == self.now,
                false => surface.triangles[first as usize / 3][first as usize % 3] != NONE,
            };
            if numbered {
                continue;
            }
            cycle.clear();
            let mut at = first;
            loop {
                cycle.push(at);
                at = self.twin(cloth, lips, at / 3 * 3 + (at + 2) % 3);
                if at == first {
                    break;
                }
            }
            let vertex = self.bind(cloth, lips, &cycle);
            let point = (first < lips.first).then(|| sheet.from(first));
            let id = match point {
                Some(p) if self.taken[p as usize] != self.now => {
                    self.taken[p as usize] = self.now;
                    surface.vertices[p as usize] = vertex;
                    p
                }
                _ => {
                    surface.vertices.push(vertex);
                    surface.vertices.len() as u32 - 1
                }
            };
            for &c in &cycle {
                surface.triangles[c as usize / 3][c as usize % 3] = id;
                if c < lips.first {
                    self.round[c as usize] = self.now;
                }
            }
        }
        for (t, corners) in lips.corners.iter().enumerate() {
            if corners[2] == Corner::Middle {
                let id = surface.triangles[sheet.corners.len() + t][2];
                surface.vertices[id as usize] = middle(cloth.cut, lips, surface, t);
            }
        }
    }

    /// The vertex of a cycle of corners: on the skin where one of them is, in the element that has to
    /// extrapolate least.
    fn bind(&self, cloth: &Cloth, lips: &Lips, cycle: &[u32]) -> SurfaceVertex {
        let mut best: Option<(f64, SurfaceVertex)> = None;
        let mut seen = NONE;
        for &c in cycle.iter().filter(|c| **c < lips.first) {
            let piece = self.piece[c as usize / 3];
            if piece != seen {
                seen = piece;
                let place = &cloth.sheet.points[cloth.sheet.from(c) as usize].place;
                let vertex = in_element(cloth.cut, piece, place);
                let reach = vertex.weights.iter().fold(0.0f64, |m, w| m.max(w.abs()));
                if best.is_none_or(|b| reach < b.0) {
                    best = Some((reach, vertex));
                }
            }
        }
        let c = cycle[0];
        match best {
            Some((_, vertex)) => vertex,
            None => match lips.corners[((c - lips.first) / 3) as usize][c as usize % 3] {
                Corner::Lip(v) => {
                    let v = &cloth.cut.fragments.vertices[v as usize];
                    on_fragment(cloth.cut, self.piece_of(lips, c), v)
                }
                // A middle is placed when its neighbours are.
                _ => SurfaceVertex { copies: [0; 4], weights: [0.0; 4] },
            },
        }
    }
}

/// The piece of element `e` that a part of boundary face `f` belongs to.
fn piece_under(cloth: &Cloth, f: u32, e: u32) -> Option<u32> {
    let fragments = &cloth.cut.fragments;
    let is_under = |t: u32, k: usize| {
        fragments.neighbour[t as usize][k] == NONE
            && fragments.tag[t as usize][k] == 0
            && cloth.base.under(cloth.cut.mesh(), fragments, t, k) == Some(f)
    };
    fragments.of_element(e).find(|&t| (0..4).any(|k| is_under(t, k))).map(|t| fragments.piece[t as usize])
}

/// The centroid of the outline around the middle corner of lip triangle `t`.
fn middle(cut: &CutMesh, lips: &Lips, surface: &Surface, t: usize) -> SurfaceVertex {
    let skin = (lips.first / 3) as usize;
    let mut sum = Vector3::zeros();
    let mut count = 0.0;
    let mut at = t;
    loop {
        sum += rest_place(cut, &surface.vertices[surface.triangles[skin + at][0] as usize]);
        count += 1.0;
        at = ((lips.twin[3 * at + 1] - lips.first) / 3) as usize;
        if at == t {
            break;
        }
    }
    in_element(cut, lips.piece[t], &(sum / count))
}

/// Two different edges may join the same two vertices, as the lips of a slit of one edge do. All but
/// the first get a vertex in the middle, and their triangles a fan.
fn split_doubled_edges(seams: &Seams, cloth: &Cloth, lips: &Lips, renewed: &[u32], surface: &mut Surface) {
    let cut = cloth.cut;
    let n = surface.triangles.len() as u32;
    let mut middle: BTreeMap<u32, u32> = BTreeMap::new();
    for h in doubled(&surface.triangles, renewed.iter().copied().chain(lips.first / 3..n)) {
        if middle.contains_key(&h) {
            continue;
        }
        let [t, k] = [h as usize / 3, h as usize % 3];
        let ends = [surface.triangles[t][k], surface.triangles[t][(k + 1) % 3]];
        let [a, b] = ends.map(|v| rest_place(cut, &surface.vertices[v as usize]));
        let id = surface.vertices.len() as u32;
        surface.vertices.push(in_element(cut, seams.piece_of(lips, h), &((a + b) / 2.0)));
        middle.insert(h, id);
        middle.insert(seams.twin(cloth, lips, h), id);
    }
    let triangles: Vec<u32> = middle.keys().map(|h| h / 3).collect();
    for on_triangle in triangles.chunk_by(|s, t| s == t) {
        let t = on_triangle[0];
        let triangle = surface.triangles[t as usize];
        let mut ring = Vec::with_capacity(6);
        for k in 0..3 {
            ring.push(triangle[k as usize]);
            ring.extend(middle.get(&(3 * t + k)));
        }
        let places = triangle.map(|v| rest_place(cut, &surface.vertices[v as usize]));
        let centre = surface.vertices.len() as u32;
        let place = places.iter().sum::<Vector3<f64>>() / 3.0;
        surface.vertices.push(in_element(cut, seams.piece_of(lips, 3 * t), &place));
        let tag = surface.tags[t as usize];
        for k in 0..ring.len() {
            let fan = [ring[k], ring[(k + 1) % ring.len()], centre];
            if k == 0 {
                surface.triangles[t as usize] = fan;
            } else {
                surface.triangles.push(fan);
                surface.tags.push(tag);
            }
        }
    }
}

/// Half-edges 3·triangle + k, of the triangles with these numbers, whose directed vertex pair an earlier
/// one already has.
fn doubled(triangles: &[[u32; 3]], numbers: impl Iterator<Item = u32>) -> Vec<u32> {
    let mut edges: Vec<(u32, u32, u32)> = numbers
        .flat_map(|t| (0..3).map(move |k| (t, k)))
        .map(|(t, k)| {
            let triangle = triangles[t as usize];
            (triangle[k as usize], triangle[(k as usize + 1) % 3], 3 * t + k)
        })
        .collect();
    edges.sort_unstable();
    let mut doubled: Vec<u32> =
        edges.windows(2).filter(|e| (e[0].0, e[0].1) == (e[1].0, e[1].1)).map(|e| e[1].2).collect();
    doubled.sort_unstable();
    doubled
}

/// Rest position of a surface vertex [m].
fn rest_place(cut: &CutMesh, vertex: &SurfaceVertex) -> Vector3<f64> {
    let node = |c: u32| cut.mesh().nodes[cut.copy_node()[c as usize] as usize];
    vertex.copies.iter().zip(&vertex.weights).map(|(&c, &w)| node(c) * w).sum()
}

/// A rest place in the coordinates of a piece's element.
fn in_element(cut: &CutMesh, piece: u32, place: &Vector3<f64>) -> SurfaceVertex {
    let piece = &cut.pieces()[piece as usize];
    let e = piece.element as usize;
    let [origin, ..] = cut.mesh().corners(e);
    let g = cut.mesh().gradients(e);
    let mut weights = [1.0, 0.0, 0.0, 0.0];
    for (w, g) in weights.iter_mut().zip(&g) {
        *w += g.dot(&(place - origin));
    }
    SurfaceVertex { copies: piece.copies, weights }
}

/// A vertex of the fragments on the copies of a piece.
fn on_fragment(cut: &CutMesh, piece: u32, v: &FragmentVertex) -> SurfaceVertex {
    let piece = &cut.pieces()[piece as usize];
    let nodes = cut.mesh().tets[piece.element as usize];
    SurfaceVertex { copies: piece.copies, weights: nodes.map(|n| v.weight_of(n)) }
}
