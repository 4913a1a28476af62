//! The critical time step of explicit schemes: ω_max of K − ω² M by power iteration, and the longest
//! stable step of each scheme for it.
//!
//! The power iteration keeps its directions (Lanczos 1950). The largest Ritz value of the same products
//! M⁻¹K q converges far faster than the Rayleigh quotient of the last iterate. The start is
//! deterministic. There is no reorthogonalisation, which the extreme value does not need (Paige 1980).

use nalgebra::Vector3;
use scindo_algebra::assembly::{BlockCsr, Model, Tangent};
use scindo_matter::element::FixedCopy;
use scindo_matter::material::Rayleigh;
use scindo_matter::team::Team;

use super::mass::Mass;
use super::scheme::{MassKind, Scheme};
use super::springs::ActiveSpring;
use super::state::hold;

/// Largest number of products with K; far more than a mesh of good quality needs.
const MOST_PRODUCTS: usize = 300;
/// Stop when the largest Ritz value changed by less than this, relative, in [`CALM`] products.
const CONVERGED: f64 = 1e-12;
const CALM: usize = 8;

/// ω_max² [1/s²] of a body, and what it was computed for.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct Frequency {
    pub omega_squared: f64,
    /// Looks until it is computed again.
    pub left: u32,
    /// The largest squared stretch that the body had.
    pub largest: f64,
}

/// Buffers of the iteration, one entry per node.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct PowerIteration {
    /// Present and previous direction, M-orthonormal.
    q: Vec<Vector3<f64>>,
    before: Vec<Vector3<f64>>,
    /// K q, then M⁻¹K q.
    force: Vec<Vector3<f64>>,
    acceleration: Vec<Vector3<f64>>,
    /// The tridiagonal matrix: diagonal and off-diagonal.
    alpha: Vec<f64>,
    beta: Vec<f64>,
    /// Σ of spring stiffness over mass at every node [1/s²].
    row: Vec<f64>,
}

impl PowerIteration {
    pub(super) fn resize(&mut self, n: usize) {
        for v in [&mut self.q, &mut self.before, &mut self.force, &mut self.acceleration] {
            v.resize(n, Vector3::zeros());
        }
        self.row.resize(n, 0.0);
        self.alpha.reserve(MOST_PRODUCTS);
        self.beta.reserve(MOST_PRODUCTS);
    }

    /// ω_max [rad/s] of K − ω² M in the directions that are not prescribed, from below: the largest
    /// Ritz value.
    pub(super) fn omega_max(
        &mut self,
        team: &mut Team,
        K: &BlockCsr<f64>,
        mass: &mut Mass,
        fixed: &[FixedCopy],
    ) -> f64 {
        self.alpha.clear();
        self.beta.clear();
        start(&mut self.q);
        hold(fixed, &mut self.q);
        self.before.fill(Vector3::zeros());
        // The norm in M does not see nodes without mass.
        self.weightless_stand_still(mass);
        let norm = (2.0 * mass.kinetic(&self.q)).sqrt();
        if norm.is_nan() || norm <= 0.0 {
            return 0.0;
        }
        self.q.iter_mut().for_each(|q| *q /= norm);
        let (mut largest, mut calm, mut beta) = (0.0_f64, 0, 0.0);
        for _ in 0..MOST_PRODUCTS {
            K.multiply_by(team, &self.q, &mut self.force);
            hold(fixed, &mut self.force);
            let alpha: f64 = self.q.iter().zip(&self.force).map(|(q, f)| q.dot(f)).sum();
            mass.solve(team, &self.force, &mut self.acceleration);
            // q_next = M⁻¹K q − α q − β q_before, normalised in M.
            for ((a, q), before) in self.acceleration.iter_mut().zip(&self.q).zip(&mut self.before) {
                *a -= alpha * q + beta * *before;
                *before = *q;
            }
            hold(fixed, &mut self.acceleration);
            self.alpha.push(alpha);
            let value = largest_eigenvalue(&self.alpha, &self.beta);
            calm = if (value - largest).abs() <= CONVERGED * value.abs() { calm + 1 } else { 0 };
            largest = value;
            beta = (2.0 * mass.kinetic(&self.acceleration)).sqrt();
            // β = 0 ends the Krylov space: its Ritz values are then eigenvalues.
            let exhausted = beta.is_nan() || beta <= 1e-14 * largest.abs();
            if calm == CALM || exhausted || !largest.is_finite() {
                break;
            }
            self.beta.push(beta);
            for (q, a) in self.q.iter_mut().zip(&self.acceleration) {
                *q = a / beta;
            }
        }
        if largest.is_finite() { largest.max(0.0).sqrt() } else { f64::INFINITY }
    }

