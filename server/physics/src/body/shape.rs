//! What an element adds to the tetrahedra of surface and contact: more nodes, other shape functions,
//! other faces.

use nalgebra::Vector3;

use crate::assembly::{ElementKind, Model, ModelError, Volumetric};
use crate::cut::CutMesh;
use crate::element::{hex8, tet10};
use crate::material::Material;
use crate::mesh::{HexMesh, TET_EDGES, Tet10Mesh, TetMesh};

/// Tetrahedra per hexahedron in [`HexMesh::to_tets`].
const TETS_PER_HEX: usize = 6;

/// The element of a body, with the data it needs beside the tet mesh.
#[derive(Debug)]
pub(super) enum Shape {
    /// The tets themselves, with the copies as their only nodes.
    Tet4,
    /// Quadratic tets: mid-edge nodes follow the copies.
    Tet10(Tet10Mesh),
    /// Hexahedra, each split into six tets on the same nodes.
    Hex8(HexMesh),
}

impl Shape {
    /// The element's kind.
    pub fn kind(&self) -> ElementKind {
        match self {
            Shape::Tet4 => ElementKind::Tet4,
            Shape::Tet10(_) => ElementKind::Tet10,
            Shape::Hex8(_) => ElementKind::Hex8,
        }
    }

    /// Rest position [m] of every node: copies first, then the nodes that the element adds.
    pub fn rest_positions(&self, cut: &CutMesh) -> Vec<Vector3<f64>> {
        match self {
            Shape::Tet10(mesh) => mesh.nodes.clone(),
            Shape::Tet4 | Shape::Hex8(_) => cut.rest_positions(),
        }
    }

    /// The discrete model of the general path.
    pub fn model(
        &self,
        cut: &CutMesh,
        material: &Material,
        volumetric: Volumetric,
    ) -> Result<Model, ModelError> {
        match self {
            Shape::Tet4 => Model::tet4_cut(cut, material, volumetric),
            Shape::Tet10(_) if volumetric != Volumetric::Full => {
                Err(ModelError::Remedy { element: ElementKind::Tet10, remedy: volumetric })
            }
            Shape::Tet10(_) => Model::tet10(cut.mesh(), material),
            Shape::Hex8(mesh) => Model::hex8(mesh, material, volumetric),
        }
    }

    /// ∫ N_a dA [m²] over the skin faces all of whose nodes are `selected`, by node.
    pub fn areas(&self, mesh: &TetMesh, selected: &[bool]) -> Vec<f64> {
        let mut area = vec![0.0; selected.len()];
        let chosen = |nodes: &[u32]| nodes.iter().all(|&n| selected[n as usize]);
        if let Shape::Hex8(hexes) = self {
            for quad in skin_of(hexes).iter().filter(|quad| chosen(&quad[..])) {
                add_quad(hexes, quad, &mut area);
            }
            return area;
        }
        for face in mesh.boundary_faces() {
            let third = mesh.face_area(&face) / 3.0;
            match self {
                Shape::Tet10(quadratic) => {
                    let middles = middles_of(quadratic, &mesh.tets[face.tet as usize], face.tet, &face.nodes);
                    if chosen(&face.nodes) && chosen(&middles) {
                        // On a straight-sided face ∫ N dA is 0 at corners and A/3 at middles.
                        middles.iter().for_each(|&n| area[n as usize] += third);
                    }
                }
                _ if chosen(&face.nodes) => face.nodes.iter().for_each(|&n| area[n as usize] += third),
                _ => {}
            }
        }
        area
    }

    /// Nodes and shape functions (Σ = 1) of the point with barycentric coordinates `weights` in tet
    /// `tet`, whose piece is on `copies`.
    pub fn carriers(&self, tet: u32, copies: [u32; 4], weights: [f64; 4]) -> Vec<(u32, f64)> {
        match self {
            Shape::Tet4 => copies.into_iter().zip(weights).collect(),
            Shape::Tet10(mesh) => {
                let N = tet10::shape(&Vector3::new(weights[1], weights[2], weights[3]));
                mesh.tets[tet as usize].into_iter().zip(N).collect()
            }
            Shape::Hex8(mesh) => {
                let hex = tet as usize / TETS_PER_HEX;
                let X = copies.iter().zip(weights).map(|(&n, w)| w * mesh.nodes[n as usize]).sum();
                let N = hex8::shape(&reference_point(&mesh.corners(hex), X));
                mesh.hexes[hex].into_iter().zip(N).collect()
            }
        }
    }

