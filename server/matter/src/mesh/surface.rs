//! The outer faces of the rest mesh.

use super::{TET_FACES, TetMesh};
use nalgebra::Vector3;

/// A triangle that belongs to exactly one tet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BoundaryFace {
    /// The tet whose face it is.
    pub tet: u32,
    /// Local number of the node of that tet opposite this face, 0..4.
    pub opposite: u8,
    /// Node ids, counter-clockwise seen from outside.
    pub nodes: [u32; 3],
}

impl TetMesh {
    /// Faces with only one tet, sorted by tet and local face number.
    pub fn boundary_faces(&self) -> Vec<BoundaryFace> {
        let mut keyed: Vec<([u32; 3], BoundaryFace)> = Vec::with_capacity(4 * self.tets.len());
        for (e, tet) in self.tets.iter().enumerate() {
            for (a, face) in TET_FACES.iter().enumerate() {
                let nodes = face.map(|b| tet[b]);
                let mut key = nodes;
                key.sort_unstable();
                let face = BoundaryFace { tet: e as u32, opposite: a as u8, nodes };
                keyed.push((key, face));
            }
        }
        keyed.sort_unstable_by_key(|(key, face)| (*key, face.tet));
        let mut skin: Vec<BoundaryFace> = keyed
            .chunk_by(|(a, _), (b, _)| a == b)
            .filter(|same| same.len() == 1)
            .map(|same| same[0].1)
            .collect();
        skin.sort_unstable_by_key(|face| (face.tet, face.opposite));
        skin
    }

    /// Area [m²] of a face at rest.
    pub fn face_area(&self, face: &BoundaryFace) -> f64 {
        let [p, q, r]: [Vector3<f64>; 3] = face.nodes.map(|n| self.nodes[n as usize]);
        0.5 * (q - p).cross(&(r - p)).norm()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{BoxPattern, box_mesh};

    #[test]
    fn the_skin_of_a_box_is_closed_and_has_its_area() {
        let size = Vector3::new(1.0, 2.0, 3.0);
        let mesh = box_mesh(Vector3::zeros(), size, [2, 3, 4], BoxPattern::Tet6);
        let skin = mesh.boundary_faces();
        let area: f64 = skin.iter().map(|f| mesh.face_area(f)).sum();
        assert!((area - 22.0).abs() < 1e-12);
        let enclosed: f64 = skin
            .iter()
            .map(|f| {
                let [p, q, r] = f.nodes.map(|n| mesh.nodes[n as usize]);
                p.dot(&q.cross(&r)) / 6.0
            })
            .sum();
        assert!((enclosed - 6.0).abs() < 1e-12);
    }
}
