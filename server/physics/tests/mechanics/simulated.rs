//! Octree bodies that simulate a coarse level: composite elements under vertices, cuts and materials of the finest
//! cells.

use nalgebra::{Matrix3, Vector3};
use scindo_allocations::allocations;
use scindo_physics::body::{
    Body, BodySettings, Method, Outcome, PcgSettings, PointSpring, Scheme, SolveReport, SpringKind,
};
use scindo_physics::cut::BladeSweep;
use scindo_physics::element::MaterialPoint;
use scindo_physics::material::{Law, Material, Rayleigh, Region};
use scindo_physics::octree::{BoxShape, Octree, OctreeSettings};
use scindo_physics::space::OctreeSpace;

type V3 = Vector3<f64>;

const MATERIAL: Material = Material {
    young_pa: 2e5,
    poisson: 0.3,
    density_kg_m3: 1000.0,
    rayleigh: Rayleigh { mass_1_s: 0.0, stiffness_s: 0.0 },
    law: Law::Linear,
};
const FALL: V3 = V3::new(0.0, 0.0, -9.81);

/// How a body is made.
#[derive(Clone, Copy)]
struct Made<'a> {
    size: V3,
    cells: u32,
    levels: u8,
    law: Law,
    region: &'a dyn Fn(&V3) -> u16,
    constants: &'a [Region],
}

const UNIT: Made<'_> = Made {
    size: V3::new(1.0, 1.0, 1.0),
    cells: 8,
    levels: 0,
    law: Law::Linear,
    region: &|_| 0,
    constants: &[],
};

fn body(made: Made<'_>, settings: BodySettings) -> Body {
    let shape = BoxShape { min: V3::zeros(), max: made.size };
    let octree = OctreeSettings { cells: made.cells, levels: made.levels };
    let mut octree = Octree::fill(&shape, octree, &made.region).unwrap();
    octree.set_regions(made.constants.to_vec());
    let body =
        Body::of_space(Box::new(OctreeSpace::new(octree)), Material { law: made.law, ..MATERIAL }, settings);
    let body = body.unwrap();
    assert!(body.is_fast());
    body
}

fn at_level(simulate_level: u8, scheme: Scheme, tolerance: f64) -> BodySettings {
    let solver = PcgSettings { iterations: 500, tolerance };
    BodySettings { solver, method: Method::MgPcg, scheme, simulate_level, ..BodySettings::default() }
}

/// The nodes where `at` is true.
fn nodes(body: &Body, at: impl Fn(&V3) -> bool) -> Vec<u32> {
    (0..).zip(body.rest_positions()).filter(|(_, X)| at(X)).map(|(n, _)| n).collect()
}

fn clamp(body: &mut Body) {
    let low = nodes(body, |X| X.x < 1e-9);
    body.fix(&low, [true; 3], V3::zeros()).unwrap();
}

fn advance(body: &mut Body, h: f64, springs: &[PointSpring]) -> SolveReport {
    let report = body.step(h, FALL, springs);
    assert_eq!(report.outcome, Outcome::Advanced, "{report:?}");
    assert!(!report.is_unconverged(), "{report:?}");
    report
}

fn moved(body: &Body) -> Vec<V3> {
    body.positions().iter().zip(body.rest_positions()).map(|(x, X)| x - X).collect()
}

fn largest<'a>(v: impl IntoIterator<Item = &'a V3>) -> f64 {
    v.into_iter().map(V3::norm).fold(0.0, f64::max)
}

/// Largest difference of displacements at the nodes of `coarse`, over the largest displacement of it.
fn apart(coarse: &Body, fine: &Body) -> f64 {
    let (u, v) = (moved(coarse), moved(fine));
    let key = |X: &V3| X.map(|x| (x * 1e6).round() as i64);
    let known: std::collections::HashMap<_, _> =
        fine.rest_positions().iter().zip(&v).map(|(X, v)| (key(X), *v)).collect();
    let apart: Vec<V3> = coarse.rest_positions().iter().zip(&u).map(|(X, u)| u - known[&key(X)]).collect();
    largest(&apart) / largest(&u)
}

/// A plane across x with a slope, from the top down to `depth`.
fn slit(x: f64, depth: f64) -> BladeSweep {
    let edge = |z: f64| [V3::new(x, -0.2, z), V3::new(x + 0.06, 1.2, z)];
    BladeSweep { segments: vec![edge(1.2), edge(depth)] }
}

