//! `.stl` surfaces, text and binary, by `stl_io`. The format repeats every vertex; welding is in `health`.

use std::io::Cursor;

use nalgebra::Vector3;

use super::cells::{CellKind, CellSoup, zero_based};
use super::error::MeshInError;
use super::mesh_file::MeshFile;

/// Bytes of a binary header with the triangle count, and of one triangle.
const HEADER: usize = 84;
const TRIANGLE: usize = 50;

/// Reads all facets. Their normals are ignored; users recompute them from the corners.
pub(super) fn read(file: &str, bytes: &[u8]) -> Result<MeshFile, MeshInError> {
    let binary_count = binary_count(bytes);
    let fault = |number: usize, expected: &str, found: String| MeshInError::Syntax {
        file: file.into(),
        place: format!("triangle {number}"),
        expected: expected.into(),
        found,
    };
    if let Some(count) = binary_count
        && count > (bytes.len() - HEADER) / TRIANGLE
    {
        return Err(MeshInError::Limit {
            file: file.into(),
            place: "byte 80".into(),
            what: "triangles".into(),
            value: count as u64,
            limit: ((bytes.len() - HEADER) / TRIANGLE) as u64,
            reason: format!("the file has {} bytes", bytes.len()),
        });
    }
    let mut cursor = Cursor::new(match binary_count {
        Some(_) => blank_header(bytes),
        None => one_solid(bytes).ok_or_else(|| {
            fault(0, "a text file that ends with endsolid, or a binary file", "another end".into())
        })?,
    });
    let triangles = stl_io::create_stl_reader(&mut cursor)
        .map_err(|e| fault(0, "a text or binary STL file", e.to_string()))?;
    let mut vertices = Vec::new();
    let mut cells = CellSoup::default();
    for (number, triangle) in triangles.enumerate() {
        let triangle = triangle.map_err(|e| fault(number, "facet, loop, three vertices", e.to_string()))?;
        let first = vertices.len() as i64;
        vertices.extend(triangle.vertices.iter().map(|v| Vector3::from(v.0.map(f64::from))));
        let _ = cells.add(CellKind::Triangle, &[first, first + 1, first + 2]);
    }
    let n = vertices.len();
    cells.finish(file, vertices, zero_based(n))
}

/// Blanks the header of a binary file. It may also start with "solid", by which the reader recognises text
/// files.
fn blank_header(bytes: &[u8]) -> Vec<u8> {
    let mut owned = bytes.to_vec();
    owned[..80].fill(0);
    owned
}

/// Converts a text file with any number of solids to one with a single solid, in lower case. `None` if the
/// last solid is not closed, since the file was cut off.
fn one_solid(bytes: &[u8]) -> Option<Vec<u8>> {
    let text = String::from_utf8_lossy(bytes).to_ascii_lowercase();
    let lines: Vec<&str> = text.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    if !lines.last()?.starts_with("endsolid") {
        return None;
    }
    let facets = lines.iter().filter(|line| !line.starts_with("solid") && !line.starts_with("endsolid"));
    let mut joined = String::from("solid joined\n");
    facets.for_each(|line| {
        joined.push_str(line);
        joined.push('\n');
    });
    joined.push_str("endsolid\n");
    Some(joined.into_bytes())
}

/// The triangle count of a binary file; `None` for a text file.
fn binary_count(bytes: &[u8]) -> Option<usize> {
    let count = u32::from_le_bytes(*bytes.get(80..84)?.first_chunk::<4>()?) as usize;
    let text = bytes.trim_ascii_start().get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"));
    let fits_exactly = count.checked_mul(TRIANGLE)?.checked_add(HEADER)? == bytes.len();
    (!text || fits_exactly).then_some(count)
}
