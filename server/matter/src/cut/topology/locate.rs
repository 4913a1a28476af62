//! Finds the piece to which a material point belongs.

use nalgebra::{Matrix4, Vector4};

use crate::mesh::TetMesh;

use super::fragments::Fragments;

/// The piece of element `e` in which the point with these barycentric coordinates lies deepest.
pub(crate) fn piece_at(mesh: &TetMesh, fragments: &Fragments, e: u32, barycentric: [f64; 4]) -> u32 {
    let point = Vector4::from(barycentric);
    let nodes = mesh.tets[e as usize];
    let depth = |t: u32| {
        let corners = fragments.tets[t as usize].map(|v| {
            let vertex = &fragments.vertices[v as usize];
            Vector4::from(nodes.map(|n| vertex.weight_of(n)))
        });
        let inverse = Matrix4::from_columns(&corners).try_inverse();
        inverse.map_or(f64::NEG_INFINITY, |inverse| (inverse * point).min())
    };
    let mut best = (f64::NEG_INFINITY, e);
    for t in fragments.of_element(e) {
        let candidate = (depth(t), t);
        if candidate.0 > best.0 {
            best = candidate;
        }
    }
    fragments.piece[best.1 as usize]
}
