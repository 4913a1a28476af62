//! Momentum, energy and rigid motion.

use nalgebra::{Rotation3, Vector3};
use scindo_allocations::allocations;
use scindo_physics::body::{Body, BodySettings, CuttingMethod, ElementKind, Outcome};
use scindo_physics::cut::BladeSweep;
use scindo_physics::material::{Material, Rayleigh};
use scindo_physics::mesh::{BoxPattern, box_mesh};

use crate::{DOWN, SOFT, cube, hold_left, left_face, settings};

#[test]
fn a_body_in_free_fall_falls_with_g_and_does_not_deform() {
    let mut body = cube(4, SOFT, settings(10, 1e-6));
    let start = body.centre_of_mass();
    let (h, steps) = (0.02, 50);
    for _ in 0..steps {
        let report = body.step(h, DOWN, &[]);
        assert_eq!(report.outcome, Outcome::Advanced);
    }
    let n = f64::from(steps);
    let fallen = body.centre_of_mass() - start;
    let expected = h * h * n * (n + 1.0) / 2.0 * DOWN; // implicit Euler's sum
    assert!((fallen - expected).norm() < 1e-9 * expected.norm(), "{fallen} {expected}");
    assert!((body.momentum() - body.total_mass() * n * h * DOWN).norm() < 1e-9);
    let rest = body.rest_positions().to_vec();
    for (x, rest) in body.positions().iter().zip(rest) {
        assert!((x - rest - fallen).norm() < 1e-6 * 0.1);
    }
}

#[test]
fn a_rigidly_moved_body_feels_no_force() {
    let mut body = cube(3, SOFT, settings(50, 1e-6));
    let turn = Rotation3::new(Vector3::new(1.0, -2.0, 0.5));
    let far = Vector3::new(1000.0, -300.0, 50.0);
    let x: Vec<_> = body.positions().iter().map(|x| turn * x + far).collect();
    body.set_state(&x, &vec![Vector3::zeros(); x.len()]).unwrap();
    let scale = SOFT.young_pa * 0.1 * 0.1;
    assert!(body.internal_forces().iter().all(|f| f.norm() < 1e-10 * scale));
    assert!(body.elastic_energy() < 1e-12 * scale);
    for _ in 0..100 {
        body.step(0.01, Vector3::zeros(), &[]);
    }
    for (now, then) in body.positions().iter().zip(&x) {
        assert!((now - then).norm() < 1e-6 * 0.1, "single-precision kernels hold the shape to 1e-6");
    }
}

#[test]
fn total_momentum_is_kept_however_few_iterations_are_made() {
    let mut body = cube(4, SOFT, settings(3, 1e-9));
    let x: Vec<_> = body.positions().iter().map(|x| Vector3::new(1.3 * x.x, 0.9 * x.y, x.z)).collect();
    let v: Vec<_> = x.iter().map(|x| Vector3::new(0.3, x.x * 5.0, -0.2 * x.y)).collect();
    body.set_state(&x, &v).unwrap();
    let start = body.momentum();
    for _ in 0..200 {
        body.step(0.005, Vector3::zeros(), &[]);
    }
    assert!((body.momentum() - start).norm() < 1e-10 * start.norm());
}

#[test]
fn a_spinning_body_never_gains_energy() {
    for (omega, h) in [(10.0, 0.005), (10.0, 0.02), (40.0, 0.02), (40.0, 0.04)] {
        let mut body = cube(2, SOFT, settings(200, 1e-6));
        let centre = body.centre_of_mass();
        let x = body.positions().to_vec();
        let v: Vec<_> = x.iter().map(|x| Vector3::new(0.0, 0.0, omega).cross(&(x - centre))).collect();
        body.set_state(&x, &v).unwrap();
        let start = body.kinetic_energy();
        let mut before = body.angular_momentum().norm();
        for _ in 0..(2.0 / h) as usize {
            body.step(h, Vector3::zeros(), &[]);
            let energy = body.kinetic_energy() + body.elastic_energy();
            assert!(energy <= start * (1.0 + 1e-6), "ω {omega} h {h}: {energy} of {start}");
            let spin = body.angular_momentum().norm();
            assert!(spin <= before * (1.0 + 1e-4), "ω {omega} h {h}");
            before = spin;
        }
    }
}

