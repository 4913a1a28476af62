//! Equilibria of corotational cells without a matrix: linear solves with a line search, against Newton's method of
//! the general path.

use nalgebra::Vector3;
use scindo_allocations::allocations;
use scindo_physics::body::{
    Arithmetic, Body, BodySettings, Method, Outcome, PcgSettings, PointSpring, Scheme, SolveReport,
    SpringKind,
};
use scindo_physics::cut::BladeSweep;
use scindo_physics::element::MaterialPoint;
use scindo_physics::material::{Law, Material, Rayleigh, Region};
use scindo_physics::octree::{BoxShape, Octree, OctreeSettings};
use scindo_physics::solver::StopReason;
use scindo_physics::space::OctreeSpace;

/// Soft enough to hang down from the wall at its own weight.
const MATERIAL: Material = Material {
    young_pa: 3e4,
    poisson: 0.3,
    density_kg_m3: 1000.0,
    rayleigh: Rayleigh { mass_1_s: 0.0, stiffness_s: 0.0 },
    law: Law::Corotational,
};
const FALL: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);

/// A bar of length 1 m, a quarter as high, `cells` long, held at x = 0.
fn bar(cells: u32, levels: u8, settings: BodySettings) -> Body {
    let shape = BoxShape { min: Vector3::zeros(), max: Vector3::new(1.0, 0.5, 0.25) };
    let region = |p: &Vector3<f64>| u16::from(p.y > 0.25);
    let mut octree = Octree::fill(&shape, OctreeSettings { cells, levels }, &region).unwrap();
    octree.set_regions(vec![Region { young_pa: 9e4, poisson: 0.4, density_kg_m3: 1000.0 }]);
    hold(Body::of_space(Box::new(OctreeSpace::new(octree)), MATERIAL, settings).unwrap())
}

/// A cube of 1 m of one material, held at x = 0.
fn cube(cells: u32, levels: u8, young_pa: f64, settings: BodySettings) -> Body {
    let shape = BoxShape { min: Vector3::zeros(), max: Vector3::repeat(1.0) };
    let octree = Octree::fill(&shape, OctreeSettings { cells, levels }, &|_| 0).unwrap();
    let material = Material { young_pa, ..MATERIAL };
    hold(Body::of_space(Box::new(OctreeSpace::new(octree)), material, settings).unwrap())
}

fn hold(mut body: Body) -> Body {
    let held: Vec<u32> =
        (0..).zip(body.rest_positions()).filter(|(_, X)| X.x < 1e-9).map(|(n, _)| n).collect();
    body.fix(&held, [true; 3], Vector3::zeros()).unwrap();
    body
}

fn fast(method: Method, tolerance: f64) -> BodySettings {
    let solver = PcgSettings { iterations: 1000, tolerance };
    let arithmetic = Some(Arithmetic::Single);
    BodySettings { scheme: Scheme::Static, method, solver, arithmetic, ..BodySettings::default() }
}

fn general() -> BodySettings {
    let arithmetic = Some(Arithmetic::Double);
    BodySettings { arithmetic, ..fast(Method::Cholesky, 1e-11) }
}

fn step(body: &mut Body, springs: &[PointSpring]) -> SolveReport {
    let report = body.step(1.0, FALL, springs);
    assert_eq!((report.outcome, report.is_unconverged()), (Outcome::Advanced, false), "{report:?}");
    report
}

/// Largest distance between vertices, relative to the largest displacement of `b`.
fn difference(a: &Body, b: &Body) -> f64 {
    let largest = |u: &mut dyn Iterator<Item = f64>| u.fold(0.0, f64::max);
    let apart = largest(&mut a.positions().iter().zip(b.positions()).map(|(a, b)| (a - b).norm()));
    apart / largest(&mut b.positions().iter().zip(b.rest_positions()).map(|(x, X)| (x - X).norm()))
}

#[test]
fn a_hanging_bar_has_the_equilibrium_of_newtons_method() {
    for (cells, levels) in [(8, 0), (16, 2)] {
        let mut reference = bar(cells, levels, general());
        assert!(!reference.is_fast());
        step(&mut reference, &[]);
        let tip = reference.positions().iter().map(|x| x.z).fold(f64::INFINITY, f64::min);
        assert!(tip < -0.15, "it hangs by {tip}");
        for method in [Method::MgPcg, Method::Pcg] {
            let mut body = bar(cells, levels, fast(method, 1e-9));
            assert!(body.is_fast());
            let report = step(&mut body, &[]);
            let apart = difference(&body, &reference);
            assert!(apart < 1e-8, "{method:?} {cells}: {apart:.2e}, {report:?}");
        }
    }
}

#[test]
fn cubes_of_any_size_take_few_solves() {
    let mut solves = Vec::new();
    for cells in [8, 16, 32] {
        let mut body = cube(cells, 0, 1e5, fast(Method::MgPcg, 1e-6));
        let report = step(&mut body, &[]);
        solves.push((report.newton_steps, report.iterations));
    }
    assert!(solves.iter().all(|&(solves, iterations)| solves <= 30 && iterations <= 120), "{solves:?}");
}

