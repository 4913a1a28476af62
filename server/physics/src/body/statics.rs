//! Static equilibrium: f_int(x) = f_ext, solved by Newton's method with a line search.
//!
//! The residual is in double precision, and the directions come from the single-precision solver: each
//! Newton step refines the last. The tangent is K̂ (rotations held), which is positive semidefinite
//! everywhere. It costs a few more steps than the exact tangent but never turns a descent direction
//! uphill.

use nalgebra::Vector3;

use super::fast::Fast;
use super::{Body, BodyError, Path};
use crate::integrator::prescribe;
use crate::operator::{BlockJacobi, CompositeDiagonal, ElasticUpdate, FixedCopy, SystemOperator, padded};
use crate::solver::{Curvature, LinearSettings, NewtonSettings, Pcg, PcgSettings};

/// Stopping criteria of a static solve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StaticSettings {
    /// Relative residual to reach: ‖f_ext − f_int‖ ≤ tolerance · ‖f_ext‖ (or the first residual, if larger).
    pub tolerance: f64,
    /// Largest number of Newton steps.
    pub newton_steps: u32,
    /// When each linear solve stops.
    pub linear: PcgSettings,
}

/// Result of a static solve.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StaticReport {
    /// Whether the tolerance was reached; if not, the body is at the best state found.
    pub converged: bool,
    /// Newton steps that were made.
    pub newton_steps: u32,
    /// Solver iterations, summed over all Newton steps.
    pub iterations: u32,
    /// Final residual relative to the loads.
    pub residual: f64,
}

impl Default for StaticSettings {
    fn default() -> Self {
        Self { tolerance: 1e-8, newton_steps: 200, linear: PcgSettings { iterations: 2000, tolerance: 1e-2 } }
    }
}

/// Shortest step of the line search, as a fraction of the full one.
const SHORTEST: f64 = 1.0 / 1024.0;

impl Body {
    /// Moves the body to its static equilibrium under gravity [m/s²], loads and constraints; it is then
    /// at rest.
    pub fn solve_static(
        &mut self,
        gravity: Vector3<f64>,
        settings: &StaticSettings,
    ) -> Result<StaticReport, BodyError> {
        if let Some(part) = self.parts().free.iter().position(|&free| free) {
            return Err(BodyError::LoosePart { part, mass_kg: self.parts().mass[part] });
        }
        self.state.v.fill(Vector3::zeros());
        prescribe(&self.fixed, &mut self.state.x);
        // The general path has its own Newton's method; only the stopping criteria are these.
        if let Path::General(general) = &self.path {
            let Self { team, state, load, fixed, .. } = self;
            let newton = self.settings.newton(self.material.law);
            let linear = LinearSettings {
                iterations: settings.linear.iterations,
                tolerance: settings.linear.tolerance,
                ..newton.linear
            };
            let newton = NewtonSettings {
                steps: settings.newton_steps,
                tolerance: settings.tolerance,
                curvature: Curvature::Exact,
                linear,
                ..newton
            };
            return Ok(general.equilibrium(team, &mut state.x, (load, gravity), fixed, newton));
        }
        self.fast_equilibrium(gravity, settings)
    }

    fn fast_equilibrium(
        &mut self,
        gravity: Vector3<f64>,
        settings: &StaticSettings,
    ) -> Result<StaticReport, BodyError> {
        let n = self.state.x.len();
        let mut f_ext: Vec<_> = (0..n).map(|c| self.mass[c] * gravity + self.load[c]).collect();
        filter(&self.fixed, &mut f_ext);
        let mut newton = Newton { f_ext, f_int: Vec::new(), residual: vec![Vector3::zeros(); n] };
        let mut report = StaticReport::default();
        let mut potential = newton.evaluate(self);
        let reference = norm(&newton.f_ext).max(norm(&newton.residual));
        let mut pcg = Pcg::default();
        pcg.resize(n);
        loop {
            report.residual = if reference > 0.0 { norm(&newton.residual) / reference } else { 0.0 };
            report.converged = report.residual <= settings.tolerance;
            if report.converged || report.newton_steps == settings.newton_steps || self.team.told_to_stop() {
                return Ok(report);
            }
            let (direction, iterations) = self.static_direction(&newton.residual, &mut pcg, settings.linear);
            report.iterations += iterations;
            report.newton_steps += 1;
            match newton.search(self, &direction, potential) {
                Some(lower) => potential = lower,
                None => return Ok(report),
            }
        }
    }

