//! Slices divided into blocks that do not overlap, so that members of a team can write them at once.

#![allow(unsafe_code)] // disjoint blocks of one exclusively borrowed slice

use std::marker::PhantomData;

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
