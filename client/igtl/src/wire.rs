//! OpenIGTLink messages as bytes, with limits. Reading is a pure function of the bytes.
//!
//! ```text
//! offset  bytes  header, big-endian
//!      0      2  version: 1 (protocol 1 and 2), or 2 and 3 (protocol 3: an extended header follows)
//!      2     12  type, ASCII, padded with zeros
//!     14     20  device name, padded with zeros
//!     34      8  time since 1970 [2⁻³² s]; 0: unknown
//!     42      8  length of the body [bytes]
//!     50      8  CRC-64 of the body: ECMA-182, polynomial 42f0e1eba9ea3693, not reflected, start 0
//! ```
//! Body of version 1: the content. Body of the others: extended header (12 bytes or more: its length u16, length of
//! the index of metadata u16, length of metadata u32, message number u32), content, index of metadata, metadata.
//! Metadata is skipped.
//!
//! # Source
//! Protocol pages of openigtlink.org, and Tokuda et al. (2009), *OpenIGTLink: an open network protocol for
//! image-guided therapy environment*, Int. J. Med. Robot. 5. Bytes of pyigtl, another implementation, are in the tests.

pub mod header;

pub mod content;

pub mod encode;

pub mod stream;

mod unreadable;
mod fields;