#[test]
fn coarse_levels_of_uncut_boxes_give_the_answers_of_coarse_cells() {
    // The held faces lie on coarse cells; one of them is moved.
    let run = |cells, level| {
        let settings = at_level(level, Scheme::Static, 1e-6);
        let mut body = body(Made { cells, ..UNIT }, settings);
        clamp(&mut body);
        let high = nodes(&body, |X| X.x > 1.0 - 1e-9);
        body.fix(&high, [true, false, true], V3::new(0.03, 0.0, -0.02)).unwrap();
        let report = advance(&mut body, 1.0, &[]);
        assert!(report.iterations > 0);
        body
    };
    for (coarse, level) in [(4, 1), (8, 1), (4, 2)] {
        let apart = apart(&run(coarse, 0), &run(coarse << level, level));
        assert!(apart < 2e-6, "{coarse}³, level {level}: {apart:e}");
    }
}

#[test]
fn affine_displacements_of_the_surface_are_continued_inside() {
    // Larger cells inside, and corners that hang.
    let G = Matrix3::new(0.03, -0.01, 0.02, 0.0, -0.02, 0.015, 0.01, 0.005, -0.01);
    for level in [1, 2] {
        for law in [Law::Linear, Law::Corotational] {
            let scheme = if law == Law::Linear { Scheme::Static } else { Scheme::ImplicitEuler };
            let made = Made { cells: 12, levels: 2, law, ..UNIT };
            let mut body = body(made, at_level(level, scheme, 1e-6));
            let on_surface = nodes(&body, |X| X.iter().any(|x| *x < 1e-9 || *x > 1.0 - 1e-9));
            for &n in &on_surface {
                let X = body.rest_positions()[n as usize];
                body.fix(&[n], [true; 3], G * X).unwrap();
            }
            assert!(on_surface.len() < body.n_copies());
            // Rotations follow step by step.
            for _ in 0..if law == Law::Linear { 1 } else { 12 } {
                let report = body.step(if law == Law::Linear { 1.0 } else { 1e2 }, V3::zeros(), &[]);
                assert_eq!(report.outcome, Outcome::Advanced);
            }
            let wrong: Vec<V3> =
                moved(&body).iter().zip(body.rest_positions()).map(|(u, X)| u - G * X).collect();
            assert!(largest(&wrong) < 2e-6 * 0.05, "level {level}, {law:?}: {:e}", largest(&wrong));
        }
    }
}

#[test]
fn composite_elements_see_materials_finer_than_themselves() {
    // A bar with a skin one fine cell thick, ten times as stiff.
    let size = V3::new(1.0, 0.25, 0.25);
    let stiff = |factor: f64| [Region { young_pa: factor * 2e5, poisson: 0.3, density_kg_m3: 1000.0 }];
    let skin = |X: &V3| u16::from((X.z - 0.125).abs() > 0.125 - 1.0 / 32.0);
    let coarse_skin = |X: &V3| u16::from((X.z - 0.125).abs() > 0.125 - 1.0 / 16.0);
    let run = |cells, level, region: &dyn Fn(&V3) -> u16, factor| {
        let constants = stiff(factor);
        let made = Made { size, cells, region, constants: &constants, ..UNIT };
        let mut body = body(made, at_level(level, Scheme::Static, 1e-6));
        clamp(&mut body);
        advance(&mut body, 1.0, &[]);
        body
    };
    let fine = run(32, 0, &skin, 10.0);
    let composite = run(32, 1, &skin, 10.0);
    let averaged = run(16, 0, &coarse_skin, 5.5);
    let (ours, theirs) = (apart(&composite, &fine), apart(&averaged, &fine));
    println!("error of composite elements {ours:.4}, of averaged material {theirs:.4}");
    assert!(ours < 0.8 * theirs, "{ours} {theirs}");
}

