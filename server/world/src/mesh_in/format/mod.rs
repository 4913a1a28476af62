//! Readers: the bytes of a mesh file → a typed mesh.
//!
//! Every reader checks counts against the bytes that are there before it allocates, and indices
//! against the nodes that are there before it hands anything on; faults name file, place and what was
//! expected.

mod scanner;
mod cells;
mod gmsh;
mod vtk_cells;
mod vtk_legacy;
mod vtk_array;
mod vtk_xml;
mod obj;
mod stl;
mod ply;

use std::path::Path;

use nalgebra::Vector3;

use super::{MeshFile, MeshInError};

/// Reads a mesh from memory; `file` is its name (its extension chooses the format).
pub fn read_mesh_bytes(file: &str, bytes: &[u8]) -> Result<MeshFile, MeshInError> {
    let extension =
        Path::new(file).extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    let mesh = match extension.as_str() {
        "msh" => gmsh::read(file, bytes),
        "vtk" => vtk_legacy::read(file, bytes),
        "vtu" | "vtp" => vtk_xml::read(file, bytes),
        "obj" => obj::read(file, bytes),
        "stl" => stl::read(file, bytes),
        "ply" => ply::read(file, bytes),
        _ if bytes.starts_with(b"$MeshFormat") || bytes.starts_with(b"$NOD") => gmsh::read(file, bytes),
        _ if bytes.starts_with(b"# vtk DataFile") => vtk_legacy::read(file, bytes),
        _ if bytes.starts_with(b"ply") => ply::read(file, bytes),
        _ => return Err(MeshInError::UnknownFormat { file: file.into(), found: extension }),
    }?;
    all_finite(file, mesh.points())?;
    Ok(mesh)
}

fn all_finite(file: &str, points: &[Vector3<f64>]) -> Result<(), MeshInError> {
    match points.iter().position(|p| !p.iter().all(|c| c.is_finite() && c.abs() < 1e100)) {
        None => Ok(()),
        Some(node) => {
            let p = points[node];
            Err(MeshInError::NonFinite { file: file.into(), node, x: p.x, y: p.y, z: p.z })
        }
    }
}

#[cfg(test)]
mod tests;
