//! Viscoelastic bodies against closed forms of relaxation and creep, under rotation, and across cuts and other changes of
//! the elements.

use nalgebra::{Rotation3, Vector3};
use scindo_allocations::allocations;
use scindo_physics::body::{
    Arithmetic, Body, BodyError, BodySettings, CuttingMethod, ElementKind, Method, Outcome, PcgSettings,
    Scheme, StaticSettings,
};
use scindo_physics::cut::BladeSweep;
use scindo_physics::material::{Law, Material, Prony, PronyTerm, Rayleigh};
use scindo_physics::mesh::{BoxPattern, box_hexes, box_mesh};
use scindo_physics::octree::{AdaptSettings, BoxShape, Octree, OctreeSettings};
use scindo_physics::space::OctreeSpace;

const SIDE: f64 = 0.2;
const TERMS: [PronyTerm; 2] = [PronyTerm { ratio: 0.8, time_s: 0.1 }, PronyTerm { ratio: 0.5, time_s: 1.5 }];
const ELEMENTS: [ElementKind; 4] =
    [ElementKind::Tet4, ElementKind::Tet10, ElementKind::Hex8, ElementKind::Octree];
const DOWN: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);

fn material(law: Law) -> Material {
    let rayleigh = Rayleigh { mass_1_s: 0.0, stiffness_s: 0.0 };
    Material { young_pa: 2e4, poisson: 0.3, density_kg_m3: 1000.0, rayleigh, law }
}

fn settings(scheme: Scheme) -> BodySettings {
    BodySettings {
        scheme,
        method: Method::Cholesky,
        arithmetic: Some(Arithmetic::Double),
        solver: PcgSettings { iterations: 400, tolerance: 1e-11 },
        prony: Prony::new(TERMS),
        ..BodySettings::default()
    }
}

/// A cube with four cells along each side.
fn cube(law: Law, settings: BodySettings) -> Result<Body, BodyError> {
    let (size, material) = (Vector3::repeat(SIDE), material(law));
    match settings.element {
        ElementKind::Hex8 => Body::hex8(box_hexes(Vector3::zeros(), size, [4; 3]), material, settings),
        ElementKind::Octree => {
            let shape = BoxShape { min: Vector3::zeros(), max: size };
            let octree = Octree::fill(&shape, OctreeSettings { cells: 8, levels: 1 }, &|_| 0).unwrap();
            Body::of_space(Box::new(OctreeSpace::new(octree)), material, settings)
        }
        _ => Body::new(box_mesh(Vector3::zeros(), size, [4; 3], BoxPattern::Tet6), material, settings),
    }
}

fn nodes(body: &Body, inside: impl Fn(&Vector3<f64>) -> bool) -> Vec<u32> {
    (0..).zip(body.rest_positions()).filter(|(_, X)| inside(X)).map(|(n, _)| n).collect()
}

/// Prescribes the positions of all nodes of the boundary.
fn place(body: &mut Body, position: impl Fn(&Vector3<f64>) -> Vector3<f64>) {
    let boundary = nodes(body, |X| X.iter().any(|c| *c < 1e-9 || *c > SIDE - 1e-9));
    for node in boundary {
        let X = body.rest_positions()[node as usize];
        body.fix(&[node], [true; 3], position(&X) - X).unwrap();
    }
}

fn step(body: &mut Body, h: f64) {
    let report = body.step(h, Vector3::zeros(), &[]);
    assert_eq!(report.outcome, Outcome::Advanced, "{report:?}");
}

/// Shear modulus [Pa] at time `t` [s] after a shear that grew evenly from −`ramp` to 0 s.
fn modulus(t: f64, ramp: f64) -> f64 {
    let left = |term: &PronyTerm| {
        let x = ramp / term.time_s;
        term.ratio * -(-x).exp_m1() / x * (-t / term.time_s).exp()
    };
    2e4 / 2.6 * (1.0 + TERMS.iter().map(left).sum::<f64>())
}

