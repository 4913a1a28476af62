//! Nodes that are held in inclined directions: rollers on an incline and in a groove.

use nalgebra::{Rotation3, Vector3};
use scindo_allocations::allocations;
use scindo_physics::body::{
    Arithmetic, Body, BodySettings, ElementKind, Method, Outcome, PcgSettings, Scheme,
};
use scindo_physics::element::Held;
use scindo_physics::material::{Law, Material, Rayleigh};
use scindo_physics::mesh::{BoxPattern, box_hexes, box_mesh};
use scindo_physics::octree::{BoxShape, Octree, OctreeSettings};
use scindo_physics::space::OctreeSpace;

use crate::SOFT;

type V = Vector3<f64>;

const FALL: V = V::new(0.0, 0.0, -9.81);
/// Incline of the rollers.
const NORMAL: V = V::new(1.0, 0.3, 2.0);
const MOVING: [Scheme; 7] = [
    Scheme::SymplecticEuler,
    Scheme::Midpoint,
    Scheme::Rk4,
    Scheme::ImplicitEuler,
    Scheme::Bdf2,
    Scheme::Newmark { beta: 0.25, gamma: 0.5 },
    Scheme::GeneralisedAlpha { spectral_radius: 0.8 },
];

fn solver(iterations: u32, tolerance: f64) -> BodySettings {
    BodySettings { solver: PcgSettings { iterations, tolerance }, ..BodySettings::default() }
}

fn select(body: &Body, choose: impl Fn(&V) -> bool) -> Vec<u32> {
    let rest = body.rest_positions().iter();
    (0..).zip(rest).filter(|(_, X)| choose(X)).map(|(n, _)| n).collect()
}

fn octree(cells: u32, levels: u8, material: Material, settings: BodySettings) -> Body {
    let shape = BoxShape { min: V::zeros(), max: V::repeat(0.1) };
    let octree = Octree::fill(&shape, OctreeSettings { cells, levels }, &|_| 0).unwrap();
    Body::of_space(Box::new(OctreeSpace::new(octree)), material, settings).unwrap()
}

/// A cube of 0.1 m of each kind that these settings allow.
fn cubes(settings: BodySettings) -> Vec<(&'static str, Body)> {
    let tets = || box_mesh(V::zeros(), V::repeat(0.1), [3; 3], BoxPattern::Tet6);
    let with = |element| BodySettings { element, ..settings };
    vec![
        ("tet4", Body::new(tets(), SOFT, with(ElementKind::Tet4)).unwrap()),
        ("tet10", Body::new(tets(), SOFT, with(ElementKind::Tet10)).unwrap()),
        (
            "hex8",
            Body::hex8(box_hexes(V::zeros(), V::repeat(0.1), [3; 3]), SOFT, with(ElementKind::Hex8)).unwrap(),
        ),
        ("octree", octree(8, 1, SOFT, settings)),
    ]
}

/// Largest distance [m] of held nodes from where they are held, and their largest velocity [m/s] there.
fn violation(body: &Body) -> [f64; 2] {
    let of = |vector: &dyn Fn(usize) -> V| {
        let held = body.fixed_nodes().iter();
        held.map(|f| f.held.part_of(&vector(f.node as usize)).norm()).fold(0.0, f64::max)
    };
    [of(&|n| body.positions()[n] - body.rest_positions()[n]), of(&|n| body.velocities()[n])]
}

