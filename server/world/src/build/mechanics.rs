//! From the words of a scene to settings of a body.

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

/// When the solver of a step stops.
pub fn linear(m: &Mechanics) -> PcgSettings {
    PcgSettings { iterations: m.iterations, tolerance: m.tolerance }
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

/// All settings of a body; threads and instructions as by default.
pub fn settings(m: &Mechanics) -> BodySettings {
    BodySettings {
        solver: linear(m),
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
