//! VTK XML `.vtu` (unstructured grids) and `.vtp` (poly data), serial files.
//!
//! # Source
//! "VTK File Formats" (vtk.org), XML formats: inline text or base64, appended raw or base64, zlib or no
//! compression, either byte order, 32- or 64-bit headers.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

use super::cells::{CellSoup, zero_based};
use super::error::MeshInError;
use super::groups::Labels;
use super::mesh_file::MeshFile;
use super::scanner::ByteOrder;
use super::vtk_array::{Array, DataArray, Storage};
use super::vtk_cells;
use super::vtk_legacy::monotone_offsets;

/// Reads a `.vtu` or `.vtp` file. Of its data only cell arrays of one whole number per cell are used.
pub(super) fn read(file: &str, bytes: &[u8]) -> Result<MeshFile, MeshInError> {
    let document = Document::parse(file, bytes)?;
    let mut points: Vec<Vector3<f64>> = Vec::new();
    let mut cells = CellSoup::default();
    for piece in 0..document.pieces {
        let first_node = points.len() as i64;
        let mark = cells.mark();
        let coordinates = document.reals(piece, "Points", None)?;
        let (triples, rest) = coordinates.as_chunks::<3>();
        if !rest.is_empty() {
            return Err(document.fault(
                "Points",
                "three coordinates a point",
                format!("{}", coordinates.len()),
            ));
        }
        points.extend(triples.iter().map(|&p| Vector3::from(p)));
        let first_cell = cells.count();
        document.cells_of(piece, &mut cells)?;
        document.labels_of(piece, first_cell, &mut cells)?;
        cells.shift_since(mark, first_node);
    }
    let n = points.len();
    cells.finish(file, points, zero_based(n))
}

/// The XML part of a file: its arrays with their text, and the appended bytes.
struct Document<'a> {
    file: &'a str,
    pieces: usize,
    storage: Storage<'a>,
    /// (piece, section such as "Cells", array name) → array. Nameless arrays have an empty name.
    arrays: BTreeMap<(usize, String, String), DataArray>,
}

impl<'a> Document<'a> {
    fn parse(file: &'a str, bytes: &'a [u8]) -> Result<Self, MeshInError> {
        let (head, appended) = split_appended(bytes);
        let syntax = |place: usize, found: String| MeshInError::Syntax {
            file: file.into(),
            place: format!("byte {place}"),
            expected: "well-formed VTK XML".into(),
            found,
        };
        let text = std::str::from_utf8(head)
            .map_err(|e| syntax(e.valid_up_to(), "bytes that are not UTF-8".into()))?;
        let mut document = Document {
            file,
            pieces: 0,
            storage: Storage { order: ByteOrder::Little, header_width: 4, compressed: false, appended },
            arrays: BTreeMap::new(),
        };
        let mut reader = Reader::from_str(text);
        let mut section = String::new();
        let mut open: Option<(String, DataArray)> = None;
        let (mut is_vtk, mut is_whole) = (false, false);
        loop {
            let at = reader.buffer_position() as usize;
            match reader.read_event().map_err(|e| syntax(at, e.to_string()))? {
                Event::Start(tag) => match tag.name().as_ref() {
                    "VTKFile" => {
                        is_vtk = true;
                        document.file_attributes(&tag)?;
                    }
                    "Piece" => document.pieces += 1,
                    "DataArray" => open = Some(document.data_array(&tag)?),
                    other if open.is_none() => section = other.to_string(),
                    _ => {}
                },
                Event::Empty(tag) if tag.name().as_ref() == "DataArray" => {
                    let (name, array) = document.data_array(&tag)?;
                    document.keep(&section, name, array);
                }
                Event::Text(text) => {
                    if let Some((_, array)) = &mut open {
                        array.text.push_str(&text);
                    }
                }
                Event::End(tag) if tag.name().as_ref() == "DataArray" => {
                    if let Some((name, array)) = open.take() {
                        document.keep(&section, name, array);
                    }
                }
                Event::End(tag) if tag.name().as_ref() == "VTKFile" => is_whole = true,
                Event::Eof => break,
                _ => {}
            }
        }
        if !is_vtk {
            return Err(syntax(0, "no <VTKFile> element".into()));
        }
        if open.is_some() || !(is_whole || appended.is_some()) {
            return Err(syntax(text.len(), "the end of the file before </VTKFile>".into()));
        }
        Ok(document)
    }

