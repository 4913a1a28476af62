//! Wavefront `.obj` surfaces, by `tobj`; polygons become triangle fans.

use std::io::Cursor;

use nalgebra::Vector3;

use super::cells::{CellKind, CellSoup, zero_based};
use super::error::MeshInError;
use super::mesh_file::MeshFile;
use super::scanner::Scanner;

/// Reads the positions and faces of all objects and groups in the file. Materials are ignored.
pub fn read(file: &str, bytes: &[u8]) -> Result<MeshFile, MeshInError> {
    let options = tobj::LoadOptions { ignore_points: true, ignore_lines: true, ..Default::default() };
    let positions = without_normals(bytes);
    let mut cursor = Cursor::new(&*positions);
    let (models, _) =
        tobj::load_obj_buf(&mut cursor, &options, |_| Ok(Default::default())).map_err(|error| {
            let mut scanner = Scanner::new(file, bytes);
            // tobj reads line by line, so the fault is in the line that ends at the cursor.
            let read = (cursor.position() as usize).min(bytes.len()).saturating_sub(1);
            let _ = scanner.take(read, "lines already read");
            MeshInError::Syntax {
                file: file.into(),
                place: scanner.place(),
                expected: "a line of an OBJ file (v, vn, vt, f, g, o, …)".into(),
                found: error.to_string(),
            }
        })?;
    let mut vertices: Vec<Vector3<f64>> = Vec::new();
    let mut cells = CellSoup::default();
    let mut polygon = Vec::new();
    for model in &models {
        let first = vertices.len() as i64;
        let (points, _) = model.mesh.positions.as_chunks::<3>();
        vertices.extend(points.iter().map(|p| Vector3::from(p.map(f64::from))));
        let mut corner = 0;
        let sizes = &model.mesh.face_arities;
        let n_faces = if sizes.is_empty() { model.mesh.indices.len() / 3 } else { sizes.len() };
        for face in 0..n_faces {
            let size = sizes.get(face).map_or(3, |&s| s as usize);
            polygon.clear();
            polygon.extend(model.mesh.indices.iter().skip(corner).take(size).map(|&i| first + i64::from(i)));
            corner += size;
            // Faces with fewer than three corners (points and lines in disguise) have no area.
            let _ = cells.add(CellKind::Polygon, &polygon);
        }
    }
    let n = vertices.len();
    cells.finish(file, vertices, zero_based(n))
}

/// The file with its normals and texture coordinates commented out; all places stay. Nobody reads them, and tobj panics
/// on a face that refers to one that cannot be.
fn without_normals(bytes: &[u8]) -> Vec<u8> {
    let mut out = bytes.to_vec();
    for line in out.split_mut(|&byte| byte == b'\n') {
        // tobj refuses a line that is not UTF-8.
        let Ok(text) = std::str::from_utf8(line) else { continue };
        let rest = text.trim_start();
        if matches!(rest.split_whitespace().next(), Some("vn" | "vt")) {
            let at = text.len() - rest.len();
            line[at..at + 2].copy_from_slice(b"# ");
        }
    }
    out
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    /// The indices of normals and texture coordinates are so large that arithmetic with them overflows.
    #[test]
    fn normals_that_cannot_be_do_no_harm() {
        let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\n \u{a0}vt 0 0\n\
                    f 1/-9223372036854775808/-9223372036854775808 2//9223372036854775807 3//4\n";
        let mesh = read("a.obj", text.as_bytes()).unwrap();
        assert!(format!("{mesh:?}").contains("[0, 1, 2]"), "{mesh:?}");
        let wrong = read("a.obj", b"vn 0 0 1\nv 0 0 0\nf 1//1 2//1 x\n").unwrap_err().to_string();
        assert!(wrong.contains("line 3"), "{wrong}");
    }
}
