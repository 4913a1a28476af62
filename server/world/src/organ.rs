//! The body of the built-in demonstration: an organ-like shape from an implicit surface.
//!
//! A thick and a thin lobe, blended, with a groove and a notch between them and a hollow below, about
//! 160 × 104 × 63 mm. It lies flat: long axis along x, thickness along z, top towards +z, centred at
//! x = y = 0 with its underside near z = 0. The program triangulates it and fills the triangles with
//! a lattice on the same path as a surface file of a user.

use nalgebra::Vector3;
use scindo_physics::mesh::TetMesh;

use crate::mesh_in::implicit::triangulate;
use crate::mesh_in::{LatticeReport, MeshInError, SurfaceMesh, lattice_from_surface};

/// Side of the cubes that the surface is triangulated on [m].
const SPACING_M: f64 = 0.004;

/// The organ filled with a lattice of `cells` cubes along its longest side [m].
///
/// # Errors
/// `cells` outside the range of the lattice.
pub fn organ(cells: usize) -> Result<(TetMesh, LatticeReport), MeshInError> {
    lattice_from_surface(&organ_surface(), cells, 1.0)
}

/// The triangulated skin of the organ [m].
pub fn organ_surface() -> SurfaceMesh {
    let (low, high) = (Vector3::new(-0.1, -0.07, -0.02), Vector3::new(0.1, 0.07, 0.085));
    triangulate("organ", &signed_distance, low, high, SPACING_M)
}

/// Approximate signed distance to the organ's skin [m], negative inside.
fn signed_distance(x: &Vector3<f64>) -> f64 {
    let right = ellipsoid(x, Vector3::new(0.034, 0.004, 0.029), Vector3::new(0.046, 0.052, 0.033));
    let middle = ellipsoid(x, Vector3::new(-0.006, 0.006, 0.027), Vector3::new(0.046, 0.046, 0.025));
    let left = ellipsoid(x, Vector3::new(-0.046, 0.000, 0.024), Vector3::new(0.034, 0.036, 0.015));
    let body = smooth_union(smooth_union(right, middle, 0.020), left, 0.026);
    let groove = capsule(x, Vector3::new(-0.024, -0.08, 0.054), Vector3::new(-0.012, 0.08, 0.060), 0.010);
    let notch = capsule(x, Vector3::new(-0.022, -0.060, -0.03), Vector3::new(-0.020, -0.056, 0.08), 0.012);
    let hollow = ellipsoid(x, Vector3::new(-0.002, -0.020, -0.030), Vector3::new(0.080, 0.062, 0.040));
    let grooved = smooth_cut(smooth_cut(body, groove, 0.014), notch, 0.016);
    smooth_cut(grooved, hollow, 0.012)
}

/// Distance to an ellipsoid to first order (Quilez): exact on its surface.
fn ellipsoid(x: &Vector3<f64>, centre: Vector3<f64>, radii: Vector3<f64>) -> f64 {
    let p = x - centre;
    let k0 = p.component_div(&radii).norm();
    let k1 = p.component_div(&radii.component_mul(&radii)).norm();
    if k1 > 0.0 { k0 * (k0 - 1.0) / k1 } else { -radii.min() }
}

/// Distance to a line from `a` to `b` of the given radius.
fn capsule(x: &Vector3<f64>, a: Vector3<f64>, b: Vector3<f64>, radius: f64) -> f64 {
    let along = b - a;
    let t = ((x - a).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
    (x - a - t * along).norm() - radius
}

/// Union with a fillet of about the width `blend` [m] (polynomial smooth minimum).
fn smooth_union(f: f64, g: f64, blend: f64) -> f64 {
    let h = (1.0 - (f - g).abs() / blend).max(0.0);
    f.min(g) - 0.25 * blend * h * h
}

/// `f` without `g`, the new edge rounded.
fn smooth_cut(f: f64, g: f64, blend: f64) -> f64 {
    -smooth_union(-f, g, blend)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_organ_is_clean_smooth_and_of_organ_size() {
        let (mesh, report) = organ(20).unwrap();
        assert!(report.surface.is_clean(), "{report}");
        let size = Vector3::from(report.surface.max_m) - Vector3::from(report.surface.min_m);
        assert!((0.14..0.18).contains(&size.x) && size.y < 0.11 && size.z < 0.07, "{size}");
        assert!(report.min_dihedral_deg > 8.0 && report.volume_error.abs() < 0.02, "{report}");
        assert_eq!((report.components, report.removed_tets), (1, 0));
        assert!(mesh.tets.len() > 5_000, "{}", mesh.tets.len());
    }
}
