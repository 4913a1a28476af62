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
    let mut cursor = Cursor::new(bytes);
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
