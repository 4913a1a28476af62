//! Joins skin triangles and lips into one closed surface, and updates it wherever a cut changed something.
//!
//! A cut changes four things. Lips change on fragments that are new, bisected or opened or whose piece has
//! other copies, and so do the lips across their edges. The skin changes over faces where the cut curve went
//! or whose element has such a fragment or piece. Lips also change where the skin over the face at their
//! border was split. Everything else stays as it is.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Vector3;

use super::base::Base;
use super::lips::{Corner, Face, Lip, fill, is_lip};
use super::misfit::Misfit;
use super::sheet::Sheet;
use crate::cut::shell::joined::{Joined, Place};
use crate::cut::topology::fragments::{FragmentVertex, NONE};
use crate::cut::{CutMesh, Surface};
use crate::element::MaterialPoint;

/// The state from which the surface is built.
pub(super) struct SkinSource<'a> {
    /// The body.
    pub cut: &'a CutMesh,
    /// Boundary of the uncut body.
    pub base: &'a Base,
    /// The skin.
    pub sheet: &'a mut Sheet,
    /// Share of an edge within which skin points are moved onto the cut curve.
    pub snapping: f64,
}

/// Fragments and pieces that the last cut changed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Change<'a> {
    /// Fragments that are new, were bisected or had a face opened.
    pub fragments: &'a [u32],
    /// Pieces that were split, created or given other copies.
    pub pieces: &'a [u32],
}

/// The skin triangle or lip to which a surface triangle belongs.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
enum Owner {
    Skin(u32),
    Lip(Face),
}

/// The joined surface: its connectivity, and the origin of its triangles.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct SkinJoin {
    joined: Joined,
    parts: Parts,
    /// Numbers of surface triangles that are no longer in use.
    free: Vec<u32>,
    renewed: usize,
}

/// The origin of every surface triangle, and the surface triangles of skin and lips.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
struct Parts {
    owner: Vec<Owner>,
    corners: Vec<[Corner; 3]>,
    piece: Vec<u32>,
    /// Surface triangle of each skin triangle, or [`NONE`].
    of_skin: Vec<u32>,
    lips: BTreeMap<Face, Lip>,
    /// Lips with a border over each boundary face.
    on_face: Vec<BTreeSet<Face>>,
}

impl Parts {
    /// The half-edge of the surface for a half-edge of the skin.
    fn half_edge(&self, h: u32) -> u32 {
        3 * self.of_skin[h as usize / 3] + h % 3
    }
}

impl SkinJoin {
    /// Number of skin triangles that the last change renewed.
    pub(super) fn renewed(&self) -> usize {
        self.renewed
    }

    /// Numbers of triangles, vertices and doubled edges.
    #[cfg(test)]
    pub(super) fn sizes(&self) -> [usize; 3] {
        self.joined.sizes()
    }

    /// Surface triangle of skin triangle `t`.
    pub(super) fn of_skin(&self, t: u32) -> u32 {
        self.parts.of_skin[t as usize]
    }

    /// Updates `surface`. After an error it is not usable.
    pub(super) fn sew(
        &mut self,
        source: &mut SkinSource,
        change: Change,
        surface: &mut Surface,
    ) -> Result<(), Misfit> {
        self.joined.begin(surface);
        self.parts.on_face.resize(source.base.faces.len(), BTreeSet::new());
        let mut faces = BTreeSet::new();
        let lips = self.cut_the_skin(source, change, &mut faces)?;
        self.lay_skin(source, change, &mut faces, surface)?;
        self.fill_lips(source, &lips, surface)?;
        self.give_numbers_back(surface);
        if self.joined.is_open() {
            return Err(Misfit::OpenSeam);
        }
        let mut placed = Placed { cut: source.cut, sheet: source.sheet, parts: &self.parts };
        self.joined.number(&mut placed, surface);
        for lip in lips.iter().filter_map(|lip| self.parts.lips.get(lip)) {
            placed.place_middle(lip, surface);
        }
        self.joined.divide_doubled_edges(&placed, surface);
        let skin = |t: &&u32| matches!(self.parts.owner[**t as usize], Owner::Skin(_));
        self.renewed = self.joined.touched().iter().filter(skin).count();
        Ok(())
    }

