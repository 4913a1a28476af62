//! Loose parts of a body and their balance of momentum.
//!
//! An iterative solve that stops early leaves a residual, and the residual of a part that hangs on
//! nothing is momentum out of thin air. Translations are null vectors of K̂, so their three
//! equations per part can be solved exactly, before the iteration and after it: every loose part
//! falls with g and answers to its springs exactly, however few iterations are made.

use nalgebra::{Matrix3, Vector3};
use scindo_matter::element::FixedCopy;
use scindo_matter::storage::disjoint::{find, join};
use scindo_matter::storage::reserve::resize_reserving;

/// Connected parts of a body, by copy.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct LooseParts {
    /// Part of every copy.
    pub of_copy: Vec<u32>,
    /// Mass of every part [kg].
    pub mass: Vec<f64>,
    /// Whether no copy of the part is fixed in any direction.
    pub free: Vec<bool>,
}

impl LooseParts {
    /// Finds the parts that groups of copies hold together: pieces, elements, springs. `for_groups` hands
    /// them over one by one.
    pub fn connected(
        for_groups: impl FnOnce(&mut dyn FnMut(&[u32])),
        mass: &[f64],
        fixed: &[FixedCopy],
    ) -> Self {
        let n = mass.len();
        let mut root: Vec<u32> = (0..n as u32).collect();
        for_groups(&mut |group| {
            // Most groups are connected already, with short paths to the root.
            let first = root[group[0] as usize];
            if !group.iter().all(|&copy| root[copy as usize] == first) {
                for &copy in &group[1..] {
                    join(&mut root, group[0], copy);
                }
            }
        });
        let mut parts = Self::default();
        resize_reserving(&mut parts.of_copy, n, 0);
        let mut n_parts = 0;
        for copy in 0..n {
            let r = find(&mut root, copy as u32) as usize;
            // Roots are the smallest copy of their part, so they come first.
            if r == copy {
                parts.of_copy[copy] = n_parts;
                n_parts += 1;
            } else {
                parts.of_copy[copy] = parts.of_copy[r];
            }
        }
        parts.mass = vec![0.0; n_parts as usize];
        parts.measure(mass, fixed);
        parts
    }

    /// Computes from the masses of the copies [kg] the mass of every part and whether it is free.
    pub(super) fn measure(&mut self, mass: &[f64], fixed: &[FixedCopy]) {
        match &mut self.mass[..] {
            [one] => *one = sum(mass),
            of_parts => {
                of_parts.fill(0.0);
                for (&part, m) in self.of_copy.iter().zip(mass) {
                    of_parts[part as usize] += m;
                }
            }
        }
        self.free.clear();
        self.free.extend(self.mass.iter().map(|&m| m > 0.0));
        for copy in fixed.iter().filter(|f| f.held.any()) {
            self.free[self.of_copy[copy.copy as usize] as usize] = false;
        }
    }

    /// Number of parts.
    pub fn len(&self) -> usize {
        self.mass.len()
    }

    /// Whether there is no part.
    pub fn is_empty(&self) -> bool {
        self.mass.is_empty()
    }

    /// Whether any part is held nowhere.
    pub fn any_free(&self) -> bool {
        self.free.contains(&true)
    }
}

/// Sum of these numbers, several at once.
fn sum(numbers: &[f64]) -> f64 {
    let (whole, rest) = numbers.as_chunks::<8>();
    let mut sums = [0.0; 8];
    for eight in whole {
        for (sum, number) in sums.iter_mut().zip(eight) {
            *sum += number;
        }
    }
    sums.iter().chain(rest).sum()
}

/// The three translation equations S t = b of every part.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Translations {
    /// Translation of every part so far [m].
    pub shift: Vec<Vector3<f64>>,
    matrix: Vec<Matrix3<f64>>,
    rhs: Vec<Vector3<f64>>,
}

impl Translations {
    /// Starts over for `parts`: no shift.
    pub(super) fn restart(&mut self, parts: &LooseParts) {
        self.shift.clear();
        self.shift.resize(parts.len(), Vector3::zeros());
    }

    /// Starts the equations of `parts`: S = factor · mass, b = 0.
    pub(super) fn begin(&mut self, parts: &LooseParts, mass_factor: f64) {
        self.matrix.clear();
        self.matrix.extend(parts.mass.iter().map(|m| Matrix3::from_diagonal_element(m * mass_factor)));
        self.rhs.clear();
        self.rhs.resize(parts.len(), Vector3::zeros());
    }

    /// Adds `b` to the right-hand side of the part of `copy`.
    #[inline(always)]
    pub(super) fn add(&mut self, parts: &LooseParts, copy: usize, b: Vector3<f64>) {
        self.rhs[parts.of_copy[copy] as usize] += b;
    }

    /// Adds a spring on the part of `copy`: stiffness to S and force to b.
    pub(super) fn add_spring(&mut self, parts: &LooseParts, copy: usize, S: Matrix3<f64>, b: Vector3<f64>) {
        self.matrix[parts.of_copy[copy] as usize] += S;
        self.rhs[parts.of_copy[copy] as usize] += b;
    }

    /// S and b of a part.
    pub(super) fn equation(&self, part: usize) -> (&Matrix3<f64>, &Vector3<f64>) {
        (&self.matrix[part], &self.rhs[part])
    }

    /// Solves for every free part and adds the result to `shift`.
    pub(super) fn solve(&mut self, parts: &LooseParts) {
        for part in (0..parts.len()).filter(|&p| parts.free[p]) {
            if let Some(inverse) = self.matrix[part].try_inverse() {
                self.shift[part] += inverse * self.rhs[part];
            }
        }
    }
}
