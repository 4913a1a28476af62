//! Contents of the messages that are read.
//!
//! ```text
//! TRANSFORM  12 × f32: the columns x, y, z of a rotation matrix, then the position [mm]
//! TDATA      per tool 70 bytes: name (20), kind u8, reserved u8, then as TRANSFORM
//! STRING     character set u16 (3: US-ASCII, 106: UTF-8), length u16, text
//! STATUS     code u16 (1: fine), code of the device i64, name of the error (20), text up to a zero
//! GET_…      a question, without content
//! STT_TDATA  starts a stream: shortest time between two messages u32 [ms], name of the coordinates (32)
//! STP_…      ends a stream, without content
//! ```

use super::fields::Fields;
use super::header::{Broken, Header, MAX_BODY_IN, MAX_SKIPPED, NAME_BYTES, TimeStamp, check_sum};
use super::unreadable::Unreadable;

/// Most tools of a `TDATA` message.
pub const MAX_TRACKED: usize = 256;

/// Bytes of a tool in a `TDATA` message.
pub(super) const TRACKED_BYTES: usize = 70;

/// Least length of the extended header [bytes].
const EXTENDED_BYTES: usize = 12;

/// Character set UTF-8 in the numbers of IANA.
pub(super) const UTF_8: u16 = 106;

/// Where a tool is: the columns x, y, z of a rotation matrix, then the position [mm].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transform(pub [f32; 12]);

/// A tool of a `TDATA` message.
#[derive(Debug, Clone, PartialEq)]
pub struct Tracked {
    /// Name of the tool.
    pub name: String,
    /// From the tool's axes to those of the world.
    pub transform: Transform,
}

/// A message, read.
#[derive(Debug, Clone, PartialEq)]
pub struct Message {
    /// Name of the device.
    pub device: String,
    /// When the content was measured.
    pub time: TimeStamp,
    /// What it says.
    pub content: Content,
}

/// What a message says.
#[derive(Debug, Clone, PartialEq)]
pub enum Content {
    /// Where the device is.
    Transform(Transform),
    /// Where several tools are.
    Tracking(Vec<Tracked>),
    /// A text.
    Text(String),
    /// State of the peer.
    Status {
        /// 1: fine.
        code: u16,
        /// Code of the device.
        subcode: i64,
        /// Name of the error.
        error: String,
        /// In words.
        message: String,
    },
    /// A question for the newest message of the type `what`.
    Get {
        /// The type.
        what: String,
    },
    /// Wants a stream of messages of the type `what`.
    Start {
        /// The type.
        what: String,
        /// Shortest time between two messages [ms]; 0: not stated.
        resolution_ms: u32,
    },
    /// Wants no more messages of the type `what`.
    Stop {
        /// The type.
        what: String,
    },
    /// A message of another type, which was skipped.
    Other {
        /// The type.
        kind: String,
    },
}

/// Whether messages of a type are read. Others are skipped without being kept.
pub(super) fn is_read(kind: &str) -> bool {
    matches!(kind, "TRANSFORM" | "TDATA" | "STRING" | "STATUS")
        || ["GET_", "STT_", "STP_"].iter().any(|verb| kind.starts_with(verb))
}

/// The length of the body, if it is within the limit of its type.
pub(super) fn checked_length(header: &Header) -> Result<u64, Broken> {
    let allowed = if is_read(&header.kind) { MAX_BODY_IN } else { MAX_SKIPPED };
    if header.body_bytes > allowed {
        let kind = header.kind.clone();
        return Err(Broken::TooLong { kind, found: header.body_bytes, allowed });
    }
    Ok(header.body_bytes)
}

/// Reads a body whose type is read.
pub(super) fn decode(header: &Header, body: &[u8]) -> Result<Message, Unreadable> {
    let found = check_sum(body);
    if found != header.check_sum {
        let (kind, device) = (header.kind.clone(), header.device.clone());
        return Err(Unreadable::CheckSum { kind, device, stated: header.check_sum, found });
    }
    let content = inner(header.version, body)?;
    let content = match header.kind.as_str() {
        "TRANSFORM" => Content::Transform(transform(&mut Fields::new("TRANSFORM", content), "TRANSFORM")?),
        "TDATA" => Content::Tracking(tracking(content)?),
        "STRING" => Content::Text(string(content)?),
        "STATUS" => status(content)?,
        other => query(other, content)?,
    };
    Ok(Message { device: header.device.clone(), time: header.time, content })
}

/// The content between extended header and metadata.
fn inner(version: u16, body: &[u8]) -> Result<&[u8], Unreadable> {
    if version == 1 {
        return Ok(body);
    }
    let mut fields = Fields::new("extended header", body);
    let (header, index, metadata) = (fields.u16()?, fields.u16()?, fields.u32()?);
    fields.u32()?;
    let (before, after) = (usize::from(header), u64::from(index) + u64::from(metadata));
    let stated = u64::from(header) + after;
    let end = u64::try_from(body.len()).ok().and_then(|length| length.checked_sub(after));
    let range = end.and_then(|end| usize::try_from(end).ok()).and_then(|end| body.get(before..end));
    match range {
        Some(content) if before >= EXTENDED_BYTES => Ok(content),
        _ => Err(Unreadable::Extended { stated, body: body.len() }),
    }
}

fn transform(fields: &mut Fields<'_>, kind: &'static str) -> Result<Transform, Unreadable> {
    let mut entries = [0.0; 12];
    for (entry, value) in entries.iter_mut().enumerate() {
        *value = fields.f32()?;
        if !value.is_finite() {
            return Err(Unreadable::NotFinite { kind, entry, value: value.to_string() });
        }
    }
    Ok(Transform(entries))
}

fn tracking(content: &[u8]) -> Result<Vec<Tracked>, Unreadable> {
    if !content.len().is_multiple_of(TRACKED_BYTES) || content.len() > MAX_TRACKED * TRACKED_BYTES {
        return Err(Unreadable::Tracking { bytes: content.len(), most: MAX_TRACKED });
    }
    let read = |one: &[u8]| {
        let mut fields = Fields::new("TDATA", one);
        let name = fields.text(NAME_BYTES)?;
        fields.u16()?;
        Ok(Tracked { name, transform: transform(&mut fields, "TDATA")? })
    };
    content.chunks_exact(TRACKED_BYTES).map(read).collect()
}

fn string(content: &[u8]) -> Result<String, Unreadable> {
    let mut fields = Fields::new("STRING", content);
    let (_set, length) = (fields.u16()?, fields.u16()?);
    fields.text(usize::from(length))
}

fn status(content: &[u8]) -> Result<Content, Unreadable> {
    let mut fields = Fields::new("STATUS", content);
    let (code, subcode) = (fields.u16()?, fields.i64()?);
    let error = fields.text(NAME_BYTES)?;
    let message = fields.text(fields.left())?;
    Ok(Content::Status { code, subcode, error, message })
}

/// `GET_`, `STT_` and `STP_`. What they are about may have any name.
fn query(kind: &str, content: &[u8]) -> Result<Content, Unreadable> {
    let what = kind[4..].to_owned();
    Ok(match &kind[..4] {
        "GET_" => Content::Get { what },
        "STP_" => Content::Stop { what },
        _ => {
            let resolution_ms = if content.len() < 4 { 0 } else { Fields::new("STT_", content).u32()? };
            Content::Start { what, resolution_ms }
        }
    })
}
