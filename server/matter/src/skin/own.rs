//! A surface of its own for the skin: its triangles, where they land on the boundary, and how many were kept.

use nalgebra::Vector3;

/// A place on the boundary of the elements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Landing {
    /// Nodes of a boundary face, in any order.
    pub nodes: [u32; 3],
    /// Weight of each of them, at least 0; Σ = 1.
    pub weights: [f64; 3],
}

/// A surface whose triangles are to become the skin.
#[derive(Clone, Copy, Debug)]
pub struct OwnSurface<'a> {
    /// Where its vertices rest [m].
    pub vertices: &'a [Vector3<f64>],
    /// Its triangles, counter-clockwise seen from outside.
    pub triangles: &'a [[u32; 3]],
    /// Where each vertex lands on the boundary of the elements; none: nowhere near.
    pub landings: &'a [Option<Landing>],
}

/// How much of a surface became the skin.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Kept {
    /// Triangles of the surface.
    pub of: usize,
    /// Those of them that are on the skin as they are, perhaps in several parts.
    pub triangles: usize,
    /// Share of the surface's area that these have, from 0 to 1.
    pub area: f64,
}

/// A side of triangles of a surface.
#[derive(Clone, Copy, Debug)]
pub struct OwnEdge {
    /// Its vertices.
    pub ends: [u32; 2],
    /// The triangle to the left of the way from the first to the second vertex seen from outside, and the one to the
    /// right; none where the surface ends.
    pub beside: [Option<u32>; 2],
}

impl OwnSurface<'_> {
    /// The edges between vertices, ordered by them, without those that more than two triangles share or that two
    /// triangles run along in the same direction.
    pub fn edges(&self) -> Vec<OwnEdge> {
        let sides = |(t, triangle): (u32, &[u32; 3])| {
            let [a, b, c] = *triangle;
            [[a, b], [b, c], [c, a]].map(|[p, q]| ([p.min(q), p.max(q)], usize::from(p > q), t))
        };
        let mut sides: Vec<_> = (0..).zip(self.triangles).flat_map(sides).collect();
        sides.sort_unstable();
        let edge = |sides: &[([u32; 2], usize, u32)]| {
            let mut edge = OwnEdge { ends: sides[0].0, beside: [None; 2] };
            for &(_, side, t) in sides {
                if edge.beside[side].replace(t).is_some() {
                    return None;
                }
            }
            Some(edge)
        };
        sides.chunk_by(|a, b| a.0 == b.0).filter_map(edge).collect()
    }

    /// Normal of a triangle; its length is twice the area [m²].
    pub fn area_normal(&self, t: u32) -> Vector3<f64> {
        let [a, b, c] = self.triangles[t as usize].map(|v| self.vertices[v as usize]);
        (b - a).cross(&(c - a))
    }
}
