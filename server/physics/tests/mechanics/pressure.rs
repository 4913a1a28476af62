//! Pressure on the surface of a body: thick tubes against closed forms, every way of a step against the others, cuts.

use std::f64::consts::FRAC_PI_2;

use nalgebra::Vector3;
use scindo_allocations::allocations;
use scindo_physics::body::{
    Ablation, Arithmetic, Body, BodySettings, CuttingMethod, ElementKind, Method, Outcome, PcgSettings,
    Scheme, StaticSettings, StopReason,
};
use scindo_physics::cut::BladeSweep;
use scindo_physics::material::{Law, Material, Rayleigh};
use scindo_physics::mesh::{BoxPattern, TetMesh, box_hexes, box_mesh};
use scindo_physics::octree::{AdaptSettings, BoxShape, Octree, OctreeSettings, Shape};
use scindo_physics::space::OctreeSpace;

use crate::{SOFT, cube, settings};

/// Radii of the tube [m].
const A: f64 = 0.01;
const B: f64 = 0.02;

/// A quarter of a slice of the tube with `n` cells through the wall.
fn tube_mesh(n: usize) -> TetMesh {
    let thickness = 0.5 * (B - A) / n as f64;
    let size = Vector3::new(1.0, FRAC_PI_2, thickness);
    let mut mesh = box_mesh(Vector3::zeros(), size, [n, 2 * n, 1], BoxPattern::Tet6);
    for X in &mut mesh.nodes {
        let (r, turn) = (A + (B - A) * X.x, X.y);
        let on_axis = |c: f64| if c.abs() < 1e-9 { 0.0 } else { r * c };
        *X = Vector3::new(on_axis(turn.cos()), on_axis(turn.sin()), X.z);
    }
    mesh
}

/// Nodes whose rest positions fulfil `is`.
fn nodes(body: &Body, is: impl Fn(&Vector3<f64>) -> bool) -> Vec<u32> {
    (0..).zip(body.rest_positions()).filter(|(_, X)| is(X)).map(|(node, _)| node).collect()
}

/// The tube in plane strain under pressure on its inner surface.
fn tube(n: usize, material: Material, settings: BodySettings, pressure_pa: f64) -> Body {
    let mut body = Body::new(tube_mesh(n), material, settings).unwrap();
    let z_max = body.bounds()[1].z;
    for (axis, on) in [(0, 0.0), (1, 0.0), (2, 0.0), (2, z_max)] {
        let plane = nodes(&body, |X| (X[axis] - on).abs() < 1e-12);
        let mut held = [false; 3];
        held[axis] = true;
        body.fix(&plane, held, Vector3::zeros()).unwrap();
    }
    let inner = nodes(&body, |X| X.xy().norm() < A * (1.0 + 1e-9));
    body.add_pressure(&inner, pressure_pa).unwrap();
    body
}

/// Largest relative error of the displacement of the corners at radius `R` from `expected` outwards [m].
fn radial_error(body: &Body, R: f64, expected: f64) -> f64 {
    let rest = body.rest_positions().iter().take(body.n_copies());
    let there = rest.zip(body.positions()).filter(|(X, _)| (X.xy().norm() - R).abs() < 1e-9);
    there.map(|(X, x)| ((x.xy().norm() - X.xy().norm()) / expected - 1.0).abs()).fold(0.0, f64::max)
}

const TISSUE: Material = Material {
    young_pa: 1e5,
    poisson: 0.3,
    density_kg_m3: 1e3,
    rayleigh: Rayleigh { mass_1_s: 0.0, stiffness_s: 0.0 },
    law: Law::Linear,
};

fn with(element: ElementKind) -> BodySettings {
    BodySettings { element, ..settings(2000, 1e-6) }
}

