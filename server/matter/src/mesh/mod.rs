//! The rest mesh: nodes, linear tetrahedra, their volumes and their orientation.
//!
//! The rest of the crate only *reads* a mesh. Cutting separates material inside the elements and never edits
//! this structure; cutting along faces ([`crate::cut::remesh`]) makes a new mesh.

mod box_mesh;
mod error;
mod hex_mesh;
mod quality;
mod surface;
mod tet10_mesh;

pub use box_mesh::{BoxPattern, box_mesh};
pub use error::MeshError;
pub use hex_mesh::{HexMesh, box_hexes, graded_hexes};
pub use quality::{MeshQuality, TetQuality};
pub use surface::BoundaryFace;
pub use tet10_mesh::Tet10Mesh;

use nalgebra::Vector3;

/// A tet with a volume below this fraction of (longest edge)³ has no usable gradient.
///
/// A needle of aspect 1e-4 still has 1e-8, a regular tet 0.118; rounding of the determinant is
/// about 1e-15.
pub const DEGENERATE_VOLUME: f64 = 1e-12;

pub use crate::element::TET_EDGES;

/// Face `a` lies opposite local node `a`; counter-clockwise from outside for a positive tet.
pub const TET_FACES: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];

/// Linear tetrahedra in their rest configuration.
///
/// ```
/// use nalgebra::Vector3;
/// use scindo_matter::mesh::TetMesh;
///
/// let corners = [Vector3::zeros(), Vector3::x(), Vector3::y(), Vector3::z()];
/// let mesh = TetMesh { nodes: corners.to_vec(), tets: vec![[0, 1, 2, 3]] };
/// mesh.check()?;
/// assert!((mesh.volume(0) - 1.0 / 6.0).abs() < 1e-15); // m³
///
/// let turned_inside_out = TetMesh { tets: vec![[1, 0, 2, 3]], ..mesh };
/// assert!(turned_inside_out.check().is_err());
/// # Ok::<(), scindo_matter::mesh::MeshError>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct TetMesh {
    /// Rest positions [m], length n_nodes.
    pub nodes: Vec<Vector3<f64>>,
    /// Node ids of every tet, positively oriented: (x1-x0)·((x2-x0)×(x3-x0)) > 0.
    pub tets: Vec<[u32; 4]>,
}

/// Counts of what [`TetMesh::repaired`] changed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MeshRepairs {
    /// Tets that were listed with negative orientation and had two nodes swapped.
    pub flipped_tets: usize,
    /// Nodes that no tet uses and that were removed.
    pub dropped_nodes: usize,
}

impl TetMesh {
    /// Builds a mesh from raw arrays. It flips negatively oriented tets, drops unused nodes, and refuses a
    /// mesh that cannot be simulated.
    pub fn repaired(nodes: Vec<Vector3<f64>>, tets: Vec<[u32; 4]>) -> Result<(Self, MeshRepairs), MeshError> {
        let mut mesh = Self { nodes, tets };
        mesh.check_nodes_and_indices()?;
        let mut repairs = MeshRepairs::default();
        for e in 0..mesh.tets.len() {
            if mesh.volume(e) < 0.0 {
                mesh.tets[e].swap(2, 3);
                repairs.flipped_tets += 1;
            }
        }
        repairs.dropped_nodes = mesh.drop_unused_nodes();
        mesh.check()?;
        Ok((mesh, repairs))
    }

    /// Checks that the mesh can be simulated: finite nodes, indices in range, every node used, every tet
    /// positively oriented and of usable volume.
    pub fn check(&self) -> Result<(), MeshError> {
        self.check_nodes_and_indices()?;
        for e in 0..self.tets.len() {
            let volume = self.volume(e);
            let least = DEGENERATE_VOLUME * self.longest_edge(e).powi(3);
            if volume.abs() <= least {
                return Err(MeshError::Degenerate { tet: e, volume_m3: volume, least_m3: least });
            }
            if volume < 0.0 {
                return Err(MeshError::Inverted { tet: e, volume_m3: volume });
            }
        }
        let mut used = vec![false; self.nodes.len()];
        for &node in self.tets.iter().flatten() {
            used[node as usize] = true;
        }
        match used.iter().position(|&u| !u) {
            Some(node) => Err(MeshError::UnusedNode { node }),
            None => Ok(()),
        }
    }

    fn check_nodes_and_indices(&self) -> Result<(), MeshError> {
        if self.tets.is_empty() {
            return Err(MeshError::Empty);
        }
        let limit = u32::MAX as usize / 8;
        if self.nodes.len() > limit || self.tets.len() > limit {
            let found = self.nodes.len().max(self.tets.len());
            return Err(MeshError::TooLarge { found, limit });
        }
        if let Some(node) = self.nodes.iter().position(|x| !x.iter().all(|c| c.is_finite())) {
            return Err(MeshError::NonFinite { node, position_m: self.nodes[node].into() });
        }
        for (tet, nodes) in self.tets.iter().enumerate() {
            for (a, &node) in nodes.iter().enumerate() {
                if node as usize >= self.nodes.len() {
                    return Err(MeshError::NodeOutOfRange { tet, node, n_nodes: self.nodes.len() });
                }
                if nodes[..a].contains(&node) {
                    return Err(MeshError::RepeatedNode { tet, node });
                }
            }
        }
        Ok(())
    }

