//! Newton's method with backtracking: minimises a potential, whatever the start.
//!
//! H p = −∇Φ, then x ← x + t p with the first t ∈ {1, ½, ¼, …} that lowers Φ enough (Armijo 1966). A Φ
//! that is not finite counts as +∞. If p gives no descent, the block-Jacobi gradient −M⁻¹∇Φ is tried. If
//! that fails too, no step is taken: an unchecked step can overflow.

use std::sync::Arc;

use nalgebra::Vector3;
use scindo_matter::element::FixedCopy;
use scindo_matter::team::Team;
use scindo_matter::team::phase::Phase;

use super::linear::{LinearSettings, LinearSolver, Method};
use super::report::StopReason;
use crate::assembly::BlockCsr;
use crate::operator::StiffModes;

/// A function to minimise: potential energy, or that plus the inertia of a time step.
pub trait Potential {
    /// Φ(x) [J]; may be infinite or NaN where x is impossible.
    fn value(&mut self, team: &mut Team, x: &[Vector3<f64>]) -> f64;

    /// g = ∇Φ(x) [N], prescribed directions included; returns Φ(x).
    fn gradient(&mut self, team: &mut Team, x: &[Vector3<f64>], g: &mut [Vector3<f64>]) -> f64;

    /// A zero matrix with the pattern of ∇²Φ.
    fn pattern(&mut self) -> BlockCsr<f64>;

    /// H = ∇²Φ(x) [N/m], or a positive semidefinite approximation of it if `curvature` requests it.
    fn hessian(&mut self, team: &mut Team, x: &[Vector3<f64>], curvature: Curvature, H: &mut BlockCsr<f64>);

    /// Writes the forces [N] against which the residual is measured: loads, inertia.
    fn loads(&mut self, loads: &mut [Vector3<f64>]);

    /// The exact H at `x` with the stress extrapolated from the positions `from`. Returns whether there is
    /// one; if not, `H` may stay as it is.
    fn extrapolated_hessian(
        &mut self,
        _team: &mut Team,
        _from: &[Vector3<f64>],
        _x: &[Vector3<f64>],
        _H: &mut BlockCsr<f64>,
    ) -> bool {
        false
    }

    /// Tells that `x` is the next iterate, for a potential that replaces another one around it. The gradient `g` at
    /// `x` is changed accordingly; returns the change of Φ(x) [J].
    fn renew(&mut self, _x: &[Vector3<f64>], _g: &mut [Vector3<f64>]) -> f64 {
        0.0
    }

    /// Elastic energy [J] at the last gradient; 0 if there is none. A body under prescribed displacements
    /// alone has no loads to measure the residual against, so this stands in.
    fn stored(&self) -> f64 {
        0.0
    }
}

/// Which Hessian Newton's method uses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Curvature {
    /// The second derivative. A step at which it turns out indefinite is made with `Definite`.
    Exact,
    /// Projected to positive semidefinite: always a descent direction.
    #[default]
    Definite,
}

/// Settings of Newton's method.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct NewtonSettings {
    /// Largest number of Newton steps.
    pub steps: u32,
    /// Stop at √(gᵀM⁻¹g) ≤ tolerance · reference; reference is the norm of the loads, or of the first
    /// gradient where that is larger, and at least 10⁻³ √(2Ψ).
    pub tolerance: f64,
    /// Largest number of halvings of a step: usually 8, and 20 to recover from ruined states.
    pub halvings: u32,
    /// Which Hessian to use.
    pub curvature: Curvature,
    /// The linear solver; its tolerance is the largest forcing term η.
    pub linear: LinearSettings,
}

impl NewtonSettings {
    /// Value of `halvings` for full steps without a check. Only to show what the line search is for.
    #[doc(hidden)]
    pub const UNCHECKED: u32 = u32::MAX;
}

impl Default for NewtonSettings {
    fn default() -> Self {
        Self {
            steps: 100,
            tolerance: 1e-8,
            halvings: 8,
            curvature: Curvature::Definite,
            linear: LinearSettings { tolerance: 0.1, ..LinearSettings::default() },
        }
    }
}

