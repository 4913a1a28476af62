//! Small teams of threads that work on one step together.
//!
//! The caller's thread is member 0; the others spin briefly between phases and sleep between steps. Every
//! phase is a fixed list of tasks. Each member starts on a range of its own, which keeps its part of the
//! data near its core, and then helps with the ranges of the others. A member that gets no processor time
//! therefore delays nobody. Tasks write only their own blocks, and partial results are summed in task
//! order. The result depends neither on the number of members nor on who did what. No phase allocates.
//!
//! Bodies that do not depend on each other work side by side: [`Team::sharing`] makes a team for each of
//! them, on one set of threads. Every thread leads a body through its step, one after another. A thread
//! that finds no body to lead helps with the phases of the others, beginning with the body in whose share it
//! is. A single large body is therefore not left to one thread, and no thread waits beside another's work.

#![allow(unsafe_code)] // sharing a borrowed closure and disjoint blocks with persistent threads

mod blocks;
mod gate;
pub mod phase;
mod threads;

pub use blocks::{Blocks, BlocksMut, RangesMut, blocks, ranges};

use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::storage::sync::{Arc, AtomicBool, Ordering, SPINS_BEFORE_YIELD, spin_loop, thread};
use crate::team::phase::{Marks, Phase, PhaseMark};

use gate::Gate;
use threads::{Lookout, Threads};

/// Persistent threads that run phases for their owner; alone, or with other teams on the same threads.
#[derive(Debug)]
pub struct Team {
    threads: Arc<Threads>,
    gate: usize,
    stop: Option<Arc<AtomicBool>>,
    marks: Marks,
}

/// Steps several teams side by side; see [`Team::sharing`].
#[derive(Debug)]
pub struct Lead {
    team: Team,
    lookout: Lookout,
}

impl Team {
    /// Calls `mark` from now on with each phase of the work when it begins; `None` ends that.
    pub fn set_phase_mark(&mut self, mark: Option<PhaseMark>) {
        self.marks.set(mark);
    }

    /// Announces that `phase` of the work begins.
    pub fn begin(&mut self, phase: Phase) {
        self.marks.begin(phase);
    }

    /// A team of `threads` members, at least one: the caller itself.
    pub fn new(threads: usize) -> std::io::Result<Self> {
        Ok(Self {
            threads: Arc::new(Threads::new(threads, &[])?),
            gate: 0,
            stop: None,
            marks: Marks::default(),
        })
    }

    /// A team of the caller alone.
    pub fn alone() -> Self {
        Self { threads: Arc::new(Threads::alone()), gate: 0, stop: None, marks: Marks::default() }
    }

    /// A team for each of the `sizes`, all on the same `threads` threads (the caller's included), and the lead
    /// under which they work side by side. A size is the work of a team relative to the others.
    pub fn sharing(threads: usize, sizes: &[usize]) -> std::io::Result<(Lead, Vec<Self>)> {
        let threads = Arc::new(Threads::new(threads, sizes)?);
        let team = |gate| Self { threads: Arc::clone(&threads), gate, stop: None, marks: Marks::default() };
        let lead = Lead { team: team(0), lookout: threads.lookout() };
        Ok((lead, (1..=sizes.len()).map(team).collect()))
    }

    /// Sets the flag that work on the team checks; the work ends early when it is raised.
    pub fn set_stop_flag(&mut self, flag: Arc<AtomicBool>) {
        self.stop = Some(flag);
    }

    /// The flag that work on the team checks, if one was set.
    pub fn stop_flag(&self) -> Option<&Arc<AtomicBool>> {
        self.stop.as_ref()
    }

    /// Whether the flag is raised; false without one.
    pub fn told_to_stop(&self) -> bool {
        self.stop.as_ref().is_some_and(|flag| flag.load(Ordering::Relaxed))
    }

    /// Number of members, the caller included.
    pub fn threads(&self) -> usize {
        self.threads.count()
    }

    /// Runs `task(t, block t of `state`)` once for every block and returns when all are done.
    pub fn for_blocks<B: Blocks>(&mut self, state: B, task: impl Fn(usize, B::Part) + Sync) {
        self.run_blocks(state, task, || false);
    }

    /// Runs these tasks, several at a time, and returns when all are done.
    pub fn run(&mut self, tasks: &mut [&mut (dyn FnMut() + Send)]) {
        self.for_blocks(blocks(tasks, 1), |_, task| task[0]());
    }

    /// As [`for_blocks`](Self::for_blocks). While others are still busy the caller calls `meanwhile`, which
    /// returns whether it did anything.
    fn run_blocks<B: Blocks>(
        &self,
        state: B,
        task: impl Fn(usize, B::Part) + Sync,
        meanwhile: impl FnMut() -> bool,
    ) {
        let (n, gate) = (state.count(), self.threads.gate(self.gate));
        gate.share_out(n);
        let job = |member| {
            gate.work(member, n, |t| {
                // SAFETY: the gate never gives a number twice.
                task(t, unsafe { state.part(t) });
            });
        };
        // SAFETY: this team alone uses its gate, and both callers of this function borrow it exclusively.
        unsafe { run(&self.threads, gate, &job, meanwhile) };
    }
}

/// Runs `job(0)` here and `job(member)` on every member that enters before the caller is done.
///
/// # Safety
/// The caller alone uses the gate.
unsafe fn run(
    threads: &Threads,
    gate: &Gate,
    job: &(dyn Fn(usize) + Sync),
    mut meanwhile: impl FnMut() -> bool,
) {
    if threads.count() == 1 {
        return job(0);
    }
    // SAFETY: the caller owns the gate, and `job` is alive until nobody is inside any more.
    unsafe { gate.open(job) };
    threads.wake();
    let own = catch_unwind(AssertUnwindSafe(|| job(0)));
    // Late members stay outside; `job` must outlive those inside.
    gate.close();
    let mut spins = 0_u32;
    while !gate.is_left() {
        spins = if meanwhile() { 0 } else { spins + 1 };
        if spins < SPINS_BEFORE_YIELD { spin_loop() } else { thread::yield_now() }
    }
    if let Err(panic) = own {
        std::panic::resume_unwind(panic);
    }
    assert!(!gate.take_panic(), "a physics thread panicked");
}

impl Lead {
    /// Runs `task(t, block t of `state`)` once for every block, several at a time, and returns when all are
    /// done. Tasks may use teams made together with this lead, each task its own. A caller that finds no task
    /// helps with the phases of these teams.
    pub fn side_by_side<B: Blocks>(&mut self, state: B, task: impl Fn(usize, B::Part) + Sync) {
        let Self { team, lookout } = self;
        team.run_blocks(state, task, || team.threads.help(lookout));
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;
