//! The linear tetrahedra from which stress is recovered: those of a model, or the pieces of a body.

use nalgebra::Vector3;
use scindo_algebra::assembly::Model;
use scindo_matter::cut::Piece;
use scindo_matter::element::ElementKind;
use scindo_matter::material::{Lame, Regions};
use scindo_matter::mesh::TetMesh;

/// Linear tetrahedra whose corners are copies.
pub trait Tets {
    /// Number of tetrahedra or pieces.
    fn count(&self) -> usize;
    /// Number of copies.
    fn n_copies(&self) -> usize;
    /// Copies, rest gradients ∇N_a [1/m] and rest volume [m³] of piece `e`.
    fn tet(&self, e: usize) -> ([u32; 4], [Vector3<f64>; 4], f64);
    /// Whether there are regions of other materials.
    fn has_regions(&self) -> bool;
    /// Region of piece `e`; 0 is the material of the body.
    fn region(&self, e: usize) -> u16;
    /// Lamé constants [Pa] of a region of a body whose own are `lame`.
    fn lame(&self, region: u16, lame: Lame) -> Lame;
}

/// The pieces of a body.
#[derive(Clone, Copy, Debug)]
pub struct CutTets<'a> {
    mesh: &'a TetMesh,
    pieces: &'a [Piece],
    n_copies: usize,
    regions: &'a Regions,
}

impl<'a> CutTets<'a> {
    /// The `pieces` of linear tetrahedra of a body with rest mesh `mesh` and `n_copies` copies. `regions` are those of
    /// the tetrahedra of `mesh`.
    pub fn new(mesh: &'a TetMesh, pieces: &'a [Piece], n_copies: usize, regions: &'a Regions) -> Self {
        Self { mesh, pieces, n_copies, regions }
    }
}

impl Tets for CutTets<'_> {
    fn count(&self) -> usize {
        self.pieces.len()
    }

    fn n_copies(&self) -> usize {
        self.n_copies
    }

    fn tet(&self, e: usize) -> ([u32; 4], [Vector3<f64>; 4], f64) {
        let Piece { element, fraction, copies } = self.pieces[e];
        let element = element as usize;
        (copies, self.mesh.gradients(element), fraction * self.mesh.volume(element))
    }

    fn has_regions(&self) -> bool {
        !self.regions.is_empty()
    }

    fn region(&self, e: usize) -> u16 {
        self.regions.of(self.pieces[e].element as usize)
    }

    fn lame(&self, region: u16, lame: Lame) -> Lame {
        self.regions.lame(region, lame)
    }
}

/// The linear tetrahedra of a model. A model with other elements has none.
impl Tets for Model {
    fn count(&self) -> usize {
        if self.kind() == ElementKind::Tet4 { self.n_elements() } else { 0 }
    }

    fn n_copies(&self) -> usize {
        self.n_nodes()
    }

    fn tet(&self, e: usize) -> ([u32; 4], [Vector3<f64>; 4], f64) {
        let (nodes, gradients) = (self.element(e), self.gradients(e, 0));
        (std::array::from_fn(|a| nodes[a]), std::array::from_fn(|a| gradients[a]), self.volume(e))
    }

    fn has_regions(&self) -> bool {
        !self.element_regions().is_empty()
    }

    fn region(&self, e: usize) -> u16 {
        self.element_regions().of(e)
    }

    fn lame(&self, region: u16, lame: Lame) -> Lame {
        self.element_regions().lame(region, lame)
    }
}