#[test]
fn a_cut_thinner_than_the_composite_elements_parts_the_body() {
    for level in [1, 2] {
        let made = Made { cells: 12, levels: 2, law: Law::Corotational, ..UNIT };
        let mut body = body(made, at_level(level, Scheme::ImplicitEuler, 1e-5));
        clamp(&mut body);
        for _ in 0..2 {
            advance(&mut body, 0.01, &[]);
        }
        // Half of the way first: the halves still hang together.
        body.cut(&slit(0.53, 0.4), 1).unwrap();
        for _ in 0..2 {
            advance(&mut body, 0.01, &[]);
        }
        assert_eq!(body.components().len(), 1);
        body.cut(&slit(0.53, -0.2), 2).unwrap();
        assert_eq!(body.components().len(), 2);
        let speed = |body: &Body| {
            let far = nodes(body, |X| X.x > 0.9);
            far.iter().map(|&n| body.velocities()[n as usize].z).sum::<f64>() / far.len() as f64
        };
        let before = speed(&body);
        for _ in 0..30 {
            advance(&mut body, 0.01, &[]);
        }
        // The loose half falls freely, whatever it carries; the other one stays.
        let (fallen, stayed) = (speed(&body) - before, moved(&body)[nodes(&body, |X| X.x < 0.3)[0] as usize]);
        let rest = body.rest_positions();
        let far = (0..rest.len()).find(|&n| rest[n].x > 0.9).unwrap();
        assert!((fallen / (-9.81 * 0.3) - 1.0).abs() < 0.2, "level {level}: {fallen}");
        assert!(moved(&body)[far].z < -0.3 && stayed.norm() < 0.05, "level {level}: {stayed}");
    }
}

#[test]
fn free_bodies_fall_and_keep_their_momentum() {
    for scheme in [
        Scheme::ImplicitEuler,
        Scheme::Bdf2,
        Scheme::Newmark { beta: 0.25, gamma: 0.5 },
        Scheme::GeneralisedAlpha { spectral_radius: 0.8 },
    ] {
        for level in [1, 2] {
            let made = Made { cells: 12, levels: 2, law: Law::Corotational, ..UNIT };
            let mut body = body(made, at_level(level, scheme, 1e-4));
            body.cut(&slit(0.53, 0.4), 1).unwrap();
            let (h, n) = (0.01, 10);
            for k in 1..=n {
                advance(&mut body, h, &[]);
                let v = f64::from(k) * h * FALL;
                let wrong = body.velocities().iter().map(|u| (u - v).norm()).fold(0.0, f64::max);
                assert!(wrong < 1e-11, "{scheme:?}, level {level}, step {k}: {wrong:e}");
            }
            // With a deformation that travels through it.
            let x = body.positions().to_vec();
            let v: Vec<V3> = body
                .rest_positions()
                .iter()
                .map(|X| V3::new(X.y * X.z, (3.0 * X.x).sin(), X.x * X.x))
                .collect();
            body.set_state(&x, &v).unwrap();
            let mass: f64 = body.masses().iter().sum();
            let before = body.momentum();
            for k in 1..=n {
                assert_eq!(body.step(h, V3::zeros(), &[]).outcome, Outcome::Advanced);
                let wrong = (body.momentum() - before).norm() / mass;
                assert!(wrong < 1e-9, "{scheme:?}, level {level}, step {k}: {wrong:e}");
            }
        }
    }
}

/// Eight steps with a cut after four, and springs of `stiffness` [N/m] from the third on.
fn run(settings: BodySettings, law: Law, stiffness: f64) -> (Vec<V3>, u32) {
    let region = |X: &V3| u16::from(X.z > 0.5 && X.x > 0.5);
    let constants = [Region { young_pa: 6e5, poisson: 0.4, density_kg_m3: 500.0 }];
    let mut body =
        body(Made { cells: 12, levels: 2, law, region: &region, constants: &constants, ..UNIT }, settings);
    clamp(&mut body);
    let top = V3::new(0.98, 0.51, 0.97);
    let mut iterations = 0;
    for k in 0..8 {
        if k == 4 {
            body.cut(&slit(0.55, 0.35), 1).unwrap();
        }
        let mut at = body.locate(top, None).unwrap();
        let point = MaterialPoint::new(body.carriers(&mut at));
        let kinds = [
            SpringKind::Hold { target_m: top + V3::new(0.0, 0.03, 0.0) },
            SpringKind::OneSided { normal: V3::z(), offset_m: 0.96 },
        ];
        let springs =
            kinds.map(|kind| PointSpring { point, kind, stiffness_n_m: stiffness, max_force_n: 1e9 });
        let report = advance(&mut body, 0.02, if k < 2 { &[] } else { &springs });
        assert!(report.algebraic_error > 0.0);
        iterations += report.iterations;
    }
    (moved(&body), iterations)
}

