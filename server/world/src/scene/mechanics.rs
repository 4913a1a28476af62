//! How a body is computed: the words of a scene, and the settings of a body that they stand for.

use scindo_physics::body::{
    Arithmetic, BodySettings, CuttingMethod, CycleShape, ElementKind, FrontRule, LooseRule, MassKind, Method,
    OperatorChoice, PcgSettings, Scheme, Volumetric,
};
use scindo_physics::cut::remesh::{Moves, SnapSettings};
use scindo_physics::material::{Fibres, Law, Prony};

use super::raw::{
    RawCutMethod, RawCycle, RawElement, RawFront, RawIntegrator, RawLaw, RawLocking, RawLoose, RawMass,
    RawMethod, RawMoves, RawOperator, RawPrecision,
};

/// Share of the volumetric energy that node averaging leaves with the elements, against checkerboards.
const KEPT: f64 = 0.05;

/// Iterations per node along the longest way through the mesh that a linear solve is allowed where the scene
/// does not say. Solves to 1e-4 were measured to take 7 to 20 at ν = 0.35 to 0.45, to 1e-6 up to 25.
const ITERATIONS_PER_NODE: f64 = 60.0;

/// Bounds of that: small meshes are cheap, and nobody waits for more.
const ITERATIONS: [f64; 2] = [500.0, 20_000.0];

/// Iterations of relaxation per step: it goes on in the next one.
const RELAXATION: u32 = 50;

/// How a body is computed: a combination that goes together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mechanics {
    /// Finite element.
    pub element: RawElement,
    /// Whether a mesh of hexahedra consists of equal cubes, which the fast path takes.
    pub cubes: bool,
    /// Constitutive law.
    pub law: RawLaw,
    /// Families of fibres.
    pub fibres: Fibres,
    /// Terms of a Prony series.
    pub prony: Prony,
    /// Whether a load is a pressure.
    pub pressed: bool,
    /// Time integration.
    pub integrator: RawIntegrator,
    /// Steps that the body makes in each step of the world.
    pub sub_steps: u32,
    /// Most stable steps that an explicit integrator may divide a step into.
    pub most_stable_steps: Option<u32>,
    /// What a step of generalised-α leaves of the fastest oscillations.
    pub spectral_radius: Option<f64>,
    /// Parameters of Newmark's method, used by it alone.
    pub newmark: Newmark,
    /// Mass matrix.
    pub mass: RawMass,
    /// Remedy against locking.
    pub locking: RawLocking,
    /// Linear solver.
    pub method: RawMethod,
    /// Whether the scene leaves the linear solver open.
    pub method_is_default: bool,
    /// Arithmetic; none: as the other settings allow.
    pub precision: Option<RawPrecision>,
    /// Most Newton steps per step of time; none: as law and integrator call for.
    pub newton_steps: Option<u32>,
    /// How single precision applies the stiffness; `None`: what costs less.
    pub operator: Option<RawOperator>,
    /// Shape of the cycles of multigrid.
    pub cycle: RawCycle,
    /// Most iterations of a linear solve; none: as the mesh calls for.
    pub iterations: Option<u32>,
    /// Whether so many iterations are meant, whatever residual they leave.
    pub fixed_iterations: bool,
    /// Relative preconditioned residual at which the solver stops.
    pub tolerance: f64,
    /// How cuts are made.
    pub cutting: RawCutMethod,
    /// How far a cut goes on ahead of the blade; none: as by default.
    pub front: Option<RawFront>,
    /// Which nodes cuts along faces move.
    pub moves: RawMoves,
    /// Whether cuts along faces remove degenerate elements.
    pub clean: bool,
    /// What becomes of parts without a held node.
    pub loose: RawLoose,
}

/// What generalised-α leaves of the fastest oscillations unless the scene says otherwise.
const SPECTRAL_RADIUS: f64 = 0.8;

/// Parameters of Newmark's method.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Newmark {
    /// β, weight of the new acceleration in the positions.
    pub beta: f64,
    /// γ, weight of the new acceleration in the velocities.
    pub gamma: f64,
}