#[test]
fn a_block_slides_down_a_smooth_incline() {
    let n = NORMAL.normalize();
    let pull = FALL - n * n.dot(&FALL);
    for scheme in MOVING {
        for (name, mut body) in cubes(BodySettings { scheme, ..solver(400, 1e-8) }) {
            let base = select(&body, |X| X.z < 1e-9);
            body.fix(&base, Held::along(NORMAL).unwrap(), V::zeros()).unwrap();
            for step in 1..=20 {
                let report = body.step(0.002, FALL, &[]);
                assert_eq!(report.outcome, Outcome::Advanced, "{name} {scheme:?}: {report:?}");
                let [apart, drift] = violation(&body);
                assert!(apart <= 1e-12 && drift <= 1e-11, "{name} {scheme:?}: {apart} m, {drift} m/s");
                let v = body.momentum() / body.masses().iter().sum::<f64>();
                let (sliding, exact) = (v - n * n.dot(&v), pull * 0.002 * f64::from(step));
                let error = (sliding - exact).norm() / exact.norm();
                assert!(error <= 1e-6, "{name} {scheme:?}, step {step}: error {error}");
            }
        }
    }
}

/// The exact solution is in the space of the elements: stress along one axis of a block that is turned in space.
#[test]
fn a_turned_block_between_rollers_stretches_evenly() {
    let (R, stretch) = (Rotation3::from_euler_angles(0.4, -0.7, 1.1), 0.02);
    let material = Material { law: Law::Linear, ..SOFT };
    let exact = |X: &V| {
        let local = R.inverse() * X;
        X + R * V::new(stretch * local.x, -0.33 * stretch * local.y, -0.33 * stretch * local.z)
    };
    let solves = [
        (Method::Cholesky, Arithmetic::Double, 1e-11),
        (Method::Cholesky, Arithmetic::Mixed, 1e-9),
        (Method::Pcg, Arithmetic::Double, 1e-9),
        (Method::Cg, Arithmetic::Double, 1e-9),
        (Method::Pcg, Arithmetic::Single, 1e-5),
    ];
    for element in [ElementKind::Tet4, ElementKind::Tet10, ElementKind::Hex8] {
        for (method, arithmetic, bound) in solves {
            if arithmetic == Arithmetic::Single && element != ElementKind::Tet4 {
                continue;
            }
            let settings = BodySettings {
                scheme: Scheme::Static,
                element,
                method,
                arithmetic: Some(arithmetic),
                ..solver(5000, if arithmetic == Arithmetic::Single { 3e-5 } else { 1e-10 })
            };
            let what = format!("{element:?} {method:?} {arithmetic:?}");
            let mut mesh = box_mesh(V::zeros(), V::repeat(0.1), [3; 3], BoxPattern::Tet6);
            let mut hexes = box_hexes(V::zeros(), V::repeat(0.1), [3; 3]);
            mesh.nodes.iter_mut().chain(&mut hexes.nodes).for_each(|X| *X = R * *X);
            let mut body = match element {
                ElementKind::Hex8 => Body::hex8(hexes, material, settings),
                _ => Body::new(mesh, material, settings),
            }
            .unwrap();
            for axis in 0..3 {
                let face = select(&body, |X| (R.inverse() * X)[axis].abs() < 1e-9);
                body.fix(&face, Held::along(R * V::ith(axis, 1.0)).unwrap(), V::zeros()).unwrap();
            }
            let far = select(&body, |X| (R.inverse() * X).x > 0.1 - 1e-9);
            let pulled = R * V::new(0.1 * stretch, 5.0, -3.0);
            body.fix(&far, Held::along(R * V::x()).unwrap(), pulled).unwrap();
            for _ in 0..2 {
                let report = body.step(1.0, V::zeros(), &[]);
                assert!(
                    report.outcome == Outcome::Advanced && !report.is_unconverged(),
                    "{what}: {report:?}"
                );
            }
            let rest = body.rest_positions();
            let error = body.positions().iter().zip(rest).map(|(x, X)| (x - exact(X)).norm());
            let error = error.fold(0.0, f64::max) / (0.1 * stretch);
            assert!(error <= bound, "{what}: error {error}");
            // The reaction of the far face is the force on a cross-section.
            let force = body.reaction(&far, V::zeros());
            let wanted = R * V::new(material.young_pa * stretch * 0.01, 0.0, 0.0);
            assert!((force - wanted).norm() <= 1e3 * bound * wanted.norm(), "{what}: {force} {wanted}");
        }
    }
}

