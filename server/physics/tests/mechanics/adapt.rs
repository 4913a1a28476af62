//! Octree bodies whose cells are refined and coarsened between steps.

use nalgebra::Vector3;
use scindo_allocations::allocations;
use scindo_physics::body::estimate::CellRecovery;
use scindo_physics::body::{
    AdaptReport, Arithmetic, Body, BodyError, BodySettings, Method, Outcome, PcgSettings, Scheme,
};
use scindo_physics::cut::BladeSweep;
use scindo_physics::material::{Law, Material, Rayleigh, Region};
use scindo_physics::octree::{AdaptSettings, BoxShape, Octree, OctreeSettings};
use scindo_physics::space::OctreeSpace;

use crate::{SOFT, bar_mesh, settings};

const MATERIAL: Material = Material {
    young_pa: 2e5,
    poisson: 0.3,
    density_kg_m3: 1000.0,
    rayleigh: Rayleigh { mass_1_s: 0.0, stiffness_s: 0.002 },
    law: Law::Corotational,
};
const FALL: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);
const NEAR: AdaptSettings =
    AdaptSettings { distance_m: Some([0.1, 0.2]), speed_m_s: None, error: None, level: 0 };
const FAR: Vector3<f64> = Vector3::new(50.0, 0.0, 0.0);

fn cube(cells: u32, levels: u8, settings: BodySettings) -> Body {
    let shape = BoxShape { min: Vector3::zeros(), max: Vector3::repeat(1.0) };
    let region = |p: &Vector3<f64>| u16::from(p.z > 0.75);
    let mut octree = Octree::fill(&shape, OctreeSettings { cells, levels }, &region).unwrap();
    octree.set_regions(vec![Region { young_pa: 6e5, poisson: 0.4, density_kg_m3: 500.0 }]);
    Body::of_space(Box::new(OctreeSpace::new(octree)), MATERIAL, settings).unwrap()
}

fn with(scheme: Scheme, arithmetic: Arithmetic, threads: usize) -> BodySettings {
    let solver = PcgSettings { iterations: 2000, tolerance: 1e-7 };
    BodySettings { scheme, arithmetic: Some(arithmetic), threads, solver, ..BodySettings::default() }
}

fn held(body: &Body, inside: impl Fn(&Vector3<f64>) -> bool) -> Vec<u32> {
    (0..).zip(body.rest_positions()).filter(|(_, X)| inside(X)).map(|(n, _)| n).collect()
}

/// Gives every vertex a motion of its own.
fn shake(body: &mut Body, size: f64) {
    let mut state = 7u64;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f64 / f64::from(1 << 24) - 0.3
    };
    let mut vector = || Vector3::new(next(), next(), next());
    let x: Vec<Vector3<f64>> = body.rest_positions().iter().map(|X| X + 0.1 * size * vector()).collect();
    let v: Vec<Vector3<f64>> = x.iter().map(|_| size * vector()).collect();
    body.set_state(&x, &v).unwrap();
}

fn adapt(body: &mut Body, settings: &AdaptSettings, tool: Vector3<f64>) -> AdaptReport {
    let (mass, momentum, centre) = (body.total_mass(), body.momentum(), body.centre_of_mass());
    let before = [body.kinetic_energy(), body.elastic_energy()];
    let report = body.adapt(settings, &[tool], None).unwrap();
    let after = [body.kinetic_energy(), body.elastic_energy()];
    for (k, told) in [report.kinetic_change_j, report.elastic_change_j].into_iter().enumerate() {
        assert!((after[k] - before[k] - told).abs() <= 1e-12 * before[k], "{before:?} {after:?} {report:?}");
    }
    assert!(!report.has_changed() || report.kinetic_change_j != 0.0 || before[0] == 0.0);
    assert!((body.total_mass() / mass - 1.0).abs() < 1e-12);
    let change = (body.momentum() - momentum).norm();
    assert!(change <= 1e-12 * momentum.norm(), "{change} of {momentum}");
    assert!((report.momentum_change.norm() - change).abs() < 1e-15 * (1.0 + momentum.norm()));
    // Refinement alone keeps the field.
    if report.joined == 0 {
        assert!((body.centre_of_mass() - centre).norm() < 1e-12);
    }
    let flaws = body.flaws();
    assert!(flaws.surface == 0 && flaws.volume < 1e-12, "{flaws:?}");
    report
}

