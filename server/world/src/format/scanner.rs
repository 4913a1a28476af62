//! A cursor over the bytes of a mesh file: reads words, numbers and binary blocks, and gives places for
//! errors.
//!
//! Every count read from a file passes [`Scanner::count`], which compares it with the remaining bytes. No
//! allocation is therefore larger than the file justifies.

use super::error::MeshInError;

/// Largest number of nodes or elements accepted from a file (indices are `u32`).
pub(super) const MAX_ITEMS: u64 = 200_000_000;

/// Byte order of binary numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ByteOrder {
    /// Least significant byte first.
    Little,
    /// Most significant byte first.
    Big,
}

/// How the numbers of a section are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    /// Words separated by white space.
    Text,
    /// Fixed-width binary.
    Binary(ByteOrder),
}

/// A position in the bytes of a named file.
#[derive(Clone)]
pub(super) struct Scanner<'a> {
    file: &'a str,
    bytes: &'a [u8],
    position: usize,
}

impl<'a> Scanner<'a> {
    /// Starts at the first byte; `file` is the name used in errors.
    pub(super) fn new(file: &'a str, bytes: &'a [u8]) -> Self {
        Scanner { file, bytes, position: 0 }
    }

    /// Name of the file, for errors.
    pub(super) fn file(&self) -> &'a str {
        self.file
    }

    /// Bytes not read yet.
    pub(super) fn remaining(&self) -> usize {
        self.bytes.len() - self.position
    }

    /// "line 12 (byte 345)" for the next byte.
    pub(super) fn place(&self) -> String {
        let newlines = self.bytes[..self.position].iter().filter(|&&b| b == b'\n').count();
        format!("line {} (byte {})", newlines + 1, self.position)
    }

    /// The error "expected … here", with a quotation of what is found.
    pub(super) fn expected(&self, expected: impl Into<String>) -> MeshInError {
        let rest = &self.bytes[self.position..];
        let start = rest.iter().position(|b| !b.is_ascii_whitespace()).unwrap_or(rest.len());
        let rest = &rest[start..];
        let length =
            rest.iter().take(24).position(|b| *b == b'\n' || *b == b'\r').unwrap_or(rest.len().min(24));
        let found = if rest.is_empty() {
            "the end of the file".to_string()
        } else {
            format!("'{}'", String::from_utf8_lossy(&rest[..length]).escape_debug())
        };
        MeshInError::Syntax { file: self.file.into(), place: self.place(), expected: expected.into(), found }
    }

    /// The error "this feature is not supported here".
    pub(super) fn unsupported(&self, what: impl Into<String>, instead: impl Into<String>) -> MeshInError {
        MeshInError::Unsupported {
            file: self.file.into(),
            place: self.place(),
            what: what.into(),
            instead: instead.into(),
        }
    }

    fn skip_white(&mut self) {
        while self.bytes.get(self.position).is_some_and(u8::is_ascii_whitespace) {
            self.position += 1;
        }
    }

    /// Skips white space and returns whether the end is reached.
    pub(super) fn at_end(&mut self) -> bool {
        self.skip_white();
        self.position == self.bytes.len()
    }

    /// The next word, without moving past it; empty at the end.
    pub(super) fn peek_word(&mut self) -> &'a str {
        self.skip_white();
        let rest = &self.bytes[self.position..];
        let length = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        std::str::from_utf8(&rest[..length.min(256)]).unwrap_or("\u{fffd}")
    }

    /// The next word.
    pub(super) fn word(&mut self, expected: &str) -> Result<&'a str, MeshInError> {
        let word = self.peek_word();
        if word.is_empty() || word == "\u{fffd}" {
            return Err(self.expected(expected));
        }
        self.position += word.len();
        Ok(word)
    }

    /// The rest of the current line. Moves to the next line.
    pub(super) fn line(&mut self) -> &'a [u8] {
        let rest = &self.bytes[self.position..];
        let length = rest.iter().position(|b| *b == b'\n').unwrap_or(rest.len());
        self.position += (length + 1).min(rest.len());
        let line = &rest[..length];
        line.strip_suffix(b"\r").unwrap_or(line)
    }

    /// Moves just behind the next occurrence of `marker`. Returns `false`, without moving, if there is none.
    pub(super) fn skip_past(&mut self, marker: &[u8]) -> bool {
        let rest = &self.bytes[self.position..];
        match rest.windows(marker.len().max(1)).position(|w| w == marker) {
            Some(start) => {
                self.position += start + marker.len();
                true
            }
            None => false,
        }
    }

    fn parsed<T: std::str::FromStr>(&mut self, expected: &str) -> Result<T, MeshInError> {
        let word = self.peek_word();
        let value = word.parse().map_err(|_| self.expected(expected))?;
        self.position += word.len();
        Ok(value)
    }

    /// The next `n` raw bytes.
    pub(super) fn take(&mut self, n: usize, what: &str) -> Result<&'a [u8], MeshInError> {
        if n > self.remaining() {
            return Err(MeshInError::Syntax {
                file: self.file.into(),
                place: self.place(),
                expected: format!("{n} bytes of {what}"),
                found: format!("{} bytes before the end of the file", self.remaining()),
            });
        }
        let taken = &self.bytes[self.position..self.position + n];
        self.position += n;
        Ok(taken)
    }

    /// The next word as an integer.
    pub(super) fn integer(&mut self, expected: &str) -> Result<i64, MeshInError> {
        self.parsed(expected)
    }

    /// The next word as a real number. Fortran-style `1d-3` is not supported.
    pub(super) fn real(&mut self, expected: &str) -> Result<f64, MeshInError> {
        self.parsed(expected)
    }

    /// The next word as a count of `what`, each of which takes at least `bytes_each` of the remaining bytes.
    pub(super) fn count(&mut self, what: &str, bytes_each: usize) -> Result<usize, MeshInError> {
        let start = self.clone();
        let value: u64 = self.parsed(&format!("the number of {what}"))?;
        start.bounded(value, what, bytes_each)
    }

    /// Checks a count that was read in another way.
    pub(super) fn bounded(&self, value: u64, what: &str, bytes_each: usize) -> Result<usize, MeshInError> {
        let by_size = (self.remaining() / bytes_each.max(1)) as u64;
        let limit = by_size.min(MAX_ITEMS);
        if value > limit {
            return Err(MeshInError::Limit {
                file: self.file.into(),
                place: self.place(),
                what: what.into(),
                value,
                limit,
                reason: if by_size < MAX_ITEMS {
                    format!("only {} bytes follow", self.remaining())
                } else {
                    "no mesh may be larger".into()
                },
            });
        }
        Ok(value as usize)
    }

    /// An integer of `width` bytes (1, 4 or 8), or the next word in a text section.
    pub(super) fn stored_integer(
        &mut self,
        encoding: Encoding,
        width: usize,
        what: &str,
    ) -> Result<i64, MeshInError> {
        match encoding {
            Encoding::Text => self.integer(what),
            Encoding::Binary(order) => {
                let bytes = self.take(width, what)?;
                binary_integer(bytes, order)
                    .ok_or_else(|| self.unsupported(format!("a {width}-byte integer"), "use 4 or 8 bytes"))
            }
        }
    }

    /// A real number of `width` bytes (4 or 8), or the next word in a text section.
    pub(super) fn stored_real(
        &mut self,
        encoding: Encoding,
        width: usize,
        what: &str,
    ) -> Result<f64, MeshInError> {
        match encoding {
            Encoding::Text => self.real(what),
            Encoding::Binary(order) => {
                let bytes = self.take(width, what)?;
                binary_real(bytes, order)
                    .ok_or_else(|| self.unsupported(format!("a {width}-byte real"), "use 4 or 8 bytes"))
            }
        }
    }
}