/// A block of cells between two inclined faces, free to slide on both.
fn wedged(cells: u32, levels: u8, inclined: bool, settings: BodySettings) -> Body {
    let material = Material {
        young_pa: 1e4,
        density_kg_m3: 1000.0,
        law: Law::Linear,
        rayleigh: Rayleigh::default(),
        ..SOFT
    };
    let mut body = octree(cells, levels, material, settings);
    let faces = [(0.0, V::new(1.0, 0.0, 0.8)), (0.1, V::new(1.0, 0.3, -1.2))];
    for (x, normal) in faces {
        let face = select(&body, |X| (X.x - x).abs() < 1e-9);
        let held = if inclined { Held::along(normal).unwrap() } else { Held::Axes([true, false, true]) };
        body.fix(&face, held, V::zeros()).unwrap();
    }
    let side = select(&body, |X| X.y < 1e-9);
    body.fix(&side, [false, true, false], V::zeros()).unwrap();
    body
}

#[test]
fn multigrid_finds_what_factors_find_between_inclined_faces() {
    for scheme in [Scheme::Static, Scheme::ImplicitEuler] {
        let with = |method, arithmetic, tolerance| BodySettings {
            scheme,
            method,
            arithmetic: Some(arithmetic),
            ..solver(2000, tolerance)
        };
        let fast = with(Method::MgPcg, Arithmetic::Single, 1e-6);
        let mut exact = wedged(8, 2, true, with(Method::Cholesky, Arithmetic::Double, 1e-12));
        let mut body = wedged(8, 2, true, fast);
        for _ in 0..3 {
            exact.step(0.02, FALL, &[]);
            let report = body.step(0.02, FALL, &[]);
            assert!(!report.is_unconverged(), "{scheme:?}: {report:?}");
            assert!(violation(&body)[0] <= 1e-12);
        }
        let moved = |body: &Body, n: usize| body.positions()[n] - body.rest_positions()[n];
        let most = (0..exact.n_copies()).map(|n| moved(&exact, n).norm()).fold(0.0, f64::max);
        let apart = (exact.positions().iter().zip(body.positions())).map(|(a, b)| (a - b).norm());
        let apart = apart.fold(0.0, f64::max);
        assert!(apart <= 2e-4 * most, "{scheme:?}: {apart} of {most}");
        // Inclined faces take hardly more iterations than faces that are held along axes, on any grid.
        let iterations = |cells, levels, inclined| {
            let mut body = wedged(cells, levels, inclined, fast);
            body.step(0.02, FALL, &[]).iterations
        };
        for (cells, levels) in [(8, 2), (16, 3)] {
            let [inclined, plain] = [true, false].map(|inclined| iterations(cells, levels, inclined));
            assert!(inclined <= 2 * plain + 4, "{scheme:?}, {cells} cells: {inclined}, {plain} along axes");
        }
    }
}

#[test]
fn inclined_steps_allocate_nothing_and_released_nodes_are_free() {
    let mut body = octree(8, 1, SOFT, solver(100, 1e-6));
    let base = select(&body, |X| X.z < 1e-9);
    body.fix(&base, Held::across(V::new(1.0, 1.0, 0.0)).unwrap(), V::zeros()).unwrap();
    for _ in 0..3 {
        body.step(0.002, FALL, &[]);
    }
    let before = allocations();
    body.step(0.002, FALL, &[]);
    assert_eq!(allocations() - before, 0);
    assert!(violation(&body)[0] <= 1e-12);
    body.release(&base);
    let before = body.momentum();
    body.step(0.002, FALL, &[]);
    let mass: f64 = body.masses().iter().sum();
    assert!(((body.momentum() - before) / mass - 0.002 * FALL).norm() < 1e-7);
}
