//! What a blade has drawn on the surface without taking the material apart: where it entered elements
//! that it has not left yet, or only scratched. Shown as a line, the incision follows the blade at once,
//! while the cut lags by at most one element.

use nalgebra::Vector3;

use crate::mesh::TET_FACES;

use super::cut_mesh::CutMesh;
use super::detect::Deformed;
use super::fragments::{FragmentVertex, NONE};
use super::pending::PendingLine;
use super::surface::{SurfaceVertex, bind};

/// A point on the surface: Σ weights · vertices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MarkPoint {
    /// Vertices around it, or thrice the point itself.
    pub vertices: [SurfaceVertex; 3],
    /// Weight of each, Σ = 1.
    pub weights: [f64; 3],
}

/// A straight line on the surface, along an incision that has not opened there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IncisionMark {
    /// The incision.
    pub incision: u32,
    /// From where to where.
    pub ends: [MarkPoint; 2],
}

impl MarkPoint {
    /// A point bound to the material.
    pub fn at(vertex: SurfaceVertex) -> Self {
        Self { vertices: [vertex; 3], weights: [1.0, 0.0, 0.0] }
    }

    /// Position [m], given the position of every copy.
    pub fn position(&self, x: &[Vector3<f64>]) -> Vector3<f64> {
        let held = self.vertices.iter().zip(&self.weights).filter(|(_, w)| **w != 0.0);
        held.map(|(vertex, &w)| vertex.position(x) * w).sum()
    }
}

impl CutMesh {
    /// Marks on the [`surface`](Self::surface), by incision and place, given the position of every copy
    /// [m]: lines over faces that an incision crosses, and of the incision that the last sweep belongs to
    /// the line on to the blade.
    pub fn incision_marks(&self, x: &[Vector3<f64>]) -> Vec<IncisionMark> {
        self.lines_on_boundary(x).iter().map(|line| self.mark(line)).collect()
    }

    pub(crate) fn lines_on_boundary(&self, x: &[Vector3<f64>]) -> Vec<PendingLine> {
        let mut lines = self.pending_lines();
        if let (Some((incision, blade)), true) = (self.blade(x), x.len() == self.n_copies()) {
            self.lines_to_blade(x, incision, &blade, &mut lines);
        }
        lines
    }

    /// A line on the boundary of a fragment, bound to its piece.
    pub(crate) fn mark(&self, line: &PendingLine) -> IncisionMark {
        let piece = self.fragments.piece[line.fragment as usize];
        let ends = line.ends.map(|end| MarkPoint::at(bind(self.mesh(), &self.pieces, piece, &end)));
        IncisionMark { incision: line.incision, ends }
    }

    /// Appends the lines over those faces of the boundary that the blade stands in.
    fn lines_to_blade(
        &self,
        x: &[Vector3<f64>],
        incision: u32,
        blade: &[Vector3<f64>; 2],
        lines: &mut Vec<PendingLine>,
    ) {
        let body = Deformed { mesh: self.mesh(), pieces: &self.pieces, x };
        let (f, known) = (&self.fragments, self.pending_pieces());
        let (low, high) = (blade[0].inf(&blade[1]), blade[0].sup(&blade[1]));
        for (p, piece) in (0u32..).zip(self.pieces()) {
            let [a, b, c, d] = piece.copies.map(|c| &x[c as usize]);
            let (from, to) = (a.inf(b).inf(&c.inf(d)), a.sup(b).sup(&c.sup(d)));
            if !(0..3).all(|k| from[k] <= high[k] && low[k] <= to[k]) {
                continue;
            }
            for t in self.pieces.fragments(p, f) {
                for (face, corners) in TET_FACES.iter().enumerate() {
                    if f.neighbour[t as usize][face] != NONE {
                        continue;
                    }
                    let vertices = corners.map(|k| f.tets[t as usize][k]);
                    let triangle = vertices.map(|v| body.vertex(f, p, v));
                    let Some(w) = stands_in(blade, &triangle) else { continue };
                    let [a, b, c] = vertices.map(|v| f.vertices[v as usize]);
                    // a, b and c with weights w, in two steps.
                    let ab = FragmentVertex::between(&a, &b, w[1] / (w[0] + w[1]));
                    let at = FragmentVertex::between(&ab, &c, w[2]);
                    lines.extend(known.line_to_blade(incision, t, face, at));
                }
            }
        }
    }
}

/// Barycentric coordinates of the point in which a segment passes through a triangle.
fn stands_in([tip, heel]: &[Vector3<f64>; 2], [a, b, c]: &[Vector3<f64>; 3]) -> Option<[f64; 3]> {
    let along = heel - tip;
    let normal = (b - a).cross(&(c - a));
    let s = normal.dot(&(a - tip)) / normal.dot(&along);
    if !(0.0..=1.0).contains(&s) {
        return None;
    }
    let point = tip + along * s;
    let part = |p: &Vector3<f64>, q: &Vector3<f64>| {
        (p - point).cross(&(q - point)).dot(&normal) / normal.norm_squared()
    };
    let w = [part(b, c), part(c, a), part(a, b)];
    (w.iter().all(|w| *w >= 0.0) && w[0] + w[1] > 0.0).then_some(w)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_blade_stands_in_a_triangle_where_it_passes_through() {
        let v = Vector3::new;
        let triangle = [v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.0), v(0.0, 1.0, 0.0)];
        let found = stands_in(&[v(0.25, 0.5, -1.0), v(0.25, 0.5, 2.0)], &triangle);
        assert_eq!(found, Some([0.25, 0.25, 0.5]));
        assert_eq!(stands_in(&[v(0.75, 0.5, -1.0), v(0.75, 0.5, 2.0)], &triangle), None);
        assert_eq!(stands_in(&[v(0.25, 0.5, 1.0), v(0.25, 0.5, 2.0)], &triangle), None);
        assert_eq!(stands_in(&[v(0.0, 0.0, 1.0), v(1.0, 0.0, 1.0)], &triangle), None);
    }
}
