//! Octree bodies stepped with multigrid: the same motion in few iterations, whatever is cut or touched.

use nalgebra::Vector3;
use scindo_allocations::allocations;
use scindo_physics::body::{
    Body, BodySettings, CycleShape, Method, Outcome, PcgSettings, PointSpring, Scheme, SolveReport,
    SpringKind,
};
use scindo_physics::cut::BladeSweep;
use scindo_physics::element::MaterialPoint;
use scindo_physics::material::{Law, Material, Rayleigh, Region};
use scindo_physics::octree::{BoxShape, Octree, OctreeSettings};
use scindo_physics::solver::multigrid::CoarsestSolve;
use scindo_physics::space::OctreeSpace;

const MATERIAL: Material = Material {
    young_pa: 2e5,
    poisson: 0.3,
    density_kg_m3: 1000.0,
    rayleigh: Rayleigh { mass_1_s: 0.0, stiffness_s: 0.002 },
    law: Law::Corotational,
};
const FALL: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);

fn cube(cells: u32, levels: u8, law: Law, settings: BodySettings) -> Body {
    let shape = BoxShape { min: Vector3::zeros(), max: Vector3::repeat(1.0) };
    let region = |p: &Vector3<f64>| u16::from(p.z > 0.5 && p.x > 0.5);
    let mut octree = Octree::fill(&shape, OctreeSettings { cells, levels }, &region).unwrap();
    octree.set_regions(vec![Region { young_pa: 6e5, poisson: 0.4, density_kg_m3: 500.0 }]);
    let space = Box::new(OctreeSpace::new(octree));
    let mut body = Body::of_space(space, Material { law, ..MATERIAL }, settings).unwrap();
    assert!(body.is_fast());
    let held: Vec<u32> =
        (0..).zip(body.rest_positions()).filter(|(_, X)| X.x < 1e-9).map(|(n, _)| n).collect();
    body.fix(&held, [true; 3], Vector3::zeros()).unwrap();
    body
}

fn with(method: Method, scheme: Scheme, tolerance: f64) -> BodySettings {
    let solver = PcgSettings { iterations: 3000, tolerance };
    BodySettings { solver, method, scheme, ..BodySettings::default() }
}

fn slit(x: f64) -> BladeSweep {
    let edge = |z: f64| [Vector3::new(x, -0.2, z), Vector3::new(x + 0.06, 1.2, z)];
    BladeSweep { segments: vec![edge(1.2), edge(0.35)] }
}

fn moved(body: &Body) -> Vec<Vector3<f64>> {
    body.positions().iter().zip(body.rest_positions()).map(|(x, X)| x - X).collect()
}

fn difference(a: &[Vector3<f64>], b: &[Vector3<f64>]) -> f64 {
    let largest = |u: &mut dyn Iterator<Item = f64>| u.fold(0.0, f64::max);
    let apart = largest(&mut a.iter().zip(b).map(|(a, b)| (a - b).norm()));
    apart / largest(&mut b.iter().map(Vector3::norm))
}

fn advance(body: &mut Body, h: f64, springs: &[PointSpring]) -> SolveReport {
    let report = body.step(h, FALL, springs);
    assert_eq!(report.outcome, Outcome::Advanced, "{report:?}");
    assert!(!report.is_unconverged(), "{report:?}");
    report
}

#[test]
fn equilibria_take_few_iterations_at_any_size() {
    let mut iterations = Vec::new();
    for cells in [12, 24] {
        let solve = |method| {
            let mut body = cube(cells, 2, Law::Linear, with(method, Scheme::Static, 1e-5));
            body.cut(&slit(0.55), 1).unwrap();
            let report = advance(&mut body, 1.0, &[]);
            assert_eq!(body.levels().is_some(), method != Method::Pcg);
            if let Some((levels, coarsest)) = body.levels() {
                assert!(coarsest == CoarsestSolve::Cholesky && levels.len() > 1);
            }
            (moved(&body), report.iterations)
        };
        let [pcg, cycles, mg_pcg] = [Method::Pcg, Method::Multigrid, Method::MgPcg].map(solve);
        println!("{cells}³: {} PCG, {} cycles, {} MG-PCG", pcg.1, cycles.1, mg_pcg.1);
        assert!(difference(&cycles.0, &pcg.0) < 1e-3 && difference(&mg_pcg.0, &pcg.0) < 1e-3);
        assert!(mg_pcg.1 <= cycles.1 && 4 * mg_pcg.1 < pcg.1);
        iterations.push(mg_pcg.1);
    }
    assert!(iterations[1] <= iterations[0] + 6);
}

