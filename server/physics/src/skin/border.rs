//! The cut curve: where lips meet the boundary of the uncut mesh.

use std::collections::BTreeSet;

use super::base::Base;
use super::sheet::Sheet;
use crate::cut::CutMesh;
use crate::cut::fragments::NONE;
use crate::mesh::TET_FACES;

/// Fragment, face and edge: a half-edge of the fragments' boundary.
pub type HalfEdge = (u32, usize, usize);

/// One edge of the cut curve, seen from the skin beside it.
#[derive(Clone, Debug)]
pub struct Border {
    /// Half-edge of the face that is skin.
    pub skin: HalfEdge,
    /// Half-edge of the lip, which runs the other way.
    pub lip: HalfEdge,
    /// Boundary face below.
    pub face: u32,
    /// Skin half-edges along it, with the skin that stays on this side to the left.
    pub chain: Vec<u32>,
}

/// The cut curve and the faces on both sides of it.
#[derive(Clone, Debug, Default)]
pub struct Borders {
    /// Edges of the cut curve.
    pub edges: Vec<Border>,
    /// Faces of fragments that are lips, in order.
    pub lips: Vec<(u32, usize)>,
}

impl Borders {
    /// Reads the cut curve off the fragments.
    pub fn of(base: &Base, cut: &CutMesh) -> Self {
        let f = &cut.fragments;
        let mut borders = Self::default();
        for (t, (neighbours, tags)) in (0u32..).zip(f.neighbour.iter().zip(&f.tag)) {
            for k in (0..4).filter(|&k| neighbours[k] == NONE && tags[k] != 0) {
                borders.lips.push((t, k));
                for edge in 0..3 {
                    let skin = f.around_edge(t, k, edge);
                    if f.tag[skin.0 as usize][skin.1] == 0
                        && let Some(face) = base.under(cut.mesh(), f, skin.0, skin.1)
                    {
                        borders.edges.push(Border { skin, lip: (t, k, edge), face, chain: Vec::new() });
                    }
                }
            }
        }
        borders
    }

    /// Inserts the curve into the skin and finds the chain of every edge.
    pub fn cut(&mut self, base: &Base, cut: &CutMesh, sheet: &mut Sheet, snapping: f64) {
        let f = &cut.fragments;
        let ends = |(t, k, edge): HalfEdge| {
            [edge, (edge + 1) % 3].map(|c| f.vertices[f.tets[t as usize][TET_FACES[k][c]] as usize])
        };
        let points: Vec<[u32; 2]> = self
            .edges
            .iter()
            .map(|b| ends(b.skin).map(|at| sheet.insert_point(base, b.face, &at, snapping)))
            .collect();
        for (border, [from, to]) in self.edges.iter().zip(&points) {
            sheet.cut_along(base, border.face, *from, *to, snapping);
        }
        for (border, [from, to]) in self.edges.iter_mut().zip(&points) {
            let path = sheet.cut_between(border.face, *from, *to).unwrap_or_default();
            let half_edges = path.windows(2).map(|e| sheet.half_edge(border.face, e[0], e[1]));
            border.chain = half_edges.collect::<Option<Vec<u32>>>().unwrap_or_default();
        }
    }

    /// Boundary faces that touch the curve.
    pub fn faces(&self, sheet: &Sheet) -> BTreeSet<u32> {
        let mut faces = BTreeSet::new();
        for &h in self.edges.iter().flat_map(|b| &b.chain) {
            faces.extend(sheet.around(h).iter().map(|&g| sheet.face[g as usize / 3]));
        }
        faces
    }
}