#[test]
fn held_shear_relaxes_as_the_prony_series_says() {
    for element in ELEMENTS {
        for arithmetic in [Arithmetic::Double, Arithmetic::Mixed] {
            let with = BodySettings { element, arithmetic: Some(arithmetic), ..settings(Scheme::Static) };
            let mut body = cube(Law::Linear, with).unwrap();
            place(&mut body, |X| X + Vector3::new(0.05 * X.z, 0.0, 0.0));
            let top = nodes(&body, |X| X.z > SIDE - 1e-9);
            let mut t = 0.0;
            for (k, h) in [0.02, 0.02, 0.1, 0.5, 3.0, 100.0].into_iter().enumerate() {
                step(&mut body, h);
                t += if k == 0 { 0.0 } else { h };
                let expected = 0.05 * modulus(t, 0.02) * SIDE * SIDE;
                let found = body.reaction(&top, Vector3::zeros()).x;
                assert!((found / expected - 1.0).abs() < 1e-8, "{element:?} at {t} s: {found} {expected} N");
                let stress = body.cauchy_stresses()[0][(0, 2)];
                assert!((stress / (0.05 * modulus(t, 0.02)) - 1.0).abs() < 0.06, "{element:?}: {stress} Pa");
            }
        }
    }
}

/// Uniaxial creep: the shear compliance is (1 − g/(1+g) exp(−t/(τ (1+g))))/μ, and the bulk stays elastic.
#[test]
fn a_loaded_bar_creeps_as_the_compliance_says() {
    let (g, tau, E, nu, traction) = (1.5, 0.4, 2e4, 0.3, 100.0);
    let (mu, bulk) = (E / (2.0 * (1.0 + nu)), E / (3.0 * (1.0 - 2.0 * nu)));
    for (element, scheme) in [(ElementKind::Tet4, Scheme::Static), (ElementKind::Tet10, Scheme::Static)] {
        let error = |h: f64| {
            let prony = Prony::new([PronyTerm { ratio: g, time_s: tau }]);
            let with = BodySettings { element, prony, ..settings(scheme) };
            let mut body = cube(Law::Linear, with).unwrap();
            for axis in 0..3 {
                let held = nodes(&body, |X| X[axis] < 1e-9);
                body.fix(&held, std::array::from_fn::<bool, 3, _>(|k| k == axis), Vector3::zeros()).unwrap();
            }
            let end = nodes(&body, |X| X.z > SIDE - 1e-9);
            let force = Vector3::new(0.0, 0.0, traction * SIDE * SIDE);
            body.add_surface_force(&end, force).unwrap();
            let length = |body: &Body| body.positions()[end[0] as usize].z / SIDE - 1.0;
            // The first step is short: the load comes suddenly.
            step(&mut body, 1e-5);
            let creep = |t: f64| 1.0 - g / (1.0 + g) * (-t / (tau * (1.0 + g))).exp();
            let expected = |t: f64| traction * (1.0 / (9.0 * bulk) + creep(t) / (3.0 * mu));
            assert!((length(&body) / expected(0.0) - 1.0).abs() < 1e-4, "{element:?}: {}", length(&body));
            let mut worst = 0.0_f64;
            for k in 1..=(2.0 / h) as u32 {
                step(&mut body, h);
                worst = worst.max((length(&body) / expected(f64::from(k) * h) - 1.0).abs());
            }
            worst
        };
        let (coarse, fine) = (error(0.1), error(0.05));
        assert!(coarse < 2e-3 && (3.5..4.5).contains(&(coarse / fine)), "order 2: {coarse} {fine}");
    }
}

