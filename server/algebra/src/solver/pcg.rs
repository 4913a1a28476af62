//! Conjugate gradients with any preconditioner.
//!
//! Vectors are single precision, scalar products double. The loop stops on the *preconditioned*
//! residual √(rᵀM⁻¹r): the plain norm is blind to slivers, whose forces are 1e-9 of the others.

use scindo_matter::storage::reserve::resize_reserving;
use scindo_matter::team::{Team, blocks};

use super::algebraic_error::AlgebraicError;
use super::report::{LinearReport, StopReason};
use crate::operator::{Advance, BLOCK, Iterate, LinearOperator, Padded, Preconditioner, block_of, rows};

/// Stopping criteria of a solve.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct PcgSettings {
    /// Largest number of iterations, each one application of A.
    pub iterations: u32,
    /// Stop at √(rᵀM⁻¹r) ≤ tolerance · reference. 0 asks for all iterations; a preconditioner that costs products is
    /// then not applied after the last one, and the reported residual is that before it.
    pub tolerance: f64,
}

/// Scratch vectors of the solver, one entry per copy; reused from solve to solve.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct Pcg {
    /// On input the residual b − A x of the start. On output that of the result, by recurrence, in the
    /// variables of the preconditioner.
    pub r: Vec<Padded>,
    /// M⁻¹ r.
    pub z: Vec<Padded>,
    /// The direction of the search.
    pub p: Vec<Padded>,
    /// A p.
    pub q: Vec<Padded>,
    pub(super) partial: Vec<f64>,
    /// rᵀM⁻¹r and β where the last run ended.
    rz: f64,
    beta: f64,
    /// Whether M⁻¹ has not been applied since x changed last; `rz` is that before then.
    owed: bool,
}

impl Pcg {
    /// Makes room for `n` copies.
    pub fn resize(&mut self, n: usize) {
        for v in [&mut self.r, &mut self.z, &mut self.p, &mut self.q] {
            resize_reserving(v, n, [0.0; 4]);
        }
        self.partial.resize(n.div_ceil(BLOCK), 0.0);
    }

    /// Improves `x`, whose residual is in `self.r`, until √(rᵀM⁻¹r) ≤ tolerance · `reference`.
    ///
    /// Prescribed directions must be 0 in `self.r`, in every column of A and in M⁻¹.
    ///
    /// # Source
    /// Hestenes, Stiefel 1952; stop on negative curvature: Steihaug 1983.
    pub fn solve(
        &mut self,
        team: &mut Team,
        A: &mut impl LinearOperator,
        M: &mut impl Preconditioner,
        x: &mut [Padded],
        (reference, settings): (f64, PcgSettings),
    ) -> LinearReport {
        let start = self.precondition(team, A, M);
        self.run(team, A, M, x, (start, reference, settings))
    }

    /// The same after [`Self::precondition`] has just returned `rz`.
    pub fn run(
        &mut self,
        team: &mut Team,
        A: &mut impl LinearOperator,
        M: &mut impl Preconditioner,
        x: &mut [Padded],
        (rz, reference, settings): (f64, f64, PcgSettings),
    ) -> LinearReport {
        (self.rz, self.beta, self.owed) = (rz, 0.0, false);
        self.go_on(team, A, M, x, (reference, settings))
    }

