//! VTK legacy `.vtk`: `UNSTRUCTURED_GRID` and `POLYDATA`, text and binary, file versions 1 to 5.
//!
//! # Source
//! "VTK File Formats" (vtk.org), simple legacy formats; 5.x stores cells as OFFSETS and CONNECTIVITY.

use nalgebra::Vector3;

use super::cells::{CellSoup, zero_based};
use super::error::MeshInError;
use super::groups::Labels;
use super::mesh_file::MeshFile;
use super::scanner::{ByteOrder, Encoding, Scanner};
use super::vtk_cells;
use super::vtk_legacy_data::{data, skip_metadata, width_of};

/// Reads a legacy VTK file. Of its data only cell arrays of one whole number per cell are used.
pub(super) fn read(file: &str, bytes: &[u8]) -> Result<MeshFile, MeshInError> {
    let mut scanner = Scanner::new(file, bytes);
    let at = scanner.clone();
    if !scanner.line().starts_with(b"# vtk DataFile Version") {
        return Err(at.expected("'# vtk DataFile Version …'"));
    }
    scanner.line();
    let at = scanner.clone();
    let encoding = match scanner.word("ASCII or BINARY")? {
        "ASCII" => Encoding::Text,
        "BINARY" => Encoding::Binary(ByteOrder::Big),
        _ => return Err(at.expected("ASCII or BINARY")),
    };
    let mut content = Content { encoding, points: Vec::new(), cells: CellSoup::default() };
    let mut grid: Option<Lists> = None;
    let mut types: Option<Vec<i64>> = None;
    let mut labels = Vec::new();
    while !scanner.at_end() {
        let at = scanner.clone();
        match scanner.word("a keyword such as POINTS")? {
            "DATASET" => match scanner.word("a data set type")? {
                "UNSTRUCTURED_GRID" | "POLYDATA" => {}
                other => {
                    return Err(at.unsupported(
                        format!("data set {other}"),
                        "save it as UNSTRUCTURED_GRID of tetrahedra or as POLYDATA",
                    ));
                }
            },
            "FIELD" => content.skip_fields(&mut scanner)?,
            "METADATA" => skip_metadata(&mut scanner),
            "POINTS" => content.points(&mut scanner)?,
            "VERTICES" => drop(content.lists(&mut scanner)?),
            "LINES" => drop(content.lists(&mut scanner)?),
            "POLYGONS" => content.faces(&mut scanner, 7)?,
            "TRIANGLE_STRIPS" => content.faces(&mut scanner, 6)?,
            "CELLS" => grid = Some(content.lists(&mut scanner)?),
            "CELL_TYPES" => {
                let n = scanner.count("cell types", 1)?;
                types = Some(content.integers(&mut scanner, n, 4, "a cell type")?);
            }
            "POINT_DATA" | "CELL_DATA" => {
                labels = data(at, encoding);
                break;
            }
            _ => return Err(at.expected("POINTS, CELLS, CELL_TYPES, POLYGONS, TRIANGLE_STRIPS or data")),
        }
    }
    content.grid_cells(&scanner, grid, types)?;
    let whole = |labels: &Labels| labels.values.len() == content.cells.count() as usize;
    labels.retain(whole);
    labels.into_iter().for_each(|labels| content.cells.label(labels));
    let n = content.points.len();
    content.cells.finish(file, content.points, zero_based(n))
}

/// Lists of node indices: list `i` is `connectivity[offsets[i]..offsets[i + 1]]`.
struct Lists {
    offsets: Vec<usize>,
    connectivity: Vec<i64>,
}

impl Lists {
    fn iter(&self) -> impl Iterator<Item = &[i64]> {
        self.offsets.windows(2).map(|w| &self.connectivity[w[0]..w[1]])
    }
}

struct Content {
    encoding: Encoding,
    points: Vec<Vector3<f64>>,
    cells: CellSoup,
}

impl Content {
    /// Moves to the start of binary data, which follows the newline of its keyword line.
    fn data_starts(&self, scanner: &mut Scanner) {
        if self.encoding != Encoding::Text {
            scanner.line();
        }
    }

    fn points(&mut self, scanner: &mut Scanner) -> Result<(), MeshInError> {
        let n = scanner.count("points", 6)?;
        let at = scanner.clone();
        let width = match scanner.word("float or double")?.to_ascii_lowercase().as_str() {
            "float" => 4,
            "double" => 8,
            _ => return Err(at.expected("float or double")),
        };
        self.data_starts(scanner);
        if !self.points.is_empty() {
            return Err(at.expected("only one POINTS section"));
        }
        self.points.reserve(n);
        for _ in 0..n {
            let mut coordinate = |name| scanner.stored_real(self.encoding, width, name);
            self.points.push(Vector3::new(coordinate("x")?, coordinate("y")?, coordinate("z")?));
        }
        Ok(())
    }

    fn integers(
        &self,
        scanner: &mut Scanner,
        n: usize,
        width: usize,
        what: &str,
    ) -> Result<Vec<i64>, MeshInError> {
        self.data_starts(scanner);
        (0..n).map(|_| scanner.stored_integer(self.encoding, width, what)).collect()
    }

