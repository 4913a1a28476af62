//! Writes ParaView files: `.vtu` grids of tetrahedra and hexahedra, `.vtp` surfaces with fields, `.vtm` files that
//! group them, `.pvd` series.
//!
//! # Source
//! "VTK File Formats" (vtk.org): XML, base64 inline, 64-bit headers, little endian. Header and data of
//! an array are encoded separately, as VTK itself does.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use nalgebra::Vector3;

/// VTK's number for a tetrahedron.
const VTK_TETRA: u8 = 10;
/// VTK's number for a hexahedron.
const VTK_HEXAHEDRON: u8 = 12;
/// VTK counts the corners of a hexahedron around its lower face, then around its upper one.
const VTK_CORNERS: [usize; 8] = [0, 1, 3, 2, 4, 5, 7, 6];

/// A tetrahedron or a hexahedron.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SolidCell {
    /// Positively oriented.
    Tet([u32; 4]),
    /// Bit k of a corner's number is its end along axis k.
    Hex([u32; 8]),
}

/// Components of a symmetric tensor in VTK's order; ParaView shows these names.
const TENSOR_COMPONENTS: [&str; 6] = ["XX", "YY", "ZZ", "XY", "YZ", "XZ"];

/// The cells of a file, which also determine its kind.
#[derive(Clone, Copy, Debug)]
pub enum Cells<'a> {
    /// Tetrahedra, positively oriented: a `.vtu` file.
    Tets(&'a [[u32; 4]]),
    /// Tetrahedra and hexahedra: a `.vtu` file.
    Solids(&'a [SolidCell]),
    /// Triangles, counter-clockwise from outside: a `.vtp` file.
    Triangles(&'a [[u32; 3]]),
}

/// Values at points or in cells.
#[derive(Clone, Copy, Debug)]
pub enum FieldValues<'a> {
    /// One real per entry.
    Scalars(&'a [f64]),
    /// Three reals per entry.
    Vectors(&'a [Vector3<f64>]),
    /// A symmetric tensor per entry, in VTK's order: xx, yy, zz, xy, yz, xz.
    SymmetricTensors(&'a [[f64; 6]]),
    /// One integer per entry (tags, numbers).
    Integers(&'a [i32]),
}

/// A named field. The name includes the unit: `displacement_m`, `von_mises_pa`.
#[derive(Clone, Copy, Debug)]
pub struct Field<'a> {
    /// Name shown by ParaView.
    pub name: &'a str,
    /// One entry per point or per cell.
    pub values: FieldValues<'a>,
}

/// Contents of a file: points, cells and fields.
#[derive(Clone, Copy, Debug)]
pub struct Grid<'a> {
    /// Positions [m].
    pub points: &'a [Vector3<f64>],
    /// Cells over those points.
    pub cells: Cells<'a>,
    /// Fields at points.
    pub point_fields: &'a [Field<'a>],
    /// Fields in cells.
    pub cell_fields: &'a [Field<'a>],
    /// Simulation time [s] of a state whose points are current positions; `None` for a mesh alone.
    pub time_s: Option<f64>,
}

/// Why a grid was not written.
#[derive(Debug, thiserror::Error)]
pub enum VtuError {
    /// A field does not have one entry per point or cell.
    #[error("field '{field}' has {found} entries, the grid has {expected} {place}")]
    FieldLength {
        /// Name of the field.
        field: String,
        /// Entries found.
        found: usize,
        /// Number of points or cells.
        expected: usize,
        /// "points" or "cells".
        place: &'static str,
    },
    /// A cell names a point that does not exist.
    #[error("cell {cell} uses point {point}, the grid has {n_points}")]
    Index {
        /// Number of the cell.
        cell: usize,
        /// The point index found.
        point: u32,
        /// Number of points.
        n_points: usize,
    },
    /// The operating system could not write the file.
    #[error("cannot write the grid: {0}")]
    Io(#[from] io::Error),
}

/// Writes a grid to a file, replacing it: `.vtu` for solids, `.vtp` for triangles.
pub fn save_grid(path: &Path, grid: &Grid) -> Result<(), VtuError> {
    let mut out = BufWriter::new(File::create(path)?);
    write_grid(&mut out, grid)?;
    out.flush()?;
    Ok(())
}

/// Writes a grid as a `.vtu` or `.vtp` document.
pub fn write_grid(out: &mut impl Write, grid: &Grid) -> Result<(), VtuError> {
    let cells = CellArrays::of(grid)?;
    let (n_points, n_cells) = (grid.points.len(), cells.offsets.len());
    check_lengths(grid.point_fields, n_points, "points")?;
    check_lengths(grid.cell_fields, n_cells, "cells")?;
    let (kind, cells_of, counted) = match grid.cells {
        Cells::Tets(_) | Cells::Solids(_) => ("UnstructuredGrid", "Cells", "NumberOfCells"),
        Cells::Triangles(_) => ("PolyData", "Polys", "NumberOfPolys"),
    };
    begin(out, kind, "1.0")?;
    writeln!(out, "<{kind}>")?;
    if let Some(time) = grid.time_s {
        state(out, time)?;
    }
    writeln!(out, "<Piece NumberOfPoints=\"{n_points}\" {counted}=\"{n_cells}\">")?;
    writeln!(out, "<PointData>")?;
    fields(out, grid.point_fields)?;
    writeln!(out, "</PointData>\n<CellData>")?;
    fields(out, grid.cell_fields)?;
    writeln!(out, "</CellData>\n<Points>")?;
    array(out, &Array::of("Float64", "Points", 3), &vector_bytes(grid.points))?;
    writeln!(out, "</Points>\n<{cells_of}>")?;
    array(out, &Array::of("Int64", "connectivity", 1), &bytes(&cells.connectivity, i64::to_le_bytes))?;
    array(out, &Array::of("Int64", "offsets", 1), &bytes(&cells.offsets, i64::to_le_bytes))?;
    let types = match grid.cells {
        Cells::Tets(tets) => Some(vec![VTK_TETRA; tets.len()]),
        Cells::Solids(cells) => Some(cells.iter().map(SolidCell::vtk_type).collect()),
        Cells::Triangles(_) => None,
    };
    if let Some(types) = types {
        array(out, &Array::of("UInt8", "types", 1), &types)?;
    }
    writeln!(out, "</{cells_of}>\n</Piece>\n</{kind}>\n</VTKFile>")?;
    Ok(())
}

/// Writes the first lines of a file.
fn begin(out: &mut impl Write, kind: &str, version: &str) -> io::Result<()> {
    writeln!(out, "<?xml version=\"1.0\"?>")?;
    writeln!(
        out,
        "<VTKFile type=\"{kind}\" version=\"{version}\" byte_order=\"LittleEndian\" header_type=\"UInt64\">"
    )
}

/// Writes the time and the meaning of the points. The meaning is encoded as a number, because common readers
/// refuse text in field data.
fn state(out: &mut impl Write, time_s: f64) -> io::Result<()> {
    writeln!(out, "<!-- points: current positions [m]; displacement_m: current minus rest position -->")?;
    writeln!(out, "<FieldData>")?;
    for (kind, name, value) in
        [("Float64", "TimeValue", time_s.to_string()), ("Int32", "points_are_current_positions", "1".into())]
    {
        writeln!(
            out,
            "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfTuples=\"1\" format=\"ascii\">{value}</DataArray>"
        )?;
    }
    writeln!(out, "</FieldData>")
}

/// Writes a `.vtm`: the names of blocks and the file of each, relative to the `.vtm`.
pub fn save_vtm(path: &Path, blocks: &[(&str, &str)]) -> io::Result<()> {
    let mut out = BufWriter::new(File::create(path)?);
    begin(&mut out, "vtkMultiBlockDataSet", "1.0")?;
    writeln!(out, "<vtkMultiBlockDataSet>")?;
    for (index, (name, file)) in blocks.iter().enumerate() {
        let (name, file) = (quick_xml::escape::escape(*name), quick_xml::escape::escape(*file));
        writeln!(out, "<DataSet index=\"{index}\" name=\"{name}\" file=\"{file}\"/>")?;
    }
    writeln!(out, "</vtkMultiBlockDataSet>\n</VTKFile>")?;
    out.flush()
}

/// Writes a `.pvd` series: times [s] and the files for each, relative to the `.pvd`.
pub fn save_pvd(path: &Path, series: &[(f64, Vec<String>)]) -> io::Result<()> {
    let mut out = BufWriter::new(File::create(path)?);
    begin(&mut out, "Collection", "0.1")?;
    writeln!(out, "<Collection>")?;
    for (time, files) in series {
        for (part, file) in files.iter().enumerate() {
            let file = quick_xml::escape::escape(file.as_str());
            writeln!(out, "<DataSet timestep=\"{time}\" group=\"\" part=\"{part}\" file=\"{file}\"/>")?;
        }
    }
    writeln!(out, "</Collection>\n</VTKFile>")?;
    out.flush()
}

impl SolidCell {
    fn vtk_type(&self) -> u8 {
        match self {
            Self::Tet(_) => VTK_TETRA,
            Self::Hex(_) => VTK_HEXAHEDRON,
        }
    }
}

/// Cells in the arrays that VTK expects.
struct CellArrays {
    connectivity: Vec<i64>,
    /// End of each cell in the connectivity.
    offsets: Vec<i64>,
}

impl CellArrays {
    fn of(grid: &Grid) -> Result<Self, VtuError> {
        let mut arrays = CellArrays { connectivity: Vec::new(), offsets: Vec::new() };
        let n_points = grid.points.len();
        match grid.cells {
            Cells::Tets(tets) => tets.iter().try_for_each(|t| arrays.push(t, n_points))?,
            Cells::Solids(cells) => cells.iter().try_for_each(|cell| match cell {
                SolidCell::Tet(tet) => arrays.push(tet, n_points),
                SolidCell::Hex(hex) => arrays.push(&VTK_CORNERS.map(|corner| hex[corner]), n_points),
            })?,
            Cells::Triangles(triangles) => triangles.iter().try_for_each(|t| arrays.push(t, n_points))?,
        }
        Ok(arrays)
    }

    fn push(&mut self, nodes: &[u32], n_points: usize) -> Result<(), VtuError> {
        if let Some(&point) = nodes.iter().find(|&&n| n as usize >= n_points) {
            return Err(VtuError::Index { cell: self.offsets.len(), point, n_points });
        }
        self.connectivity.extend(nodes.iter().map(|&n| i64::from(n)));
        self.offsets.push(self.connectivity.len() as i64);
        Ok(())
    }
}

fn check_lengths(fields: &[Field], expected: usize, place: &'static str) -> Result<(), VtuError> {
    for field in fields {
        let found = match field.values {
            FieldValues::Scalars(values) => values.len(),
            FieldValues::Vectors(values) => values.len(),
            FieldValues::SymmetricTensors(values) => values.len(),
            FieldValues::Integers(values) => values.len(),
        };
        if found != expected {
            return Err(VtuError::FieldLength { field: field.name.into(), found, expected, place });
        }
    }
    Ok(())
}

fn fields(out: &mut impl Write, fields: &[Field]) -> io::Result<()> {
    for field in fields {
        let of = |kind, components| Array::of(kind, field.name, components);
        match field.values {
            FieldValues::Scalars(v) => array(out, &of("Float64", 1), &bytes(v, f64::to_le_bytes))?,
            FieldValues::Vectors(v) => array(out, &of("Float64", 3), &vector_bytes(v))?,
            FieldValues::SymmetricTensors(v) => {
                let named = Array { component_names: &TENSOR_COMPONENTS, ..of("Float64", 6) };
                array(out, &named, &bytes(v.as_flattened(), f64::to_le_bytes))?;
            }
            FieldValues::Integers(v) => array(out, &of("Int32", 1), &bytes(v, i32::to_le_bytes))?,
        }
    }
    Ok(())
}

fn bytes<T: Copy, const N: usize>(values: &[T], to_bytes: impl Fn(T) -> [u8; N]) -> Vec<u8> {
    values.iter().flat_map(|&v| to_bytes(v)).collect()
}

fn vector_bytes(values: &[Vector3<f64>]) -> Vec<u8> {
    values.iter().flat_map(|v| v.iter().flat_map(|c| c.to_le_bytes()).collect::<Vec<u8>>()).collect()
}

/// Attributes of a data array.
struct Array<'a> {
    kind: &'a str,
    name: &'a str,
    components: usize,
    /// Names of the components; empty if they have none.
    component_names: &'a [&'a str],
}

