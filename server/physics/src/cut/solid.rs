//! The material as tetrahedra that fill it once: the fragments of all pieces, each bound to its piece.
//!
//! A cut element counts in mechanics as one whole tetrahedron per piece, and these overlap. What is to be
//! drawn, sliced or measured is this.

use std::collections::BTreeMap;

use super::cut_mesh::CutMesh;
use super::shell::surface::{SurfaceVertex, bind};

/// Tetrahedra without overlap; their volumes add up to that of the body, in every configuration.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Solid {
    /// Points of the material; the two sides of a cut have each their own.
    pub vertices: Vec<SurfaceVertex>,
    /// Vertex ids, positively oriented at rest.
    pub tets: Vec<[u32; 4]>,
    /// Piece each tetrahedron is part of.
    pub piece: Vec<u32>,
}

impl CutMesh {
    /// The fragments of all pieces.
    pub fn solid(&self) -> Solid {
        let mut solid = Solid::default();
        // Two pieces share a point where they share the copies that move it.
        let mut ids: BTreeMap<(u32, [u32; 4]), u32> = BTreeMap::new();
        let fragments = &self.fragments;
        for (t, tet) in fragments.tets.iter().enumerate() {
            if fragments.fraction[t] == 0.0 {
                continue;
            }
            let piece = fragments.piece[t];
            solid.piece.push(piece);
            solid.tets.push(tet.map(|v| {
                let vertex = bind(self.mesh(), &self.pieces, piece, &fragments.vertices[v as usize]);
                *ids.entry((v, vertex.copies)).or_insert_with(|| {
                    solid.vertices.push(vertex);
                    solid.vertices.len() as u32 - 1
                })
            }));
        }
        solid
    }
}