fn same_numbers(a: &Body, b: &Body) {
    assert_eq!(a.rest_positions(), b.rest_positions());
    assert_eq!(a.node_of_copy(), b.node_of_copy());
    let groups = |body: &Body| {
        let mut all = Vec::new();
        body.for_pieces(&mut |id, copies, weights| all.push((id, copies.to_vec(), weights.to_vec())));
        all
    };
    assert_eq!(groups(a), groups(b));
    assert_eq!(a.masses(), b.masses());
    assert_eq!((a.fixed_nodes(), a.loads()), (b.fixed_nodes(), b.loads()));
    assert_eq!(a.parts(), b.parts());
}

#[test]
fn random_motion_keeps_mass_and_momentum_and_returns_to_the_start() {
    let schemes = [
        (Scheme::ImplicitEuler, Arithmetic::Single),
        (Scheme::Bdf2, Arithmetic::Single),
        (Scheme::Newmark { beta: 0.25, gamma: 0.5 }, Arithmetic::Single),
        (Scheme::Bdf2, Arithmetic::Double),
        (Scheme::SymplecticEuler, Arithmetic::Double),
    ];
    for (scheme, arithmetic) in schemes {
        let mut body = cube(16, 2, with(scheme, arithmetic, 1));
        let start = cube(16, 2, with(scheme, arithmetic, 1));
        shake(&mut body, 0.1);
        let finer = adapt(&mut body, &NEAR, Vector3::repeat(0.5));
        assert!(finer.divided > 0 && finer.appeared > 0 && finer.joined == 0, "{finer:?}");
        shake(&mut body, 0.1);
        for _ in 0..3 {
            adapt(&mut body, &NEAR, FAR);
            shake(&mut body, 0.1);
        }
        assert!(body.renumberings() > 0);
        assert!(!adapt(&mut body, &NEAR, FAR).has_changed());
        same_numbers(&body, &start);
        let report = body.step(1e-5, FALL, &[]);
        assert_eq!(report.outcome, Outcome::Advanced, "{scheme:?} {report:?}");
    }
}

/// A tool passes through a held, sagging body that is cut meanwhile.
fn passage(settings: BodySettings) -> (Body, [usize; 2], usize) {
    let mut body = cube(16, 2, settings);
    let clamp = held(&body, |X| X.x < 1e-9);
    body.fix(&clamp, [true; 3], Vector3::zeros()).unwrap();
    let n = body.rest_positions().len();
    let (mut counts, mut most) = ([0; 2], 0);
    for k in 0..24 {
        let tool = Vector3::new(0.2 + 0.05 * f64::from(k), 0.5, 0.4);
        let report = body.adapt(&NEAR, &[tool], None).unwrap();
        let change = report.momentum_change.norm();
        assert!(change < 1e-12 * (1.0 + body.momentum().norm()), "{change}");
        counts = [counts[0] + report.divided, counts[1] + report.joined];
        most = most.max(body.rest_positions().len());
        let step = body.step(0.01, FALL, &[]);
        assert_eq!(step.outcome, Outcome::Advanced, "{step:?}");
        assert!(k == 0 || step.scheme == body.settings().scheme, "{k} {step:?}");
        if k == 6 {
            let edge = |z: f64| [Vector3::new(0.53, -0.2, z), Vector3::new(0.56, 1.2, z)];
            body.cut(&BladeSweep { segments: vec![edge(1.3), edge(0.6)] }, 1).unwrap();
        }
        let flaws = body.flaws();
        assert!(flaws.surface == 0 && flaws.volume < 1e-12, "{k}: {flaws:?}");
    }
    assert!(most > n);
    (body, counts, most)
}

#[test]
fn a_tool_passes_and_the_body_keeps_moving() {
    for method in [Method::Pcg, Method::MgPcg] {
        for scheme in [Scheme::ImplicitEuler, Scheme::Bdf2] {
            let settings = |threads| BodySettings { method, ..with(scheme, Arithmetic::Single, threads) };
            let (body, [divided, joined], most) = passage(settings(1));
            assert!(divided > 5 && joined > 5, "{divided} {joined}");
            assert!(body.rest_positions().len() < most);
            assert_eq!(body.components().volume.len(), 1);
            let (other, ..) = passage(settings(2));
            assert_eq!(body.positions(), other.positions(), "{method:?} {scheme:?}");
        }
    }
}

