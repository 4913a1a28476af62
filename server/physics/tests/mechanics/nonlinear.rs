//! Laws that are nonlinear in the stretch on the fast path: the same motion as on the general one.

use nalgebra::Vector3;
use scindo_physics::body::{Arithmetic, Body, BodySettings, Outcome, PcgSettings, Scheme, StopReason};
use scindo_physics::cut::BladeSweep;
use scindo_physics::material::{Law, Material, Rayleigh};
use scindo_physics::mesh::{BoxPattern, box_mesh};

const DOWN: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);

/// A bar of 0.4 × 0.1 × 0.1 m that is held at one end.
fn bar(law: Law, stiffness_s: f64, settings: BodySettings) -> Body {
    let mesh = box_mesh(Vector3::zeros(), Vector3::new(0.4, 0.1, 0.1), [16, 4, 4], BoxPattern::Tet6);
    let rayleigh = Rayleigh { mass_1_s: 0.1, stiffness_s };
    let material = Material { young_pa: 2e5, poisson: 0.4, density_kg_m3: 1000.0, rayleigh, law };
    let mut body = Body::new(mesh, material, settings).unwrap();
    let held: Vec<u32> =
        (0..).zip(body.rest_positions()).filter(|(_, X)| X.x < 1e-9).map(|(n, _)| n).collect();
    body.fix(&held, [true; 3], Vector3::zeros()).unwrap();
    body
}

/// Lets the bar fall for `steps` of `h` [s], and cuts it half through at the beginning.
fn fall(mut body: Body, steps: usize, h: f64) -> Body {
    for step in 0..steps {
        if step == 2 {
            let segment = |z: f64| [Vector3::new(0.21, -0.1, z), Vector3::new(0.21, 0.2, z - 0.01)];
            assert!(
                body.cut(&BladeSweep { segments: vec![segment(0.2), segment(0.02)] }, 1)
                    .unwrap()
                    .elements_cut
                    > 8
            );
        }
        let report = body.step(h, DOWN, &[]);
        assert_eq!(report.outcome, Outcome::Advanced, "{report:?}");
        // Forces in single precision end the search a little above the tolerance.
        assert!(matches!(report.stop, StopReason::Converged | StopReason::Stagnated), "{step} {report:?}");
        assert!(report.residual < 1e-2, "{step} {report:?}");
    }
    body
}

/// One Newton step by request is solved to its tolerance, with a tangent that has a minimum.
#[test]
fn a_single_solve_reaches_its_tolerance() {
    for law in [Law::StVenantKirchhoff, Law::NeoHookean] {
        let solver = PcgSettings { iterations: 1000, tolerance: 1e-4 };
        let settings = BodySettings { solver, newton_steps: Some(1), ..BodySettings::default() };
        let mut body = bar(law, 0.0, settings);
        for step in 0..20 {
            let report = body.step(0.01, DOWN, &[]);
            assert!(body.is_fast() && report.newton_steps == 1, "{law:?} {step}: {report:?}");
            assert_eq!(report.stop, StopReason::Converged, "{law:?} {step}: {report:?}");
            assert!(report.residual <= 1e-4, "{law:?} {step}: {report:?}");
        }
    }
}

#[test]
fn the_fast_path_moves_as_the_general_one() {
    let newmark = Scheme::Newmark { beta: 0.25, gamma: 0.5 };
    for law in [Law::StVenantKirchhoff, Law::NeoHookean] {
        for (scheme, damping) in [
            (Scheme::ImplicitEuler, 0.0),
            (Scheme::ImplicitEuler, 0.01),
            (Scheme::Bdf2, 0.01),
            (newmark, 0.02),
        ] {
            let run = |arithmetic, threads| {
                let solver = PcgSettings { iterations: 1000, tolerance: 1e-5 };
                let settings =
                    BodySettings { scheme, solver, arithmetic, threads, ..BodySettings::default() };
                fall(bar(law, damping, settings), 40, 0.01)
            };
            let (fast, general) = (run(None, 1), run(Some(Arithmetic::Double), 1));
            assert!(fast.is_fast() && !general.is_fast());
            let far = |a: &[Vector3<f64>], b: &[Vector3<f64>]| {
                a.iter().zip(b).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max)
            };
            let (apart, moved) = (
                far(fast.positions(), general.positions()),
                far(general.positions(), general.rest_positions()),
            );
            assert!(
                moved > 0.05 && apart < 1e-3 * moved,
                "{law:?} {scheme:?} {damping}: {apart:e} of {moved}"
            );
            assert_eq!(run(None, 3).positions(), fast.positions(), "{law:?} {scheme:?}");
        }
    }
}