/// The levels follow every cut, and are worked on twice.
#[test]
fn w_cycles_find_the_same_equilibria_in_fewer_iterations() {
    let solve = |cycle| {
        let settings = BodySettings { cycle, ..with(Method::MgPcg, Scheme::Static, 1e-5) };
        let mut body = cube(24, 2, Law::Linear, settings);
        let mut iterations = 0;
        for (incision, x) in (1..).zip([0.3, 0.45, 0.6, 0.75]) {
            body.cut(&slit(x), incision).unwrap();
            iterations += advance(&mut body, 1.0, &[]).iterations;
        }
        (moved(&body), iterations)
    };
    let [v, w] = [CycleShape::V, CycleShape::W].map(solve);
    println!("{} iterations with V-cycles, {} with W-cycles", v.1, w.1);
    assert!(difference(&w.0, &v.0) < 1e-3 && w.1 < v.1);

    let settings = BodySettings { cycle: CycleShape::W, ..with(Method::Pcg, Scheme::Static, 1e-5) };
    let shape = BoxShape { min: Vector3::zeros(), max: Vector3::repeat(1.0) };
    let octree = Octree::fill(&shape, OctreeSettings { cells: 4, levels: 0 }, &|_| 0).unwrap();
    let refused = Body::of_space(Box::new(OctreeSpace::new(octree)), MATERIAL, settings).unwrap_err();
    assert!(refused.to_string().contains("W-cycle"), "{refused}");
}

/// Positions after eight steps with a cut after four, and with springs of `stiffness` [N/m] from the third on: one
/// holds a corner, and one keeps it above a floor.
fn run(method: Method, scheme: Scheme, stiffness: f64) -> (Vec<Vector3<f64>>, u32) {
    // Stiff springs are a large part of the norm of the residual.
    let tolerance = if stiffness > 1e7 { 1e-6 } else { 1e-5 };
    let mut body = cube(12, 2, Law::Corotational, with(method, scheme, tolerance));
    let top = Vector3::new(0.98, 0.51, 0.97);
    let mut iterations = 0;
    for k in 0..8 {
        if k == 4 {
            body.cut(&slit(0.55), 1).unwrap();
        }
        let mut at = body.locate(top, None).unwrap();
        let point = MaterialPoint::new(body.carriers(&mut at));
        let kinds = [
            SpringKind::Hold { target_m: top + Vector3::new(0.0, 0.03, 0.0) },
            SpringKind::OneSided { normal: Vector3::z(), offset_m: 0.96 },
        ];
        let springs =
            kinds.map(|kind| PointSpring { point, kind, stiffness_n_m: stiffness, max_force_n: 1e9 });
        let springs = if k < 2 { &[][..] } else { &springs[..] };
        iterations += advance(&mut body, 0.02, springs).iterations;
    }
    (moved(&body), iterations)
}

#[test]
fn motion_is_that_of_other_solvers_through_cuts_and_springs() {
    for scheme in [
        Scheme::ImplicitEuler,
        Scheme::Bdf2,
        Scheme::Newmark { beta: 0.25, gamma: 0.5 },
        Scheme::GeneralisedAlpha { spectral_radius: 0.8 },
    ] {
        for stiffness in [1e4, 3e6, 1e8] {
            let [pcg, cycles, mg_pcg] =
                [Method::Pcg, Method::Multigrid, Method::MgPcg].map(|method| run(method, scheme, stiffness));
            let counts = [pcg.1, cycles.1, mg_pcg.1];
            println!("{scheme:?}, springs of {stiffness} N/m: {counts:?} iterations of PCG, cycles, MG-PCG");
            let apart = [difference(&cycles.0, &pcg.0), difference(&mg_pcg.0, &pcg.0)];
            assert!(apart.iter().all(|&d| d < 1e-3), "{scheme:?}, {stiffness}: {apart:?}");
            assert!(2 * mg_pcg.1 < pcg.1, "{scheme:?}, {stiffness}: {counts:?}");
        }
    }
}

/// A patch of stiff springs that press on the top of the body.
fn pressed(body: &Body, stiffness_n_m: f64) -> Vec<PointSpring> {
    let place = |i: usize, k: usize| Vector3::new(0.61 + 0.04 * i as f64, 0.42 + 0.04 * k as f64, 0.98);
    let spring = |top: Vector3<f64>| {
        let mut at = body.locate(top, None).unwrap();
        let kind = SpringKind::Hold { target_m: top - Vector3::new(0.0, 0.0, 0.02) };
        PointSpring {
            point: MaterialPoint::new(body.carriers(&mut at)),
            kind,
            stiffness_n_m,
            max_force_n: 1e9,
        }
    };
    (0..9).map(|i| spring(place(i / 3, i % 3))).collect()
}