/// A signed binary integer of 1 (unsigned), 2, 4 or 8 bytes; `None` for other widths.
pub(super) fn binary_integer(bytes: &[u8], order: ByteOrder) -> Option<i64> {
    use ByteOrder::{Big, Little};
    Some(match (bytes, order) {
        ([b], _) => i64::from(*b),
        (&[a, b], Little) => i64::from(i16::from_le_bytes([a, b])),
        (&[a, b], Big) => i64::from(i16::from_be_bytes([a, b])),
        (&[a, b, c, d], Little) => i64::from(i32::from_le_bytes([a, b, c, d])),
        (&[a, b, c, d], Big) => i64::from(i32::from_be_bytes([a, b, c, d])),
        (&[a, b, c, d, e, f, g, h], Little) => i64::from_le_bytes([a, b, c, d, e, f, g, h]),
        (&[a, b, c, d, e, f, g, h], Big) => i64::from_be_bytes([a, b, c, d, e, f, g, h]),
        _ => return None,
    })
}

/// A binary IEEE real of 4 or 8 bytes; `None` for other widths.
pub(super) fn binary_real(bytes: &[u8], order: ByteOrder) -> Option<f64> {
    use ByteOrder::{Big, Little};
    Some(match (bytes, order) {
        (&[a, b, c, d], Little) => f64::from(f32::from_le_bytes([a, b, c, d])),
        (&[a, b, c, d], Big) => f64::from(f32::from_be_bytes([a, b, c, d])),
        (&[a, b, c, d, e, f, g, h], Little) => f64::from_le_bytes([a, b, c, d, e, f, g, h]),
        (&[a, b, c, d, e, f, g, h], Big) => f64::from_be_bytes([a, b, c, d, e, f, g, h]),
        _ => return None,
    })
}
