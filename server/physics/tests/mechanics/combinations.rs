//! Every element with every law, integrator, solver, remedy and mass: accepted combinations move, the
//! others are refused.

use nalgebra::Vector3;
use scindo_allocations::allocations;
use scindo_physics::body::{
    Arithmetic, Body, BodyError, BodySettings, ElementKind, MassKind, Method, Outcome, PcgSettings, Scheme,
    Volumetric,
};
use scindo_physics::cut::BladeSweep;
use scindo_physics::material::{Law, Material, Rayleigh};
use scindo_physics::mesh::{BoxPattern, box_hexes, box_mesh};

use crate::DOWN;

const SIZE: Vector3<f64> = Vector3::new(0.2, 0.1, 0.1);
const CELLS: [usize; 3] = [4, 2, 2];

const ELEMENTS: [ElementKind; 3] = [ElementKind::Tet4, ElementKind::Tet10, ElementKind::Hex8];
const SCHEMES: [Scheme; 8] = [
    Scheme::Static,
    Scheme::SymplecticEuler,
    Scheme::Midpoint,
    Scheme::Rk4,
    Scheme::ImplicitEuler,
    Scheme::Bdf2,
    Scheme::Newmark { beta: 0.25, gamma: 0.5 },
    Scheme::GeneralisedAlpha { spectral_radius: 0.8 },
];
const METHODS: [Method; 3] = [Method::Cg, Method::Pcg, Method::Cholesky];

fn material(law: Law) -> Material {
    Material {
        young_pa: 2e4,
        poisson: 0.3,
        density_kg_m3: 1000.0,
        rayleigh: Rayleigh { mass_1_s: 0.1, stiffness_s: 1e-4 },
        law,
    }
}

fn settings() -> BodySettings {
    BodySettings { solver: PcgSettings { iterations: 400, tolerance: 1e-8 }, ..BodySettings::default() }
}

/// A beam held at x = 0.
fn beam(law: Law, settings: BodySettings) -> Result<Body, BodyError> {
    let mut body = match settings.element {
        ElementKind::Hex8 => Body::hex8(box_hexes(Vector3::zeros(), SIZE, CELLS), material(law), settings)?,
        _ => {
            let mesh = box_mesh(Vector3::zeros(), SIZE, CELLS, BoxPattern::Tet6);
            Body::new(mesh, material(law), settings)?
        }
    };
    let rest = body.rest_positions();
    let held: Vec<u32> = (0..rest.len() as u32).filter(|&n| rest[n as usize].x == 0.0).collect();
    body.fix(&held, [true; 3], Vector3::zeros())?;
    Ok(body)
}

/// Ten steps of 5 ms under gravity.
fn run(body: &mut Body, what: &str) {
    for step in 0..10 {
        let report = body.step(0.005, DOWN, &[]);
        assert_eq!(report.outcome, Outcome::Advanced, "{what}, step {step}: {report:?}");
        assert!(report.residual.is_finite(), "{what}: {report:?}");
    }
    assert!(body.positions().iter().chain(body.velocities()).flatten().all(|c| c.is_finite()), "{what}");
    let fall = body.rest_positions().iter().zip(body.positions()).map(|(rest, x)| rest.y - x.y);
    let lowest = fall.fold(0.0, f64::max);
    assert!(lowest > 1e-3 && lowest < 0.2, "{what}: sank by {lowest} m");
}

#[test]
fn every_element_law_integrator_and_solver_steps() {
    for element in ELEMENTS {
        for law in Law::ALL {
            for scheme in SCHEMES {
                let methods = if scheme.is_explicit() { &METHODS[1..2] } else { &METHODS[..] };
                for &method in methods {
                    let what = format!("{element:?} {law:?} {} {method:?}", scheme.name());
                    let settings = BodySettings { element, scheme, method, ..settings() };
                    let mut body = beam(law, settings).unwrap();
                    run(&mut body, &what);
                }
            }
        }
    }
}

#[test]
fn remedies_masses_and_precisions_step() {
    let averaged = Volumetric::NodeAveraged { kept: 0.05 };
    for (element, volumetric) in [(ElementKind::Tet4, averaged), (ElementKind::Hex8, Volumetric::Selective)] {
        for law in [Law::Linear, Law::Corotational, Law::NeoHookean] {
            let settings = BodySettings { element, volumetric, ..settings() };
            run(&mut beam(law, settings).unwrap(), &format!("{element:?} {volumetric:?} {law:?}"));
        }
    }
    for element in ELEMENTS {
        for scheme in SCHEMES {
            let settings = BodySettings { element, scheme, mass: MassKind::Consistent, ..settings() };
            run(
                &mut beam(Law::Corotational, settings).unwrap(),
                &format!("{element:?} {scheme:?} consistent"),
            );
        }
    }
    for arithmetic in [Arithmetic::Single, Arithmetic::Mixed, Arithmetic::Double] {
        let settings = BodySettings { arithmetic: Some(arithmetic), ..settings() };
        let mut body = beam(Law::Corotational, settings).unwrap();
        assert_eq!(body.is_fast(), arithmetic == Arithmetic::Single);
        run(&mut body, &format!("{arithmetic:?}"));
    }
}

