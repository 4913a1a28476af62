//! Quads around cut links, and how the material joins them across their edges.
//!
//! Quad (c, d) of cell c in direction d has its corners at the lattice points of that face of the cell, counter-
//! clockwise seen from outside. Edge k runs from corner k to the next, at the side of the face in direction
//! [`SIDES`]\[d\]\[k\].

use super::super::cells::Octree;
use super::super::lattice::DIRECTIONS;

/// Corners of the face of a cell in each direction, counter-clockwise seen from outside. Bit k is the end along
/// axis k.
pub(super) const CORNERS: [[usize; 4]; 6] =
    [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];

/// Direction from the middle of each face to its edges.
const SIDES: [[usize; 4]; 6] =
    [[2, 5, 3, 4], [4, 3, 5, 2], [4, 1, 5, 0], [0, 5, 1, 4], [0, 3, 1, 2], [2, 1, 3, 0]];

/// The face (6·leaf + direction) and its edge that continue the surface beyond edge `k` of `face`.
///
/// Of the four cells around the edge, those that links connect with the cell of `face` are walked through up to
/// the next cut link. Seen from the other face, the walk leads back.
pub(super) fn partner(octree: &Octree, face: u32, k: usize) -> (u32, u32) {
    let (leaf, d) = (face / 6, face as usize % 6);
    let side = SIDES[d][k];
    let (d_back, side_back) = (d ^ 1, side ^ 1);
    let at = octree.cells()[leaf as usize].at;
    let beside = across(at, side);
    let ahead = across(beside, d);
    let (cell, out, towards) = if !octree.is_linked(at, side) {
        (at, side, d)
    } else if !octree.is_linked(beside, d) {
        (beside, d, side_back)
    } else if !octree.is_linked(ahead, side_back) {
        (ahead, side_back, d_back)
    } else {
        // The end of an incision: its other lip follows.
        (across(at, d), d_back, side)
    };
    let edge = SIDES[out].iter().position(|s| *s == towards).unwrap_or(0);
    (6 * octree.leaf(cell) + out as u32, edge as u32)
}

fn across(at: [i32; 3], d: usize) -> [i32; 3] {
    [0, 1, 2].map(|k| at[k] + DIRECTIONS[d][k])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_turn_counter_clockwise_and_sides_follow_from_them() {
        for d in 0..6 {
            let p = CORNERS[d].map(|c| [0, 1, 2].map(|k| f64::from((c >> k & 1) as u8)));
            let p = p.map(nalgebra::Vector3::from);
            let out = nalgebra::Vector3::from(DIRECTIONS[d].map(f64::from));
            assert_eq!((p[1] - p[0]).cross(&(p[2] - p[1])), out);
            let middle = (p[0] + p[2]) / 2.0;
            for k in 0..4 {
                let side = 2.0 * ((p[k] + p[(k + 1) % 4]) / 2.0 - middle);
                assert_eq!(side, nalgebra::Vector3::from(DIRECTIONS[SIDES[d][k]].map(f64::from)), "{d} {k}");
            }
        }
    }
}
