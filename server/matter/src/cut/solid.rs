//! The material as cells that fill it without overlap. For tetrahedra these are the fragments of all pieces,
//! each bound to its piece.
//!
//! Mechanics treats every piece of a cut element as one whole tetrahedron, and these overlap. Drawing,
//! slicing and measuring use the [`Solid`] instead.

use std::collections::BTreeMap;

use super::cut_mesh::CutMesh;
use super::shell::surface::bind;
use super::topology::pieces::Piece;
use crate::element::MaterialPoint;

/// Cells without overlap; their volumes add up to that of the body, in every configuration.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Solid {
    /// Points of the material. The two sides of a cut have separate points.
    pub vertices: Vec<MaterialPoint>,
    /// Tetrahedra or cells, on these vertices.
    pub cells: SolidCells,
    /// Where each cell comes from.
    pub origins: Vec<SolidOrigin>,
}

/// Vertex ids of the cells of a [`Solid`].
#[derive(Clone, Debug, PartialEq)]
pub enum SolidCells {
    /// Tetrahedra, positively oriented at rest.
    Tets(Vec<[u32; 4]>),
    /// Hexahedra; bit k of a corner's number is its end along axis k.
    Hexes(Vec<[u32; 8]>),
}

impl Default for SolidCells {
    fn default() -> Self {
        Self::Tets(Vec::new())
    }
}

/// What a cell of a [`Solid`] is part of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolidOrigin {
    /// The tetrahedron or cell of the uncut body.
    pub element: u32,
    /// The piece that cuts made of it.
    pub piece: u32,
    /// Its entry in `Body::cauchy_stresses`.
    pub stress: u32,
    /// Share of the piece in the volume of the uncut element.
    pub fraction: f64,
}

impl CutMesh {
    /// The fragments of all pieces as one mesh, built anew at each call.
    pub fn solid(&self) -> Solid {
        let (mut solid, mut tets) = (Solid::default(), Vec::new());
        // Two pieces share a point exactly where they share the copies that move it.
        let mut ids: BTreeMap<(u32, Vec<u32>), u32> = BTreeMap::new();
        let fragments = &self.fragments;
        for (t, tet) in fragments.tets.iter().enumerate() {
            if fragments.fraction[t] == 0.0 {
                continue;
            }
            let piece = fragments.piece[t];
            let Piece { element, fraction, .. } = self.pieces()[piece as usize];
            solid.origins.push(SolidOrigin { element, piece, stress: piece, fraction });
            tets.push(tet.map(|v| {
                let vertex = bind(self.mesh(), &self.pieces, piece, &fragments.vertices[v as usize]);
                *ids.entry((v, vertex.copies().to_vec())).or_insert_with(|| {
                    solid.vertices.push(vertex);
                    solid.vertices.len() as u32 - 1
                })
            }));
        }
        solid.cells = SolidCells::Tets(tets);
        solid
    }
}