    /// Solves K̂ δ ≈ residual at the present state. Returns δ and the iterations it took.
    fn static_direction(
        &mut self,
        residual: &[Vector3<f64>],
        pcg: &mut Pcg,
        linear: PcgSettings,
    ) -> (Vec<Vector3<f64>>, u32) {
        let n = residual.len();
        let with = ElasticUpdate { lame: self.material.lame(), law: self.material.law, scale: 1.0 };
        let (mut f, mut diagonal, mut delta) = (vec![[0.0; 4]; n], vec![[0.0; 8]; n], vec![[0.0; 4]; n]);
        let Self { cut_mesh, team, state, fixed, path: Path::Fast(fast), .. } = self else {
            return (vec![Vector3::zeros(); n], 0);
        };
        fast.elastic.update(team, &with, &state.x, &mut f, &mut diagonal);
        let mut M = BlockJacobi::default();
        M.resize(n);
        // Degenerate elements would cost most of the iterations; the preconditioner substitutes their
        // motions.
        if let Some(modes) = fast.stiff_modes(cut_mesh) {
            let (T, _) = modes.substitution(|copy| fixed.iter().any(|f| f.copy == copy));
            let mut composite = CompositeDiagonal::new(&modes, &T, &fast.elastic);
            composite.update(team, (&fast.elastic, &with), (&fast.mass_f32, 0.0), &mut diagonal);
            M.set_substitution(T);
        }
        let Fast { elastic, mass_f32, .. } = &mut **fast;
        M.update(team, &diagonal, fixed);
        // Scaled to 1, so that single precision can represent the residual however small it has become.
        let size = norm(residual).max(f64::MIN_POSITIVE);
        for (r, residual) in pcg.r.iter_mut().zip(residual) {
            *r = padded(&(residual / size));
        }
        let r = pcg.r.clone();
        let reference = pcg.norm(team, &mut M, &r);
        let mut K = SystemOperator { elastic, mass: mass_f32, mass_factor: 0.0, springs: &[], fixed };
        let report = pcg.solve(team, &mut K, &mut M, &mut delta, (reference, linear));
        let direction = delta.iter().map(|d| size * Vector3::new(d[0], d[1], d[2]).map(f64::from)).collect();
        (direction, report.iterations)
    }
}

/// Loads and residual of a static solve, one entry per copy.
struct Newton {
    f_ext: Vec<Vector3<f64>>,
    f_int: Vec<Vector3<f64>>,
    residual: Vec<Vector3<f64>>,
}

impl Newton {
    /// Residual f_ext − f_int in the free directions; returns the potential Ψ − f_ext·x [J].
    fn evaluate(&mut self, body: &Body) -> f64 {
        let mut potential = body.elastic_response(&mut self.f_int);
        for (c, residual) in self.residual.iter_mut().enumerate() {
            *residual = self.f_ext[c] - self.f_int[c];
            potential -= self.f_ext[c].dot(&body.state.x[c]);
        }
        filter(&body.fixed, &mut self.residual);
        potential
    }

    /// Moves along `direction` until the potential falls or, where rounding hides that, the residual
    /// halves. Returns the new potential, or `None` with the body where it was.
    fn search(&mut self, body: &mut Body, direction: &[Vector3<f64>], potential: f64) -> Option<f64> {
        let start = body.state.x.clone();
        let before = norm(&self.residual);
        let slope: f64 = self.residual.iter().zip(direction).map(|(r, d)| r.dot(d)).sum();
        let mut t = 1.0;
        while t >= SHORTEST {
            for ((x, start), d) in body.state.x.iter_mut().zip(&start).zip(direction) {
                *x = start + t * d;
            }
            let next = self.evaluate(body);
            let falls = next <= potential - 1e-4 * t * slope;
            if falls || norm(&self.residual) < 0.5 * before {
                return Some(next);
            }
            t *= 0.5;
        }
        body.state.x = start;
        self.evaluate(body);
        None
    }
}

fn norm(v: &[Vector3<f64>]) -> f64 {
    v.iter().map(Vector3::norm_squared).sum::<f64>().sqrt()
}

fn filter(fixed: &[FixedCopy], v: &mut [Vector3<f64>]) {
    for copy in fixed {
        for axis in (0..3).filter(|&axis| copy.axes[axis]) {
            v[copy.copy as usize][axis] = 0.0;
        }
    }
}
