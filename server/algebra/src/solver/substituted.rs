//! The block-Jacobi preconditioner of an assembled matrix on degenerate elements: in variables in
//! which they are not stiff.

use std::sync::Arc;

use nalgebra::{Matrix3, Vector3};
use scindo_matter::element::Held;

use super::block_jacobi::{DiagonalInverse, root};
use super::constraint::Filter;
use crate::assembly::BlockCsr;
use crate::operator::{StiffModes, Substitution};

/// A substitution T, found anew whenever other copies are held.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Substituted {
    modes: Option<Arc<StiffModes>>,
    T: Substitution,
    /// Degenerate pieces that keep a stiff motion.
    left: usize,
    /// Prescribed directions for which T was found.
    made_for: Option<Vec<(u32, Held)>>,
}

impl Substituted {
    /// The substitution for `modes`; the first update finds it.
    pub(super) fn new(modes: Option<Arc<StiffModes>>) -> Self {
        Self { modes, ..Self::default() }
    }

    /// T; empty if nothing is substituted.
    pub(super) fn substitution(&self) -> &Substitution {
        &self.T
    }

    /// Numbers of degenerate pieces, of copies moved relative to others, and of degenerate pieces that
    /// keep a stiff motion.
    pub(super) fn counts(&self) -> [usize; 3] {
        [self.modes.as_ref().map_or(0, |modes| modes.n_degenerate()), self.T.len(), self.left]
    }

    /// Puts the inverse diagonal blocks of TᵀA T in place of those of A, if `wanted`.
    pub(super) fn update(
        &mut self,
        A: &BlockCsr<f64>,
        filter: &Filter,
        wanted: bool,
        inverse: &mut DiagonalInverse<f64>,
    ) {
        let Some(modes) = &self.modes else { return };
        if !wanted || modes.n_copies() != A.n_rows() {
            (self.T, self.left, self.made_for) = (Substitution::default(), 0, None);
            return;
        }
        let held = filter.held();
        if self.made_for.as_deref() != Some(held) {
            let is_held = |copy: u32| held.iter().any(|h| h.0 == copy);
            (self.T, self.left) = modes.substitution(is_held);
            self.made_for = Some(held.to_vec());
        }
        for (copy, column) in self.T.columns() {
            let mut block = Matrix3::zeros();
            for &(a, wa) in column {
                for &(b, wb) in column {
                    if let Some(at) = A.position(a as usize, b) {
                        block += wa * wb * Matrix3::from_row_slice(&A.blocks[at]);
                    }
                }
            }
            let held = held.iter().find(|h| h.0 == copy).map_or(Held::NOT, |h| h.1);
            inverse.set(copy as usize, block, held);
        }
    }

    /// √(rᵀT M⁻¹Tᵀr).
    pub(super) fn norm(&self, M: &DiagonalInverse<f64>, r: &[Vector3<f64>]) -> f64 {
        if self.T.is_empty() {
            return M.norm(r);
        }
        let mut columns = self.T.columns().peekable();
        let squared = (0..r.len()).map(|i| {
            let column = columns.next_if(|(copy, _)| *copy as usize == i);
            let t = column.map_or(r[i], |(_, column)| folded(column, r));
            t.dot(&M.times(i, &t))
        });
        root(squared.sum())
    }

    /// z = T M⁻¹ Tᵀ r.
    pub(super) fn apply(&self, M: &DiagonalInverse<f64>, r: &[Vector3<f64>], z: &mut [Vector3<f64>]) {
        M.apply(r, z);
        for (copy, column) in self.T.columns() {
            z[copy as usize] = M.times(copy as usize, &folded(column, r));
        }
        self.T.unfold(z);
    }
}

/// (Tᵀr) of the copy with this column of T.
fn folded(column: &[(u32, f64)], r: &[Vector3<f64>]) -> Vector3<f64> {
    column.iter().map(|&(a, w)| w * r[a as usize]).sum()
}
