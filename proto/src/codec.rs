//! Conversion between bytes and messages. The guards are applied in this order: encoding string, payload
//! size, counts of repeated fields (by a walk over the wire format), protobuf decoding, then
//! [`WireMessage::check`].

use bytes::Bytes;
use thiserror::Error;

/// Reason why bytes from the wire are refused.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum DecodeError {
    /// The sample states another encoding.
    #[error("encoding is '{found}', expected '{expected}'")]
    Encoding {
        /// Encoding of the expected message.
        expected: String,
        /// Encoding of the sample.
        found: String,
    },
    /// Payload, list or text is longer than allowed.
    #[error("{message}: {field} has {found}, allowed {allowed}")]
    TooLarge {
        /// Message name.
        message: &'static str,
        /// Field, or `payload bytes`.
        field: &'static str,
        /// Size found.
        found: usize,
        /// Largest size allowed.
        allowed: usize,
    },
    /// The payload is not the wire format of this message.
    #[error("{message}: malformed: {reason}")]
    Malformed {
        /// Message name.
        message: &'static str,
        /// Message of the decoder.
        reason: String,
    },
    /// A required field is absent.
    #[error("{message}: {field} is missing")]
    Missing {
        /// Message name.
        message: &'static str,
        /// Field name.
        field: &'static str,
    },
    /// A number is a NaN or an infinity.
    #[error("{message}: {field} is {found}, not a finite number")]
    NonFinite {
        /// Message name.
        message: &'static str,
        /// Field name.
        field: &'static str,
        /// The NaN or infinity that was found.
        found: f64,
    },
    /// A value is outside its range, or arrays contradict their counts.
    #[error("{message}: {field} is {found}, allowed {allowed}")]
    OutOfRange {
        /// Message name.
        message: &'static str,
        /// Field name.
        field: &'static str,
        /// Value found.
        found: String,
        /// The allowed range.
        allowed: String,
    },
}

impl DecodeError {
    /// Stable name of the reason, as counted in `Stats::refused`.
    pub fn code(&self) -> &'static str {
        match self {
            Self::Encoding { .. } => "bad-encoding",
            Self::TooLarge { .. } => "too-large",
            Self::Malformed { .. } => "malformed",
            Self::Missing { .. } => "missing-field",
            Self::NonFinite { .. } => "non-finite",
            Self::OutOfRange { .. } => "out-of-range",
        }
    }
}

/// Limit on the length of a repeated field.
#[derive(Debug, Clone, Copy)]
pub struct CountLimit {
    /// Field number.
    pub tag: u32,
    /// Field name.
    pub field: &'static str,
    /// Most occurrences.
    pub allowed: usize,
}

/// A message of `scindo.v1` that is sent on its own.
pub trait WireMessage: prost::Message + prost::Name + Default {
    /// Largest payload [bytes].
    const MAX_BYTES: usize;
    /// Limits of the repeated fields.
    const MAX_COUNTS: &'static [CountLimit] = &[];

    /// Checks ids, ranges, finiteness, and agreement of counts with arrays.
    fn check(&self) -> Result<(), DecodeError>;
}

/// Encoding string of a message: `application/protobuf;scindo.v1.<Message>`.
pub fn encoding<M: WireMessage>() -> String {
    format!("application/protobuf;{}.{}", M::PACKAGE, M::NAME)
}

/// Encodes a message.
pub fn encode<M: WireMessage>(message: &M) -> Bytes {
    message.encode_to_vec().into()
}

/// Decodes and checks a payload. `bytes` fields of the message share the payload's memory.
pub fn decode<M: WireMessage>(payload: Bytes) -> Result<M, DecodeError> {
    if payload.len() > M::MAX_BYTES {
        return Err(DecodeError::TooLarge {
            message: M::NAME,
            field: "payload bytes",
            found: payload.len(),
            allowed: M::MAX_BYTES,
        });
    }
    for limit in M::MAX_COUNTS {
        let found = count_occurrences(&payload, limit.tag).ok_or_else(|| truncated::<M>())?;
        if found > limit.allowed {
            return Err(DecodeError::TooLarge {
                message: M::NAME,
                field: limit.field,
                found,
                allowed: limit.allowed,
            });
        }
    }
    let message =
        M::decode(payload).map_err(|e| DecodeError::Malformed { message: M::NAME, reason: e.to_string() })?;
    message.check()?;
    Ok(message)
}

/// Like [`decode`], for a sample that states its encoding.
pub fn decode_as<M: WireMessage>(stated: &str, payload: Bytes) -> Result<M, DecodeError> {
    let expected = encoding::<M>();
    if stated != expected {
        let found = stated.chars().take(128).collect();
        return Err(DecodeError::Encoding { expected, found });
    }
    decode(payload)
}

fn truncated<M: WireMessage>() -> DecodeError {
    DecodeError::Malformed { message: M::NAME, reason: "truncated or invalid field structure".to_owned() }
}

/// Number of times that field `tag` occurs at the top level of `payload`. `None` if the structure is broken.
fn count_occurrences(mut payload: &[u8], tag: u32) -> Option<usize> {
    let mut count = 0;
    while !payload.is_empty() {
        let key = varint(&mut payload)?;
        if key >> 3 == u64::from(tag) {
            count += 1;
        }
        let skip = match key & 7 {
            0 => {
                varint(&mut payload)?;
                0
            }
            1 => 8,
            2 => usize::try_from(varint(&mut payload)?).ok()?,
            5 => 4,
            _ => return None, // groups do not exist in proto3
        };
        payload = payload.get(skip..)?;
    }
    Some(count)
}

fn varint(bytes: &mut &[u8]) -> Option<u64> {
    let mut value = 0_u64;
    for shift in (0..64).step_by(7) {
        let (&byte, rest) = bytes.split_first()?;
        *bytes = rest;
        value |= u64::from(byte & 0x7f) << shift;
        if byte & 0x80 == 0 {
            return Some(value);
        }
    }
    None
}
