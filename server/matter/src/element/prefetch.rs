//! Asking for memory before it is read.

#![allow(unsafe_code)] // a hint to the processor

/// Asks for a value that is read soon, where the processor takes such hints. Kernels do so with data that they read
/// only once per application: of a large body it comes from memory each time.
#[inline(always)]
pub fn prefetch<T: ?Sized>(value: &T) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        let start = (&raw const *value).cast::<i8>();
        for line in 0..size_of_val(value).div_ceil(64) {
            // SAFETY: a hint, within the value.
            unsafe { _mm_prefetch::<_MM_HINT_T0>(start.wrapping_add(64 * line)) };
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = value;
}

/// Asks for an entry that is read soon, if there is one.
#[inline(always)]
pub fn prefetch_at<T>(entries: &[T], at: usize) {
    if let Some(entry) = entries.get(at) {
        prefetch(entry);
    }
}
