//! A x = b for an assembled matrix, by the method and in the precision that the user chose.

use std::sync::Arc;

use nalgebra::Vector3;
use scindo_matter::element::FixedCopy;
use scindo_matter::team::{Team, blocks};

use super::block_jacobi::DiagonalInverse;
use super::cholesky::{Cholesky, Failure};
use super::conjugate_gradients::{ConjugateGradients, Rows, Stop, System};
use super::constraint::Filter;
use super::differences::Differences;
use super::real::Real;
use super::report::{LinearReport, StopReason};
use super::substituted::Substituted;
use crate::assembly::BlockCsr;
use crate::operator::{BLOCK, StiffModes};

/// How A x = b is solved.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Method {
    /// Conjugate gradients with only the constraint filter: the thesis' modified CG.
    Cg,
    /// Conjugate gradients preconditioned by the inverse 3×3 diagonal blocks.
    #[default]
    Pcg,
    /// Cycles of multigrid alone: x ← x + V (b − A x). Bodies without levels, and assembled matrices, are solved
    /// by [`Pcg`](Self::Pcg) instead, and steps with springs under load by [`MgPcg`](Self::MgPcg), because coarse
    /// levels have stiff springs only.
    Multigrid,
    /// Conjugate gradients preconditioned by one cycle of multigrid; the same holds.
    MgPcg,
    /// Conjugate gradients preconditioned by block-Jacobi and a [coarse space](crate::solver::two_level). Steps of several
    /// bodies that touch each other, and assembled matrices, are solved by [`Pcg`](Self::Pcg) instead.
    TwoLevelPcg,
    /// Sparse Cholesky factorisation; the analysis is kept while the pattern stays.
    Cholesky,
}

/// The precision of the work inside a linear solve.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Precision {
    /// Residuals and solution in double, everything else in single precision: as accurate as `Double`
    /// at half the memory traffic.
    #[default]
    Mixed,
    /// Everything in double precision.
    Double,
}

/// Method, precision and stopping criteria of a linear solve.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct LinearSettings {
    /// Method of the solve; may be changed between solves.
    pub method: Method,
    /// Precision of the work inside the solve.
    pub precision: Precision,
    /// Largest number of iterations; for a factorisation, of solves with the factors.
    pub iterations: u32,
    /// Stop at √(rᵀM⁻¹r) ≤ tolerance · reference, with M the 3×3 diagonal blocks of A.
    pub tolerance: f64,
}

impl Method {
    /// Whether it asks for multigrid.
    pub fn is_multigrid(self) -> bool {
        matches!(self, Self::Multigrid | Self::MgPcg)
    }
}

impl Default for LinearSettings {
    fn default() -> Self {
        Self { method: Method::Pcg, precision: Precision::Mixed, iterations: 5_000, tolerance: 1e-8 }
    }
}

/// Corrections of a direct solve before it counts as stagnated.
const MOST_CORRECTIONS: u32 = 20;

/// Solves linear systems again and again; nothing is allocated unless the pattern changes.
#[derive(Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct LinearSolver {
    /// Settings; may be changed between solves.
    pub settings: LinearSettings,
    filter: Filter,
    inverse: DiagonalInverse<f64>,
    substituted: Substituted,
    single: Single,
    double: ConjugateGradients<f64>,
    factors: Factors<f64>,
    single_factors: Factors<f32>,
    r: Vec<Vector3<f64>>,
    z: Vec<Vector3<f64>>,
}

/// Data of single-precision iterations.
#[derive(Debug, Default, serde::Serialize, serde::Deserialize)]
struct Single {
    matrix: Differences,
    inverse: DiagonalInverse<f32>,
    current: bool,
    gradients: ConjugateGradients<f32>,
}

/// A factorisation, and the pattern and matrix it belongs to.
#[derive(Debug, Default, serde::Serialize, serde::Deserialize)]
#[serde(bound(deserialize = "T: Real + faer::traits::ComplexField + serde::Deserialize<'de>"))]
struct Factors<T> {
    cholesky: Cholesky<T>,
    first: Vec<u32>,
    columns: Vec<u32>,
    /// Result for the present matrix, once it was factorised.
    current: Option<Result<(), Failure>>,
}

impl LinearSolver {
    /// A solver with these settings.
    pub fn new(settings: LinearSettings) -> Self {
        Self { settings, ..Self::default() }
    }

    /// Sets the stiff motions of degenerate elements, so that they cost no extra iterations: the
    /// preconditioner works in other variables, in double precision. They do not help [`Method::Cg`],
    /// which has no preconditioner.
    pub fn set_stiff_modes(&mut self, modes: Option<Arc<StiffModes>>) {
        self.substituted = Substituted::new(modes);
    }