#[test]
fn material_damping_leaves_rigid_motion_alone_and_drag_slows_it_exactly() {
    let viscous = Material { rayleigh: Rayleigh { mass_1_s: 0.0, stiffness_s: 0.1 }, ..SOFT };
    let (h, omega) = (0.002, 5.0);
    let spin_after = |material: Material| {
        let mut body = cube(3, material, settings(200, 1e-7));
        let centre = body.centre_of_mass();
        let x = body.positions().to_vec();
        let spin = |x: &Vector3<f64>| {
            Vector3::new(1.0, 0.0, 0.0) + Vector3::new(0.0, 0.0, omega).cross(&(x - centre))
        };
        let v: Vec<_> = x.iter().map(spin).collect();
        body.set_state(&x, &v).unwrap();
        for _ in 0..100 {
            body.step(h, Vector3::zeros(), &[]);
        }
        (body.angular_momentum().norm(), body.momentum().norm() / body.total_mass())
    };
    let ((plain, _), (damped, speed)) = (spin_after(SOFT), spin_after(viscous));
    assert!((damped / plain - 1.0).abs() < 0.01, "{damped} {plain}");
    assert!((speed - 1.0).abs() < 1e-9);
    let dragged = Material { rayleigh: Rayleigh { mass_1_s: 2.0, stiffness_s: 0.0 }, ..SOFT };
    let (_, speed) = spin_after(dragged);
    assert!((speed - (1.0 + 2.0 * h).powi(-100)).abs() < 1e-9);
}

#[test]
fn stretching_is_damped_by_the_material() {
    let energy_after = |beta: f64| {
        let rayleigh = Rayleigh { mass_1_s: 0.0, stiffness_s: beta };
        let mut body = cube(3, Material { rayleigh, ..SOFT }, settings(200, 1e-6));
        let x: Vec<_> = body.positions().iter().map(|x| Vector3::new(1.2 * x.x, x.y, x.z)).collect();
        body.set_state(&x, &vec![Vector3::zeros(); x.len()]).unwrap();
        for _ in 0..50 {
            body.step(0.0005, Vector3::zeros(), &[]);
        }
        body.kinetic_energy() + body.elastic_energy()
    };
    assert!(energy_after(0.002) < 0.5 * energy_after(0.0));
}

#[test]
fn weight_rests_on_the_clamp() {
    let mut body = cube(
        4,
        Material { rayleigh: Rayleigh { mass_1_s: 30.0, stiffness_s: 0.01 }, ..SOFT },
        settings(200, 1e-6),
    );
    let clamp = hold_left(&mut body);
    for _ in 0..400 {
        let report = body.step(0.01, DOWN, &[]);
        assert_eq!(report.outcome, Outcome::Advanced);
    }
    let weight = body.total_mass() * DOWN;
    let reaction = body.reaction(&clamp, DOWN);
    assert!((reaction + weight).norm() < 1e-4 * weight.norm(), "{reaction} {weight}");
    assert!(body.velocities().iter().all(|v| v.norm() < 1e-5));
    for &n in &clamp {
        assert_eq!(body.positions()[n as usize], body.tets().unwrap().mesh().nodes[n as usize]);
    }
}

#[test]
fn prescribed_surfaces_carry_a_homogeneous_strain_inside() {
    let mut body = cube(
        4,
        Material { rayleigh: Rayleigh { mass_1_s: 50.0, stiffness_s: 0.05 }, ..SOFT },
        settings(300, 1e-7),
    );
    let nodes = body.tets().unwrap().mesh().nodes.clone();
    let strain = |x: &Vector3<f64>| Vector3::new(0.1 * x.x + 0.05 * x.y, -0.02 * x.y, 0.03 * x.z);
    for (n, x) in nodes.iter().enumerate() {
        if x.iter().any(|&c| c == 0.0 || c == 0.1) {
            body.fix(&[n as u32], [true; 3], strain(x)).unwrap();
        }
    }
    for _ in 0..200 {
        body.step(0.01, Vector3::zeros(), &[]);
    }
    for (x, rest) in body.positions().iter().zip(&nodes) {
        assert!((x - rest - strain(rest)).norm() < 1e-7, "patch test to single precision");
    }
}

