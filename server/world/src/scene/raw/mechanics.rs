//! Keys that say how a body is computed: element, law, integrator, mass, locking, solver.

use schemars::JsonSchema;
use scindo_physics::material::Material;
use serde::{Deserialize, Serialize};

/// Finite element.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RawElement {
    /// Linear tetrahedron; the only one that can be cut.
    #[default]
    Tet4,
    /// Quadratic tetrahedron, for accuracy.
    Tet10,
    /// Trilinear hexahedron; needs the box pattern `hex`.
    Hex8,
}

/// Constitutive law.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RawLaw {
    /// Small strain, small rotation.
    Linear,
    /// Small strain, large rotation.
    #[default]
    Corotational,
    /// St. Venant-Kirchhoff as in the textbooks while every principal stretch is above 0.65; below, where that
    /// law would give way, it is continued so that it resists inversion.
    Stvk,
    /// The stable Neo-Hookean law (Smith, de Goes, Kim 2018), not that of the textbooks: the same for small
    /// strains, finite when an element inverts; with a guard against collapse.
    NeoHookean,
}

/// Rayleigh damping, D = mass_1_s M + stiffness_s K.
#[derive(Debug, Clone, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawRayleigh {
    /// Factor of the mass matrix [1/s]: drags against the room.
    #[schemars(extend("minimum" = *Material::MASS_1_S.start(), "maximum" = *Material::MASS_1_S.end(),
        "x-next" = "0 switches it off"))]
    pub mass_1_s: f64,
    /// Factor of the stiffness matrix [s]: damps deformation, not rigid motion.
    #[schemars(extend("minimum" = *Material::STIFFNESS_S.start(), "maximum" = *Material::STIFFNESS_S.end(),
        "x-next" = "0 switches it off"))]
    pub stiffness_s: f64,
}

/// Time integration.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RawIntegrator {
    /// No inertia: every step is an equilibrium.
    Static,
    /// Explicit, first order.
    SymplecticEuler,
    /// Explicit midpoint rule, second order.
    Midpoint,
    /// Explicit Runge-Kutta, fourth order.
    Rk4,
    /// First order and unconditionally stable, linearised at the inertial predictor.
    #[default]
    ImplicitEuler,
    /// Second order, implicit, little damping.
    Bdf2,
    /// Second order, implicit, no damping with the default parameters.
    Newmark,
}

impl RawIntegrator {
    /// Whether a step needs no equations solved.
    pub fn is_explicit(self) -> bool {
        matches!(self, Self::SymplecticEuler | Self::Midpoint | Self::Rk4)
    }
}

/// Parameters of Newmark's method.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawNewmark {
    /// Weight of the new acceleration in the positions.
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 1.0,
        "x-next" = "0.25 is the average acceleration; beta = gamma/2 or more is stable for every step"))]
    pub beta: f64,
    /// Weight of the new acceleration in the velocities.
    #[schemars(range(min = 0.5, max = 1.0),
        extend("x-next" = "0.5 does not damp, more damps, less would gain energy"))]
    pub gamma: f64,
}

impl Default for RawNewmark {
    fn default() -> Self {
        Self { beta: 0.25, gamma: 0.5 }
    }
}

/// Mass matrix.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RawMass {
    /// Diagonal.
    #[default]
    Lumped,
    /// As the shape functions give it.
    Consistent,
}

/// Remedy against locking of nearly incompressible material.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RawLocking {
    /// Full integration of everything.
    #[default]
    None,
    /// The volume change averaged around each node, per copy; for `tet4`. Next to `tet10` it is a remedy for
    /// speed: for the last percent near incompressibility take `tet10`, or `hex8` with `selective`.
    NodeAveraged,
    /// The volume change of each element's centre; for `hex8`.
    Selective,
}

/// Solver of a step.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawSolver {
    /// Linear solver. For solutions to round-off take `cholesky` with precision `double` and tolerance 1e-12; in
    /// equilibrium it also costs least where thin layers would take `pcg` hundreds of iterations.
    pub method: RawMethod,
    /// Most iterations of a linear solve; absent: several times what the size of the mesh and `poisson` call for.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1, max = 100000), extend("x-next" = "leave it out; 10 to 100 with fixed_iterations = true suits real time"))]
    pub iterations: Option<u32>,
    /// The iterations are a fixed number that is meant, as in real time: steps that end above the tolerance are
    /// counted, but neither warned of nor a failure of the run.
    pub fixed_iterations: bool,
    /// Stop when the preconditioned residual is below this part of that of the loads: after the linear solve where
    /// a step is one, after Newton's method otherwise. With 1e-4 positions are off by less than 0.1 % of the motion.
    #[schemars(extend("exclusiveMinimum" = 0.0, "exclusiveMaximum" = 1.0, "x-next" = "1e-3 for speed, 1e-6 for accuracy, 1e-10 with method cholesky and precision double"))]
    pub tolerance: f64,
    /// Arithmetic; absent: `single` where it can be and the tolerance allows, else `mixed`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub precision: Option<RawPrecision>,
    /// How single precision applies the stiffness; absent: what costs less, from measured costs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub operator: Option<RawOperator>,
    /// Most Newton steps per step of time; absent: 1 for linear and corotational bodies in motion (2 with
    /// newmark), 100 for static ones, else 20.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1, max = 1000), extend("x-next" = "1 for speed, 20 for accuracy"))]
    pub newton_steps: Option<u32>,
}

impl Default for RawSolver {
    fn default() -> Self {
        Self {
            method: RawMethod::Pcg,
            iterations: None,
            fixed_iterations: false,
            tolerance: 1e-4,
            precision: None,
            operator: None,
            newton_steps: None,
        }
    }
}

/// How the stiffness is applied to a vector.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RawOperator {
    /// Element by element, from rotated gradients.
    MatrixFree,
    /// From a matrix of 3×3 blocks.
    Assembled,
}

/// Linear solver.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RawMethod {
    /// Conjugate gradients without preconditioner.
    Cg,
    /// Conjugate gradients with block-Jacobi preconditioner.
    #[default]
    Pcg,
    /// Sparse factorisation.
    Cholesky,
    /// Matrix-free, with integrator static: so many iterations per step, going on where the last ended.
    Relaxation,
    /// Not supported yet.
    Multigrid,
    /// Not supported yet.
    MgPcg,
}

/// Arithmetic of a step. State and sums are in double precision always.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RawPrecision {
    /// Forces and solver in single precision: the fast path.
    Single,
    /// Residuals in double precision, solver in single precision with iterative refinement.
    Mixed,
    /// Everything in double precision.
    Double,
}
