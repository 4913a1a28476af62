//! Quadratic tetrahedra: the corners of a linear mesh and the midpoints of its edges.

use nalgebra::Vector3;

use super::{TET_EDGES, TetMesh};

/// Straight-sided ten-node tetrahedra in their rest configuration.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Tet10Mesh {
    /// Rest positions [m]: first the nodes of the linear mesh, then the midpoints of its edges.
    pub nodes: Vec<Vector3<f64>>,
    /// Node ids of every tet: four corners, then the midpoints of [`TET_EDGES`].
    pub tets: Vec<[u32; 10]>,
    /// The two corners of every mid-edge node, smaller id first; sorted.
    pub edges: Vec<[u32; 2]>,
}

impl Tet10Mesh {
    /// Adds a node in the middle of every edge of `mesh`.
    pub fn new(mesh: &TetMesh) -> Self {
        let ends = |tet: &[u32; 4], [a, b]: [usize; 2]| {
            let (a, b) = (tet[a], tet[b]);
            [a.min(b), a.max(b)]
        };
        let mut edges: Vec<[u32; 2]> =
            mesh.tets.iter().flat_map(|tet| TET_EDGES.map(|edge| ends(tet, edge))).collect();
        edges.sort_unstable();
        edges.dedup();
        let middles = edges.iter().map(|&[a, b]| 0.5 * (mesh.nodes[a as usize] + mesh.nodes[b as usize]));
        let nodes = mesh.nodes.iter().copied().chain(middles).collect();
        let middle = |edge: [u32; 2]| (mesh.nodes.len() + edges.partition_point(|e| *e < edge)) as u32;
        let tets = mesh
            .tets
            .iter()
            .map(|tet| {
                std::array::from_fn(|a| if a < 4 { tet[a] } else { middle(ends(tet, TET_EDGES[a - 4])) })
            })
            .collect();
        Self { nodes, tets, edges }
    }

    /// Number of corner nodes, which come before all mid-edge nodes.
    pub fn n_corners(&self) -> usize {
        self.nodes.len() - self.edges.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{BoxPattern, box_mesh};

    #[test]
    fn middles_follow_the_corners_and_are_shared() {
        let mesh = box_mesh(Vector3::zeros(), Vector3::repeat(2.0), [2; 3], BoxPattern::Tet6);
        let quadratic = Tet10Mesh::new(&mesh);
        assert_eq!(quadratic.n_corners(), 27);
        // The nodes of the box with twice as many cells are exactly the corners and midpoints of Kuhn tets.
        assert_eq!(quadratic.nodes.len(), 125);
        for (tet, corners) in quadratic.tets.iter().zip(&mesh.tets) {
            assert_eq!(tet[..4], corners[..]);
            for (k, [a, b]) in TET_EDGES.into_iter().enumerate() {
                let x = |n: usize| quadratic.nodes[tet[n] as usize];
                assert_eq!(x(4 + k), 0.5 * (x(a) + x(b)));
            }
        }
    }
}
