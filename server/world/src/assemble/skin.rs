//! Puts the skin of a scene on a body: where each point of it rests.

use std::collections::HashMap;
use std::fmt::Display;
use std::path::Path;

use nalgebra::Vector3;
use scindo_collision::SurfaceBvh;
use scindo_physics::body::Body;
use scindo_physics::skin::{Kept, Landing, OwnSurface, SkinSettings};
use scindo_physics::space::Tets;

use super::mesh::fault;
use crate::format::{MeshFile, SurfaceMesh, read_mesh};
use crate::mesh_in::clean_surface;
use crate::scene::{Fault, MeshSource, SkinSpec};

/// How far the skin may lie off the elements' boundary, in mean edges of elements.
const REACH: f64 = 0.75;

/// Least share of a surface's area that is on a skin of its triangles without a warning.
const ENOUGH: f64 = 0.99;

/// Puts the skin on `body`, whose mesh comes from `source`; paths are relative to `base_dir`. Returns what is odd about it.
pub(super) fn put_on(
    body: &mut Body,
    spec: &SkinSpec,
    source: &MeshSource,
    base_dir: &Path,
) -> Result<Option<String>, Fault> {
    let settings = SkinSettings { snapping: spec.snapping, ..SkinSettings::default() };
    let reach = REACH * edge(body);
    let Some((surface, scale)) = target(spec, source, base_dir)? else {
        let settings = SkinSettings { divisions: spec.divisions.unwrap_or(1), ..settings };
        return body.put_on_skin(settings, None, &mut |flat, _| *flat).map_err(refused).map(|()| None);
    };
    let tree = tree(surface.vertices.iter().map(|v| v * scale), &surface.triangles)?;
    let shape = &mut |flat: &Vector3<f64>, normal: &Vector3<f64>| rest(&tree, flat, normal, reach);
    if let Some(divisions) = spec.divisions {
        let settings = SkinSettings { divisions, ..settings };
        return body.put_on_skin(settings, None, shape).map_err(refused).map(|()| None);
    }
    let own = Own::new(&surface, scale)?;
    let landings = own.landings(body, reach)?;
    let own = OwnSurface { vertices: &own.vertices, triangles: &own.triangles, landings: &landings };
    body.put_on_skin(settings, Some(&own), shape).map_err(refused)?;
    Ok(body.kept().and_then(|kept| doubt(&kept)))
}

fn doubt(kept: &Kept) -> Option<String> {
    let percent = 100.0 * kept.area;
    (kept.area < ENOUGH).then(|| {
        format!(
            "{} of {} triangles of the surface are on the skin, {percent:.1} % of its area; elsewhere the skin follows the \
             elements, which are too coarse for the surface. A finer mesh keeps more of them",
            kept.triangles, kept.of
        )
    })
}

fn refused(error: impl Display) -> Fault {
    Fault::Mesh { reason: error.to_string() }
}

/// A surface in one piece: its vertices [m] are welded, its triangles sound and turned outwards.
struct Own {
    vertices: Vec<Vector3<f64>>,
    triangles: Vec<[u32; 3]>,
}

impl Own {
    fn new(surface: &SurfaceMesh, scale: f64) -> Result<Self, Fault> {
        let (clean, _) = clean_surface(surface, scale).map_err(fault)?;
        let mut own = Self { vertices: Vec::new(), triangles: Vec::new() };
        let mut known: HashMap<[u64; 3], u32> = HashMap::new();
        let mut number = |x: Vector3<f64>| {
            *known.entry([x.x, x.y, x.z].map(f64::to_bits)).or_insert_with(|| {
                own.vertices.push(x);
                own.vertices.len() as u32 - 1
            })
        };
        own.triangles = clean.tree.triangles().iter().map(|corners| corners.map(&mut number)).collect();
        Ok(own)
    }

    /// Closest points of the body's elements to the vertices, on faces that look the same way, no farther than `reach` [m].
    fn landings(&self, body: &Body, reach: f64) -> Result<Vec<Option<Landing>>, Fault> {
        let (nodes, faces) = body.skin_ground();
        let tree = tree(nodes.into_iter(), &faces)?;
        let mut normals = vec![Vector3::zeros(); self.vertices.len()];
        for corners in &self.triangles {
            let [a, b, c] = corners.map(|v| self.vertices[v as usize]);
            corners.iter().for_each(|&v| normals[v as usize] += (b - a).cross(&(c - a)));
        }
        let land = |(x, normal): (&Vector3<f64>, &Vector3<f64>)| {
            let closest = tree.closest_point_where(*x, reach, |t| tree.area_normal(t).dot(normal) > 0.0)?;
            Some(Landing { nodes: faces[closest.triangle as usize], weights: closest.barycentric })
        };
        Ok(self.vertices.iter().zip(&normals).map(land).collect())
    }
}

/// A tree over triangles with vertices here [m].
fn tree(vertices: impl Iterator<Item = Vector3<f64>>, triangles: &[[u32; 3]]) -> Result<SurfaceBvh, Fault> {
    let positions: Vec<[f32; 3]> = vertices.map(|v| [v.x, v.y, v.z].map(|c| c as f32)).collect();
    SurfaceBvh::new(&positions, triangles).map_err(refused)
}

/// Closest point of the surface that faces the same way, or the point itself if there is none in reach.
fn rest(surface: &SurfaceBvh, flat: &Vector3<f64>, normal: &Vector3<f64>, reach: f64) -> Vector3<f64> {
    let closest = surface.closest_point(*flat, reach);
    let facing = closest.filter(|c| surface.normal_at(c.triangle, c.barycentric).dot(normal) > 0.0);
    facing.map_or(*flat, |c| c.point)
}

/// Mean longest edge of the tetrahedra, or diagonal of the finest cells [m].
fn edge(body: &Body) -> f64 {
    let Some(mesh) = body.tets().map(Tets::mesh) else { return 3_f64.sqrt() * body.element_size() };
    let sum: f64 = (0..mesh.tets.len()).map(|e| mesh.longest_edge(e)).sum();
    sum / mesh.tets.len() as f64
}

/// The surface that the skin rests on and its unit of length [m], if there is one.
fn target(
    spec: &SkinSpec,
    source: &MeshSource,
    base_dir: &Path,
) -> Result<Option<(SurfaceMesh, f64)>, Fault> {
    Ok(match (&spec.surface, source) {
        (Some((path, scale)), _) | (None, MeshSource::Surface { path, scale, .. }) => {
            Some((open(path, base_dir)?, *scale))
        }
        (None, MeshSource::Organ { shape, .. }) => Some((shape.surface(), 1.0)),
        _ => None,
    })
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
