//! The data of a legacy VTK file, from its first `POINT_DATA` or `CELL_DATA` on: arrays of one whole number per cell
//! name groups of cells, everything else is passed over.
//!
//! Data is a supplement of the mesh. Where something unknown or broken stands in it, the rest is not read.

use super::error::MeshInError;
use super::groups::Labels;
use super::scanner::{Encoding, Scanner};

/// The cell arrays that follow in `scanner`, as far as they can be read.
pub(super) fn data(scanner: Scanner<'_>, encoding: Encoding) -> Vec<Labels> {
    let mut reader = Reader { scanner, encoding, of_cells: false, n: 0, found: Vec::new() };
    while let Ok(true) = reader.next() {}
    reader.found
}

struct Reader<'a> {
    scanner: Scanner<'a>,
    encoding: Encoding,
    /// Whether arrays belong to cells.
    of_cells: bool,
    /// Number of values of every array.
    n: usize,
    found: Vec<Labels>,
}

impl Reader<'_> {
    /// Reads what the next keyword announces; `false` at the end or at an unknown keyword.
    fn next(&mut self) -> Result<bool, MeshInError> {
        if self.scanner.at_end() {
            return Ok(false);
        }
        match self.scanner.word("a keyword such as SCALARS")? {
            keyword @ ("POINT_DATA" | "CELL_DATA") => {
                self.of_cells = keyword == "CELL_DATA";
                self.n = self.scanner.count("values", 0)?;
            }
            "SCALARS" => self.scalars()?,
            "FIELD" => self.field()?,
            "VECTORS" | "NORMALS" => self.skip_typed(3)?,
            "TENSORS" => self.skip_typed(9)?,
            "TENSORS6" => self.skip_typed(6)?,
            "TEXTURE_COORDINATES" => {
                self.scanner.word("an array name")?;
                let components = self.scanner.count("components", 0)?;
                let of_type = self.scanner.word("a data type")?;
                self.skip(components, of_type)?;
            }
            "LOOKUP_TABLE" => {
                self.scanner.word("a table name")?;
                let entries = self.scanner.count("table entries", 1)?;
                let of_type = if self.encoding == Encoding::Text { "float" } else { "unsigned_char" };
                self.values(entries.saturating_mul(4), of_type)?;
            }
            "COLOR_SCALARS" => {
                self.scanner.word("an array name")?;
                let components = self.scanner.count("components", 0)?;
                let of_type = if self.encoding == Encoding::Text { "float" } else { "unsigned_char" };
                self.skip(components, of_type)?;
            }
            "METADATA" => skip_metadata(&mut self.scanner),
            _ => return Ok(false),
        }
        Ok(true)
    }

    /// `SCALARS name type [components]`, `LOOKUP_TABLE name`, values.
    fn scalars(&mut self) -> Result<(), MeshInError> {
        let name = self.scanner.word("an array name")?.to_owned();
        let of_type = self.scanner.word("a data type")?;
        let mut components = 1;
        if self.scanner.peek_word() != "LOOKUP_TABLE" {
            components = self.scanner.count("components", 0)?;
        }
        if self.scanner.peek_word() == "LOOKUP_TABLE" {
            self.scanner.word("LOOKUP_TABLE")?;
            self.scanner.word("a table name")?;
        }
        let values = self.values(self.n.saturating_mul(components), of_type)?;
        self.keep(&name, components, &values);
        Ok(())
    }

    /// `FIELD name n`, then n arrays `name components tuples type` with their values.
    fn field(&mut self) -> Result<(), MeshInError> {
        self.scanner.word("a field name")?;
        let arrays = self.scanner.count("arrays", 4)?;
        for _ in 0..arrays {
            if self.scanner.peek_word() == "METADATA" {
                self.scanner.word("METADATA")?;
                skip_metadata(&mut self.scanner);
            }
            let name = self.scanner.word("an array name")?.to_owned();
            let components = self.scanner.count("components", 0)?;
            let tuples = self.scanner.count("tuples", 0)?;
            let of_type = self.scanner.word("a data type")?;
            let values = self.values(tuples.saturating_mul(components), of_type)?;
            if tuples == self.n {
                self.keep(&name, components, &values);
            }
        }
        Ok(())
    }

    fn skip_typed(&mut self, components: usize) -> Result<(), MeshInError> {
        self.scanner.word("an array name")?;
        let of_type = self.scanner.word("a data type")?;
        self.skip(components, of_type)
    }

    fn skip(&mut self, components: usize, of_type: &str) -> Result<(), MeshInError> {
        self.values(self.n.saturating_mul(components), of_type).map(drop)
    }

    fn values(&mut self, n: usize, of_type: &str) -> Result<Vec<f64>, MeshInError> {
        let n = self.scanner.bounded(n as u64, "values", 1)?;
        if self.encoding != Encoding::Text {
            self.scanner.line();
        }
        let (encoding, scanner) = (self.encoding, &mut self.scanner);
        let Some(width) = width_of(of_type) else { return Err(scanner.expected("a data type such as int")) };
        let real = of_type == "float" || of_type == "double" || encoding == Encoding::Text;
        (0..n)
            .map(|_| match real {
                true => scanner.stored_real(encoding, width, "a value"),
                false => scanner.stored_integer(encoding, width, "a value").map(|value| value as f64),
            })
            .collect()
    }

    fn keep(&mut self, name: &str, components: usize, values: &[f64]) {
        if self.of_cells && components == 1 {
            self.found.extend(Labels::of_reals(name, 0, values));
        }
    }
}

/// Bytes of a value of a type of the format.
pub(super) fn width_of(type_name: &str) -> Option<usize> {
    Some(match type_name {
        "char" | "unsigned_char" => 1,
        "short" | "unsigned_short" => 2,
        "int" | "unsigned_int" | "float" | "vtktypeint32" => 4,
        "long" | "unsigned_long" | "double" | "vtktypeint64" | "vtkIdType" => 8,
        _ => return None,
    })
}

/// METADATA ends at the first blank line after its keyword line.
pub(super) fn skip_metadata(scanner: &mut Scanner) {
    scanner.line();
    while !scanner.line().is_empty() && scanner.remaining() > 0 {}
}
