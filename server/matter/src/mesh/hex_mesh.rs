//! Hexahedral meshes with eight nodes per element.

use nalgebra::Vector3;

use super::{DEGENERATE_VOLUME, MeshError, TetMesh, box_mesh::split_cells};
use crate::element::hex8;

/// Trilinear hexahedra in their rest configuration.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct HexMesh {
    /// Rest positions [m], length n_nodes.
    pub nodes: Vec<Vector3<f64>>,
    /// Node ids of every hexahedron: corner c = a + 2 b + 4 d with a, b, d ∈ {0, 1} along its own
    /// right-handed axes.
    pub hexes: Vec<[u32; 8]>,
}

impl HexMesh {
    /// Checks that the mesh can be simulated: finite nodes, indices in range, every node used, det J > 0 at
    /// every corner and in the middle of every element.
    pub fn check(&self) -> Result<(), MeshError> {
        if self.hexes.is_empty() {
            return Err(MeshError::Empty);
        }
        let limit = u32::MAX as usize / 8;
        if self.nodes.len() > limit || self.hexes.len() > limit {
            let found = self.nodes.len().max(self.hexes.len());
            return Err(MeshError::TooLarge { found, limit });
        }
        if let Some(node) = self.nodes.iter().position(|x| !x.iter().all(|c| c.is_finite())) {
            return Err(MeshError::NonFinite { node, position_m: self.nodes[node].into() });
        }
        let mut used = vec![false; self.nodes.len()];
        for (element, hex) in self.hexes.iter().enumerate() {
            for (a, &node) in hex.iter().enumerate() {
                if node as usize >= self.nodes.len() {
                    return Err(MeshError::NodeOutOfRange { tet: element, node, n_nodes: self.nodes.len() });
                }
                if hex[..a].contains(&node) {
                    return Err(MeshError::RepeatedNode { tet: element, node });
                }
                used[node as usize] = true;
            }
            self.check_shape(element)?;
        }
        match used.iter().position(|&u| !u) {
            Some(node) => Err(MeshError::UnusedNode { node }),
            None => Ok(()),
        }
    }

    fn check_shape(&self, element: usize) -> Result<(), MeshError> {
        let X = self.corners(element);
        let size = (0..8).map(|c| (X[c] - X[0]).norm()).fold(0.0, f64::max);
        let least_m3 = DEGENERATE_VOLUME * size.powi(3);
        let corners = (0..8).map(hex8::corner);
        for xi in corners.chain(std::iter::once(Vector3::zeros())) {
            // 8 det J is the volume the element would have if the Jacobian were the same everywhere.
            let volume_m3 = 8.0 * hex8::jacobian(&X, &xi).determinant();
            if volume_m3.abs() <= least_m3 {
                return Err(MeshError::Degenerate { tet: element, volume_m3, least_m3 });
            }
            if volume_m3 < 0.0 {
                return Err(MeshError::Inverted { tet: element, volume_m3 });
            }
        }
        Ok(())
    }

    /// Rest positions [m] of the corners of element `e`.
    pub fn corners(&self, e: usize) -> [Vector3<f64>; 8] {
        self.hexes[e].map(|n| self.nodes[n as usize])
    }

    /// Divides every element into six tetrahedra around its diagonal 0–7, on the same nodes. For
    /// [`box_hexes`] the result is [`box_mesh`](super::box_mesh) with
    /// [`BoxPattern::Tet6`](super::BoxPattern). Faces match where neighbours have parallel axes.
    pub fn to_tets(&self) -> TetMesh {
        TetMesh { nodes: self.nodes.clone(), tets: split_cells(&self.nodes, &self.hexes) }
    }
}

/// Hexahedra of the box from `min` to `max` [m] with `cells` cells along x, y, z.
///
/// Node id = i + (nx+1)·(j + (ny+1)·k), as [`box_mesh`](super::box_mesh); elements in cell order.
pub fn box_hexes(min: Vector3<f64>, max: Vector3<f64>, cells: [usize; 3]) -> HexMesh {
    let ticks = |axis: usize| -> Vec<f64> {
        let n = cells[axis];
        (0..=n).map(|i| min[axis] + (max[axis] - min[axis]) * (i as f64 / n as f64)).collect()
    };
    if cells.contains(&0) {
        return HexMesh::default();
    }
    graded_hexes(&ticks(0), &ticks(1), &ticks(2))
}

/// Hexahedra of a box whose cell boundaries lie at the ascending coordinates `x`, `y`, `z` [m].
pub fn graded_hexes(x: &[f64], y: &[f64], z: &[f64]) -> HexMesh {
    let mut mesh = HexMesh::default();
    for &z in z {
        for &y in y {
            mesh.nodes.extend(x.iter().map(|&x| Vector3::new(x, y, z)));
        }
    }
    let node = |i: usize, j: usize, k: usize| (i + x.len() * (j + y.len() * k)) as u32;
    for k in 1..z.len() {
        for j in 1..y.len() {
            for i in 1..x.len() {
                mesh.hexes.push(std::array::from_fn(|c| {
                    node(i - 1 + (c & 1), j - 1 + ((c >> 1) & 1), k - 1 + ((c >> 2) & 1))
                }));
            }
        }
    }
    mesh
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::mesh::{BoxPattern, box_mesh};

    #[test]
    fn a_box_has_the_nodes_and_the_splits_of_the_tet_box() {
        let (min, max, cells) = (Vector3::new(-0.1, 0.2, 0.0), Vector3::new(1.0, 0.9, 0.3), [4, 3, 2]);
        let hexes = box_hexes(min, max, cells);
        hexes.check().unwrap();
        assert_eq!((hexes.nodes.len(), hexes.hexes.len()), (60, 24));
        let tets = box_mesh(min, max, cells, BoxPattern::Tet6);
        let split = hexes.to_tets();
        split.check().unwrap();
        assert_eq!(split.tets, tets.tets);
        assert!(split.nodes.iter().zip(&tets.nodes).all(|(a, b)| (a - b).norm() < 1e-15));
    }

    #[test]
    fn unusable_meshes_are_refused() {
        let mut mesh = box_hexes(Vector3::zeros(), Vector3::repeat(1.0), [1, 1, 2]);
        mesh.hexes[1].swap(0, 1);
        assert!(matches!(
            mesh.check(),
            Err(MeshError::Inverted { tet: 1, .. } | MeshError::Degenerate { tet: 1, .. })
        ));
        assert_eq!(
            box_hexes(Vector3::zeros(), Vector3::repeat(1.0), [1, 0, 1]).check(),
            Err(MeshError::Empty)
        );
        let flat = box_hexes(Vector3::zeros(), Vector3::new(1.0, 1.0, 0.0), [1; 3]);
        assert!(matches!(flat.check(), Err(MeshError::Degenerate { .. })));
    }
}
