//! Bounds of the largest eigenvalue of D⁻¹A on the finest level that hold however the body is cut.
//!
//! # Derivation
//! A = Σ Aₑ over the cells, and D = Σ Dₑ with the diagonal blocks Dₑ of Aₑ. From Aₑ ≤ μₑ Dₑ follows A ≤ max μₑ · D. A
//! rotation of a cell leaves μₑ, lumped mass adds the same to both sides, and prescribed directions restrict both, so
//! μₑ depends on Poisson's ratio and on hanging corners alone. It is at most a few per cent above the safe estimate for
//! a large uncut body.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, SMatrix};
use scindo_matter::octree::{Cell, corner_weights};

use super::galerkin::Coefficients;
use super::level::Level;
use crate::operator::cells::{slot_hanging, unit_stiffness};

type Matrix24 = SMatrix<f64, 24, 24>;

/// The largest eigenvalue of a leaf by its material and by which of its corners hang, for those that occurred.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct LeafBounds {
    known: BTreeMap<(u16, u8), f64>,
    largest: f64,
}

impl LeafBounds {
    /// Forgets all: the constants change.
    pub(super) fn clear(&mut self) {
        self.known.clear();
        self.largest = 0.0;
    }

    /// The bound for a body whose leaves are those of `finest`. Only `changed` leaves are examined, unless nothing is
    /// known yet.
    pub(super) fn largest(&mut self, finest: &Level, changed: &[u32], with: &Coefficients) -> f64 {
        if self.known.is_empty() {
            (0..finest.cells.len()).for_each(|id| self.add(finest, id, with));
        } else {
            changed.iter().for_each(|&id| self.add(finest, id as usize, with));
        }
        self.largest
    }

    fn add(&mut self, finest: &Level, id: usize, with: &Coefficients) {
        let cell = &finest.cells[id];
        let slots = slot_hanging(finest.hanging[id], cell.octant() as u8);
        let last = self.known.entry((cell.material, slots));
        let largest = *last.or_insert_with(|| of_leaf(with, cell.material, slots));
        self.largest = self.largest.max(largest);
    }
}

/// The largest eigenvalue of D⁻¹A of one leaf whose slots `hanging` hang.
fn of_leaf(with: &Coefficients, material: u16, hanging: u8) -> f64 {
    let material = with.materials.get(usize::from(material)).or(with.materials.first());
    let Some(material) = material else { return 0.0 };
    let K = unit_stiffness(material.lame);
    let K = Matrix24::from_fn(|r, s| K[r][s]);
    let weights = corner_weights(&Cell::new([0; 3], 0, 0), hanging);
    let W = Matrix24::from_fn(|r, s| if r % 3 == s % 3 { weights[r / 3][s / 3] } else { 0.0 });
    let A = W.transpose() * K * W;
    // L⁻¹ A L⁻ᵀ with D = L Lᵀ.
    let mut inverse = Matrix24::zeros();
    for c in 0..8 {
        let block: Matrix3<f64> = A.fixed_view::<3, 3>(3 * c, 3 * c).into_owned();
        let factor = block.cholesky().and_then(|factor| factor.l().try_inverse());
        inverse.fixed_view_mut::<3, 3>(3 * c, 3 * c).copy_from(&factor.unwrap_or_default());
    }
    (inverse * A * inverse.transpose()).symmetric_eigenvalues().max()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solver::multigrid::tests::support::coefficients;

    #[test]
    fn a_single_cube_has_the_eigenvalue_that_power_iterations_find() {
        for (poisson, expected) in [(0.0, 2.769), (0.3, 3.162), (0.45, 4.661), (0.49, 5.238)] {
            let found = of_leaf(&coefficients(poisson, 0.0), 0, 0);
            assert!((found - expected).abs() < 2e-3, "{poisson}: {found}");
        }
    }
}