/// Result of a minimisation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NewtonReport {
    /// Newton steps made, gradient steps included.
    pub steps: u32,
    /// Iterations of all linear solves.
    pub linear_iterations: u32,
    /// √(gᵀM⁻¹g) at the end, over the reference.
    pub residual: f64,
    /// The reference itself [√J]: the norm of the loads, or of the first gradient.
    pub reference: f64,
    /// What ended the iteration.
    pub stop: StopReason,
    /// Halvings of all line searches.
    pub backtracks: u32,
    /// Steps at which the Hessian was found indefinite.
    pub indefinite: u32,
    /// Steps along the block-Jacobi gradient, because Newton's direction led nowhere.
    pub gradient_steps: u32,
    /// Φ at the end [J].
    pub potential: f64,
    /// Algebraic error of the last linear solve [√J].
    pub algebraic_error: f64,
    /// Residual of the linearised equations after the last linear solve and its line search, √(rᵀM⁻¹r)
    /// over the reference. It judges steps that are a fixed number of linear solves by design.
    pub linear_residual: f64,
    /// The displacement (3 · copy + axis) whose pivot was not positive, if the factorisation of a matrix
    /// that must be positive definite met one. Conjugate gradients then took its place.
    pub pivot: Option<u32>,
}

/// Newton's method with all its memory; reused from solve to solve without allocation.
#[derive(Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct Newton {
    /// Settings; may be changed between solves.
    pub settings: NewtonSettings,
    pub(super) solver: LinearSolver,
    pub(super) hessian: BlockCsr<f64>,
    pub(super) g: Vec<Vector3<f64>>,
    minus_g: Vec<Vector3<f64>>,
    pub(super) p: Vec<Vector3<f64>>,
    pub(super) trial: Vec<Vector3<f64>>,
    pub(super) trial_g: Vec<Vector3<f64>>,
    /// Positions before the last of the mixed steps.
    pub(super) from: Vec<Vector3<f64>>,
    loads: Vec<Vector3<f64>>,
}

/// Armijo's factor: the part of the promised decrease that a step must keep.
const ARMIJO: f64 = 1e-4;
/// Differences of Φ below this part of the largest |Φ| met are rounding.
pub(super) const ROUNDING: f64 = 1e-12;
/// Least reference, relative to the norm √(2Ψ) of the elastic forces. Without loads, and with held nodes
/// where they were, a residual could otherwise be measured only against rounding.
pub const LEAST_REFERENCE: f64 = 1e-3;
/// Least number of iterations allowed to conjugate gradients after a failed factorisation.
const INSTEAD_OF_FACTORS: u32 = 500;
/// Steps without a halving of the residual after which it counts as rounding.
const FUTILE_STEPS: u32 = 3;
/// A full step that cuts the residual to at most this part of it changes the Hessian little on its way, so that
/// the preconditioner of its start may judge its end. A step that cut it less may have entered softer material,
/// where the same forces count for more.
const SAME_HESSIAN: f64 = 0.25;
/// Halvings of a gradient step, whose length has no natural scale.
const GRADIENT_HALVINGS: u32 = 40;

impl Newton {
    /// A minimiser with these settings.
    pub fn new(settings: NewtonSettings) -> Self {
        Self { settings, ..Self::default() }
    }

    /// Sets the stiff motions of degenerate elements, for the linear solver.
    pub fn set_stiff_modes(&mut self, modes: Option<Arc<StiffModes>>) {
        self.solver.set_stiff_modes(modes);
    }

    /// See [`LinearSolver::stiff_motions`].
    pub fn stiff_motions(&self) -> [usize; 3] {
        self.solver.stiff_motions()
    }

    /// Prepares for potentials with the pattern of this one; call it again when the pattern changes.
    pub fn prepare(&mut self, potential: &mut dyn Potential) {
        self.hessian = potential.pattern();
        let n = self.hessian.n_rows();
        let Self { g, minus_g, p, trial, trial_g, from, loads, .. } = self;
        for v in [g, minus_g, p, trial, trial_g, from, loads] {
            v.clear();
            v.resize(n, Vector3::zeros());
        }
    }

    /// Forgets the pattern of the Hessian, because it has changed.
    pub fn forget_pattern(&mut self) {
        self.hessian = BlockCsr::default();
    }

