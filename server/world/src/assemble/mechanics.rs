//! From the words of a scene to settings of a body.

use nalgebra::Vector3;
use scindo_physics::body::{
    Arithmetic, BodySettings, CuttingMethod, ElementKind, LooseRule, MassKind, Method, OperatorChoice,
    PcgSettings, Scheme, Volumetric,
};
use scindo_physics::material::Law;

use crate::scene::Mechanics;
use crate::scene::raw::{
    RawCutMethod, RawElement, RawIntegrator, RawLaw, RawLocking, RawLoose, RawMass, RawMethod, RawOperator,
    RawPrecision,
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

/// When the solver of a step stops, in a mesh with so many nodes along the longest way through it.
pub fn linear(m: &Mechanics, nodes_along: f64, poisson: f64) -> PcgSettings {
    // The condition number grows with the bulk modulus over the shear modulus, and iterations with its root.
    let wanted = ITERATIONS_PER_NODE * nodes_along / (1.0 - 2.0 * poisson).max(1e-3).sqrt();
    let limit = match m.method {
        RawMethod::Relaxation => RELAXATION,
        _ => wanted.clamp(ITERATIONS[0], ITERATIONS[1]).round() as u32,
    };
    PcgSettings { iterations: m.iterations.unwrap_or(limit), tolerance: m.tolerance }
}

/// Nodes along the longest way through a mesh of so many nodes in the box from `low` to `high` [m].
pub fn nodes_along([low, high]: [Vector3<f64>; 2], nodes: usize) -> f64 {
    let extent = high - low;
    let along = extent.amax() * (nodes as f64 / extent.product()).cbrt();
    // A flat mesh fills no volume; no way has more nodes than there are.
    if along.is_finite() { along.min(nodes as f64) } else { nodes as f64 }
}

/// The constitutive law.
pub fn law(m: &Mechanics) -> Law {
    match m.law {
        RawLaw::Linear => Law::Linear,
        RawLaw::Corotational => Law::Corotational,
        RawLaw::Stvk => Law::StVenantKirchhoff,
        RawLaw::NeoHookean => Law::NeoHookean,
    }
}

/// All settings of a body, with as many iterations as any mesh may have; threads and instructions as by default.
pub fn settings(m: &Mechanics) -> BodySettings {
    BodySettings {
        solver: linear(m, f64::INFINITY, 0.0),
        element: match m.element {
            RawElement::Tet4 => ElementKind::Tet4,
            RawElement::Tet10 => ElementKind::Tet10,
            RawElement::Hex8 => ElementKind::Hex8,
        },
        volumetric: match m.locking {
            RawLocking::None => Volumetric::Full,
            RawLocking::NodeAveraged => Volumetric::NodeAveraged { kept: KEPT },
            RawLocking::Selective => Volumetric::Selective,
        },
        scheme: match m.integrator {
            RawIntegrator::Static => Scheme::Static,
            RawIntegrator::SymplecticEuler => Scheme::SymplecticEuler,
            RawIntegrator::Midpoint => Scheme::Midpoint,
            RawIntegrator::Rk4 => Scheme::Rk4,
            RawIntegrator::ImplicitEuler => Scheme::ImplicitEuler,
            RawIntegrator::Bdf2 => Scheme::Bdf2,
            RawIntegrator::Newmark => Scheme::Newmark { beta: m.newmark.beta, gamma: m.newmark.gamma },
        },
        mass: match m.mass {
            RawMass::Lumped => MassKind::Lumped,
            RawMass::Consistent => MassKind::Consistent,
        },
        method: match m.method {
            RawMethod::Cg => Method::Cg,
            RawMethod::Cholesky => Method::Cholesky,
            // The others are refused before a body is made.
            RawMethod::Pcg | RawMethod::Relaxation | RawMethod::Multigrid | RawMethod::MgPcg => Method::Pcg,
        },
        relaxation: m.method == RawMethod::Relaxation,
        arithmetic: m.precision.map(|precision| match precision {
            RawPrecision::Single => Arithmetic::Single,
            RawPrecision::Mixed => Arithmetic::Mixed,
            RawPrecision::Double => Arithmetic::Double,
        }),
        operator: match m.operator {
            None => OperatorChoice::Auto,
            Some(RawOperator::MatrixFree) => OperatorChoice::MatrixFree,
            Some(RawOperator::Assembled) => OperatorChoice::Assembled,
        },
        newton_steps: m.newton_steps,
        cutting: match m.cutting {
            // Links are refused before a body is made.
            RawCutMethod::Xfem | RawCutMethod::Links => CuttingMethod::Xfem,
            RawCutMethod::Snap => CuttingMethod::Snap,
        },
        loose: match m.loose {
            RawLoose::Free => LooseRule::Free,
            RawLoose::Pinned => LooseRule::Pinned,
        },
        ..BodySettings::default()
    }
}
