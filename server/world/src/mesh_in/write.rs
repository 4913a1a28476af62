//! Writes meshes: `scindo mesh IN -o OUT` writes tetrahedra as `.vtu`, `.vtk` or `.msh`.

use std::fmt::Write;
use std::path::Path;

use scindo_physics::mesh::TetMesh;

use crate::format::MeshInError;
use crate::format::vtu::{Cells, Grid, save_grid};

/// Writes a mesh in the format of the extension: `.vtu`, `.vtk` (legacy, text) or `.msh` (Gmsh 2.2, text).
pub fn write_mesh(path: &Path, mesh: &TetMesh) -> Result<(), MeshInError> {
    let fail = |reason: String| MeshInError::Write { path: path.to_path_buf(), reason };
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    match extension.as_str() {
        "vtu" => {
            let grid = Grid {
                points: &mesh.nodes,
                cells: Cells::Tets(&mesh.tets),
                point_fields: &[],
                cell_fields: &[],
                time_s: None,
            };
            save_grid(path, &grid).map_err(|e| fail(e.to_string()))
        }
        "vtk" => std::fs::write(path, vtk_text(mesh)).map_err(|e| fail(e.to_string())),
        "msh" => std::fs::write(path, msh_text(mesh)).map_err(|e| fail(e.to_string())),
        other => Err(fail(format!("unknown format '.{other}'; known are .vtu .vtk .msh"))),
    }
}

fn vtk_text(mesh: &TetMesh) -> String {
    let mut text = "# vtk DataFile Version 3.0\nscindo\nASCII\nDATASET UNSTRUCTURED_GRID\n".to_string();
    let n = mesh.tets.len();
    // Writing to a String cannot fail.
    let _ = writeln!(text, "POINTS {} double", mesh.nodes.len());
    for x in &mesh.nodes {
        let _ = writeln!(text, "{} {} {}", x.x, x.y, x.z);
    }
    let _ = writeln!(text, "CELLS {n} {}", 5 * n);
    for [a, b, c, d] in &mesh.tets {
        let _ = writeln!(text, "4 {a} {b} {c} {d}");
    }
    let _ = writeln!(text, "CELL_TYPES {n}");
    text.push_str(&"10\n".repeat(n));
    text
}

fn msh_text(mesh: &TetMesh) -> String {
    let mut text = format!("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{}\n", mesh.nodes.len());
    for (i, x) in mesh.nodes.iter().enumerate() {
        let _ = writeln!(text, "{} {} {} {}", i + 1, x.x, x.y, x.z);
    }
    let _ = writeln!(text, "$EndNodes\n$Elements\n{}", mesh.tets.len());
    for (i, tet) in mesh.tets.iter().enumerate() {
        let [a, b, c, d] = tet.map(|n| n + 1);
        let _ = writeln!(text, "{} 4 2 1 1 {a} {b} {c} {d}", i + 1);
    }
    text.push_str("$EndElements\n");
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh_in::load_volume;
    use nalgebra::Vector3;
    use scindo_physics::mesh::{BoxPattern, box_mesh};

    #[test]
    fn every_format_is_read_back_bit_for_bit() {
        let folder = tempfile::tempdir().unwrap();
        let (low, high) = (Vector3::new(0.1, -1.0 / 3.0, 0.0), Vector3::new(1.0, 2.0, 1e-3));
        let mesh = box_mesh(low, high, [2, 3, 2], BoxPattern::Tet5 { parity: false });
        for name in ["a.vtu", "a.vtk", "a.msh"] {
            let path = folder.path().join(name);
            write_mesh(&path, &mesh).unwrap();
            let (back, health) = load_volume(&path, 1.0, true).unwrap();
            assert_eq!(back, mesh, "{name}");
            assert_eq!((health.flipped_tets, health.notes.len()), (0, 0));
        }
        assert!(write_mesh(&folder.path().join("a.blend"), &mesh).is_err());
        assert!(write_mesh(&folder.path().join("none/a.vtu"), &mesh).is_err());
    }
}