    /// `CELLS n size` followed by `count i j k …` lists (≤ 4.x), or by OFFSETS and CONNECTIVITY (5.x).
    fn lists(&self, scanner: &mut Scanner) -> Result<Lists, MeshInError> {
        let n = scanner.count("cells", 1)?;
        let size = scanner.count("list entries", 1)?;
        let start = scanner.clone();
        if scanner.peek_word() == "OFFSETS" {
            return self.lists_v5(scanner, n, size);
        }
        *scanner = start;
        let at = scanner.clone();
        let entries = self.integers(scanner, size, 4, "a node index")?;
        let mut lists = Lists { offsets: vec![0], connectivity: Vec::with_capacity(size) };
        let mut rest = entries.as_slice();
        for i in 0..n {
            let list = rest
                .split_first()
                .and_then(|(&count, after)| after.split_at_checked(usize::try_from(count).ok()?))
                .ok_or_else(|| at.expected(format!("{n} lists in {size} entries, list {i} does not fit")))?;
            lists.connectivity.extend_from_slice(list.0);
            lists.offsets.push(lists.connectivity.len());
            rest = list.1;
        }
        Ok(lists)
    }

    fn lists_v5(
        &self,
        scanner: &mut Scanner,
        n_offsets: usize,
        n_entries: usize,
    ) -> Result<Lists, MeshInError> {
        let mut section = |name: &str, n: usize| -> Result<Vec<i64>, MeshInError> {
            let at = scanner.clone();
            if scanner.word(name)? != name {
                return Err(at.expected(name));
            }
            let width = match scanner.word("vtktypeint64 or vtktypeint32")? {
                "vtktypeint64" => 8,
                "vtktypeint32" => 4,
                _ => return Err(at.expected(format!("{name} vtktypeint64 or vtktypeint32"))),
            };
            self.integers(scanner, n, width, "an index")
        };
        let raw_offsets = section("OFFSETS", n_offsets)?;
        let connectivity = section("CONNECTIVITY", n_entries)?;
        let offsets = monotone_offsets(raw_offsets, connectivity.len())
            .ok_or_else(|| scanner.expected(format!("rising OFFSETS between 0 and {n_entries}")))?;
        Ok(Lists { offsets, connectivity })
    }

    fn faces(&mut self, scanner: &mut Scanner, vtk_type: i64) -> Result<(), MeshInError> {
        let at = scanner.clone();
        let lists = self.lists(scanner)?;
        for (i, list) in lists.iter().enumerate() {
            let place = || format!("face {i} of the section at {}", at.place());
            vtk_cells::add(&mut self.cells, at.file(), vtk_type, list, place)?;
        }
        Ok(())
    }

    fn grid_cells(
        &mut self,
        scanner: &Scanner,
        grid: Option<Lists>,
        types: Option<Vec<i64>>,
    ) -> Result<(), MeshInError> {
        let Some(grid) = grid else { return Ok(()) };
        let n_cells = grid.offsets.len().saturating_sub(1);
        let types = types.unwrap_or_default();
        if types.len() != n_cells {
            return Err(
                scanner.expected(format!("CELL_TYPES for {n_cells} cells (there are {})", types.len()))
            );
        }
        for (i, (list, &vtk_type)) in grid.iter().zip(&types).enumerate() {
            vtk_cells::add(&mut self.cells, scanner.file(), vtk_type, list, || format!("cell {i}"))?;
        }
        Ok(())
    }

    /// Skips `FIELD name n` and its n arrays `name components tuples type` with their data.
    fn skip_fields(&self, scanner: &mut Scanner) -> Result<(), MeshInError> {
        scanner.word("a field name")?;
        let arrays = scanner.count("arrays", 4)?;
        for _ in 0..arrays {
            if scanner.peek_word() == "METADATA" {
                scanner.word("METADATA")?;
                skip_metadata(scanner);
            }
            scanner.word("an array name")?;
            let components = scanner.count("components", 0)?;
            let tuples = scanner.count("tuples", 0)?;
            let at = scanner.clone();
            let values = (components as u64).saturating_mul(tuples as u64);
            let type_name = scanner.word("a data type")?;
            let values = at.bounded(values, "field values", 1)?;
            self.data_starts(scanner);
            if self.encoding == Encoding::Text {
                for _ in 0..values {
                    scanner.word("a field value")?;
                }
            } else {
                let width = width_of(type_name).ok_or_else(|| {
                    at.unsupported(format!("a field of type {type_name}"), "remove the field data")
                })?;
                scanner.take(values.saturating_mul(width), "field data")?;
            }
        }
        Ok(())
    }
}

/// Offsets as indices, if they ascend and stay within `n_entries`.
pub(super) fn monotone_offsets(raw: Vec<i64>, n_entries: usize) -> Option<Vec<usize>> {
    let offsets: Vec<usize> = raw.into_iter().map(usize::try_from).collect::<Result<_, _>>().ok()?;
    let rising = offsets.windows(2).all(|w| w[0] <= w[1]);
    (rising && offsets.last().is_none_or(|&end| end <= n_entries)).then_some(offsets)
}
