//! ParaView files: `.vtu` grids of tetrahedra and triangles with fields, and `.pvd` time series.
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

/// VTK's numbers for the cells written here.
const VTK_TRIANGLE: u8 = 5;
const VTK_TETRA: u8 = 10;

/// Cells of one type; a grid may hold several blocks, one after the other.
#[derive(Clone, Copy, Debug)]
pub enum CellBlock<'a> {
    /// Tetrahedra, positively oriented.
    Tets(&'a [[u32; 4]]),
    /// Triangles, counter-clockwise from outside.
    Triangles(&'a [[u32; 3]]),
}

/// Values at points or in cells.
#[derive(Clone, Copy, Debug)]
pub enum FieldValues<'a> {
    /// One real each.
    Scalars(&'a [f64]),
    /// Three reals each.
    Vectors(&'a [Vector3<f64>]),
    /// One integer each (tags, numbers).
    Integers(&'a [i32]),
}

/// A named field. The unit belongs into the name: `displacement_m`, `von_mises_pa`.
#[derive(Clone, Copy, Debug)]
pub struct Field<'a> {
    /// Name shown by ParaView.
    pub name: &'a str,
    /// One entry per point or per cell (cells in the order of the blocks).
    pub values: FieldValues<'a>,
}

/// What a `.vtu` file holds.
#[derive(Clone, Copy, Debug)]
pub struct Grid<'a> {
    /// Positions [m].
    pub points: &'a [Vector3<f64>],
    /// Cells over those points.
    pub cells: &'a [CellBlock<'a>],
    /// Fields at points.
    pub point_fields: &'a [Field<'a>],
    /// Fields in cells.
    pub cell_fields: &'a [Field<'a>],
    /// Simulation time [s], if any.
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
        /// Entries.
        found: usize,
        /// Points or cells.
        expected: usize,
        /// "points" or "cells".
        place: &'static str,
    },
    /// A cell names a point that does not exist.
    #[error("cell {cell} uses point {point}, the grid has {n_points}")]
    Index {
        /// Cell number over all blocks.
        cell: usize,
        /// The index.
        point: u32,
        /// Points.
        n_points: usize,
    },
    /// The disk said no.
    #[error("cannot write the grid: {0}")]
    Io(#[from] io::Error),
}

/// Writes a grid to a file, replacing it.
pub fn save_vtu(path: &Path, grid: &Grid) -> Result<(), VtuError> {
    let mut out = BufWriter::new(File::create(path)?);
    write_vtu(&mut out, grid)?;
    out.flush()?;
    Ok(())
}

/// Writes a grid as a `.vtu` document.
pub fn write_vtu(out: &mut impl Write, grid: &Grid) -> Result<(), VtuError> {
    let cells = CellArrays::of(grid)?;
    let (n_points, n_cells) = (grid.points.len(), cells.types.len());
    check_lengths(grid.point_fields, n_points, "points")?;
    check_lengths(grid.cell_fields, n_cells, "cells")?;
    writeln!(out, "<?xml version=\"1.0\"?>")?;
    writeln!(
        out,
        "<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">"
    )?;
    writeln!(out, "<UnstructuredGrid>")?;
    if let Some(time) = grid.time_s {
        writeln!(
            out,
            "<FieldData><DataArray type=\"Float64\" Name=\"TimeValue\" NumberOfTuples=\"1\" format=\"ascii\">{time}</DataArray></FieldData>"
        )?;
    }
    writeln!(out, "<Piece NumberOfPoints=\"{n_points}\" NumberOfCells=\"{n_cells}\">")?;
    writeln!(out, "<PointData>")?;
    fields(out, grid.point_fields)?;
    writeln!(out, "</PointData>\n<CellData>")?;
    fields(out, grid.cell_fields)?;
    writeln!(out, "</CellData>\n<Points>")?;
    array(out, "Float64", "Points", 3, &vector_bytes(grid.points))?;
    writeln!(out, "</Points>\n<Cells>")?;
    array(out, "Int64", "connectivity", 1, &bytes(&cells.connectivity, i64::to_le_bytes))?;
    array(out, "Int64", "offsets", 1, &bytes(&cells.offsets, i64::to_le_bytes))?;
    array(out, "UInt8", "types", 1, &cells.types)?;
    writeln!(out, "</Cells>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>")?;
    Ok(())
}

/// Writes a `.pvd` series: times [s] and the file of each, relative to the `.pvd`.
pub fn save_pvd(path: &Path, series: &[(f64, String)]) -> io::Result<()> {
    let mut out = BufWriter::new(File::create(path)?);
    writeln!(
        out,
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\" byte_order=\"LittleEndian\">"
    )?;
    writeln!(out, "<Collection>")?;
    for (time, file) in series {
        let file = quick_xml::escape::escape(file.as_str());
        writeln!(out, "<DataSet timestep=\"{time}\" group=\"\" part=\"0\" file=\"{file}\"/>")?;
    }
    writeln!(out, "</Collection>\n</VTKFile>")?;
    out.flush()
}

