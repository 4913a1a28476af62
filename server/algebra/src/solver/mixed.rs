//! Full Newton steps with extrapolated stress: few of them bring a slender body into equilibrium.
//!
//! A Newton step turns material along straight lines, which stretches it. The stress of this spurious
//! stretch is what makes Newton's method creep. If stresses at the integration points are unknowns of
//! their own, then they move along straight lines too and stay small. Eliminated at every point, they
//! leave Newton's method with one change: the tangent takes the stress extrapolated from the step before.
//! Φ and the residual rise at first and then fall fast, so no line search is made. Where they do not fall,
//! Newton's method with its line search takes over.
//!
//! # Source
//! Magisano, Leonetti, Garcea 2017, "How to improve efficiency and robustness of the Newton method in
//! geometrically non-linear structural problem discretized via displacement-based finite elements".

use nalgebra::Vector3;
use scindo_matter::element::FixedCopy;
use scindo_matter::team::Team;
use scindo_matter::team::phase::Phase;

use super::newton::{Curvature, Newton, NewtonReport, Potential, ROUNDING};

/// Largest number of steps. Five are usual.
const MOST_STEPS: u32 = 10;
/// Steps after which every further one must lower the residual.
const FREE_STEPS: u32 = 2;
/// Where the residual is c times the reference, a linear solve stops at this part of min(c, 1/c). A larger
/// residual is that of the spurious stretch, behind which the rest must not hide. Towards a smaller one the
/// convergence is quadratic.
const FORCING: f64 = 4e-3;

impl Newton {
    /// Moves `x` from where `report` gives Φ, and `g` its gradient, by full steps, if the potential knows
    /// how. Never ends at a higher Φ. Returns whether the tolerance is reached.
    pub(super) fn mixed_steps(
        &mut self,
        team: &mut Team,
        potential: &mut dyn Potential,
        (x, fixed): (&mut [Vector3<f64>], &[FixedCopy]),
        (report, first): (&mut NewtonReport, &mut Option<f64>),
    ) -> bool {
        let mut start = report.potential;
        let wanted = self.settings.curvature == Curvature::Exact && self.settings.steps > MOST_STEPS;
        if !wanted || !start.is_finite() || !potential.extrapolated_hessian(team, x, x, &mut self.hessian) {
            return false;
        }
        self.trial.copy_from_slice(x);
        self.trial_g.copy_from_slice(&self.g);
        let (mut before, mut converged) = (f64::INFINITY, false);
        while report.potential.is_finite() && !team.told_to_stop() {
            team.begin(Phase::Operator);
            self.solver.set_matrix(&self.hessian, fixed);
            converged = self.measure(potential, report, first);
            let risen = report.steps > FREE_STEPS && report.residual >= before;
            if converged || risen || report.steps == MOST_STEPS {
                break;
            }
            let most = FORCING * report.residual.min(1.0 / report.residual);
            team.begin(Phase::Solve);
            if !self.direction(team, (Curvature::Exact, most), report) {
                break;
            }
            before = report.residual;
            self.from.copy_from_slice(x);
            team.begin(Phase::Residual);
            x.iter_mut().zip(&self.p).for_each(|(x, p)| *x += p);
            report.potential = potential.gradient(team, x, &mut self.g);
            let renewed = potential.renew(x, &mut self.g);
            (report.potential, start) = (report.potential + renewed, start + renewed);
            report.steps += 1;
            team.begin(Phase::Operator);
            potential.extrapolated_hessian(team, &self.from, x, &mut self.hessian);
        }
        let finite = self.g.iter().all(|g| g.norm_squared().is_finite());
        if finite && report.potential <= start + ROUNDING * start.abs() {
            return converged;
        }
        x.copy_from_slice(&self.trial);
        let renewed = potential.renew(x, &mut self.g);
        self.g.copy_from_slice(&self.trial_g);
        report.potential = start + renewed;
        false
    }
}
