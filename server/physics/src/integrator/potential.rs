//! The incremental potential of an implicit step, whose minimum is the end of the step.
//!
//! Every implicit scheme sets a⁺ = A (x⁺ − x_a) and v⁺ = B (x⁺ − x_v) in
//! M a⁺ + (α M + β K̂) v⁺ + f_int(x⁺) = f_ext + f_springs(x⁺), which is ∇Φ(x⁺) = 0 of
//!
//!   Φ(x) = A/2 ‖x − x_a‖²_M + αB/2 ‖x − x_v‖²_M + βB (½ ‖x − x_v‖²_K̂ − c·(x − x_v)) + Ψ(x) − f_ext·(x − x_a) + Σ springs
//!          + P(x)
//!
//! with K̂ held at the predictor. In implicit Euler c is the part of K̂ (x − x_v) that is a turn and no strain. P is the
//! potential of [pressure](scindo_algebra::assembly::pressure) around the iterate.
//!
//! # Source
//! Radovitzky, Ortiz 1999 (incremental potential of Newmark schemes); Martin et al. 2011.

use nalgebra::Vector3;
use scindo_algebra::assembly::pressure::{Follower, Pressure};
use scindo_algebra::assembly::{BlockCsr, Model, Tangent};
use scindo_algebra::solver::{Curvature, Potential};
use scindo_matter::team::Team;

use super::increment::Increment;
use super::mass::Mass;
use super::springs::ActiveSpring;

/// Φ of one step; borrows all its data.
pub(super) struct StepPotential<'a> {
    pub model: &'a Model,
    pub mass: &'a Mass,
    pub increment: Increment,
    pub x_a: &'a [Vector3<f64>],
    pub x_v: &'a [Vector3<f64>],
    /// α [1/s].
    pub alpha: f64,
    /// β [s] and K̂ at the predictor, if β > 0.
    pub damping: Option<(f64, &'a BlockCsr<f64>)>,
    /// What K̂ (x − x_v) has too much of the change of strain [N].
    pub turned: &'a [Vector3<f64>],
    /// Positions whose tension stiffens a step of one solve.
    pub tension: Option<&'a [Vector3<f64>]>,
    /// Gravity and loads [N].
    pub f_ext: &'a [Vector3<f64>],
    pub springs: &'a [ActiveSpring],
    /// Pressure that follows the surface, and its potential around the iterate.
    pub pressure: (&'a Pressure, &'a mut Follower),
    /// The tangent to use where a positive semidefinite one is needed.
    pub definite: Tangent,
    /// Ψ [J] at the positions of the last gradient.
    pub stored: f64,
    /// Buffers for differences of positions and for forces.
    pub scratch: &'a mut [Vector3<f64>],
    pub force: &'a mut [Vector3<f64>],
}

