//! Puts the skin of a scene on a body: where each point of it rests.

use std::path::Path;

use nalgebra::Vector3;
use scindo_collision::SurfaceBvh;
use scindo_physics::body::Body;
use scindo_physics::space::Tets;
use scindo_physics::space::skin::SkinSettings;

use super::mesh::fault;
use crate::format::{MeshFile, SurfaceMesh, read_mesh};
use crate::scene::{Fault, MeshSource, SkinSpec};

/// How far the skin may lie off the elements' boundary, in mean edges of elements.
const REACH: f64 = 0.75;

/// Puts the skin on `body`, whose mesh comes from `source`; paths are relative to `base_dir`.
pub fn put_on(body: &mut Body, spec: &SkinSpec, source: &MeshSource, base_dir: &Path) -> Result<(), Fault> {
    let settings = SkinSettings { divisions: spec.divisions, snapping: spec.snapping };
    let reach = REACH * edge(body);
    let put_on = match target(spec, source, base_dir)? {
        Some(surface) => body.put_on_skin(settings, &mut |flat, normal| rest(&surface, flat, normal, reach)),
        None => body.put_on_skin(settings, &mut |flat, _| *flat),
    };
    put_on.map_err(|error| Fault::Mesh { reason: error.to_string() })
}

/// Closest point of the surface that faces the same way, or the point itself if there is none in reach.
fn rest(surface: &SurfaceBvh, flat: &Vector3<f64>, normal: &Vector3<f64>, reach: f64) -> Vector3<f64> {
    let closest = surface.closest_point(*flat, reach);
    let facing = closest.filter(|c| surface.normal_at(c.triangle, c.barycentric).dot(normal) > 0.0);
    facing.map_or(*flat, |c| c.point)
}

/// Mean edge of the tetrahedra [m]; 0 for a body without them, which gets no skin.
fn edge(body: &Body) -> f64 {
    let Some(mesh) = body.tets().map(Tets::mesh) else { return 0.0 };
    let sum: f64 = (0..mesh.tets.len()).map(|e| mesh.longest_edge(e)).sum();
    sum / mesh.tets.len() as f64
}

/// The surface that the skin rests on, if there is one.
fn target(spec: &SkinSpec, source: &MeshSource, base_dir: &Path) -> Result<Option<SurfaceBvh>, Fault> {
    let (surface, scale) = if let Some((path, scale)) = &spec.surface {
        (open(path, base_dir)?, *scale)
    } else if let MeshSource::Surface { path, scale, .. } = source {
        (open(path, base_dir)?, *scale)
    } else if let MeshSource::Organ { shape, .. } = source {
        (shape.surface(), 1.0)
    } else {
        return Ok(None);
    };
    let positions: Vec<[f32; 3]> =
        surface.vertices.iter().map(|v| [v.x, v.y, v.z].map(|c| (c * scale) as f32)).collect();
    let tree = SurfaceBvh::new(&positions, &surface.triangles);
    tree.map(Some).map_err(|error| Fault::Mesh { reason: error.to_string() })
}

fn open(path: &str, base_dir: &Path) -> Result<SurfaceMesh, Fault> {
    match read_mesh(&base_dir.join(path)).map_err(fault)? {
        MeshFile::Surface(surface) => Ok(surface),
        MeshFile::Volume(volume) => Err(Fault::Mesh {
            reason: format!(
                "{} holds tetrahedra; the skin rests on a surface: .obj, .stl or .ply",
                volume.file
            ),
        }),
    }
}
