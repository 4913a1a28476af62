//! Meshes whose elements are too flat for single precision.
//!
//! The deformation gradient of an element is a sum of edges times gradients, F = Σ e_a ⊗ g_a. In a flat
//! element these terms cancel. With edges of length L and a gradient |g| the rounding of F is 6e-8 L |g|.
//! A strain below that is noise, and its stress is a spurious force.

use nalgebra::Vector3;
use scindo_matter::mesh::TetMesh;

/// L |g| above which noise counts. It is then a strain of 2e-5; soft tissue under its own weight has 1e-3.
const FLAT: f64 = 300.0;
/// One element in this many may be arbitrarily flat: the solver can deal with slivers.
const ONE_IN: usize = 4;

/// Whether so many elements are flat that the forces of the whole body would be noise.
pub(super) fn too_flat_for_single(mesh: &TetMesh) -> bool {
    let flat = |e: &usize| {
        let most = mesh.gradients(*e).iter().map(Vector3::norm_squared).fold(0.0, f64::max);
        mesh.longest_edge(*e) * most.sqrt() > FLAT
    };
    let n = mesh.tets.len();
    (0..n).filter(flat).take(n / ONE_IN + 1).count() > n / ONE_IN
}

#[cfg(test)]
mod tests {
    use super::*;
    use scindo_matter::mesh::{BoxPattern, box_mesh};

    #[test]
    fn foils_are_too_flat_and_slivers_in_a_sound_body_are_not() {
        let mesh = |thickness: f64| {
            box_mesh(Vector3::zeros(), Vector3::new(thickness, 0.05, 0.05), [4, 3, 3], BoxPattern::Tet6)
        };
        assert!(!too_flat_for_single(&mesh(0.05)) && !too_flat_for_single(&mesh(1e-3)));
        assert!(too_flat_for_single(&mesh(3e-5)));
        let mut slivers = mesh(0.05);
        let [a, b, c, d] = slivers.tets[0];
        let middle = [b, c, d].map(|n| slivers.nodes[n as usize]).iter().sum::<Vector3<f64>>() / 3.0;
        slivers.nodes[a as usize] = middle;
        assert!(!too_flat_for_single(&slivers));
    }
}
