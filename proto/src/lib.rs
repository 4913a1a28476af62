//! The wire of scindo: messages, keys, limits, and the codec that guards them. It contains no physics, no
//! algorithm and no transport.
//!
//! # Layout
//! * [`messages`]: the structs generated from `scindo/v1/*.proto`.
//! * [`key`]: the key space `<realm>/@v1/<session>/…`, built and parsed in one place.
//! * [`endpoint`]: the endpoint of a client's second connection.
//! * [`limits`]: limits on sizes, counts and values; each constant with its reason.
//! * [`check`]: conditions that a decoded message must meet before it is used.
//! * [`name`]: names of people.
//! * [`codec`]: bytes ↔ messages; sizes and counts are checked before anything is allocated.

pub mod messages;

pub mod limits;

pub mod endpoint;

pub mod name;

pub mod key;

pub mod codec;

mod check;

pub use codec::{DecodeError, WireMessage, decode, decode_as, encode, encoding};
pub use key::{Chunk, KeyError, KeySpace, MOUSE, Role, Topic, Verb};

/// Version of the wire: the `@v1` chunk of every key and `SessionInfo::wire_version`.
pub const WIRE_VERSION: u32 = 1;

/// Encoded `google.protobuf.FileDescriptorSet` of package `scindo.v1`; the answer of `rpc/schema`.
pub const FILE_DESCRIPTOR_SET: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/scindo_v1.binpb"));
