//! Static relaxation: a few matrix-free iterations towards equilibrium per frame.
//!
//! The iterate *and* the search direction are kept from frame to frame, so that ten frames of ten
//! iterations are one hundred iterations. The direction is given up only when loads, prescribed
//! directions, the topology or the positions were changed from outside (Nienhuys 2003, §3.3). For a
//! nonlinear law the conjugate gradients are those of Polak and Ribière with a secant along the line
//! (Shewchuk 1994, §14), and a step is taken only if it lowers the potential.

use nalgebra::Vector3;
use scindo_algebra::assembly::BlockCsr;
use scindo_algebra::solver::{Curvature, DiagonalInverse, Filter, Potential, StopReason};
use scindo_matter::element::FixedCopy;
use scindo_matter::team::Team;

use super::statics::prescribe;

/// Result of one frame of relaxation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RelaxationReport {
    /// Iterations of this frame.
    pub iterations: u32,
    /// √(gᵀM⁻¹g) over that of the loads (of the first gradient, where that is larger).
    pub residual: f64,
    /// What ended the iteration.
    pub stop: StopReason,
    /// Whether the search started anew, because something was changed from outside.
    pub restarted: bool,
    /// Directions without positive curvature that were met and given up.
    pub indefinite: u32,
    /// Π at the end \[J\].
    pub potential: f64,
}

/// Static relaxation with its iterate; nothing is allocated unless the number of nodes changes.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct Relaxation {
    /// Stop at √(gᵀM⁻¹g) ≤ tolerance · reference.
    pub tolerance: f64,
    x: Vec<Vector3<f64>>,
    g: Vec<Vector3<f64>>,
    z: Vec<Vector3<f64>>,
    p: Vec<Vector3<f64>>,
    trial: Vec<Vector3<f64>>,
    trial_g: Vec<Vector3<f64>>,
    loads: Vec<Vector3<f64>>,
    known_loads: Vec<Vector3<f64>>,
    known_fixed: Vec<FixedCopy>,
    filter: Filter,
    inverse: DiagonalInverse<f64>,
    diagonal: BlockCsr<f64>,
    /// gᵀM⁻¹g, Π, reference and step length of the last iteration.
    rho: f64,
    phi: f64,
    reference: f64,
    length: f64,
}

/// Armijo's factor, and the fraction of |Π| that counts as rounding.
const ARMIJO: f64 = 1e-4;
const ROUNDING: f64 = 1e-12;
const MOST_HALVINGS: u32 = 30;

impl Relaxation {
    /// Relaxation that stops at this tolerance.
    pub fn new(tolerance: f64) -> Self {
        Self { tolerance, ..Self::default() }
    }

    /// Forgets the search. Call it when the topology or the material has changed.
    pub fn forget(&mut self) {
        self.x.clear();
    }

    /// Makes the next frame start its search anew from the iterate. Call it when the potential has
    /// changed other than by its loads.
    pub fn restart_next(&mut self) {
        self.known_loads.clear();
    }

    /// Makes at most `iterations` iterations from where the last frame ended.
    pub fn relax(
        &mut self,
        team: &mut Team,
        potential: &mut dyn Potential,
        fixed: &[FixedCopy],
        x: &mut [Vector3<f64>],
        iterations: u32,
    ) -> RelaxationReport {
        prescribe(fixed, x);
        let mut report =
            RelaxationReport { restarted: self.follow(potential, fixed, x), ..Default::default() };
        if report.restarted {
            self.restart(team, potential, x);
        } else {
            // Only differences of the potential are kept from frame to frame.
            self.phi = potential.value(team, x);
        }
        loop {
            let norm = self.rho.sqrt();
            report.residual = if self.reference > 0.0 { norm / self.reference } else { norm };
            report.potential = self.phi;
            report.stop = if !self.phi.is_finite() || !norm.is_finite() {
                StopReason::NonFinite
            } else if norm <= self.tolerance * self.reference {
                StopReason::Converged
            } else {
                StopReason::IterationLimit
            };
            if report.stop != StopReason::IterationLimit || report.iterations == iterations {
                break;
            }
            if team.told_to_stop() {
                report.stop = StopReason::Interrupted;
                break;
            }
            if !self.iterate(team, potential, x, &mut report) {
                report.stop = StopReason::Stagnated;
                break;
            }
            report.iterations += 1;
        }
        self.x.clear();
        self.x.extend_from_slice(x);
        report
    }

