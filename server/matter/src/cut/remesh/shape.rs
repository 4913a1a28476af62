//! Shapes of degenerate elements.
//!
//! # Source
//! Nienhuys 2003, §3.2.3: flatness by the aspect ratio, the kind by the number of large dihedral
//! angles; both thresholds as printed in §3.3.

use nalgebra::Vector3;

use super::complex::{Complex, det};
use crate::mesh::{TET_EDGES, TET_FACES};

/// An element is degenerate below this aspect ratio.
pub const FLAT: f64 = 0.01;

/// A dihedral angle is large beyond this [rad].
pub const LARGE_ANGLE: f64 = 0.99 * std::f64::consts::PI;

/// Kind of a degenerate element; local node numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// No large angle: a short edge or flat triangles.
    Needle,
    /// One large angle, at the edge given: a node lies close to the edge opposite.
    Spindle([usize; 2]),
    /// Two large angles, at opposite edges: these nearly meet.
    Sliver([usize; 2], [usize; 2]),
    /// Three large angles, at the edges of one node, which lies close to the face opposite.
    Cap(usize),
}

/// Least height over longest edge; 0 for an element without extent, negative for an inverted one.
pub fn aspect(x: &[Vector3<f64>; 4]) -> f64 {
    let largest_face =
        TET_FACES.iter().map(|&[a, b, c]| (x[b] - x[a]).cross(&(x[c] - x[a])).norm()).fold(0.0, f64::max);
    let longest = TET_EDGES.iter().map(|&[a, b]| (x[b] - x[a]).norm()).fold(0.0, f64::max);
    let scale = largest_face * longest;
    if scale > 0.0 { det(x) / scale } else { 0.0 }
}

/// The kind of an element by its large dihedral angles.
pub fn kind(x: &[Vector3<f64>; 4]) -> Kind {
    let mut large: Vec<[usize; 2]> =
        TET_EDGES.into_iter().filter(|&e| dihedral(x, e) > LARGE_ANGLE).collect();
    large.sort_by(|&a, &b| dihedral(x, b).total_cmp(&dihedral(x, a)));
    match large[..] {
        [] => Kind::Needle,
        [e] => Kind::Spindle(e),
        [e, f] if opposite(e) == f => Kind::Sliver(e, f),
        [e, f, g, ..] => match (0..4).find(|k| e.contains(k) && f.contains(k) && g.contains(k)) {
            Some(apex) => Kind::Cap(apex),
            None => Kind::Spindle(e),
        },
        [e, _] => Kind::Spindle(e),
    }
}

/// The edge that shares no node with `e`.
pub fn opposite(e: [usize; 2]) -> [usize; 2] {
    let mut rest = (0..4).filter(|k| !e.contains(k));
    [rest.next().unwrap_or(0), rest.next().unwrap_or(0)]
}

/// Inner angle [rad] between the two faces at an edge.
fn dihedral(x: &[Vector3<f64>; 4], e: [usize; 2]) -> f64 {
    let axis = x[e[1]] - x[e[0]];
    // An edge without length has no angle.
    let Some(axis) = axis.try_normalize(0.0) else { return 0.0 };
    let [p, q] = opposite(e).map(|k| {
        let arm = x[k] - x[e[0]];
        arm - axis * axis.dot(&arm)
    });
    p.cross(&q).norm().atan2(p.dot(&q))
}

/// Volume at rest [m³] of some elements.
pub fn star_volume(complex: &Complex, tets: &[u32]) -> f64 {
    tets.iter().map(|&t| det(&complex.rest(t)) / 6.0).sum()
}
