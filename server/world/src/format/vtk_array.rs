//! The data arrays of VTK XML files: text, base64 or raw bytes, zlib blocks or plain.

use std::io::Read;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::read::ZlibDecoder;

use super::scanner::{ByteOrder, binary_integer, binary_real};

/// Largest decoded array [bytes]. A compressed block cannot announce more.
const MAX_ARRAY_BYTES: u64 = 2 << 30;

/// How a file stores its binary arrays.
pub(super) struct Storage<'a> {
    /// Byte order of headers and data.
    pub order: ByteOrder,
    /// Width of header integers [bytes].
    pub header_width: usize,
    /// Whether data is stored in zlib blocks.
    pub compressed: bool,
    /// Appended data: whether it is base64, and its bytes.
    pub appended: Option<(bool, &'a [u8])>,
}

/// A `<DataArray>` as found in the XML, not decoded.
pub(super) struct DataArray {
    /// "Float32", "Int64", …
    pub type_name: String,
    /// "ascii", "binary" or "appended".
    pub format: String,
    /// Offset into the appended data.
    pub offset: Option<usize>,
    /// Values per entry.
    pub components: usize,
    /// Text content.
    pub text: String,
}

/// Decoded values.
pub(super) enum Array {
    /// Values of an integer type.
    Integers(Vec<i64>),
    /// Values of a real type.
    Reals(Vec<f64>),
}

impl Array {
    /// Values as reals.
    pub(super) fn into_reals(self) -> Vec<f64> {
        match self {
            Array::Integers(values) => values.into_iter().map(|v| v as f64).collect(),
            Array::Reals(values) => values,
        }
    }
}

impl Storage<'_> {
    /// Decodes one array. The error describes the fault.
    pub(super) fn decode(&self, array: &DataArray) -> Result<Array, String> {
        let (is_real, width) = match array.type_name.as_str() {
            "Float32" => (true, 4),
            "Float64" => (true, 8),
            "Int8" | "UInt8" => (false, 1),
            "Int16" | "UInt16" => (false, 2),
            "Int32" | "UInt32" => (false, 4),
            "Int64" | "UInt64" => (false, 8),
            other => return Err(format!("unknown type '{other}'")),
        };
        if array.format == "ascii" {
            return decode_text(&array.text, is_real);
        }
        let bytes = match (array.format.as_str(), self.appended) {
            ("binary", _) => self.block(&mut Base64::new(array.text.as_bytes()))?,
            ("appended", Some((is_base64, data))) => {
                let offset = array.offset.ok_or("appended without an offset")?;
                let data = data
                    .get(offset..)
                    .ok_or_else(|| format!("offset {offset} beyond the end of the file"))?;
                if is_base64 { self.block(&mut Base64::new(data))? } else { self.block(&mut Raw(data))? }
            }
            ("appended", None) => return Err("appended, but the file has no <AppendedData>".into()),
            (other, _) => return Err(format!("unknown format '{other}'")),
        };
        if bytes.len() % width != 0 {
            return Err(format!("{} bytes, not a multiple of {width}", bytes.len()));
        }
        let words = bytes.chunks_exact(width);
        Ok(if is_real {
            Array::Reals(words.filter_map(|w| binary_real(w, self.order)).collect())
        } else {
            Array::Integers(words.filter_map(|w| binary_integer(w, self.order)).collect())
        })
    }

    fn header(&self, source: &mut dyn ByteSource) -> Result<u64, String> {
        let bytes = source.take(self.header_width as u64)?;
        let value = binary_integer(&bytes, self.order).ok_or("a header of unknown width")?;
        // 32-bit headers are unsigned.
        let value = if self.header_width == 4 { value & 0xffff_ffff } else { value };
        u64::try_from(value).map_err(|_| "a negative length in the header".into())
    }

    /// Reads length header(s) and data: `[n_bytes][data]`, or compressed
    /// `[n_blocks][block_bytes][last_block_bytes][compressed_bytes…][blocks…]`.
    fn block(&self, source: &mut dyn ByteSource) -> Result<Vec<u8>, String> {
        let first = self.header(source)?;
        if !self.compressed {
            source.end_of_group();
            return source.take(first);
        }
        if first == 0 {
            return Ok(Vec::new());
        }
        let block_bytes = self.header(source)?;
        let last_bytes = self.header(source)?;
        let total = block_bytes.checked_mul(first).filter(|&t| t <= MAX_ARRAY_BYTES);
        let total = total.ok_or_else(|| format!("{first} blocks of {block_bytes} bytes, too large"))?;
        if first > source.left() / self.header_width as u64 + 1 {
            return Err(format!("{first} blocks announced, the file ends before"));
        }
        let sizes = (0..first).map(|_| self.header(source)).collect::<Result<Vec<u64>, String>>()?;
        source.end_of_group();
        let mut data = Vec::new();
        for (i, &size) in sizes.iter().enumerate() {
            let compressed = source.take(size)?;
            let is_last = i + 1 == sizes.len();
            let expected = if is_last && last_bytes > 0 { last_bytes } else { block_bytes };
            let before = data.len();
            ZlibDecoder::new(compressed.as_slice())
                .take(expected.min(total) + 1)
                .read_to_end(&mut data)
                .map_err(|e| format!("block {i}: {e}"))?;
            if (data.len() - before) as u64 != expected {
                return Err(format!("block {i} holds {} bytes instead of {expected}", data.len() - before));
            }
        }
        Ok(data)
    }
}

