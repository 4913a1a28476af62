//! Messages that are sent. All have version 1, which every peer reads.
//!
//! ```text
//! POLYDATA    counts u32: points; then cells and their bytes for vertices, lines, polygons, strips; attributes
//!             points 3 × f32 [mm], polygons (3, i, j, k) u32; per attribute kind u8 (2: normals of points),
//!             components u8, count u32; names that end with a zero, padded to an even length; values f32
//! CAPABILITY  names of types (12 bytes each)
//! RTS_…       u8: 0 if a stream was started or ended as asked
//! ```

use bytes::Bytes;

use super::content::{TRACKED_BYTES, Tracked, Transform, UTF_8};
use super::header::{HEADER_BYTES, KIND_BYTES, MAX_BODY_OUT, NAME_BYTES, TimeStamp, check_sum};

/// Bytes of the counts at the start of a `POLYDATA` message.
const COUNTS_BYTES: usize = 40;

/// Bytes of a point or normal, and of an index or value.
const POINT_BYTES: usize = 12;

/// Bytes of a triangle: the number 3 and three indices.
const TRIANGLE_BYTES: usize = 16;

/// Kind of an attribute: a normal per point.
const POINT_NORMALS: u8 = 2;

/// Name of the normals, with its zero and an even length.
const NORMALS: &[u8; 8] = b"Normals\0";

/// The surface is larger than what is sent in one message.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "a surface of {points} points and {triangles} triangles takes {bytes} bytes; at most {MAX_BODY_OUT} are sent"
)]
pub struct TooLarge {
    /// Points of the surface.
    pub points: usize,
    /// Triangles of the surface.
    pub triangles: usize,
    /// Bytes of the message.
    pub bytes: usize,
}

/// A message as bytes, header and body.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Encoded(Vec<u8>);

impl Encoded {
    /// Where a device is.
    pub fn transform(device: &str, time: TimeStamp, transform: &Transform) -> Self {
        let mut message = Self::begin(48);
        message.put_transform(transform);
        message.finish("TRANSFORM", device, time)
    }

    /// Where several tools are.
    pub fn tracking(device: &str, time: TimeStamp, tools: &[Tracked]) -> Self {
        /// A tool with six degrees of freedom.
        const TRACKER: u8 = 1;
        let mut message = Self::begin(TRACKED_BYTES * tools.len());
        for tool in tools {
            message.put_name(&tool.name, NAME_BYTES);
            message.0.extend([TRACKER, 0]);
            message.put_transform(&tool.transform);
        }
        message.finish("TDATA", device, time)
    }

    /// A text. What exceeds 65,535 bytes is cut off.
    pub fn text(device: &str, time: TimeStamp, text: &str) -> Self {
        let text = start_of(text, usize::from(u16::MAX));
        let mut message = Self::begin(4 + text.len());
        message.0.extend(UTF_8.to_be_bytes());
        message.0.extend((text.len() as u16).to_be_bytes());
        message.0.extend(text.as_bytes());
        message.finish("STRING", device, time)
    }

    /// State of this program; code 1 is fine.
    pub fn status(device: &str, time: TimeStamp, code: u16, error: &str, text: &str) -> Self {
        let mut message = Self::begin(31 + text.len());
        message.0.extend(code.to_be_bytes());
        message.0.extend(0_i64.to_be_bytes());
        message.put_name(error, NAME_BYTES);
        message.0.extend(text.as_bytes());
        message.0.push(0);
        message.finish("STATUS", device, time)
    }

    /// The types of messages that this program speaks.
    pub fn capability(device: &str, time: TimeStamp, kinds: &[&str]) -> Self {
        let mut message = Self::begin(KIND_BYTES * kinds.len());
        for kind in kinds {
            message.put_name(kind, KIND_BYTES);
        }
        message.finish("CAPABILITY", device, time)
    }

    /// Whether a stream of messages of the type `what` was started or ended as asked.
    pub fn ready(what: &str, device: &str, time: TimeStamp, done: bool) -> Self {
        let mut message = Self::begin(1);
        message.0.push(u8::from(!done));
        message.finish(&format!("RTS_{what}"), device, time)
    }

    /// Triangles with a normal per point. `points_mm` and `normals` have one entry per point, `triangles` point to them.
    ///
    /// # Errors
    /// The message would be longer than [`MAX_BODY_OUT`].
    pub fn surface(
        device: &str,
        time: TimeStamp,
        points_mm: &[[f32; 3]],
        normals: &[[f32; 3]],
        triangles: &[[u32; 3]],
    ) -> Result<Self, TooLarge> {
        let (points, cells) = (points_mm.len(), triangles.len());
        let attribute = 6 + NORMALS.len();
        let bytes = COUNTS_BYTES + 2 * POINT_BYTES * points + TRIANGLE_BYTES * cells + attribute;
        if bytes > MAX_BODY_OUT {
            return Err(TooLarge { points, triangles: cells, bytes });
        }
        let mut message = Self::begin(bytes);
        let polygons = [cells, TRIANGLE_BYTES * cells];
        let counts = [points, 0, 0, 0, 0, polygons[0], polygons[1], 0, 0, 1];
        // `MAX_BODY_OUT` bounds every count.
        message.0.extend(counts.iter().flat_map(|count| (*count as u32).to_be_bytes()));
        message.0.extend(points_mm.iter().flatten().flat_map(|value| value.to_be_bytes()));
        for [i, j, k] in triangles {
            message.0.extend([3, *i, *j, *k].iter().flat_map(|index| index.to_be_bytes()));
        }
        message.0.extend([POINT_NORMALS, 3]);
        message.0.extend((points as u32).to_be_bytes());
        message.0.extend(NORMALS);
        message.0.extend(normals.iter().flatten().flat_map(|value| value.to_be_bytes()));
        debug_assert_eq!(message.0.len(), HEADER_BYTES + bytes);
        Ok(message.finish("POLYDATA", device, time))
    }

    /// Header and body.
    pub fn into_bytes(self) -> Bytes {
        self.0.into()
    }

    fn begin(body_bytes: usize) -> Self {
        let mut bytes = Vec::with_capacity(HEADER_BYTES + body_bytes);
        bytes.resize(HEADER_BYTES, 0);
        Self(bytes)
    }

    fn put_transform(&mut self, transform: &Transform) {
        self.0.extend(transform.0.iter().flat_map(|value| value.to_be_bytes()));
    }

    /// A text in a field of `length` bytes, cut off where it is longer.
    fn put_name(&mut self, name: &str, length: usize) {
        let end = self.0.len() + length;
        self.0.extend(start_of(name, length).as_bytes());
        self.0.resize(end, 0);
    }

    /// Writes the header before the body.
    fn finish(mut self, kind: &str, device: &str, time: TimeStamp) -> Self {
        let (header, body) = self.0.split_at_mut(HEADER_BYTES);
        let (kind, device) = (start_of(kind, KIND_BYTES), start_of(device, NAME_BYTES));
        header[..2].copy_from_slice(&1_u16.to_be_bytes());
        header[2..2 + kind.len()].copy_from_slice(kind.as_bytes());
        header[14..14 + device.len()].copy_from_slice(device.as_bytes());
        header[34..42].copy_from_slice(&time.0.to_be_bytes());
        header[42..50].copy_from_slice(&(body.len() as u64).to_be_bytes());
        header[50..].copy_from_slice(&check_sum(body).to_be_bytes());
        self
    }
}

/// The longest start of `text` that has at most `bytes` bytes.
pub fn start_of(text: &str, bytes: usize) -> &str {
    &text[..text.floor_char_boundary(bytes)]
}
