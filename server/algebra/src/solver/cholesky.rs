//! Sparse Cholesky factorisation A = L Lᵀ of the filtered matrix, by faer.
//!
//! The fill-reducing order (approximate minimum degree) and the pattern of L depend only on the
//! pattern of A and are kept until that changes; prescribed directions become rows of the identity,
//! so that holding or releasing a copy needs no new analysis. Refactorising and solving allocate
//! nothing. Sequential, so the bits are the same on any number of threads.

use faer::Par;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::LltError;
use faer::sparse::linalg::cholesky::{
    LltRef, SymbolicCholesky, SymbolicCholeskyRaw, factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Side};
use nalgebra::{Matrix3, Vector3};

use super::constraint::Filter;
use super::real::Real;
use crate::assembly::BlockCsr;

/// Symbolic and numeric factorisation of one matrix, with all memory it needs.
#[derive(Default, serde::Serialize)]
pub struct Cholesky<T> {
    /// Follows from the pattern of A.
    #[serde(skip)]
    symbolic: Option<SymbolicCholesky<u32>>,
    /// The upper triangle of A by columns: start of every column, row of every entry.
    first: Vec<u32>,
    rows: Vec<u32>,
    /// Place of every entry in the blocks of A.
    source: Vec<Source>,
    values: Vec<T>,
    factor: Vec<T>,
    right: Vec<T>,
    held: Vec<bool>,
    /// Copies that are held in inclined directions, ascending, with P and with H times the size of their block.
    inclined: Vec<(u32, Matrix3<f64>, Matrix3<f64>)>,
    #[serde(skip)]
    scratch: Option<MemBuffer>,
    factored: bool,
}

/// Entry `entry` of block `block`.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
struct Source {
    block: u32,
    entry: u8,
}

/// Why a factorisation failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Failure {
    /// The pivot of this displacement (3 · copy + axis) is not positive.
    Pivot(u32),
    /// There is not enough memory for the factors, or the matrix is too large for its indices.
    Memory,
}

/// The entries of a saved factorisation; the analysis follows from the pattern.
#[derive(serde::Deserialize)]
struct Saved<T> {
    first: Vec<u32>,
    rows: Vec<u32>,
    source: Vec<Source>,
    values: Vec<T>,
    factor: Vec<T>,
    right: Vec<T>,
    held: Vec<bool>,
    inclined: Vec<(u32, Matrix3<f64>, Matrix3<f64>)>,
    factored: bool,
}

impl<'de, T: Real + faer::traits::ComplexField + serde::Deserialize<'de>> serde::Deserialize<'de>
    for Cholesky<T>
{
    fn deserialize<D: serde::Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let Saved { first, rows, source, values, factor, right, held, inclined, factored } =
            Saved::deserialize(from)?;
        let (symbolic, scratch) = (None, None);
        let mut read =
            Self { symbolic, first, rows, source, values, factor, right, held, inclined, scratch, factored };
        if !read.first.is_empty() {
            let analysed = read.analyse_pattern();
            if analysed.is_err() || read.symbolic.as_ref().is_none_or(|s| s.len_val() != read.factor.len()) {
                return Err(serde::de::Error::custom("a factorisation that does not fit its pattern"));
            }
        }
        Ok(read)
    }
}

impl<T> std::fmt::Debug for Cholesky<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Cholesky")
            .field("rows", &self.first.len().saturating_sub(1))
            .field("factor_entries", &self.factor.len())
            .field("factored", &self.factored)
            .finish_non_exhaustive()
    }
}

