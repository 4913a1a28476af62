//! The contents of a mesh file as read: not checked, not repaired.

use nalgebra::Vector3;

use super::groups::CellGroup;

/// Tetrahedra as read from a file: not checked, not oriented.
#[derive(Clone, Debug, PartialEq)]
pub struct VolumeMesh {
    /// Name of the file, for errors and reports.
    pub file: String,
    /// Node positions, in the file's unit.
    pub nodes: Vec<Vector3<f64>>,
    /// Four node indices per tetrahedron, all within range.
    pub tets: Vec<[u32; 4]>,
    /// Groups that the file puts its tetrahedra into.
    pub groups: Vec<CellGroup>,
    /// Contents that were read but not used.
    pub notes: Vec<String>,
}

/// Triangles as read from a file: not checked, not oriented, vertices not welded.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceMesh {
    /// Name of the file, for errors and reports.
    pub file: String,
    /// Vertex positions, in the file's unit.
    pub vertices: Vec<Vector3<f64>>,
    /// Three vertex indices per triangle, all within range.
    pub triangles: Vec<[u32; 3]>,
    /// Contents that were read but not used.
    pub notes: Vec<String>,
}

/// Triangles with texture coordinates at every corner, as read.
#[derive(Clone, Debug, PartialEq)]
pub struct TexturedSurface {
    /// Vertex positions, in the file's unit.
    pub vertices: Vec<Vector3<f64>>,
    /// Three vertex indices per triangle, all within range.
    pub triangles: Vec<[u32; 3]>,
    /// Texture coordinates of the corners of every triangle; (0, 0) is the lower left corner of the image.
    pub coordinates: Vec<[[f32; 2]; 3]>,
}

/// The contents of a mesh file: a volume or a surface.
#[derive(Clone, Debug, PartialEq)]
pub enum MeshFile {
    /// Tetrahedra.
    Volume(VolumeMesh),
    /// A triangulated surface.
    Surface(SurfaceMesh),
}

impl MeshFile {
    /// Node or vertex positions, in the file's unit.
    pub fn points(&self) -> &[Vector3<f64>] {
        match self {
            MeshFile::Volume(volume) => &volume.nodes,
            MeshFile::Surface(surface) => &surface.vertices,
        }
    }
}