    /// Removes the lips that changed and inserts the borders of the new ones into the skin. Returns the new
    /// lips; `faces` receives the boundary faces affected.
    fn cut_the_skin(
        &mut self,
        source: &mut SkinSource,
        change: Change,
        faces: &mut BTreeSet<u32>,
    ) -> Result<Vec<Face>, Misfit> {
        let SkinSource { cut, base, snapping, .. } = *source;
        let mut todo = self.lips_around(cut, change);
        let mut made: BTreeMap<Face, Lip> = BTreeMap::new();
        while !todo.is_empty() {
            for &lip in &todo {
                self.take_off(lip, faces);
            }
            let present: Vec<Face> = todo.iter().copied().filter(|&lip| is_lip(cut, lip)).collect();
            let new: Vec<Lip> =
                present.iter().map(|&lip| Lip::new(base, cut, source.sheet, snapping, lip)).collect();
            new.iter().for_each(|lip| lip.cut(base, source.sheet, snapping));
            made.extend(present.into_iter().zip(new));
            // Splitting the skin gives the borders of other lips more edges, so these lips are redone too.
            todo = BTreeSet::new();
            for f in std::mem::take(&mut source.sheet.split) {
                faces.insert(f);
                todo.extend(&self.parts.on_face[f as usize]);
            }
        }
        // Only now is the skin final, so that borders can be traced along its edges.
        for (&face, lip) in &mut made {
            lip.find_chains(source.sheet)?;
            for border in lip.borders.iter().flatten() {
                faces.insert(border.face);
                self.parts.on_face[border.face as usize].insert(face);
            }
        }
        let lips = made.keys().copied().collect();
        self.parts.lips.extend(made);
        Ok(lips)
    }

    /// Old and new lips on the changed fragments and pieces, and across their edges.
    fn lips_around(&self, cut: &CutMesh, change: Change) -> BTreeSet<Face> {
        let f = &cut.fragments;
        let mut lips = BTreeSet::new();
        let of_pieces = change.pieces.iter().flat_map(|&p| cut.pieces.fragments(p, f));
        for t in change.fragments.iter().copied().chain(of_pieces) {
            let faces = (0..4u8).map(|k| (t, k));
            lips.extend(faces.filter(|lip| is_lip(cut, *lip) || self.parts.lips.contains_key(lip)));
        }
        for &t in change.fragments {
            for k in (0..4).filter(|&k| f.neighbour[t as usize][k] == NONE) {
                let across = (0..3).map(|edge| f.around_edge(t, k, edge)).map(|(s, j, _)| (s, j as u8));
                lips.extend(across.filter(|lip| is_lip(cut, *lip)));
            }
        }
        lips
    }

    fn take_off(&mut self, lip: Face, faces: &mut BTreeSet<u32>) {
        let Some(old) = self.parts.lips.remove(&lip) else { return };
        for border in old.borders.iter().flatten() {
            faces.insert(border.face);
            self.parts.on_face[border.face as usize].remove(&lip);
        }
        for &t in &old.triangles {
            self.joined.clear(t);
            self.free.push(t);
        }
    }

    /// Returns a surface triangle for `owner`: a free one, or a new one.
    fn new_triangle(&mut self, owner: Owner, surface: &mut Surface) -> u32 {
        let t = self.free.pop().unwrap_or_else(|| {
            let t = self.joined.add(0, surface);
            self.parts.owner.push(owner);
            self.parts.corners.push([Corner::Middle; 3]);
            self.parts.piece.push(NONE);
            t
        });
        self.parts.owner[t as usize] = owner;
        self.joined.touch(t);
        t
    }

