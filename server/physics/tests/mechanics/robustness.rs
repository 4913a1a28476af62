//! Ruined starts and meaningless input.

use nalgebra::Vector3;
use scindo_physics::body::{Body, Outcome, PointSpring, SpringKind};
use scindo_physics::element::MaterialPoint;
use scindo_physics::material::{Material, Rayleigh};

use crate::{DOWN, SOFT, cube, settings};

fn is_finite(body: &Body) -> bool {
    body.positions().iter().chain(body.velocities()).all(|v| v.iter().all(|c| c.is_finite()))
}

/// Largest difference between present and rest edge lengths, relative to the size of the body.
fn shape_error(body: &Body) -> f64 {
    let (x, mesh) = (body.positions(), body.tets().unwrap().mesh());
    let length = |x: &[Vector3<f64>], a: u32, b: u32| (x[a as usize] - x[b as usize]).norm();
    mesh.tets
        .iter()
        .flat_map(|t| [[t[0], t[1]], [t[0], t[2]], [t[0], t[3]], [t[1], t[2]], [t[1], t[3]], [t[2], t[3]]])
        .map(|[a, b]| (length(x, a, b) - length(&mesh.nodes, a, b)).abs() / 0.1)
        .fold(0.0, f64::max)
}

/// A deterministic number in [-1, 1) from a seed.
fn noise(seed: usize) -> f64 {
    let h = (seed as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    ((h ^ (h >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
}

#[test]
fn ruined_starts_stay_finite_and_recover() {
    let material = Material { rayleigh: Rayleigh { mass_1_s: 0.5, stiffness_s: 0.005 }, ..SOFT };
    type Ruin = fn(usize, &Vector3<f64>) -> Vector3<f64>;
    let ruins: [(&str, Ruin); 8] = [
        ("inverted", |_, x| -x),
        ("mirrored", |_, x| Vector3::new(-x.x, x.y, x.z)),
        ("flat", |_, x| Vector3::new(x.x, x.y, 0.0)),
        ("a point", |_, _| Vector3::zeros()),
        ("nearly a point", |i, _| 1e-10 * Vector3::new(noise(3 * i), noise(3 * i + 1), noise(3 * i + 2))),
        ("a thousandth", |_, x| 1e-3 * x),
        ("stretched 20 times", |_, x| Vector3::new(20.0 * x.x, x.y, x.z)),
        ("scrambled", |i, _| 0.05 * Vector3::new(noise(3 * i), noise(3 * i + 1), noise(3 * i + 2))),
    ];
    for (name, ruin) in ruins {
        let mut body = cube(2, material, settings(200, 1e-6));
        let x: Vec<_> = body.positions().iter().enumerate().map(|(i, x)| ruin(i, x)).collect();
        body.set_state(&x, &vec![Vector3::zeros(); x.len()]).unwrap();
        for _ in 0..500 {
            body.step(0.01, Vector3::zeros(), &[]);
            assert!(is_finite(&body), "{name}");
        }
        let error = shape_error(&body);
        assert!(error < 1e-3, "{name}: shape error {error:e}, det F ≥ {}", body.least_volume_ratio());
    }
}

#[test]
fn absurd_velocities_are_survived_and_reported() {
    let mut body = cube(2, SOFT, settings(50, 1e-6));
    let x = body.positions().to_vec();
    let v: Vec<_> = (0..x.len()).map(|i| Vector3::repeat(noise(i) * 9e11)).collect();
    body.set_state(&x, &v).unwrap();
    for _ in 0..20 {
        body.step(0.02, DOWN, &[]);
        assert!(is_finite(&body));
    }
}

#[test]
fn input_without_meaning_changes_nothing() {
    let mut body = cube(2, SOFT, settings(50, 1e-6));
    let x = body.positions().to_vec();
    for h in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(body.step(h, DOWN, &[]).outcome, Outcome::Refused);
    }
    assert_eq!(body.step(0.01, Vector3::repeat(f64::NAN), &[]).outcome, Outcome::Refused);
    assert_eq!(body.positions(), x);
    let broken = PointSpring {
        point: MaterialPoint::in_tet([0, 1, 2, 3], [f64::NAN, 0.0, 0.0, 1.0]),
        kind: SpringKind::Hold { target_m: Vector3::zeros() },
        stiffness_n_m: 10.0,
        max_force_n: 1.0,
    };
    let missing = PointSpring { point: MaterialPoint::in_tet([0, 1, 2, 9999], [0.25; 4]), ..broken };
    let report = body.step(0.01, Vector3::zeros(), &[broken, missing]);
    assert_eq!((report.outcome, report.refused_springs), (Outcome::Advanced, 2));
    assert_eq!(body.spring_forces(), [Vector3::zeros(); 2]);
    assert!(body.set_state(&x[1..], &x).is_err());
    assert!(body.set_state(&vec![Vector3::repeat(f64::NAN); x.len()], &x).is_err());
}

#[test]
fn reset_returns_to_the_start() {
    let mut body = cube(2, SOFT, settings(50, 1e-6));
    let rest = body.positions().to_vec();
    let epoch = body.epoch();
    body.step(0.1, DOWN, &[]);
    body.reset().unwrap();
    assert_eq!(body.positions(), rest);
    assert!(body.velocities().iter().all(|v| *v == Vector3::zeros()));
    assert!(body.epoch() > epoch);
}

/// A stiff cube that turns by 2, 4 and 8 rad in a step. One linear solve from the predictor would gain
/// energy, so the step is divided or the spin slowed, and this is reported.
#[test]
fn a_free_body_that_turns_far_in_a_step_gains_no_energy() {
    let h = 0.2;
    for young_pa in [1e4, 1e5, 1e6, 1e7] {
        for turn in [0.25_f64, 2.0, 4.0, 8.0] {
            let mut body = cube(2, Material { young_pa, density_kg_m3: 1e3, ..SOFT }, settings(500, 1e-6));
            let (centre, x) = (body.centre_of_mass(), body.positions().to_vec());
            let spin: Vector3<f64> = (turn / h) * Vector3::new(1.0, 2.0, 3.0).normalize();
            let v: Vec<_> = x.iter().map(|x| spin.cross(&(x - centre))).collect();
            body.set_state(&x, &v).unwrap();
            let start = body.kinetic_energy();
            for step in 0..10 {
                let report = body.step(h, Vector3::zeros(), &[]);
                assert_eq!(report.outcome, Outcome::Advanced);
                assert!(report.substeps == 1 || report.notice.is_some());
                assert!(turn >= 1.0 || report.notice.is_none());
                let energy = body.kinetic_energy() + body.elastic_energy();
                assert!(energy <= 1.00001 * start, "{young_pa} Pa, {turn} rad, {step}: {}", energy / start);
            }
        }
    }
}