#[test]
fn what_is_off_or_quiet_costs_nothing() {
    let make = || {
        let mut body = cube(16, 2, with(Scheme::Bdf2, Arithmetic::Single, 1));
        let clamp = held(&body, |X| X.x < 1e-9);
        body.fix(&clamp, [true; 3], Vector3::zeros()).unwrap();
        body
    };
    let all = AdaptSettings { speed_m_s: Some([100.0, 50.0]), error: Some([1e3, 1e2]), ..NEAR };
    let (mut plain, mut off, mut quiet) = (make(), make(), make());
    let error = vec![0.0; off.n_pieces()];
    let mut count = 0;
    for k in 0..6 {
        plain.step(0.01, FALL, &[]);
        let before = allocations();
        let none = off.adapt(&AdaptSettings::default(), &[FAR], None).unwrap();
        let quietly = quiet.adapt(&all, &[FAR], Some(&error)).unwrap();
        assert_eq!((none, quietly), (AdaptReport::default(), AdaptReport::default()));
        off.step(0.01, FALL, &[]);
        quiet.step(0.01, FALL, &[]);
        count += if k > 2 { allocations() - before } else { 0 };
        for other in [&off, &quiet] {
            assert_eq!(plain.positions(), other.positions());
            assert_eq!((plain.velocities(), plain.epoch()), (other.velocities(), other.epoch()));
        }
    }
    assert_eq!(count, 0, "allocations");
}

#[test]
fn held_and_loaded_vertices_follow() {
    let mut body = cube(16, 2, with(Scheme::ImplicitEuler, Arithmetic::Single, 1));
    let inside = held(&body, |X| X.x < 0.55);
    body.fix(&inside, [true, false, true], Vector3::new(0.01, 0.0, 0.02)).unwrap();
    body.add_volume_force(&inside, Vector3::new(0.0, 3.0, 0.0)).unwrap();
    let total = |body: &Body| body.loads().iter().sum::<Vector3<f64>>();
    let start: Vec<_> = body.fixed_nodes().to_vec();
    let loads = body.loads().to_vec();
    let tool = Vector3::new(0.4, 0.5, 0.4);
    assert!(adapt(&mut body, &NEAR, tool).divided > 0);
    assert!(body.fixed_nodes().len() > start.len());
    assert!((total(&body) - Vector3::new(0.0, 3.0, 0.0)).norm() < 1e-12);
    body.step(0.01, FALL, &[]);
    // A vertex that is held by request stays with its cells.
    let new = body.fixed_nodes().last().unwrap().node;
    let place = body.rest_positions()[new as usize];
    body.fix(&[new], [false, true, false], Vector3::zeros()).unwrap();
    for _ in 0..3 {
        adapt(&mut body, &NEAR, FAR);
    }
    let now = body.rest_positions().iter().position(|X| *X == place).unwrap() as u32;
    assert!(body.fixed_nodes().iter().any(|f| f.node == now && f.held == [true; 3].into()));
    body.release(&[now]);
    while adapt(&mut body, &NEAR, FAR).has_changed() {}
    let n = body.fixed_nodes().len();
    assert!(body.fixed_nodes() == start, "{n} nodes held, {} before", start.len());
    assert!(body.loads() == loads);
    assert!(!body.rest_positions().contains(&place));
}

#[test]
fn a_cut_is_taken_back_over_a_coarsening() {
    let mut body = cube(16, 2, with(Scheme::ImplicitEuler, Arithmetic::Single, 1));
    let clamp = held(&body, |X| X.x < 1e-9);
    body.fix(&clamp, [true; 3], Vector3::zeros()).unwrap();
    adapt(&mut body, &NEAR, Vector3::new(0.3, 0.5, 0.4));
    let then = body.rest_positions().to_vec();
    let topology = body.topology();
    let edge = |z: f64| [Vector3::new(0.81, -0.2, z), Vector3::new(0.84, 1.2, z)];
    body.cut(&BladeSweep { segments: vec![edge(1.2), edge(0.6)] }, 1).unwrap();
    for _ in 0..5 {
        body.step(0.01, FALL, &[]);
    }
    while body.adapt(&NEAR, &[FAR], None).unwrap().has_changed() {}
    assert!(body.renumberings() > 0);
    let (mass, momentum, centre) = (body.total_mass(), body.momentum(), body.centre_of_mass());
    body.restore(topology).unwrap();
    assert_eq!(body.rest_positions(), then);
    assert!((body.total_mass() / mass - 1.0).abs() < 1e-12);
    assert!((body.momentum() - momentum).norm() < 1e-9 * momentum.norm());
    assert!((body.centre_of_mass() - centre).norm() < 1e-9);
    let furthest = body.positions().iter().zip(&then).map(|(x, X)| (x - X).norm()).fold(0.0, f64::max);
    assert!(furthest < 0.05, "{furthest}");
    assert_eq!(body.step(0.01, FALL, &[]).outcome, Outcome::Advanced);
    body.reset().unwrap();
    same_numbers(&body, &{
        let mut start = cube(16, 2, with(Scheme::ImplicitEuler, Arithmetic::Single, 1));
        start.fix(&clamp, [true; 3], Vector3::zeros()).unwrap();
        start
    });
}

