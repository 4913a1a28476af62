//! Every integrator at its order in Δt, on a smooth vibration with large rotations, against a reference
//! that is far more accurate.

use scindo_physics::integrator::{DynamicsSettings, MassKind, Scheme};
use scindo_physics::material::{Law, Material, Rayleigh};
use scindo_physics::solver::Precision;

use crate::bodies::{Run, V, accurate, held_at_zero, material, tet_box};

/// End of every run [s]: a tenth of the slowest period.
const END: f64 = 0.05;

/// A clamped beam that starts with a velocity in the shape of its first bending mode.
fn vibrating(material: Material, settings: DynamicsSettings) -> Run {
    let model = tet_box([0.2, 0.05, 0.05], [4, 1, 1], &material);
    let fixed = held_at_zero(&model, 0);
    let mut run = Run::new(model, material, settings);
    for (v, x) in run.state.v.iter_mut().zip(&run.state.x) {
        *v = V::new(0.0, 25.0, 10.0) * x.x * x.x;
    }
    run.fixed = fixed;
    run.gravity = V::new(0.0, 0.0, -9.81);
    run
}

fn end(material: Material, scheme: Scheme, mass: MassKind, steps: usize) -> (Vec<V>, Vec<V>) {
    let mut run = vibrating(material, accurate(scheme, mass));
    assert!(accurate(scheme, mass).newton.linear.precision == Precision::Double);
    run.steps(END / steps as f64, steps);
    let off = run.reports.iter().filter(|r| r.scheme != scheme).count();
    assert!(off <= usize::from(scheme == Scheme::Bdf2), "{scheme:?} left its scheme {off} times");
    assert!(run.reports.iter().all(|r| r.substeps == 1), "{:?}", run.reports[0]);
    (run.state.x, run.state.v)
}

fn distance((x, v): &(Vec<V>, Vec<V>), (y, w): &(Vec<V>, Vec<V>)) -> f64 {
    let norm = |a: &[V], b: &[V]| a.iter().zip(b).map(|(a, b)| (a - b).norm_squared()).sum::<f64>().sqrt();
    norm(x, y) + 0.01 * norm(v, w)
}

/// Observed order over the last halving of the step.
fn order(material: Material, scheme: Scheme, mass: MassKind, steps: [usize; 3], expected: f64) {
    let reference = end(material, Scheme::Rk4, mass, 800);
    let errors = steps.map(|n| distance(&end(material, scheme, mass, n), &reference));
    let orders = [errors[0] / errors[1], errors[1] / errors[2]].map(f64::log2);
    println!(
        "{} {:?} {mass:?}: errors {:.2e} {:.2e} {:.2e}, orders {orders:.3?}",
        scheme.name(),
        material.law,
        errors[0],
        errors[1],
        errors[2],
    );
    assert!((orders[1] - expected).abs() < 0.12, "{} has order {orders:?}, not {expected}", scheme.name());
}

fn soft(law: Law) -> Material {
    material(law, 2e4, 0.3, 1000.0)
}

const ALPHA: Scheme = Scheme::GeneralisedAlpha { spectral_radius: 0.8 };

#[test]
fn explicit_schemes_have_their_order() {
    for law in [Law::Corotational, Law::NeoHookean] {
        order(soft(law), Scheme::SymplecticEuler, MassKind::Lumped, [50, 100, 200], 1.0);
        // Shorter, since it amplifies the fastest oscillations of the mesh.
        order(soft(law), Scheme::Midpoint, MassKind::Lumped, [150, 300, 600], 2.0);
        order(soft(law), Scheme::Rk4, MassKind::Lumped, [25, 50, 100], 4.0);
    }
}

#[test]
fn implicit_schemes_have_their_order() {
    for law in [Law::Corotational, Law::NeoHookean] {
        order(soft(law), Scheme::ImplicitEuler, MassKind::Lumped, [100, 200, 400], 1.0);
        order(soft(law), Scheme::Bdf2, MassKind::Lumped, [50, 100, 200], 2.0);
        order(soft(law), Scheme::AVERAGE_ACCELERATION, MassKind::Lumped, [50, 100, 200], 2.0);
        order(soft(law), ALPHA, MassKind::Lumped, [50, 100, 200], 2.0);
    }
}

#[test]
fn orders_hold_with_consistent_mass_and_damping() {
    let damped =
        Material { rayleigh: Rayleigh { mass_1_s: 0.5, stiffness_s: 1e-3 }, ..soft(Law::Corotational) };
    order(damped, Scheme::Rk4, MassKind::Consistent, [25, 50, 100], 4.0);
    order(damped, Scheme::AVERAGE_ACCELERATION, MassKind::Consistent, [50, 100, 200], 2.0);
    order(damped, ALPHA, MassKind::Consistent, [50, 100, 200], 2.0);
    order(damped, Scheme::Bdf2, MassKind::Lumped, [50, 100, 200], 2.0);
}

/// Newmark with γ > ½ is of first order, as it should be.
#[test]
fn a_dissipative_newmark_has_order_one() {
    let scheme = Scheme::Newmark { beta: 0.3025, gamma: 0.6 };
    order(soft(Law::Corotational), scheme, MassKind::Lumped, [50, 100, 200], 1.0);
}
