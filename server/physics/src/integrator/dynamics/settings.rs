//! Settings of the integrator: scheme, mass, Newton's method, limits of explicit steps.

use super::DynamicsError;
use crate::solver::{LinearSettings, Method, NewtonSettings, Precision};

/// A time integration scheme. h is the step, a = M⁻¹ (f_ext − f_int − D v).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
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
}

impl Scheme {
    /// Average acceleration: β = ¼, γ = ½.
    pub const AVERAGE_ACCELERATION: Self = Self::Newmark { beta: 0.25, gamma: 0.5 };

    /// Whether the scheme solves no system; its step is then limited by Δt_c.
    pub fn is_explicit(self) -> bool {
        matches!(self, Self::SymplecticEuler | Self::Midpoint | Self::Rk4)
    }

    /// Whether the scheme's parameters are in their range.
    pub fn check(self) -> Result<(), DynamicsError> {
        match self {
            Self::Newmark { beta, gamma } if !(beta > 0.0 && beta <= 1.0 && (0.5..=2.0).contains(&gamma)) => {
                Err(DynamicsError::Newmark { beta, gamma })
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
        }
    }
}

/// How mass is distributed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MassKind {
    /// One number per node.
    #[default]
    Lumped,
    /// M_ab = ρ ∫ N_a N_b dV. Explicit schemes solve with it in every evaluation.
    Consistent,
}

/// Settings of [`Dynamics`](super::Dynamics).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DynamicsSettings {
    /// Time integration scheme.
    pub scheme: Scheme,
    /// Lumped or consistent mass.
    pub mass: MassKind,
    /// A step is a fixed number of linear solves by design. It is judged by how well the last of them was
    /// solved and not by the residual of Newton's method.
    pub linearised: bool,
    /// Newton's method of implicit schemes. `steps` = 1 (2 for Newmark) is the fast path, one linear
    /// solve from the predictor. Linear and corotational bodies in order take it. Other laws, inverted or
    /// collapsed elements and contacts get at least [`LEAST_NEWTON_STEPS`].
    pub newton: NewtonSettings,
    /// [`Scheme::Static`] only: number of iterations of matrix-free relaxation per step, in place of
    /// Newton's method. They continue from step to step.
    pub relaxation: Option<u32>,
    /// Explicit schemes: largest number of parts into which a step longer than the stable one is divided;
    /// 1 refuses such a step.
    pub most_substeps: u32,
}

/// Least number of Newton steps where one linear solve cannot be trusted.
pub const LEAST_NEWTON_STEPS: u32 = 3;

impl Default for DynamicsSettings {
    fn default() -> Self {
        let linear = LinearSettings {
            method: Method::Pcg,
            precision: Precision::Mixed,
            iterations: 500,
            tolerance: 0.1,
        };
        Self {
            scheme: Scheme::ImplicitEuler,
            mass: MassKind::Lumped,
            linearised: false,
            newton: NewtonSettings { steps: 20, tolerance: 1e-6, linear, ..NewtonSettings::default() },
            relaxation: None,
            most_substeps: 256,
        }
    }
}