/// Lamé's solution at the inner and outer radius. Errors fall at least with h² for linear and quadratic
/// tetrahedra, whose faces are flat. With small pressure every law is the linear one.
#[test]
fn a_thick_tube_under_small_pressure_moves_as_lame_says() {
    let p = 1e-4 * TISSUE.young_pa;
    let lame = |r: f64| {
        let (E, nu) = (TISSUE.young_pa, TISSUE.poisson);
        p * A * A / (B * B - A * A) * (1.0 + nu) / E * ((1.0 - 2.0 * nu) * r + B * B / r)
    };
    for (element, sizes, most) in
        [(ElementKind::Tet4, [4, 8, 16], 0.02), (ElementKind::Tet10, [2, 4, 8], 0.002)]
    {
        let errors = sizes.map(|n| {
            let mut body = tube(n, TISSUE, with(element), p);
            assert!(body.solve_static(Vector3::zeros(), &StaticSettings::default()).unwrap().converged);
            radial_error(&body, A, lame(A)).max(radial_error(&body, B, lame(B)))
        });
        assert!(errors[2] < most, "{element:?}: {errors:?}");
        assert!(errors.windows(2).all(|pair| pair[1] < pair[0] / 3.0), "{element:?}: {errors:?}");
    }
    for law in [Law::Corotational, Law::StVenantKirchhoff, Law::NeoHookean] {
        let mut body = tube(4, Material { law, ..TISSUE }, with(ElementKind::Tet10), p);
        assert!(body.solve_static(Vector3::zeros(), &StaticSettings::default()).unwrap().converged);
        let error = radial_error(&body, A, lame(A));
        assert!(error < 0.01, "{law:?}: {error}");
    }
}

/// An incompressible tube inflated to λ_a at its inner wall: p = ∫ W'(λ)/(λ² − 1) dλ from λ_b to λ_a, where
/// W(λ) = ψ at the stretches λ, 1/λ, 1 (Ogden 1997, "Non-Linear Elastic Deformations", §5.3.3).
fn inflation_pressure(material: &Material, lambda_a: f64) -> f64 {
    let mu = 4.0 / 3.0 * material.lame().mu;
    let lambda_b = (1.0 + (lambda_a * lambda_a - 1.0) * (A / B).powi(2)).sqrt();
    let integrand = |l: f64| {
        let I = l * l + 1.0 / (l * l) + 1.0;
        0.5 * mu * (1.0 - 1.0 / (I + 1.0)) * (2.0 * l - 2.0 / l.powi(3)) / (l * l - 1.0)
    };
    let (n, width) = (1000, lambda_a - lambda_b);
    let at = |i: f64| integrand(lambda_b + width * i / f64::from(n));
    // Simpson's rule.
    (0..n).map(f64::from).map(|i| (at(i) + 4.0 * at(i + 0.5) + at(i + 1.0)) / 6.0).sum::<f64>() * width
        / f64::from(n)
}

/// The inner radius grows by half. Of the force that keeps its direction and size only the start would be right.
#[test]
fn a_neo_hookean_tube_inflates_as_the_closed_form_says() {
    let rubber = Material { law: Law::NeoHookean, poisson: 0.4995, ..TISSUE };
    let stretch = 1.5;
    let p = inflation_pressure(&rubber, stretch);
    let solver = PcgSettings { iterations: 2000, tolerance: 1e-6 };
    let statics =
        BodySettings { scheme: Scheme::Static, method: Method::Cholesky, solver, ..with(ElementKind::Tet10) };
    let errors = [2, 4, 6].map(|n| {
        let mut body = tube(n, rubber, statics, p);
        for share in [0.25, 0.5, 0.75, 1.0] {
            body.set_pressure_shares([share].into_iter());
            let report = body.step(1.0, Vector3::zeros(), &[]);
            assert_eq!(report.stop, StopReason::Converged, "{report:?}");
            // Without the load stiffness the third stagnates above the tolerance.
            assert!(report.newton_steps <= 15, "{n}: {report:?}");
        }
        let inner = radial_error(&body, A, (stretch - 1.0) * A);
        let volume = body.volume() / body.rest_volume() - 1.0;
        assert!(volume.abs() < 1e-3, "{n}: {volume}");
        inner
    });
    assert!(errors[2] < 0.005 && errors[2] < errors[1] && errors[1] < errors[0], "{errors:?}");
}

/// A strip held at x = 0 that pressure from below bends far up.
fn strip(material: Material, settings: BodySettings, pressure_pa: f64) -> Body {
    let size = Vector3::new(0.2, 0.02, 0.01);
    let mesh = box_mesh(Vector3::zeros(), size, [20, 2, 1], BoxPattern::Tet6);
    let mut body = Body::new(mesh, material, settings).unwrap();
    let root = nodes(&body, |X| X.x == 0.0);
    body.fix(&root, [true; 3], Vector3::zeros()).unwrap();
    let below = nodes(&body, |X| X.z == 0.0);
    body.add_pressure(&below, pressure_pa).unwrap();
    body
}

