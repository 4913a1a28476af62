//! BDF2 and Newmark's method: the same motion on both paths, their order, and what a cut does to them.

use nalgebra::Vector3;
use scindo_allocations::allocations;
use scindo_physics::body::{
    Arithmetic, Body, BodySettings, Constants, Notice, Outcome, PointSpring, Scheme, SpringKind,
};
use scindo_physics::cut::BladeSweep;
use scindo_physics::element::MaterialPoint;
use scindo_physics::material::{Law, Material, Rayleigh};
use scindo_physics::mesh::{BoxPattern, box_mesh};

use crate::{DOWN, SOFT, apart, cube, hold_left, settings};

const NEWMARK: Scheme = Scheme::AVERAGE_ACCELERATION;
const ALPHA: Scheme = Scheme::GeneralisedAlpha { spectral_radius: 0.8 };

/// A beam that is held at its left end, in free vibration under its weight.
fn beam(law: Law, rayleigh: Rayleigh, settings: BodySettings) -> Body {
    let mesh = box_mesh(Vector3::zeros(), Vector3::new(0.2, 0.05, 0.05), [8, 2, 2], BoxPattern::Tet6);
    let mut body = Body::new(mesh, Material { law, rayleigh, ..SOFT }, settings).unwrap();
    hold_left(&mut body);
    body
}

fn with(scheme: Scheme, arithmetic: Arithmetic, tolerance: f64) -> BodySettings {
    BodySettings { scheme, arithmetic: Some(arithmetic), ..settings(500, tolerance) }
}

#[test]
fn both_paths_move_alike() {
    let damped = Rayleigh { mass_1_s: 0.5, stiffness_s: 0.002 };
    for scheme in [Scheme::Bdf2, NEWMARK, ALPHA] {
        for law in [Law::Linear, Law::Corotational] {
            for rayleigh in [Rayleigh::default(), damped] {
                let mut fast = beam(law, rayleigh, with(scheme, Arithmetic::Single, 1e-6));
                let mut general = beam(law, rayleigh, with(scheme, Arithmetic::Double, 1e-9));
                assert!(fast.is_fast() && !general.is_fast());
                for step in 0..60 {
                    let reports = [fast.step(0.004, DOWN, &[]), general.step(0.004, DOWN, &[])];
                    assert!(reports.iter().all(|r| r.outcome == Outcome::Advanced), "{reports:?}");
                    assert!(reports[0].residual <= 1e-6 && reports[0].algebraic_error >= 0.0);
                    let euler = matches!(reports[0].notice, Some(Notice::Started));
                    let kept = reports.iter().all(|r| euler || r.scheme == scheme);
                    assert!(kept, "step {step}: {reports:?}");
                    assert_eq!(euler, scheme == Scheme::Bdf2 && step == 0, "{:?}", reports[0].notice);
                }
                let (sag, apart) =
                    (apart(&fast, &beam(law, rayleigh, settings(1, 0.5))), apart(&fast, &general));
                // The corotational tangents differ: held rotations against the projected one.
                let bound = if law == Law::Linear { 1e-4 } else { 1e-2 };
                assert!(apart < bound * sag, "{scheme:?} {law:?} {rayleigh:?}: {apart} m of {sag} m");
            }
        }
    }
}

