//! The thread team of `scindo-matter`, compiled with the threads and atomics of `shuttle`.
//!
//! Every access to an atomic is a point where the scheduler may let another thread go on. A team that works on
//! a machine millions of times may still hang or run a task twice in an order that the machine rarely takes;
//! here such orders come up within seconds, and a failure prints the schedule that repeats it. The scheduler
//! tries orders of accesses, not the weaker memory orderings of a processor.

#![allow(dead_code, unreachable_pub)] // the sources of the team also serve what is not tried here

/// The paths under which the team finds them.
pub mod storage {
    pub mod sync;
}
#[path = "../../../server/matter/src/team/mod.rs"]
pub mod team;
