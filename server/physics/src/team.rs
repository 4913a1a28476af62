//! A small team of threads that works on one step together.
//!
//! The caller's thread is member 0; the others spin briefly between phases and sleep between steps. Every
//! phase is a fixed list of tasks. Each member starts on a range of its own, which keeps its part of the
//! data near its core, and then helps with the ranges of the others. A member that gets no processor time
//! therefore delays nobody. Tasks write only their own blocks, and partial results are summed in task
//! order. The result depends neither on the number of members nor on who did what. No phase allocates.

#![allow(unsafe_code)] // sharing a borrowed closure and disjoint blocks with persistent threads

use std::cell::UnsafeCell;
use std::marker::PhantomData;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::thread::JoinHandle;

/// Idle members look for the next phase this many times before they sleep (about 30 µs).
const SPINS_BEFORE_SLEEP: u32 = 4_000;
/// The caller gives up its time slice after this many looks at members that are still busy.
const SPINS_BEFORE_YIELD: u32 = 2_000;

/// Persistent threads that run phases for their owner.
#[derive(Debug)]
pub struct Team {
    shared: Arc<Shared>,
    members: Vec<JoinHandle<()>>,
    stop: Option<Arc<AtomicBool>>,
}

type Job = *const (dyn Fn(usize) + Sync);

#[derive(Debug)]
struct Shared {
    /// Job that every member runs in the current phase; written only while nobody is inside.
    job: UnsafeCell<Option<Job>>,
    /// Number of the phase (upper half), [`CLOSED`], and how many members are inside (lower bits).
    gate: AtomicU64,
    /// Next task in the range of every member.
    next: Vec<Counter>,
    stop: AtomicBool,
    panicked: AtomicBool,
}

/// Alone on its cache line, so that members do not slow each other down.
#[derive(Debug, Default)]
#[repr(align(128))]
struct Counter(AtomicUsize);

/// Flag of the gate: nobody may enter the phase any more.
const CLOSED: u64 = 1 << 31;
const INSIDE: u64 = CLOSED - 1;
const PHASE: u64 = 1 << 32;

// SAFETY: `job` is written by the owner while the gate is closed and nobody is inside, and read only
// by members that entered through the gate, which synchronises with its opening.
unsafe impl Sync for Shared {}
// SAFETY: the pointer inside `job` is only dereferenced while the owner's `run` keeps it alive.
unsafe impl Send for Shared {}

impl Team {
    /// A team of `threads` members, at least one: the caller itself.
    pub fn new(threads: usize) -> std::io::Result<Self> {
        let shared = Arc::new(Shared {
            job: UnsafeCell::new(None),
            gate: AtomicU64::new(CLOSED),
            next: (0..threads.max(1)).map(|_| Counter::default()).collect(),
            stop: AtomicBool::new(false),
            panicked: AtomicBool::new(false),
        });
        let mut team = Self { shared, members: Vec::new(), stop: None };
        for member in 1..threads {
            let shared = Arc::clone(&team.shared);
            let thread = std::thread::Builder::new().name(format!("physics-{member}"));
            team.members.push(thread.spawn(move || shared.serve(member))?);
        }
        Ok(team)
    }

    /// Sets the flag that work on the team checks; the work ends early when it is raised.
    pub fn set_stop_flag(&mut self, flag: Arc<AtomicBool>) {
        self.stop = Some(flag);
    }

    /// Whether the flag is raised; false without one.
    pub fn told_to_stop(&self) -> bool {
        self.stop.as_ref().is_some_and(|flag| flag.load(Ordering::Relaxed))
    }

    /// Number of members, the caller included.
    pub fn threads(&self) -> usize {
        self.members.len() + 1
    }

    /// Runs `task(t, block t of `state`)` once for every block and returns when all are done.
    pub fn for_blocks<B: Blocks>(&mut self, state: B, task: impl Fn(usize, B::Part) + Sync) {
        let (n, threads) = (state.count(), self.threads());
        let first = |member: usize| n * member / threads;
        for (member, next) in self.shared.next.iter().enumerate() {
            next.0.store(first(member), Ordering::Relaxed);
        }
        let shared = Arc::clone(&self.shared);
        self.run(&|member| {
            // The own range first, then what the others have left.
            for helped in (member..threads).chain(0..member) {
                loop {
                    let t = shared.next[helped].0.fetch_add(1, Ordering::Relaxed);
                    if t >= first(helped + 1) {
                        break;
                    }
                    // SAFETY: the ranges partition 0..n and a counter never gives a number twice.
                    task(t, unsafe { state.part(t) });
                }
            }
        });
    }

