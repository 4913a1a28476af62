//! Quadratic tetrahedra: mid-edge nodes follow the copies. They are not cut.

use nalgebra::Vector3;

use super::element::Element;
use crate::assembly::{ElementKind, Model, ModelError, Volumetric};
use crate::cut::CutMesh;
use crate::element::{Point, deformation_gradient, quadrature, tet10};
use crate::material::Material;
use crate::mesh::{TET_EDGES, Tet10Mesh, TetMesh};

/// Quadratic tetrahedra with these nodes.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct QuadraticTets(pub Tet10Mesh);

impl Element for QuadraticTets {
    fn kind(&self) -> ElementKind {
        ElementKind::Tet10
    }

    fn rest_positions(&self, _: &CutMesh) -> Vec<Vector3<f64>> {
        self.0.nodes.clone()
    }

    fn n_nodes(&self, _: &TetMesh) -> usize {
        self.0.nodes.len()
    }

    fn model(&self, cut: &CutMesh, material: &Material, how: Volumetric) -> Result<Model, ModelError> {
        if how != Volumetric::Full {
            return Err(ModelError::Remedy { element: ElementKind::Tet10, remedy: how });
        }
        Model::tet10(cut.mesh(), material)
    }

    fn areas(&self, mesh: &TetMesh, selected: &[bool]) -> Vec<f64> {
        let mut area = vec![0.0; selected.len()];
        let chosen = |nodes: &[u32; 3]| nodes.iter().all(|&n| selected[n as usize]);
        for face in mesh.boundary_faces() {
            let middles = self.middles(&mesh.tets[face.tet as usize], face.tet, &face.nodes);
            if chosen(&face.nodes) && chosen(&middles) {
                // On a straight-sided face ∫ N dA is 0 at corners and A/3 at middles.
                let third = mesh.face_area(&face) / 3.0;
                middles.iter().for_each(|&n| area[n as usize] += third);
            }
        }
        area
    }

    fn volumes(&self, mesh: &TetMesh, selected: &[bool]) -> Vec<f64> {
        let mut volume = vec![0.0; selected.len()];
        for (e, tet) in self.0.tets.iter().enumerate() {
            for (a, &n) in tet.iter().enumerate().filter(|(_, n)| selected[**n as usize]) {
                let integral = if a < 4 { tet10::INTEGRAL_CORNER } else { tet10::INTEGRAL_EDGE };
                volume[n as usize] += integral * mesh.volume(e);
            }
        }
        volume
    }

    fn carriers(&self, tet: u32, _: [u32; 4], weights: [f64; 4]) -> Vec<(u32, f64)> {
        let N = tet10::shape(&Vector3::new(weights[1], weights[2], weights[3]));
        self.0.tets[tet as usize].into_iter().zip(N).collect()
    }

    fn for_groups(&self, _: &CutMesh, visit: &mut dyn FnMut(&[u32])) {
        self.0.tets.iter().for_each(|tet| visit(tet));
    }

    fn for_points(&self, cut: &CutMesh, x: &[Vector3<f64>], visit: &mut dyn FnMut(Point<'_>)) {
        let rule = quadrature::tet_degree_2();
        for (element, tet) in self.0.tets.iter().enumerate() {
            let (volume, g) = (cut.mesh().volume(element), cut.mesh().gradients(element));
            for (xi, w) in &rule {
                let gradients = tet10::gradients(xi, &g);
                visit(Point {
                    element,
                    nodes: tet,
                    gradients: &gradients,
                    weight: w * volume,
                    F: deformation_gradient(&tet.map(|n| x[n as usize]), &gradients),
                    region: 0,
                });
            }
        }
    }
}

impl QuadraticTets {
    /// Mid-edge nodes of the three edges of a face.
    fn middles(&self, corners: &[u32; 4], tet: u32, face: &[u32; 3]) -> [u32; 3] {
        let local = face.map(|n| corners.iter().position(|&c| c == n).unwrap_or(0));
        [[0, 1], [1, 2], [2, 0]].map(|[i, j]| {
            let (a, b) = (local[i].min(local[j]), local[i].max(local[j]));
            let edge = TET_EDGES.iter().position(|e| [e[0].min(e[1]), e[0].max(e[1])] == [a, b]).unwrap_or(0);
            self.0.tets[tet as usize][4 + edge]
        })
    }
}
