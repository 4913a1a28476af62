//! A total force shared over nodes.

use nalgebra::Vector3;
use scindo_physics::mesh::TetMesh;

use crate::scene::checked::Share;

/// Shares `total_n` [N] over `nodes` (ascending): by the area of the boundary faces whose three
/// nodes are all selected, or by the volume of the elements around each node.
///
/// Without a wish it goes by area, and by volume where the selection holds no whole boundary face.
/// The shares of a wish that cannot be met (`Area` without a face) are empty.
pub fn share_force(
    mesh: &TetMesh,
    nodes: &[u32],
    total_n: Vector3<f64>,
    wish: Option<Share>,
) -> Vec<(u32, Vector3<f64>)> {
    let mut weight = vec![0.0; mesh.nodes.len()];
    if wish != Some(Share::Volume) {
        area_weights(mesh, nodes, &mut weight);
    }
    if wish == Some(Share::Volume) || (wish.is_none() && weight.iter().all(|w| *w == 0.0)) {
        volume_weights(mesh, nodes, &mut weight);
    }
    let sum: f64 = weight.iter().sum();
    let loaded = nodes.iter().filter(|n| weight[**n as usize] > 0.0);
    loaded.map(|n| (*n, total_n * (weight[*n as usize] / sum))).collect()
}

fn area_weights(mesh: &TetMesh, nodes: &[u32], weight: &mut [f64]) {
    for face in mesh.boundary_faces() {
        if face.nodes.iter().all(|n| nodes.binary_search(n).is_ok()) {
            let third = mesh.face_area(&face) / 3.0;
            face.nodes.iter().for_each(|n| weight[*n as usize] += third);
        }
    }
}

fn volume_weights(mesh: &TetMesh, nodes: &[u32], weight: &mut [f64]) {
    for (e, tet) in mesh.tets.iter().enumerate() {
        let quarter = mesh.volume(e) / 4.0;
        for n in tet.iter().filter(|n| nodes.binary_search(n).is_ok()) {
            weight[*n as usize] += quarter;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use scindo_physics::mesh::{BoxPattern, box_mesh};

    #[test]
    fn shares_add_up_and_follow_area() {
        let mesh = box_mesh(Vector3::zeros(), Vector3::repeat(1.0), [2, 2, 2], BoxPattern::Tet6);
        let top: Vec<u32> = (0..27).filter(|n| mesh.nodes[*n as usize].z == 1.0).collect();
        let shares = share_force(&mesh, &top, Vector3::new(0.0, 0.0, -3.0), None);
        let total: Vector3<f64> = shares.iter().map(|(_, f)| f).sum();
        assert!((total.z + 3.0).abs() < 1e-12);
        let centre = shares.iter().find(|(n, _)| mesh.nodes[*n as usize].xy() == Vector3::repeat(0.5).xy());
        assert!((centre.map_or(0.0, |(_, f)| f.z) + 0.75).abs() < 1e-12);
    }

    #[test]
    fn nodes_without_a_face_share_by_volume() {
        let mesh = box_mesh(Vector3::zeros(), Vector3::repeat(1.0), [2, 2, 2], BoxPattern::Tet6);
        let shares = share_force(&mesh, &[13], Vector3::x(), None);
        assert_eq!(shares, vec![(13, Vector3::x())]);
        assert!(share_force(&mesh, &[13], Vector3::x(), Some(Share::Area)).is_empty());
    }
}