/// Relaxation continues from step to step: many short steps end where one of Newton's method does.
#[test]
fn relaxation_keeps_its_iterate() {
    for law in Law::ALL {
        let statics = BodySettings { scheme: Scheme::Static, ..settings() };
        let solver = PcgSettings { iterations: 20, tolerance: 1e-8 };
        let mut relaxed = beam(law, BodySettings { relaxation: true, solver, ..statics }).unwrap();
        let mut newton = beam(law, statics).unwrap();
        newton.step(0.02, DOWN, &[]);
        let steps = (0..300).take_while(|_| relaxed.step(0.02, DOWN, &[]).residual > 1e-8).count();
        assert!(steps > 2 && steps < 300, "{law:?}: {steps} steps");
        let apart = relaxed.positions().iter().zip(newton.positions()).map(|(a, b)| (a - b).norm());
        assert!(apart.fold(0.0, f64::max) < 1e-6, "{law:?}");
    }
    let moving = BodySettings { relaxation: true, ..settings() };
    let message = beam(Law::Linear, moving).unwrap_err().to_string();
    assert!(message.contains("static integrator"), "{message}");
}

/// The fast path and the general one make the same step, to single precision.
#[test]
fn both_paths_agree() {
    for law in [Law::Linear, Law::Corotational] {
        let with = |arithmetic| BodySettings { arithmetic: Some(arithmetic), ..settings() };
        let mut fast = beam(law, with(Arithmetic::Single)).unwrap();
        let mut general = beam(law, with(Arithmetic::Double)).unwrap();
        for _ in 0..20 {
            fast.step(0.01, DOWN, &[]);
            general.step(0.01, DOWN, &[]);
        }
        let apart = fast.positions().iter().zip(general.positions()).map(|(a, b)| (a - b).norm());
        let apart = apart.fold(0.0, f64::max);
        // The corotational tangents differ: rotations held against the projected one.
        let bound = if law == Law::Linear { 1e-6 } else { 2e-3 };
        assert!(apart < bound, "{law:?}: {apart} m apart");
    }
}

/// A cut through the beam from above, then more steps; nothing jumps at the cut.
#[test]
fn every_law_is_cut_on_the_general_path() {
    let averaged = Volumetric::NodeAveraged { kept: 0.05 };
    let full = |element| Law::ALL.into_iter().map(move |law| (element, law, Volumetric::Full));
    for (element, law, volumetric) in full(ElementKind::Tet4)
        .chain(full(ElementKind::Tet10))
        .chain([Law::Corotational, Law::NeoHookean].map(|law| (ElementKind::Tet4, law, averaged)))
    {
        for scheme in SCHEMES {
            let what = format!("{element:?} {law:?} {volumetric:?} {}", scheme.name());
            let settings = BodySettings {
                element,
                scheme,
                volumetric,
                method: Method::Cholesky,
                arithmetic: Some(Arithmetic::Double),
                ..settings()
            };
            let settings = match scheme.is_explicit() {
                true => BodySettings { method: Method::Pcg, ..settings },
                false => settings,
            };
            let mut body = beam(law, settings).unwrap();
            run(&mut body, &what);
            let (mass, momentum, energy) = (body.total_mass(), body.momentum(), body.elastic_energy());
            let segment = |y: f64| [Vector3::new(0.07, y, -0.3), Vector3::new(0.07, y, 0.3)];
            let report = body.cut(&BladeSweep { segments: vec![segment(0.3), segment(0.03)] }, 1).unwrap();
            assert!(report.elements_cut > 0 && !report.new_copies.is_empty(), "{what}: {report:?}");
            assert!((body.total_mass() / mass - 1.0).abs() < 1e-12, "{what}");
            assert!((body.momentum() - momentum).norm() <= 1e-12 * (1.0 + momentum.norm()), "{what}");
            let jump = (body.elastic_energy() - energy).abs();
            // Thin pieces of quadratic tetrahedra resist curvature as thicker ones do.
            let exact = element == ElementKind::Tet4;
            assert!(
                jump <= if exact { 1e-9 } else { 1e-3 } * energy || volumetric != Volumetric::Full,
                "{what}: {jump} J of {energy} J"
            );
            for _ in 0..10 {
                let report = body.step(0.005, DOWN, &[]);
                assert_eq!(report.outcome, Outcome::Advanced, "{what}: {report:?}");
            }
            assert!(body.positions().iter().all(|x| x.norm() < 1.0), "{what}");
            body.reset().unwrap();
            assert_eq!(body.positions(), body.rest_positions());
        }
    }
}

