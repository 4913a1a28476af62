//! The surface of the fragment mesh: skin and the two lips of every cut, closed and 2-manifold.
//!
//! Each boundary face of a fragment is one triangle.
//! [`SurfaceBuilder`](super::surface_builder::SurfaceBuilder) joins them.

use nalgebra::Vector3;

use crate::element::MaterialPoint;
use crate::mesh::TetMesh;

use crate::cut::topology::fragments::{FragmentVertex, NONE};
use crate::cut::topology::pieces::PieceTable;
use crate::cut::topology::slot::slot_of;

/// Closed triangle surface of a body, counter-clockwise seen from outside.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Surface {
    /// Vertex ids.
    pub triangles: Vec<[u32; 3]>,
    /// Per triangle 0 for skin, n > 0 for a lip of incision n.
    pub tags: Vec<u32>,
    /// The vertices, each bound to the copies of one piece.
    pub vertices: Vec<MaterialPoint>,
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
pub(crate) fn bind(mesh: &TetMesh, pieces: &PieceTable, p: u32, v: &FragmentVertex) -> MaterialPoint {
    let piece = &pieces.pieces[p as usize];
    let nodes = &mesh.tets[piece.element as usize];
    let mut copies = v.nodes.map(|node| slot_of(nodes, node).map_or(NONE, |a| piece.copies[a]));
    // Unused slots have weight 0, and need a valid copy.
    let [first, ..] = copies;
    copies.iter_mut().filter(|copy| **copy == NONE).for_each(|copy| *copy = first);
    MaterialPoint::in_tet(copies, v.weights)
}
