//! Iterative solution of A x = b.

mod pcg;

pub use pcg::{Pcg, PcgReport, PcgSettings, StopReason};