    /// Lays the skin triangles over all affected faces: assigns their pieces and joins neighbours.
    fn lay_skin(
        &mut self,
        source: &SkinSource,
        change: Change,
        faces: &mut BTreeSet<u32>,
        surface: &mut Surface,
    ) -> Result<(), Misfit> {
        let SkinSource { cut, base, .. } = *source;
        let sheet = &*source.sheet;
        let of_fragments = change.fragments.iter().map(|&t| cut.fragments.element[t as usize]);
        let of_pieces = change.pieces.iter().map(|&p| cut.pieces()[p as usize].element);
        faces.extend(of_fragments.chain(of_pieces).flat_map(|e| base.faces_of(e)));
        self.parts.of_skin.resize(sheet.corners.len(), NONE);
        for &t in faces.iter().flat_map(|&f| &sheet.over[f as usize]) {
            if self.parts.of_skin[t as usize] == NONE {
                self.parts.of_skin[t as usize] = self.new_triangle(Owner::Skin(t), surface);
            }
            let s = self.parts.of_skin[t as usize];
            self.joined.touch(s);
            self.parts.corners[s as usize] = sheet.corners[t as usize].map(Corner::Skin);
            self.parts.piece[s as usize] = NONE;
            surface.tags[s as usize] = 0;
        }
        for &f in faces.iter() {
            self.find_pieces(cut, base, sheet, f)?;
        }
        // Skin edges on the cut curve stay open; the lips are joined there.
        for h in faces.iter().flat_map(|&f| &sheet.over[f as usize]).flat_map(|&t| 3 * t..3 * t + 3) {
            let here = self.parts.half_edge(h);
            if sheet.chain[h as usize] == NONE {
                self.joined.join(here, self.parts.half_edge(sheet.twin[h as usize]));
                continue;
            }
            let twin = self.joined.twin(here);
            if twin != NONE && matches!(self.parts.owner[twin as usize / 3], Owner::Skin(_)) {
                self.joined.open(here);
            }
        }
        Ok(())
    }

    /// Finds the pieces below the skin over face `f`. The flood starts at the borders and stops at the cut
    /// curve.
    fn find_pieces(&mut self, cut: &CutMesh, base: &Base, sheet: &Sheet, f: u32) -> Result<(), Misfit> {
        let parts = &mut self.parts;
        let mut stack = Vec::new();
        for lip in parts.on_face[f as usize].iter().filter_map(|lip| parts.lips.get(lip)) {
            for border in lip.borders.iter().flatten().filter(|border| border.face == f) {
                for &h in &border.chain {
                    let s = parts.of_skin[h as usize / 3];
                    parts.piece[s as usize] = cut.fragments.piece[border.below as usize];
                    stack.push(h / 3);
                }
            }
        }
        while let Some(t) = stack.pop() {
            for h in 3 * t..3 * t + 3 {
                let next = sheet.twin[h as usize] / 3;
                if sheet.face[next as usize] != f || sheet.chain[h as usize] != NONE {
                    continue;
                }
                let [s, beside] = [t, next].map(|t| parts.of_skin[t as usize] as usize);
                if parts.piece[beside] == NONE {
                    parts.piece[beside] = parts.piece[s];
                    stack.push(next);
                }
            }
        }
        // A face without borders, or a part of it that no border reaches, takes the piece found below it.
        let mut whole = None;
        for &t in &sheet.over[f as usize] {
            let s = parts.of_skin[t as usize] as usize;
            if parts.piece[s] == NONE {
                let found = match whole {
                    Some(piece) => piece,
                    None => piece_under(cut, base, f).ok_or(Misfit::NoPiece)?,
                };
                whole = Some(found);
                parts.piece[s] = found;
            }
        }
        Ok(())
    }