    /// Moves `x` to a minimum of the potential; prescribed directions stay where they are.
    ///
    /// `x` only ever moves to states of lower potential, so it stays finite if it was.
    pub fn minimise(
        &mut self,
        team: &mut Team,
        potential: &mut dyn Potential,
        x: &mut [Vector3<f64>],
        fixed: &[FixedCopy],
    ) -> NewtonReport {
        if self.hessian.n_rows() != x.len() {
            self.prepare(potential);
        }
        team.begin(Phase::Residual);
        let potential_there = potential.gradient(team, x, &mut self.g);
        let mut report = NewtonReport { potential: potential_there, ..NewtonReport::default() };
        let mut first = None;
        let mut curvature = self.settings.curvature;
        // Full steps with extrapolated stress go first, where there are such; what they leave is minimised as usual.
        if self.mixed_steps(team, potential, (x, fixed), (&mut report, &mut first)) {
            return report;
        }
        let mut phi = report.potential;
        let mut largest = phi.abs();
        let mut floor = Floor::default();
        // Residual before the last step, if that was a full one.
        let mut full_step_from = None;
        loop {
            report.potential = phi;
            if !phi.is_finite() || !self.g.iter().all(|g| g.norm_squared().is_finite()) {
                report.stop = StopReason::NonFinite;
                return report;
            }
            if team.told_to_stop() {
                report.stop = StopReason::Interrupted;
                return report;
            }
            // After a full step, the previous preconditioner tells whether a new Hessian is needed at all.
            if let Some(before) = full_step_from.take()
                && self.measure(potential, &mut report, &mut first)
                && report.residual <= SAME_HESSIAN * before
            {
                return report;
            }
            team.begin(Phase::Operator);
            potential.hessian(team, x, curvature, &mut self.hessian);
            self.solver.set_matrix(&self.hessian, fixed);
            team.begin(Phase::Residual);
            if self.measure(potential, &mut report, &mut first) {
                return report;
            }
            if floor.is_reached(report.residual) || report.steps == self.settings.steps {
                let futile = report.steps < self.settings.steps;
                report.stop = if futile { StopReason::Stagnated } else { StopReason::IterationLimit };
                return report;
            }
            let (before, backtracks) = (report.residual, report.backtracks);
            team.begin(Phase::Solve);
            let most = self.settings.linear.tolerance.min(report.residual.sqrt());
            let definite = self.direction(team, (curvature, most), &mut report);
            // An indefinite Hessian may point uphill: make this step with its projection.
            if !definite && curvature == Curvature::Exact {
                curvature = Curvature::Definite;
                continue;
            }
            team.begin(Phase::Search);
            let slope = dot(&self.g, &self.p);
            let (halvings, gradient_steps) = (self.settings.halvings, report.gradient_steps);
            let mut next = self.search(team, potential, (x, phi), (slope, largest, halvings), &mut report);
            // A shortened step leaves the rest of the right-hand side.
            let t =
                if next.is_some() { 0.5_f64.powf(f64::from(report.backtracks - backtracks)) } else { 0.0 };
            report.linear_residual = before * (1.0 - t) + t * report.linear_residual;
            // No descent along p: try the gradient.
            if next.is_none() {
                self.solver.precondition(&self.minus_g, &mut self.p);
                let slope = dot(&self.g, &self.p);
                next =
                    self.search(team, potential, (x, phi), (slope, largest, GRADIENT_HALVINGS), &mut report);
                report.gradient_steps += u32::from(next.is_some());
            }
            let Some(next) = next else {
                let rounding = slope.abs() <= 1e3 * ROUNDING * largest;
                report.stop = if team.told_to_stop() {
                    StopReason::Interrupted
                } else if rounding {
                    StopReason::Stagnated
                } else {
                    StopReason::NoDescent
                };
                return report;
            };
            floor.below_rounding = slope.abs() <= 1e3 * ROUNDING * next.abs();
            team.begin(Phase::Residual);
            phi = next;
            largest = largest.max(phi.abs());
            x.copy_from_slice(&self.trial);
            std::mem::swap(&mut self.g, &mut self.trial_g);
            // A potential that stands in for another one changes with the iterate, and Φ and its gradient with it.
            phi += potential.renew(x, &mut self.g);
            report.steps += 1;
            // The projection was for this step only; the next one tries the Hessian that was asked for.
            curvature = self.settings.curvature;
            let full = report.backtracks == backtracks && report.gradient_steps == gradient_steps;
            full_step_from = full.then_some(before);
        }
    }

    /// Writes the residual into the report. Returns whether the tolerance is reached.
    pub(super) fn measure(
        &mut self,
        potential: &mut dyn Potential,
        report: &mut NewtonReport,
        first: &mut Option<f64>,
    ) -> bool {
        self.solver.filter(&mut self.g);
        potential.loads(&mut self.loads);
        self.solver.filter(&mut self.loads);
        let norm = self.solver.norm(&self.g);
        let least = LEAST_REFERENCE * (2.0 * potential.stored().max(0.0)).sqrt();
        report.reference = self.solver.norm(&self.loads).max(*first.get_or_insert(norm)).max(least);
        report.residual = if report.reference > 0.0 { norm / report.reference } else { norm };
        report.stop = StopReason::Converged;
        norm <= self.settings.tolerance * report.reference
    }

