//! What a cut must not change, and how fragments move.

use nalgebra::Vector3;
use scindo_physics::body::{Arithmetic, Body, BodySettings, Outcome, StaticSettings, StopReason};
use scindo_physics::cut::BladeSweep;
use scindo_physics::material::{Law, Material, Rayleigh};
use scindo_physics::mesh::{BoxPattern, box_mesh};

use crate::{DOWN, SOFT, cube, hold_left, settings, tumbling_blade};

/// A blade along z that sweeps the plane x = `at` through a body of 0.1 m.
fn slice(at: f64, from_y: f64, to_y: f64) -> BladeSweep {
    let segment = |y: f64| [Vector3::new(at, y, -0.5), Vector3::new(at, y, 0.5)];
    BladeSweep { segments: vec![segment(from_y), segment(to_y)] }
}

/// Per part: mass, centre of mass, momentum.
fn parts(body: &Body) -> Vec<(f64, Vector3<f64>, Vector3<f64>)> {
    let parts = body.parts();
    let mut sums = vec![(0.0, Vector3::zeros(), Vector3::zeros()); parts.len()];
    for (c, &part) in parts.of_copy.iter().enumerate() {
        let (m, x, v) = (body.masses()[c], body.positions()[c], body.velocities()[c]);
        let sum = &mut sums[part as usize];
        *sum = (sum.0 + m, sum.1 + m * x, sum.2 + m * v);
    }
    sums.iter().map(|(m, mx, p)| (*m, mx / *m, *p)).collect()
}

#[test]
fn a_cut_changes_neither_mass_nor_motion() {
    let mut body = cube(5, SOFT, settings(50, 1e-6));
    let x: Vec<_> = body.positions().iter().map(|x| Vector3::new(1.1 * x.x, x.y + 0.2 * x.x, x.z)).collect();
    let v: Vec<_> = x.iter().map(|x| Vector3::new(0.3, 5.0 * x.x, -2.0 * x.y)).collect();
    body.set_state(&x, &v).unwrap();
    let measure = |b: &Body| (b.total_mass(), b.centre_of_mass(), b.momentum(), b.angular_momentum());
    let energies = |b: &Body| (b.kinetic_energy(), b.elastic_energy());
    let (before, energy) = (measure(&body), energies(&body));
    for (incision, at) in [(1, 0.031), (2, 0.0671), (3, 0.04)] {
        let report = body.cut(&slice(at, -0.5, 0.5), incision).unwrap();
        assert!(!report.new_copies.is_empty(), "cut at {at}");
        let after = measure(&body);
        assert!((after.0 / before.0 - 1.0).abs() < 1e-12);
        assert!((after.1 - before.1).norm() < 1e-12 * 0.1);
        assert!((after.2 - before.2).norm() < 1e-12 * before.2.norm());
        assert!((after.3 - before.3).norm() < 1e-12 * before.3.norm().max(1e-3));
        assert!((energies(&body).0 / energy.0 - 1.0).abs() < 1e-12);
        assert!((energies(&body).1 / energy.1 - 1.0).abs() < 1e-12);
    }
    assert_eq!(body.parts().len(), 4);
}

#[test]
fn every_fragment_falls_with_g() {
    let mut body = cube(4, SOFT, settings(5, 1e-4));
    for (incision, at) in [(1, 0.0300001), (2, 0.0251), (3, 0.077)] {
        body.cut(&slice(at, -0.5, 0.5), incision).unwrap();
    }
    let start = parts(&body);
    assert_eq!(start.len(), 4);
    assert!(start.iter().any(|p| p.0 < 0.06 * body.total_mass()), "one fragment is a thin slice");
    let (h, steps) = (0.01, 40);
    for _ in 0..steps {
        body.step(h, DOWN, &[]);
    }
    let n = f64::from(steps);
    for (now, then) in parts(&body).iter().zip(&start) {
        let fallen = h * h * n * (n + 1.0) / 2.0 * DOWN;
        assert!((now.1 - then.1 - fallen).norm() < 1e-6 * fallen.norm());
        assert!((now.2 - now.0 * n * h * DOWN).norm() < 1e-6 * (now.0 * n * h * 9.81));
    }
}