    /// For the last matrix: pieces of degenerate elements, copies moved relative to others for them, and
    /// pieces that keep a stiff motion.
    pub fn stiff_motions(&self) -> [usize; 3] {
        self.substituted.counts()
    }

    /// Sets a new matrix and the prescribed directions.
    ///
    /// Must be called whenever either has changed, before [`solve`](Self::solve) and
    /// [`norm`](Self::norm); a matrix that stays is factorised only once.
    pub fn set_matrix(&mut self, A: &BlockCsr<f64>, fixed: &[FixedCopy]) {
        self.filter.set(fixed);
        self.inverse.update(A, &self.filter);
        self.substituted.update(A, &self.filter, self.settings.method != Method::Cg, &mut self.inverse);
        self.single.current = false;
        self.factors.current = None;
        self.single_factors.current = None;
    }

    /// √(vᵀM⁻¹v), in which residuals are measured; prescribed directions do not count.
    pub fn norm(&self, v: &[Vector3<f64>]) -> f64 {
        self.substituted.norm(&self.inverse, v)
    }

    /// z = M⁻¹ r, the block-Jacobi step.
    pub fn precondition(&self, r: &[Vector3<f64>], z: &mut [Vector3<f64>]) {
        self.substituted.apply(&self.inverse, r, z);
        self.tidy(z);
    }

    /// Sets the prescribed directions of `v` to 0.
    pub fn filter(&self, v: &mut [Vector3<f64>]) {
        self.filter.apply(v);
    }

    /// Improves `x` until the residual of A x = b is below tolerance · `reference` (√(bᵀM⁻¹b) where
    /// that is `None`), with the matrix of the last [`set_matrix`](Self::set_matrix).
    ///
    /// Prescribed directions of `x` stay as they are. Whatever happens, `x` is the best iterate found
    /// and the report tells how good it is. After [`StopReason::NonFinite`] `x` is useless.
    pub fn solve(
        &mut self,
        team: &mut Team,
        A: &BlockCsr<f64>,
        b: &[Vector3<f64>],
        x: &mut [Vector3<f64>],
        reference: Option<f64>,
    ) -> LinearReport {
        let reference = reference.unwrap_or_else(|| self.norm(b));
        let stop = Stop { target: self.settings.tolerance * reference, iterations: self.settings.iterations };
        let mut report = match self.settings.method {
            Method::Cholesky => self.direct(team, A, b, x, stop),
            method => self.iterate(team, A, b, x, (stop, method != Method::Cg)),
        };
        if reference > 0.0 {
            report.residual /= reference;
        }
        report
    }

    /// Takes rounding in prescribed inclined directions from an increment that [`solve`](Self::solve) found.
    pub fn tidy(&self, v: &mut [Vector3<f64>]) {
        self.filter.apply_inclined(v);
    }

    fn iterate(
        &mut self,
        team: &mut Team,
        A: &BlockCsr<f64>,
        b: &[Vector3<f64>],
        x: &mut [Vector3<f64>],
        (stop, preconditioned): (Stop, bool),
    ) -> LinearReport {
        let Self { filter, inverse, substituted, single, double, .. } = self;
        let (filter, exact_inverse) = (&*filter, &*inverse);
        let substitution = substituted.substitution();
        // Rounding a matrix with entries 1/ε times as large as the others would spoil the small ones.
        if self.settings.precision == Precision::Double || !substitution.is_empty() {
            let system = System {
                exact: A,
                working: A,
                filter,
                exact_inverse,
                inverse: exact_inverse,
                substitution,
                preconditioned,
            };
            return double.solve(team, &system, b, x, stop);
        }
        if !single.current {
            single.matrix.update(A);
            single.inverse.update(A, filter);
            single.current = true;
        }
        let system = System {
            exact: A,
            working: &single.matrix,
            filter,
            exact_inverse,
            inverse: &single.inverse,
            substitution,
            preconditioned,
        };
        single.gradients.solve(team, &system, b, x, stop)
    }

