//! What a mesh file holds, as it stands there: not checked, not repaired.

use nalgebra::Vector3;

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

impl MeshFile {
    /// Node or vertex positions.
    pub fn points(&self) -> &[Vector3<f64>] {
        match self {
            MeshFile::Volume(volume) => &volume.nodes,
            MeshFile::Surface(surface) => &surface.vertices,
        }
    }
}