/// The tip of the strip relative to rest [m].
fn tip(body: &Body) -> Vector3<f64> {
    let tip = nodes(body, |X| X.x > 0.1999 && X.z == 0.0);
    let moved = tip.iter().map(|&n| body.positions()[n as usize] - body.rest_positions()[n as usize]);
    moved.sum::<Vector3<f64>>() / tip.len() as f64
}

const STRIP: Material = Material {
    young_pa: 1e5,
    poisson: 0.3,
    density_kg_m3: 1e3,
    rayleigh: Rayleigh { mass_1_s: 1.0, stiffness_s: 0.02 },
    law: Law::Corotational,
};

/// In every way of a step the strip comes to rest in the equilibrium of the follower load, which differs from that of
/// the force at rest.
#[test]
fn every_integrator_comes_to_the_same_equilibrium() {
    let p = 30.0;
    let mut still = strip(STRIP, with(ElementKind::Tet4), p);
    assert!(still.solve_static(Vector3::zeros(), &StaticSettings::default()).unwrap().converged);
    let expected = tip(&still);
    let mut dead = strip(STRIP, with(ElementKind::Tet4), 0.0);
    let below = nodes(&dead, |X| X.z == 0.0);
    dead.add_surface_force(&below, Vector3::new(0.0, 0.0, p * 0.2 * 0.02)).unwrap();
    assert!(dead.solve_static(Vector3::zeros(), &StaticSettings::default()).unwrap().converged);
    assert!((tip(&dead) - expected).norm() > 0.05 * expected.norm(), "{expected} {}", tip(&dead));
    let newmark = Scheme::Newmark { beta: 0.25, gamma: 0.5 };
    for (scheme, arithmetic, h, steps) in [
        (Scheme::ImplicitEuler, Arithmetic::Single, 0.02, 400),
        (Scheme::Bdf2, Arithmetic::Single, 0.02, 400),
        (newmark, Arithmetic::Single, 0.02, 400),
        (Scheme::ImplicitEuler, Arithmetic::Double, 0.02, 400),
        (Scheme::Bdf2, Arithmetic::Double, 0.02, 400),
        (newmark, Arithmetic::Double, 0.02, 400),
        (Scheme::Static, Arithmetic::Double, 1.0, 1),
        (Scheme::SymplecticEuler, Arithmetic::Double, 0.002, 250),
        (Scheme::Midpoint, Arithmetic::Double, 0.002, 250),
        (Scheme::Rk4, Arithmetic::Double, 0.002, 250),
    ] {
        let settings = BodySettings { scheme, arithmetic: Some(arithmetic), ..with(ElementKind::Tet4) };
        // The damping by stiffness would shorten the stable step a hundredfold.
        let heavily = Rayleigh { mass_1_s: 5.0, stiffness_s: 0.0 };
        let material = if scheme.is_explicit() { Material { rayleigh: heavily, ..STRIP } } else { STRIP };
        let mut body = strip(material, settings, p);
        if scheme.is_explicit() {
            // Coming to rest takes too many short steps: they stay where they are at rest.
            body.set_state(still.positions(), still.velocities()).unwrap();
        }
        for _ in 0..steps {
            let report = body.step(h, Vector3::zeros(), &[]);
            assert_eq!(report.outcome, Outcome::Advanced, "{scheme:?}: {report:?}");
        }
        let off = (tip(&body) - expected).norm() / expected.norm();
        assert!(off < 2e-3, "{scheme:?} {arithmetic:?}: {off}");
    }
}