#[test]
fn stiff_springs_hardly_cost_iterations() {
    let run = |method, stiffness: Option<f64>| {
        let mut body = cube(16, 2, Law::Corotational, with(method, Scheme::ImplicitEuler, 1e-6));
        body.cut(&slit(0.3), 1).unwrap();
        let springs = stiffness.map_or_else(Vec::new, |k| pressed(&body, k));
        let iterations: u32 = (0..4).map(|_| advance(&mut body, 0.02, &springs).iterations).sum();
        (iterations, moved(&body))
    };
    let (free, _) = run(Method::MgPcg, None);
    // Times the stiffness E h of a cell.
    for ratio in [10.0, 100.0, 1000.0] {
        let stiffness = ratio * MATERIAL.young_pa / 16.0;
        let (pcg, mg_pcg) = (run(Method::Pcg, Some(stiffness)), run(Method::MgPcg, Some(stiffness)));
        let apart = difference(&mg_pcg.1, &pcg.1);
        let counts = format!(
            "{ratio} E h: {} PCG, {} MG-PCG, {free} without springs, {apart:.1e} apart",
            pcg.0, mg_pcg.0
        );
        println!("{counts}");
        assert!(apart < 1e-3, "{counts}");
        assert!(3 * mg_pcg.0 < pcg.0 && mg_pcg.0 <= 2 * free, "{counts}");
    }
}

#[test]
fn stiff_springs_keep_steps_free_of_allocations_and_the_same_on_any_number_of_threads() {
    let run = |threads| {
        let settings = BodySettings { threads, ..with(Method::MgPcg, Scheme::ImplicitEuler, 1e-3) };
        let mut body = cube(12, 2, Law::Corotational, settings);
        body.cut(&slit(0.3), 1).unwrap();
        let springs = pressed(&body, 1e6);
        for _ in 0..5 {
            advance(&mut body, 0.01, &springs);
        }
        let before = allocations();
        for _ in 0..5 {
            advance(&mut body, 0.01, &springs);
        }
        assert_eq!(allocations() - before, 0, "{threads} threads");
        body.positions().to_vec()
    };
    let one = run(1);
    assert_eq!(one, run(2));
    assert_eq!(one, run(3));
}

/// A blade that advances by half a cell before each step, past held vertices and through coarse leaves.
#[test]
fn motion_is_that_of_other_solvers_while_a_blade_advances() {
    for law in [Law::Linear, Law::Corotational] {
        let run = |method| {
            let mut body = cube(16, 2, law, with(method, Scheme::ImplicitEuler, 1e-5));
            let (mut links, mut iterations) = (0, 0);
            for k in 0..12 {
                let z = 1.05 - f64::from(k) / 32.0;
                let edge = [Vector3::new(-0.1, 0.47, z), Vector3::new(0.6, 0.52, z)];
                links += body.cut(&BladeSweep { segments: vec![edge] }, 1).unwrap().faces_opened;
                iterations += advance(&mut body, 0.01, &[]).iterations;
            }
            assert!(links > 40);
            (moved(&body), iterations)
        };
        let [pcg, mg_pcg] = [Method::Pcg, Method::MgPcg].map(run);
        assert!(difference(&mg_pcg.0, &pcg.0) < 1e-3, "{law:?}: {:e}", difference(&mg_pcg.0, &pcg.0));
        assert!(mg_pcg.1 <= 12 * 8, "{law:?}: {} iterations, {} of PCG", mg_pcg.1, pcg.1);
    }
}

#[test]
fn steps_with_multigrid_have_the_same_bits_for_any_number_of_threads() {
    let run = |threads, method| {
        let settings = BodySettings { threads, ..with(method, Scheme::ImplicitEuler, 1e-4) };
        let mut body = cube(12, 2, Law::Corotational, settings);
        let edge = |y: f64| [Vector3::new(-0.1, y, 0.4), Vector3::new(1.1, y, 0.52)];
        for k in 0..8 {
            match k {
                3 => drop(body.cut(&slit(0.3), 1).unwrap()),
                5 => drop(body.cut(&BladeSweep { segments: vec![edge(-0.1), edge(0.7)] }, 2).unwrap()),
                _ => {}
            }
            advance(&mut body, 0.02, &[]);
        }
        (body.positions().to_vec(), body.surface().triangles.clone())
    };
    for method in [Method::Multigrid, Method::MgPcg] {
        assert_eq!(run(1, method), run(2, method));
        assert_eq!(run(1, method), run(3, method));
    }
}

#[test]
fn a_steady_step_with_multigrid_does_not_allocate() {
    for method in [Method::Multigrid, Method::MgPcg] {
        let settings = BodySettings { threads: 2, ..with(method, Scheme::ImplicitEuler, 1e-3) };
        let mut body = cube(12, 2, Law::Corotational, settings);
        body.cut(&slit(0.55), 1).unwrap();
        for _ in 0..5 {
            advance(&mut body, 0.01, &[]);
        }
        let before = allocations();
        for _ in 0..5 {
            advance(&mut body, 0.01, &[]);
        }
        assert_eq!(allocations() - before, 0, "{method:?}");
    }
}