    fn weightless_stand_still(&mut self, mass: &Mass) {
        for (q, &m) in self.q.iter_mut().zip(&mass.lumped) {
            if m <= 0.0 {
                *q = Vector3::zeros();
            }
        }
    }

    /// Upper bound of the largest eigenvalue [1/s²] of M⁻¹ Σ k J Jᵀ over all springs, in contact or not,
    /// by the rows of M^−½ (…) M^−½ (Gershgorin).
    pub(super) fn spring_bound(&mut self, springs: &[ActiveSpring], mass: &[f64]) -> f64 {
        self.row.fill(0.0);
        for spring in springs {
            let of = |c: usize, w: f64| if mass[c] > 0.0 { w.abs() / mass[c].sqrt() } else { 0.0 };
            let sum: f64 = spring.carriers().map(|(c, w)| of(c, w)).sum();
            for (c, w) in spring.carriers() {
                self.row[c] += spring.law().stiffness_n_m() * of(c, w) * sum;
            }
        }
        self.row.iter().fold(0.0, |most, row| most.max(*row))
    }
}

/// ω_max [rad/s] of the tangent of `model` at `x` [m] and of its mass matrix for a density [kg/m³], in the
/// directions that `fixed` leaves free; Δt_c = 2/ω_max.
pub fn omega_max(
    team: &mut Team,
    model: &Model,
    (density_kg_m3, kind): (f64, MassKind),
    x: &[Vector3<f64>],
    fixed: &[FixedCopy],
) -> f64 {
    let (mut power, mut K) = (PowerIteration::default(), model.pattern());
    let mut mass = Mass::new(model, density_kg_m3, kind);
    power.resize(model.n_nodes());
    mass.hold(fixed);
    model.tangent(x, Tangent::Projected, &mut K);
    power.omega_max(team, &K, &mut mass, fixed)
}

/// A deterministic start with a component in every direction: a Weyl sequence per axis.
fn start(q: &mut [Vector3<f64>]) {
    for (i, q) in q.iter_mut().enumerate() {
        let t = (i + 1) as f64;
        *q = Vector3::new(0.754_877_666, 0.569_840_291, 0.438_579_021).map(|step| (t * step).fract() - 0.5);
    }
}

/// Largest eigenvalue of the symmetric tridiagonal matrix with `diagonal` and `off`, by bisection on
/// the sign count of its Sturm sequence.
fn largest_eigenvalue(diagonal: &[f64], off: &[f64]) -> f64 {
    let n = diagonal.len();
    let radius = |i: usize| {
        let left = if i > 0 { off[i - 1].abs() } else { 0.0 };
        let right = if i + 1 < n { off[i].abs() } else { 0.0 };
        left + right
    };
    let mut low = diagonal.iter().fold(f64::NEG_INFINITY, |m, d| m.max(*d));
    let mut high = (0..n).map(|i| diagonal[i] + radius(i)).fold(f64::NEG_INFINITY, f64::max);
    if !(low.is_finite() && high.is_finite()) {
        return f64::NAN;
    }
    // λ exceeds every eigenvalue if all pivots of T − λ I are negative.
    let above = |lambda: f64| {
        let mut pivot = diagonal[0] - lambda;
        for i in 1..n {
            if pivot >= 0.0 {
                return false;
            }
            pivot = diagonal[i] - lambda - off[i - 1] * off[i - 1] / pivot;
        }
        pivot < 0.0
    };
    while high - low > 1e-15 * high.abs().max(low.abs()) {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            break;
        }
        if above(middle) { high = middle } else { low = middle }
    }
    high
}

/// Growth of rounding noise that an explicit step may have [1/s]. It must not be zero: the midpoint rule
/// amplifies every undamped oscillation.
const NOISE_GROWTH: f64 = 1.0;