    /// Takes loads and constraints. Returns whether the search must start anew.
    fn follow(&mut self, potential: &mut dyn Potential, fixed: &[FixedCopy], x: &[Vector3<f64>]) -> bool {
        let n = x.len();
        let resized = self.g.len() != n || self.x.is_empty();
        if resized {
            let Self { g, z, p, trial, trial_g, loads, .. } = self;
            for v in [g, z, p, trial, trial_g, loads] {
                v.resize(n, Vector3::zeros());
            }
            self.diagonal = potential.pattern();
        }
        potential.loads(&mut self.loads);
        let same =
            !resized && self.x[..] == *x && self.loads == self.known_loads && self.known_fixed[..] == *fixed;
        if !same {
            self.known_loads.clone_from(&self.loads);
            self.known_fixed.clear();
            self.known_fixed.extend_from_slice(fixed);
            self.filter.set(fixed);
        }
        !same
    }

    fn restart(&mut self, team: &mut Team, potential: &mut dyn Potential, x: &[Vector3<f64>]) {
        potential.hessian(team, x, Curvature::Definite, &mut self.diagonal);
        self.inverse.update(&self.diagonal, &self.filter);
        self.phi = potential.gradient(team, x, &mut self.g);
        self.filter.apply(&mut self.g);
        self.filter.apply(&mut self.loads);
        self.inverse.apply(&self.g, &mut self.z);
        self.rho = dot(&self.g, &self.z);
        self.reference = self.inverse.norm(&self.loads).max(self.rho.sqrt());
        self.length = 0.5;
        for (p, z) in self.p.iter_mut().zip(&self.z) {
            *p = -z;
        }
    }

    /// Takes one step along p. Returns `false` if none lowers the potential.
    fn iterate(
        &mut self,
        team: &mut Team,
        potential: &mut dyn Potential,
        x: &mut [Vector3<f64>],
        report: &mut RelaxationReport,
    ) -> bool {
        // If the conjugate direction fails, the steepest one is tried.
        for steepest in [false, true] {
            if steepest {
                for (p, z) in self.p.iter_mut().zip(&self.z) {
                    *p = -z;
                }
            }
            let slope = dot(&self.g, &self.p);
            if slope >= 0.0 || !slope.is_finite() {
                continue;
            }
            // The slope at a probe tells the curvature along the line.
            self.look(team, potential, x, self.length);
            let curvature = (dot(&self.trial_g, &self.p) - slope) / self.length;
            let mut t = -slope / curvature;
            if curvature <= 0.0 || !t.is_finite() {
                report.indefinite += 1;
                if !steepest {
                    continue;
                }
                t = self.length;
            }
            for _ in 0..MOST_HALVINGS {
                let next = self.look(team, potential, x, t);
                let rounding = ROUNDING * self.phi.abs();
                let flatter = dot(&self.trial_g, &self.p).abs() <= 0.9 * slope.abs();
                let lower = next <= self.phi + ARMIJO * t * slope;
                if next.is_finite() && (lower || (next <= self.phi + rounding && flatter)) {
                    self.accept(x, next, t);
                    return true;
                }
                t *= 0.5;
            }
        }
        false
    }

    /// Returns the potential at x + t p and writes its gradient to `trial_g`.
    fn look(&mut self, team: &mut Team, potential: &mut dyn Potential, x: &[Vector3<f64>], t: f64) -> f64 {
        for ((trial, x), p) in self.trial.iter_mut().zip(x).zip(&self.p) {
            *trial = x + t * p;
        }
        let phi = potential.gradient(team, &self.trial, &mut self.trial_g);
        self.filter.apply(&mut self.trial_g);
        phi
    }

    fn accept(&mut self, x: &mut [Vector3<f64>], phi: f64, t: f64) {
        x.copy_from_slice(&self.trial);
        (self.phi, self.length) = (phi, t.max(f64::MIN_POSITIVE));
        // Polak–Ribière: β = g⁺·M⁻¹(g⁺ − g) / g·M⁻¹g, not below 0.
        let overlap = dot(&self.trial_g, &self.z);
        std::mem::swap(&mut self.g, &mut self.trial_g);
        self.inverse.apply(&self.g, &mut self.z);
        let rho = dot(&self.g, &self.z);
        let beta = ((rho - overlap) / self.rho).max(0.0);
        self.rho = rho;
        for (p, z) in self.p.iter_mut().zip(&self.z) {
            *p = beta * *p - z;
        }
    }
}

fn dot(a: &[Vector3<f64>], b: &[Vector3<f64>]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(b)).sum()
}