    /// Continues where the last run ended, as if both were one. A and M must be the same, and A must not
    /// have been applied meanwhile. The result is added to `x`.
    pub fn go_on(
        &mut self,
        team: &mut Team,
        A: &mut impl LinearOperator,
        M: &mut impl Preconditioner,
        x: &mut [Padded],
        (reference, settings): (f64, PcgSettings),
    ) -> LinearReport {
        // The last run spared itself M⁻¹ at its end; whoever goes on needs it.
        if std::mem::take(&mut self.owed) {
            let next = M.apply(team, A, &self.r, &mut self.z, &mut self.partial);
            (self.rz, self.beta) = (next, next / self.rz);
        }
        let (mut rz, mut beta) = (self.rz, self.beta);
        let target = settings.tolerance * reference;
        let mut report = LinearReport::default();
        let mut error = AlgebraicError::default();
        loop {
            // rᵀM⁻¹r is not negative: M⁻¹ is positive semidefinite.
            let norm = rz.max(0.0).sqrt();
            report.residual = if reference > 0.0 { norm / reference } else { norm };
            report.stop = if !rz.is_finite() {
                StopReason::NonFinite
            } else if norm <= target {
                StopReason::Converged
            } else {
                StopReason::IterationLimit
            };
            if report.stop != StopReason::IterationLimit || report.iterations == settings.iterations {
                return report;
            }
            if team.told_to_stop() {
                report.stop = StopReason::Interrupted;
                return report;
            }
            let curvature = self.turn(team, A, M, beta);
            M.enter(&mut self.q);
            if !curvature.is_finite() {
                report.stop = StopReason::NonFinite;
                return report;
            }
            // Along p there is no minimum: `x` stays where the step before led.
            if curvature <= 0.0 {
                report.stop = StopReason::NonPositiveCurvature;
                return report;
            }
            let alpha = rz / curvature;
            error.add(alpha * rz);
            report.algebraic_error = error.norm();
            report.iterations += 1;
            // With a fixed number of iterations nobody asks for the last residual, so the products in M⁻¹ are put off.
            if settings.tolerance == 0.0 && report.iterations == settings.iterations && M.uses_operator() {
                let Self { r, z, p, q, partial, .. } = self;
                Iterate { x, r, z, partial }.along(team, alpha as f32, [p, q]);
                self.owed = true;
                return report;
            }
            let next = self.descend(team, A, M, alpha, x);
            beta = next / rz;
            rz = next;
            // Kept for a later continuation.
            (self.rz, self.beta) = (rz, beta);
        }
    }

    /// p ← z + β p, q = A p; returns pᵀA p. In q it is still in the variables of A.
    pub fn turn(
        &mut self,
        team: &mut Team,
        A: &mut impl LinearOperator,
        M: &mut impl Preconditioner,
        beta: f64,
    ) -> f64 {
        let mut beta = beta as f32;
        if M.uses_operator() && beta != 0.0 {
            // Products inside M made A forget p, so the new one is handed over as a whole.
            let (p, factor) = (&self.p, beta);
            team.for_blocks(blocks(&mut self.z, BLOCK), |block, z| {
                for (z, p) in z.iter_mut().zip(block_of(p, block)) {
                    let mut next = *p;
                    rows::direction(&mut next, z, factor);
                    *z = next;
                }
            });
            beta = 0.0;
        }
        let out = Advance { p: &mut self.p, q: &mut self.q, partial: &mut self.partial };
        A.advance(team, beta, &self.z, out)
    }

    /// x ← x + α p, r ← r − α q, z = M⁻¹ r; returns rᵀz.
    pub fn descend(
        &mut self,
        team: &mut Team,
        A: &mut impl LinearOperator,
        M: &mut impl Preconditioner,
        alpha: f64,
        x: &mut [Padded],
    ) -> f64 {
        let Self { r, z, p, q, partial, .. } = self;
        M.advance(team, A, (alpha as f32, [p, q]), Iterate { x, r, z, partial })
    }

    /// √(vᵀM⁻¹v), the norm in which `reference` is given.
    pub fn norm(
        &mut self,
        team: &mut Team,
        A: &mut impl LinearOperator,
        M: &mut impl Preconditioner,
        v: &[Padded],
    ) -> f64 {
        M.norm(team, A, v, &mut self.z, &mut self.partial)
    }

