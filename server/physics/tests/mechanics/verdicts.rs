//! What a step reports: whether it converged, on every path. Also parts that sleep, and explicit steps
//! after a cut.

use nalgebra::Vector3;
use scindo_physics::body::{Arithmetic, Body, BodySettings, Method, Notice, Outcome, Scheme, StopReason};
use scindo_physics::cut::BladeSweep;
use scindo_physics::material::{Law, Material};
use scindo_physics::mesh::{BoxPattern, TetMesh, box_mesh};
use scindo_physics::solver::PcgSettings;

use crate::{DOWN, SOFT};

type V = Vector3<f64>;

fn beam() -> TetMesh {
    box_mesh(V::zeros(), V::new(0.2, 0.04, 0.04), [20, 4, 4], BoxPattern::Tet6)
}

/// A beam that is held at x = 0.
fn held(law: Law, settings: BodySettings) -> Body {
    let mut body = Body::new(beam(), Material { law, ..SOFT }, settings).unwrap();
    let end: Vec<u32> = (0..body.rest_positions().len() as u32)
        .filter(|&n| body.rest_positions()[n as usize].x == 0.0)
        .collect();
    body.fix(&end, [true; 3], V::zeros()).unwrap();
    body
}

fn solver(iterations: u32) -> BodySettings {
    BodySettings { solver: PcgSettings { iterations, tolerance: 1e-6 }, ..BodySettings::default() }
}

/// A wall across the beam at `x`, from y = −0.01 to `depth`.
fn wall(x: f64, depth: f64) -> BladeSweep {
    let at = |y: f64| [V::new(x, y, -0.01), V::new(x, y, 0.05)];
    BladeSweep { segments: vec![at(-0.01), at(depth)] }
}

#[test]
fn unconverged_means_the_same_on_every_path() {
    // Path, law and settings, and whether the iterations are enough.
    let bdf2 = |iterations| BodySettings { scheme: Scheme::Bdf2, ..solver(iterations) };
    let direct = BodySettings { method: Method::Cholesky, ..solver(50) };
    let cases = [
        ("fast", Law::Corotational, solver(3), false),
        ("fast", Law::Corotational, solver(2000), true),
        ("general, one solve", Law::Corotational, bdf2(3), false),
        ("general, one solve", Law::Corotational, bdf2(2000), true),
        ("general, one factorisation", Law::Corotational, direct, true),
        ("newton", Law::StVenantKirchhoff, BodySettings { newton_steps: Some(3), ..solver(3) }, false),
        (
            "newton",
            Law::StVenantKirchhoff,
            BodySettings { arithmetic: Some(Arithmetic::Double), ..solver(2000) },
            true,
        ),
        ("fast, several solves", Law::StVenantKirchhoff, solver(2000), true),
    ];
    for (name, law, settings, enough) in cases {
        let mut body = held(law, settings);
        for step in 0..10 {
            let report = body.step(0.02, DOWN, &[]);
            assert_eq!(report.outcome, Outcome::Advanced);
            assert_eq!(report.tolerance, 1e-6);
            assert_eq!(report.is_unconverged(), !enough, "{name}, step {step}: {report:?}");
            // Rounding ends the solves of a nonlinear law in single precision.
            let (reached, rounding) = (report.residual <= report.tolerance, report.rounding);
            assert_eq!(report.is_unconverged(), !(reached || report.residual <= rounding));
            assert!(rounding == 0.0 || (1e-6..0.1).contains(&rounding), "{name}, step {step}: {report:?}");
            let stop = if reached { StopReason::Converged } else { StopReason::Stagnated };
            assert!(!enough || report.stop == stop, "{name}, step {step}: {report:?}");
        }
    }
}

/// A specimen stretched between two clamps without any load: only its supports act on it, and soon
/// nothing moves.
#[test]
fn what_is_driven_by_its_supports_alone_converges() {
    let newmark = Scheme::Newmark { beta: 0.25, gamma: 0.5 };
    for scheme in [Scheme::ImplicitEuler, Scheme::Bdf2, newmark, Scheme::Static] {
        for law in [Law::Linear, Law::Corotational, Law::StVenantKirchhoff, Law::NeoHookean] {
            let solver = PcgSettings { iterations: 2000, tolerance: 1e-4 };
            let settings = BodySettings { scheme, solver, ..BodySettings::default() };
            let mut body = held(law, settings);
            let rest = body.rest_positions();
            let end: Vec<u32> = (0..rest.len() as u32).filter(|&n| rest[n as usize].x > 0.2 - 1e-9).collect();
            body.fix(&end, [true; 3], V::new(0.03, 0.0, 0.02)).unwrap();
            for step in 1..=60 {
                body.set_prescribed_share(f64::min(1.0, f64::from(step) / 25.0));
                let report = body.step(0.02, V::zeros(), &[]);
                assert_eq!(report.outcome, Outcome::Advanced);
                assert!(!report.is_unconverged(), "{scheme:?}, {law:?}, step {step}: {report:?}");
            }
            assert!(body.elastic_energy() > 1e-4);
        }
    }
}

#[test]
fn explicit_steps_have_no_tolerance_to_miss() {
    let mut body = held(Law::Linear, BodySettings { scheme: Scheme::Rk4, ..solver(50) });
    let report = body.step(0.01, DOWN, &[]);
    assert!(matches!(report.notice, Some(Notice::Divided { .. })), "{report:?}");
    assert!(!report.is_unconverged() && !report.is_divided() && report.tolerance == 0.0, "{report:?}");
}

