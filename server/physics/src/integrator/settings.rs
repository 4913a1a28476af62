//! Settings of the integration of a discrete model: scheme, mass, Newton's method, limits of explicit steps.

use scindo_algebra::solver::{LinearSettings, Method, NewtonSettings, Precision};

use super::ablation::Ablation;
use super::scheme::{MassKind, Scheme};

/// Settings of a [`ModelSolver`](super::ModelSolver).
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct DynamicsSettings {
    /// Time integration scheme.
    pub scheme: Scheme,
    /// How mass is distributed.
    pub mass: MassKind,
    /// A step is a fixed number of linear solves by design. It is judged by how well the last of them was
    /// solved and not by the residual of Newton's method.
    pub linearised: bool,
    /// Newton's method of implicit schemes. With `steps` = 1 a step is one linear solve from the predictor;
    /// Newmark's method makes two. Linear and corotational bodies need no more. Other laws, inverted or
    /// collapsed elements and contacts get at least [`LEAST_NEWTON_STEPS`].
    pub newton: NewtonSettings,
    /// [`Scheme::Static`] only: number of iterations of matrix-free relaxation per step, in place of
    /// Newton's method. They continue from step to step.
    pub relaxation: Option<u32>,
    /// Explicit schemes: largest number of parts into which a step longer than the stable one is divided;
    /// 1 refuses such a step.
    pub most_substeps: u32,
    /// What a mutation test leaves out.
    pub ablation: Ablation,
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
            ablation: Ablation::default(),
        }
    }
}
