//! Marks of incisions on the skin: lines on the boundary, lifted to the skin triangles over it.
//!
//! # Limit
//! A blade leaves a line where it reaches the boundary of the elements. The skin may stand farther off the
//! boundary than the blade goes in, e.g. over the middle of large faces of a bulging body. Nothing is drawn
//! there, and a very shallow scratch has gaps.
//!
//! Lines found on the skin triangles themselves would close the gaps but not match the cut. The cut curve
//! lies where the blade crosses edges of the boundary. A blade that is not along the normal crosses the skin
//! over another place than the boundary, even over another face. A line beside the curve would remain when
//! the lips open.

use super::base::Base;
use super::sheet::Sheet;
use super::stitch::SkinJoin;
use crate::cut::drawn::traces::{TraceLine, part_inside};
use crate::cut::{CutMesh, IncisionMark, MarkPoint, Surface};

/// Shortest part of a line, as a share of it. Shorter parts lie in a corner of a triangle and are left out.
const SHORT: f64 = 1e-6;

/// Appends the parts of a line, one for every skin triangle over it. A line on a lip is not divided.
pub(super) fn lift(
    base: &Base,
    sheet: &Sheet,
    (join, surface): (&SkinJoin, &Surface),
    cut: &CutMesh,
    line: &TraceLine,
    out: &mut Vec<IncisionMark>,
) {
    let on_lip = cut.fragments.tag[line.fragment as usize][line.face] != 0;
    let face = base.under(cut.mesh(), &cut.fragments, line.fragment, line.face).filter(|_| !on_lip);
    let Some(f) = face else {
        out.push(cut.mark(line));
        return;
    };
    let ends = line.ends.map(|end| Sheet::coordinates(base, f, &end));
    for &t in &sheet.over[f as usize] {
        let corners = sheet.corners[t as usize].map(|p| sheet.point_on(base, f, p));
        let Some(parts) = clip(&corners, &ends) else { continue };
        let vertices = surface.triangles[join.of_skin(t) as usize].map(|v| surface.vertices[v as usize]);
        let ends = parts.map(|weights| MarkPoint { vertices, weights });
        out.push(IncisionMark { incision: line.incision, ends });
    }
}

/// Clips a line to a triangle. Both are in coordinates on one face; the result is in coordinates of the
/// triangle.
fn clip(triangle: &[[f64; 3]; 3], line: &[[f64; 3]; 2]) -> Option<[[f64; 3]; 2]> {
    let [a, b, c] = triangle;
    let whole = Sheet::area(a, b, c);
    let ends = line.map(|p| [[b, c], [c, a], [a, b]].map(|[q, r]| Sheet::area(&p, q, r) / whole));
    let [from, to] = part_inside([0, 1, 2].map(|k| ends.map(|end| end[k])))?;
    let at = |s: f64| [0, 1, 2].map(|k| ends[0][k] + s * (ends[1][k] - ends[0][k]));
    (to - from > SHORT).then(|| [at(from), at(to)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_clipped_to_the_triangle_that_it_crosses() {
        let triangle = [[1.0, 0.0, 0.0], [0.5, 0.5, 0.0], [0.5, 0.0, 0.5]];
        let across = [[0.75, 0.5, -0.25], [0.75, -0.25, 0.5]];
        let [from, to] = clip(&triangle, &across).unwrap_or_default();
        for (found, expected) in from.into_iter().chain(to).zip([0.5, 0.5, 0.0, 0.5, 0.0, 0.5]) {
            assert!((found - expected).abs() < 1e-12, "{from:?} {to:?}");
        }
        assert_eq!(clip(&triangle, &[[0.2, 0.8, 0.0], [0.2, 0.0, 0.8]]), None);
        let inside = [[0.8, 0.1, 0.1], [0.7, 0.1, 0.2]];
        assert!(clip(&triangle, &inside).is_some());
    }
}