/// The estimate of conjugate gradients lags by four iterations and is a lower bound. It is within a power
/// of ten of the truth, the distance to a far better solution.
#[test]
fn the_fast_path_reports_its_algebraic_error() {
    let (h, mut errors) = (0.02, Vec::new());
    for iterations in [10, 20, 40] {
        let mut rough = held(Law::Linear, solver(iterations));
        let mut exact = held(Law::Linear, solver(5000));
        let report = rough.step(h, DOWN, &[]);
        exact.step(h, DOWN, &[]);
        let apart: Vec<V> = rough.positions().iter().zip(exact.positions()).map(|(a, b)| a - b).collect();
        // ‖e‖² = eᵀ (M/h² + K) e; the energy of K from that of the displaced beam.
        let inertia: f64 =
            apart.iter().zip(rough.masses()).map(|(e, m)| m * e.norm_squared()).sum::<f64>() / (h * h);
        let displaced: Vec<V> = exact.rest_positions().iter().zip(&apart).map(|(x, e)| x + e).collect();
        exact.set_state(&displaced, &vec![V::zeros(); displaced.len()]).unwrap();
        let truth = (inertia + 2.0 * exact.elastic_energy()).sqrt();
        let estimate = report.algebraic_error;
        assert!(
            estimate > 0.1 * truth && estimate < 10.0 * truth,
            "{iterations}: {estimate} against {truth}"
        );
        errors.push(estimate);
    }
    assert!(errors[2] < errors[0], "{errors:?}");
}

#[test]
fn a_part_that_sleeps_stays_where_it_is_and_the_rest_goes_on() {
    for scheme in [Scheme::ImplicitEuler, Scheme::Bdf2] {
        let make = || {
            let mut body = held(Law::Corotational, BodySettings { scheme, ..solver(500) });
            body.cut(&wall(0.113, 0.05), 1).unwrap();
            for _ in 0..5 {
                body.step(0.01, DOWN, &[]);
            }
            body
        };
        let (mut body, mut falling) = (make(), make());
        let part = body.parts().free.iter().position(|&free| free).unwrap();
        let copies: Vec<usize> =
            (0..body.positions().len()).filter(|&c| body.parts().of_copy[c] as usize == part).collect();
        let (epoch, before) = (body.epoch(), body.positions().to_vec());
        let mut centres = Vec::new();
        body.part_centres(&mut centres);
        assert!(centres[part].x > 0.113 && centres[1 - part].x < 0.113, "{centres:?}");
        assert!(body.put_to_sleep(part) && !body.put_to_sleep(part) && body.sleeps());
        assert!(body.epoch() > epoch && !body.parts().any_free());
        for _ in 0..10 {
            let report = body.step(0.01, DOWN, &[]);
            falling.step(0.01, DOWN, &[]);
            assert!(report.outcome == Outcome::Advanced && !report.is_unconverged(), "{report:?}");
        }
        let mut moved: f64 = 0.0;
        for (c, was) in before.iter().enumerate() {
            if copies.contains(&c) {
                assert!(body.is_asleep(c as u32) && body.velocities()[c].norm() < 1e-9);
                assert!((body.positions()[c] - was).norm() < 1e-12);
                assert!((falling.positions()[c] - was).norm() > 0.01);
            } else {
                moved = moved.max((body.positions()[c] - falling.positions()[c]).norm());
            }
        }
        assert!(moved < 1e-5, "what is awake moves as if nothing had fallen asleep: {moved}");
        // The copies of a further cut are numbered after those that sleep, which stay asleep.
        body.cut(&wall(0.06, 0.02), 2).unwrap();
        body.step(0.01, DOWN, &[]);
        assert!(copies.iter().all(|&c| (body.positions()[c] - before[c]).norm() < 1e-12));
        body.reset().unwrap();
        assert!(!body.sleeps());
    }
}

/// Slivers of any thickness: the stable step is about that of the uncut body. It is never shorter than
/// that of the worst element by itself, because a piece shares its mass as it shares its stiffness.
#[test]
fn explicit_steps_stay_as_long_as_they_were_however_thin_a_cut_leaves_the_pieces() {
    for scheme in [Scheme::SymplecticEuler, Scheme::Midpoint, Scheme::Rk4] {
        let substeps = |cut: Option<f64>| {
            let mut body = held(Law::Corotational, BodySettings { scheme, ..solver(50) });
            let (mass, momentum) = (body.total_mass(), |body: &Body| -> V {
                body.velocities().iter().zip(body.masses()).map(|(v, m)| *m * v).sum()
            });
            for _ in 0..3 {
                body.step(0.0005, DOWN, &[]);
            }
            if let Some(beside) = cut {
                let before = momentum(&body);
                body.cut(&wall(0.1 + beside, 0.03), 1).unwrap();
                assert!((body.total_mass() / mass - 1.0).abs() < 1e-12);
                assert!((momentum(&body) - before).norm() < 1e-12 * (1.0 + before.norm()));
            }
            let mut most = 0;
            for _ in 0..10 {
                let report = body.step(0.0005, DOWN, &[]);
                assert_eq!(report.outcome, Outcome::Advanced, "{report:?}");
                most = most.max(report.substeps);
            }
            assert!(body.positions().iter().zip(body.rest_positions()).all(|(x, X)| (x - X).norm() < 0.05));
            most
        };
        let uncut = substeps(None);
        for beside in [1e-3, 1e-5, 1e-7] {
            let cut = substeps(Some(beside));
            assert!(2 * cut <= 3 * uncut + 2, "{scheme:?}, {beside}: {cut} against {uncut}");
        }
    }
}
