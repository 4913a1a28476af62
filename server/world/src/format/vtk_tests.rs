//! Tests of the VTK readers, legacy and XML, with small files written here.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use std::io::Write;

use crate::format::{MeshFile, read_mesh_bytes};

const POINTS: [[f32; 3]; 5] = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.], [1., 1., 1.]];
const GRID: &str = "# vtk DataFile Version 3.0\ntitle\nASCII\nDATASET UNSTRUCTURED_GRID\n\
    FIELD FieldData 1\nT 1 1 double\n0.5\nPOINTS 5 float\n0 0 0 1 0 0 0 1 0\n0 0 1 1 1 1\n\
    CELLS 3 13\n4 0 1 2 3\n4 1 2 3 4\n2 0 1\nCELL_TYPES 3\n10 10 3\nPOINT_DATA 5\nSCALARS a float\n";

fn tets(file: &str, bytes: &[u8]) -> Vec<[u32; 4]> {
    match read_mesh_bytes(file, bytes).unwrap() {
        MeshFile::Volume(volume) => {
            assert_eq!(volume.nodes.len(), 5);
            assert_eq!(volume.nodes[4].x, 1.0);
            volume.tets
        }
        MeshFile::Surface(_) => panic!("a surface"),
    }
}

fn triangles(bytes: &[u8]) -> Vec<[u32; 3]> {
    match read_mesh_bytes("s.vtk", bytes).unwrap() {
        MeshFile::Surface(surface) => surface.triangles,
        MeshFile::Volume(_) => panic!("a volume"),
    }
}

/// The two tetrahedra in a binary file.
fn binary_grid() -> Vec<u8> {
    let mut binary =
        b"# vtk DataFile Version 3.0\nt\nBINARY\nDATASET UNSTRUCTURED_GRID\nPOINTS 5 float\n".to_vec();
    POINTS.iter().flatten().for_each(|c| binary.extend(c.to_be_bytes()));
    binary.extend(b"\nCELLS 2 10\n");
    [4i32, 0, 1, 2, 3, 4, 1, 2, 3, 4].iter().for_each(|i| binary.extend(i.to_be_bytes()));
    binary.extend(b"\nCELL_TYPES 2\n");
    [10i32, 10].iter().for_each(|i| binary.extend(i.to_be_bytes()));
    binary
}

#[test]
fn legacy_grids_text_and_binary_old_and_new() {
    let expected = vec![[0, 1, 2, 3], [1, 2, 3, 4]];
    assert_eq!(tets("a.vtk", GRID.as_bytes()), expected);
    let v5 = "# vtk DataFile Version 5.1\nt\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 5 double\n\
        0 0 0 1 0 0 0 1 0 0 0 1 1 1 1\nMETADATA\nINFORMATION 0\n\nCELLS 3 8\nOFFSETS vtktypeint64\n0 4 8\n\
        CONNECTIVITY vtktypeint64\n0 1 2 3 1 2 3 4\nCELL_TYPES 2\n10\n10\n";
    assert_eq!(tets("a.vtk", v5.as_bytes()), expected);
    assert_eq!(tets("a.vtk", &binary_grid()), expected);
}

/// Array, number and tetrahedra of every group.
fn groups(file: &str, bytes: &[u8]) -> Vec<(String, i64, Vec<u32>)> {
    let MeshFile::Volume(volume) = read_mesh_bytes(file, bytes).unwrap() else { panic!("a surface") };
    volume.groups.into_iter().map(|group| (group.array, group.number, group.tets)).collect()
}

