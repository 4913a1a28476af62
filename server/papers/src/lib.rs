//! Studies for papers and on the way of the product: none of them is needed to run a scene.
//!
//! `scindo` starts the binary `scindo-papers` of this crate for its commands `accuracy NAME`, `stress`, `haptics`,
//! `reliability` and `book`. Modules are listed from those that know nothing of the others to the one that drives all.
//!
//! * [`lab`] and [`system`]: what experiments share, and linear systems of octree cells taken apart.
//! * [`cases`]: accuracy cases with known solutions, run by `scindo-study`.
//! * [`enrichment`]: the bases of enriched finite elements, compared on cut elements and bodies.
//! * [`experiment`]: measurements of parts of the program, many of them beside the figures of a paper.
//! * [`stress`]: hard cases, which break codes that deform and cut.
//! * [`haptics`]: what a hand feels over a link, against the same tissue solved at 1 kHz.
//! * [`book`]: all results, beside the numbers that papers print.
//! * [`command`]: the commands and their outcome.

#[allow(non_snake_case)] // the symbols of the field: A, X, K
pub mod lab;

#[allow(non_snake_case)]
pub mod system;

pub mod cases;

#[allow(non_snake_case)]
#[allow(clippy::needless_range_loop)] // i, j are tensor indices
pub mod enrichment;

#[allow(non_snake_case)]
pub mod experiment;

#[allow(non_snake_case)]
pub mod stress;

pub mod haptics;

pub mod book;

pub mod error;

pub mod command;