    /// Creates the triangles of new lips and joins them to each other, to the neighbouring lips and to the
    /// skin.
    fn fill_lips(&mut self, source: &SkinSource, lips: &[Face], surface: &mut Surface) -> Result<(), Misfit> {
        let f = &source.cut.fragments;
        for &face in lips {
            let Some(mut lip) = self.parts.lips.remove(&face) else { continue };
            let (t, k) = (face.0 as usize, face.1 as usize);
            let (ring, parts) = lip.ring(source.cut, source.sheet, face);
            let (n, mut edges) = (ring.len(), BTreeMap::new());
            for corners in fill(n, parts) {
                let s = self.new_triangle(Owner::Lip(face), surface);
                self.parts.corners[s as usize] =
                    corners.map(|c| ring.get(c).copied().unwrap_or(Corner::Middle));
                self.parts.piece[s as usize] = f.piece[t];
                surface.tags[s as usize] = f.tag[t][k];
                lip.triangles.push(s);
                for i in 0..3 {
                    edges.insert([corners[i], corners[(i + 1) % 3]], 3 * s + i as u32);
                }
            }
            for ([a, b], &h) in &edges {
                if let Some(&twin) = edges.get(&[*b, *a]) {
                    self.joined.join(h, twin);
                }
            }
            // The outline is recorded edge by edge: the skin and the lips beside it are joined along it.
            let mut first = 0;
            for (edge, &count) in parts.iter().enumerate() {
                let along = (first..first + count).map(|i| edges[&[i, (i + 1) % n]]);
                lip.outline[edge] = along.collect();
                first += count;
            }
            for (border, outline) in lip.borders.iter().zip(&lip.outline) {
                let Some(border) = border else { continue };
                for (&h, &skin) in outline.iter().zip(border.chain.iter().rev()) {
                    let skin = self.parts.half_edge(skin);
                    if self.joined.twin(skin) != NONE {
                        return Err(Misfit::NoChain);
                    }
                    self.joined.join(h, skin);
                }
            }
            self.parts.lips.insert(face, lip);
        }
        // Lips meet across edges inside the body only once all of them have their triangles.
        for &(t, k) in lips {
            for edge in (0..3).filter(|&edge| self.parts.lips[&(t, k)].borders[edge].is_none()) {
                let (s, j, other) = f.around_edge(t, k as usize, edge);
                let beside = self.parts.lips.get(&(s, j as u8)).map(|lip| &lip.outline[other]);
                let (mine, Some([twin])) =
                    (self.parts.lips[&(t, k)].outline[edge][0], beside.map(Vec::as_slice))
                else {
                    return Err(Misfit::OpenSeam);
                };
                self.joined.join(mine, *twin);
            }
        }
        Ok(())
    }

    /// Removes unused surface triangles; the last triangles take their numbers.
    fn give_numbers_back(&mut self, surface: &mut Surface) {
        let mut free = std::mem::take(&mut self.free);
        free.sort_unstable_by(|s, t| t.cmp(s));
        for &t in &free {
            let last = self.joined.remove(t, surface);
            let parts = &mut self.parts;
            parts.owner.swap_remove(t as usize);
            parts.corners.swap_remove(t as usize);
            parts.piece.swap_remove(t as usize);
            if t == last {
                continue;
            }
            match parts.owner[t as usize] {
                Owner::Skin(skin) => parts.of_skin[skin as usize] = t,
                Owner::Lip(face) => {
                    let Some(lip) = parts.lips.get_mut(&face) else { continue };
                    lip.triangles.iter_mut().filter(|s| **s == last).for_each(|s| *s = t);
                    for h in lip.outline.iter_mut().flatten().filter(|h| **h / 3 == last) {
                        *h = 3 * t + *h % 3;
                    }
                }
            }
        }
        free.clear();
        self.free = free;
    }
}

/// Places the vertices of the surface.
struct Placed<'a> {
    cut: &'a CutMesh,
    sheet: &'a Sheet,
    parts: &'a Parts,
}

impl Placed<'_> {
    fn corner(&self, c: u32) -> Corner {
        self.parts.corners[c as usize / 3][c as usize % 3]
    }

    /// Puts the middle of a lip at the centroid of its outline, once the outline has its vertices.
    fn place_middle(&self, lip: &Lip, surface: &mut Surface) {
        let Some(&first) = lip.triangles.first() else { return };
        if self.corner(3 * first + 2) != Corner::Middle {
            return;
        }
        let place =
            |s: &u32| rest_place(self.cut, &surface.vertices[surface.triangles[*s as usize][0] as usize]);
        let sum: Vector3<f64> = lip.triangles.iter().map(place).sum();
        let middle =
            in_element(self.cut, self.parts.piece[first as usize], &(sum / lip.triangles.len() as f64));
        surface.vertices[surface.triangles[first as usize][2] as usize] = middle;
    }
}

