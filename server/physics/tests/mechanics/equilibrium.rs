//! Equilibria of linear bodies on the fast path agree with those in double precision, whether they are
//! searched over many steps or found at once.

use nalgebra::Vector3;
use scindo_allocations::allocations;
use scindo_physics::body::{
    Arithmetic, Body, BodySettings, Constants, Notice, Outcome, PcgSettings, PointSpring, Scheme, SpringKind,
    StopReason,
};
use scindo_physics::cut::BladeSweep;
use scindo_physics::element::MaterialPoint;
use scindo_physics::material::{Law, Material};
use scindo_physics::mesh::{BoxPattern, box_mesh};

use crate::{DOWN, SOFT, apart, hold_left, left_face};

fn statics(arithmetic: Arithmetic, iterations: u32, tolerance: f64) -> BodySettings {
    let solver = PcgSettings { iterations, tolerance };
    BodySettings { solver, scheme: Scheme::Static, arithmetic: Some(arithmetic), ..BodySettings::default() }
}

fn beam(settings: BodySettings) -> Body {
    let mesh = box_mesh(Vector3::zeros(), Vector3::new(0.2, 0.05, 0.05), [16, 4, 4], BoxPattern::Tet6);
    let mut body = Body::new(mesh, Material { law: Law::Linear, ..SOFT }, settings).unwrap();
    hold_left(&mut body);
    body
}

fn sag(body: &Body) -> f64 {
    let down = body.positions().iter().zip(body.rest_positions()).map(|(x, X)| X.y - x.y);
    down.fold(0.0, f64::max)
}

/// A spring that pushes the free end up.
fn prop(body: &Body) -> PointSpring {
    let last = *body.tets().unwrap().pieces().last().unwrap();
    let kind = SpringKind::OneSided { normal: Vector3::y(), offset_m: 0.06 };
    PointSpring {
        point: MaterialPoint::in_tet(last.copies, [0.25; 4]),
        kind,
        stiffness_n_m: 20.0,
        max_force_n: f64::INFINITY,
    }
}

#[test]
fn single_precision_finds_the_equilibrium_of_double_precision() {
    let mut fast = beam(statics(Arithmetic::Single, 50, 1e-5));
    let mut exact = beam(statics(Arithmetic::Double, 2000, 1e-10));
    assert!(fast.is_fast() && !exact.is_fast());
    let springs = [prop(&fast)];
    let segment = |y: f64| [Vector3::new(0.09, y, -0.3), Vector3::new(0.09, y, 0.3)];
    let blade = BladeSweep { segments: vec![segment(0.3), segment(0.02)] };
    for springs in [&[][..], &springs] {
        for body in [&mut fast, &mut exact] {
            let report = body.step(0.02, DOWN, springs);
            assert_eq!(
                (report.outcome, report.stop),
                (Outcome::Advanced, StopReason::Converged),
                "{report:?}"
            );
            assert!(body.velocities().iter().all(|v| *v == Vector3::zeros()));
        }
        let (apart, sag) = (apart(&fast, &exact), sag(&exact));
        assert!(apart < 1e-3 * sag, "{apart} of {sag} m");
        // A body in equilibrium stays there and reports a small residual.
        let before = fast.positions().to_vec();
        let again = fast.step(0.02, DOWN, springs);
        assert!(!again.is_unconverged(), "{again:?}");
        let moved = fast.positions().iter().zip(&before).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
        assert!(moved < 1e-4 * sag, "{moved} of {sag} m");
        // The next round has a wound.
        assert!(fast.cut(&blade, 1).unwrap().elements_cut > 0 || !springs.is_empty());
        exact.cut(&blade, 1).unwrap();
    }
}

#[test]
fn relaxation_goes_on_where_it_ended() {
    let run = |iterations: u32, steps: usize| {
        let settings = BodySettings { relaxation: true, ..statics(Arithmetic::Single, iterations, 1e-5) };
        let mut body = beam(settings);
        let reports: Vec<_> = (0..steps).map(|_| body.step(0.02, DOWN, &[])).collect();
        assert!(reports.iter().all(|r| r.outcome == Outcome::Advanced && r.iterations <= iterations));
        (body, reports)
    };
    let ((often, many), (once, one)) = (run(10, 8), run(80, 1));
    assert_eq!(many.iter().map(|r| r.iterations).sum::<u32>(), one[0].iterations);
    let ratio = many[7].residual / one[0].residual;
    assert!((0.999..1.001).contains(&ratio), "{ratio}");
    assert!(apart(&often, &once) < 1e-6 * sag(&once));
    // The search comes to its end and stays there; it returns when the load changes.
    let (mut body, _) = run(10, 100);
    let mut exact = beam(statics(Arithmetic::Double, 2000, 1e-10));
    exact.step(0.02, DOWN, &[]);
    assert!(apart(&body, &exact) < 1e-3 * sag(&exact), "{} of {} m", apart(&body, &exact), sag(&exact));
    let report = body.step(0.02, DOWN, &[]);
    assert_eq!(report.stop, StopReason::Converged, "{report:?}");
    for _ in 0..100 {
        body.step(0.02, Vector3::zeros(), &[]);
    }
    assert!(sag(&body) < 1e-3 * sag(&exact));
    // Half as stiff, twice the sag.
    let Material { young_pa, poisson, rayleigh, .. } = *body.material();
    body.set_constants(Constants { young_pa: 0.5 * young_pa, poisson, rayleigh }).unwrap();
    for _ in 0..100 {
        body.step(0.02, DOWN, &[]);
    }
    let ratio = sag(&body) / sag(&exact);
    assert!((1.998..2.002).contains(&ratio), "{ratio}");
    body.set_constants(Constants { young_pa, poisson, rayleigh }).unwrap();
    for _ in 0..100 {
        body.step(0.02, DOWN, &[]);
    }
    let ratio = sag(&body) / sag(&exact);
    assert!((0.999..1.001).contains(&ratio), "{ratio}");
}

#[test]
fn a_steady_search_allocates_nothing_and_has_the_same_bits_for_any_number_of_threads() {
    for relaxation in [true, false] {
        let run = |threads| {
            let settings = BodySettings { relaxation, threads, ..statics(Arithmetic::Single, 10, 1e-6) };
            let mut body = beam(settings);
            (0..3).for_each(|_| {
                body.step(0.02, DOWN, &[]);
            });
            let before = allocations();
            (0..3).for_each(|_| {
                body.step(0.02, DOWN, &[]);
            });
            (allocations() - before, body.positions().to_vec())
        };
        let [one, two, three] = [1, 2, 3].map(run);
        assert_eq!(one.0, 0);
        assert!(one == two && one == three);
    }
}

#[test]
fn what_nothing_holds_has_no_equilibrium() {
    let mut body = beam(statics(Arithmetic::Single, 50, 1e-5));
    let all: Vec<u32> = (0..body.n_nodes() as u32).collect();
    body.release(&all);
    assert_eq!(body.step(0.02, DOWN, &[]).notice, Some(Notice::LooseBody));
    let held = left_face(&body);
    body.fix(&held, [true, false, true], Vector3::zeros()).unwrap();
    let report = body.step(0.02, DOWN, &[]);
    assert_eq!(report.outcome, Outcome::Refused);
    assert!(matches!(report.notice, Some(Notice::Underheld { driven: true, .. })), "{report:?}");
    // A body that could slide but is not driven rests.
    let report = body.step(0.02, Vector3::x(), &[]);
    assert_eq!(report.outcome, Outcome::Advanced);
    assert!(matches!(report.notice, Some(Notice::Underheld { driven: false, .. })), "{report:?}");
}