/// Generalised-α leaves of the fastest oscillations what its spectral radius says, and damps slow ones hardly.
#[test]
fn generalised_alpha_damps_fast_oscillations_alone() {
    for arithmetic in [Arithmetic::Single, Arithmetic::Double] {
        for spectral_radius in [1.0, 0.8, 0.5] {
            let scheme = Scheme::GeneralisedAlpha { spectral_radius };
            let left = |h: f64, steps: u32| {
                let mut body = beam(Law::Linear, Rayleigh::default(), with(scheme, arithmetic, 1e-7));
                let drawn = |x: &Vector3<f64>| x + Vector3::new(1e-3 * x.x, 0.0, 0.0);
                let x: Vec<Vector3<f64>> = body.rest_positions().iter().map(drawn).collect();
                let v = vec![Vector3::zeros(); x.len()];
                body.set_state(&x, &v).unwrap();
                let before = body.elastic_energy();
                for _ in 0..steps {
                    assert_eq!(body.step(h, Vector3::zeros(), &[]).outcome, Outcome::Advanced);
                }
                (body.kinetic_energy() + body.elastic_energy()) / before
            };
            // Steps of many periods leave ρ² of the energy each, and a little more at first, because both roots are ρ.
            let rate = (left(2.0, 24) / left(2.0, 12)).powf(1.0 / 12.0);
            let expected = spectral_radius.powi(2);
            let expects = rate > 0.98 * expected && rate < 1.14 * expected;
            assert!(expects, "{arithmetic:?} {spectral_radius}: {rate}");
            let slow = left(1e-4, 100);
            assert!(slow > 0.97 && slow < 1.001, "{arithmetic:?} {spectral_radius}: {slow}");
        }
    }
}

/// Cuts the beam half through.
fn cut(body: &mut Body) {
    let segment = |y: f64| [Vector3::new(0.09, y, -0.3), Vector3::new(0.09, y, 0.3)];
    let made = body.cut(&BladeSweep { segments: vec![segment(0.3), segment(0.02)] }, 1).unwrap();
    assert!(!made.new_copies.is_empty());
}

/// Makes the beam three times as stiff.
fn stiffen(body: &mut Body) {
    let Material { young_pa, poisson, rayleigh, .. } = *body.material();
    body.set_constants(Constants { young_pa: 3.0 * young_pa, poisson, rayleigh }).unwrap();
}

/// Distance after 0.16 s of a run with step `h` from one with a sixteenth of it, both changed at half the
/// time; and how often the scheme started anew.
fn error_with(
    change: fn(&mut Body),
    (scheme, arithmetic): (Scheme, Arithmetic),
    law: Law,
    h: f64,
) -> (f64, u32) {
    let run = |h: f64| {
        let mut body =
            beam(law, Rayleigh { mass_1_s: 0.0, stiffness_s: 0.01 }, with(scheme, arithmetic, 1e-7));
        let n = (0.16 / h).round() as u32;
        let mut restarts = 0;
        for step in 0..n {
            if step == n / 2 {
                change(&mut body);
            }
            let report = body.step(h, DOWN, &[]);
            assert_eq!(report.outcome, Outcome::Advanced, "{report:?}");
            restarts += u32::from(matches!(report.notice, Some(Notice::Started)));
        }
        (body, restarts)
    };
    let ((fine, _), (coarse, restarts)) = (run(h / 16.0), run(h));
    (apart(&fine, &coarse), restarts)
}

/// Holds the order of `schemes` across a change on both paths; only the first step of BDF2 starts anew.
fn assert_order(change: fn(&mut Body), schemes: &[Scheme]) {
    for &scheme in schemes {
        for (arithmetic, law) in [
            (Arithmetic::Single, Law::Linear),
            (Arithmetic::Single, Law::Corotational),
            (Arithmetic::Mixed, Law::StVenantKirchhoff),
        ] {
            let [coarse, fine] = [0.004, 0.002].map(|h| error_with(change, (scheme, arithmetic), law, h));
            let order = (coarse.0 / fine.0).log2();
            println!("{scheme:?} {arithmetic:?} {law:?}: {coarse:?} {fine:?}, order {order:.2}");
            assert!(order > 1.7, "{scheme:?} {arithmetic:?} {law:?}: {coarse:?} {fine:?}, order {order}");
            assert_eq!(coarse.1, u32::from(scheme == Scheme::Bdf2), "only the first step starts anew");
        }
    }
}