#[test]
fn whole_numbers_in_cells_become_groups() {
    // Behind the data of points, beside arrays that are no labels; the third cell is a line.
    let data = "CELL_DATA 3\nSCALARS pressure float 1\nLOOKUP_TABLE default\n0.5 1 2\nVECTORS v float\n\
        1 2 3 4 5 6 7 8 9\nSCALARS label int\nLOOKUP_TABLE default\n4 7 9\n\
        FIELD more 2\npart 1 3 double\n2 2 2\npair 2 3 int\n1 2 3 4 5 6\n";
    let whole = GRID
        .replace("SCALARS a float\n", &format!("SCALARS a float\nLOOKUP_TABLE default\n1 2 3 4 5\n{data}"));
    let expected = [("label", 4, vec![0]), ("label", 7, vec![1]), ("part", 2, vec![0, 1])]
        .map(|(a, n, t)| (a.to_owned(), n, t));
    assert_eq!(groups("a.vtk", whole.as_bytes()), expected);
    // What is broken or unknown ends the data, not the mesh.
    for (from, to) in [("FIELD more 2", "UNKNOWN"), ("part 1 3 double\n2", "part 1 3 double\ntwo")] {
        assert_eq!(groups("a.vtk", whole.replace(from, to).as_bytes()), expected[..2]);
    }
    assert!(groups("a.vtk", GRID.as_bytes()).is_empty());
    let mut binary = binary_grid();
    binary.extend(b"\nCELL_DATA 2\nSCALARS m short 1\nLOOKUP_TABLE default\n");
    [3i16, -1].iter().for_each(|i| binary.extend(i.to_be_bytes()));
    assert_eq!(groups("a.vtk", &binary), [("m".to_owned(), -1, vec![1]), ("m".to_owned(), 3, vec![0])]);
}

#[test]
fn polygons_quads_and_strips_become_triangles() {
    let head = "# vtk DataFile Version 3.0\nt\nASCII\nDATASET POLYDATA\nPOINTS 5 float\n0 0 0 1 0 0 1 1 0 0 1 0 0 0 1\n";
    let polygons = format!("{head}VERTICES 1 2\n1 0\nPOLYGONS 2 11\n4 0 1 2 3\n5 0 1 2 3 4\n");
    assert_eq!(triangles(polygons.as_bytes()), [[0, 1, 2], [0, 2, 3], [0, 1, 2], [0, 2, 3], [0, 3, 4]]);
    let strips = format!("{head}LINES 1 3\n2 0 1\nTRIANGLE_STRIPS 1 6\n5 0 1 2 3 4\n");
    assert_eq!(triangles(strips.as_bytes()), [[0, 1, 2], [2, 1, 3], [2, 3, 4]]);
}

#[test]
fn what_is_not_read_is_refused_with_place_and_way_out() {
    let error = |text: String| read_mesh_bytes("g.vtk", text.as_bytes()).unwrap_err().to_string();
    let hex = GRID
        .replace("CELLS 3 13\n4 0 1 2 3\n4 1 2 3 4\n2 0 1", "CELLS 1 9\n8 0 1 2 3 4 0 1 2")
        .replace("CELL_TYPES 3\n10 10 3", "CELL_TYPES 1\n12");
    let message = error(hex);
    assert!(
        message.contains("hexahedron") && message.contains("cell 0") && message.contains("surface"),
        "{message}"
    );
    let message = error(GRID.replace("UNSTRUCTURED_GRID", "STRUCTURED_POINTS"));
    assert!(message.contains("STRUCTURED_POINTS"), "{message}");
    let message = error(GRID.replace("4 1 2 3 4\n", "4 1 2 3 9\n"));
    assert!(message.contains("tetrahedron 1 uses node 9"), "{message}");
    let message = error(GRID.replace("POINTS 5", "POINTS 999999999"));
    assert!(message.contains("announces 999999999 points"), "{message}");
    let message = error(GRID.replace("CELL_TYPES 3\n10 10 3", "CELL_TYPES 2\n10 10"));
    assert!(message.contains("CELL_TYPES for 3 cells"), "{message}");
}

/// How the test writes its arrays.
#[derive(Clone, Copy, PartialEq)]
enum Style {
    Ascii,
    Joined,
    Padded,
    Zlib,
    AppendedRaw,
    AppendedBase64,
}

fn bytes_of(values: &[f64], is_real: bool) -> Vec<u8> {
    values.iter().flat_map(|&v| if is_real { v.to_le_bytes() } else { (v as i64).to_le_bytes() }).collect()
}