#[test]
fn the_loose_half_falls_and_the_clamped_half_holds() {
    let damped = Material { rayleigh: Rayleigh { mass_1_s: 0.0, stiffness_s: 0.01 }, ..SOFT };
    let mut body = cube(4, damped, settings(100, 1e-5));
    hold_left(&mut body);
    body.cut(&slice(0.06, -0.5, 0.5), 1).unwrap();
    assert_eq!(body.parts().len(), 2);
    let start = parts(&body);
    for _ in 0..50 {
        body.step(0.01, DOWN, &[]);
    }
    let fallen: Vec<f64> = parts(&body).iter().zip(&start).map(|(now, then)| now.1.y - then.1.y).collect();
    let free = body.parts().free.iter().position(|f| *f).unwrap();
    let expected = 1e-4 * 50.0 * 51.0 / 2.0 * DOWN.y;
    assert!((fallen[free] / expected - 1.0).abs() < 1e-6, "{fallen:?}");
    assert!(fallen[1 - free].abs() < 0.01);
}

#[test]
fn a_cut_through_the_clamp_glues_nothing_to_air() {
    let mut body = cube(4, SOFT, settings(100, 1e-5));
    hold_left(&mut body);
    // Just beside the clamped face: the pieces beyond still span clamped nodes, but hold none.
    body.cut(&slice(0.004, -0.5, 0.5), 1).unwrap();
    let free: Vec<bool> = body.parts().free.clone();
    assert_eq!(free.iter().filter(|f| **f).count(), 1);
    let before = parts(&body);
    for _ in 0..20 {
        body.step(0.01, DOWN, &[]);
    }
    let after = parts(&body);
    let loose = free.iter().position(|f| *f).unwrap();
    assert!(after[loose].0 > 0.9 * body.total_mass());
    let expected = 1e-4 * 20.0 * 21.0 / 2.0 * DOWN.y;
    assert!(((after[loose].1 - before[loose].1).y / expected - 1.0).abs() < 1e-6);
}

/// After a cut exactly through a layer of nodes that ends in the clamp, both lips have the clamped nodes.
#[test]
fn a_cut_exactly_through_clamped_nodes_leaves_both_lips_clamped() {
    for general in [false, true] {
        let arithmetic = general.then_some(Arithmetic::Double);
        let settings = BodySettings { arithmetic, ..settings(200, 1e-5) };
        let mut body = cube(4, SOFT, settings);
        let rest = body.tets().unwrap().mesh().nodes.clone();
        let clamp: Vec<u32> = (0..rest.len() as u32).filter(|&n| rest[n as usize].y == 0.0).collect();
        body.fix(&clamp, [true; 3], Vector3::zeros()).unwrap();
        body.cut(&slice(0.05, -0.5, 0.5), 1).unwrap();
        assert_eq!((body.parts().len(), body.parts().free.contains(&true)), (2, false));
        for _ in 0..20 {
            body.step(0.01, DOWN, &[]);
        }
        let node = body.node_of_copy().to_vec();
        let copies: Vec<usize> = (0..node.len()).filter(|&c| rest[node[c] as usize].y == 0.0).collect();
        assert_eq!(copies.len(), 25 + 5);
        let moved = |c: &&usize| body.positions()[**c] != rest[node[**c] as usize];
        assert_eq!(copies.iter().filter(moved).count(), 0, "general: {general}");
    }
}

/// A cut along the first layer of nodes behind the clamp lets the body fall; a cut along the clamp itself
/// frees nothing.
#[test]
fn what_holds_no_clamped_node_falls() {
    let mut body = cube(4, SOFT, settings(200, 1e-5));
    hold_left(&mut body);
    body.cut(&slice(0.0, -0.5, 0.5), 1).unwrap();
    assert_eq!(body.parts().free, [false]);
    body.cut(&slice(0.025, -0.5, 0.5), 2).unwrap();
    assert_eq!((body.parts().len(), body.parts().free.iter().filter(|f| **f).count()), (2, 1));
}

#[test]
fn slivers_do_not_slow_the_solver_or_fly_away() {
    let iterations = |cut: Option<f64>| {
        let mut body = cube(6, SOFT, settings(500, 1e-4));
        hold_left(&mut body);
        if let Some(at) = cut {
            body.cut(&slice(at, -0.5, 0.05), 1).unwrap();
        }
        let mut most = 0;
        for _ in 0..100 {
            let report = body.step(0.02, DOWN, &[]);
            most = most.max(report.iterations);
            let fastest = body.velocities().iter().map(|v| v.norm()).fold(0.0, f64::max);
            assert!(fastest < 3.0, "cut at {cut:?}: {fastest} m/s");
        }
        most
    };
    let uncut = iterations(None);
    for distance in [1e-3, 1e-5, 1e-8, 1e-12] {
        let cut = iterations(Some(0.05 + distance));
        assert!(cut <= uncut * 3 / 2, "{cut} iterations beside a sliver of {distance} m, {uncut} uncut");
    }
}