impl Place for Placed<'_> {
    /// On the skin if one of the corners is, and in the element that has to extrapolate least.
    fn vertex(&mut self, cycle: &[u32]) -> MaterialPoint {
        let mut best: Option<(f64, MaterialPoint)> = None;
        let mut seen = NONE;
        for &c in cycle {
            let (Owner::Skin(_), Corner::Skin(p)) = (self.parts.owner[c as usize / 3], self.corner(c)) else {
                continue;
            };
            let piece = self.parts.piece[c as usize / 3];
            if piece != seen {
                seen = piece;
                let vertex = in_element(self.cut, piece, &self.sheet.points[p as usize].place);
                let reach = vertex.weights().iter().fold(0.0f64, |m, w| m.max(w.abs()));
                if best.is_none_or(|b| reach < b.0) {
                    best = Some((reach, vertex));
                }
            }
        }
        match (best, self.corner(cycle[0])) {
            (Some((_, vertex)), _) => vertex,
            (None, Corner::Lip(v)) => {
                let piece = self.parts.piece[cycle[0] as usize / 3];
                on_fragment(self.cut, piece, &self.cut.fragments.vertices[v as usize])
            }
            // The middle of a lip is placed after its neighbours.
            _ => MaterialPoint::default(),
        }
    }

    fn middle(&self, corners: &[u32], of: &[MaterialPoint]) -> MaterialPoint {
        let sum: Vector3<f64> = of.iter().map(|vertex| rest_place(self.cut, vertex)).sum();
        in_element(self.cut, self.parts.piece[corners[0] as usize / 3], &(sum / of.len() as f64))
    }
}

/// The piece of one of the fragments below boundary face `f`.
fn piece_under(cut: &CutMesh, base: &Base, f: u32) -> Option<u32> {
    let fragments = &cut.fragments;
    let e = base.faces[f as usize].element;
    if fragments.count[e as usize] == 1 {
        return Some(e);
    }
    let is_under = |t: u32, k: usize| {
        fragments.neighbour[t as usize][k] == NONE
            && fragments.tag[t as usize][k] == 0
            && base.under(cut.mesh(), fragments, t, k) == Some(f)
    };
    fragments.of_element(e).find(|&t| (0..4).any(|k| is_under(t, k))).map(|t| fragments.piece[t as usize])
}

/// Rest position of a surface vertex [m].
fn rest_place(cut: &CutMesh, vertex: &MaterialPoint) -> Vector3<f64> {
    let node = |c: usize| cut.mesh().nodes[cut.copy_node()[c] as usize];
    vertex.carriers().map(|(c, w)| node(c) * w).sum()
}

/// A rest position in the barycentric coordinates of a piece's element.
fn in_element(cut: &CutMesh, piece: u32, place: &Vector3<f64>) -> MaterialPoint {
    let piece = &cut.pieces()[piece as usize];
    let e = piece.element as usize;
    let [origin, ..] = cut.mesh().corners(e);
    let g = cut.mesh().gradients(e);
    let mut weights = [1.0, 0.0, 0.0, 0.0];
    for (w, g) in weights.iter_mut().zip(&g) {
        *w += g.dot(&(place - origin));
    }
    MaterialPoint::in_tet(piece.copies, weights)
}

/// A fragment vertex, expressed by the copies of a piece.
fn on_fragment(cut: &CutMesh, piece: u32, v: &FragmentVertex) -> MaterialPoint {
    let piece = &cut.pieces()[piece as usize];
    let nodes = cut.mesh().tets[piece.element as usize];
    MaterialPoint::in_tet(piece.copies, nodes.map(|n| v.weight_of(n)))
}
