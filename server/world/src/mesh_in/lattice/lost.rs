//! Detects thin parts of a surface that the lattice has lost: where the surface lies farther than a cell from
//! its mesh.

use nalgebra::Vector3;
use scindo_collision::SurfaceBvh;
use scindo_physics::mesh::TetMesh;

use super::LatticeReport;
use crate::mesh_in::health::surface::CleanSurface;

/// Most triangles that are sampled.
const SAMPLES: usize = 4000;

/// Records in `report` how much of `surface` has no element of `mesh` within a cell.
pub(super) fn measure(surface: &CleanSurface, mesh: &TetMesh, report: &mut LatticeReport) {
    let positions: Vec<[f32; 3]> = mesh.nodes.iter().map(|x| [x.x as f32, x.y as f32, x.z as f32]).collect();
    let skin: Vec<[u32; 3]> = mesh.boundary_faces().iter().map(|face| face.nodes).collect();
    let Ok(skin) = SurfaceBvh::new(&positions, &skin) else { return };
    let triangles = surface.tree.triangles();
    let stride = triangles.len().div_ceil(SAMPLES).max(1);
    let (mut area, mut lost, mut farthest) = (0.0, 0.0, 0.0);
    for [a, b, c] in triangles.iter().step_by(stride) {
        let own = 0.5 * (b - a).cross(&(c - a)).norm();
        let centre: Vector3<f64> = (a + b + c) / 3.0;
        area += own;
        if skin.closest_point(centre, report.spacing_m).is_none() {
            lost += own;
            let away = skin.closest_point(centre, f64::MAX).map_or(0.0, |c| (c.point - centre).norm());
            if away > farthest {
                (farthest, report.lost_near_m) = (away, centre.into());
            }
        }
    }
    report.lost_share = if area > 0.0 { lost / area } else { 0.0 };
}