#[test]
fn rotations_neither_load_the_springs_nor_change_what_is_in_them() {
    for element in ELEMENTS {
        for law in [Law::Corotational, Law::NeoHookean] {
            let with = BodySettings { element, ..settings(Scheme::Static) };
            let stretch = |X: &Vector3<f64>| Vector3::new(1.1 * X.x + 0.1 * X.y, 0.95 * X.y, 1.05 * X.z);
            let (mut still, mut turning) = (cube(law, with).unwrap(), cube(law, with).unwrap());
            let mut most = 0.0_f64;
            for k in 0..6 {
                let Q = Rotation3::new(0.4 * f64::from(k) * Vector3::new(0.3, -0.8, 0.5)).into_inner();
                place(&mut still, stretch);
                place(&mut turning, |X| Q * stretch(X));
                step(&mut still, 0.05);
                step(&mut turning, 0.05);
                let size = still.internal_forces().iter().map(|f| f.norm()).fold(0.0, f64::max);
                for (f, turned) in still.internal_forces().iter().zip(turning.internal_forces()) {
                    most = most.max((Q * f - turned).norm() / size);
                }
                let energies = [still.elastic_energy(), turning.elastic_energy()];
                assert!((energies[1] / energies[0] - 1.0).abs() < 1e-8, "{element:?} {law:?}: {energies:?}");
            }
            assert!(most < 1e-7, "{element:?} {law:?}: forces differ by {most}");
        }
    }
}

fn sag(body: &mut Body) {
    let held = nodes(body, |X| X.x < 1e-9);
    body.fix(&held, [true; 3], Vector3::zeros()).unwrap();
}

/// Free oscillations of a bent cube: energy at the end of 100 steps over that at the start. It never rises.
fn left(scheme: Scheme, prony: Prony) -> f64 {
    let with = BodySettings { prony, newton_steps: Some(20), ..settings(scheme) };
    let mut body = cube(Law::Corotational, with).unwrap();
    sag(&mut body);
    let bent = |X: &Vector3<f64>| Vector3::new(X.x, X.y, X.z - 1.5 * X.x * X.x);
    let x: Vec<_> = body.rest_positions().iter().map(bent).collect();
    let v = vec![Vector3::zeros(); x.len()];
    body.set_state(&x, &v).unwrap();
    let start = body.elastic_energy() + body.kinetic_energy();
    let mut last = start;
    for k in 0..100 {
        step(&mut body, 0.002);
        let now = body.elastic_energy() + body.kinetic_energy();
        assert!(now < last + 1e-3 * start, "{} {k}: {last} → {now} J", scheme.name());
        last = now;
    }
    last / start
}

#[test]
fn energy_only_falls_and_dashpots_damp() {
    for scheme in [Scheme::ImplicitEuler, Scheme::Bdf2] {
        left(scheme, Prony::new(TERMS));
    }
    let newmark = Scheme::Newmark { beta: 0.25, gamma: 0.5 };
    let elastic = left(newmark, Prony::default());
    let viscous = left(newmark, Prony::new([PronyTerm { ratio: 0.3, time_s: 0.02 }]));
    assert!(elastic > 0.9 && viscous < 0.5, "{elastic} {viscous}");
}

/// A cut leaves stress and energy of the material as they are; undoing it, too, where nothing has moved. Divided cells have
/// more quadrature points, and thin pieces of quadratic tetrahedra one strain for each term.
#[test]
fn cuts_and_undoing_them_leave_the_springs_as_they_are() {
    for (element, exact) in
        [(ElementKind::Tet4, 1e-12), (ElementKind::Octree, 1e-7), (ElementKind::Tet10, 3e-3)]
    {
        let with = BodySettings { element, ..settings(Scheme::ImplicitEuler) };
        let mut body = cube(Law::Corotational, with).unwrap();
        sag(&mut body);
        for _ in 0..8 {
            assert_eq!(body.step(0.01, DOWN, &[]).outcome, Outcome::Advanced);
        }
        let same = |body: &Body, energy: f64, what: &str| {
            let now = body.elastic_energy();
            assert!((now / energy - 1.0).abs() < exact, "{element:?}, {what}: {energy} → {now} J");
        };
        let energy = body.elastic_energy();
        let topology = body.topology();
        for (k, z) in [0.11, 0.06].into_iter().enumerate() {
            let segment = |y: f64| [Vector3::new(0.04, y, z), Vector3::new(0.3, y, z - 0.01)];
            let blade = BladeSweep { segments: vec![segment(-0.1), segment(0.09), segment(0.3)] };
            let report = body.cut(&blade, k as u32 + 1).unwrap();
            assert!(report.elements_cut > 0 || element == ElementKind::Octree, "{report:?}");
            same(&body, energy, "cut");
        }
        let copies = body.n_copies();
        body.restore(topology).unwrap();
        assert!(body.n_copies() < copies);
        same(&body, energy, "undone");
        // Cut again, it moves on, and at rest nothing is left.
        let segment = |y: f64| [Vector3::new(0.04, y, 0.11), Vector3::new(0.3, y, 0.11)];
        body.cut(&BladeSweep { segments: vec![segment(-0.1), segment(0.3)] }, 3).unwrap();
        for _ in 0..20 {
            assert_eq!(body.step(0.01, DOWN, &[]).outcome, Outcome::Advanced);
        }
        body.reset().unwrap();
        assert!(body.elastic_energy() < 1e-20, "{} J", body.elastic_energy());
    }
}