impl StepPotential<'_> {
    /// Φ without Ψ; adds its gradient to `g`, if given.
    fn rest(&mut self, x: &[Vector3<f64>], mut g: Option<&mut [Vector3<f64>]>) -> f64 {
        let Increment { A, B } = self.increment;
        let mut phi = 0.0;
        for (s, from) in [(A, self.x_a), (self.alpha * B, self.x_v)] {
            if s == 0.0 {
                continue;
            }
            difference(x, from, self.scratch);
            for c in 0..x.len() {
                let f = s * self.mass.row_times(c, self.scratch);
                phi += 0.5 * f.dot(&self.scratch[c]);
                if let Some(g) = g.as_deref_mut() {
                    g[c] += f;
                }
            }
        }
        if let Some((beta, K)) = self.damping {
            difference(x, self.x_v, self.scratch);
            K.multiply(self.scratch, self.force);
            for (c, (f, d)) in self.force.iter().zip(&*self.scratch).enumerate() {
                let turned = self.turned[c];
                phi += beta * B * (0.5 * f - turned).dot(d);
                if let Some(g) = g.as_deref_mut() {
                    g[c] += beta * B * (f - turned);
                }
            }
        }
        // The work of the loads is counted from x_a: from the origin it would be large even for small
        // motions.
        for (c, (f, x)) in self.f_ext.iter().zip(x).enumerate() {
            phi -= f.dot(&(x - self.x_a[c]));
            if let Some(g) = g.as_deref_mut() {
                g[c] -= f;
            }
        }
        let (pressure, follower) = &self.pressure;
        phi += follower.add_to(pressure, x, g.as_deref_mut());
        for spring in self.springs {
            let response = spring.law().potential(spring.point(x));
            phi += response.energy;
            if let Some(g) = g.as_deref_mut() {
                spring.carriers().for_each(|(c, w)| g[c] -= w * response.force);
            }
        }
        phi
    }

    /// Adds ∇²Φ without ∇²Ψ.
    fn add_rest_of_hessian(&self, x: &[Vector3<f64>], H: &mut BlockCsr<f64>) {
        let Increment { A, B } = self.increment;
        self.mass.add_to(A + self.alpha * B, H);
        if let Some((beta, K)) = self.damping {
            H.add_scaled(beta * B, K);
        }
        self.springs.iter().for_each(|spring| add_spring(spring, x, H));
        let (pressure, follower) = &self.pressure;
        follower.add_hessian(pressure, x, H);
    }
}

impl Potential for StepPotential<'_> {
    fn value(&mut self, team: &mut Team, x: &[Vector3<f64>]) -> f64 {
        self.model.energy_by(team, x) + self.rest(x, None)
    }

    fn gradient(&mut self, team: &mut Team, x: &[Vector3<f64>], g: &mut [Vector3<f64>]) -> f64 {
        self.stored = self.model.internal_forces_by(team, x, g);
        self.stored + self.rest(x, Some(g))
    }

    fn pattern(&mut self) -> BlockCsr<f64> {
        self.model.pattern()
    }

    fn hessian(&mut self, team: &mut Team, x: &[Vector3<f64>], curvature: Curvature, H: &mut BlockCsr<f64>) {
        let kind = match curvature {
            Curvature::Exact => Tangent::Exact,
            Curvature::Definite => self.definite,
        };
        self.model.tangent_by(team, x, kind, H);
        if let (Tangent::Held, Some(from)) = (kind, self.tension) {
            self.model.add_twists(x, from, H);
        }
        self.add_rest_of_hessian(x, H);
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
            self.add_rest_of_hessian(x, H);
        }
        known
    }

    fn loads(&mut self, loads: &mut [Vector3<f64>]) {
        loads.copy_from_slice(self.f_ext);
        self.pressure.1.add_force(loads);
    }

    fn renew(&mut self, x: &[Vector3<f64>], g: &mut [Vector3<f64>]) -> f64 {
        let (pressure, follower) = &mut self.pressure;
        follower.renew(pressure, x, g)
    }

    fn stored(&self) -> f64 {
        self.stored
    }
}

/// Adds w_a w_b S for every pair of carriers. A pair that the pattern lacks is moved to the diagonal,
/// which keeps the matrix positive semidefinite.
fn add_spring(spring: &ActiveSpring, x: &[Vector3<f64>], H: &mut BlockCsr<f64>) {
    let S = spring.law().potential(spring.point(x)).stiffness;
    if S.amax() == 0.0 {
        return;
    }
    for (a, w_a) in spring.carriers() {
        for (b, w_b) in spring.carriers() {
            let block = w_a * w_b * S;
            match H.position(a, b as u32) {
                Some(at) => {
                    for (entry, h) in H.blocks[at].iter_mut().enumerate() {
                        *h += block[(entry / 3, entry % 3)];
                    }
                }
                None => H.add_to_diagonal(a, &block.abs()),
            }
        }
    }
}

fn difference(x: &[Vector3<f64>], y: &[Vector3<f64>], d: &mut [Vector3<f64>]) {
    for ((d, x), y) in d.iter_mut().zip(x).zip(y) {
        *d = x - y;
    }
}
