//! Stanford `.ply` surfaces, text and binary, by `ply-rs-bw`.

use nalgebra::Vector3;
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{Property, PropertyAccess, PropertyAccessResult};

use super::cells::{CellKind, CellSoup, zero_based};
use super::error::MeshInError;
use super::mesh_file::MeshFile;

/// One row of any element. The parser fills what a surface needs and drops the rest (colours, normals, …).
struct Row {
    position: [f64; 3],
    corners: Vec<i64>,
    strip: bool,
}

impl PropertyAccess for Row {
    fn new() -> Self {
        Row { position: [f64::NAN; 3], corners: Vec::new(), strip: false }
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        match name {
            "x" | "y" | "z" => {
                let Some(value) = real(&property) else { return PropertyAccessResult::UnsupportedType };
                self.position[usize::from(name.as_bytes()[0] - b'x')] = value;
            }
            "vertex_indices" | "vertex_index" | "tristrips" => {
                let Some(list) = integers(property) else { return PropertyAccessResult::UnsupportedType };
                self.corners = list;
                self.strip = name == "tristrips";
            }
            _ => return PropertyAccessResult::Ignored,
        }
        PropertyAccessResult::Set
    }
}

fn real(property: &Property) -> Option<f64> {
    Some(match *property {
        Property::Char(v) => v.into(),
        Property::UChar(v) => v.into(),
        Property::Short(v) => v.into(),
        Property::UShort(v) => v.into(),
        Property::Int(v) => v.into(),
        Property::UInt(v) => v.into(),
        Property::Float(v) => v.into(),
        Property::Double(v) => v,
        _ => return None,
    })
}

fn integers(property: Property) -> Option<Vec<i64>> {
    Some(match property {
        Property::ListChar(v) => v.into_iter().map(Into::into).collect(),
        Property::ListUChar(v) => v.into_iter().map(Into::into).collect(),
        Property::ListShort(v) => v.into_iter().map(Into::into).collect(),
        Property::ListUShort(v) => v.into_iter().map(Into::into).collect(),
        Property::ListInt(v) => v.into_iter().map(Into::into).collect(),
        Property::ListUInt(v) => v.into_iter().map(Into::into).collect(),
        _ => return None,
    })
}

/// Reads the elements `vertex` (x, y, z) and `face` (vertex_indices) or `tristrips`.
pub(super) fn read(file: &str, bytes: &[u8]) -> Result<MeshFile, MeshInError> {
    let fault = |place: &str, found: String| MeshInError::Syntax {
        file: file.into(),
        place: place.into(),
        expected: "a PLY file with elements vertex (x, y, z) and face (vertex_indices)".into(),
        found,
    };
    let parser = Parser::<Row>::new();
    let mut reader = Reader::new(bytes);
    let header = parser.read_header(&mut reader).map_err(|e| fault("header", e.to_string()))?;
    for (name, element) in &header.elements {
        if element.count > bytes.len() {
            return Err(MeshInError::Limit {
                file: file.into(),
                place: "header".into(),
                what: format!("'{name}' elements"),
                value: element.count as u64,
                limit: bytes.len() as u64,
                reason: format!("the file has {} bytes", bytes.len()),
            });
        }
    }
    let payload = parser.read_payload(&mut reader, &header).map_err(|e| fault("data", e.to_string()))?;
    let rows = |name: &str| payload.get(name).map(Vec::as_slice).unwrap_or_default();
    let vertices: Vec<Vector3<f64>> = rows("vertex").iter().map(|r| Vector3::from(r.position)).collect();
    let mut cells = CellSoup::default();
    for row in rows("face") {
        if !cells.add(CellKind::Polygon, &row.corners) {
            return Err(fault("element face", format!("a face with {} corners", row.corners.len())));
        }
    }
    for row in rows("tristrips") {
        // -1 separates strips.
        for strip in row.corners.split(|&i| i == -1).filter(|s| s.len() >= 3) {
            let _ = cells.add(CellKind::Strip, strip);
        }
    }
    let n = vertices.len();
    cells.finish(file, vertices, zero_based(n))
}
