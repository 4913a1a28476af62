//! Messages out of a stream of bytes, in bounded memory.

use super::content::{Content, Message, checked_length, decode, is_read};
use super::header::{Broken, HEADER_BYTES, Header};
use super::unreadable::Unreadable;

/// So many wrong check sums in a row end the connection.
pub const MAX_SPOILT: u32 = 8;

/// What came out of the stream.
pub type Read = Result<Message, Unreadable>;

/// Where the stream is.
#[derive(Debug)]
enum Position {
    Header,
    Body(Header),
    /// In a body of another type, so many bytes before its end.
    Skipped(u64),
}

/// Cuts a stream into messages. It holds one message of at most [`MAX_BODY_IN`](super::header::MAX_BODY_IN) bytes.
///
/// ```
/// use scindo_igtl::wire::content::Content;
/// use scindo_igtl::wire::encode::Encoded;
/// use scindo_igtl::wire::header::TimeStamp;
/// use scindo_igtl::wire::stream::Deframer;
///
/// let bytes = Encoded::text("Stylus", TimeStamp(0), "cut").into_bytes();
/// let (first, second) = bytes.split_at(40);
/// let mut stream = Deframer::default();
/// let mut read = Vec::new();
/// stream.push(first, &mut |message| read.push(message)).unwrap();
/// assert!(read.is_empty());
/// stream.push(second, &mut |message| read.push(message)).unwrap();
/// assert_eq!(read[0].as_ref().unwrap().content, Content::Text("cut".into()));
/// ```
#[derive(Debug)]
pub struct Deframer {
    held: Vec<u8>,
    position: Position,
    spoilt: u32,
}

impl Default for Deframer {
    fn default() -> Self {
        Self { held: Vec::new(), position: Position::Header, spoilt: 0 }
    }
}

impl Deframer {
    /// Takes the next bytes of the stream, and hands over each message that ends in them.
    ///
    /// # Errors
    /// The stream cannot be read any further; the connection should be closed.
    pub fn push(&mut self, mut bytes: &[u8], on_message: &mut impl FnMut(Read)) -> Result<(), Broken> {
        loop {
            match &mut self.position {
                Position::Header => {
                    let header = match self.held.is_empty().then(|| bytes.split_first_chunk::<HEADER_BYTES>())
                    {
                        Some(Some((header, rest))) => {
                            bytes = rest;
                            Header::decode(header)?
                        }
                        _ => {
                            bytes = fill(&mut self.held, HEADER_BYTES, bytes);
                            let Some(header) = self.held.first_chunk::<HEADER_BYTES>() else { return Ok(()) };
                            let header = Header::decode(header)?;
                            self.held.clear();
                            header
                        }
                    };
                    let length = checked_length(&header)?;
                    self.position = if is_read(&header.kind) {
                        Position::Body(header)
                    } else {
                        let Header { kind, device, time, .. } = header;
                        on_message(Ok(Message { device, time, content: Content::Other { kind } }));
                        Position::Skipped(length)
                    };
                }
                Position::Skipped(left) => {
                    let now = usize::try_from(*left).unwrap_or(usize::MAX).min(bytes.len());
                    bytes = &bytes[now..];
                    *left -= now as u64;
                    if *left > 0 {
                        return Ok(());
                    }
                    self.position = Position::Header;
                }
                Position::Body(header) => {
                    // `checked_length` has bounded it.
                    let length = usize::try_from(header.body_bytes).unwrap_or(usize::MAX);
                    bytes = fill(&mut self.held, length, bytes);
                    if self.held.len() < length {
                        return Ok(());
                    }
                    let read = decode(header, &self.held);
                    let is_spoilt = matches!(read, Err(Unreadable::CheckSum { .. }));
                    self.spoilt = if is_spoilt { self.spoilt + 1 } else { 0 };
                    on_message(read);
                    self.held.clear();
                    self.position = Position::Header;
                    if self.spoilt >= MAX_SPOILT {
                        return Err(Broken::Spoilt { count: self.spoilt });
                    }
                }
            }
        }
    }

    /// Memory that the stream holds [bytes].
    pub fn held_bytes(&self) -> usize {
        self.held.capacity()
    }
}

/// Adds to `held` until it has `length` bytes; returns what is left of `bytes`. The memory grows with what has come,
/// not with what was announced.
fn fill<'a>(held: &mut Vec<u8>, length: usize, bytes: &'a [u8]) -> &'a [u8] {
    let (now, rest) = bytes.split_at(length.saturating_sub(held.len()).min(bytes.len()));
    held.extend_from_slice(now);
    rest
}

#[cfg(test)]
mod tests;
