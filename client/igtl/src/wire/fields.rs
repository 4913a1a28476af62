//! Reads big-endian fields from bytes that may be too short.

use super::unreadable::Unreadable;

/// What is left of the content of one message.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fields<'a> {
    kind: &'static str,
    left: &'a [u8],
}

impl<'a> Fields<'a> {
    /// Fields of the content of a message of type `kind`.
    pub(super) fn new(kind: &'static str, content: &'a [u8]) -> Self {
        Self { kind, left: content }
    }

    /// The next `N` bytes.
    pub(super) fn array<const N: usize>(&mut self) -> Result<[u8; N], Unreadable> {
        match self.left.split_first_chunk::<N>() {
            Some((first, rest)) => {
                self.left = rest;
                Ok(*first)
            }
            None => Err(self.short(N)),
        }
    }

    /// The next `count` bytes.
    pub(super) fn bytes(&mut self, count: usize) -> Result<&'a [u8], Unreadable> {
        match self.left.split_at_checked(count) {
            Some((first, rest)) => {
                self.left = rest;
                Ok(first)
            }
            None => Err(self.short(count)),
        }
    }

    pub(super) fn u16(&mut self) -> Result<u16, Unreadable> {
        self.array().map(u16::from_be_bytes)
    }

    pub(super) fn u32(&mut self) -> Result<u32, Unreadable> {
        self.array().map(u32::from_be_bytes)
    }

    pub(super) fn i64(&mut self) -> Result<i64, Unreadable> {
        self.array().map(i64::from_be_bytes)
    }

    pub(super) fn f32(&mut self) -> Result<f32, Unreadable> {
        self.array().map(f32::from_be_bytes)
    }

    /// A text of `count` bytes that ends at the first zero.
    pub(super) fn text(&mut self, count: usize) -> Result<String, Unreadable> {
        self.bytes(count).map(text)
    }

    /// Bytes that are left.
    pub(super) fn left(&self) -> usize {
        self.left.len()
    }

    fn short(&self, needed: usize) -> Unreadable {
        Unreadable::Short { kind: self.kind, needed, found: self.left.len() }
    }
}

/// The text before the first zero. What is not UTF-8 becomes U+FFFD; control characters become spaces.
pub(super) fn text(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|b| *b == 0).unwrap_or(bytes.len());
    let clean = |c: char| if c.is_control() && c != '\n' && c != '\t' { ' ' } else { c };
    String::from_utf8_lossy(&bytes[..end]).trim_end().chars().map(clean).collect()
}
