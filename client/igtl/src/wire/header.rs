//! The 58 bytes before every message, and the check sum of its body.

use std::time::{SystemTime, UNIX_EPOCH};

use crc::{CRC_64_ECMA_182, Crc};

use super::fields::text;

/// Length of the header [bytes].
pub const HEADER_BYTES: usize = 58;

/// Longest type of a message [bytes].
pub const KIND_BYTES: usize = 12;

/// Longest device name [bytes].
pub const NAME_BYTES: usize = 20;

/// Longest body that is read [bytes]. A string has at most 64 KiB, and 256 tracked tools have 18 kB.
pub const MAX_BODY_IN: u64 = 1 << 20;

/// Longest body of a type that is not read [bytes], which is skipped without being kept: an image of 512³ voxels of two
/// bytes. A longer one ends the connection.
pub const MAX_SKIPPED: u64 = 1 << 28;

/// Longest body that is sent [bytes]: 300,000 triangles with normals.
pub const MAX_BODY_OUT: usize = 16 << 20;

static ECMA: Crc<u64> = Crc::<u64>::new(&CRC_64_ECMA_182);

/// Check sum of a body.
pub fn check_sum(body: &[u8]) -> u64 {
    ECMA.checksum(body)
}

/// A time since 1970 [2⁻³² s]; 0: unknown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct TimeStamp(pub u64);

impl TimeStamp {
    /// The present time of this machine.
    pub fn now() -> Self {
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        Self::from_unix_ns(u64::try_from(since.as_nanos()).unwrap_or(u64::MAX))
    }

    /// From nanoseconds since 1970.
    pub fn from_unix_ns(ns: u64) -> Self {
        let (seconds, rest) = (ns / 1_000_000_000, ns % 1_000_000_000);
        Self((seconds << 32) | ((rest << 32) / 1_000_000_000))
    }

    /// Seconds since 1970.
    pub fn seconds(self) -> f64 {
        (self.0 >> 32) as f64 + (self.0 & 0xffff_ffff) as f64 / 4_294_967_296.0
    }
}

/// What stands before a body.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Header {
    /// 1, or 2 and 3 for bodies with an extended header.
    pub version: u16,
    /// Type of the message.
    pub kind: String,
    /// Name of the device that the message is about.
    pub device: String,
    /// When the content was measured.
    pub time: TimeStamp,
    /// Length of the body [bytes].
    pub body_bytes: u64,
    /// Check sum of the body.
    pub check_sum: u64,
}

/// The stream cannot be read any further: where the next message begins is unknown, or it would cost too much to go
/// there.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Broken {
    /// A version that no OpenIGTLink has.
    #[error("header version {found} instead of 1, 2 or 3: the peer does not speak OpenIGTLink")]
    Version {
        /// The version.
        found: u16,
    },
    /// A type that is not a word.
    #[error("message type {found:02x?} is not a word in ASCII: the peer does not speak OpenIGTLink")]
    Kind {
        /// The bytes of the type.
        found: [u8; KIND_BYTES],
    },
    /// A body above the limit.
    #[error(
        "a {kind} of {found} bytes, of which at most {allowed} are read; stop sending it here, or make it smaller"
    )]
    TooLong {
        /// Type of the message.
        kind: String,
        /// Length of its body [bytes].
        found: u64,
        /// Longest body of the type [bytes].
        allowed: u64,
    },
    /// Many spoilt bodies one after another.
    #[error(
        "{count} messages in a row have a wrong check sum: the stream is spoilt, or the peer computes no CRC-64"
    )]
    Spoilt {
        /// How many there were.
        count: u32,
    },
}

impl Header {
    /// Reads a header.
    ///
    /// # Errors
    /// The bytes are no header. [`Broken::TooLong`] is the business of [`super::stream`].
    pub fn decode(bytes: &[u8; HEADER_BYTES]) -> Result<Self, Broken> {
        let number = |from: usize| {
            bytes[from..from + 8].iter().fold(0_u64, |number, byte| (number << 8) | u64::from(*byte))
        };
        let version = u16::from_be_bytes([bytes[0], bytes[1]]);
        if !(1..=3).contains(&version) {
            return Err(Broken::Version { found: version });
        }
        let mut kind = [0; KIND_BYTES];
        kind.copy_from_slice(&bytes[2..14]);
        let end = kind.iter().position(|b| *b == 0).unwrap_or(KIND_BYTES);
        let word = kind[..end].trim_ascii_end();
        let is_word = |b: &u8| b.is_ascii_alphanumeric() || *b == b'_';
        if word.is_empty() || !word.iter().all(is_word) || kind[end..].iter().any(|b| *b != 0) {
            return Err(Broken::Kind { found: kind });
        }
        Ok(Self {
            version,
            kind: text(word),
            device: text(&bytes[14..34]),
            time: TimeStamp(number(34)),
            body_bytes: number(42),
            check_sum: number(50),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_check_sum_is_that_of_the_catalogue() {
        assert_eq!(check_sum(b"123456789"), 0x6c40_df5f_0b49_7347);
        assert_eq!(check_sum(b""), 0);
    }

    #[test]
    fn what_is_not_openigtlink_is_told() {
        let mut http = [0; HEADER_BYTES];
        http[..15].copy_from_slice(b"GET / HTTP/1.1\r");
        assert_eq!(Header::decode(&http), Err(Broken::Version { found: u16::from_be_bytes(*b"GE") }));
        let mut blank = [0; HEADER_BYTES];
        blank[1] = 1;
        assert!(matches!(Header::decode(&blank), Err(Broken::Kind { .. })));
        blank[2..6].copy_from_slice(b"A\0B\0");
        assert!(matches!(Header::decode(&blank), Err(Broken::Kind { .. })), "text after the end");
    }

    #[test]
    fn the_time_is_that_of_the_clock() {
        let before = SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_secs_f64();
        let now = TimeStamp::now().seconds();
        assert!((now - before).abs() < 60.0 && TimeStamp::from_unix_ns(1_500_000_000) == TimeStamp(3 << 31));
    }
}