    /// Number of elements at rest; hexahedra count as one each, not as six tets.
    pub fn n_elements(&self, mesh: &TetMesh) -> usize {
        match self {
            Shape::Hex8(mesh) => mesh.hexes.len(),
            Shape::Tet4 | Shape::Tet10(_) => mesh.tets.len(),
        }
    }

    /// Element of the model that contains tet `tet` of the mesh.
    pub fn element_of(&self, tet: usize) -> usize {
        match self {
            Shape::Hex8(_) => tet / TETS_PER_HEX,
            Shape::Tet4 | Shape::Tet10(_) => tet,
        }
    }
}

/// Mid-edge nodes of the three edges of a face.
fn middles_of(mesh: &Tet10Mesh, corners: &[u32; 4], tet: u32, face: &[u32; 3]) -> [u32; 3] {
    let local = face.map(|n| corners.iter().position(|&c| c == n).unwrap_or(0));
    [[0, 1], [1, 2], [2, 0]].map(|[i, j]| {
        let (a, b) = (local[i].min(local[j]), local[i].max(local[j]));
        let edge = TET_EDGES.iter().position(|e| [e[0].min(e[1]), e[0].max(e[1])] == [a, b]).unwrap_or(0);
        mesh.tets[tet as usize][4 + edge]
    })
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

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::mesh::{BoxPattern, box_hexes, box_mesh};

    const SIZE: Vector3<f64> = Vector3::new(1.0, 2.0, 3.0);

    fn shapes() -> [(TetMesh, Shape); 3] {
        let tets = box_mesh(Vector3::zeros(), SIZE, [2, 2, 3], BoxPattern::Tet6);
        let hexes = box_hexes(Vector3::zeros(), SIZE, [2, 2, 3]);
        [
            (tets.clone(), Shape::Tet4),
            (tets.clone(), Shape::Tet10(Tet10Mesh::new(&tets))),
            (hexes.to_tets(), Shape::Hex8(hexes)),
        ]
    }

    #[test]
    fn loads_on_a_face_have_its_area_and_its_middle() {
        for (mesh, shape) in shapes() {
            let cut = CutMesh::new(mesh.clone()).unwrap();
            let rest = shape.rest_positions(&cut);
            let top: Vec<bool> = rest.iter().map(|X| X.z > 3.0 - 1e-9).collect();
            let area = shape.areas(&mesh, &top);
            assert!((area.iter().sum::<f64>() - 2.0).abs() < 1e-12, "{:?}", shape.kind());
            let middle: Vector3<f64> = area.iter().zip(&rest).map(|(a, X)| *a * X).sum();
            assert!((middle / 2.0 - Vector3::new(0.5, 1.0, 3.0)).norm() < 1e-12, "{:?}", shape.kind());
        }
    }

    #[test]
    fn carriers_reproduce_the_point_they_carry() {
        for (mesh, shape) in shapes() {
            let rest = shape.rest_positions(&CutMesh::new(mesh.clone()).unwrap());
            for (e, tet) in mesh.tets.iter().enumerate().step_by(7) {
                let weights = [0.1, 0.2, 0.3, 0.4];
                let X: Vector3<f64> = mesh.corners(e).iter().zip(weights).map(|(X, w)| w * X).sum();
                let carriers = shape.carriers(e as u32, *tet, weights);
                let found: Vector3<f64> = carriers.iter().map(|(n, N)| *N * rest[*n as usize]).sum();
                assert!((found - X).norm() < 1e-12, "{:?} {e}", shape.kind());
            }
        }
    }
}
