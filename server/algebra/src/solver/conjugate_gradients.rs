//! Conjugate gradients on an assembled matrix: with the constraint filter alone, or preconditioned by
//! the inverse diagonal blocks; in double precision, or in single precision with reliable updates.
//!
//! The thesis' ModifiedCG (Jeřábková 2007, Fig. 4.15) with its misprints corrected: the residual
//! starts from b − A x and not from b, the search direction from zero, and the loop stops on the
//! preconditioned residual relative to the loads instead of on |r| in whatever unit.

use nalgebra::Vector3;
use scindo_matter::team::{Team, blocks};

use super::algebraic_error::AlgebraicError;
use super::block_jacobi::{DiagonalInverse, root};
use super::constraint::Filter;
use super::real::{Real, dot};
use super::report::{LinearReport, StopReason};
use crate::assembly::BlockCsr;
use crate::operator::{BLOCK, Substitutable, Substitution};

/// The true residual is computed when the recurrence reports a fall by this factor (Clark et al. 2010).
const RELIABLE: f64 = 0.1;
/// The solver gives up when the true residual has failed to halve this many times in a row.
const FUTILE: u32 = 2;

/// A matrix that is multiplied row by row.
pub(super) trait Rows<T>: Sync {
    /// Row `i` of A x.
    fn times(&self, i: usize, x: &[Vector3<T>]) -> Vector3<T>;
}

/// A filtered matrix with its diagonal, in double precision and in that of the iteration.
#[derive(Clone, Copy, Debug)]
pub(super) struct System<'a, T, A> {
    /// A, for true residuals.
    pub exact: &'a BlockCsr<f64>,
    /// A, rounded to the precision of the iteration.
    pub working: &'a A,
    /// Prescribed directions.
    pub filter: &'a Filter,
    /// M⁻¹ of `exact`.
    pub exact_inverse: &'a DiagonalInverse<f64>,
    /// M⁻¹ of `working`.
    pub inverse: &'a DiagonalInverse<T>,
    /// T: M⁻¹ is that of TᵀA T, and residuals are kept as Tᵀr; empty for T = 1.
    pub substitution: &'a Substitution,
    /// Whether M⁻¹ preconditions the iteration; the norm in which it stops is that of M⁻¹ anyway.
    pub preconditioned: bool,
}

/// Stopping criteria of conjugate gradients.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stop {
    /// √(rᵀM⁻¹r) to reach, not relative to anything.
    pub target: f64,
    /// Largest number of iterations.
    pub iterations: u32,
}

/// Scratch vectors, one entry per copy; reused from solve to solve.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
#[serde(bound(serialize = "T: Real + serde::Serialize", deserialize = "T: Real + serde::Deserialize<'de>"))]
pub(super) struct ConjugateGradients<T> {
    r: Vec<Vector3<T>>,
    z: Vec<Vector3<T>>,
    p: Vec<Vector3<T>>,
    q: Vec<Vector3<T>>,
    residual: Vec<Vector3<f64>>,
    sums: Vec<[f64; 2]>,
}

/// rᵀz, which steers the iteration, and √(rᵀM⁻¹r), on which it stops.
#[derive(Clone, Copy, Debug)]
struct Size {
    rho: f64,
    norm: f64,
}