/// Linear laws keep the normal of the rest configuration: the load is dead, whatever the way of a step.
#[test]
fn the_linear_law_keeps_the_normal_of_the_rest_configuration() {
    for arithmetic in [Arithmetic::Single, Arithmetic::Double] {
        let linear = Material { law: Law::Linear, ..STRIP };
        let settings = BodySettings { arithmetic: Some(arithmetic), ..with(ElementKind::Tet4) };
        let mut body = strip(linear, settings, 12.0);
        let at_rest = body.loads().to_vec();
        for _ in 0..20 {
            body.step(0.02, Vector3::zeros(), &[]);
        }
        assert!(tip(&body).norm() > 0.01 && body.loads() == at_rest && body.pressure_forces() == at_rest);
        assert!((at_rest.iter().sum::<Vector3<f64>>() - Vector3::z() * 12.0 * 0.004).norm() < 1e-12);
    }
}

/// Under pressure on all of its surface a free block keeps its momentum, and kinetic plus elastic energy plus p V.
#[test]
fn a_free_block_in_a_vessel_keeps_momentum_and_energy() {
    let (p, material) = (5e3, Material { law: Law::NeoHookean, ..SOFT });
    let settings = BodySettings { scheme: Scheme::Rk4, ..settings(50, 1e-6) };
    let hexes = box_hexes(Vector3::zeros(), Vector3::repeat(0.1), [2; 3]);
    for mut body in [cube(2, material, settings), Body::hex8(hexes, material, settings).unwrap()] {
        let all: Vec<u32> = (0..body.n_nodes() as u32).collect();
        body.add_pressure(&all, p).unwrap();
        let energy = |body: &Body| body.kinetic_energy() + body.elastic_energy() + p * body.volume();
        let (start, mut most) = (energy(&body), 0.0_f64);
        for _ in 0..400 {
            assert_eq!(body.step(5e-5, Vector3::zeros(), &[]).outcome, Outcome::Advanced);
            most = most.max(body.kinetic_energy());
        }
        let drift = (energy(&body) - start).abs() / most;
        assert!(most > 1e-4 * p * body.rest_volume() && drift < 1e-4, "{drift}");
        let size = (2.0 * most * body.total_mass()).sqrt();
        assert!(body.momentum().norm() < 1e-10 * size, "{}", body.momentum());
    }
}

/// The fast path takes the force at the predicted positions. What this lag changes falls with h² and is less than the
/// error of the scheme; the stiffness of stretched material makes it smaller.
#[test]
fn the_lag_of_linear_solves_is_of_second_order() {
    let run = |arithmetic, h: f64, twists| {
        let scheme = Scheme::Bdf2;
        let ablation = Ablation { twists, ..Ablation::default() };
        let settings =
            BodySettings { scheme, ablation, arithmetic: Some(arithmetic), ..with(ElementKind::Tet4) };
        let mut body = strip(STRIP, settings, 30.0);
        for _ in 0..(0.4 / h).round() as usize {
            assert_eq!(body.step(h, Vector3::zeros(), &[]).outcome, Outcome::Advanced);
        }
        tip(&body)
    };
    let exact = run(Arithmetic::Double, 0.00125, false);
    let [coarse, fine] = [0.02, 0.01].map(|h| {
        let implicit = run(Arithmetic::Double, h, false);
        let [full, bare] = [false, true].map(|bare| (run(Arithmetic::Single, h, bare) - implicit).norm());
        let error = (implicit - exact).norm();
        assert!(bare < 0.2 * error && full < 0.8 * bare && exact.norm() > 0.15, "{h}: {full} {bare} {error}");
        bare
    });
    assert!(fine < coarse / 3.0, "{coarse} {fine}");
}