/// A world undoes cuts of all its bodies at once.
#[test]
fn undoing_nothing_leaves_hexahedra_as_they_are() {
    let with = BodySettings { element: ElementKind::Hex8, ..settings(Scheme::ImplicitEuler) };
    let mut body = cube(Law::Corotational, with).unwrap();
    sag(&mut body);
    for _ in 0..4 {
        body.step(0.01, DOWN, &[]);
    }
    let (energy, topology) = (body.elastic_energy(), body.topology());
    body.restore(topology).unwrap();
    assert!((body.elastic_energy() / energy - 1.0).abs() < 1e-12);
    assert_eq!(body.step(0.01, DOWN, &[]).outcome, Outcome::Advanced);
}

/// In uniaxial tension no plane along it carries any traction: cut there, a bar relaxes as a whole one does. The cut passes
/// through nodes, so that the ends of both halves are held as before.
#[test]
fn a_bar_split_along_its_tension_relaxes_as_if_it_were_whole() {
    for element in [ElementKind::Tet4, ElementKind::Tet10] {
        let run = |cut: bool| {
            let mut body = cube(Law::Linear, BodySettings { element, ..settings(Scheme::Static) }).unwrap();
            let of = |axis: usize| std::array::from_fn::<bool, 3, _>(|k| k == axis);
            for axis in 0..3 {
                let held = nodes(&body, |X| X[axis] < 1e-9);
                body.fix(&held, of(axis), Vector3::zeros()).unwrap();
            }
            let end = nodes(&body, |X| X.x > SIDE - 1e-9);
            body.fix(&end, of(0), Vector3::new(0.05 * SIDE, 0.0, 0.0)).unwrap();
            let mut pulls = Vec::new();
            for k in 0..6 {
                if cut && k == 2 {
                    let middle = nodes(&body, |X| (X.z - 0.5 * SIDE).abs() < 1e-9)[0];
                    let z = body.positions()[middle as usize].z;
                    let segment = |y: f64| [Vector3::new(-0.1, y, z), Vector3::new(0.3, y, z)];
                    body.cut(&BladeSweep { segments: vec![segment(-0.1), segment(0.3)] }, 1).unwrap();
                    // The upper half would be free to move up.
                    let top = nodes(&body, |X| X.z > SIDE - 1e-9)[0];
                    let up = body.positions()[top as usize] - body.rest_positions()[top as usize];
                    body.fix(&[top], of(2), up).unwrap();
                }
                step(&mut body, 0.05);
                pulls.push(body.reaction(&end, Vector3::zeros()).x);
            }
            pulls
        };
        let (whole, halves) = (run(false), run(true));
        assert!(whole[5] < 0.8 * whole[0], "it must relax: {whole:?}");
        for (whole, halves) in whole.iter().zip(&halves) {
            assert!((halves / whole - 1.0).abs() < 1e-7, "{element:?}: {whole} N, cut {halves} N");
        }
    }
}

