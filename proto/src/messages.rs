//! Messages generated from `scindo/v1/*.proto`; meanings, units and layouts stand there.

// The comments of the .proto files are prose: `tool/<id>` is not HTML, and `[m]` is not a link.
#![allow(missing_docs, clippy::all, rustdoc::all)]

include!(concat!(env!("OUT_DIR"), "/scindo.v1.rs"));