/// Half through the bar, from above.
fn slit(x: f64) -> BladeSweep {
    let edge = |z: f64| [Vector3::new(x, -0.2, z), Vector3::new(x + 0.03, 0.7, z)];
    BladeSweep { segments: vec![edge(0.3), edge(0.12)] }
}

#[test]
fn cuts_and_displaced_vertices_have_the_equilibrium_of_newtons_method() {
    let make = |settings| {
        let mut body = bar(16, 2, settings);
        let pulled: Vec<u32> =
            (0..).zip(body.rest_positions()).filter(|(_, X)| X.x > 1.0 - 1e-9).map(|(n, _)| n).collect();
        body.fix(&pulled, [true, true, true], Vector3::new(0.05, 0.0, -0.2)).unwrap();
        body.cut(&slit(0.41), 1).unwrap();
        step(&mut body, &[]);
        body
    };
    let (body, reference) = (make(fast(Method::MgPcg, 1e-8)), make(general()));
    assert!(body.is_fast() && body.positions().len() > bar(16, 2, general()).positions().len());
    let apart = difference(&body, &reference);
    assert!(apart < 1e-8, "{apart:.2e}");
}

/// A spring that pulls the vertex nearest to `X` to `target_m`.
fn pull(body: &Body, X: Vector3<f64>, target_m: Vector3<f64>) -> PointSpring {
    let near = |&(_, p): &(u32, &Vector3<f64>)| (p - X).norm() < 1e-9;
    let (vertex, _) = (0u32..).zip(body.rest_positions()).find(near).unwrap();
    PointSpring {
        point: MaterialPoint::new([(vertex, 1.0)]),
        kind: SpringKind::Hold { target_m },
        stiffness_n_m: 50.0,
        max_force_n: 8.0,
    }
}

#[test]
fn springs_end_in_balance_with_the_body() {
    let tip = Vector3::new(1.0, 0.5, 0.25);
    let run = |settings| {
        let mut body = bar(16, 2, settings);
        let spring = pull(&body, tip, Vector3::new(0.9, 0.7, 0.6));
        step(&mut body, &[spring]);
        (body.spring_forces()[0], body)
    };
    let (force, body) = run(fast(Method::MgPcg, 1e-7));
    let (expected, reference) = run(general());
    assert!((expected.norm() - 8.0).abs() < 1e-6, "the spring reaches its cap: {expected}");
    assert!((force - expected).norm() < 1e-4 * expected.norm(), "{force} {expected}");
    assert!(difference(&body, &reference) < 1e-5);
}

#[test]
fn the_result_has_the_same_bits_for_every_number_of_threads_and_a_steady_step_allocates_nothing() {
    let run = |threads| {
        let mut body = bar(16, 2, BodySettings { threads, ..fast(Method::MgPcg, 1e-6) });
        step(&mut body, &[]);
        body
    };
    let mut one = run(1);
    for threads in [2, 3] {
        assert_eq!(one.positions(), run(threads).positions(), "{threads} threads");
    }
    // Gravity changes from step to step, so that each has something to solve.
    let mut allocated = 0;
    for k in 1..8 {
        let before = allocations();
        let report = one.step(1.0, FALL * (1.0 + 0.02 * f64::from(k)), &[]);
        allocated = allocations() - before;
        assert!(report.iterations > 0 && !report.is_unconverged(), "{k} {report:?}");
    }
    assert_eq!(allocated, 0);
}

#[test]
fn what_has_no_equilibrium_is_refused_and_what_is_out_of_steps_says_so() {
    let mut free = bar(8, 0, fast(Method::MgPcg, 1e-6));
    let all: Vec<u32> = free.fixed_nodes().iter().map(|held| held.node).collect();
    free.release(&all);
    assert_eq!(free.step(1.0, FALL, &[]).outcome, Outcome::Refused);
    let few = BodySettings { newton_steps: Some(4), ..fast(Method::MgPcg, 1e-9) };
    let mut body = bar(8, 0, few);
    let first = body.step(1.0, FALL, &[]);
    assert_eq!((first.stop, first.newton_steps), (StopReason::IterationLimit, 4), "{first:?}");
    assert!(first.is_unconverged() && first.residual > 1e-9, "{first:?}");
    // Later steps go on from there.
    let last = (0..40).map(|_| body.step(1.0, FALL, &[])).find(|report| !report.is_unconverged());
    assert!(last.is_some());
}

#[test]
fn a_cube_of_64_cells_across_converges() {
    let mut body = cube(64, 0, 1e5, fast(Method::MgPcg, 1e-6));
    let report = step(&mut body, &[]);
    let low = body.positions().iter().map(|x| x.z).fold(f64::INFINITY, f64::min);
    assert!(report.newton_steps <= 30 && report.iterations <= 150 && low < -0.1, "{low} {report:?}");
}