#[test]
fn what_does_not_go_together_is_refused() {
    let refused = |law, settings: BodySettings, part: &str| {
        let message = beam(law, settings).map(|_| ()).unwrap_err().to_string();
        assert!(message.contains(part), "{message}");
    };
    let with = settings();
    let single = BodySettings { arithmetic: Some(Arithmetic::Single), ..with };
    let many = BodySettings { newton_steps: Some(3), ..single };
    refused(Law::NeoHookean, many, "single precision does not go with more than one Newton step");
    refused(Law::Corotational, BodySettings { scheme: Scheme::Static, ..single }, "the static integrator");
    refused(Law::Linear, BodySettings { scheme: Scheme::Rk4, ..single }, "an explicit integrator");
    refused(Law::Linear, BodySettings { method: Method::Cholesky, ..single }, "a solver other than pcg");
    let mixed = BodySettings { arithmetic: Some(Arithmetic::Mixed), scheme: Scheme::Rk4, ..with };
    refused(Law::Linear, mixed, "explicit integrator");
    let averaged = Volumetric::NodeAveraged { kept: 0.05 };
    refused(Law::StVenantKirchhoff, BodySettings { volumetric: averaged, ..with }, "");
    refused(Law::Linear, BodySettings { volumetric: averaged, element: ElementKind::Tet10, ..with }, "");
    refused(Law::Linear, BodySettings { volumetric: Volumetric::Selective, ..with }, "");
    refused(Law::Linear, BodySettings { scheme: Scheme::Newmark { beta: 0.0, gamma: 0.5 }, ..with }, "beta");
    let hexes = BodySettings { element: ElementKind::Hex8, ..with };
    let mesh = box_mesh(Vector3::zeros(), SIZE, CELLS, BoxPattern::Tet6);
    assert!(Body::new(mesh, material(Law::Linear), hexes).unwrap_err().to_string().contains("tetrahedra"));
    let segment = |y: f64| [Vector3::new(0.07, y, -0.3), Vector3::new(0.07, y, 0.3)];
    let blade = BladeSweep { segments: vec![segment(0.3), segment(0.045)] };
    let mut body = beam(Law::Linear, hexes).unwrap();
    let message = body.cut(&blade, 1).unwrap_err().to_string();
    assert!(message.contains("a cut does not go with") && message.contains("tet4, tet10"), "{message}");
}

fn hash(body: &Body) -> u64 {
    let values = body.positions().iter().chain(body.velocities()).flat_map(|v| [v.x, v.y, v.z]);
    values.fold(0xcbf2_9ce4_8422_2325, |h, v| (h ^ v.to_bits()).wrapping_mul(0x0000_0100_0000_01b3))
}

#[test]
fn threads_and_repetition_do_not_change_a_bit_on_the_general_path() {
    for (element, scheme, method) in [
        (ElementKind::Tet4, Scheme::ImplicitEuler, Method::Pcg),
        (ElementKind::Tet10, Scheme::Bdf2, Method::Cholesky),
        (ElementKind::Hex8, Scheme::Rk4, Method::Pcg),
    ] {
        let hashes: Vec<u64> = [1, 2, 1]
            .into_iter()
            .map(|threads| {
                let settings = BodySettings { element, scheme, method, threads, ..settings() };
                let mut body = beam(Law::NeoHookean, settings).unwrap();
                run(&mut body, "hash");
                hash(&body)
            })
            .collect();
        assert!(hashes.iter().all(|h| *h == hashes[0]), "{element:?}: {hashes:x?}");
    }
}

#[test]
fn steady_steps_of_the_general_path_allocate_nothing() {
    for (element, law, scheme, method) in [
        (ElementKind::Tet4, Law::NeoHookean, Scheme::ImplicitEuler, Method::Pcg),
        (ElementKind::Tet10, Law::Corotational, Scheme::Bdf2, Method::Pcg),
        (ElementKind::Hex8, Law::StVenantKirchhoff, Scheme::Newmark { beta: 0.25, gamma: 0.5 }, Method::Cg),
        (ElementKind::Tet4, Law::Linear, Scheme::Rk4, Method::Pcg),
        (ElementKind::Tet4, Law::Corotational, Scheme::Static, Method::Pcg),
        (ElementKind::Tet4, Law::Corotational, Scheme::ImplicitEuler, Method::Cholesky),
    ] {
        let settings = BodySettings { element, scheme, method, ..settings() };
        let mut body = beam(law, settings).unwrap();
        let mut run = |steps| {
            for _ in 0..steps {
                body.step(0.005, DOWN, &[]);
            }
        };
        run(4);
        let before = allocations();
        run(5);
        assert_eq!(allocations() - before, 0, "{element:?} {law:?} {} {method:?}", scheme.name());
    }
}