#[test]
fn cycles_and_conjugate_gradients_agree_through_cuts_and_springs() {
    for scheme in [Scheme::ImplicitEuler, Scheme::Newmark { beta: 0.25, gamma: 0.5 }] {
        for (law, stiffness) in [(Law::Linear, 1e4), (Law::Corotational, 1e4), (Law::Corotational, 3e6)] {
            let fine = run(at_level(0, scheme, 1e-5), law, stiffness);
            let mut before = 0.0;
            for level in [1, 2] {
                let settings = at_level(level, scheme, 1e-5);
                let (x, iterations) = run(settings, law, stiffness);
                let cycles = run(BodySettings { method: Method::Multigrid, ..settings }, law, stiffness);
                let apart = |a: &[V3], b: &[V3]| {
                    let apart: Vec<V3> = a.iter().zip(b).map(|(a, b)| a - b).collect();
                    largest(&apart) / largest(b)
                };
                let error = apart(&x, &fine.0);
                println!(
                    "{scheme:?}, {law:?}, {stiffness} N/m, level {level}: {iterations} iterations ({} fine), error {error:.4}",
                    fine.1
                );
                assert!(apart(&cycles.0, &x) < 1e-3, "{scheme:?}, {law:?}, {stiffness}, level {level}");
                // Coarser elements are stiffer. A stiff spring at a point moves them less still.
                let most = if stiffness > 1e5 { 0.7 } else { 0.22 * f64::from(level) };
                assert!(error > before && error < most, "{error} after {before}");
                before = error;
            }
        }
    }
}

#[test]
fn steps_on_a_coarse_level_have_the_same_bits_for_any_number_of_threads() {
    let run = |threads, level, method| {
        let settings = BodySettings { threads, method, ..at_level(level, Scheme::ImplicitEuler, 1e-4) };
        run(settings, Law::Corotational, 1e4).0
    };
    for (level, method) in [(1, Method::MgPcg), (2, Method::MgPcg), (1, Method::Multigrid)] {
        assert_eq!(run(1, level, method), run(2, level, method));
        assert_eq!(run(1, level, method), run(3, level, method));
    }
}

#[test]
fn a_steady_step_on_a_coarse_level_does_not_allocate() {
    for level in [1, 2] {
        let settings = BodySettings { threads: 2, ..at_level(level, Scheme::ImplicitEuler, 1e-3) };
        let mut body = body(Made { cells: 12, levels: 2, law: Law::Corotational, ..UNIT }, settings);
        clamp(&mut body);
        body.cut(&slit(0.55, 0.35), 1).unwrap();
        for _ in 0..8 {
            advance(&mut body, 0.01, &[]);
        }
        let before = allocations();
        for _ in 0..5 {
            advance(&mut body, 0.01, &[]);
        }
        assert_eq!(allocations() - before, 0, "level {level}");
    }
}

#[test]
fn what_cannot_simulate_a_coarse_level_is_refused() {
    let level = at_level(1, Scheme::ImplicitEuler, 1e-4);
    let refused = |settings: BodySettings, law, words: &str| {
        let octree = Octree::fill(
            &BoxShape { min: V3::zeros(), max: V3::repeat(1.0) },
            OctreeSettings { cells: 4, levels: 0 },
            &|_| 0,
        );
        let space = Box::new(OctreeSpace::new(octree.unwrap()));
        let error = Body::of_space(space, Material { law, ..MATERIAL }, settings).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    };
    refused(BodySettings { method: Method::Cholesky, ..level }, Law::Linear, "a solver without levels");
    refused(BodySettings { method: Method::Pcg, ..level }, Law::Linear, "take mg-pcg or multigrid");
    refused(BodySettings { scheme: Scheme::Static, ..level }, Law::Corotational, "the static integrator");
    refused(BodySettings { scheme: Scheme::SymplecticEuler, ..level }, Law::Linear, "explicit");
    refused(level, Law::NeoHookean, "nonlinear in the stretch");
    refused(BodySettings { simulate_level: 3, ..level }, Law::Linear, "simulate_level = 3");
    let mesh = crate::bar_mesh();
    let error = Body::new(mesh, MATERIAL, level).unwrap_err().to_string();
    assert!(error.contains("element octree"), "{error}");
}