    /// Removes nodes that no tet uses, keeps the order of the others, and returns the number removed.
    pub fn drop_unused_nodes(&mut self) -> usize {
        let mut used = vec![false; self.nodes.len()];
        for &node in self.tets.iter().flatten() {
            used[node as usize] = true;
        }
        let mut next = 0;
        let renumbered: Vec<u32> = used
            .iter()
            .map(|&u| {
                let id = next;
                next += u32::from(u);
                id
            })
            .collect();
        let before = self.nodes.len();
        let mut at = used.iter();
        self.nodes.retain(|_| *at.next().unwrap_or(&true));
        for node in self.tets.iter_mut().flatten() {
            *node = renumbered[*node as usize];
        }
        before - self.nodes.len()
    }

    /// Rest positions [m] of the four corners of tet `e`.
    pub fn corners(&self, e: usize) -> [Vector3<f64>; 4] {
        self.tets[e].map(|n| self.nodes[n as usize])
    }

    /// Signed rest volume [m³] of tet `e`, positive if it is well oriented.
    pub fn volume(&self, e: usize) -> f64 {
        tet_volume(&self.corners(e))
    }

    /// Signed rest volumes [m³], length n_tets.
    pub fn volumes(&self) -> Vec<f64> {
        (0..self.tets.len()).map(|e| self.volume(e)).collect()
    }

    /// Gradients g_a = ∇N_a [1/m] of the linear shape functions on tet `e`; Σ g_a = 0.
    pub fn gradients(&self, e: usize) -> [Vector3<f64>; 4] {
        tet_gradients(&self.corners(e))
    }

    /// Length [m] of the longest edge of tet `e`.
    pub fn longest_edge(&self, e: usize) -> f64 {
        let x = self.corners(e);
        TET_EDGES.iter().map(|&[a, b]| (x[b] - x[a]).norm()).fold(0.0, f64::max)
    }

    /// Smallest and largest corner [m] of the box around all nodes.
    pub fn bounds(&self) -> [Vector3<f64>; 2] {
        let mut low = Vector3::repeat(f64::INFINITY);
        let mut high = Vector3::repeat(f64::NEG_INFINITY);
        for x in &self.nodes {
            low = low.inf(x);
            high = high.sup(x);
        }
        [low, high]
    }
}

/// Signed volume [m³] of the tet with corners `x`.
pub fn tet_volume(x: &[Vector3<f64>; 4]) -> f64 {
    (x[1] - x[0]).dot(&(x[2] - x[0]).cross(&(x[3] - x[0]))) / 6.0
}

/// Shape function gradients g_a [1/m] of the tet with corners `x`:
/// g_1 = (e_2 × e_3)/det, cyclic, g_0 = −(g_1 + g_2 + g_3), with e_a = x_a − x_0, det = 6 V.
pub fn tet_gradients(x: &[Vector3<f64>; 4]) -> [Vector3<f64>; 4] {
    let [e1, e2, e3] = [x[1] - x[0], x[2] - x[0], x[3] - x[0]];
    let det = e1.dot(&e2.cross(&e3));
    let g1 = e2.cross(&e3) / det;
    let g2 = e3.cross(&e1) / det;
    let g3 = e1.cross(&e2) / det;
    [-(g1 + g2 + g3), g1, g2, g3]
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn corner_tet() -> Vec<Vector3<f64>> {
        vec![Vector3::zeros(), Vector3::x(), Vector3::y(), Vector3::z()]
    }

    #[test]
    fn gradients_are_dual_to_the_corners() {
        let x = [
            Vector3::new(0.1, 0.2, -0.3),
            Vector3::new(1.1, 0.1, 0.2),
            Vector3::new(-0.2, 1.4, 0.3),
            Vector3::new(0.3, 0.1, 0.9),
        ];
        let g = tet_gradients(&x);
        let centre = (x[0] + x[1] + x[2] + x[3]) / 4.0;
        for (a, g_a) in g.iter().enumerate() {
            for (b, x_b) in x.iter().enumerate() {
                let n_a_at_b = 0.25 + g_a.dot(&(x_b - centre));
                assert!((n_a_at_b - f64::from(a == b)).abs() < 1e-14);
            }
        }
    }

    #[test]
    fn faces_point_outwards() {
        let x = corner_tet();
        for (a, face) in TET_FACES.iter().enumerate() {
            let [p, q, r] = face.map(|n| x[n]);
            assert!((q - p).cross(&(r - p)).dot(&(x[a] - p)) < 0.0, "face {a}");
        }
    }

    #[test]
    fn repair_flips_and_drops() {
        let mut nodes = corner_tet();
        nodes.insert(1, Vector3::repeat(7.0));
        let (mesh, repairs) = TetMesh::repaired(nodes, vec![[0, 2, 4, 3]]).unwrap();
        assert_eq!((repairs.flipped_tets, repairs.dropped_nodes), (1, 1));
        assert!(mesh.volume(0) > 0.0);
        assert_eq!(mesh.nodes, corner_tet());
    }

    #[test]
    fn unusable_meshes_are_refused_with_the_place() {
        let flat = vec![Vector3::zeros(), Vector3::x(), Vector3::y(), Vector3::new(1.0, 1.0, 1e-14)];
        let refused = |nodes, tets| TetMesh::repaired(nodes, tets).unwrap_err();
        assert!(matches!(refused(flat, vec![[0, 1, 2, 3]]), MeshError::Degenerate { tet: 0, .. }));
        assert!(matches!(refused(corner_tet(), vec![]), MeshError::Empty));
        assert!(matches!(
            refused(corner_tet(), vec![[0, 1, 2, 4]]),
            MeshError::NodeOutOfRange { node: 4, .. }
        ));
        assert!(matches!(refused(corner_tet(), vec![[0, 1, 2, 2]]), MeshError::RepeatedNode { node: 2, .. }));
        let mut broken = corner_tet();
        broken[2].y = f64::NAN;
        assert!(matches!(refused(broken, vec![[0, 1, 2, 3]]), MeshError::NonFinite { node: 2, .. }));
    }
}
