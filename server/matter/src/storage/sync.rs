//! The parts of the standard library that a [`team`](crate::team) of threads is built from, and its patience.
//!
//! The crate `scindo-schedules` compiles the team with other types under these names. Their scheduler decides
//! which thread goes on at every access, and so tries orders that a machine hardly ever takes.

pub use std::hint::spin_loop;
pub use std::sync::Arc;
pub use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
pub use std::thread;

/// The caller gives up its time slice after this many looks at members that are still busy.
pub const SPINS_BEFORE_YIELD: u32 = 2_000;
/// Idle members look for the next phase this many times before they sleep (about 30 µs).
pub const LOOKS_BEFORE_SLEEP: u32 = 4_000;
/// A member that has just helped a team looks only there this many times, since the team mostly goes on
/// at once and its data is near the core.
pub const LOOKS_BEFORE_WANDERING: u32 = 200;
