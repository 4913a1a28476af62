//! Time integration schemes.

use scindo_algebra::assembly::MassSharing;
use thiserror::Error;

/// Settings with which no step can be made.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum DynamicsError {
    /// Newmark's parameters are out of range.
    #[error("Newmark parameters beta = {beta}, gamma = {gamma}: beta must be in (0, 1], gamma in [0.5, 2]")]
    Newmark {
        /// β.
        beta: f64,
        /// γ.
        gamma: f64,
    },
    /// The spectral radius is out of range.
    #[error("spectral radius {spectral_radius} of generalised-alpha: it must be in [0, 1]")]
    SpectralRadius {
        /// ρ∞.
        spectral_radius: f64,
    },
}

/// A time integration scheme. h is the step, a = M⁻¹ (f_ext − f_int − D v).
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub enum Scheme {
    /// No inertia: every step ends in equilibrium with the loads, at rest.
    Static,
    /// v⁺ = v + h a(x, v), x⁺ = x + h v⁺. Explicit, first order, symplectic: energy does not drift.
    SymplecticEuler,
    /// Explicit midpoint rule (second-order Runge–Kutta). Amplifies undamped oscillations a little,
    /// by 1 + (ωh)⁴/8 per step.
    Midpoint,
    /// The classical fourth-order Runge–Kutta scheme. Explicit.
    Rk4,
    /// v⁺ = v + h a(x⁺, v⁺), x⁺ = x + h v⁺. Unconditionally stable, first order, dissipates.
    #[default]
    ImplicitEuler,
    /// v⁺ = (4 v − v₋)/3 + ⅔ h a(x⁺, v⁺), x alike: second order, dissipates far less. The first step, a
    /// step at contact onset and one where the body turns too fast are made with implicit Euler.
    Bdf2,
    /// x⁺ = x + h v + h² ((½ − β) a + β a⁺), v⁺ = v + h ((1 − γ) a + γ a⁺) (Newmark 1959).
    ///
    /// β = ¼, γ = ½, the average acceleration, is of second order and dissipates nothing. With large
    /// rotations it is not stable: a step that gains energy is replaced by one of implicit Euler.
    Newmark {
        /// β > 0.
        beta: f64,
        /// γ ≥ ½; the scheme is unconditionally stable for linear bodies if 2β ≥ γ.
        gamma: f64,
    },
    /// M ((1 − α_m) a⁺ + α_m a) + D v_α + f_int(x_α) = f_ext with x_α = (1 − α_f) x⁺ + α_f x, v_α alike, and the x⁺ and
    /// v⁺ of Newmark's method (Chung, Hulbert 1993). Second order; dissipates fast oscillations alone.
    GeneralisedAlpha {
        /// ρ∞, from 0 to 1: what a step leaves of the fastest oscillations. 1 dissipates nothing.
        spectral_radius: f64,
    },
}

/// Parameters of Newmark's method and its generalisation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Alpha {
    pub beta: f64,
    pub gamma: f64,
    /// Weight of the acceleration at the start of the step in the equations.
    pub alpha_m: f64,
    /// Weight of position and velocity there.
    pub alpha_f: f64,
}

impl Scheme {
    /// Average acceleration: β = ¼, γ = ½.
    pub const AVERAGE_ACCELERATION: Self = Self::Newmark { beta: 0.25, gamma: 0.5 };

    /// Whether the scheme solves no system; its step is then limited by Δt_c.
    pub fn is_explicit(self) -> bool {
        matches!(self, Self::SymplecticEuler | Self::Midpoint | Self::Rk4)
    }

    /// Whether a step needs more than the state before it.
    pub fn remembers(self) -> bool {
        self == Self::Bdf2 || self.is_newmark()
    }

    /// Whether it is a method of Newmark, or its generalisation.
    pub fn is_newmark(self) -> bool {
        self.alpha().is_some()
    }

    /// Its parameters, if it is a method of Newmark or its generalisation.
    pub(super) fn alpha(self) -> Option<Alpha> {
        match self {
            Self::Newmark { beta, gamma } => Some(Alpha { beta, gamma, alpha_m: 0.0, alpha_f: 0.0 }),
            Self::GeneralisedAlpha { spectral_radius: rho } => {
                let (alpha_m, alpha_f) = ((2.0 * rho - 1.0) / (rho + 1.0), rho / (rho + 1.0));
                let gamma = 0.5 - alpha_m + alpha_f;
                Some(Alpha { beta: 0.25 * (0.5 + gamma).powi(2), gamma, alpha_m, alpha_f })
            }
            _ => None,
        }
    }

    /// Whether it is an implicit scheme with inertia.
    pub fn is_implicit_motion(self) -> bool {
        !self.is_explicit() && self != Self::Static
    }

    /// Whether the scheme's parameters are in their range.
    pub fn check(self) -> Result<(), DynamicsError> {
        match self {
            Self::Newmark { beta, gamma } if !(beta > 0.0 && beta <= 1.0 && (0.5..=2.0).contains(&gamma)) => {
                Err(DynamicsError::Newmark { beta, gamma })
            }
            Self::GeneralisedAlpha { spectral_radius } if !(0.0..=1.0).contains(&spectral_radius) => {
                Err(DynamicsError::SpectralRadius { spectral_radius })
            }
            _ => Ok(()),
        }
    }

    /// Name of the scheme in scene files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Static => "static",
            Self::SymplecticEuler => "symplectic-euler",
            Self::Midpoint => "midpoint",
            Self::Rk4 => "rk4",
            Self::ImplicitEuler => "implicit-euler",
            Self::Bdf2 => "bdf2",
            Self::Newmark { .. } => "newmark",
            Self::GeneralisedAlpha { .. } => "generalised-alpha",
        }
    }
}

/// How mass is distributed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum MassKind {
    /// One number per node. Explicit schemes take [`Menouillard`](Self::Menouillard) for it.
    #[default]
    Lumped,
    /// One number per node: the mass of every piece, divided evenly among its copies. Only linear tetrahedra know it.
    Menouillard,
    /// One number per node: ρ ∫ N_a dV, but at least half of what [`Menouillard`](Self::Menouillard) gives it. Only
    /// linear tetrahedra know it.
    Floored,
    /// M_ab = ρ ∫ N_a N_b dV. Explicit schemes solve with it in every evaluation.
    Consistent,
}

impl MassKind {
    /// How a model shares the mass of a piece for a scheme; `None` if by the integrals of the shape functions.
    pub(super) fn sharing(self, explicit: bool) -> Option<MassSharing> {
        match self {
            Self::Menouillard => Some(MassSharing::Even),
            Self::Floored => Some(MassSharing::Floored),
            Self::Lumped | Self::Consistent => explicit.then_some(MassSharing::Even),
        }
    }
}
