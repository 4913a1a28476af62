//! Pressure as a part of the potential that Newton's method minimises.
//!
//! Newton's method needs a potential, which pressure on a part of a surface does not have. Around the iterate x_k it is
//! replaced by P(x) = p V(x) − c_k·(x − x_k), where c_k = f(x_k) + p ∂V/∂x(x_k) is what f has beyond −p ∂V/∂x. Then
//! −∂P/∂x(x_k) = f(x_k) exactly, and P has the symmetric tangent p ∂²V/∂x². c_k is renewed after every Newton step.
//! On a closed surface, or where the rim is held, c_k does nothing and convergence is quadratic; else it is linear.
//!
//! The tangent is worth its cost, a pass over the faces under pressure per Newton step. A quarter of a thick tube of a
//! neo-Hookean law, inflated by half in four steps of load to a residual of 10⁻⁶, takes 5, 6, 9 and 10 Newton steps with
//! it. Without it the first two take 7 and 11, and the third stagnates above the tolerance.

use nalgebra::Vector3;
use scindo_matter::storage::reserve::resize_reserving;

use super::Pressure;
use crate::assembly::BlockCsr;

/// P around the present iterate, with all its memory.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct Follower {
    /// The fixed point of V [m].
    apex: Vector3<f64>,
    /// x_k [m].
    at: Vec<Vector3<f64>>,
    /// c_k [N].
    correction: Vec<Vector3<f64>>,
    /// f(x_k) [N].
    force: Vec<Vector3<f64>>,
}

impl Follower {
    /// Begins with the iterate `x` [m]. Allocates only if the number of nodes has grown.
    pub fn begin(&mut self, pressure: &Pressure, x: &[Vector3<f64>]) {
        if pressure.is_empty() {
            return;
        }
        for v in [&mut self.at, &mut self.correction, &mut self.force] {
            v.clear();
            resize_reserving(v, x.len(), Vector3::zeros());
        }
        self.apex = pressure.centre(x);
        self.linearise(pressure, x);
    }

    /// Takes `x` [m] as the next iterate. Changes the gradient `g` [N] at `x` accordingly, and returns the change of P
    /// at `x` [J].
    pub fn renew(&mut self, pressure: &Pressure, x: &[Vector3<f64>], g: &mut [Vector3<f64>]) -> f64 {
        if pressure.is_empty() {
            return 0.0;
        }
        let moved = x.iter().zip(&self.at);
        let change = self.correction.iter().zip(moved).map(|(c, (x, at))| c.dot(&(x - at))).sum();
        g.iter_mut().zip(&self.correction).for_each(|(g, c)| *g += c);
        self.linearise(pressure, x);
        g.iter_mut().zip(&self.correction).for_each(|(g, c)| *g -= c);
        change
    }

    fn linearise(&mut self, pressure: &Pressure, x: &[Vector3<f64>]) {
        self.at.copy_from_slice(x);
        self.force.fill(Vector3::zeros());
        pressure.add_forces(x, &mut self.force);
        self.correction.copy_from_slice(&self.force);
        pressure.add_gradient(x, &self.apex, &mut self.correction);
    }

    /// P(x) [J]; adds its gradient [N] to `g`, if given.
    pub fn add_to(&self, pressure: &Pressure, x: &[Vector3<f64>], g: Option<&mut [Vector3<f64>]>) -> f64 {
        if pressure.is_empty() {
            return 0.0;
        }
        if let Some(g) = g {
            pressure.add_gradient(x, &self.apex, g);
            g.iter_mut().zip(&self.correction).for_each(|(g, c)| *g -= c);
        }
        let moved = x.iter().zip(&self.at);
        let linear: f64 = self.correction.iter().zip(moved).map(|(c, (x, at))| c.dot(&(x - at))).sum();
        pressure.potential(x, &self.apex) - linear
    }

    /// Adds ∂²P/∂x² [N/m].
    pub fn add_hessian(&self, pressure: &Pressure, x: &[Vector3<f64>], H: &mut BlockCsr<f64>) {
        pressure.add_hessian(x, &self.apex, H);
    }

    /// Adds f(x_k) [N] to `loads`.
    pub fn add_force(&self, loads: &mut [Vector3<f64>]) {
        loads.iter_mut().zip(&self.force).for_each(|(load, f)| *load += f);
    }
}
