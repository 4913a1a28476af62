//! Iteration with a preconditioner alone: x ← x + M⁻¹ (b − A x).

use scindo_matter::team::Team;

use super::pcg::{Pcg, PcgSettings};
use super::report::{LinearReport, StopReason};
use crate::operator::{BLOCK, Iterate, LinearOperator, Padded, Preconditioner};

impl Pcg {
    /// Improves `x` by x ← x + z, z = M⁻¹ r, until √(rᵀM⁻¹r) ≤ tolerance · `reference`; after
    /// [`precondition`](Self::precondition) has just returned `rz`. With a cycle of multigrid as M⁻¹ these are its
    /// iterations. They end as stagnated if the residual grows: M⁻¹ is then too large for A.
    pub fn cycles(
        &mut self,
        team: &mut Team,
        A: &mut impl LinearOperator,
        M: &mut impl Preconditioner,
        x: &mut [Padded],
        (mut rz, reference, settings): (f64, f64, PcgSettings),
    ) -> LinearReport {
        let mut report = LinearReport::default();
        let mut before = f64::INFINITY;
        loop {
            let norm = rz.abs().sqrt();
            report.residual = if reference > 0.0 { norm / reference } else { norm };
            // The error is A⁻¹ r, and M⁻¹ is near A⁻¹.
            report.algebraic_error = norm;
            report.stop = if !rz.is_finite() {
                StopReason::NonFinite
            } else if norm <= settings.tolerance * reference {
                StopReason::Converged
            } else if rz.abs() >= before {
                StopReason::Stagnated
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
            before = rz.abs();
            let Self { r, z, p, q, partial, .. } = self;
            debug_assert_eq!(partial.len(), r.len().div_ceil(BLOCK));
            p.copy_from_slice(z);
            A.apply(team, p, q);
            M.enter(q);
            rz = M.advance(team, A, (1.0, [p, q]), Iterate { x, r, z, partial });
            report.iterations += 1;
        }
    }
}
