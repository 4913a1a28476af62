//! Messages generated from `scindo/v1/*.proto`; meanings, units and layouts stand there.

#![allow(missing_docs, clippy::all)]

include!(concat!(env!("OUT_DIR"), "/scindo.v1.rs"));