#[test]
fn reset_heals_a_cut_and_keeps_the_clamp() {
    let mut body = cube(3, SOFT, settings(50, 1e-6));
    let clamp = hold_left(&mut body);
    let copies = body.n_copies();
    let report = body.cut(&slice(0.05, -0.5, 0.5), 1).unwrap();
    body.step(0.01, DOWN, &[]);
    body.reset().unwrap();
    assert_eq!((body.n_copies(), body.parts().len()), (copies, 1));
    assert!(body.epoch() > report.epoch);
    for _ in 0..10 {
        body.step(0.01, DOWN, &[]);
    }
    assert!(clamp.iter().all(|&n| body.positions()[n as usize].x == 0.0));
}

#[test]
fn a_refused_sweep_changes_nothing() {
    let mut body = cube(2, SOFT, settings(50, 1e-6));
    let epoch = body.epoch();
    assert!(body.cut(&BladeSweep { segments: vec![] }, 1).is_err());
    assert!(body.cut(&slice(f64::NAN, 0.0, 1.0), 1).is_err());
    assert_eq!(body.epoch(), epoch);
}

/// The half-cut beam, cut along a layer of nodes: the reference duplicates those nodes by hand.
#[test]
fn half_cut_beam_agrees_with_the_reference() {
    for (law, ux, uz, opening, energy) in [
        (Law::Linear, 0.102_672_4, 0.001_186_6, 0.004_325_1, 7.371_394_51e-2),
        (Law::Corotational, 0.087_318_3, -0.022_795_6, 0.003_160_6, 5.985_623_80e-2),
    ] {
        let mesh = box_mesh(
            Vector3::zeros(),
            Vector3::new(0.03, 0.06, 0.2),
            [6, 12, 40],
            BoxPattern::Tet5 { parity: false },
        );
        let nodes = mesh.nodes.clone();
        let clamp: Vec<u32> = (0..nodes.len() as u32).filter(|&n| nodes[n as usize].z == 0.0).collect();
        let material = Material {
            young_pa: 3e5,
            poisson: 0.35,
            density_kg_m3: 1070.0,
            rayleigh: Rayleigh::default(),
            law,
        };
        let mut body = Body::new(mesh, material, settings(10, 1e-3)).unwrap();
        body.fix(&clamp, [true; 3], Vector3::zeros()).unwrap();
        let segment = |x: f64| [Vector3::new(x, -0.01, 0.1), Vector3::new(x, 0.07, 0.1)];
        body.cut(&BladeSweep { segments: vec![segment(-0.01), segment(0.0151)] }, 1).unwrap();
        let report = body.solve_static(Vector3::new(9.81, 0.0, 0.0), &StaticSettings::default()).unwrap();
        assert!(report.converged, "{report:?}");
        let u = body.positions()[3685] - nodes[3685];
        let lips: Vec<Vector3<f64>> = (0..body.n_copies())
            .filter(|&c| {
                let rest = nodes[body.node_of_copy()[c] as usize];
                (rest - Vector3::new(0.0, 0.03, 0.1)).norm() < 1e-9
            })
            .map(|c| body.positions()[c])
            .collect();
        assert!((u.x - ux).abs() < 1e-6 && (u.z - uz).abs() < 1e-6, "{law:?}: {u}");
        assert_eq!(lips.len(), 2);
        assert!(((lips[1] - lips[0]).z.abs() - opening).abs() < 1e-6);
        assert!((body.elastic_energy() / energy - 1.0).abs() < 1e-6);
    }
}

#[test]
fn thirty_cuts_in_all_directions_while_the_body_moves() {
    let damped = Material { rayleigh: Rayleigh { mass_1_s: 0.5, stiffness_s: 0.002 }, ..SOFT };
    let mut body = cube(5, damped, settings(500, 1e-4));
    hold_left(&mut body);
    let mass = body.total_mass();
    for k in 0..30_u32 {
        body.cut(&tumbling_blade(&body, k), k + 1).unwrap();
        for _ in 0..4 {
            let report = body.step(0.01, DOWN, &[]);
            assert_eq!(
                (report.outcome, report.substeps),
                (Outcome::Advanced, 1),
                "after cut {k}: {report:?}"
            );
            assert_eq!(report.stop, StopReason::Converged, "after cut {k}: {report:?}");
        }
        assert!((body.total_mass() / mass - 1.0).abs() < 1e-12);
        let held = body.parts().free.iter().zip(&body.parts().mass).filter(|(free, _)| !**free);
        assert!(held.map(|(_, m)| m).sum::<f64>() > 0.0);
    }
    assert!(body.velocities().iter().all(|v| v.norm() < 50.0));
}
