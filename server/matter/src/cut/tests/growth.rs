//! Partial cuts, cuts that grow, cuts of moving tissue, closed curves.

use super::*;

/// Slab cut from x = −0.1 to `to` in `n` advances, blade along y.
pub(super) fn advance(body: &mut Body, to: f64, z: f64, n: usize, incision: u32) {
    for k in 0..n {
        let at = |k: usize| -0.1 + (to + 0.1) * k as f64 / n as f64;
        let blade = |x: f64| [v(x, -0.1, z), v(x, 1.1, z)];
        body.sweep(&[blade(at(k)), blade(at(k + 1))], incision);
    }
}

#[test]
fn a_cut_that_ends_inside_opens_a_slit_and_separates_nothing() {
    let mut body = Body::unit(6);
    advance(&mut body, 0.55, 0.51, 1, 1);
    check::everything(&body.cut);
    assert_eq!(body.cut.components().len(), 1);
    let lips: f64 = body.cut.surface().tags.iter().filter(|&&t| t == 1).count() as f64;
    assert!(lips > 0.0 && body.cut.n_copies() > 343);
}

#[test]
fn two_hundred_small_advances_equal_the_whole_cut() {
    for (z, to) in [(0.51, 1.1), (0.51, 0.63), (0.5, 1.1), (0.5, 0.63)] {
        let mut whole = Body::unit(6);
        advance(&mut whole, to, z, 1, 1);
        let mut grown = Body::unit(6);
        let mut before = grown.topology();
        for k in 0..200 {
            let at = |k: usize| -0.1 + (to + 0.1) * k as f64 / 200.0;
            let blade = |x: f64| [v(x, -0.1, z), v(x, 1.1, z)];
            grown.sweep(&[blade(at(k)), blade(at(k + 1))], 1);
            let now = grown.topology();
            assert!(now.iter().zip(&before).all(|(n, b)| n >= b));
            before = now;
        }
        check::everything(&grown.cut);
        check::everything(&whole.cut);
        assert_eq!(grown.topology(), whole.topology(), "z {z}, to {to}");
    }
}

/// A tenth of an element at a time. What the blade has entered and not left is reported, lies where the blade
/// was, reaches back at most one element, and is gone when the cut is through.
#[test]
fn what_is_pending_is_within_one_element_of_the_blade() {
    let (cells, z) = (6, 0.47);
    let h = 1.0 / cells as f64;
    let mut body = Body::unit(cells);
    let mut most = 0;
    for k in 0..=75 {
        let x = -0.1 + 0.1 * h * f64::from(k);
        let report = body.sweep(&[[v(x, -0.1, z), v(x, 1.1, z)]], 3);
        let faces = body.cut.pending_faces();
        assert_eq!(faces.is_empty(), report.pending_edges == 0, "blade at {x}");
        for face in &faces {
            assert!(face.incision == 3 && (2..=4).contains(&face.corners.len()));
            for p in face.corners.iter().map(|c| c.position(&body.x)) {
                assert!(
                    (p.z - z).abs() < 1e-12 && p.x < x + 1e-5 && p.x > x - 1.001 * h,
                    "{p:?}, blade at {x}"
                );
            }
        }
        most = most.max(faces.len());
    }
    assert!(most > 10);
    assert_eq!((body.cut.components().len(), body.cut.pending_faces().len()), (2, 0));
}

#[test]
fn single_segments_continue_the_incision() {
    let mut body = Body::unit(4);
    for k in 0..=30 {
        let x = -0.1 + 0.04 * f64::from(k);
        body.sweep(&[[v(x, -0.1, 0.45), v(x, 1.1, 0.45)]], 4);
    }
    check::everything(&body.cut);
    assert_eq!(body.cut.components().len(), 2);
}

