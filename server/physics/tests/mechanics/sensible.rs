//! What a body reports if too little holds it, if it leaves any sensible range, or if it is cut through
//! its support.

use nalgebra::Vector3;
use scindo_physics::body::{Body, BodySettings, Method, Notice, Outcome, PcgSettings, Scheme, StopReason};
use scindo_physics::cut::BladeSweep;
use scindo_physics::material::{Law, Material};
use scindo_physics::mesh::{BoxPattern, box_mesh};

use crate::{DOWN, SOFT, cube, left_face, settings};

fn at_rest(method: Method) -> BodySettings {
    BodySettings {
        scheme: Scheme::Static,
        method,
        solver: PcgSettings { iterations: 2_000, tolerance: 1e-9 },
        ..BodySettings::default()
    }
}

/// Nodes of a body whose rest position satisfies `at`.
fn nodes(body: &Body, at: impl Fn(&Vector3<f64>) -> bool) -> Vec<u32> {
    (0u32..).zip(body.rest_positions()).filter(|(_, x)| at(x)).map(|(n, _)| n).collect()
}

#[test]
fn a_static_body_that_can_slide_is_refused_with_the_direction() {
    for (method, law) in [(Method::Pcg, Law::Corotational), (Method::Cholesky, Law::Linear)] {
        let mut body = cube(3, Material { law, ..SOFT }, at_rest(method));
        body.fix(&left_face(&body), [true, false, false], Vector3::zeros()).unwrap();
        let report = body.step(0.01, DOWN, &[]);
        assert_eq!(report.outcome, Outcome::Refused);
        let Some(Notice::Underheld { motion, driven: true }) = report.notice else { panic!("{report:?}") };
        assert_eq!(motion.slide, Vector3::y(), "along gravity");
        let said = report.notice.unwrap().to_string();
        assert!(said.contains("from sliding along [0.000, 1.000, 0.000]"), "{said}");
        // The same without a load: an equilibrium, one of many.
        let report = body.step(0.01, Vector3::zeros(), &[]);
        assert_eq!(report.outcome, Outcome::Advanced);
        assert!(matches!(report.notice, Some(Notice::Underheld { driven: false, .. })), "{report:?}");
    }
}

/// The pivots of motions that nothing holds are rounding of either sign, wherever they stand.
#[test]
fn cholesky_ends_soundly_on_bodies_that_are_held_by_too_little() {
    for cells in [1, 2, 3] {
        for (held, law) in [(1, Law::Linear), (2, Law::StVenantKirchhoff), (2, Law::NeoHookean)] {
            let mut body = cube(cells, Material { law, ..SOFT }, at_rest(Method::Cholesky));
            let edge = nodes(&body, |x| x.x == 0.0 && x.y == 0.0);
            body.fix(&edge[..held.min(edge.len())], [true; 3], Vector3::zeros()).unwrap();
            body.add_nodal_force(edge[0], Vector3::new(1.0, 0.0, 0.0)).unwrap();
            for _ in 0..2 {
                let report = body.step(0.01, DOWN, &[]);
                assert!(body.positions().iter().all(|x| x.amax().is_finite()));
                assert!(report.notice.is_some(), "{cells}, {held}, {law:?}: {report:?}");
            }
        }
    }
}

#[test]
fn a_stretched_neo_hookean_cube_is_solved_by_cholesky() {
    let mut body = cube(3, Material { law: Law::NeoHookean, ..SOFT }, at_rest(Method::Cholesky));
    body.fix(&left_face(&body), [true; 3], Vector3::zeros()).unwrap();
    let far = nodes(&body, |x| x.x > 0.1 - 1e-9);
    body.fix(&far, [true; 3], Vector3::new(0.05, 0.0, 0.0)).unwrap();
    let report = body.step(0.01, Vector3::zeros(), &[]);
    assert_eq!((report.outcome, report.stop), (Outcome::Advanced, StopReason::Converged), "{report:?}");
}

#[test]
fn a_body_that_is_drawn_out_of_range_is_held_where_it_was() {
    // Its own weight would draw it out to hundreds of times its size.
    let limp = Material { young_pa: 0.1, law: Law::Linear, ..SOFT };
    let mut body = cube(3, limp, settings(200, 1e-6));
    body.fix(&left_face(&body), [true; 3], Vector3::zeros()).unwrap();
    let held = (0..200).map(|_| body.step(0.02, DOWN, &[])).find(|report| report.outcome == Outcome::Held);
    let Some(Notice::OutOfRange { stretch, size_m }) = held.unwrap().notice else { panic!("{held:?}") };
    assert!(stretch > 10.0 && (size_m / 0.1 - 3f64.sqrt()).abs() < 1e-9, "{stretch}, {size_m}");
    assert_eq!(body.kinetic_energy(), 0.0);
    let most = body.positions().iter().zip(body.rest_positions()).map(|(x, X)| (x - X).norm());
    assert!(most.fold(0.0, f64::max) < 10.0 * size_m);
    // Free fall does not count.
    let mut free = cube(3, SOFT, settings(20, 1e-4));
    for _ in 0..300 {
        assert_eq!(free.step(0.02, DOWN, &[]).outcome, Outcome::Advanced);
    }
    assert!(free.centre_of_mass().y < -100.0);
}

/// A foil of 7.5 µm × 17 mm cells: in single precision its strain is rounding.
#[test]
fn a_foil_hangs_as_it_does_in_double_precision() {
    let hang = |thickness: f64| {
        let size = Vector3::new(thickness, 0.05, 0.05);
        let mesh = box_mesh(Vector3::zeros(), size, [4, 3, 3], BoxPattern::Tet6);
        let mut body = Body::new(mesh, Material { young_pa: 2e3, ..SOFT }, settings(1000, 1e-6)).unwrap();
        let top = nodes(&body, |x| x.y > 0.05 - 1e-9);
        body.fix(&top, [true; 3], Vector3::zeros()).unwrap();
        for _ in 0..30 {
            let report = body.step(0.02, DOWN, &[]);
            assert_eq!(report.outcome, Outcome::Advanced, "{report:?}");
        }
        let down = body.positions().iter().zip(body.rest_positions()).map(|(x, X)| X.y - x.y);
        (body.is_fast(), down.fold(0.0, f64::max))
    };
    let ((thin_is_fast, thin), (thick_is_fast, thick)) = (hang(3e-5), hang(5e-3));
    assert!(!thin_is_fast && thick_is_fast);
    // It stretches under its own weight, by the same amount whatever its thickness.
    assert!((thin / thick - 1.0).abs() < 0.2, "{thin} and {thick}");
}

#[test]
fn reactions_count_both_lips_of_a_held_node() {
    let mut body = cube(4, SOFT, at_rest(Method::Cholesky));
    let top = nodes(&body, |x| x.y > 0.1 - 1e-9);
    body.fix(&top, [true; 3], Vector3::zeros()).unwrap();
    // Right through, exactly along a layer of nodes, some of them held.
    let segment = |y: f64| [Vector3::new(0.05, y, -0.5), Vector3::new(0.05, y, 0.5)];
    body.cut(&BladeSweep { segments: vec![segment(-0.5), segment(0.5)] }, 1).unwrap();
    assert_eq!(body.parts().len(), 2);
    let report = body.step(0.01, DOWN, &[]);
    assert_eq!(report.stop, StopReason::Converged, "{report:?}");
    let weight = body.total_mass() * DOWN;
    let reaction = body.reaction(&top, DOWN);
    assert!((reaction + weight).norm() < 1e-6 * weight.norm(), "{reaction} against {weight}");
}