    fn direct(
        &mut self,
        team: &mut Team,
        A: &BlockCsr<f64>,
        b: &[Vector3<f64>],
        x: &mut [Vector3<f64>],
        stop: Stop,
    ) -> LinearReport {
        self.r.resize(x.len(), Vector3::zeros());
        self.z.resize(x.len(), Vector3::zeros());
        let mut report = LinearReport::default();
        // A single-precision factor that is not good enough is followed by one in double precision.
        if self.settings.precision == Precision::Mixed && self.single_factors.prepare(A, &self.filter).is_ok()
        {
            let Self { single_factors, filter, inverse, substituted, r, z, .. } = self;
            let work = Correction { A, b, filter, inverse: (inverse, substituted), r, z };
            work.run(team, x, &mut single_factors.cholesky, stop, &mut report);
            if report.stop != StopReason::Stagnated {
                return report;
            }
        }
        match self.factors.prepare(A, &self.filter) {
            Ok(()) => {
                let Self { factors, filter, inverse, substituted, r, z, .. } = self;
                let work = Correction { A, b, filter, inverse: (inverse, substituted), r, z };
                work.run(team, x, &mut factors.cholesky, stop, &mut report);
                report
            }
            Err(Failure::Pivot(pivot)) => {
                let Self { filter, inverse, substituted, r, z, .. } = self;
                let inverse = (&*inverse, &*substituted);
                let residual = Correction { A, b, filter, inverse, r, z }.residual(team, x);
                let stop = StopReason::NonPositiveCurvature;
                LinearReport { residual, stop, pivot: Some(pivot), ..report }
            }
            // No memory for the factors: conjugate gradients need none.
            Err(Failure::Memory) => self.iterate(team, A, b, x, (stop, true)),
        }
    }
}

impl<T: Real + faer::traits::ComplexField> Factors<T> {
    fn prepare(&mut self, A: &BlockCsr<f64>, filter: &Filter) -> Result<(), Failure> {
        if let Some(known) = self.current {
            return known;
        }
        let mut result = Ok(());
        if self.first != A.first || self.columns != A.columns {
            self.first.clear();
            result = self.cholesky.analyse(A);
            if result.is_ok() {
                self.first.clone_from(&A.first);
                self.columns.clone_from(&A.columns);
            }
        }
        let result = result.and_then(|()| self.cholesky.factorise(A, filter));
        self.current = Some(result);
        result
    }
}

/// Iterative refinement: x ← x + (L Lᵀ)⁻¹ (b − A x).
struct Correction<'a> {
    A: &'a BlockCsr<f64>,
    b: &'a [Vector3<f64>],
    filter: &'a Filter,
    inverse: (&'a DiagonalInverse<f64>, &'a Substituted),
    r: &'a mut [Vector3<f64>],
    z: &'a mut [Vector3<f64>],
}

impl Correction<'_> {
    fn run<T: Real + faer::traits::ComplexField>(
        mut self,
        team: &mut Team,
        x: &mut [Vector3<f64>],
        cholesky: &mut Cholesky<T>,
        stop: Stop,
        report: &mut LinearReport,
    ) {
        report.residual = self.residual(team, x);
        let mut corrections = 0;
        loop {
            report.stop = if !report.residual.is_finite() {
                StopReason::NonFinite
            } else if report.residual <= stop.target {
                StopReason::Converged
            } else if report.iterations >= stop.iterations {
                StopReason::IterationLimit
            } else if corrections == MOST_CORRECTIONS {
                StopReason::Stagnated
            } else {
                let before = report.residual;
                cholesky.solve(self.r, self.z, before);
                self.filter.apply_inclined(self.z);
                let energy: f64 = self.r.iter().zip(&*self.z).map(|(r, z)| r.dot(z)).sum();
                add(x, self.z, 1.0);
                report.residual = self.residual(team, x);
                report.iterations += 1;
                report.refinements += 1;
                corrections += 1;
                // The correction was the error before it; the remaining error shrank as the residual did.
                report.algebraic_error = energy.max(0.0).sqrt() * (report.residual / before).min(1.0);
                // A correction that hardly helps is the last one; a harmful one is taken back.
                if report.residual > stop.target && report.residual > 0.5 * before {
                    if report.residual >= before {
                        add(x, self.z, -1.0);
                        report.residual = self.residual(team, x);
                    }
                    corrections = MOST_CORRECTIONS;
                }
                continue;
            };
            return;
        }
    }

    /// r = S (b − A x); returns √(rᵀM⁻¹r).
    fn residual(&mut self, team: &mut Team, x: &[Vector3<f64>]) -> f64 {
        let (A, b) = (self.A, self.b);
        team.for_blocks(blocks(self.r, BLOCK), |block, r| {
            for (i, r) in r.iter_mut().enumerate() {
                let c = block * BLOCK + i;
                *r = b[c] - A.times(c, x);
            }
        });
        self.filter.apply(self.r);
        let (inverse, substituted) = self.inverse;
        substituted.norm(inverse, self.r)
    }
}

fn add(x: &mut [Vector3<f64>], z: &[Vector3<f64>], factor: f64) {
    for (x, z) in x.iter_mut().zip(z) {
        *x += factor * z;
    }
}
