//! Keys that say how a body is computed: element, law, integrator, mass, locking, solver.

use schemars::JsonSchema;
use scindo_physics::material::Material;
use serde::{Deserialize, Serialize};

/// Finite element.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RawElement {
    /// Linear tetrahedron. It can be cut anywhere.
    #[default]
    Tet4,
    /// Quadratic tetrahedron, for accuracy. It can be cut anywhere, and is computed in double precision.
    Tet10,
    /// Trilinear hexahedron, which is not cut. It needs the pattern `hex`. A box of equal cubes takes the kernels of octree cells.
    Hex8,
    /// Cubes on an adaptive octree, for very fine cuts along the links between them. It fills a `box`, a
    /// `surface` or an `organ`.
    Octree,
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
    /// St. Venant–Kirchhoff while every principal stretch is above 0.65. Below, where that law loses its
    /// resistance, it is modified so that it resists inversion.
    Stvk,
    /// The stable Neo-Hookean law of Smith, de Goes and Kim (2018). It equals the classical law for small
    /// strains and stays finite when an element inverts. A guard prevents collapse.
    NeoHookean,
}

/// Rayleigh damping, D = mass_1_s M + stiffness_s K.
#[derive(Debug, Clone, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawRayleigh {
    /// Coefficient of the mass matrix [1/s]. It damps all motion, rigid motion included.
    #[schemars(extend("minimum" = *Material::MASS_1_S.start(), "maximum" = *Material::MASS_1_S.end(),
        "x-next" = "0 switches it off"))]
    pub mass_1_s: f64,
    /// Coefficient of the stiffness matrix [s]. It damps deformation, but not rigid motion.
    #[schemars(extend("minimum" = *Material::STIFFNESS_S.start(), "maximum" = *Material::STIFFNESS_S.end(),
        "x-next" = "0 switches it off"))]
    pub stiffness_s: f64,
}

/// A time integration scheme.
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
    /// Second order, implicit, damps fast oscillations alone.
    GeneralisedAlpha,
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
    /// β, the weight of the new acceleration in the displacements.
    #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 1.0,
        "x-next" = "0.25 is the average acceleration method; beta = gamma/2 or more is stable for every step"))]
    pub beta: f64,
    /// γ, the weight of the new acceleration in the velocities.
    #[schemars(range(min = 0.5, max = 1.0),
        extend("x-next" = "0.5 adds no damping, larger values damp, smaller ones would gain energy"))]
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
    /// Diagonal. With an explicit integrator it is that of `menouillard`.
    #[default]
    Lumped,
    /// Diagonal: every piece of a cut element divides its mass evenly among its nodes. Thin pieces then do not shorten
    /// the stable step of explicit integrators. Only for `tet4`.
    Menouillard,
    /// Diagonal by the integrals of the shape functions, but at least half of what `menouillard` gives. The stable step
    /// is at least 0.7 of that before the cut; nodes of thin pieces become heavier than they are. Only for `tet4`.
    Floored,
    /// Integrated from the shape functions.
    Consistent,
}

/// Remedy for volumetric locking of nearly incompressible material.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RawLocking {
    /// Full integration of everything.
    #[default]
    None,
    /// The volume change is averaged around each node copy. For `tet4`. It is the fast remedy; for the last
    /// percent of accuracy, take `tet10`, or `hex8` with `selective`.
    NodeAveraged,
    /// The volume change is evaluated at the centre of each element. For `hex8`.
    Selective,
}

/// Settings of the solver.
#[derive(Debug, Clone, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawSolver {
    /// Linear solver. Default: `mg-pcg` for `octree` where law, integrator and precision allow it, otherwise
    /// `pcg`. Bodies of tetrahedra whose steps take more than some fifty iterations are faster with
    /// `two-level-pcg`. For a solution to round-off, take `cholesky` with precision `double` and tolerance
    /// 1e-12. It is also the fastest for equilibria with thin layers, where `pcg` needs hundreds of
    /// iterations.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub method: Option<RawMethod>,
    /// Order in which `mg-pcg` and `multigrid` go through their levels. A W-cycle works twice on every coarse
    /// level: each takes 1.3 to 1.9 times as long, and equilibria of bodies that are cut into many rods or
    /// slices need far fewer.
    pub cycle: RawCycle,
    /// Maximum number of iterations of a linear solve. Default: several times an estimate from the size of
    /// the mesh and `poisson`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1, max = 100000), extend("x-next" = "leave it out; 10 to 100 with fixed_iterations = true suits real time"))]
    pub iterations: Option<u32>,
    /// Whether the limit of iterations is deliberate, as in real time. Steps that end above the tolerance are
    /// then counted, but they cause no warning and no failed run.
    pub fixed_iterations: bool,
    /// Relative tolerance: the solver stops when the preconditioned residual is below this fraction of that
    /// of the loads. It is measured after the linear solve if a step is a single one, otherwise after
    /// Newton's method. With 1e-4, positions deviate by less than 0.1 % of the motion.
    #[schemars(extend("exclusiveMinimum" = 0.0, "exclusiveMaximum" = 1.0, "x-next" = "1e-3 for speed, 1e-6 for accuracy, 1e-10 with method cholesky and precision double"))]
    pub tolerance: f64,
    /// Floating-point precision. Default: `single` if the other settings and the tolerance allow it,
    /// otherwise `mixed`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub precision: Option<RawPrecision>,
    /// How the stiffness is applied in single precision. Default: the faster of the two by measured costs.
    /// Cells of an `octree`, and of a `hex8` box of equal cubes, have no matrix.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub operator: Option<RawOperator>,
    /// Maximum number of Newton iterations per time step. Default: 1 for linear and corotational bodies in
    /// motion (2 with `newmark`), 100 for static bodies, otherwise 20.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1, max = 1000), extend("x-next" = "1 for speed, 20 for accuracy"))]
    pub newton_steps: Option<u32>,
}

impl Default for RawSolver {
    fn default() -> Self {
        Self {
            method: None,
            cycle: RawCycle::V,
            iterations: None,
            fixed_iterations: false,
            tolerance: 1e-4,
            precision: None,
            operator: None,
            newton_steps: None,
        }
    }
}

/// Order in which a cycle of multigrid goes through its levels.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RawCycle {
    /// Down to the coarsest level and up again.
    #[default]
    V,
    /// From every level twice down to the next one.
    W,
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
    /// Conjugate gradients with a two-level preconditioner, block-Jacobi and a coarse space, for `tet4`. Iterations
    /// hardly depend on the mesh, the stiffness and the step.
    TwoLevelPcg,
    /// Sparse factorisation.
    Cholesky,
    /// Matrix-free static relaxation, for the integrator `static`. Each step makes a fixed number of
    /// iterations and continues where the last one ended.
    Relaxation,
    /// Multigrid cycles on the levels of an `octree`.
    Multigrid,
    /// Conjugate gradients with one multigrid cycle as preconditioner, for `octree`.
    MgPcg,
}

/// Floating-point precision of a step. State and sums are always in double precision.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RawPrecision {
    /// Forces and solver in single precision (the fast path).
    Single,
    /// Residuals in double precision, solver in single precision with iterative refinement.
    Mixed,
    /// Everything in double precision.
    Double,
}
