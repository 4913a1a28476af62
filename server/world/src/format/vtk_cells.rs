//! VTK cell types, shared by the legacy and the XML reader.
//!
//! # Source
//! VTK file formats, "Cell types" (vtkCellType.h).

use super::cells::{CellKind, CellSoup};
use super::error::MeshInError;

/// The contribution of a VTK cell type to a mesh.
pub(super) fn kind(vtk_type: i64) -> CellKind {
    use CellKind::{Ignored, Pixel, Polygon, Quad, Refused, Strip, Tetrahedron, Triangle};
    match vtk_type {
        0..=2 => Ignored("point"),
        3 | 4 | 21 | 35 | 68 => Ignored("line"),
        5 | 22 | 34 | 69 => Triangle,
        6 => Strip,
        7 => Polygon,
        8 => Pixel,
        9 | 23 | 28 | 30 | 70 => Quad,
        10 => Tetrahedron { order: 1 },
        24 | 71 => Tetrahedron { order: 2 },
        11 => Refused("voxel"),
        12 | 25 | 29 | 33 | 72 => Refused("hexahedron"),
        13 | 26 | 31 | 32 | 73 => Refused("wedge"),
        14 | 27 | 37 | 74 => Refused("pyramid"),
        41 | 42 => Refused("polyhedron"),
        _ => Refused("unknown type of"),
    }
}

/// Adds a cell. `place` is called only for an error.
pub(super) fn add(
    cells: &mut CellSoup,
    file: &str,
    vtk_type: i64,
    nodes: &[i64],
    place: impl Fn() -> String,
) -> Result<(), MeshInError> {
    let kind = kind(vtk_type);
    if let CellKind::Refused(name) = kind {
        return Err(MeshInError::Unsupported {
            file: file.into(),
            place: place(),
            what: format!("a {name} cell (VTK type {vtk_type})"),
            instead: "mesh the body with tetrahedra, or give its surface with `mesh = { surface = … }`"
                .into(),
        });
    }
    if cells.add(kind, nodes) {
        return Ok(());
    }
    Err(MeshInError::Syntax {
        file: file.into(),
        place: place(),
        expected: format!("enough nodes for a cell of VTK type {vtk_type}"),
        found: format!("{} nodes", nodes.len()),
    })
}
