//! A matrix in single precision whose rounding errors do not grow with the motion of the body as a whole.

use nalgebra::Vector3;

use super::conjugate_gradients::Rows;
use crate::assembly::BlockCsr;

/// A in single precision, applied as (A x)_i = Σ_j A_ij (x_j − x_i) + (Σ_j A_ij) x_i.
///
/// A stiffness has row sums of zero, and neighbours move almost alike: rounding then errs relative to
/// the *strain* and not to the displacement. Applied plainly, rounding of A stiffens the softest
/// modes, and the iteration has to be corrected every ten iterations or so.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Differences {
    matrix: BlockCsr<f32>,
    row_sums: Vec<[f32; 9]>,
}

impl Differences {
    /// Rounds `A`; allocates only where its pattern has changed.
    pub(super) fn update(&mut self, A: &BlockCsr<f64>) {
        A.to_f32(&mut self.matrix);
        self.row_sums.resize(A.n_rows(), [0.0; 9]);
        for (i, sum) in self.row_sums.iter_mut().enumerate() {
            let mut exact = [0.0; 9];
            for block in &A.blocks[A.row(i)] {
                (0..9).for_each(|k| exact[k] += block[k]);
            }
            *sum = exact.map(|s| s as f32);
        }
    }
}

impl Rows<f32> for Differences {
    #[inline(always)]
    fn times(&self, i: usize, x: &[Vector3<f32>]) -> Vector3<f32> {
        let own = x[i];
        let S = &self.row_sums[i];
        let mut y = [0.0; 3];
        for k in 0..3 {
            y[k] = S[3 * k] * own.x + S[3 * k + 1] * own.y + S[3 * k + 2] * own.z;
        }
        let row = self.matrix.row(i);
        for (A, &j) in self.matrix.blocks[row.clone()].iter().zip(&self.matrix.columns[row]) {
            let d = x[j as usize] - own;
            for k in 0..3 {
                y[k] += A[3 * k] * d.x + A[3 * k + 1] * d.y + A[3 * k + 2] * d.z;
            }
        }
        y.into()
    }
}
