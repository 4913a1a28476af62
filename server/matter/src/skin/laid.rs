//! A surface laid on a boundary: its own triangles, divided by the edges of the boundary.

use nalgebra::Vector3;

use super::base::Base;
use super::error::{SkinError, check, check_size};
use super::overlay::Overlay;
use super::own::{Kept, OwnSurface};
use super::patch::rest_on;
use super::sheet::{Sheet, SkinShape};
use crate::cut::topology::fragments::NONE;

/// A closed surface on which another one is laid.
#[derive(Clone, Copy, Debug)]
pub struct Ground<'a> {
    /// Where its vertices rest [m].
    pub vertices: &'a [Vector3<f64>],
    /// Its triangles, counter-clockwise seen from outside.
    pub triangles: &'a [[u32; 3]],
    /// Opposite of each half-edge 3·triangle + k, which runs from corner k to the next.
    pub twin: &'a [usize],
}

/// A point of a surface that was laid.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
pub struct LaidPoint {
    /// The one to three vertices of the ground that it lies between.
    between: [u32; 3],
    /// Where it rests [m].
    pub rest: Vector3<f64>,
}

impl LaidPoint {
    /// The one to three vertices of the ground that it lies between.
    pub fn between(&self) -> impl Iterator<Item = u32> {
        self.between.into_iter().filter(|v| *v != NONE)
    }
}

/// A surface that was laid on another one.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct Laid {
    /// Where each vertex of the skin rests.
    pub points: Vec<LaidPoint>,
    /// Its triangles, in the order of the triangles of the ground below them.
    pub triangles: Vec<[u32; 3]>,
    /// The first of them over each triangle of the ground, and their number.
    first: Vec<u32>,
    /// Points strictly between the ends of each half-edge of the ground, from its first to its second end.
    sides: Vec<u32>,
    /// The first of them of each half-edge, and their number.
    first_of_side: Vec<u32>,
    /// Point at each corner 3·triangle + k of the ground.
    pub corners: Vec<u32>,
}

impl Laid {
    /// Lays `own` on `ground`. Where the two do not go together, it rests where `shape` says.
    ///
    /// # Errors
    /// Too many triangles, or a place that is not finite.
    pub fn new(
        ground: &Ground<'_>,
        own: &OwnSurface<'_>,
        shape: &mut SkinShape<'_>,
    ) -> Result<(Self, Kept), SkinError> {
        let base = Base::of_surface(ground.triangles, ground.twin);
        let (sheet, kept) = own_sheet(&base, ground.vertices, own, shape)?;
        check(&sheet)?;
        let point = |p: &super::sheet::Point| LaidPoint {
            between: [0, 1, 2].map(|k| if p.at.weights[k] > 0.0 { p.at.nodes[k] } else { NONE }),
            rest: p.place,
        };
        let mut laid = Self {
            points: sheet.points.iter().map(point).collect(),
            first: vec![0],
            first_of_side: vec![0],
            ..Self::default()
        };
        for (face, over) in base.faces.iter().zip(&sheet.over) {
            laid.triangles.extend(over.iter().map(|&t| sheet.corners[t as usize]));
            laid.first.push(laid.triangles.len() as u32);
            laid.corners.extend(face.corners.map(|corner| sheet.corner_point[corner as usize]));
            for k in 0..3 {
                let ends = [face.nodes[k], face.nodes[(k + 1) % 3]];
                laid.sides.extend(on_side(&sheet, over, ends));
                laid.first_of_side.push(laid.sides.len() as u32);
            }
        }
        Ok((laid, kept))
    }

    /// The triangles over triangle `t` of the ground.
    pub fn over(&self, t: u32) -> &[[u32; 3]] {
        &self.triangles[self.first[t as usize] as usize..self.first[t as usize + 1] as usize]
    }

    /// The points strictly between the ends of half-edge `h` of the ground, from its first to its second end.
    pub fn side(&self, h: u32) -> &[u32] {
        &self.sides[self.first_of_side[h as usize] as usize..self.first_of_side[h as usize + 1] as usize]
    }
}

/// A skin of the triangles of a surface, and how many of them it has.
pub(super) fn own_sheet(
    base: &Base,
    nodes: &[Vector3<f64>],
    own: &OwnSurface<'_>,
    shape: &mut SkinShape<'_>,
) -> Result<(Sheet, Kept), SkinError> {
    check_size(base.faces.len() + own.triangles.len())?;
    let mut sheet = Sheet::new(base, nodes, 1, &mut |flat, _| *flat);
    let overlay = Overlay::new(base, nodes, own, &mut sheet);
    let kept = rest_on(own, &overlay, nodes, &mut sheet, shape);
    sheet.forget_chains();
    Ok((sheet, kept))
}

/// Points strictly between the corners `ends` of a face, from the first to the second; `over` are the triangles over it.
fn on_side(sheet: &Sheet, over: &[u32], ends: [u32; 2]) -> Vec<u32> {
    let share = |p: u32| {
        let at = &sheet.points[p as usize].at;
        let [from, to] = ends.map(|node| at.weight_of(node));
        let elsewhere = at.nodes.iter().zip(&at.weights).any(|(n, w)| *w > 0.0 && !ends.contains(n));
        (from > 0.0 && to > 0.0 && !elsewhere).then_some(to / (from + to))
    };
    let points = over.iter().flat_map(|&t| sheet.corners[t as usize]);
    let mut points: Vec<(f64, u32)> = points.filter_map(|p| Some((share(p)?, p))).collect();
    points.sort_by(|p, q| p.0.total_cmp(&q.0).then(p.1.cmp(&q.1)));
    points.dedup();
    points.into_iter().map(|(_, p)| p).collect()
}