impl<T: Real + faer::traits::ComplexField> Cholesky<T> {
    /// Analyses the pattern of `A`: order of elimination and pattern of L.
    pub fn analyse(&mut self, A: &BlockCsr<f64>) -> Result<(), Failure> {
        (self.symbolic, self.factored) = (None, false);
        let n = 3 * A.n_rows();
        self.first.clear();
        self.first.push(0);
        self.rows.clear();
        self.source.clear();
        for i in 0..A.n_rows() {
            for column in 0..3 {
                for block in A.row(i).take_while(|&k| A.columns[k] as usize <= i) {
                    let j = A.columns[block] as usize;
                    // A is symmetric: entry (3 j + row, 3 i + column) is (column, row) of block (i, j).
                    for row in (0..3).filter(|&row| 3 * j + row <= 3 * i + column) {
                        self.rows.push((3 * j + row) as u32);
                        self.source.push(Source { block: block as u32, entry: (3 * column + row) as u8 });
                    }
                }
                self.first.push(u32::try_from(self.rows.len()).map_err(|_| Failure::Memory)?);
            }
        }
        self.analyse_pattern()?;
        let Some(symbolic) = &self.symbolic else { return Err(Failure::Memory) };
        self.factor.clear();
        self.factor.try_reserve_exact(symbolic.len_val()).map_err(|_| Failure::Memory)?;
        self.factor.resize(symbolic.len_val(), T::default());
        self.values.resize(self.rows.len(), T::default());
        self.right.resize(n, T::default());
        self.held.resize(n, false);
        Ok(())
    }

    /// The order of elimination, the pattern of L, and all memory for them.
    fn analyse_pattern(&mut self) -> Result<(), Failure> {
        let n = self.first.len().saturating_sub(1);
        let pattern = SymbolicSparseColMatRef::new_checked(n, n, &self.first, None, &self.rows);
        let symbolic =
            factorize_symbolic_cholesky(pattern, Side::Upper, Default::default(), Default::default())
                .map_err(|_| Failure::Memory)?;
        // All memory is reserved here, so that refactorising and solving allocate nothing.
        let need = symbolic
            .factorize_numeric_llt_scratch::<T>(Par::Seq, Default::default())
            .or(symbolic.solve_in_place_scratch::<T>(1, Par::Seq));
        self.scratch = Some(MemBuffer::try_new(need).map_err(|_| Failure::Memory)?);
        self.symbolic = Some(symbolic);
        Ok(())
    }

    /// Computes L from the values of `A`, whose pattern was analysed.
    pub fn factorise(&mut self, A: &BlockCsr<f64>, filter: &Filter) -> Result<(), Failure> {
        self.factored = false;
        if self.symbolic.is_none() {
            return Err(Failure::Memory);
        }
        self.held.fill(false);
        self.inclined.clear();
        for &(copy, held) in filter.held() {
            match held.axes() {
                Some(axes) => (0..3)
                    .filter(|&axis| axes[axis])
                    .for_each(|axis| self.held[3 * copy as usize + axis] = true),
                // The held directions get the size of the block, so that no digits of the others are lost.
                None => {
                    let size = A.diagonal(copy as usize).amax();
                    if size > 0.0 {
                        self.inclined.push((copy, held.filter(), held.projection() * size));
                    } else {
                        self.held[3 * copy as usize..][..3].fill(true);
                    }
                }
            }
        }
        if filter.held().is_empty() {
            for (value, &Source { block, entry }) in self.values.iter_mut().zip(&self.source) {
                *value = T::of(A.blocks[block as usize][entry as usize]);
            }
            // A copy without mass and stiffness stays where it is. Diagonal entries are the last ones of their columns.
            for &end in &self.first[1..] {
                let diagonal = &mut self.values[end as usize - 1];
                if *diagonal == T::default() {
                    *diagonal = T::of(1.0);
                }
            }
        } else {
            self.set_filtered(A);
        }
        let (Some(symbolic), Some(scratch)) = (&self.symbolic, &mut self.scratch) else {
            return Err(Failure::Memory);
        };
        let n = self.right.len();
        let pattern = SymbolicSparseColMatRef::new_checked(n, n, &self.first, None, &self.rows);
        symbolic
            .factorize_numeric_llt(
                &mut self.factor,
                SparseColMatRef::new(pattern, &self.values),
                Side::Upper,
                Default::default(),
                Par::Seq,
                MemStack::new(scratch),
                Default::default(),
            )
            .map_err(|LltError::NonPositivePivot { index }| Failure::Pivot(displacement(symbolic, index)))?;
        self.factored = true;
        Ok(())
    }

