//! Lists of numbers: sets, union–find, renumbering, lists of different lengths, and memory that grows ahead of need;
//! and how arrays and trait objects are saved.

pub mod bits;
pub mod disjoint;
pub mod jagged;
pub mod numbering;
pub mod padded;
pub mod reserve;
pub mod saved;
pub mod sync;