/// The tissue translates at 1 m/s and rotates while the blade passes. The incision stays connected, so it
/// cuts the body apart.
#[test]
fn an_incision_stays_connected_while_the_tissue_moves() {
    let mut body = Body::new([0.1; 3], [6; 3], BoxPattern::Tet6);
    let rest = body.cut.rest_positions();
    assert_eq!(rest.len(), body.x.len());
    for k in 0..=150 {
        let time = f64::from(k) * 1e-3;
        let turn = nalgebra::Rotation3::from_axis_angle(&Vector3::y_axis(), 0.6 * (40.0 * time).sin());
        for (x, &node) in body.x.iter_mut().zip(body.cut.copy_node()) {
            *x = turn * (rest[node as usize] - v(0.05, 0.05, 0.05)) + v(0.0, time, 0.0) + v(0.05, 0.05, 0.05);
        }
        let s = -0.02 + 0.14 * f64::from(k) / 150.0;
        body.sweep(&[[v(s, time - 0.05, 0.05), v(s, time + 0.15, 0.05)]], 1);
    }
    check::everything(&body.cut);
    assert_eq!(body.cut.components().len(), 2, "{:?}", body.cut.components().volume);
}

/// The tissue deforms in waves, at up to 1 m/s, and does not move as a rigid body.
#[test]
fn an_incision_stays_connected_while_the_tissue_waves() {
    for (amplitude, cells) in [(0.002, 6), (0.005, 6), (0.01, 5), (0.01, 9)] {
        let mut body = Body::new([0.1; 3], [cells; 3], BoxPattern::Tet6);
        let rest = body.cut.mesh().nodes.clone();
        for k in 0..=150 {
            let time = f64::from(k) * 1e-3;
            for (x, &node) in body.x.iter_mut().zip(body.cut.copy_node()) {
                let p = rest[node as usize];
                let phase = 100.0 * time + 50.0 * p.y + 20.0 * p.x;
                *x = p + v(0.3 * phase.cos(), 0.5 * phase.cos(), phase.sin()) * amplitude;
            }
            let s = -0.02 + 0.14 * f64::from(k) / 150.0;
            body.sweep(&[[v(s, -0.05, 0.047), v(s, 0.15, 0.052)]], 1);
        }
        check::everything(&body.cut);
        let parts = body.cut.components().volume;
        assert_eq!(parts.len(), 2, "amplitude {amplitude}: {parts:?}");
    }
}

/// A closed curve cuts a plug out of the body.
#[test]
fn a_closed_curve_cuts_a_plug_out() {
    for n in [5, 16, 40] {
        for steps in [1, n] {
            let mut body = Body::unit(6);
            let blade = |k: usize| {
                let angle = std::f64::consts::TAU * (k % n) as f64 / n as f64 + 0.1;
                let (x, y) = (0.5 + 0.3 * angle.cos(), 0.5 + 0.3 * angle.sin());
                [v(x, y, -0.1), v(x, y, 1.1)]
            };
            for s in 0..steps {
                let (from, to) = (s * n / steps, (s + 1) * n / steps);
                let segments: Vec<_> = (from..=to).map(blade).collect();
                body.sweep(&segments, 1);
            }
            check::everything(&body.cut);
            assert_eq!(body.cut.components().len(), 2, "{n} sides in {steps} sweeps");
        }
    }
}

/// A hand trembles: while the blade advances by a fiftieth of an element, it is off its path by up to a
/// tenth. No chip comes off, and nothing stays connected.
#[test]
fn a_blade_that_trembles_cuts_like_a_steady_one() {
    let h = 1.0 / 6.0;
    let topologies = [(0.1, 0.0), (0.1, 0.02), (0.1, 0.1), (0.02, 0.02), (0.02, 0.1)].map(|(step, off)| {
        let mut body = Body::unit(6);
        let mut random = Rng::with_seed(12);
        let mut place = |x: f64, y: f64| v(x, y, 0.47) + random.vector(off * h);
        for k in 0..=(1.2 / (step * h)) as u32 {
            let x = -0.1 + step * h * f64::from(k);
            body.sweep(&[[place(x, -0.1), place(x, 1.1)]], 3);
        }
        check::everything(&body.cut);
        assert_eq!(body.cut.components().len(), 2, "{step} {off}");
        body.topology()
    });
    assert!(topologies.iter().all(|t| *t == topologies[0]), "{topologies:?}");
}