    /// Sets the values of the upper triangle where some directions are held.
    fn set_filtered(&mut self, A: &BlockCsr<f64>) {
        for column in 0..self.right.len() {
            for k in self.first[column] as usize..self.first[column + 1] as usize {
                let Source { block, entry } = self.source[k];
                let row = self.rows[k] as usize;
                let value = match self.inclined.is_empty() {
                    true => A.blocks[block as usize][entry as usize],
                    false => {
                        filtered(&self.inclined, &A.blocks[block as usize], [column, row, entry as usize])
                    }
                };
                let idle = self.held[row] || self.held[column] || (row == column && value == 0.0);
                self.values[k] = T::of(if !idle { value } else { f64::from(u8::from(row == column)) });
            }
        }
    }

    /// z = scale · (L Lᵀ)⁻¹ (r / scale), with the solve in the precision of the factor.
    /// Prescribed directions must be 0 in `r`; without a factor z = 0.
    pub fn solve(&mut self, r: &[Vector3<f64>], z: &mut [Vector3<f64>], scale: f64) {
        let (Some(symbolic), Some(scratch), true) = (&self.symbolic, &mut self.scratch, self.factored) else {
            return z.fill(Vector3::zeros());
        };
        for (right, r) in self.right.chunks_exact_mut(3).zip(r) {
            (0..3).for_each(|k| right[k] = T::of(r[k] / scale));
        }
        let n = self.right.len();
        LltRef::new(symbolic, &self.factor).solve_in_place_with_conj(
            Conj::No,
            MatMut::from_column_major_slice_mut(&mut self.right, n, 1),
            Par::Seq,
            MemStack::new(scratch),
        );
        for (z, right) in z.iter_mut().zip(self.right.chunks_exact(3)) {
            *z = Vector3::from_fn(|k, _| right[k].wide() * scale);
        }
    }
}

/// Entry `entry` of the block between the copies of `column` and `row`, P_i A_ij P_j, and s H_i more on the diagonal.
fn filtered(
    inclined: &[(u32, Matrix3<f64>, Matrix3<f64>)],
    block: &[f64; 9],
    [column, row, entry]: [usize; 3],
) -> f64 {
    let of = |place: usize| {
        let found = inclined.binary_search_by_key(&((place / 3) as u32), |held| held.0);
        found.ok().map(|at| &inclined[at])
    };
    let (left, right) = (of(column), of(row));
    if left.is_none() && right.is_none() {
        return block[entry];
    }
    let mut B = Matrix3::from_row_slice(block);
    if let Some((_, P, _)) = left {
        B = P * B;
    }
    if let Some((_, P, _)) = right {
        B *= P;
    }
    match left {
        Some((_, _, H)) if column / 3 == row / 3 => (B + H)[(entry / 3, entry % 3)],
        _ => B[(entry / 3, entry % 3)],
    }
}

/// The displacement (3 · copy + axis) of the failed pivot `index` of faer. faer counts it from 1 if L is
/// stored by columns, and from 0 if it is stored by supernodes.
fn displacement(symbolic: &SymbolicCholesky<u32>, index: usize) -> u32 {
    let from_zero = match symbolic.raw() {
        SymbolicCholeskyRaw::Simplicial(_) => index.saturating_sub(1),
        SymbolicCholeskyRaw::Supernodal(_) => index,
    };
    let row = from_zero.min(symbolic.nrows().saturating_sub(1));
    symbolic.perm().map_or(row as u32, |order| order.arrays().0[row])
}
