//! Line search of an equilibrium that is found by linear solves, for laws whose stiffness turns with the material.
//!
//! Each solve has the stiffness K̂ = Σ R K Rᵀ with the rotations where it begins. K̂ is positive semidefinite, so δ
//! points downhill, but it is not the Hessian: the full step may lead too far. [Pairs](QuasiNewton) of earlier steps
//! correct it. The potential decides in double precision, as in [`Newton`](scindo_algebra::solver::Newton): the stored energy
//! Ψ(x) and that of the springs, less the work f·(x − X) of the loads.
//!
//! # Source
//! Nocedal, Wright 2006: Numerical Optimization, §3.1 (backtracking), §3.2 (descent with approximate Hessians).

use nalgebra::Vector3;
use scindo_algebra::operator::Padded;
use scindo_matter::storage::reserve::resize_reserving;

use super::quasi_newton::QuasiNewton;
use super::springs::ActiveSpring;
use super::step_inputs::LinearInputs;

/// The part of the promised decrease that a step must keep (Armijo 1966).
const ARMIJO: f64 = 1e-4;
/// Differences of Π below this part of the largest |Π| met are rounding.
const ROUNDING: f64 = 1e-12;
/// Largest number of halvings of a step.
const HALVINGS: u32 = 12;
/// Solves without a halving of the residual after which it counts as rounding, once Π resolves no decrease.
const FUTILE_SOLVES: u32 = 10;

/// Where a search begins.
#[derive(Clone, Copy, Debug)]
pub(super) struct Start<'a> {
    /// Position of every copy [m].
    pub x: &'a [Vector3<f64>],
    /// Internal force on every copy [N].
    pub f_int: &'a [Vector3<f64>],
    /// Ψ [J].
    pub stored: f64,
}

/// What a search needs to remember from solve to solve.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Descent {
    trial: Vec<Vector3<f64>>,
    /// Largest |Π| met [J].
    largest: f64,
    /// Least residual at the start of a solve that was half of the one before it, and solves since then.
    least: (f64, u32),
    /// Whether Π could not resolve the decrease that the last step promised.
    below_rounding: bool,
    /// Halvings of all steps since the beginning.
    pub backtracks: u32,
    /// What earlier steps tell about the Hessian.
    pub memory: QuasiNewton,
}

impl Descent {
    /// Begins an equilibrium.
    pub(super) fn begin(&mut self) {
        (self.largest, self.least, self.below_rounding, self.backtracks) =
            (0.0, (f64::INFINITY, 0), false, 0);
        self.memory.clear();
    }

    /// Takes note of the true residual at the start of a solve. Returns whether more solves are futile: Π resolves
    /// no decrease, and the residual has not halved for some time.
    pub(super) fn is_futile(&mut self, residual: f64) -> bool {
        let (least, since) = &mut self.least;
        if residual <= 0.5 * *least {
            (*least, *since) = (residual, 0);
        } else {
            *since += 1;
        }
        self.below_rounding && *since >= FUTILE_SOLVES
    }

    /// The largest t ∈ {1, ½, …} for which x + t δ lowers the potential enough; `None` if there is none. Where
    /// the potential cannot resolve the decrease, t is 1 unless the potential rises by more than rounding.
    pub(super) fn search(
        &mut self,
        inputs: &LinearInputs<'_>,
        springs: &[ActiveSpring],
        start: Start<'_>,
        delta: &[Padded],
    ) -> Option<f64> {
        let Start { x, f_int, stored } = start;
        let external = |c: usize| inputs.step.mass[c] * inputs.step.gravity + inputs.step.load[c];
        let moved = |c: usize| Vector3::new(delta[c][0], delta[c][1], delta[c][2]).map(f64::from);
        let (mut slope, mut work) = (0.0, 0.0);
        for c in 0..x.len() {
            let f = external(c);
            slope += (f_int[c] - f).dot(&moved(c));
            work += f.dot(&(x[c] - inputs.step.rest[c]));
        }
        let mut phi = stored - work;
        for spring in springs {
            let response = spring.law().potential(spring.point(x));
            let along: Vector3<f64> = spring.carriers().map(|(c, w)| w * moved(c)).sum();
            slope -= response.force.dot(&along);
            phi += response.energy;
        }
        self.largest = self.largest.max(phi.abs());
        let rounding = ROUNDING * self.largest;
        self.below_rounding = slope.abs() <= 1e3 * rounding;
        if slope.is_nan() || (slope >= 0.0 && !self.below_rounding) {
            return None;
        }
        resize_reserving(&mut self.trial, x.len(), Vector3::zeros());
        let mut t = 1.0;
        for halving in 0..=HALVINGS {
            // The increase of Π is small beside Π itself: the work of the loads enters as a difference.
            let mut gained = 0.0;
            for (c, trial) in self.trial.iter_mut().enumerate() {
                let step = t * moved(c);
                *trial = x[c] + step;
                gained += external(c).dot(&step);
            }
            let mut rise = inputs.step.points.energy(inputs.material, &self.trial) - stored - gained;
            for spring in springs {
                rise += spring.law().potential(spring.point(&self.trial)).energy
                    - spring.law().potential(spring.point(x)).energy;
            }
            if rise <= (ARMIJO * t * slope).min(0.0) + rounding {
                return Some(t);
            }
            self.backtracks += u32::from(halving < HALVINGS);
            t *= 0.5;
        }
        None
    }
}
