//! The constraint filter: which displacements are prescribed.

use nalgebra::{RealField, Vector3};
use scindo_matter::element::{FixedCopy, Held};

/// The projection S onto the directions that are free: a block per copy, of ones and zeros
/// where it is held along world axes.
///
/// A solver works on S A S instead of A, so that the matrix keeps its pattern whatever is held.
///
/// # Source
/// Baraff, Witkin 1998; the thesis' vector S (Jeřábková 2007, Fig. 4.15).
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Filter {
    held: Vec<(u32, Held)>,
}

impl Filter {
    /// Sets which directions of which copies are prescribed.
    pub fn set(&mut self, fixed: &[FixedCopy]) {
        self.held.clear();
        self.held.extend(fixed.iter().map(|f| (f.copy, f.held)));
    }

    /// Sets the copies with prescribed directions, and which directions these are.
    pub fn set_held(&mut self, held: &[(u32, Held)]) {
        self.held.clear();
        self.held.extend_from_slice(held);
    }

    /// Copies with prescribed directions, and which directions these are.
    pub fn held(&self) -> &[(u32, Held)] {
        &self.held
    }

    /// v ← S v.
    pub fn apply<T: RealField + Copy>(&self, v: &mut [Vector3<T>]) {
        for &(copy, held) in &self.held {
            held.clear(&mut v[copy as usize]);
        }
    }

    /// v ← S v for the copies that are held along other directions than world axes: there a solver that is exact
    /// along axes leaves rounding.
    pub fn apply_inclined<T: RealField + Copy>(&self, v: &mut [Vector3<T>]) {
        for (copy, held) in self.held.iter().filter(|(_, held)| held.is_inclined()) {
            held.clear(&mut v[*copy as usize]);
        }
    }
}