    fn keep(&mut self, section: &str, name: String, array: DataArray) {
        if self.pieces > 0 && matches!(section, "Points" | "Cells" | "Polys" | "Strips" | "CellData") {
            self.arrays.insert((self.pieces - 1, section.to_string(), name), array);
        }
    }

    fn file_attributes(&mut self, tag: &BytesStart) -> Result<(), MeshInError> {
        let attribute = |name| attribute(tag, name);
        match attribute("type").as_deref() {
            Some("UnstructuredGrid" | "PolyData") => {}
            other => {
                return Err(self.unsupported(
                    format!("VTK file type {}", other.unwrap_or("(none)")),
                    "save it as a serial .vtu of tetrahedra or a .vtp surface",
                ));
            }
        }
        if attribute("byte_order").as_deref() == Some("BigEndian") {
            self.storage.order = ByteOrder::Big;
        }
        if attribute("header_type").as_deref() == Some("UInt64") {
            self.storage.header_width = 8;
        }
        match attribute("compressor").as_deref() {
            None | Some("") => {}
            Some("vtkZLibDataCompressor") => self.storage.compressed = true,
            Some(other) => {
                return Err(self
                    .unsupported(format!("compressor {other}"), "save it with zlib or without compression"));
            }
        }
        Ok(())
    }

    fn data_array(&self, tag: &BytesStart) -> Result<(String, DataArray), MeshInError> {
        let name = attribute(tag, "Name").unwrap_or_default();
        let array = DataArray {
            type_name: attribute(tag, "type").unwrap_or_default(),
            format: attribute(tag, "format").unwrap_or_else(|| "ascii".into()),
            offset: attribute(tag, "offset").and_then(|o| o.parse().ok()),
            components: attribute(tag, "NumberOfComponents").and_then(|n| n.parse().ok()).unwrap_or(1),
            text: String::new(),
        };
        Ok((name, array))
    }

    fn unsupported(&self, what: String, instead: &str) -> MeshInError {
        MeshInError::Unsupported {
            file: self.file.into(),
            place: "<VTKFile>".into(),
            what,
            instead: instead.into(),
        }
    }

    fn fault(&self, place: &str, expected: &str, found: String) -> MeshInError {
        MeshInError::Syntax { file: self.file.into(), place: place.into(), expected: expected.into(), found }
    }

    fn array(&self, piece: usize, section: &str, name: Option<&str>) -> Option<&DataArray> {
        let from = (piece, section.to_string(), name.unwrap_or_default().to_string());
        match name {
            Some(_) => self.arrays.get(&from),
            None => self
                .arrays
                .range(from..)
                .next()
                .filter(|(k, _)| k.0 == piece && k.1 == section)
                .map(|(_, a)| a),
        }
    }

    fn decode(&self, piece: usize, section: &str, name: Option<&str>) -> Result<Option<Array>, MeshInError> {
        let Some(array) = self.array(piece, section, name) else { return Ok(None) };
        let place = format!("piece {piece}, <{section}> array '{}'", name.unwrap_or("points"));
        self.storage
            .decode(array)
            .map(Some)
            .map_err(|found| self.fault(&place, "data that fits its declaration", found))
    }

    fn reals(&self, piece: usize, section: &str, name: Option<&str>) -> Result<Vec<f64>, MeshInError> {
        match self.decode(piece, section, name)? {
            Some(array) => Ok(array.into_reals()),
            None => Err(self.fault(&format!("piece {piece}"), "a <Points> data array", "none".into())),
        }
    }

