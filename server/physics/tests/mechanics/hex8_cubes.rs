//! Hexahedra that are equal cubes: the kernels of cells against the general path.

use nalgebra::Vector3;
use scindo_physics::body::{Arithmetic, Body, BodySettings, Method, Outcome, PcgSettings, Scheme};
use scindo_physics::material::{Law, Material, Rayleigh};
use scindo_physics::mesh::{HexMesh, box_hexes};

const FALL: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);

fn material(law: Law) -> Material {
    let rayleigh = Rayleigh { mass_1_s: 0.3, stiffness_s: 0.004 };
    Material { young_pa: 1e5, poisson: 0.35, density_kg_m3: 1000.0, rayleigh, law }
}

fn beam(cells: usize) -> HexMesh {
    box_hexes(Vector3::new(0.1, 0.0, -0.2), Vector3::new(1.1, 0.5, 0.3), [2 * cells, cells, cells])
}

fn body(mesh: HexMesh, law: Law, settings: BodySettings) -> Body {
    let mut body = Body::hex8(mesh, material(law), settings).unwrap();
    let held: Vec<u32> =
        (0..).zip(body.rest_positions()).filter(|(_, X)| X.x < 0.1 + 1e-9).map(|(n, _)| n).collect();
    body.fix(&held, [true; 3], Vector3::zeros()).unwrap();
    let tip: Vec<u32> =
        (0..).zip(body.rest_positions()).filter(|(_, X)| X.x > 1.1 - 1e-9).map(|(n, _)| n).collect();
    body.add_surface_force(&tip, Vector3::new(0.0, 30.0, 0.0)).unwrap();
    body
}

fn with(scheme: Scheme, method: Method, arithmetic: Option<Arithmetic>, tolerance: f64) -> BodySettings {
    let solver = PcgSettings { iterations: 2000, tolerance };
    BodySettings { scheme, method, arithmetic, solver, ..BodySettings::default() }
}

/// Motion of both paths over 20 steps: largest distance of a node over the largest displacement.
fn apart(cells: usize, law: Law, scheme: Scheme, method: Method) -> f64 {
    let mut fast = body(beam(cells), law, with(scheme, method, None, 1e-6));
    let double = Some(Arithmetic::Double);
    let mut general = body(beam(cells), law, with(scheme, Method::Cholesky, double, 1e-10));
    assert!(fast.is_fast() && !general.is_fast());
    assert_eq!(fast.rest_positions(), general.rest_positions());
    for (a, b) in fast.masses().iter().zip(general.masses()) {
        assert!((a / b - 1.0).abs() < 1e-12, "{a} {b}");
    }
    for k in 0..if scheme == Scheme::Static { 1 } else { 20 } {
        for body in [&mut fast, &mut general] {
            let report = body.step(0.02, FALL, &[]);
            assert_eq!(
                (report.outcome, report.is_unconverged()),
                (Outcome::Advanced, false),
                "{k} {report:?}"
            );
        }
    }
    let largest = |u: &mut dyn Iterator<Item = f64>| u.fold(0.0, f64::max);
    let moved =
        largest(&mut general.positions().iter().zip(general.rest_positions()).map(|(x, X)| (x - X).norm()));
    assert!(moved > 0.02, "{moved}");
    largest(&mut fast.positions().iter().zip(general.positions()).map(|(a, b)| (a - b).norm())) / moved
}

#[test]
fn the_linear_law_gives_the_same_motion_on_both_paths() {
    let newmark = Scheme::Newmark { beta: 0.25, gamma: 0.5 };
    for scheme in [Scheme::ImplicitEuler, Scheme::Bdf2, newmark, Scheme::Static] {
        for method in [Method::Pcg, Method::MgPcg] {
            let apart = apart(6, Law::Linear, scheme, method);
            assert!(apart < 2e-5, "{scheme:?} {method:?}: {apart:.1e}");
        }
    }
}

#[test]
fn corotational_cubes_move_nearly_as_on_the_general_path() {
    // One rotation per cube instead of eight, and another tangent in the one solve of a step.
    for scheme in [Scheme::ImplicitEuler, Scheme::Bdf2] {
        let found = [4, 8].map(|cells| apart(cells, Law::Corotational, scheme, Method::Pcg));
        assert!(found[0] < 0.006 && found[1] < 0.006, "{scheme:?}: {found:?}");
    }
}

#[test]
fn what_is_no_cube_keeps_the_general_path() {
    let cuboids = box_hexes(Vector3::zeros(), Vector3::new(1.0, 0.5, 0.5), [8, 4, 5]);
    let with = with(Scheme::ImplicitEuler, Method::Pcg, None, 1e-4);
    let body = Body::hex8(cuboids.clone(), material(Law::Corotational), with).unwrap();
    assert!(!body.is_fast());
    assert_eq!(body.settings().why_general(Law::Corotational), Some("element hex8 without equal cubes"));
    let single = BodySettings { arithmetic: Some(Arithmetic::Single), ..with };
    let message = Body::hex8(cuboids, material(Law::Linear), single).unwrap_err().to_string();
    assert!(message.contains("single precision does not go with element hex8"), "{message}");
    let cubes = beam(2);
    let law = Body::hex8(cubes.clone(), material(Law::NeoHookean), with).unwrap();
    assert!(!law.is_fast() && Body::hex8(cubes, material(Law::Linear), single).unwrap().is_fast());
}

#[test]
fn threads_change_no_bit_and_momentum_is_kept() {
    let run = |threads| {
        let settings = BodySettings { threads, ..with(Scheme::ImplicitEuler, Method::Pcg, None, 1e-5) };
        let mut body = body(beam(8), Law::Corotational, settings);
        (0..10).for_each(|_| {
            body.step(0.01, FALL, &[]);
        });
        body.positions().to_vec()
    };
    let one = run(1);
    assert!(one == run(2) && one == run(3));
    let settings = with(Scheme::ImplicitEuler, Method::Pcg, None, 1e-6);
    let mut free = Body::hex8(
        beam(6),
        Material { rayleigh: Rayleigh::default(), ..material(Law::Corotational) },
        settings,
    )
    .unwrap();
    (0..20).for_each(|_| {
        free.step(0.01, FALL, &[]);
    });
    let expected = free.total_mass() * 0.2 * FALL;
    assert!((free.momentum() - expected).norm() < 1e-6 * expected.norm(), "{}", free.momentum());
    assert!((free.total_mass() / 250.0 - 1.0).abs() < 1e-12);
}