/// Longest stable step [s] of an explicit `scheme` for a mode of frequency `omega` [rad/s] with the
/// damping ratio ζ = α/(2ω) + βω/2. Infinite for ω = 0 and for implicit schemes.
///
/// - symplectic Euler: h = (2/ω)(√(1 + ζ²) − ζ), which is 2/ω without damping (Belytschko, Liu, Moran
///   2000; the thesis gives 2/ω for forward Euler, which is not stable at all).
/// - Runge–Kutta: the largest h up to which |R(hλ)| ≤ exp(h · 1 s⁻¹), with the stability polynomial R
///   and λ² + 2ζωλ + ω² = 0. Without damping 2√2/ω for the fourth order.
pub fn stable_step(scheme: Scheme, omega: f64, rayleigh: Rayleigh) -> f64 {
    if omega.is_nan() || omega <= 0.0 {
        return f64::INFINITY;
    }
    let zeta = rayleigh.mass_1_s / (2.0 * omega) + rayleigh.stiffness_s * omega / 2.0;
    let order = match scheme {
        Scheme::SymplecticEuler => return 2.0 / (omega * ((1.0 + zeta * zeta).sqrt() + zeta)),
        Scheme::Midpoint => 2,
        Scheme::Rk4 => 4,
        _ => return f64::INFINITY,
    };
    let stable = |z: f64| {
        // λ/ω, the root that is larger in size.
        let (re, im) = match zeta {
            z if z < 1.0 => (-z, (1.0 - z * z).sqrt()),
            z => (-z - (z * z - 1.0).sqrt(), 0.0),
        };
        amplification(order, z * re, z * im) <= (NOISE_GROWTH * z / omega).exp()
    };
    // The stable steps begin at 0: walk up until one is not stable, then bisect.
    let (mut low, mut high) = (0.0, 1e-3);
    while stable(high) && high < 8.0 {
        low = high;
        high *= 1.02;
    }
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if stable(middle) { low = middle } else { high = middle }
    }
    low / omega
}

/// |1 + z + z²/2 + … + z^order/order!|.
fn amplification(order: u32, re: f64, im: f64) -> f64 {
    let (mut sum, mut term) = ((1.0, 0.0), (1.0, 0.0));
    for k in 1..=order {
        term = ((term.0 * re - term.1 * im) / f64::from(k), (term.0 * im + term.1 * re) / f64::from(k));
        sum = (sum.0 + term.0, sum.1 + term.1);
    }
    f64::hypot(sum.0, sum.1)
}

#[cfg(test)]
mod tests {
    use super::*;

    const UNDAMPED: Rayleigh = Rayleigh { mass_1_s: 0.0, stiffness_s: 0.0 };

    #[test]
    fn tridiagonal_matrices_have_known_eigenvalues() {
        // −u″ on n points: 2 − 2 cos(kπ/(n+1)).
        let n = 20;
        let (diagonal, off) = (vec![2.0; n], vec![-1.0; n - 1]);
        let exact = 2.0 - 2.0 * (std::f64::consts::PI * n as f64 / (n as f64 + 1.0)).cos();
        assert!((largest_eigenvalue(&diagonal, &off) - exact).abs() < 1e-14);
        assert_eq!(largest_eigenvalue(&[3.0], &[]), 3.0);
    }

    #[test]
    fn stable_steps_are_those_of_the_textbook() {
        let omega = 1e4;
        assert!((stable_step(Scheme::SymplecticEuler, omega, UNDAMPED) * omega - 2.0).abs() < 1e-15);
        assert!((stable_step(Scheme::Rk4, omega, UNDAMPED) * omega - 8_f64.sqrt()).abs() < 2e-3);
        // Midpoint: (ωh)⁴/8 per step is the growth allowed, h · 1/s.
        let h = stable_step(Scheme::Midpoint, omega, UNDAMPED);
        assert!(((omega * h).powi(4) / 8.0 / h - 1.0).abs() < 1e-2, "{}", h * omega);
        assert_eq!(stable_step(Scheme::Bdf2, omega, UNDAMPED), f64::INFINITY);
        assert_eq!(stable_step(Scheme::Rk4, 0.0, UNDAMPED), f64::INFINITY);
    }

    /// Steps just below and above the bound, on one oscillator, for every damping.
    #[test]
    fn the_bound_of_symplectic_euler_separates_decay_from_growth() {
        for zeta in [0.0, 0.1, 1.0, 3.0] {
            let (omega, beta) = (7.0, 2.0 * zeta / 7.0);
            let bound =
                stable_step(Scheme::SymplecticEuler, omega, Rayleigh { mass_1_s: 0.0, stiffness_s: beta });
            for (factor, grows) in [(0.999, false), (1.01, true)] {
                let (h, mut x, mut v) = (factor * bound, 1.0, 0.0);
                for _ in 0..1000 {
                    v -= h * (omega * omega * x + 2.0 * zeta * omega * v);
                    x += h * v;
                }
                let size = f64::hypot(x, v / omega);
                assert_eq!(size > 1e3, grows, "ζ = {zeta}, {factor}: {size}");
            }
        }
    }
}