    /// Runs `job(0)` here and `job(member)` on every member that enters before the caller is done.
    fn run(&mut self, job: &(dyn Fn(usize) + Sync)) {
        if self.members.is_empty() {
            return job(0);
        }
        let shared = &*self.shared;
        // SAFETY: the gate is closed and nobody is inside, so nobody reads the cell; the lifetime is
        // only extended until this function has closed the gate and seen everybody leave.
        unsafe {
            *shared.job.get() = Some(std::mem::transmute::<*const (dyn Fn(usize) + Sync + '_), Job>(job));
        }
        let phase = (shared.gate.load(Ordering::Relaxed) & !(PHASE - 1)).wrapping_add(PHASE);
        shared.gate.store(phase, Ordering::Release);
        for member in &self.members {
            member.thread().unpark();
        }
        let own = catch_unwind(AssertUnwindSafe(|| job(0)));
        // Late members stay outside; `job` must outlive those inside.
        shared.gate.fetch_or(CLOSED, Ordering::Relaxed);
        let mut spins = 0_u32;
        while shared.gate.load(Ordering::Acquire) & INSIDE > 0 {
            spins += 1;
            if spins < SPINS_BEFORE_YIELD { std::hint::spin_loop() } else { std::thread::yield_now() }
        }
        if let Err(panic) = own {
            std::panic::resume_unwind(panic);
        }
        assert!(!shared.panicked.swap(false, Ordering::Relaxed), "a physics thread panicked");
    }
}

impl Drop for Team {
    fn drop(&mut self) {
        self.shared.stop.store(true, Ordering::Release);
        for member in self.members.drain(..) {
            member.thread().unpark();
            // A member that panicked has been reported by `run` already.
            let _ = member.join();
        }
    }
}

impl Shared {
    fn serve(&self, member: usize) {
        let (mut done, mut spins) = (0, 0);
        while !self.stop.load(Ordering::Acquire) {
            if let Some(phase) = self.enter(done) {
                // SAFETY: this member is inside, so the owner keeps the job alive; it is Sync.
                let result = catch_unwind(AssertUnwindSafe(|| unsafe {
                    if let Some(job) = *self.job.get() {
                        (*job)(member);
                    }
                }));
                if result.is_err() {
                    self.panicked.store(true, Ordering::Relaxed);
                }
                self.gate.fetch_sub(1, Ordering::Release);
                (done, spins) = (phase, 0);
            } else {
                spins += 1;
                if spins < SPINS_BEFORE_SLEEP { std::hint::spin_loop() } else { std::thread::park() }
            }
        }
    }

    /// Enters the present phase if it is open and is not `done`; returns its number.
    fn enter(&self, done: u64) -> Option<u64> {
        let mut gate = self.gate.load(Ordering::Relaxed);
        loop {
            let phase = gate & !(PHASE - 1);
            if gate & CLOSED != 0 || phase == done {
                return None;
            }
            match self.gate.compare_exchange_weak(gate, gate + 1, Ordering::Acquire, Ordering::Relaxed) {
                Ok(_) => return Some(phase),
                Err(now) => gate = now,
            }
        }
    }
}

/// A value that can be divided into blocks that do not overlap.
///
/// # Safety
/// Parts of different numbers must not overlap.
pub unsafe trait Blocks: Sync {
    /// One block; a mutable slice or a tuple of them.
    type Part;
    /// Number of blocks.
    fn count(&self) -> usize;
    /// Block `i`.
    ///
    /// # Safety
    /// Each number below `count` is taken at most once.
    unsafe fn part(&self, i: usize) -> Self::Part;
}

/// A slice in blocks of a fixed size (the last may be shorter).
#[derive(Debug)]
pub struct BlocksMut<'a, T> {
    start: *mut T,
    length: usize,
    size: usize,
    slice: PhantomData<&'a mut [T]>,
}

/// Divides `slice` into blocks of `size` entries.
pub fn blocks<T: Send>(slice: &mut [T], size: usize) -> BlocksMut<'_, T> {
    BlocksMut { start: slice.as_mut_ptr(), length: slice.len(), size: size.max(1), slice: PhantomData }
}

