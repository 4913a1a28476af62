//! The material as tetrahedra that fill it without overlap: the fragments of all pieces, each bound to its
//! piece.
//!
//! Mechanics treats every piece of a cut element as one whole tetrahedron, and these overlap. Drawing,
//! slicing and measuring use the [`Solid`] instead.

use std::collections::BTreeMap;

use super::cut_mesh::CutMesh;
use super::shell::surface::bind;
use crate::element::MaterialPoint;

/// Tetrahedra without overlap; their volumes add up to that of the body, in every configuration.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Solid {
    /// Points of the material. The two sides of a cut have separate points.
    pub vertices: Vec<MaterialPoint>,
    /// Vertex ids, positively oriented at rest.
    pub tets: Vec<[u32; 4]>,
    /// Piece each tetrahedron belongs to.
    pub piece: Vec<u32>,
}

impl CutMesh {
    /// The fragments of all pieces as one mesh, built anew at each call.
    pub fn solid(&self) -> Solid {
        let mut solid = Solid::default();
        // Two pieces share a point exactly where they share the copies that move it.
        let mut ids: BTreeMap<(u32, Vec<u32>), u32> = BTreeMap::new();
        let fragments = &self.fragments;
        for (t, tet) in fragments.tets.iter().enumerate() {
            if fragments.fraction[t] == 0.0 {
                continue;
            }
            let piece = fragments.piece[t];
            solid.piece.push(piece);
            solid.tets.push(tet.map(|v| {
                let vertex = bind(self.mesh(), &self.pieces, piece, &fragments.vertices[v as usize]);
                *ids.entry((v, vertex.copies().to_vec())).or_insert_with(|| {
                    solid.vertices.push(vertex);
                    solid.vertices.len() as u32 - 1
                })
            }));
        }
        solid
    }
}