fn vtu(style: Style) -> Vec<u8> {
    let points: Vec<f64> = POINTS.iter().flatten().map(|&c| f64::from(c)).collect();
    let arrays: [(&str, &str, &str, Vec<f64>); 6] = [
        ("Points", "Float64", "", points),
        ("Cells", "Int64", "connectivity", vec![0., 1., 2., 3., 1., 2., 3., 4.]),
        ("Cells", "Int64", "offsets", vec![4., 8.]),
        ("Cells", "Int64", "types", vec![10., 10.]),
        ("CellData", "Int64", "label", vec![4., 7.]),
        ("CellData", "Float64", "share", vec![0.5, 1.]),
    ];
    let compressor = if style == Style::Zlib { " compressor=\"vtkZLibDataCompressor\"" } else { "" };
    let mut text = format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" \
         header_type=\"UInt64\"{compressor}>\n<UnstructuredGrid><Piece NumberOfPoints=\"5\" NumberOfCells=\"2\">\n"
    );
    let mut appended: Vec<u8> = Vec::new();
    for (section, type_name, name, values) in &arrays {
        let raw = bytes_of(values, type_name.starts_with('F'));
        let header = (raw.len() as u64).to_le_bytes();
        let (format, content) = match style {
            Style::Ascii => ("ascii".to_string(), values.iter().map(|v| format!("{v} ")).collect::<String>()),
            Style::Joined => ("binary".into(), STANDARD.encode([header.as_slice(), &raw].concat())),
            Style::Padded => {
                ("binary".into(), format!("\n{}{}\n", STANDARD.encode(header), STANDARD.encode(&raw)))
            }
            Style::Zlib => {
                let (first, second) = raw.split_at(raw.len() / 2);
                let blocks = [first, second].map(|b| {
                    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
                    encoder.write_all(b).unwrap();
                    encoder.finish().unwrap()
                });
                let sizes = [2, first.len(), second.len(), blocks[0].len(), blocks[1].len()];
                let header: Vec<u8> = sizes.iter().flat_map(|&s| (s as u64).to_le_bytes()).collect();
                ("binary".into(), format!("{}{}", STANDARD.encode(header), STANDARD.encode(blocks.concat())))
            }
            Style::AppendedRaw | Style::AppendedBase64 => {
                let format = format!("appended\" offset=\"{}", appended.len());
                let block = [header.as_slice(), &raw].concat();
                if style == Style::AppendedRaw {
                    appended.extend(block)
                } else {
                    appended.extend(STANDARD.encode(block).bytes())
                }
                (format, String::new())
            }
        };
        text += &format!(
            "<{section}><DataArray type=\"{type_name}\" Name=\"{name}\" format=\"{format}\">{content}</DataArray></{section}>\n"
        );
    }
    text += "</Piece></UnstructuredGrid>\n";
    let mut bytes = text.into_bytes();
    if !appended.is_empty() {
        let encoding = if style == Style::AppendedRaw { "raw" } else { "base64" };
        bytes.extend(format!("<AppendedData encoding=\"{encoding}\">\n_").bytes());
        bytes.extend(appended);
        bytes.extend(b"\n</AppendedData>\n");
    }
    bytes.extend(b"</VTKFile>\n");
    bytes
}

const STYLES: [Style; 6] =
    [Style::Ascii, Style::Joined, Style::Padded, Style::Zlib, Style::AppendedRaw, Style::AppendedBase64];

#[test]
fn xml_grids_in_every_encoding() {
    for style in STYLES {
        let bytes = vtu(style);
        assert_eq!(tets("a.vtu", &bytes), [[0, 1, 2, 3], [1, 2, 3, 4]]);
        let label = |number, tet| ("label".to_owned(), number, vec![tet]);
        assert_eq!(groups("a.vtu", &bytes), [label(4, 0), label(7, 1)]);
    }
}

#[test]
fn xml_damage_is_an_error() {
    for style in STYLES {
        let whole = vtu(style);
        for length in (0..whole.len().saturating_sub(90)).step_by(7) {
            assert!(read_mesh_bytes("a.vtu", &whole[..length]).is_err(), "{length} bytes accepted");
        }
    }
    let lz4 = String::from_utf8(vtu(Style::Zlib)).unwrap().replace("vtkZLib", "vtkLZ4");
    let message = read_mesh_bytes("a.vtu", lz4.as_bytes()).unwrap_err().to_string();
    assert!(message.contains("vtkLZ4DataCompressor"), "{message}");
}

/// Every byte in turn takes values that damage numbers, counts, tags and base64.
#[test]
fn mutated_xml_never_panics() {
    for style in STYLES {
        let whole = vtu(style);
        for at in 0..whole.len() {
            for value in [b'9', b'-', b'<', b'"', 0xff, 0x00] {
                let mut bytes = whole.clone();
                bytes[at] = value;
                let _ = read_mesh_bytes("a.vtu", &bytes);
            }
        }
    }
}
