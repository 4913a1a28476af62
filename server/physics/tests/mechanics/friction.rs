//! Dry friction: a block on an incline sticks below the critical angle and slides above it.

use nalgebra::Vector3;
use scindo_physics::body::{Arithmetic, Body, BodySettings, PointSpring, Scheme, SpringKind};
use scindo_physics::element::MaterialPoint;
use scindo_physics::material::{Material, Rayleigh};

use crate::{SOFT, cube, settings};

/// Coefficient of friction.
const MU: f64 = 0.5;
/// Length of a step [s].
const H: f64 = 0.01;

/// Stiff rough springs under every node of the lowest layer.
fn rough_floor(body: &Body) -> Vec<PointSpring> {
    let nodes = &body.tets().unwrap().mesh().nodes;
    let lowest = (0..nodes.len()).filter(|&n| nodes[n].y == 0.0);
    let spring = |n: usize| PointSpring {
        point: MaterialPoint::new([(n as u32, 1.0)]),
        kind: SpringKind::Rough {
            normal: Vector3::y(),
            offset_m: 0.0,
            anchor_m: nodes[n],
            friction: MU,
            tangential_n_m: 2000.0,
            grip_n: 0.0,
        },
        stiffness_n_m: 2000.0,
        max_force_n: 100.0,
    };
    lowest.map(spring).collect()
}

/// Steps a block under gravity that is tilted so that tan θ = `share` μ. Returns its speed and displacement along
/// the incline after every step.
fn slide(share: f64, steps: usize, of: BodySettings) -> Vec<(f64, f64)> {
    // Without numerical damping, contacts that have just closed chatter.
    let worst = if of.scheme == Scheme::ImplicitEuler { 1.05 } else { 1.5 };
    let damped = Material { rayleigh: Rayleigh { mass_1_s: 0.0, stiffness_s: 0.01 }, ..SOFT };
    let mut body = cube(3, damped, of);
    let angle = (share * MU).atan();
    let gravity = 9.81 * Vector3::new(angle.sin(), -angle.cos(), 0.0);
    let mut springs = rough_floor(&body);
    let start = body.centre_of_mass().x;
    (0..steps)
        .map(|_| {
            body.step(H, gravity, &springs);
            let mut total = [0.0; 2];
            for (spring, force) in springs.iter_mut().zip(body.spring_forces()) {
                spring.kind = spring.after(spring.point.position(body.positions()), *force);
                let SpringKind::Rough { normal, .. } = &spring.kind else { continue };
                let across = (force - force.dot(normal) * *normal).norm();
                let bound = MU * force.dot(normal).max(0.0);
                // The passes of a step end before the last percent where contacts have just closed.
                assert!(across <= worst * bound + 1e-4, "{across} > {bound} N");
                total = [total[0] + across, total[1] + bound];
            }
            assert!(total[0] <= (1.0 + 0.2 * (worst - 1.0)) * total[1] + 1e-9, "{total:?} N");
            (body.momentum().x / body.total_mass(), body.centre_of_mass().x - start)
        })
        .collect()
}

fn double() -> BodySettings {
    BodySettings { arithmetic: Some(Arithmetic::Double), ..settings(200, 1e-8) }
}

#[test]
fn a_block_sticks_below_the_critical_angle_without_creeping() {
    for of in [settings(100, 1e-6), double()] {
        let motion = slide(0.95, 600, of);
        let (settled, last) = (motion[300], motion[599]);
        assert!((last.1 - settled.1).abs() < 1e-9, "creeps: {settled:?} {last:?}");
        assert!(last.0.abs() < 1e-7, "{last:?}");
    }
}

#[test]
fn a_block_slides_above_the_critical_angle_as_coulomb_says() {
    let angle = (1.05 * MU).atan();
    let expected = 9.81 * (angle.sin() - MU * angle.cos());
    for of in [settings(100, 1e-6), double()] {
        let motion = slide(1.05, 600, of);
        let found = (motion[599].0 - motion[299].0) / (300.0 * H);
        assert!((found - expected).abs() < 0.01 * expected, "{found} {expected}");
    }
}

#[test]
fn friction_holds_with_a_second_order_scheme_too() {
    let motion = slide(0.9, 600, BodySettings { scheme: Scheme::Bdf2, ..settings(100, 1e-6) });
    assert!((motion[599].1 - motion[500].1).abs() < 1e-5, "{:?} {:?}", motion[500], motion[599]);
}
