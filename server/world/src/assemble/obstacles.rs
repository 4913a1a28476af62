//! From checked obstacles to solids: surfaces opened, closed and turned outside out.

use std::collections::HashMap;
use std::path::Path;

use nalgebra::Vector3;
use scindo_collision::SurfaceBvh;

use super::mesh::fault;
use crate::format::{MeshFile, SurfaceMesh, read_mesh};
use crate::scene::{Fault, ObstacleSpec, Solid};
use crate::tool::obstacle::{Obstacle, Shape};

/// The obstacle of `spec`; paths are relative to `base_dir`.
pub(super) fn open(spec: &ObstacleSpec, base_dir: &Path) -> Result<Obstacle, Fault> {
    let shape = match &spec.solid {
        Solid::HalfSpace { point_m, normal } => Shape::HalfSpace { point: *point_m, normal: *normal },
        Solid::Box { min_m, max_m } => Shape::Box { min: *min_m, max: *max_m },
        Solid::Capsule { ends_m, radius_m } => Shape::Capsule { ends: *ends_m, radius: *radius_m },
        Solid::Surface { path, scale, at_m } => {
            let surface = match read_mesh(&base_dir.join(path)).map_err(fault)? {
                MeshFile::Surface(surface) => surface,
                MeshFile::Volume(volume) => {
                    let next = "an obstacle is a surface: .obj, .stl or .ply";
                    return Err(Fault::Mesh { reason: format!("{} holds tetrahedra; {next}", volume.file) });
                }
            };
            Shape::Surface(Box::new(solid(&surface, *scale, *at_m)?))
        }
    };
    let ObstacleSpec { id, friction, stiffness, .. } = spec;
    Ok(Obstacle { id: id.clone(), shape, friction: *friction, stiffness: *stiffness })
}

/// The tree over a closed surface whose triangles face outwards.
fn solid(surface: &SurfaceMesh, scale: f64, at_m: Vector3<f64>) -> Result<SurfaceBvh, Fault> {
    let open = open_edges(&surface.triangles);
    if open > 0 || surface.triangles.is_empty() {
        let next = "an obstacle needs a closed surface whose triangles all face the same side";
        let reason = format!("{} has {open} open edges; {next}", surface.file);
        return Err(Fault::Mesh { reason });
    }
    let place = |v: &Vector3<f64>| v * scale + at_m;
    let corners = |t: &[u32; 3]| t.map(|v| place(&surface.vertices[v as usize]));
    let volume = surface.triangles.iter().map(corners).map(|[a, b, c]| a.cross(&b).dot(&c)).sum::<f64>();
    let turned = |t: &[u32; 3]| if volume < 0.0 { [t[0], t[2], t[1]] } else { *t };
    let triangles: Vec<[u32; 3]> = surface.triangles.iter().map(turned).collect();
    let positions: Vec<[f32; 3]> =
        surface.vertices.iter().map(|v| place(v).map(|c| c as f32).into()).collect();
    SurfaceBvh::new(&positions, &triangles).map_err(|error| Fault::Mesh { reason: error.to_string() })
}

/// Number of directed edges without an opposite one.
fn open_edges(triangles: &[[u32; 3]]) -> usize {
    let mut balance: HashMap<[u32; 2], i64> = HashMap::new();
    for [a, b, c] in triangles {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            let sign = if from < to { 1 } else { -1 };
            *balance.entry([*from.min(to), *from.max(to)]).or_default() += sign;
        }
    }
    balance.values().filter(|&&sum| sum != 0).count()
}
