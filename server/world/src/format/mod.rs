//! Mesh files: reads their bytes into a typed mesh, and writes grids with fields.
//!
//! A file holds either a *volume* (tetrahedra: `.msh`, `.vtk`, `.vtu`) or a *surface* (triangles: `.obj`,
//! `.stl`, `.ply`, and `.vtk`, `.vtu`, `.vtp`, `.msh` without tetrahedra). Readers work on bytes in memory;
//! only [`read_mesh`] and [`read_textured`] open files. Before it allocates, every reader checks counts against the bytes that are
//! there. Before it returns, it checks indices against the nodes. Errors name the file, the place and what
//! was expected.

mod error;
mod inside;
mod groups;
mod mesh_file;
mod scanner;
mod cells;
mod gmsh;
mod vtk_cells;
mod vtk_legacy;
mod vtk_legacy_data;
mod vtk_array;
mod vtk_xml;
mod obj;
mod stl;
mod ply;
pub mod vtu;

use std::path::Path;

use nalgebra::Vector3;

pub use error::MeshInError;
pub use groups::{CellGroup, GMSH_PHYSICAL, keep_tets};
pub(crate) use inside::{inside, with_files_inside};
pub use mesh_file::{MeshFile, SurfaceMesh, TexturedSurface, VolumeMesh};
pub use obj::{read_textured, read_textured_bytes};

/// Largest mesh file accepted [bytes].
pub const MAX_FILE_BYTES: u64 = 2 << 30;

/// Reads a mesh file. The format follows from the extension, or from the first bytes if there is none.
pub fn read_mesh(path: &Path) -> Result<MeshFile, MeshInError> {
    read_mesh_bytes(&path.display().to_string(), &read_bytes(path)?)
}

fn read_bytes(path: &Path) -> Result<Vec<u8>, MeshInError> {
    if let Some(bytes) = inside(path) {
        return Ok(bytes.to_vec());
    }
    let io = |source| MeshInError::Io { path: path.to_path_buf(), source };
    let file = path.display().to_string();
    let length = std::fs::metadata(path).map_err(io)?.len();
    if length > MAX_FILE_BYTES {
        return Err(MeshInError::Limit {
            file,
            place: "file".into(),
            what: "bytes".into(),
            value: length,
            limit: MAX_FILE_BYTES,
            reason: "no mesh file may be larger".into(),
        });
    }
    std::fs::read(path).map_err(io)
}

/// Reads a mesh from memory. `file` is its name, whose extension chooses the format.
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
