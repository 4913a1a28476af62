//! What the mechanics of each body are made of, and what they cost.

use scindo_physics::body::{Arithmetic, OperatorChoice};

use super::{Plan, count};
use crate::body::BodySize;
use crate::scene::raw::{RawCycle, RawElement, RawIntegrator, RawLaw, RawLocking, RawMass, RawMethod};
use crate::scene::{BodySpec, CheckedScene, Mechanics};

/// General path, seconds per quadrature point for energy and forces.
const POINT_FORCES: f64 = 150e-9;

/// General path, seconds per quadrature point and node for the tangent.
const POINT_TANGENT: f64 = 400e-9;

/// General path, seconds per solver iteration and 3×3 block of a row, times the blocks of a node.
const BLOCK_ITERATION: f64 = 6e-9;

/// Iterations of the general path that take the residual down to a tenth.
const ITERATIONS_PER_DECADE: f64 = 45.0;

/// Seconds per row and its blocks squared for a factorisation, a coarse guess.
const FACTOR_ROW: f64 = 20e-9;

impl Plan {
    pub(super) fn mechanics(&mut self, scene: &CheckedScene, sizes: &[BodySize]) {
        for (body, size) in scene.bodies.iter().zip(sizes) {
            let why = describe(&body.mechanics, size);
            self.push(&format!("deformation {}", body.id), true, why, seconds(&body.mechanics, size));
        }
        let moving = |body: &&BodySpec| body.mechanics.integrator != RawIntegrator::Static;
        let of = |wanted: &dyn Fn(&&BodySpec) -> bool| scene.bodies.iter().filter(wanted).count();
        let inertia = of(&moving);
        let why = format!("{} in motion, {} static", count(inertia, "body"), scene.bodies.len() - inertia);
        self.push("inertia", inertia > 0, why, 0.0);
        let turning = of(&|body| body.mechanics.law != RawLaw::Linear);
        let why = format!("{} with a law for large rotations", count(turning, "body"));
        self.push("large rotation", turning > 0, why, 0.0);
        let damped = of(&|b| b.damping_mass_1_s > 0.0 || b.damping_stiffness_s > 0.0);
        let why = if damped > 0 {
            format!("{} with Rayleigh damping", count(damped, "body"))
        } else {
            "no body has Rayleigh damping".into()
        };
        self.push("damping", damped > 0, why, 0.0);
        let remedies = of(&|body| body.mechanics.locking != RawLocking::None);
        let why = if remedies > 0 {
            format!("{} with a locking remedy", count(remedies, "body"))
        } else {
            "no body has a locking remedy".into()
        };
        self.push("locking remedy", remedies > 0, why, 0.0);
        let estimate = scene.effects.error_estimate == Some(true);
        let why = if estimate { "effects.error_estimate = true" } else { "not requested" };
        let cost = sizes.iter().map(|size| size.elements as f64 * POINT_FORCES).sum();
        self.push("error estimate", estimate, why, cost);
    }
}