/// Cuts leave the skin loaded and their lips bare, also through elements; taking them back and a reset too.
#[test]
fn what_is_left_of_the_skin_stays_loaded_after_cuts() {
    for element in [ElementKind::Tet4, ElementKind::Tet10] {
        let mut body = cube(3, SOFT, BodySettings { element, ..settings(50, 1e-6) });
        let held = nodes(&body, |X| X.z == 0.0);
        body.fix(&held, [true; 3], Vector3::zeros()).unwrap();
        let top = nodes(&body, |X| X.z == 0.1);
        body.add_pressure(&top, 100.0).unwrap();
        let total = |body: &Body| body.pressure_forces().iter().sum::<Vector3<f64>>();
        let whole = Vector3::new(0.0, 0.0, -1.0);
        assert!((total(&body) - whole).norm() < 1e-12);
        let uncut = body.topology();
        let blade = |x: f64, lean: f64| [Vector3::new(x, 0.047, 0.02), Vector3::new(x, 0.047 + lean, 0.11)];
        for (incision, lean) in [(1, 0.0), (2, 0.01)] {
            body.cut(&BladeSweep { segments: vec![blade(-0.01, lean), blade(0.11, lean)] }, incision)
                .unwrap();
            assert!((total(&body) - whole).norm() < 1e-12, "{element:?}: {}", total(&body));
        }
        assert!(body.surface().tags.contains(&2));
        for _ in 0..5 {
            assert_eq!(body.step(0.01, Vector3::zeros(), &[]).outcome, Outcome::Advanced);
        }
        assert!((total(&body) - whole).norm() > 1e-6, "it follows the deformed skin");
        body.restore(uncut).unwrap();
        assert_eq!(body.step(0.01, Vector3::zeros(), &[]).outcome, Outcome::Advanced);
        body.reset().unwrap();
        assert!((total(&body) - whole).norm() < 1e-12, "{element:?}");
        body.clear_loads();
        assert_eq!(total(&body), Vector3::zeros());
    }
}

/// A steady step allocates nothing and gives the same bits for any number of threads.
#[test]
fn pressure_allocates_nothing_and_knows_no_threads() {
    for (scheme, arithmetic) in [
        (Scheme::ImplicitEuler, Arithmetic::Single),
        (Scheme::ImplicitEuler, Arithmetic::Double),
        (Scheme::SymplecticEuler, Arithmetic::Double),
    ] {
        let run = |threads: usize| {
            let settings =
                BodySettings { scheme, threads, arithmetic: Some(arithmetic), ..with(ElementKind::Tet4) };
            let mut body = strip(STRIP, settings, 12.0);
            for _ in 0..5 {
                body.step(0.005, Vector3::zeros(), &[]);
            }
            let before = allocations();
            for step in 0..5 {
                body.set_pressure_shares([1.0 - 0.1 * f64::from(step)].into_iter());
                body.step(0.005, Vector3::zeros(), &[]);
            }
            assert!(threads > 1 || allocations() == before, "{scheme:?} {arithmetic:?}");
            body.positions().to_vec()
        };
        assert_eq!(run(1), run(2), "{scheme:?} {arithmetic:?}");
    }
}

/// A pressure of which no share acts leaves every step as it is without one, to the last bit.
#[test]
fn a_pressure_that_does_not_act_changes_nothing() {
    for (scheme, arithmetic) in [
        (Scheme::Bdf2, Arithmetic::Single),
        (Scheme::ImplicitEuler, Arithmetic::Double),
        (Scheme::Static, Arithmetic::Double),
        (Scheme::Rk4, Arithmetic::Double),
    ] {
        let settings = BodySettings { scheme, arithmetic: Some(arithmetic), ..with(ElementKind::Tet4) };
        let run = |mut body: Body| {
            for _ in 0..5 {
                body.step(1e-4, Vector3::new(0.0, 0.0, -1.0), &[]);
            }
            body.positions().to_vec()
        };
        let mut idle = strip(STRIP, settings, 12.0);
        idle.set_pressure_shares([0.0].into_iter());
        let mut without = strip(STRIP, settings, 12.0);
        without.clear_loads();
        assert_eq!(run(idle), run(without), "{scheme:?} {arithmetic:?}");
    }
}