/// Cells as VTK wants them.
struct CellArrays {
    connectivity: Vec<i64>,
    /// End of each cell in the connectivity.
    offsets: Vec<i64>,
    types: Vec<u8>,
}

impl CellArrays {
    fn of(grid: &Grid) -> Result<Self, VtuError> {
        let mut arrays = CellArrays { connectivity: Vec::new(), offsets: Vec::new(), types: Vec::new() };
        for block in grid.cells {
            match block {
                CellBlock::Tets(tets) => {
                    tets.iter().try_for_each(|t| arrays.push(t, VTK_TETRA, grid.points.len()))?;
                }
                CellBlock::Triangles(triangles) => {
                    triangles.iter().try_for_each(|t| arrays.push(t, VTK_TRIANGLE, grid.points.len()))?;
                }
            }
        }
        Ok(arrays)
    }

    fn push(&mut self, nodes: &[u32], vtk_type: u8, n_points: usize) -> Result<(), VtuError> {
        if let Some(&point) = nodes.iter().find(|&&n| n as usize >= n_points) {
            return Err(VtuError::Index { cell: self.types.len(), point, n_points });
        }
        self.connectivity.extend(nodes.iter().map(|&n| i64::from(n)));
        self.offsets.push(self.connectivity.len() as i64);
        self.types.push(vtk_type);
        Ok(())
    }
}

fn check_lengths(fields: &[Field], expected: usize, place: &'static str) -> Result<(), VtuError> {
    for field in fields {
        let found = match field.values {
            FieldValues::Scalars(values) => values.len(),
            FieldValues::Vectors(values) => values.len(),
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
        match field.values {
            FieldValues::Scalars(v) => array(out, "Float64", field.name, 1, &bytes(v, f64::to_le_bytes))?,
            FieldValues::Vectors(v) => array(out, "Float64", field.name, 3, &vector_bytes(v))?,
            FieldValues::Integers(v) => array(out, "Int32", field.name, 1, &bytes(v, i32::to_le_bytes))?,
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

fn array(
    out: &mut impl Write,
    type_name: &str,
    name: &str,
    components: usize,
    data: &[u8],
) -> io::Result<()> {
    let name = quick_xml::escape::escape(name);
    writeln!(
        out,
        "<DataArray type=\"{type_name}\" Name=\"{name}\" NumberOfComponents=\"{components}\" format=\"binary\">"
    )?;
    let header = (data.len() as u64).to_le_bytes();
    writeln!(out, "{}{}\n</DataArray>", STANDARD.encode(header), STANDARD.encode(data))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::mesh_in::{MeshFile, read_mesh_bytes};

    const TETS: [[u32; 4]; 1] = [[0, 1, 2, 3]];

    fn points() -> Vec<Vector3<f64>> {
        vec![Vector3::zeros(), Vector3::x(), Vector3::y(), Vector3::z()]
    }

    #[test]
    fn what_is_written_is_read_back() {
        let points = points();
        let fields = [Field { name: "displacement <m>", values: FieldValues::Vectors(&points) }];
        let tags = [Field { name: "tag", values: FieldValues::Integers(&[-1, 0]) }];
        let cells = [CellBlock::Tets(&TETS), CellBlock::Triangles(&[[0, 2, 1]])];
        let grid = Grid {
            points: &points,
            cells: &cells,
            point_fields: &fields,
            cell_fields: &tags,
            time_s: Some(0.25),
        };
        let mut out = Vec::new();
        write_vtu(&mut out, &grid).unwrap();
        let Ok(MeshFile::Volume(mesh)) = read_mesh_bytes("a.vtu", &out) else { panic!("not a volume") };
        assert_eq!((mesh.nodes, mesh.tets), (points, TETS.to_vec()));
    }

    #[test]
    fn fields_of_the_wrong_length_and_bad_indices_are_refused() {
        let points = points();
        let short = [Field { name: "speed", values: FieldValues::Scalars(&[1.0]) }];
        let cells = [CellBlock::Tets(&TETS)];
        let grid =
            Grid { points: &points, cells: &cells, point_fields: &short, cell_fields: &[], time_s: None };
        let message = write_vtu(&mut Vec::new(), &grid).unwrap_err().to_string();
        assert!(message.contains("'speed' has 1 entries, the grid has 4 points"), "{message}");
        let grid = Grid { points: &points[..3], point_fields: &[], ..grid };
        assert!(matches!(write_vtu(&mut Vec::new(), &grid), Err(VtuError::Index { point: 3, .. })));
    }
}
