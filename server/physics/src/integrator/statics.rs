//! Static equilibrium of a model: the minimum of Π(x) = Ψ(x) − f·(x − X), with pressure as its potential around the
//! iterate.
//!
//! [`StaticProblem`] is that potential, for Newton's method ([`scindo_algebra::solver::Newton`]) or for
//! [`Relaxation`]; [`find_equilibrium`] minimises it by Newton's method.

use nalgebra::Vector3;
use scindo_algebra::assembly::pressure::{Follower, Pressure};
use scindo_algebra::assembly::{BlockCsr, Model, Tangent};
use scindo_algebra::solver::{Curvature, Newton, NewtonReport, Potential};
use scindo_matter::element::FixedCopy;
use scindo_matter::team::Team;

/// Potential energy Π(x) = Ψ(x) − f·(x − X) of a model under dead loads, and pressure.
#[derive(Clone, Debug)]
pub struct StaticProblem<'a> {
    /// The discretised body.
    pub model: &'a Model,
    /// Load on every node [N], gravity included.
    pub load: &'a [Vector3<f64>],
    /// The tangent to use where a positive semidefinite Hessian is needed: projected or held.
    pub definite: Tangent,
    /// Ψ [J] at the positions of the last gradient.
    stored: f64,
    pressure: Option<(&'a Pressure, Follower)>,
}

impl<'a> StaticProblem<'a> {
    /// The problem with the projected tangent.
    pub fn new(model: &'a Model, load: &'a [Vector3<f64>]) -> Self {
        Self { model, load, definite: Tangent::Projected, stored: 0.0, pressure: None }
    }

    /// The same under pressure too, for a search that begins at `x` [m].
    pub fn under(self, pressure: &'a Pressure, x: &[Vector3<f64>]) -> Self {
        let mut follower = Follower::default();
        follower.begin(pressure, x);
        Self { pressure: Some((pressure, follower)), ..self }
    }

    fn add_load_stiffness(&self, x: &[Vector3<f64>], H: &mut BlockCsr<f64>) {
        if let Some((pressure, follower)) = &self.pressure {
            follower.add_hessian(pressure, x, H);
        }
    }

    /// Potential of the pressure [J]; adds its gradient to `g`, if given.
    fn pressed(&self, x: &[Vector3<f64>], g: Option<&mut [Vector3<f64>]>) -> f64 {
        self.pressure.as_ref().map_or(0.0, |(pressure, follower)| follower.add_to(pressure, x, g))
    }

    /// −f·(x − X): relative to rest, so that it is not large where the work is small.
    fn work(&self, x: &[Vector3<f64>]) -> f64 {
        let moved = x.iter().zip(self.model.rest());
        -self.load.iter().zip(moved).map(|(f, (x, X))| f.dot(&(x - X))).sum::<f64>()
    }
}

impl Potential for StaticProblem<'_> {
    fn value(&mut self, team: &mut Team, x: &[Vector3<f64>]) -> f64 {
        self.model.energy_by(team, x) + self.work(x) + self.pressed(x, None)
    }

    fn gradient(&mut self, team: &mut Team, x: &[Vector3<f64>], g: &mut [Vector3<f64>]) -> f64 {
        self.stored = self.model.internal_forces_by(team, x, g);
        g.iter_mut().zip(self.load).for_each(|(g, f)| *g -= f);
        self.stored + self.work(x) + self.pressed(x, Some(g))
    }

    fn pattern(&mut self) -> BlockCsr<f64> {
        self.model.pattern()
    }

    fn hessian(&mut self, team: &mut Team, x: &[Vector3<f64>], curvature: Curvature, H: &mut BlockCsr<f64>) {
        let kind = if curvature == Curvature::Exact { Tangent::Exact } else { self.definite };
        self.model.tangent_by(team, x, kind, H);
        self.add_load_stiffness(x, H);
    }

    fn extrapolated_hessian(
        &mut self,
        team: &mut Team,
        from: &[Vector3<f64>],
        x: &[Vector3<f64>],
        H: &mut BlockCsr<f64>,
    ) -> bool {
        let known = self.model.extrapolated_tangent_by(team, from, x, H);
        if known {
            self.add_load_stiffness(x, H);
        }
        known
    }

    fn loads(&mut self, loads: &mut [Vector3<f64>]) {
        loads.copy_from_slice(self.load);
        if let Some((_, follower)) = &self.pressure {
            follower.add_force(loads);
        }
    }

    fn renew(&mut self, x: &[Vector3<f64>], g: &mut [Vector3<f64>]) -> f64 {
        self.pressure.as_mut().map_or(0.0, |(pressure, follower)| follower.renew(pressure, x, g))
    }

    fn stored(&self) -> f64 {
        self.stored
    }
}

/// Moves `x` [m] to the equilibrium of `problem` under the prescribed positions, by Newton's method.
pub fn find_equilibrium(
    newton: &mut Newton,
    team: &mut Team,
    problem: &mut StaticProblem<'_>,
    fixed: &[FixedCopy],
    x: &mut [Vector3<f64>],
) -> NewtonReport {
    prescribe(fixed, x);
    newton.minimise(team, problem, x, fixed)
}

/// Sets the prescribed directions of `x` to their positions.
pub fn prescribe(fixed: &[FixedCopy], x: &mut [Vector3<f64>]) {
    for f in fixed {
        f.held.place(&mut x[f.copy as usize], &f.position_m);
    }
}