    /// z = M⁻¹ r of the residual just put into `self.r`; returns rᵀz.
    pub fn precondition(
        &mut self,
        team: &mut Team,
        A: &mut impl LinearOperator,
        M: &mut impl Preconditioner,
    ) -> f64 {
        M.enter(&mut self.r);
        M.apply(team, A, &self.r, &mut self.z, &mut self.partial)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::operator::BlockJacobi;

    /// The path graph's Laplacian plus a shift, on all three components.
    struct Chain {
        shift: f32,
    }

    impl LinearOperator for Chain {
        fn apply(&mut self, _: &mut Team, x: &[Padded], y: &mut [Padded]) {
            for i in 0..x.len() {
                for k in 0..3 {
                    let left = if i > 0 { x[i - 1][k] } else { 0.0 };
                    let right = if i + 1 < x.len() { x[i + 1][k] } else { 0.0 };
                    y[i][k] = (2.0 + self.shift) * x[i][k] - left - right;
                }
            }
        }
    }

    fn solve(shift: f32, iterations: u32, n: usize) -> (LinearReport, Vec<Padded>) {
        let mut team = Team::new(1).unwrap();
        let mut M = BlockJacobi::default();
        M.resize(n);
        let d = 2.0 + shift;
        M.update(&mut team, &vec![[d.abs(), 0.0, 0.0, 0.0, d.abs(), 0.0, d.abs(), 0.0]; n], &[]);
        let mut pcg = Pcg::default();
        pcg.resize(n);
        pcg.r.fill([1.0, -2.0, 0.5, 0.0]);
        let b = pcg.r.clone();
        let reference = pcg.norm(&mut team, &mut Chain { shift }, &mut M, &b);
        let mut x = vec![[0.0; 4]; n];
        let settings = PcgSettings { iterations, tolerance: 1e-5 };
        let report = pcg.solve(&mut team, &mut Chain { shift }, &mut M, &mut x, (reference, settings));
        (report, x)
    }

    #[test]
    fn solves_a_chain() {
        let (report, x) = solve(0.1, 1000, 300);
        assert_eq!(report.stop, StopReason::Converged);
        assert!(report.residual <= 1e-5 && report.iterations < 120);
        for (i, x) in x.iter().enumerate().skip(120).take(60) {
            assert!((x[0] - 10.0).abs() < 1e-3 && (x[1] + 20.0).abs() < 2e-3, "{i}: {x:?}");
        }
    }

    #[test]
    fn says_when_iterations_run_out_or_the_operator_is_indefinite() {
        let (report, _) = solve(0.001, 3, 300);
        assert_eq!((report.stop, report.iterations), (StopReason::IterationLimit, 3));
        assert!(report.residual > 1e-5);
        let (report, x) = solve(-1.0, 1000, 300);
        assert_eq!(report.stop, StopReason::NonPositiveCurvature);
        assert!(x.iter().flatten().all(|v| v.is_finite()));
    }

    /// A preconditioner that costs products, by its own account.
    struct Dear {
        jacobi: BlockJacobi,
        applied: usize,
    }

    impl Preconditioner for Dear {
        fn uses_operator(&self) -> bool {
            true
        }

        fn apply(
            &mut self,
            team: &mut Team,
            A: &mut dyn LinearOperator,
            r: &[Padded],
            z: &mut [Padded],
            partial: &mut [f64],
        ) -> f64 {
            self.applied += 1;
            self.jacobi.apply(team, A, r, z, partial)
        }
    }

    /// A fixed number of iterations ends without another application, which the next run makes up for.
    #[test]
    fn a_dear_preconditioner_is_applied_once_per_iteration() {
        let n = 300;
        let run = |parts: &[u32]| {
            let (mut team, mut A) = (Team::new(1).unwrap(), Chain { shift: 0.01 });
            let mut jacobi = BlockJacobi::default();
            jacobi.resize(n);
            jacobi.update(&mut team, &vec![[2.0, 0.0, 0.0, 0.0, 2.0, 0.0, 2.0, 0.0]; n], &[]);
            let mut M = Dear { jacobi, applied: 0 };
            let (mut pcg, mut x) = (Pcg::default(), vec![[0.0; 4]; n]);
            pcg.resize(n);
            (0..n).for_each(|i| pcg.r[i] = [1.0, (i as f32).sin(), 0.5, 0.0]);
            let mut start = Some(pcg.precondition(&mut team, &mut A, &mut M));
            let mut residuals = Vec::new();
            for &iterations in parts {
                let settings = PcgSettings { iterations, tolerance: 0.0 };
                let report = match start.take() {
                    Some(rz) => pcg.run(&mut team, &mut A, &mut M, &mut x, (rz, 1.0, settings)),
                    None => pcg.go_on(&mut team, &mut A, &mut M, &mut x, (1.0, settings)),
                };
                assert_eq!((report.stop, report.iterations), (StopReason::IterationLimit, iterations));
                residuals.push(report.residual);
            }
            (M.applied, x, residuals)
        };
        let (applied, x, whole) = run(&[10]);
        let (in_parts, same, parts) = run(&[1, 4, 5]);
        assert_eq!((applied, in_parts), (10, 10));
        assert_eq!(x, same);
        assert_eq!(whole[0], parts[2]);
    }
}
