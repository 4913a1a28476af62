//! Lists of numbers: union–find, renumbering, and memory that grows ahead of need.

pub mod disjoint;
pub mod numbering;
pub mod reserve;
