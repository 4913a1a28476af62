//! The form of the end of a step that all implicit schemes share: a⁺ = A (x⁺ − x_a), v⁺ = B (x⁺ − x_v).
//!
//! | scheme | A | B | x_v | x_a |
//! |---|---|---|---|---|
//! | implicit Euler | 1/h² | 1/h | x | x + h v |
//! | BDF2, k = 2h/3 | 1/k² | 1/k | (4x − x₋)/3 | x_v + k (4v − v₋)/3 |
//! | Newmark | 1/(βh²) | γ/(βh) | x_a − (v + h(1−γ)a)/B | x + h v + h²(½−β) a |
//!
//! Generalised-α solves for x_α = φ x⁺ + (1 − φ) x, φ = 1 − α_f. With the A, B, x_v and x_a of Newmark's method,
//! (1 − α_m) a⁺ + α_m a = A' (x_α − x_a') and φ v⁺ + (1 − φ) v = B (x_α − x_v') with A' = (1 − α_m) A/φ,
//! x_a' = (1 − φ) x + φ x_a − α_m a/A' and x_v' = (1 − φ) x + φ x_v − (1 − φ) v/B.
//!
//! # Source
//! Newmark 1959; Chung, Hulbert 1993, "A time integration algorithm for structural dynamics with improved numerical
//! dissipation: the generalized-α method"; Hairer, Wanner, *Solving Ordinary Differential Equations II*, ch. V.1 (BDF2).

use nalgebra::Vector3;

use super::scheme::Alpha;

/// Factors A and B of a scheme.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Increment {
    /// A [1/s²].
    pub A: f64,
    /// B [1/s].
    pub B: f64,
}

impl Increment {
    /// No inertia: x⁺ is an equilibrium.
    pub const NONE: Self = Self { A: 0.0, B: 0.0 };

    /// Implicit Euler with step `h` [s].
    pub fn euler(h: f64) -> Self {
        Self { A: 1.0 / (h * h), B: 1.0 / h }
    }

    /// BDF2 with constant step `h` [s].
    pub fn bdf2(h: f64) -> Self {
        Self::euler(2.0 / 3.0 * h)
    }

    /// Newmark's method with step `h` [s].
    pub fn newmark(h: f64, beta: f64, gamma: f64) -> Self {
        Self { A: 1.0 / (beta * h * h), B: gamma / (beta * h) }
    }

    /// The same of its generalisation.
    pub(super) fn alpha(h: f64, alpha: Alpha) -> Self {
        let Self { A, B } = Self::newmark(h, alpha.beta, alpha.gamma);
        Self { A: (1.0 - alpha.alpha_m) / (1.0 - alpha.alpha_f) * A, B }
    }
}

/// (x_v, x_a) of one copy in BDF2: from positions and velocities now and before.
#[inline(always)]
pub(crate) fn bdf2_history(
    h: f64,
    [x, v]: [&Vector3<f64>; 2],
    [x_before, v_before]: [&Vector3<f64>; 2],
) -> [Vector3<f64>; 2] {
    let k = 2.0 / 3.0 * h;
    let x_v = (4.0 * x - x_before) / 3.0;
    [x_v, x_v + k * (4.0 * v - v_before) / 3.0]
}

/// (x_v, x_a) of one copy in Newmark's method and its generalisation: from position, velocity and acceleration now.
#[inline(always)]
pub(super) fn newmark_history(h: f64, alpha: Alpha, [x, v, a]: [&Vector3<f64>; 3]) -> [Vector3<f64>; 2] {
    let Alpha { beta, gamma, alpha_m, alpha_f } = alpha;
    let x_a = x + h * v + h * h * (0.5 - beta) * a;
    let Increment { A, B } = Increment::alpha(h, alpha);
    // v⁺ = ṽ + B (x⁺ − x_a) with ṽ = v + h (1 − γ) a.
    let x_v = x_a - (v + h * (1.0 - gamma) * a) / B;
    if alpha_m == 0.0 && alpha_f == 0.0 {
        return [x_v, x_a];
    }
    let between = |from: Vector3<f64>| alpha_f * x + (1.0 - alpha_f) * from;
    [between(x_v) - alpha_f * v / B, between(x_a) - alpha_m * a / A]
}