// SAFETY: a shared `BlocksMut` only hands out disjoint parts (contract of `part`).
unsafe impl<T: Send> Sync for BlocksMut<'_, T> {}

// SAFETY: blocks are [i·size, (i+1)·size) of one exclusively borrowed slice.
unsafe impl<'a, T: Send> Blocks for BlocksMut<'a, T> {
    type Part = &'a mut [T];

    fn count(&self) -> usize {
        self.length.div_ceil(self.size)
    }

    unsafe fn part(&self, i: usize) -> &'a mut [T] {
        assert!(i < self.count());
        let first = i * self.size;
        let length = self.size.min(self.length - first);
        // SAFETY: in bounds by the lines above, exclusive by the contract of `part`.
        unsafe { std::slice::from_raw_parts_mut(self.start.add(first), length) }
    }
}

/// A slice in consecutive ranges of different lengths.
#[derive(Debug)]
pub struct RangesMut<'a, T> {
    start: *mut T,
    first: &'a [u32],
    slice: PhantomData<&'a mut [T]>,
}

/// Divides `slice` into the ranges [first\[i\], first\[i + 1\]); `first` must ascend and end within it.
pub fn ranges<'a, T: Send>(slice: &'a mut [T], first: &'a [u32]) -> RangesMut<'a, T> {
    assert!(first.is_sorted() && first.last().is_none_or(|&end| end as usize <= slice.len()));
    RangesMut { start: slice.as_mut_ptr(), first, slice: PhantomData }
}

// SAFETY: a shared `RangesMut` only hands out disjoint parts (contract of `part`).
unsafe impl<T: Send> Sync for RangesMut<'_, T> {}

// SAFETY: the ranges of ascending bounds do not overlap and lie in one exclusively borrowed slice.
unsafe impl<'a, T: Send> Blocks for RangesMut<'a, T> {
    type Part = &'a mut [T];

    fn count(&self) -> usize {
        self.first.len().saturating_sub(1)
    }

    unsafe fn part(&self, i: usize) -> &'a mut [T] {
        let (first, end) = (self.first[i] as usize, self.first[i + 1] as usize);
        // SAFETY: in bounds and ascending by the check of `ranges`, exclusive by the contract.
        unsafe { std::slice::from_raw_parts_mut(self.start.add(first), end - first) }
    }
}

macro_rules! blocks_of_tuples {
    ($($name:ident $at:tt),+) => {
        // SAFETY: parts are tuples of parts that do not overlap.
        unsafe impl<$($name: Blocks),+> Blocks for ($($name,)+) {
            type Part = ($($name::Part,)+);
            fn count(&self) -> usize {
                let n = self.0.count();
                $(assert_eq!(self.$at.count(), n, "as many blocks in every slice");)+
                n
            }
            unsafe fn part(&self, i: usize) -> Self::Part {
                // SAFETY: forwarded contract.
                unsafe { ($(self.$at.part(i),)+) }
            }
        }
    };
}
blocks_of_tuples!(A 0, B 1);
blocks_of_tuples!(A 0, B 1, C 2);
blocks_of_tuples!(A 0, B 1, C 2, D 3);

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn every_block_is_visited_once_by_any_number_of_members() {
        for threads in [1, 2, 3, 8] {
            let mut team = Team::new(threads).unwrap();
            let (mut values, mut sums) = (vec![0_u32; 1003], vec![0_u32; 101]);
            for _ in 0..200 {
                team.for_blocks((blocks(&mut values, 10), blocks(&mut sums, 1)), |i, (part, sum)| {
                    part.iter_mut().for_each(|v| *v += i as u32);
                    sum[0] = part.iter().sum();
                });
            }
            assert!(values.iter().enumerate().all(|(k, &v)| v == 200 * (k as u32 / 10)));
            assert_eq!(sums.iter().sum::<u32>(), values.iter().sum());
        }
    }

    #[test]
    fn a_panic_in_a_task_reaches_the_caller_and_the_team_goes_on() {
        let mut team = Team::new(2).unwrap();
        let mut values = [0; 64];
        let panicked = catch_unwind(AssertUnwindSafe(|| {
            team.for_blocks(blocks(&mut values, 1), |i, _| assert!(i != 40, "expected"));
        }));
        assert!(panicked.is_err());
        team.for_blocks(blocks(&mut values, 1), |i, v| v[0] = i);
        assert!(values.iter().enumerate().all(|(i, v)| i == *v));
    }
}
