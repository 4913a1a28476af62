//! Counts the allocations of a thread, for tests that a steady step, tick or query allocates nothing, and the bytes that
//! it holds, for tests that nothing piles up.
//!
//! ```
//! #[global_allocator]
//! static ALLOCATOR: scindo_allocations::Counting = scindo_allocations::Counting;
//!
//! let before = scindo_allocations::allocations();
//! let list = vec![1, 2, 3];
//! assert_eq!(scindo_allocations::allocations() - before, 1);
//! # drop(list);
//! ```

#![allow(unsafe_code)] // an allocator cannot be written without

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

/// The system allocator, which also counts the allocations of each thread.
#[derive(Debug)]
pub struct Counting;

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
    static HELD: Cell<i64> = const { Cell::new(0) };
}

/// Allocations that the calling thread has made so far. Stays 0 unless [`Counting`] is the program's
/// `#[global_allocator]`.
pub fn allocations() -> u64 {
    ALLOCATIONS.with(Cell::get)
}

/// Bytes that the calling thread has taken and not given back so far. Stays 0 unless [`Counting`] is the program's
/// `#[global_allocator]`.
pub fn held_bytes() -> i64 {
    HELD.with(Cell::get)
}

// SAFETY: every call is passed on to the system allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // A thread that is ending no longer has its counter; nobody asks it either.
        let _ = ALLOCATIONS.try_with(|n| n.set(n.get() + 1));
        let _ = HELD.try_with(|bytes| bytes.set(bytes.get() + layout.size().cast_signed() as i64));
        // SAFETY: the caller's promise about `layout` is handed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        let _ = HELD.try_with(|bytes| bytes.set(bytes.get() - layout.size().cast_signed() as i64));
        // SAFETY: the caller's promise about `pointer` and `layout` is handed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}
