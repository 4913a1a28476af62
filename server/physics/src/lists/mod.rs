//! Lists of numbers: sets, union–find, renumbering, lists of different lengths, and memory that grows ahead of need.

pub mod bits;
pub mod disjoint;
pub mod jagged;
pub mod numbering;
pub mod reserve;