impl Mechanics {
    /// What keeps the body from the fast path, which runs in single precision; none if nothing does.
    pub fn why_general(&self) -> Option<&'static str> {
        self.body_settings().why_general(self.constitutive_law())
    }

    /// With the linear solver that suits it, if the scene leaves it open: multigrid where octree cells take the
    /// fast path.
    pub(super) fn with_method(self) -> Self {
        let with_multigrid = Self { method: RawMethod::MgPcg, ..self };
        let multigrid = self.method_is_default
            && self.element == RawElement::Octree
            && with_multigrid.arithmetic() == Arithmetic::Single
            && with_multigrid.why_general().is_none();
        if multigrid { with_multigrid } else { self }
    }

    /// Whether an equilibrium is approached by relaxation, step after step.
    pub fn relaxes(&self) -> bool {
        self.method == RawMethod::Relaxation
    }

    /// The arithmetic that is used: single where it can be and the tolerance allows, else mixed;
    /// double without a solver.
    pub fn arithmetic(&self) -> Arithmetic {
        self.body_settings().arithmetic(self.constitutive_law())
    }

    /// When the solver of a step stops, in a mesh with so many nodes along the longest way through it.
    pub fn linear_solver(&self, nodes_along: f64, poisson: f64) -> PcgSettings {
        // The condition number grows with the bulk modulus over the shear modulus, and iterations with its root.
        let wanted = ITERATIONS_PER_NODE * nodes_along / (1.0 - 2.0 * poisson).max(1e-3).sqrt();
        let limit = match self.method {
            RawMethod::Relaxation => RELAXATION,
            _ => wanted.clamp(ITERATIONS[0], ITERATIONS[1]).round() as u32,
        };
        PcgSettings { iterations: self.iterations.unwrap_or(limit), tolerance: self.tolerance }
    }

    /// The law as the physics knows it.
    pub fn constitutive_law(&self) -> Law {
        match self.law {
            RawLaw::Linear => Law::Linear,
            RawLaw::Corotational => Law::Corotational,
            RawLaw::Stvk => Law::StVenantKirchhoff,
            RawLaw::NeoHookean => Law::NeoHookean,
        }
    }

    /// All settings of a body, with as many iterations as any mesh may have; threads and instructions as by default.
    pub fn body_settings(&self) -> BodySettings {
        BodySettings {
            // No mesh is known here; who has one takes the limit of iterations that suits it.
            solver: self.linear_solver(f64::INFINITY, 0.0),
            element: match self.element {
                RawElement::Tet4 => ElementKind::Tet4,
                RawElement::Tet10 => ElementKind::Tet10,
                RawElement::Hex8 => ElementKind::Hex8,
                RawElement::Octree => ElementKind::Octree,
            },
            cubes: self.element == RawElement::Hex8 && self.cubes,
            fibres: self.fibres,
            prony: self.prony,
            pressed: self.pressed,
            volumetric: match self.locking {
                RawLocking::None => Volumetric::Full,
                RawLocking::NodeAveraged => Volumetric::NodeAveraged { kept: KEPT },
                RawLocking::Selective => Volumetric::Selective,
            },
            scheme: match self.integrator {
                RawIntegrator::Static => Scheme::Static,
                RawIntegrator::SymplecticEuler => Scheme::SymplecticEuler,
                RawIntegrator::Midpoint => Scheme::Midpoint,
                RawIntegrator::Rk4 => Scheme::Rk4,
                RawIntegrator::ImplicitEuler => Scheme::ImplicitEuler,
                RawIntegrator::Bdf2 => Scheme::Bdf2,
                RawIntegrator::GeneralisedAlpha => Scheme::GeneralisedAlpha {
                    spectral_radius: self.spectral_radius.unwrap_or(SPECTRAL_RADIUS),
                },
                RawIntegrator::Newmark => {
                    Scheme::Newmark { beta: self.newmark.beta, gamma: self.newmark.gamma }
                }
            },
            mass: match self.mass {
                RawMass::Lumped => MassKind::Lumped,
                RawMass::Menouillard => MassKind::Menouillard,
                RawMass::Floored => MassKind::Floored,
                RawMass::Consistent => MassKind::Consistent,
            },
            method: match self.method {
                RawMethod::Cg => Method::Cg,
                RawMethod::Cholesky => Method::Cholesky,
                // Relaxation is conjugate gradients, too, that go on from step to step.
                RawMethod::Pcg | RawMethod::Relaxation => Method::Pcg,
                RawMethod::TwoLevelPcg => Method::TwoLevelPcg,
                RawMethod::Multigrid => Method::Multigrid,
                RawMethod::MgPcg => Method::MgPcg,
            },
            cycle: match self.cycle {
                RawCycle::V => CycleShape::V,
                RawCycle::W => CycleShape::W,
            },
            relaxation: self.method == RawMethod::Relaxation,
            // Left open, it follows from law, scheme and tolerance.
            arithmetic: self.precision.map(|precision| match precision {
                RawPrecision::Single => Arithmetic::Single,
                RawPrecision::Mixed => Arithmetic::Mixed,
                RawPrecision::Double => Arithmetic::Double,
            }),
            operator: match self.operator {
                None => OperatorChoice::Auto,
                Some(RawOperator::MatrixFree) => OperatorChoice::MatrixFree,
                Some(RawOperator::Assembled) => OperatorChoice::Assembled,
            },
            newton_steps: self.newton_steps,
            most_substeps: self.most_stable_steps.unwrap_or(BodySettings::default().most_substeps),
            cutting: match self.cutting {
                // An octree has no other method.
                RawCutMethod::Xfem | RawCutMethod::Links => CuttingMethod::Xfem,
                RawCutMethod::Snap => CuttingMethod::Snap,
                RawCutMethod::Subdivide => CuttingMethod::Subdivide,
                RawCutMethod::Remove => CuttingMethod::Remove,
            },
            front: match self.front {
                None | Some(RawFront::Behind) => FrontRule::Behind,
                Some(RawFront::Calibrated) => FrontRule::Calibrated,
            },
            snap: SnapSettings {
                moves: match self.moves {
                    RawMoves::None => Moves::None,
                    RawMoves::Sound => Moves::Sound,
                    RawMoves::Press => Moves::Press,
                },
                clean: self.clean,
            },
            loose: match self.loose {
                RawLoose::Free => LooseRule::Free,
                RawLoose::Pinned => LooseRule::Pinned,
            },
            ..BodySettings::default()
        }
    }
}
