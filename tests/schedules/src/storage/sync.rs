//! What a team is built from, under the scheduler of `shuttle`; and so little patience that its members
//! sleep, wander and yield within a short schedule.

pub use shuttle::hint::spin_loop;
pub use shuttle::sync::Arc;
pub use shuttle::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
pub use shuttle::thread;

/// Looks at busy members before the caller gives up its time slice.
pub const SPINS_BEFORE_YIELD: u32 = 1;
/// Looks for the next phase before a member sleeps.
pub const LOOKS_BEFORE_SLEEP: u32 = 2;
/// Looks at one team before a member looks at the others.
pub const LOOKS_BEFORE_WANDERING: u32 = 1;
