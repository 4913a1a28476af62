//! The lowest natural frequencies: K φ = ω² M φ, by subspace iteration over a Cholesky factor.
//!
//! Each iteration solves (K + σM) X̄ = M X for a block of vectors and then the small eigenproblem of
//! K + σM and M on their span (Rayleigh–Ritz). Blocks find frequencies that coincide, as those of a
//! square beam do. σ > 0 makes the matrix of a free body definite; its six rigid modes have ω = 0.
//!
//! # Source
//! Bathe, *Finite Element Procedures*, §11.6.

use nalgebra::{DMatrix, Vector3};
use scindo_matter::element::FixedCopy;
use scindo_matter::team::Team;
use thiserror::Error;

use super::cholesky::{Cholesky, Failure};
use super::constraint::Filter;
use crate::assembly::BlockCsr;

/// Which natural frequencies are computed and how exactly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EigenSettings {
    /// Number of frequencies to compute, from the lowest up.
    pub count: usize,
    /// Stop when no ω² changes by more than this, relatively, from one iteration to the next.
    pub tolerance: f64,
    /// Largest number of iterations.
    pub iterations: u32,
    /// σ [rad²/s²] ≥ 0: 0 for a body that is held, about ω₁² for one that is free.
    pub shift: f64,
}

impl Default for EigenSettings {
    fn default() -> Self {
        Self { count: 10, tolerance: 1e-8, iterations: 100, shift: 0.0 }
    }
}

/// The lowest natural frequencies and their modes.
#[derive(Clone, Debug, Default)]
pub struct Modes {
    /// Angular frequencies ω [rad/s], ascending.
    pub omega: Vec<f64>,
    /// φ of each, with φᵀMφ = 1 [1/√kg]; one entry per node.
    pub shapes: Vec<Vec<Vector3<f64>>>,
    /// Iterations made.
    pub iterations: u32,
    /// Whether the tolerance was reached.
    pub converged: bool,
}

/// Reasons why natural frequencies cannot be computed.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum EigenError {
    /// K + σM or M is singular or indefinite.
    #[error("stiffness or mass is not positive definite: hold the body, or shift the stiffness by its mass")]
    Indefinite,
    /// The factors do not fit into memory.
    #[error("not enough memory for the factors of the stiffness")]
    Memory,
}

/// Lowest `settings.count` natural frequencies of the stiffness `K` [N/m] and mass `M` [kg], which
/// have the same pattern, with the prescribed directions held.
pub fn natural_frequencies(
    team: &mut Team,
    (K, M): (&BlockCsr<f64>, &BlockCsr<f64>),
    fixed: &[FixedCopy],
    settings: &EigenSettings,
) -> Result<Modes, EigenError> {
    let n = K.n_rows();
    let mut filter = Filter::default();
    filter.set(fixed);
    let held: usize = fixed.iter().map(|f| f.held.count()).sum();
    let free = (3 * n).saturating_sub(held);
    let count = settings.count.min(free);
    // More vectors than frequencies: the extra ones speed up convergence.
    let size = (2 * count).min(count + 8).min(free);
    let mut modes = Modes::default();
    if count == 0 {
        modes.converged = true;
        return Ok(modes);
    }
    // Factorised once; every iteration only solves with the factors.
    let mut shifted = K.clone();
    shifted.add_scaled(settings.shift, M);
    let mut factor = Cholesky::<f64>::default();
    factor.analyse(K).and_then(|()| factor.factorise(&shifted, &filter)).map_err(
        |failure| match failure {
            Failure::Pivot(_) => EigenError::Indefinite,
            Failure::Memory => EigenError::Memory,
        },
    )?;
    let mut X: Vec<_> = (0..size).map(|k| start(n, k, &filter)).collect();
    let mut Y = vec![vec![Vector3::zeros(); n]; size]; // M X, later M X̄
    let mut lambda = vec![f64::INFINITY; size];
    while modes.iterations < settings.iterations && !modes.converged {
        modes.iterations += 1;
        for (x, y) in X.iter_mut().zip(&mut Y) {
            M.multiply_by(team, x, y);
            filter.apply(y);
            factor.solve(y, x, 1.0);
            filter.apply_inclined(x);
        }
        // Y = (K + σM) X̄, so this is K + σM on the span of X̄.
        let projected = gram(&X, &Y);
        for (x, y) in X.iter().zip(&mut Y) {
            M.multiply_by(team, x, y);
            filter.apply(y);
        }
        let (values, Q) = small_problem(&projected, &gram(&X, &Y)).ok_or(EigenError::Indefinite)?;
        X = combine(&X, &Q);
        let change = |k: usize| ((values[k] - lambda[k]) / values[k]).abs();
        modes.converged = (0..count).all(|k| change(k) <= settings.tolerance);
        lambda = values;
    }
    modes.omega = lambda[..count].iter().map(|l| (l - settings.shift).max(0.0).sqrt()).collect();
    X.truncate(count);
    modes.shapes = X;
    Ok(modes)
}

/// A start vector without symmetry: digits of a linear congruential generator.
fn start(n: usize, k: usize, filter: &Filter) -> Vec<Vector3<f64>> {
    let mut seed = 0x9e37_79b9_7f4a_7c15_u64.wrapping_mul(2 * k as u64 + 1);
    let mut digit = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    };
    let mut x: Vec<_> = (0..n).map(|_| Vector3::new(digit(), digit(), digit())).collect();
    filter.apply(&mut x);
    x
}

/// Xᵀ Y, made symmetric.
fn gram(X: &[Vec<Vector3<f64>>], Y: &[Vec<Vector3<f64>>]) -> DMatrix<f64> {
    let dot = |i: usize, j: usize| X[i].iter().zip(&Y[j]).map(|(x, y)| x.dot(y)).sum::<f64>();
    let G = DMatrix::from_fn(X.len(), X.len(), dot);
    0.5 * (&G + G.transpose())
}

/// Eigenvalues, ascending, and B-orthonormal eigenvectors of A q = λ B q.
fn small_problem(A: &DMatrix<f64>, B: &DMatrix<f64>) -> Option<(Vec<f64>, DMatrix<f64>)> {
    let L = B.clone().cholesky()?.unpack();
    let left = L.solve_lower_triangular(A)?;
    let C = L.solve_lower_triangular(&left.transpose())?;
    let eigen = (0.5 * (&C + C.transpose())).symmetric_eigen();
    let mut order: Vec<usize> = (0..A.nrows()).collect();
    order.sort_by(|&i, &j| eigen.eigenvalues[i].total_cmp(&eigen.eigenvalues[j]));
    let sorted =
        DMatrix::from_columns(&order.iter().map(|&i| eigen.eigenvectors.column(i)).collect::<Vec<_>>());
    let Q = L.transpose().solve_upper_triangular(&sorted)?;
    Some((order.iter().map(|&i| eigen.eigenvalues[i]).collect(), Q))
}

/// X Q.
fn combine(X: &[Vec<Vector3<f64>>], Q: &DMatrix<f64>) -> Vec<Vec<Vector3<f64>>> {
    let n = X[0].len();
    (0..X.len())
        .map(|k| {
            let mut x = vec![Vector3::zeros(); n];
            for (column, q) in X.iter().zip(Q.column(k).iter()) {
                for (x, c) in x.iter_mut().zip(column) {
                    *x += *q * c;
                }
            }
            x
        })
        .collect()
}
