//! Contacts and grabs: force and motion come from the same solve.

use nalgebra::Vector3;
use scindo_physics::body::{Body, PointSpring, SpringKind};
use scindo_physics::element::MaterialPoint;
use scindo_physics::material::{Material, Rayleigh};

use crate::{DOWN, SOFT, cube, settings};

/// One-sided springs under every node of the lowest layer.
fn floor(body: &Body, height: f64, stiffness_n_m: f64, max_force_n: f64) -> Vec<PointSpring> {
    let nodes = &body.tets().unwrap().mesh().nodes;
    (0..nodes.len())
        .filter(|&n| nodes[n].y == 0.0)
        .map(|n| PointSpring {
            point: MaterialPoint::new([(n as u32, 1.0)]),
            kind: SpringKind::OneSided { normal: Vector3::y(), offset_m: height },
            stiffness_n_m,
            max_force_n,
        })
        .collect()
}

#[test]
fn a_body_comes_to_rest_on_a_floor_that_carries_its_weight() {
    let damped = Material { rayleigh: Rayleigh { mass_1_s: 10.0, stiffness_s: 0.01 }, ..SOFT };
    let mut body = cube(3, damped, settings(100, 1e-6));
    let springs = floor(&body, -0.02, 200.0, 100.0);
    let mut before = body.momentum();
    for _ in 0..400 {
        let speed = body.momentum();
        body.step(0.01, DOWN, &springs);
        let push: Vector3<f64> = body.spring_forces().iter().sum();
        let drag = -10.0 * body.momentum();
        let balance = (body.momentum() - before) - 0.01 * (push + drag + body.total_mass() * DOWN);
        assert!(balance.norm() < 1e-9, "momentum is exchanged exactly: {balance} at {speed}");
        before = body.momentum();
        assert!(body.spring_forces().iter().all(|f| f.y >= -1e-9), "a floor does not pull");
    }
    let push: Vector3<f64> = body.spring_forces().iter().sum();
    let weight = body.total_mass() * DOWN;
    assert!((push + weight).norm() < 1e-5 * weight.norm(), "{push} {weight}");
}

#[test]
fn a_grab_pulls_no_harder_than_it_may() {
    let mut body = cube(3, SOFT, settings(100, 1e-6));
    let grab = PointSpring {
        point: MaterialPoint::in_tet(body.tets().unwrap().pieces()[40].copies, [0.25; 4]),
        kind: SpringKind::Hold { target_m: Vector3::new(0.05, 0.5, 0.05) },
        stiffness_n_m: 1000.0,
        max_force_n: 0.05,
    };
    let mut forces = Vec::new();
    for _ in 0..5 {
        let before = body.momentum();
        body.step(0.005, Vector3::zeros(), &[grab]);
        let f = body.spring_forces()[0];
        assert!((body.momentum() - before - 0.005 * f).norm() < 1e-10);
        forces.push(f.norm());
    }
    assert!(forces.iter().all(|&f| f <= 0.05 * (1.0 + 1e-9) && f > 0.049), "{forces:?}");
}

#[test]
fn a_soft_grab_moves_the_body_to_its_target() {
    let damped = Material { rayleigh: Rayleigh { mass_1_s: 5.0, stiffness_s: 0.01 }, ..SOFT };
    let mut body = cube(3, damped, settings(100, 1e-6));
    let target = Vector3::new(0.2, 0.1, 0.0);
    let copies = body.tets().unwrap().pieces()[40].copies;
    let kind = SpringKind::Hold { target_m: target };
    let grab = PointSpring {
        point: MaterialPoint::in_tet(copies, [0.25; 4]),
        kind,
        stiffness_n_m: 50.0,
        max_force_n: 100.0,
    };
    for _ in 0..600 {
        body.step(0.01, Vector3::zeros(), &[grab]);
    }
    let point: Vector3<f64> = copies.iter().map(|&c| 0.25 * body.positions()[c as usize]).sum();
    assert!((point - target).norm() < 1e-4);
}
