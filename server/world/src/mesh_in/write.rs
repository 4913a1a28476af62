//! Writes meshes: `scindo mesh IN -o OUT` writes tetrahedra as `.vtu`, `.vtk` or `.msh`.

use std::fmt::Write;
use std::path::Path;

use scindo_physics::mesh::TetMesh;

use crate::format::vtu::{Cells, Field, FieldValues, Grid, save_grid};
use crate::format::{CellGroup, GMSH_PHYSICAL, MeshInError};

/// Writes a mesh in the format of the extension: `.vtu`, `.vtk` (legacy, text) or `.msh` (Gmsh 2.2, text).
///
/// The groups of its tetrahedra become cell arrays of VTK files, without their names. A `.msh` file has one physical
/// group per tetrahedron: those of Gmsh, or of the first array if there are none.
pub fn write_mesh(path: &Path, mesh: &TetMesh, groups: &[CellGroup]) -> Result<(), MeshInError> {
    let fail = |reason: String| MeshInError::Write { path: path.to_path_buf(), reason };
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    match extension.as_str() {
        "vtu" => {
            let arrays = arrays(mesh, groups);
            let field = |(name, values)| Field { name, values: FieldValues::Integers(values) };
            let cell_fields: Vec<Field> =
                arrays.iter().map(|(name, values)| field((*name, values))).collect();
            let grid = Grid {
                points: &mesh.nodes,
                cells: Cells::Tets(&mesh.tets),
                point_fields: &[],
                cell_fields: &cell_fields,
                time_s: None,
            };
            save_grid(path, &grid).map_err(|e| fail(e.to_string()))
        }
        "vtk" => std::fs::write(path, vtk_text(mesh, groups)).map_err(|e| fail(e.to_string())),
        "msh" => std::fs::write(path, msh_text(mesh, groups)).map_err(|e| fail(e.to_string())),
        other => Err(fail(format!("unknown format '.{other}'; known are .vtu .vtk .msh"))),
    }
}

/// The value of every array of groups in every tetrahedron; 0 where it has none.
fn arrays<'a>(mesh: &TetMesh, groups: &'a [CellGroup]) -> Vec<(&'a str, Vec<i32>)> {
    let mut arrays: Vec<(&str, Vec<i32>)> = Vec::new();
    for group in groups {
        let known = arrays.iter().position(|(name, _)| *name == group.array);
        let at = known.unwrap_or_else(|| {
            arrays.push((&group.array, vec![0; mesh.tets.len()]));
            arrays.len() - 1
        });
        let number = i32::try_from(group.number).unwrap_or(i32::MAX);
        group.tets.iter().for_each(|&tet| arrays[at].1[tet as usize] = number);
    }
    arrays
}

fn vtk_text(mesh: &TetMesh, groups: &[CellGroup]) -> String {
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
    let arrays = arrays(mesh, groups);
    if !arrays.is_empty() {
        let _ = writeln!(text, "CELL_DATA {n}");
    }
    for (name, values) in arrays {
        // The format ends names at white space.
        let name = name.replace(char::is_whitespace, "_");
        let _ = writeln!(text, "SCALARS {name} int 1\nLOOKUP_TABLE default");
        values.iter().for_each(|value| {
            let _ = writeln!(text, "{value}");
        });
    }
    text
}

fn msh_text(mesh: &TetMesh, groups: &[CellGroup]) -> String {
    let mut text = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n".to_owned();
    let array = groups.iter().find(|group| group.array == GMSH_PHYSICAL).or(groups.first());
    let of_array = |group: &&CellGroup| array.is_some_and(|array| group.array == array.array);
    let named: Vec<(i64, &str)> = groups
        .iter()
        .filter(of_array)
        .filter_map(|group| group.name.as_deref().map(|name| (group.number, name)))
        .collect();
    if !named.is_empty() {
        let _ = writeln!(text, "$PhysicalNames\n{}", named.len());
        for (number, name) in named {
            let _ = writeln!(text, "3 {number} \"{name}\"");
        }
        text.push_str("$EndPhysicalNames\n");
    }
    let mut physical = vec![1; mesh.tets.len()];
    if array.is_some() {
        physical.fill(0);
    }
    for group in groups.iter().filter(of_array) {
        group.tets.iter().for_each(|&tet| physical[tet as usize] = group.number);
    }
    let _ = writeln!(text, "$Nodes\n{}", mesh.nodes.len());
    for (i, x) in mesh.nodes.iter().enumerate() {
        let _ = writeln!(text, "{} {} {} {}", i + 1, x.x, x.y, x.z);
    }
    let _ = writeln!(text, "$EndNodes\n$Elements\n{}", mesh.tets.len());
    for (i, (tet, physical)) in mesh.tets.iter().zip(physical).enumerate() {
        let [a, b, c, d] = tet.map(|n| n + 1);
        let _ = writeln!(text, "{} 4 2 {physical} 1 {a} {b} {c} {d}", i + 1);
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
            write_mesh(&path, &mesh, &[]).unwrap();
            let (back, health) = load_volume(&path, 1.0, true).unwrap();
            assert_eq!(back, mesh, "{name}");
            assert_eq!((health.flipped_tets, health.notes.len()), (0, 0));
        }
        assert!(write_mesh(&folder.path().join("a.blend"), &mesh, &[]).is_err());
        assert!(write_mesh(&folder.path().join("none/a.vtu"), &mesh, &[]).is_err());
    }

    #[test]
    fn groups_are_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let mesh = box_mesh(Vector3::zeros(), Vector3::repeat(1.0), [1; 3], BoxPattern::Tet6);
        let group = |array: &str, number, name: Option<&str>, tets: &[u32]| CellGroup {
            array: array.into(),
            number,
            name: name.map(Into::into),
            tets: tets.to_vec(),
        };
        let physical = |name| group(GMSH_PHYSICAL, 7, name, &[1, 4]);
        let label = [group("my_label", 0, None, &[0, 1, 2, 4, 5]), group("my_label", 3, None, &[3])];
        let [zero, three] = label;
        let others = group(GMSH_PHYSICAL, 0, None, &[0, 2, 3, 5]);
        for (name, expected) in [
            ("a.msh", vec![physical(Some("tumour"))]),
            ("a.vtu", vec![others.clone(), physical(None), zero.clone(), three.clone()]),
            ("a.vtk", vec![others, physical(None), zero, three.clone()]),
        ] {
            let path = folder.path().join(name);
            write_mesh(&path, &mesh, &[physical(Some("tumour")), three.clone()]).unwrap();
            let (_, health) = load_volume(&path, 1.0, true).unwrap();
            assert_eq!(health.groups, expected, "{name}");
        }
    }
}