fn sagging(octree: Octree) -> Body {
    let material = Material { law: Law::Linear, ..MATERIAL };
    let solver = PcgSettings { iterations: 3000, tolerance: 1e-8 };
    let settings =
        BodySettings { scheme: Scheme::Static, method: Method::Cholesky, solver, ..BodySettings::default() };
    let mut body = Body::of_space(Box::new(OctreeSpace::new(octree)), material, settings).unwrap();
    let clamp = held(&body, |X| X.x < 1e-9);
    body.fix(&clamp, [true; 3], Vector3::zeros()).unwrap();
    assert_eq!(body.step(1.0, FALL, &[]).outcome, Outcome::Advanced);
    body
}

#[test]
fn the_error_falls_with_refinement_and_is_largest_at_the_clamped_edge() {
    let shape = BoxShape { min: Vector3::zeros(), max: Vector3::repeat(1.0) };
    let fill = |cells, levels| Octree::fill(&shape, OctreeSettings { cells, levels }, &|_| 0).unwrap();
    let mut recovery = CellRecovery::default();
    let relative: Vec<f64> = [4, 8, 16]
        .into_iter()
        .map(|cells| sagging(fill(cells, 0)).cell_error(&mut recovery).unwrap().relative)
        .collect();
    assert!(relative.windows(2).all(|w| w[1] < 0.8 * w[0] && w[1] > 0.4 * w[0]), "{relative:?}");
    // The largest errors are at the edges of the clamped face.
    let octree = fill(16, 0);
    let eta = recovery.eta();
    let mut order: Vec<usize> = (0..eta.len()).collect();
    order.sort_by(|&a, &b| eta[b].total_cmp(&eta[a]));
    for &id in &order[..20] {
        let at = octree.cells()[id].at;
        let on_edge = at[0] < 2 && (at[1] < 1 || at[1] > 14 || at[2] < 1 || at[2] > 14);
        assert!(on_edge, "{at:?}");
    }
    // Inside a coarse body, refinement where the error is large lowers it.
    let mut body = sagging(fill(16, 2));
    let before = body.cell_error(&mut recovery).unwrap();
    let coarse = |body: &Body, recovery: &CellRecovery| {
        let mut sides = vec![0.0; recovery.eta().len()];
        body.for_pieces(&mut |id, _, weights| sides[id] = weights.iter().sum::<f64>().cbrt());
        let large = recovery.eta().iter().zip(sides).filter(|(_, side)| *side > 0.07);
        large.map(|(eta, _)| eta * eta).sum::<f64>().sqrt()
    };
    let eta = recovery.eta().to_vec();
    let worst = coarse(&body, &recovery);
    let settings = AdaptSettings { error: Some([0.1 * worst, 0.001 * worst]), ..AdaptSettings::default() };
    let report = body.adapt(&settings, &[], Some(&eta)).unwrap();
    assert!(report.divided > 0, "{worst} {report:?}");
    assert_eq!(body.step(1.0, FALL, &[]).outcome, Outcome::Advanced);
    let after = body.cell_error(&mut recovery).unwrap();
    assert!(after.eta < before.eta, "{before:?} {after:?}");
    assert!(coarse(&body, &recovery) < worst);
}

#[test]
fn what_cannot_be_adapted_is_refused() {
    let mut body = Body::new(bar_mesh(), SOFT, settings(10, 1e-6)).unwrap();
    assert!(matches!(body.adapt(&NEAR, &[], None), Err(BodyError::Combination { .. })));
    assert!(body.adapt(&AdaptSettings::default(), &[], None).is_ok());
    assert!(body.cell_error(&mut CellRecovery::default()).is_none());
    let mut body = cube(8, 1, BodySettings::default());
    let wrong = AdaptSettings { distance_m: Some([0.2, 0.1]), ..NEAR };
    assert!(matches!(body.adapt(&wrong, &[], None), Err(BodyError::Criterion { name: "distance_m", .. })));
    assert!(matches!(body.adapt(&NEAR, &[], Some(&[0.0])), Err(BodyError::ErrorLength { found: 1, .. })));
}