/// A block of octree cells, finer at its boundary: its faces are those of hexahedra, and the force is the same.
#[test]
fn octree_cells_take_the_pressure_of_hexahedra() {
    let size = Vector3::new(0.1, 0.1, 0.1);
    let single = |element| BodySettings { element, threads: 2, ..settings(400, 1e-6) };
    let shape = BoxShape { min: Vector3::zeros(), max: size };
    let octree = Octree::fill(&shape, OctreeSettings { cells: 8, levels: 1 }, &|_| 0).unwrap();
    let cells = OctreeSpace::new(octree);
    let hexes =
        Body::hex8(box_hexes(Vector3::zeros(), size, [8; 3]), SOFT, single(ElementKind::Hex8)).unwrap();
    let cells = Body::of_space(Box::new(cells), SOFT, single(ElementKind::Octree)).unwrap();
    assert!(cells.n_nodes() < hexes.n_nodes());
    let mut found = Vec::new();
    for mut body in [hexes, cells] {
        let held = nodes(&body, |X| X.z == 0.0);
        body.fix(&held, [true; 3], Vector3::zeros()).unwrap();
        let top = nodes(&body, |X| (X.z - 0.1).abs() < 1e-9 && X.x < 0.051);
        body.add_pressure(&top, 300.0).unwrap();
        let pressed: Vector3<f64> = body.pressure_forces().iter().sum();
        assert!((pressed - Vector3::new(0.0, 0.0, -1.5)).norm() < 1e-9, "{pressed}");
        for _ in 0..50 {
            assert_eq!(body.step(0.01, Vector3::zeros(), &[]).outcome, Outcome::Advanced);
        }
        let corner = nodes(&body, |X| X.x == 0.0 && X.y == 0.0 && (X.z - 0.1).abs() < 1e-9)[0] as usize;
        found.push(body.positions()[corner] - body.rest_positions()[corner]);
    }
    // The interior of the octree is coarser.
    let [hexes, cells] = found[..] else { panic!() };
    assert!(hexes.norm() > 3e-4 && (cells - hexes).norm() < 0.01 * hexes.norm(), "{hexes} {cells}");
}

/// A ball of octree cells under pressure on all of its surface becomes smaller, as a ball does, and stays where it is:
/// steps in its surface push against each other.
#[test]
fn a_ball_of_cells_is_compressed_evenly() {
    struct Ball;
    impl Shape for Ball {
        fn bounds(&self) -> [Vector3<f64>; 2] {
            [Vector3::repeat(-0.05), Vector3::repeat(0.05)]
        }

        fn contains(&self, p: &Vector3<f64>) -> bool {
            p.norm() < 0.05
        }

        fn crossing(&self, a: &Vector3<f64>, b: &Vector3<f64>) -> Option<(f64, Vector3<f64>)> {
            let t = (0.05 - a.norm()) / (b.norm() - a.norm());
            Some((t, a + t * (b - a)))
        }
    }
    let (p, bulk) = (300.0, SOFT.young_pa / (3.0 * (1.0 - 2.0 * SOFT.poisson)));
    for (scheme, law) in [
        (Scheme::Static, Law::Corotational),
        (Scheme::Static, Law::Linear),
        (Scheme::Bdf2, Law::Corotational),
    ] {
        let octree = Octree::fill(&Ball, OctreeSettings { cells: 20, levels: 2 }, &|_| 0).unwrap();
        let settings =
            BodySettings { scheme, element: ElementKind::Octree, pressed: true, ..settings(500, 1e-7) };
        let mut body =
            Body::of_space(Box::new(OctreeSpace::new(octree)), Material { law, ..SOFT }, settings).unwrap();
        let all: Vec<u32> = (0..body.n_nodes() as u32).collect();
        if scheme == Scheme::Static {
            // What holds it is statically determinate, so no force acts there.
            let near = |x: f64, y: f64| {
                let away = |i: &u32| (body.rest_positions()[*i as usize] - Vector3::new(x, y, 0.0)).norm();
                (0..body.n_nodes() as u32).min_by(|a, b| away(a).total_cmp(&away(b))).unwrap()
            };
            let holds = [
                (near(0.0, 0.0), [true; 3]),
                (near(0.02, 0.0), [false, true, true]),
                (near(0.0, 0.02), [false, false, true]),
            ];
            holds.iter().for_each(|&(node, held)| body.fix(&[node], held, Vector3::zeros()).unwrap());
        }
        body.add_pressure(&all, p).unwrap();
        let force: Vector3<f64> = body.pressure_forces().iter().sum();
        assert!(force.norm() < 1e-12 * p, "{force}");
        for _ in 0..if scheme == Scheme::Static { 1 } else { 100 } {
            assert_eq!(body.step(0.01, Vector3::zeros(), &[]).outcome, Outcome::Advanced);
        }
        let strain = body.volume() / body.rest_volume() - 1.0;
        assert!((strain * bulk / p + 1.0).abs() < 0.01, "{scheme:?} {law:?}: {strain} for {}", -p / bulk);
    }
}

