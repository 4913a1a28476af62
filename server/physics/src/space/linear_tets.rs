//! Linear tetrahedra, cut or not: the copies are their only nodes.

use nalgebra::Vector3;
use scindo_algebra::assembly::{Model, ModelError, Volumetric};
use scindo_matter::cut::CutMesh;
use scindo_matter::element::ElementKind;
use scindo_matter::element::{Point, deformation_gradient};
use scindo_matter::material::Material;
use scindo_matter::mesh::TetMesh;

use super::element::Element;

/// Linear tetrahedra.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
pub struct LinearTets;

impl Element for LinearTets {
    fn kind(&self) -> ElementKind {
        ElementKind::Tet4
    }

    fn model(&self, cut: &CutMesh, material: &Material, how: Volumetric) -> Result<Model, ModelError> {
        Model::tet4_cut(cut, material, how)
    }

    fn areas(&self, mesh: &TetMesh, selected: &[bool]) -> Vec<f64> {
        let mut area = vec![0.0; selected.len()];
        for face in mesh.boundary_faces() {
            if face.nodes.iter().all(|&n| selected[n as usize]) {
                let third = mesh.face_area(&face) / 3.0;
                face.nodes.iter().for_each(|&n| area[n as usize] += third);
            }
        }
        area
    }

    fn volumes(&self, mesh: &TetMesh, selected: &[bool]) -> Vec<f64> {
        let mut volume = vec![0.0; selected.len()];
        for (e, tet) in mesh.tets.iter().enumerate() {
            for &n in tet.iter().filter(|&&n| selected[n as usize]) {
                volume[n as usize] += mesh.volume(e) / 4.0;
            }
        }
        volume
    }

    fn carriers(&self, cut: &CutMesh, piece: u32, weights: [f64; 4]) -> Vec<(u32, f64)> {
        cut.pieces()[piece as usize].copies.into_iter().zip(weights).collect()
    }

    fn for_points(&self, cut: &CutMesh, x: &[Vector3<f64>], visit: &mut dyn FnMut(Point<'_>)) {
        for (element, piece) in cut.pieces().iter().enumerate() {
            let tet = piece.element as usize;
            let gradients = cut.mesh().gradients(tet);
            visit(Point {
                element,
                nodes: &piece.copies,
                gradients: &gradients,
                weight: piece.fraction * cut.mesh().volume(tet),
                F: deformation_gradient(&piece.copies.map(|c| x[c as usize]), &gradients),
                region: 0,
            });
        }
    }
}