/// Law, element, integrator, solver, arithmetic, path and operator in a line.
fn describe(m: &Mechanics, size: &BodySize) -> String {
    let law = match m.law {
        RawLaw::Linear => "linear",
        RawLaw::Corotational => "corotational",
        RawLaw::Stvk => "St. Venant-Kirchhoff",
        RawLaw::NeoHookean => "Neo-Hookean",
    };
    let element = match m.element {
        RawElement::Tet4 => "tet4",
        RawElement::Tet10 => "tet10",
        RawElement::Hex8 => "hex8",
        RawElement::Octree => "octree",
    };
    let remedy = match m.locking {
        RawLocking::None => "",
        RawLocking::NodeAveraged => " with node-averaged volume",
        RawLocking::Selective => " with selective integration",
    };
    let integrator = match m.integrator {
        RawIntegrator::Static => "static".into(),
        RawIntegrator::SymplecticEuler => "symplectic Euler".into(),
        RawIntegrator::Midpoint => "midpoint".into(),
        RawIntegrator::Rk4 => "Runge-Kutta 4".into(),
        RawIntegrator::ImplicitEuler => "implicit Euler".into(),
        RawIntegrator::Bdf2 => "BDF2".into(),
        RawIntegrator::GeneralisedAlpha => "generalised-alpha".into(),
        RawIntegrator::Newmark => format!("Newmark {} {}", m.newmark.beta, m.newmark.gamma),
    };
    let steps = if m.sub_steps > 1 { format!(" in {} sub-steps", m.sub_steps) } else { String::new() };
    let mass = match m.mass {
        RawMass::Lumped => "",
        RawMass::Menouillard => ", mass after Menouillard",
        RawMass::Floored => ", floored mass",
        RawMass::Consistent => ", consistent mass",
    };
    // What the body will compute with, which the scene may have left open.
    let precision = match m.arithmetic() {
        Arithmetic::Single => "single",
        Arithmetic::Mixed => "mixed",
        Arithmetic::Double => "double",
    };
    let cycles = if m.cycle == RawCycle::W { "W-cycles" } else { "cycles" };
    let solver = match m.method {
        // An explicit step solves nothing, whatever method stands in the scene.
        _ if m.integrator.is_explicit() => "no solver".into(),
        RawMethod::Cholesky => format!("cholesky, {precision}"),
        RawMethod::Relaxation => {
            format!("relaxation, {} iterations to {:e}, {precision}", size.iterations, m.tolerance)
        }
        RawMethod::Cg => {
            format!("cg, at most {} iterations to {:e}, {precision}", size.iterations, m.tolerance)
        }
        RawMethod::Multigrid => {
            format!("multigrid, at most {} {cycles} to {:e}, {precision}", size.iterations, m.tolerance)
        }
        RawMethod::MgPcg => format!(
            "cg preconditioned by {}{}, at most {} iterations to {:e}, {precision}",
            if m.cycle == RawCycle::W { "W-cycles of multigrid" } else { "multigrid" },
            if m.method_is_default { " by default" } else { "" },
            size.iterations,
            m.tolerance
        ),
        RawMethod::TwoLevelPcg => format!(
            "cg preconditioned by block-jacobi and a coarse space, at most {} iterations to {:e}, {precision}",
            size.iterations, m.tolerance
        ),
        RawMethod::Pcg => {
            format!("pcg, at most {} iterations to {:e}, {precision}", size.iterations, m.tolerance)
        }
    };
    let path = if m.arithmetic() == Arithmetic::Single {
        let operator = match m.body_settings().operator(m.constitutive_law(), size.elements) {
            OperatorChoice::Assembled => "assembled",
            _ => "matrix-free",
        };
        match m.operator {
            // Cells are never assembled, so nobody chose.
            _ if m.body_settings().has_cells() => format!("fast path, {operator}"),
            Some(_) => format!("fast path, {operator}: set by the scene"),
            None => format!("fast path, {operator}: it costs less"),
        }
    } else if m.integrator.is_explicit() || m.method == RawMethod::Relaxation {
        "general path, forces only".into()
    } else {
        // If nothing else is in the way, it is the precision or a tolerance too fine for single precision.
        let why = m.why_general().unwrap_or("the chosen precision");
        format!("general path for {why}, assembled")
    };
    let elements = size.elements;
    format!("{elements} {element}{remedy}, {law}; {integrator}{steps}{mass}; {solver}; {path}")
}

/// Predicted seconds per step of the world.
fn seconds(m: &Mechanics, size: &BodySize) -> f64 {
    f64::from(m.sub_steps) * seconds_of_one(m, size)
}

fn seconds_of_one(m: &Mechanics, size: &BodySize) -> f64 {
    let elements = size.elements as f64;
    if m.arithmetic() == Arithmetic::Single {
        return m.body_settings().fast_seconds(m.constitutive_law(), size.elements);
    }
    let (points, nodes_of_element, blocks_of_row) = match (m.element, m.locking) {
        (RawElement::Tet4, RawLocking::NodeAveraged) => (2.0, 4.0, 60.0),
        (RawElement::Tet4, _) => (1.0, 4.0, 14.0),
        (RawElement::Tet10, _) => (4.0, 10.0, 28.0),
        (RawElement::Hex8 | RawElement::Octree, _) => (8.0, 8.0, 27.0),
    };
    let forces = elements * points * POINT_FORCES;
    let evaluations = match m.integrator {
        RawIntegrator::Rk4 => 4.0,
        RawIntegrator::Midpoint => 2.0,
        _ => 1.0,
    };
    if m.integrator.is_explicit() {
        return evaluations * forces;
    }
    if m.method == RawMethod::Relaxation {
        return 2.0 * f64::from(size.iterations) * forces;
    }
    let rows = size.nodes as f64;
    let solve = if m.method == RawMethod::Cholesky {
        rows * rows.powf(2.0 / 3.0) * FACTOR_ROW * 9.0
    } else {
        let made = f64::from(size.iterations).min(-ITERATIONS_PER_DECADE * m.tolerance.log10());
        made * rows * blocks_of_row * BLOCK_ITERATION
    };
    let tangent = elements * points * nodes_of_element * POINT_TANGENT;
    let easy = matches!(m.law, RawLaw::Linear | RawLaw::Corotational);
    // Most steps of time need no more than three Newton steps.
    let newton = if m.newton_steps == Some(1) || (m.newton_steps.is_none() && easy) { 1.0 } else { 3.0 };
    newton * (tangent + 2.0 * forces + solve)
}