    /// Computes p with H p ≈ −g, with a forcing term of at most `most`. Returns whether H showed no direction
    /// of non-positive curvature.
    pub(super) fn direction(
        &mut self,
        team: &mut Team,
        (curvature, most): (Curvature, f64),
        report: &mut NewtonReport,
    ) -> bool {
        for (minus_g, g) in self.minus_g.iter_mut().zip(&self.g) {
            *minus_g = -g;
        }
        self.p.fill(Vector3::zeros());
        // Eisenstat, Walker 1996: solve the more accurately, the closer the end; never beyond it.
        let linear = self.settings.linear;
        let needed = 0.1 * self.settings.tolerance / report.residual.max(f64::MIN_POSITIVE);
        let tolerance = most.max(needed.min(0.1));
        self.solver.settings = LinearSettings { tolerance, ..linear };
        let mut solved = self.solver.solve(team, &self.hessian, &self.minus_g, &mut self.p, None);
        // A matrix that must be definite was not factorised: conjugate gradients take over.
        if let (Some(pivot), Curvature::Definite) = (solved.pivot, curvature) {
            report.pivot = Some(pivot);
            let iterations = linear.iterations.max(INSTEAD_OF_FACTORS);
            self.solver.settings = LinearSettings { tolerance, method: Method::Pcg, iterations, ..linear };
            self.p.fill(Vector3::zeros());
            solved = self.solver.solve(team, &self.hessian, &self.minus_g, &mut self.p, None);
        }
        report.linear_iterations += solved.iterations;
        report.algebraic_error = solved.algebraic_error;
        report.linear_residual = solved.residual * report.residual;
        let definite = solved.stop != StopReason::NonPositiveCurvature;
        report.indefinite += u32::from(!definite);
        if solved.stop == StopReason::NonFinite {
            self.p.fill(Vector3::zeros());
        }
        self.solver.tidy(&mut self.p);
        definite
    }

    /// Finds the largest t ∈ {1, ½, …} that lowers Φ enough. Returns Φ there, with x + t p in `trial` and
    /// its gradient in `trial_g`; `None` if there is none.
    ///
    /// Close to the minimum Φ cannot resolve the decrease any more. There the slope decides instead
    /// (approximate Wolfe condition, Hager, Zhang 2005), or a gradient that is halved.
    fn search(
        &mut self,
        team: &mut Team,
        potential: &mut dyn Potential,
        (x, phi): (&[Vector3<f64>], f64),
        (slope, largest, halvings): (f64, f64, u32),
        report: &mut NewtonReport,
    ) -> Option<f64> {
        if halvings == NewtonSettings::UNCHECKED {
            for ((trial, x), p) in self.trial.iter_mut().zip(x).zip(&self.p) {
                *trial = x + p;
            }
            return Some(potential.gradient(team, &self.trial, &mut self.trial_g));
        }
        if slope >= 0.0 || !slope.is_finite() {
            return None;
        }
        let rounding = ROUNDING * largest;
        let before = self.solver.norm(&self.g);
        let mut t = 1.0;
        for halving in 0..=halvings {
            if team.told_to_stop() {
                return None;
            }
            for ((trial, x), p) in self.trial.iter_mut().zip(x).zip(&self.p) {
                *trial = x + t * p;
            }
            let mut next = potential.value(team, &self.trial);
            if next.is_finite() && next <= phi + ARMIJO * t * slope + rounding {
                next = potential.gradient(team, &self.trial, &mut self.trial_g);
                self.solver.filter(&mut self.trial_g);
                let certain = -ARMIJO * t * slope > rounding;
                let flatter = || {
                    dot(&self.trial_g, &self.p).abs() <= (1.0 - 2.0 * ARMIJO) * slope.abs()
                        || self.solver.norm(&self.trial_g) <= 0.5 * before
                };
                let lower = next <= phi + ARMIJO * t * slope;
                if (lower && certain) || (self.trial_g.iter().all(|g| g.norm().is_finite()) && flatter()) {
                    return Some(next);
                }
            }
            report.backtracks += u32::from(halving < halvings);
            t *= 0.5;
        }
        None
    }
}

/// Detects when a minimisation has come down to rounding: the residual no longer falls, and a step can
/// gain less than Φ resolves.
#[derive(Clone, Copy, Debug)]
struct Floor {
    /// Smallest residual so far.
    least: f64,
    /// Steps since it halved.
    futile: u32,
    /// Whether the last step promised less than the rounding of Φ.
    below_rounding: bool,
}

impl Default for Floor {
    fn default() -> Self {
        Self { least: f64::INFINITY, futile: 0, below_rounding: false }
    }
}

impl Floor {
    /// Takes the residual after a step. Returns whether further steps are useless.
    fn is_reached(&mut self, residual: f64) -> bool {
        self.futile = if residual > 0.5 * self.least { self.futile + 1 } else { 0 };
        self.least = self.least.min(residual);
        self.below_rounding && self.futile >= FUTILE_STEPS
    }
}

fn dot(a: &[Vector3<f64>], b: &[Vector3<f64>]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(b)).sum()
}