impl<T: Real> ConjugateGradients<T>
where
    Vector3<T>: Substitutable,
{
    fn resize(&mut self, n: usize) {
        for v in [&mut self.r, &mut self.z, &mut self.p, &mut self.q] {
            v.resize(n, Vector3::zeros());
        }
        self.residual.resize(n, Vector3::zeros());
        self.sums.resize(n.div_ceil(BLOCK), [0.0; 2]);
    }

    /// Improves `x` until the true residual is small enough; prescribed directions of `x` stay.
    ///
    /// The residual of the report is not relative: the caller divides by its reference.
    pub(super) fn solve(
        &mut self,
        team: &mut Team,
        system: &System<'_, T, impl Rows<T>>,
        b: &[Vector3<f64>],
        x: &mut [Vector3<f64>],
        stop: Stop,
    ) -> LinearReport {
        self.resize(x.len());
        self.p.fill(Vector3::zeros());
        let mut report = LinearReport::default();
        let mut error = AlgebraicError::default();
        // The iteration works on r / scale, so that units do not exhaust the range of single precision.
        let scale = self.true_residual(team, system, b, x);
        let mut checked = scale;
        report.residual = scale;
        report.stop = verdict(scale, stop.target);
        if report.stop != StopReason::IterationLimit || stop.iterations == 0 {
            return report;
        }
        let mut size = self.restart(team, system, scale);
        let (mut beta, mut futile) = (0.0, 0);
        loop {
            if team.told_to_stop() {
                report.stop = StopReason::Interrupted;
                return report;
            }
            let curvature = self.direction(team, system, beta);
            // Beyond a direction without positive curvature the iteration has no meaning.
            if !curvature.is_finite() || curvature <= 0.0 {
                report.residual = self.true_residual(team, system, b, x);
                report.algebraic_error = error.norm();
                report.stop = if curvature.is_finite() && report.residual.is_finite() {
                    StopReason::NonPositiveCurvature
                } else {
                    StopReason::NonFinite
                };
                return report;
            }
            let alpha = size.rho / curvature;
            let mut next = self.advance(team, system, x, (alpha, scale));
            // A step lowers the square of the error in the energy norm by α ρ; `scale` restores the unit.
            error.add(alpha * size.rho * scale * scale);
            report.iterations += 1;
            let norm = next.norm * scale;
            let last = report.iterations == stop.iterations;
            // In single precision the recurrence drifts, so the true residual is checked on the way.
            let doubtful = size_of::<T>() == 4 && norm <= RELIABLE * checked;
            if norm <= stop.target || doubtful || last || !norm.is_finite() {
                let known = self.true_residual(team, system, b, x);
                report.refinements += 1;
                report.residual = known;
                report.algebraic_error = error.norm();
                report.stop = verdict(known, stop.target);
                futile = if known > 0.5 * checked { futile + 1 } else { 0 };
                // A true residual that no longer falls is rounding.
                if report.stop == StopReason::IterationLimit && futile == FUTILE && !last {
                    report.stop = StopReason::Stagnated;
                }
                if report.stop != StopReason::IterationLimit || last {
                    return report;
                }
                checked = known;
                // Only the residual is replaced; the direction stays, so that convergence does not begin from scratch.
                next = self.restart(team, system, scale);
            }
            beta = next.rho / size.rho;
            size = next;
        }
    }

    /// residual = Tᵀ S (b − A x); returns √(rᵀM⁻¹r) of it.
    fn true_residual(
        &mut self,
        team: &mut Team,
        system: &System<'_, T, impl Rows<T>>,
        b: &[Vector3<f64>],
        x: &[Vector3<f64>],
    ) -> f64 {
        team.for_blocks(blocks(&mut self.residual, BLOCK), |block, r| {
            for (i, r) in r.iter_mut().enumerate() {
                let c = block * BLOCK + i;
                *r = b[c] - system.exact.times(c, x);
            }
        });
        system.filter.apply(&mut self.residual);
        system.substitution.fold(&mut self.residual);
        system.exact_inverse.norm(&self.residual)
    }

    /// r = residual / scale, z = M⁻¹ r.
    fn restart(&mut self, team: &mut Team, system: &System<'_, T, impl Rows<T>>, scale: f64) -> Size {
        let (residual, inverse) = (&self.residual, system.inverse);
        let state = (blocks(&mut self.r, BLOCK), blocks(&mut self.z, BLOCK), blocks(&mut self.sums, 1));
        team.for_blocks(state, |block, (r, z, sums)| {
            sums[0] = [0.0; 2];
            for (i, (r, z)) in r.iter_mut().zip(z).enumerate() {
                let c = block * BLOCK + i;
                *r = residual[c].map(|v| T::of(v / scale));
                *z = inverse.times(c, r);
                sums[0][0] += dot(r, z);
                sums[0][1] += dot(r, r);
            }
        });
        system.substitution.unfold(&mut self.z);
        self.size(system)
    }

    /// p ← z + β p (r in place of z without preconditioner), q = S A p; returns pᵀA p.
    fn direction(&mut self, team: &mut Team, system: &System<'_, T, impl Rows<T>>, beta: f64) -> f64 {
        let (towards, beta) = (if system.preconditioned { &self.z } else { &self.r }, T::of(beta));
        team.for_blocks(blocks(&mut self.p, BLOCK), |block, p| {
            for (i, p) in p.iter_mut().enumerate() {
                *p = towards[block * BLOCK + i] + *p * beta;
            }
        });
        let p = &self.p;
        team.for_blocks((blocks(&mut self.q, BLOCK), blocks(&mut self.sums, 1)), |block, (q, sums)| {
            sums[0] = [0.0; 2];
            for (i, q) in q.iter_mut().enumerate() {
                let c = block * BLOCK + i;
                *q = system.working.times(c, p);
                sums[0][0] += dot(&p[c], q);
            }
        });
        system.filter.apply(&mut self.q);
        system.substitution.fold(&mut self.q);
        self.sums.iter().map(|s| s[0]).sum()
    }

    /// x += scale · α p, r −= α q, z = M⁻¹ r. The solution is summed in double precision, because its
    /// rounding error times A would act as a force.
    fn advance(
        &mut self,
        team: &mut Team,
        system: &System<'_, T, impl Rows<T>>,
        x: &mut [Vector3<f64>],
        (alpha, scale): (f64, f64),
    ) -> Size {
        let (p, q, inverse) = (&self.p, &self.q, system.inverse);
        // x must gain exactly what r loses.
        let alpha = T::of(alpha);
        let step = alpha.wide() * scale;
        let state = (
            blocks(x, BLOCK),
            blocks(&mut self.r, BLOCK),
            blocks(&mut self.z, BLOCK),
            blocks(&mut self.sums, 1),
        );
        team.for_blocks(state, |block, (x, r, z, sums)| {
            sums[0] = [0.0; 2];
            for (i, ((x, r), z)) in x.iter_mut().zip(r).zip(z).enumerate() {
                let c = block * BLOCK + i;
                *x += p[c].map(T::wide) * step;
                *r -= q[c] * alpha;
                *z = inverse.times(c, r);
                sums[0][0] += dot(r, z);
                sums[0][1] += dot(r, r);
            }
        });
        system.substitution.unfold(&mut self.z);
        self.size(system)
    }

    fn size(&self, system: &System<'_, T, impl Rows<T>>) -> Size {
        let sum = |k: usize| self.sums.iter().map(|s| s[k]).sum::<f64>();
        let squared = sum(0);
        let rho = if system.preconditioned { squared } else { sum(1) };
        Size { rho, norm: root(squared) }
    }
}

/// Whether a residual norm ends the iteration; `IterationLimit` if it does not.
fn verdict(norm: f64, target: f64) -> StopReason {
    if !norm.is_finite() {
        StopReason::NonFinite
    } else if norm <= target {
        StopReason::Converged
    } else {
        StopReason::IterationLimit
    }
}

impl Rows<f64> for BlockCsr<f64> {
    #[inline(always)]
    fn times(&self, i: usize, x: &[Vector3<f64>]) -> Vector3<f64> {
        self.row_times(i, x)
    }
}
