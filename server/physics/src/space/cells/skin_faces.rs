//! Faces of cells at the boundary of a body, as they carry pressure.
//!
//! They are steps where the boundary is inclined. The vector area Σ n A of steps is that of the surface between the same
//! rims, so the resultant of a pressure is that on the surface, and its distribution is known to a cell.

use scindo_matter::element::MaterialPoint;
use scindo_matter::octree::{FACES, corner_weights};

use super::OctreeSpace;

/// Corners of the face in direction `d`, counter-clockwise from outside.
fn around(d: usize) -> [usize; 4] {
    let (axis, up) = (d / 2, d % 2);
    let [b, c] = [1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3)];
    let first = up << axis;
    match up {
        1 => [first, first | b, first | b | c, first | c],
        _ => [first, first | c, first | b | c, first | b],
    }
}

impl OctreeSpace {
    /// Calls `visit` with the corners of every boundary face, counter-clockwise from outside, all of whose vertices were
    /// `selected` in the uncut body. Lips of cuts are no boundary.
    pub(super) fn for_boundary_faces(&self, selected: &[bool], visit: &mut dyn FnMut(&[MaterialPoint])) {
        let (octree, uncut) = (&self.octree, &*self.initial);
        for (id, cell) in (0_u32..).zip(octree.cells()).filter(|(_, cell)| cell.cut != 0) {
            // Cells at the boundary are finest ones from the beginning.
            let before = uncut.leaf(cell.at) as usize;
            let W = corner_weights(&uncut.cells()[before], uncut.hanging()[before]);
            let carry = |c: usize| uncut.vertices()[before].into_iter().zip(W[c]);
            let chosen = |c: &usize| carry(*c).all(|(v, w)| w == 0.0 || selected[v as usize]);
            for d in (0..6).filter(|&d| octree.leads_out(id, d)) {
                if FACES[d].iter().all(chosen) {
                    let corner = |c: usize| [0, 1, 2].map(|k| (c >> k & 1) as f64);
                    visit(&around(d).map(|c| octree.point_in(id, corner(c))));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_run_around_their_face() {
        for (d, face) in FACES.iter().enumerate() {
            let mut corners = around(d);
            let [a, b, c, e] =
                corners.map(|c| [0, 1, 2].map(|k| (c >> k & 1) as f64)).map(nalgebra::Vector3::from);
            let normal = (b - a).cross(&(c - a));
            assert_eq!(normal, (c - a).cross(&(e - a)));
            let mut outside = nalgebra::Vector3::zeros();
            outside[d / 2] = if d % 2 == 1 { 1.0 } else { -1.0 };
            assert_eq!(normal, outside);
            corners.sort_unstable();
            assert_eq!(corners, *face);
        }
    }
}