impl<'a> Array<'a> {
    fn of(kind: &'a str, name: &'a str, components: usize) -> Self {
        Self { kind, name, components, component_names: &[] }
    }
}

fn array(out: &mut impl Write, array: &Array, data: &[u8]) -> io::Result<()> {
    let Array { kind, components, .. } = array;
    let name = quick_xml::escape::escape(array.name);
    write!(out, "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\"")?;
    for (number, component) in array.component_names.iter().enumerate() {
        write!(out, " ComponentName{number}=\"{component}\"")?;
    }
    writeln!(out, " format=\"binary\">")?;
    let header = (data.len() as u64).to_le_bytes();
    writeln!(out, "{}{}\n</DataArray>", STANDARD.encode(header), STANDARD.encode(data))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::format::{MeshFile, read_mesh_bytes};

    const TETS: [[u32; 4]; 1] = [[0, 1, 2, 3]];

    fn points() -> Vec<Vector3<f64>> {
        vec![Vector3::zeros(), Vector3::x(), Vector3::y(), Vector3::z()]
    }

    #[test]
    fn what_is_written_is_read_back() {
        let points = points();
        let fields = [Field { name: "displacement <m>", values: FieldValues::Vectors(&points) }];
        let tags = [Field { name: "tag", values: FieldValues::Integers(&[-1]) }];
        let grid = Grid {
            points: &points,
            cells: Cells::Tets(&TETS),
            point_fields: &fields,
            cell_fields: &tags,
            time_s: Some(0.25),
        };
        let mut out = Vec::new();
        write_grid(&mut out, &grid).unwrap();
        let Ok(MeshFile::Volume(mesh)) = read_mesh_bytes("a.vtu", &out) else { panic!("not a volume") };
        assert_eq!((mesh.nodes, mesh.tets), (points, TETS.to_vec()));
    }

    #[test]
    fn hexahedra_stand_beside_tetrahedra_with_their_corners_in_vtks_order() {
        let corner = |c: usize| Vector3::from_fn(|k, _| (c >> k & 1) as f64);
        let points: Vec<Vector3<f64>> = (0..8).map(corner).collect();
        let cells = [SolidCell::Hex([0, 1, 2, 3, 4, 5, 6, 7]), SolidCell::Tet([0, 1, 2, 4])];
        let cells = Cells::Solids(&cells);
        let grid = Grid { points: &points, cells, point_fields: &[], cell_fields: &[], time_s: None };
        let arrays = CellArrays::of(&grid).unwrap();
        assert_eq!(arrays.connectivity, [0, 1, 3, 2, 4, 5, 7, 6, 0, 1, 2, 4]);
        assert_eq!(arrays.offsets, [8, 12]);
        let mut out = Vec::new();
        write_grid(&mut out, &grid).unwrap();
        let refused = read_mesh_bytes("a.vtu", &out).unwrap_err().to_string();
        assert!(refused.contains("hexahedron"), "{refused}");
    }

    #[test]
    fn a_tensor_names_its_components_in_vtks_order() {
        let tensor = [Field {
            name: "cauchy_stress_pa",
            values: FieldValues::SymmetricTensors(&[[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]]),
        }];
        let cells = Cells::Triangles(&[[0, 2, 1]]);
        let grid = Grid { points: &points(), cells, point_fields: &[], cell_fields: &tensor, time_s: None };
        let mut out = Vec::new();
        write_grid(&mut out, &grid).unwrap();
        let text = String::from_utf8(out).unwrap();
        assert!(text.contains("type=\"PolyData\"") && text.contains("NumberOfPolys=\"1\""), "{text}");
        assert!(text.contains("NumberOfComponents=\"6\" ComponentName0=\"XX\" ComponentName1=\"YY\""));
        assert!(text.contains("ComponentName3=\"XY\" ComponentName4=\"YZ\" ComponentName5=\"XZ\""));
    }

    #[test]
    fn fields_of_the_wrong_length_and_bad_indices_are_refused() {
        let points = points();
        let short = [Field { name: "speed", values: FieldValues::Scalars(&[1.0]) }];
        let cells = Cells::Tets(&TETS);
        let grid = Grid { points: &points, cells, point_fields: &short, cell_fields: &[], time_s: None };
        let message = write_grid(&mut Vec::new(), &grid).unwrap_err().to_string();
        assert!(message.contains("'speed' has 1 entries, the grid has 4 points"), "{message}");
        let grid = Grid { points: &points[..3], point_fields: &[], ..grid };
        assert!(matches!(write_grid(&mut Vec::new(), &grid), Err(VtuError::Index { point: 3, .. })));
    }
}