#[test]
fn loads_are_shared_and_their_total_is_kept() {
    let mut body = cube(3, SOFT, settings(20, 1e-6));
    let clamp = left_face(&body);
    let force = Vector3::new(0.3, -0.2, 0.1);
    body.add_surface_force(&clamp, force).unwrap();
    body.add_volume_force(&clamp, force).unwrap();
    body.add_nodal_force(5, force).unwrap();
    body.step(0.01, Vector3::zeros(), &[]);
    assert!((body.momentum() - 0.03 * force).norm() < 1e-12);
    assert!(body.add_surface_force(&[0, 1], force).is_err());
    assert!(body.add_nodal_force(9999, force).is_err());
    assert!(body.add_nodal_force(0, Vector3::repeat(f64::NAN)).is_err());
}

/// Shares act on their own loads, cuts keep them, and setting them allocates nothing.
#[test]
fn a_share_of_a_varying_load_acts() {
    for element in [ElementKind::Tet4, ElementKind::Tet10] {
        let mut body = cube(3, SOFT, BodySettings { element, ..settings(20, 1e-6) });
        let all: Vec<u32> = (0..body.n_nodes() as u32).collect();
        let [push, pull, lift] = [Vector3::x(), Vector3::y(), Vector3::z()];
        body.add_volume_force(&all, push).unwrap();
        body.add_varying_volume_force(&all, pull).unwrap();
        body.add_varying_surface_force(&all, lift).unwrap();
        let total = |body: &Body| body.loads().iter().sum::<Vector3<f64>>();
        assert!((total(&body) - (push + pull + lift)).norm() < 1e-12, "whole loads at first");
        let blade = |x: f64| [Vector3::new(x, 0.05, -0.01), Vector3::new(x, 0.05, 0.11)];
        for shares in [[0.0, 0.0], [0.25, -2.0], [1.0, 0.5]] {
            let before = allocations();
            body.set_load_shares(shares.into_iter());
            assert_eq!(allocations(), before);
            assert!((total(&body) - (push + shares[0] * pull + shares[1] * lift)).norm() < 1e-12);
            body.cut(&BladeSweep { segments: vec![blade(-0.01), blade(0.11)] }, 1).unwrap();
            assert!((total(&body) - (push + shares[0] * pull + shares[1] * lift)).norm() < 1e-12);
        }
        assert_eq!(body.parts().len(), 2);
        body.clear_loads();
        body.set_load_shares([1.0, 1.0].into_iter());
        assert_eq!(total(&body), Vector3::zeros());
    }
    let mut snap = cube(3, SOFT, BodySettings { cutting: CuttingMethod::Snap, ..settings(20, 1e-6) });
    let refused = snap.add_varying_volume_force(&[0], Vector3::x()).unwrap_err().to_string();
    assert!(refused.contains("a load that varies"), "{refused}");
}

#[test]
fn a_body_a_kilometre_away_moves_the_same() {
    let end = |origin: Vector3<f64>| {
        let pattern = BoxPattern::Tet5 { parity: true };
        let mesh = box_mesh(origin, origin + Vector3::new(0.3, 0.1, 0.1), [6, 2, 2], pattern);
        let mut body = Body::new(mesh, SOFT, settings(200, 1e-7)).unwrap();
        body.fix(&(0..63).step_by(7).collect::<Vec<u32>>(), [true; 3], Vector3::zeros()).unwrap();
        for _ in 0..50 {
            body.step(0.02, DOWN, &[]);
        }
        body.positions().iter().map(|x| x - origin).collect::<Vec<_>>()
    };
    let (near, far) = (end(Vector3::zeros()), end(Vector3::new(1000.0, -500.0, 300.0)));
    assert!(near[62].y < 0.098, "it droops");
    for (a, b) in near.iter().zip(&far) {
        assert!((a - b).norm() < 1e-4 * 0.3, "{a} {b}");
    }
}

#[test]
fn no_step_length_makes_energy() {
    for h in [1e-4, 1e-3, 5e-3, 2e-2, 4e-2, 0.1, 0.2] {
        let mut body = cube(2, SOFT, settings(300, 1e-6));
        let x: Vec<_> = body.positions().iter().map(|x| Vector3::new(1.4 * x.x, 0.8 * x.y, x.z)).collect();
        let v: Vec<_> = x.iter().map(|x| Vector3::new(0.0, 0.0, 5.0).cross(x)).collect();
        body.set_state(&x, &v).unwrap();
        let start = body.kinetic_energy() + body.elastic_energy();
        for _ in 0..60 {
            body.step(h, Vector3::zeros(), &[]);
            let energy = body.kinetic_energy() + body.elastic_energy();
            assert!(energy <= start * (1.0 + 1e-5), "h {h}: {energy} of {start}");
        }
    }
}
