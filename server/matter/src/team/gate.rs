//! The gate to the phases of one team: members enter while it is open.

#![allow(unsafe_code)] // sharing a borrowed closure with persistent threads

use std::cell::UnsafeCell;
use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::storage::sync::{AtomicBool, AtomicU64, AtomicUsize, Ordering};

type Job = *const (dyn Fn(usize) + Sync);

/// Where the members of one team find its present phase.
#[derive(Debug)]
#[repr(align(128))]
pub(super) struct Gate {
    /// Job that every member runs in the current phase; written only while nobody is inside.
    job: UnsafeCell<Option<Job>>,
    /// Number of the phase (upper half), [`CLOSED`], and how many members are inside (lower bits).
    word: AtomicU64,
    /// Next task in the range of every member.
    next: Vec<Counter>,
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
unsafe impl Sync for Gate {}
// SAFETY: the pointer inside `job` is only dereferenced while the owner keeps it alive (see `open`).
unsafe impl Send for Gate {}

impl Gate {
    /// A closed gate for as many members.
    pub(super) fn new(members: usize) -> Self {
        Self {
            job: UnsafeCell::new(None),
            word: AtomicU64::new(CLOSED),
            next: (0..members).map(|_| Counter::default()).collect(),
            panicked: AtomicBool::new(false),
        }
    }

    /// Divides the tasks 0 … `n` − 1 among the members. Only while the gate is closed and empty.
    pub(super) fn share_out(&self, n: usize) {
        for (member, next) in self.next.iter().enumerate() {
            next.0.store(self.first(member, n), Ordering::Relaxed);
        }
    }

    /// Runs tasks of `n` as `member`: those of its own range first, then what the others have left. No number
    /// is given twice.
    pub(super) fn work(&self, member: usize, n: usize, mut task: impl FnMut(usize)) {
        for helped in (member..self.next.len()).chain(0..member) {
            loop {
                let t = self.next[helped].0.fetch_add(1, Ordering::Relaxed);
                if t >= self.first(helped + 1, n) {
                    break;
                }
                task(t);
            }
        }
    }

    /// First of `n` tasks in the range of a member.
    fn first(&self, member: usize, n: usize) -> usize {
        n * member / self.next.len()
    }

    /// Lets members into the next phase.
    ///
    /// # Safety
    /// The caller is the only owner. It has to keep `job` alive until it has called [`close`](Self::close) and
    /// seen that [`is_left`](Self::is_left), before it opens the gate again too.
    pub(super) unsafe fn open(&self, job: &(dyn Fn(usize) + Sync)) {
        // SAFETY: the gate is closed and nobody is inside, so nobody reads the cell; the caller keeps the
        // closure alive as long as somebody may be inside.
        unsafe {
            *self.job.get() = Some(std::mem::transmute::<*const (dyn Fn(usize) + Sync + '_), Job>(job));
        }
        let phase = (self.word.load(Ordering::Relaxed) & !(PHASE - 1)).wrapping_add(PHASE);
        self.word.store(phase, Ordering::Release);
    }

    /// Lets nobody in any more.
    pub(super) fn close(&self) {
        self.word.fetch_or(CLOSED, Ordering::Relaxed);
    }

    /// Whether nobody is inside; what those who left have written is visible then.
    pub(super) fn is_left(&self) -> bool {
        self.word.load(Ordering::Acquire) & INSIDE == 0
    }

    /// Whether a member panicked since the last call.
    pub(super) fn take_panic(&self) -> bool {
        self.panicked.swap(false, Ordering::Relaxed)
    }

    /// Works on the present phase as `member` if it is open and is not `done`, which becomes its number.
    /// Returns whether it did.
    pub(super) fn help(&self, member: usize, done: &mut u64) -> bool {
        let Some(phase) = self.enter(*done) else { return false };
        *done = phase;
        // SAFETY: this member is inside, so the owner keeps the job alive; it is Sync.
        let result = catch_unwind(AssertUnwindSafe(|| unsafe {
            if let Some(job) = *self.job.get() {
                (*job)(member);
            }
        }));
        if result.is_err() {
            self.panicked.store(true, Ordering::Relaxed);
        }
        self.word.fetch_sub(1, Ordering::Release);
        true
    }

    /// Enters the present phase if it is open and is not `done`; returns its number.
    fn enter(&self, done: u64) -> Option<u64> {
        let mut word = self.word.load(Ordering::Relaxed);
        loop {
            let phase = word & !(PHASE - 1);
            if word & CLOSED != 0 || phase == done {
                return None;
            }
            match self.word.compare_exchange_weak(word, word + 1, Ordering::Acquire, Ordering::Relaxed) {
                Ok(_) => return Some(phase),
                Err(now) => word = now,
            }
        }
    }
}