    fn integers(&self, piece: usize, section: &str, name: &str) -> Result<Vec<i64>, MeshInError> {
        let place = format!("piece {piece}, <{section}>");
        match self.decode(piece, section, Some(name))? {
            Some(Array::Integers(values)) => Ok(values),
            Some(Array::Reals(_)) => {
                Err(self.fault(&place, &format!("integers in '{name}'"), "reals".into()))
            }
            None => Err(self.fault(&place, &format!("a data array '{name}'"), "none".into())),
        }
    }

    /// Labels the cells from `first_cell` on by the arrays of one number per cell.
    fn labels_of(&self, piece: usize, first_cell: u32, cells: &mut CellSoup) -> Result<(), MeshInError> {
        let n = (cells.count() - first_cell) as usize;
        let of_piece = (piece, "CellData".to_owned(), String::new())..;
        let arrays = self.arrays.range(of_piece).take_while(|(key, _)| key.0 == piece && key.1 == "CellData");
        // Texts and bits are no labels.
        let is_number = |array: &DataArray| {
            array.components == 1
                && ["Int", "UInt", "Float"].iter().any(|kind| array.type_name.starts_with(kind))
        };
        for ((_, _, name), array) in arrays.filter(|(_, array)| is_number(array)) {
            let place = format!("piece {piece}, <CellData> array '{name}'");
            let decoded = self.storage.decode(array);
            let decoded =
                decoded.map_err(|found| self.fault(&place, "data that fits its declaration", found))?;
            let values = decoded.into_reals();
            if values.len() == n
                && let Some(labels) = Labels::of_reals(name, first_cell, &values)
            {
                cells.label(labels);
            }
        }
        Ok(())
    }

    fn cells_of(&self, piece: usize, cells: &mut CellSoup) -> Result<(), MeshInError> {
        // Section and the VTK type of its cells (0: given by the array "types").
        for (section, fixed_type) in [("Cells", 0), ("Polys", 7), ("Strips", 6)] {
            if self.array(piece, section, Some("connectivity")).is_none() {
                continue;
            }
            let connectivity = self.integers(piece, section, "connectivity")?;
            let mut raw = self.integers(piece, section, "offsets")?;
            raw.insert(0, 0);
            let place = format!("piece {piece}, <{section}>");
            let offsets = monotone_offsets(raw, connectivity.len()).ok_or_else(|| {
                self.fault(&place, "rising offsets within the connectivity", "others".into())
            })?;
            let types = if fixed_type == 0 {
                self.integers(piece, section, "types")?
            } else {
                vec![fixed_type; offsets.len() - 1]
            };
            if types.len() != offsets.len() - 1 {
                return Err(self.fault(&place, "as many types as offsets", format!("{}", types.len())));
            }
            for (i, (w, &vtk_type)) in offsets.windows(2).zip(&types).enumerate() {
                let nodes = &connectivity[w[0]..w[1]];
                vtk_cells::add(cells, self.file, vtk_type, nodes, || format!("{place} cell {i}"))?;
            }
        }
        Ok(())
    }
}

fn attribute(tag: &BytesStart, name: &str) -> Option<String> {
    tag.try_get_attribute(name).ok().flatten().map(|a| a.value.to_string())
}

/// Splits a file at `<AppendedData`. Returns all before it and, if present, whether the data is base64 with
/// the bytes behind the `_`.
fn split_appended(bytes: &[u8]) -> (&[u8], Option<(bool, &[u8])>) {
    let marker = b"<AppendedData";
    let Some(start) = bytes.windows(marker.len()).position(|w| w == marker) else { return (bytes, None) };
    let (head, tail) = bytes.split_at(start);
    let Some(close) = tail.iter().position(|&b| b == b'>') else { return (head, None) };
    let is_base64 = tail[..close].windows(6).any(|w| w == b"base64");
    let data = &tail[close + 1..];
    let Some(underscore) = data.iter().position(|&b| b == b'_') else { return (head, None) };
    (head, Some((is_base64, &data[underscore + 1..])))
}

#[cfg(test)]
#[path = "vtk_tests.rs"]
mod tests;