fn decode_text(text: &str, is_real: bool) -> Result<Array, String> {
    let words = text.split_ascii_whitespace();
    let bad = |word: &str| format!("'{}'", word.chars().take(24).collect::<String>().escape_debug());
    Ok(if is_real {
        Array::Reals(words.map(|w| w.parse().map_err(|_| bad(w))).collect::<Result<_, String>>()?)
    } else {
        Array::Integers(words.map(|w| w.parse().map_err(|_| bad(w))).collect::<Result<_, String>>()?)
    })
}

/// A source of bytes that are taken from the front.
trait ByteSource {
    /// The next `n` bytes.
    fn take(&mut self, n: u64) -> Result<Vec<u8>, String>;
    /// Upper bound of the bytes left.
    fn left(&self) -> u64;
    /// Called at the end of the header, where base64 writers may have padded.
    fn end_of_group(&mut self) {}
}

/// Raw bytes.
struct Raw<'a>(&'a [u8]);

impl ByteSource for Raw<'_> {
    fn take(&mut self, n: u64) -> Result<Vec<u8>, String> {
        if n > self.left() {
            return Err(format!("{n} bytes announced, {} left in the file", self.left()));
        }
        let (taken, rest) = self.0.split_at(n as usize);
        self.0 = rest;
        Ok(taken.to_vec())
    }

    fn left(&self) -> u64 {
        self.0.len() as u64
    }
}

/// Base64 text. Padding may occur in the middle: VTK pads the header separately, others do not.
struct Base64<'a> {
    text: &'a [u8],
    /// Decoded, but not taken yet.
    ready: Vec<u8>,
}

impl<'a> Base64<'a> {
    fn new(text: &'a [u8]) -> Self {
        Base64 { text, ready: Vec::new() }
    }

    /// Decodes the next groups of four characters, up to `n` bytes or a padding.
    fn fill(&mut self, n: usize) -> Result<(), String> {
        let mut group = Vec::with_capacity((n / 3 + 1) * 4);
        let wanted = (n / 3 + 1) * 4;
        let mut used = 0;
        for &c in self.text {
            if c == b'<' {
                break;
            }
            used += 1;
            if c.is_ascii_whitespace() {
                continue;
            }
            group.push(c);
            if group.len() % 4 == 0 && (group.len() >= wanted || c == b'=') {
                break;
            }
        }
        if group.is_empty() {
            return Err("the end of the base64 data too early".into());
        }
        self.text = &self.text[used..];
        STANDARD.decode_vec(&group, &mut self.ready).map_err(|e| format!("bad base64: {e}"))
    }
}

impl ByteSource for Base64<'_> {
    fn take(&mut self, n: u64) -> Result<Vec<u8>, String> {
        if n > self.left() {
            return Err(format!("{n} bytes announced, at most {} left in the file", self.left()));
        }
        let n = n as usize;
        while self.ready.len() < n {
            self.fill(n - self.ready.len())?;
        }
        let rest = self.ready.split_off(n);
        Ok(std::mem::replace(&mut self.ready, rest))
    }

    fn left(&self) -> u64 {
        (self.ready.len() + self.text.len() / 4 * 3 + 3) as u64
    }
}