#[test]
fn a_cut_neither_restarts_a_scheme_nor_costs_it_its_order() {
    assert_order(cut, &[Scheme::Bdf2, NEWMARK]);
}

/// The forces jump with the constants, so the acceleration of the last step is no longer that of the body.
#[test]
fn new_constants_do_not_cost_newmark_its_order() {
    assert_order(stiffen, &[NEWMARK]);
}

/// A free cube that turns fast gains no energy, whatever the scheme does.
#[test]
fn a_spinning_body_gains_no_energy() {
    for scheme in [Scheme::Bdf2, NEWMARK] {
        for omega in [3.0, 30.0, 120.0] {
            let mut body =
                cube(3, Material { young_pa: 1e6, ..SOFT }, with(scheme, Arithmetic::Single, 1e-5));
            let spin = Vector3::new(0.3, 0.2, 1.0).normalize() * omega;
            let v: Vec<_> =
                body.rest_positions().iter().map(|X| spin.cross(&(X - Vector3::repeat(0.05)))).collect();
            let rest = body.rest_positions().to_vec();
            body.set_state(&rest, &v).unwrap();
            let start = body.kinetic_energy() + body.elastic_energy();
            for _ in 0..200 {
                let report = body.step(0.01, Vector3::zeros(), &[]);
                assert_eq!(report.outcome, Outcome::Advanced);
                let energy = body.kinetic_energy() + body.elastic_energy();
                assert!(energy < 1.02 * start, "{scheme:?} {omega}: {energy} of {start} J, {report:?}");
            }
        }
    }
}

/// Newmark's average acceleration keeps the energy of a linear body that vibrates, over many periods.
#[test]
fn newmark_keeps_energy_in_single_precision() {
    let mut body = beam(Law::Linear, Rayleigh::default(), with(NEWMARK, Arithmetic::Single, 1e-6));
    let x: Vec<_> = body.rest_positions().iter().map(|X| X + Vector3::y() * X.x * X.x).collect();
    body.set_state(&x, &vec![Vector3::zeros(); x.len()]).unwrap();
    let start = body.elastic_energy();
    let (mut least, mut most) = (f64::INFINITY, 0.0_f64);
    for _ in 0..2000 {
        assert_eq!(body.step(0.002, Vector3::zeros(), &[]).notice, None);
        let energy = body.kinetic_energy() + body.elastic_energy();
        (least, most) = (least.min(energy), most.max(energy));
    }
    assert!(least > 0.99 * start && most < 1.01 * start, "{least} … {most} of {start} J");
}

/// The bits do not depend on the number of threads, and a steady step allocates nothing, contacts included.
#[test]
fn threads_do_not_change_a_bit_and_nothing_is_allocated() {
    for scheme in [Scheme::Bdf2, NEWMARK] {
        for law in [Law::Linear, Law::Corotational] {
            let run = |threads| {
                let settings = BodySettings { threads, ..with(scheme, Arithmetic::Single, 1e-4) };
                let mut body = beam(law, Rayleigh { mass_1_s: 0.1, stiffness_s: 0.001 }, settings);
                let kind = SpringKind::OneSided { normal: Vector3::y(), offset_m: 0.0 };
                let point = MaterialPoint::in_tet(body.tets().unwrap().pieces()[70].copies, [0.25; 4]);
                let spring = PointSpring { point, kind, stiffness_n_m: 50.0, max_force_n: 1.0 };
                (0..8).for_each(|_| {
                    body.step(0.004, DOWN, &[spring]);
                });
                let before = allocations();
                (0..8).for_each(|_| {
                    body.step(0.004, DOWN, &[spring]);
                });
                let made = allocations() - before;
                (body.positions().to_vec(), body.velocities().to_vec(), made)
            };
            let [one, two, three] = [1, 2, 3].map(run);
            assert_eq!(one.2, 0, "{scheme:?} {law:?}");
            assert!(one == two && one == three, "{scheme:?} {law:?}");
        }
    }
}