#[test]
fn springs_follow_refined_and_joined_cells() {
    let with = BodySettings { element: ElementKind::Octree, ..settings(Scheme::ImplicitEuler) };
    let mut body = cube(Law::Corotational, with).unwrap();
    sag(&mut body);
    let near = AdaptSettings { distance_m: Some([0.05, 0.08]), speed_m_s: None, error: None, level: 0 };
    let mut seen = [0; 2];
    for k in 0..40 {
        assert_eq!(body.step(0.01, DOWN, &[]).outcome, Outcome::Advanced);
        let tool = Vector3::new(0.01 * f64::from(k) - 0.1, 0.1, 0.1);
        let energy = body.elastic_energy();
        let report = body.adapt(&near, &[tool], None).unwrap();
        let change = (body.elastic_energy() - energy).abs();
        assert!(report.joined > 0 || change < 1e-6 * energy, "divided: {change} of {energy} J");
        assert!(change < 0.02 * energy, "{change} of {energy} J");
        seen[0] += report.divided;
        seen[1] += report.joined;
    }
    assert!(seen.iter().all(|n| *n > 0), "{seen:?}");
}

#[test]
fn equilibria_are_those_of_the_elastic_body() {
    let solve = |prony: Prony| {
        let with = BodySettings { prony, ..settings(Scheme::ImplicitEuler) };
        let mut body = cube(Law::Corotational, with).unwrap();
        sag(&mut body);
        body.step(0.01, DOWN, &[]);
        assert!(body.solve_static(DOWN, &StaticSettings::default()).unwrap().converged);
        let before = body.positions().to_vec();
        let rest: Vec<_> = before.iter().map(|_| Vector3::zeros()).collect();
        body.set_state(&before, &rest).unwrap();
        for _ in 0..5 {
            body.step(0.01, DOWN, &[]);
        }
        let moved = body.positions().iter().zip(&before).map(|(x, b)| (x - b).norm()).fold(0.0, f64::max);
        assert!(moved < 1e-7, "it stays where it is: {moved} m");
        before
    };
    let (elastic, viscous) = (solve(Prony::default()), solve(Prony::new(TERMS)));
    let apart = elastic.iter().zip(&viscous).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
    assert!(apart < 1e-8, "{apart} m");
}

#[test]
fn threads_change_no_bit_and_steady_steps_allocate_nothing() {
    for element in ELEMENTS {
        let states: Vec<Vec<u64>> = [1, 2, 3]
            .into_iter()
            .map(|threads| {
                let with = BodySettings { element, threads, ..settings(Scheme::Bdf2) };
                let mut body = cube(Law::Corotational, with).unwrap();
                sag(&mut body);
                for k in 0..8 {
                    let before = allocations();
                    body.step(0.01, DOWN, &[]);
                    assert!(k < 4 || allocations() == before, "{element:?} allocates");
                }
                body.positions().iter().flatten().map(|c| c.to_bits()).collect()
            })
            .collect();
        assert!(states.iter().all(|state| *state == states[0]), "{element:?}");
    }
}

#[test]
fn what_does_not_go_together_is_refused() {
    let refused = |with: BodySettings, part: &str| {
        let message = cube(Law::Corotational, with).map(|_| ()).unwrap_err().to_string();
        assert!(message.contains(part), "{message}");
    };
    let with = settings(Scheme::ImplicitEuler);
    refused(BodySettings { scheme: Scheme::Rk4, method: Method::Pcg, ..with }, "explicit");
    refused(
        BodySettings { arithmetic: Some(Arithmetic::Single), method: Method::Pcg, ..with },
        "viscoelasticity",
    );
    refused(BodySettings { cutting: CuttingMethod::Snap, ..with }, "cutting that changes the mesh");
    refused(BodySettings { scheme: Scheme::Static, relaxation: true, ..with }, "relaxation");
    let broken = Prony::new([PronyTerm { ratio: 0.5, time_s: -1.0 }]);
    refused(BodySettings { prony: broken, ..with }, "prony.time_s");
}