/// Cuts of octree cells divide coarse ones, and leave the skin loaded and their lips bare.
#[test]
fn cut_cells_stay_loaded() {
    let shape = BoxShape { min: Vector3::zeros(), max: Vector3::repeat(0.1) };
    let octree = Octree::fill(&shape, OctreeSettings { cells: 12, levels: 2 }, &|_| 0).unwrap();
    let settings = BodySettings { element: ElementKind::Octree, ..settings(100, 1e-5) };
    let mut body = Body::of_space(Box::new(OctreeSpace::new(octree)), SOFT, settings).unwrap();
    let held = nodes(&body, |X| X.z == 0.0);
    body.fix(&held, [true; 3], Vector3::zeros()).unwrap();
    let top = nodes(&body, |X| (X.z - 0.1).abs() < 1e-9);
    body.add_pressure(&top, 100.0).unwrap();
    let total = |body: &Body| body.pressure_forces().iter().sum::<Vector3<f64>>();
    let whole = Vector3::new(0.0, 0.0, -1.0);
    assert!((total(&body) - whole).norm() < 1e-9);
    let blade = |x: f64, lean: f64| [Vector3::new(x, 0.047, 0.02), Vector3::new(x, 0.047 + lean, 0.11)];
    for (incision, lean) in [(1, 0.0), (2, 0.02)] {
        let copies = body.n_copies();
        body.cut(&BladeSweep { segments: vec![blade(-0.01, lean), blade(0.11, lean)] }, incision).unwrap();
        assert!(body.n_copies() > copies && (total(&body) - whole).norm() < 1e-9, "{}", total(&body));
    }
    // Refinement makes corners of faces vertices of their own.
    let near = AdaptSettings { distance_m: Some([0.03, 0.05]), ..AdaptSettings::default() };
    let refined = body.adapt(&near, &[Vector3::new(0.08, 0.08, 0.08)], None).unwrap();
    assert!(refined.divided > 0 && (total(&body) - whole).norm() < 1e-9, "{refined:?} {}", total(&body));
    for _ in 0..5 {
        assert_eq!(body.step(0.01, Vector3::zeros(), &[]).outcome, Outcome::Advanced);
    }
    assert!((total(&body) - whole).norm() > 1e-6, "it follows the deformed skin");
    body.reset().unwrap();
    assert!((total(&body) - whole).norm() < 1e-9);
}

#[test]
fn what_pressure_does_not_go_with_is_refused() {
    let mut body = cube(2, SOFT, settings(50, 1e-6));
    let refused =
        |body: &mut Body, nodes: &[u32], p: f64| body.add_pressure(nodes, p).unwrap_err().to_string();
    assert!(refused(&mut body, &[0], 10.0).contains("no whole face"));
    assert!(refused(&mut body, &[999], 10.0).contains("999"));
    assert!(refused(&mut body, &[0, 1, 3], f64::NAN).contains("pressure_pa"));
    let all: Vec<u32> = (0..body.n_nodes() as u32).collect();
    let mut snap = cube(2, SOFT, BodySettings { cutting: CuttingMethod::Snap, ..settings(50, 1e-6) });
    assert!(refused(&mut snap, &all, 10.0).contains("cutting that changes the mesh"));
    let relaxed = BodySettings { relaxation: true, scheme: Scheme::Static, ..settings(50, 1e-6) };
    assert!(refused(&mut cube(2, SOFT, relaxed), &all, 10.0).contains("relaxation"));
    let linear = Material { law: Law::Linear, ..SOFT };
    cube(2, linear, relaxed).add_pressure(&all, 10.0).unwrap();
    let shape = BoxShape { min: Vector3::zeros(), max: Vector3::repeat(0.1) };
    let cells = |pressed: bool| {
        let octree = Octree::fill(&shape, OctreeSettings { cells: 4, levels: 0 }, &|_| 0).unwrap();
        let scheme = Scheme::Static;
        let settings = BodySettings { scheme, pressed, element: ElementKind::Octree, ..settings(50, 1e-5) };
        Body::of_space(Box::new(OctreeSpace::new(octree)), SOFT, settings).unwrap()
    };
    assert!(refused(&mut cells(false), &all, 10.0).contains("equilibria on the fast path"));
    cells(true).add_pressure(&all, 10.0).unwrap();
    assert!(body.pressure_forces().iter().all(|f| *f == Vector3::zeros()));
}
