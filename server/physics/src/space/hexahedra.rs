//! Trilinear hexahedra. For surface and contact each is split into six tetrahedra on the same nodes. They are
//! not cut.

use nalgebra::Vector3;
use scindo_algebra::assembly::{Model, ModelError, Volumetric};
use scindo_matter::cut::{CutMesh, Piece};
use scindo_matter::element::ElementKind;
use scindo_matter::element::{MaterialPoint, Point, deformation_gradient, hex8, quadrature};
use scindo_matter::material::Material;
use scindo_matter::mesh::{HexMesh, TetMesh};
use scindo_matter::octree::Octree;

use super::element::Element;

/// Tetrahedra per hexahedron in [`HexMesh::to_tets`].
const TETS_PER_HEX: usize = 6;

/// Hexahedra with these nodes.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct Hexahedra(pub HexMesh);

impl Element for Hexahedra {
    fn kind(&self) -> ElementKind {
        ElementKind::Hex8
    }

    fn n_elements(&self, _: &TetMesh) -> usize {
        self.0.hexes.len()
    }

    fn element_of(&self, p: usize) -> usize {
        p / TETS_PER_HEX
    }

    fn model(&self, _: &CutMesh, material: &Material, how: Volumetric) -> Result<Model, ModelError> {
        Model::hex8(&self.0, material, how)
    }

    fn areas(&self, _: &TetMesh, selected: &[bool]) -> Vec<f64> {
        let mut area = vec![0.0; selected.len()];
        let chosen = |quad: &&[u32; 4]| quad.iter().all(|&n| selected[n as usize]);
        for quad in skin_of(&self.0).iter().filter(chosen) {
            add_quad(&self.0, quad, &mut area);
        }
        area
    }

    fn for_skin_faces(
        &self,
        _: &CutMesh,
        is_chosen: &dyn Fn(u32) -> bool,
        visit: &mut dyn FnMut(&[MaterialPoint]),
    ) {
        for quad in skin_of(&self.0).into_iter().filter(|quad| quad.iter().all(|&n| is_chosen(n))) {
            // The corners of the list run clockwise seen from outside.
            let [a, b, c, d] = quad.map(|n| MaterialPoint::new([(n, 1.0)]));
            visit(&[a, d, c, b]);
        }
    }

    fn volumes(&self, _: &TetMesh, selected: &[bool]) -> Vec<f64> {
        let mut volume = vec![0.0; selected.len()];
        for (e, hex) in self.0.hexes.iter().enumerate() {
            // The shape functions sum to one, so row sums of their products are their integrals.
            for (row, &n) in hex8::shape_products(&self.0.corners(e)).iter().zip(hex) {
                if selected[n as usize] {
                    volume[n as usize] += row.iter().sum::<f64>();
                }
            }
        }
        volume
    }

    fn carriers(&self, cut: &CutMesh, piece: u32, weights: [f64; 4]) -> Vec<(u32, f64)> {
        let Piece { element, copies, .. } = cut.pieces()[piece as usize];
        let hex = element as usize / TETS_PER_HEX;
        let X = copies.iter().zip(weights).map(|(&n, w)| w * self.0.nodes[n as usize]).sum();
        let N = hex8::shape(&reference_point(&self.0.corners(hex), X));
        self.0.hexes[hex].into_iter().zip(N).collect()
    }

    fn cubes(&self) -> Option<Octree> {
        Octree::of_cubes(&self.0)
    }

    fn for_groups(&self, _: &CutMesh, visit: &mut dyn FnMut(&[u32])) {
        self.0.hexes.iter().for_each(|hex| visit(hex));
    }

    fn for_points(&self, _: &CutMesh, x: &[Vector3<f64>], visit: &mut dyn FnMut(Point<'_>)) {
        let rule = quadrature::cube_gauss_2();
        for (element, hex) in self.0.hexes.iter().enumerate() {
            for xi in &rule {
                if let Some((gradients, weight)) = hex8::gradients(&self.0.corners(element), xi) {
                    visit(Point {
                        element,
                        nodes: hex,
                        gradients: &gradients,
                        weight,
                        F: deformation_gradient(&hex.map(|n| x[n as usize]), &gradients),
                        region: 0,
                    });
                }
            }
        }
    }
}

/// Corners of the six faces of a hexahedron, around each face.
const FACES: [[usize; 4]; 6] =
    [[0, 2, 6, 4], [1, 5, 7, 3], [0, 4, 5, 1], [2, 3, 7, 6], [0, 1, 3, 2], [4, 6, 7, 5]];

/// Faces that belong to exactly one hexahedron, in the order of the hexahedra.
fn skin_of(mesh: &HexMesh) -> Vec<[u32; 4]> {
    let mut keyed: Vec<([u32; 4], usize, [u32; 4])> = Vec::with_capacity(6 * mesh.hexes.len());
    for hex in &mesh.hexes {
        for face in FACES {
            let nodes = face.map(|c| hex[c]);
            let mut key = nodes;
            key.sort_unstable();
            keyed.push((key, keyed.len(), nodes));
        }
    }
    keyed.sort_unstable();
    let mut skin: Vec<(usize, [u32; 4])> = keyed
        .chunk_by(|a, b| a.0 == b.0)
        .filter(|same| same.len() == 1)
        .map(|same| (same[0].1, same[0].2))
        .collect();
    skin.sort_unstable();
    skin.into_iter().map(|(_, nodes)| nodes).collect()
}

/// ∫ N_a dA of a bilinear face by 2×2 Gauss points.
fn add_quad(mesh: &HexMesh, quad: &[u32; 4], area: &mut [f64]) {
    let X = quad.map(|n| mesh.nodes[n as usize]);
    let g = 1.0 / 3.0_f64.sqrt();
    for (s, t) in [(-g, -g), (g, -g), (g, g), (-g, g)] {
        let sign = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
        let (mut along_s, mut along_t) = (Vector3::zeros(), Vector3::zeros());
        for (X, (a, b)) in X.iter().zip(sign) {
            along_s += 0.25 * a * (1.0 + b * t) * X;
            along_t += 0.25 * b * (1.0 + a * s) * X;
        }
        let dA = along_s.cross(&along_t).norm();
        for (&n, (a, b)) in quad.iter().zip(sign) {
            area[n as usize] += 0.25 * (1.0 + a * s) * (1.0 + b * t) * dA;
        }
    }
}

/// ξ with Σ N_c(ξ) X_c = X, by Newton's method; exact after one step on a parallelepiped.
fn reference_point(corners: &[Vector3<f64>; 8], X: Vector3<f64>) -> Vector3<f64> {
    let mut xi = Vector3::zeros();
    for _ in 0..20 {
        let at: Vector3<f64> = corners.iter().zip(hex8::shape(&xi)).map(|(c, N)| N * c).sum();
        let Some(inverse) = hex8::jacobian(corners, &xi).try_inverse() else { return xi };
        let step = inverse * (X - at);
        xi += step;
        if step.norm() < 1e-13 {
            break;
        }
    }
    xi
}
