//! The constraint filter: which displacements are prescribed.

use nalgebra::{RealField, Vector3};

use crate::operator::FixedCopy;

/// The projection S onto the directions that are free: a diagonal of ones and zeros.
///
/// A solver works on S A S instead of A, so that the matrix keeps its pattern whatever is held.
///
/// # Source
/// Baraff, Witkin 1998; the thesis' vector S (Jeřábková 2007, Fig. 4.15).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Filter {
    held: Vec<(u32, [bool; 3])>,
}

impl Filter {
    /// Sets which directions of which copies are prescribed.
    pub fn set(&mut self, fixed: &[FixedCopy]) {
        self.held.clear();
        self.held.extend(fixed.iter().map(|f| (f.copy, f.axes)));
    }

    /// Sets the copies with prescribed directions, and which directions these are.
    pub fn set_held(&mut self, held: &[(u32, [bool; 3])]) {
        self.held.clear();
        self.held.extend_from_slice(held);
    }

    /// Copies with prescribed directions, and which directions these are.
    pub fn held(&self) -> &[(u32, [bool; 3])] {
        &self.held
    }

    /// v ← S v.
    pub fn apply<T: RealField + Copy>(&self, v: &mut [Vector3<T>]) {
        for &(copy, axes) in &self.held {
            for axis in (0..3).filter(|&axis| axes[axis]) {
                v[copy as usize][axis] = T::zero();
            }
        }
    }
}
