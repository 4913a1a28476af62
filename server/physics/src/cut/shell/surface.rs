//! The surface of the fragment mesh: skin and the two lips of every cut, closed and 2-manifold.
//!
//! Each boundary face of a fragment is one triangle.
//! [`SurfaceBuilder`](super::surface_builder::SurfaceBuilder) joins them.

use nalgebra::Vector3;

use crate::mesh::TetMesh;

use crate::cut::topology::fragments::{FragmentVertex, NONE};
use crate::cut::topology::pieces::PieceTable;
use crate::cut::topology::slot::slot_of;

/// A surface point bound to the material: x = Σ weights · x\[copies\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceVertex {
    /// Copies of the piece the vertex belongs to; a valid id in unused slots too.
    pub copies: [u32; 4],
    /// Weights, Σ = 1; 0 in unused slots.
    pub weights: [f64; 4],
}

/// Closed triangle surface of a body, counter-clockwise seen from outside.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surface {
    /// Vertex ids.
    pub triangles: Vec<[u32; 3]>,
    /// Per triangle 0 for skin, n > 0 for a lip of incision n.
    pub tags: Vec<u32>,
    /// The vertices, each bound to the copies of one piece.
    pub vertices: Vec<SurfaceVertex>,
}

impl SurfaceVertex {
    /// Position [m] at the positions `x` of the copies.
    pub fn position(&self, x: &[Vector3<f64>]) -> Vector3<f64> {
        self.copies.iter().zip(&self.weights).map(|(&c, &w)| x[c as usize] * w).sum()
    }
}

impl Surface {
    /// Enclosed volume [m³] at the positions `x` of the copies: Σ p·(q × r)/6.
    pub fn volume(&self, x: &[Vector3<f64>]) -> f64 {
        let points: Vec<Vector3<f64>> = self.vertices.iter().map(|v| v.position(x)).collect();
        let origin = points.first().copied().unwrap_or_default();
        let six: f64 = self
            .triangles
            .iter()
            .map(|t| {
                let [p, q, r] = t.map(|v| points[v as usize] - origin);
                p.dot(&q.cross(&r))
            })
            .sum();
        six / 6.0
    }
}

/// Expresses a fragment vertex by weights on the copies of piece `p`.
pub fn bind(mesh: &TetMesh, pieces: &PieceTable, p: u32, v: &FragmentVertex) -> SurfaceVertex {
    let piece = &pieces.pieces[p as usize];
    let nodes = &mesh.tets[piece.element as usize];
    let mut bound = SurfaceVertex { copies: [NONE; 4], weights: v.weights };
    for (copy, &node) in bound.copies.iter_mut().zip(&v.nodes) {
        if let Some(a) = slot_of(nodes, node) {
            *copy = piece.copies[a];
        }
    }
    let [first, ..] = bound.copies;
    for copy in bound.copies.iter_mut().filter(|c| **c == NONE) {
        *copy = first;
    }
    bound
}
