//! Meshes in: bytes of a file → typed mesh → checked and repaired → tetrahedra.
//!
//! A file holds either a *volume* (tetrahedra: `.msh`, `.vtk`, `.vtu`) or a *surface* (triangles: `.obj`,
//! `.stl`, `.ply`, and `.vtk`, `.vtu`, `.vtp`, `.msh` without tetrahedra). Volumes are checked and
//! repaired; surfaces, closed or dirty, are filled with a lattice of tetrahedra whose
//! boundary follows them. Readers work on bytes in memory; [`read_mesh`] alone opens files.

mod error;
mod format;
mod triangle_tree;
mod health;
mod estimate;
mod lattice;
pub(crate) mod implicit;
mod load;
mod write;
#[cfg(test)]
mod shapes;

use std::path::Path;

use nalgebra::Vector3;

pub use error::MeshInError;
pub use estimate::{MeshEstimate, estimate, largest};
pub(crate) use estimate::{body_bytes, memory_for_meshes};
pub use format::read_mesh_bytes;
pub(crate) use health::connectivity::components;
pub use health::scale::{ScaleWarning, check_scale};
pub use health::surface::SurfaceHealth;
pub use health::volume::{VolumeHealth, repair_volume};
pub(crate) use lattice::lattice_observed;
pub use lattice::{CELLS, LatticeReport, lattice_from_surface};
pub use load::{MeshHealth, load_any, load_surface, load_volume};
pub use write::write_mesh;

/// How far the making of a mesh has come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Meshing {
    /// What is done now.
    pub stage: &'static str,
    /// Share of the whole that is done, 0 to 1.
    pub done: f64,
    /// What it will take altogether.
    pub estimate: MeshEstimate,
}

/// Hears how far the making of a mesh has come; from several threads.
pub type Observer<'a> = dyn Fn(Meshing) + Sync + 'a;

/// Most cells that may be asked for.
pub(crate) fn most_cells() -> usize {
    *CELLS.end()
}

/// Tetrahedra as a file gave them: not checked, not oriented.
#[derive(Clone, Debug, PartialEq)]
pub struct VolumeMesh {
    /// Name of the file, for errors and reports.
    pub file: String,
    /// Node positions, in the file's unit.
    pub nodes: Vec<Vector3<f64>>,
    /// Four node indices each; within range.
    pub tets: Vec<[u32; 4]>,
    /// What was read but not used.
    pub notes: Vec<String>,
}

/// Triangles as a file gave them: not checked, not oriented, vertices not welded.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceMesh {
    /// Name of the file, for errors and reports.
    pub file: String,
    /// Vertex positions, in the file's unit.
    pub vertices: Vec<Vector3<f64>>,
    /// Three vertex indices each; within range.
    pub triangles: Vec<[u32; 3]>,
    /// What was read but not used.
    pub notes: Vec<String>,
}

/// What a mesh file holds.
#[derive(Clone, Debug, PartialEq)]
pub enum MeshFile {
    /// Tetrahedra.
    Volume(VolumeMesh),
    /// A triangulated surface.
    Surface(SurfaceMesh),
}

/// Largest mesh file that is opened [bytes].
pub const MAX_FILE_BYTES: u64 = 2 << 30;

/// Reads a mesh file; the format follows from the extension, or from the first bytes when there is none.
pub fn read_mesh(path: &Path) -> Result<MeshFile, MeshInError> {
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
    let bytes = std::fs::read(path).map_err(io)?;
    read_mesh_bytes(&file, &bytes)
}

impl MeshFile {
    /// Node or vertex positions.
    pub fn points(&self) -> &[Vector3<f64>] {
        match self {
            MeshFile::Volume(volume) => &volume.nodes,
            MeshFile::Surface(surface) => &surface.vertices,
        }
    }
}
