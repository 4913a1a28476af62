//! Cuts of every kind: bent, curved, sawn, branching, beginning and ending inside. The result is the same in
//! every unit of length.

use super::*;
use std::f64::consts::{PI, TAU};

/// Blades parallel to z through points of the unit square, from below the unit cube to above it.
pub(super) fn upright(points: &[[f64; 2]]) -> Vec<[Vector3<f64>; 2]> {
    points.iter().map(|p| [v(p[0], p[1], -0.1), v(p[0], p[1], 1.1)]).collect()
}

/// Half a circle around the middle of the edge y = 0, from y < 0 to y < 0.
fn arc(n: usize) -> Vec<[Vector3<f64>; 2]> {
    let at = |k: usize| {
        let angle = PI * (-0.1 + 1.2 * k as f64 / n as f64);
        [0.51 + 0.33 * angle.cos(), 0.02 + 0.41 * angle.sin()]
    };
    upright(&(0..=n).map(at).collect::<Vec<_>>())
}

#[test]
fn a_curved_path_whole_and_in_pieces() {
    for n in [3, 12, 60, 200] {
        let path = arc(n);
        let mut whole = Body::unit(6);
        whole.sweep(&path, 1);
        check::everything(&whole.cut);
        assert_eq!(whole.cut.components().len(), 2, "{n} segments");
        let mut grown = Body::unit(6);
        for k in 1..path.len() {
            grown.sweep(&path[k - 1..=k], 1);
        }
        check::everything(&grown.cut);
        assert_eq!(grown.topology(), whole.topology(), "{n} segments");
        assert_eq!(grown.cut.surface().triangles.len(), whole.cut.surface().triangles.len());
    }
}

/// Two arms in one bent stroke, then a third from where they meet: Y. A fourth makes an X. The lip of a bent
/// stroke is straight inside an element, so the third arm begins a little behind the bend. Where it crosses
/// that lip more than once, chips fall out.
#[test]
fn arms_that_meet_in_a_line() {
    for middle in [[0.5, 0.5], [0.47, 0.56]] {
        let mut body = Body::unit(5);
        let arm = |k: usize, arms: usize| {
            let angle = TAU * k as f64 / arms as f64 + 0.3;
            [middle[0] + 1.5 * angle.cos(), middle[1] + 1.5 * angle.sin()]
        };
        body.sweep(&upright(&[arm(0, 3), middle, arm(1, 3)]), 1);
        check::everything(&body.cut);
        assert_eq!(body.cut.components().len(), 2);
        let begin = [0, 1].map(|k| middle[k] - 0.06 * (arm(2, 3)[k] - middle[k]));
        body.sweep(&upright(&[begin, arm(2, 3)]), 2);
        check::everything(&body.cut);
        let mut parts = body.cut.components().volume;
        parts.sort_by(|p, q| q.total_cmp(p));
        assert!(parts[2] > 0.1 && parts[3..].iter().sum::<f64>() < 1e-3, "Y at {middle:?}: {parts:?}");

        let mut body = Body::unit(5);
        body.sweep(&upright(&[arm(0, 4), middle, arm(2, 4)]), 1);
        body.sweep(&upright(&[arm(1, 4), middle, arm(3, 4)]), 2);
        check::everything(&body.cut);
        assert_eq!(body.cut.components().len(), 4, "X at {middle:?}");
    }
}

/// The blade appears and stops inside the material: a crack with a closed front.
#[test]
fn a_crack_inside_the_body_reaches_no_skin() {
    let mut body = Body::unit(7);
    let skin = body.cut.surface().triangles.len();
    let report =
        body.sweep(&[[v(0.2, 0.2, 0.49), v(0.2, 0.8, 0.51)], [v(0.8, 0.2, 0.5), v(0.8, 0.8, 0.52)]], 1);
    check::everything(&body.cut);
    assert!(report.elements_cut > 0 && !report.new_copies.is_empty());
    assert_eq!(body.cut.components().len(), 1);
    let tags = &body.cut.surface().tags;
    assert_eq!(tags.iter().filter(|t| **t == 0).count(), skin, "the skin is whole");
    let lips = tags.iter().filter(|t| **t == 1).count();
    assert!(lips > 0 && lips.is_multiple_of(2));
    // It grows to the skin on all sides.
    body.cut_plane(v(0.5, 0.5, 0.5), v(0.0, 0.0, 1.0), 2.0, 2);
    check::everything(&body.cut);
    assert!(body.cut.components().len() >= 2);
}

/// Back and forth, each stroke longer than the last, in one incision.
#[test]
fn sawing() {
    let mut body = Body::unit(5);
    let blade = |x: f64| [v(x, -0.1, 0.46), v(x, 1.1, 0.53)];
    for k in 0..40 {
        let x = -0.1 + 0.03 * f64::from(k) + if k % 2 == 0 { 0.1 } else { 0.0 };
        body.sweep(&[blade(x)], 1);
    }
    check::everything(&body.cut);
    assert_eq!(body.cut.components().len(), 2);
}

/// A stroke that crosses its own beginning gets a new id there, and the tongue falls out.
#[test]
fn a_loop_that_crosses_itself() {
    let mut body = Body::unit(6);
    let path = upright(&[[-0.2, 0.31], [0.83, 0.52], [0.52, 0.87], [0.46, -0.2]]);
    body.sweep(&path[..3], 1);
    body.sweep(&path[2..], 2);
    check::everything(&body.cut);
    assert!(body.cut.components().len() >= 2, "{:?}", body.cut.components().volume);
}

/// Cuts of every kind, one after the other, in a body whose edge is `unit` metres long.
fn all_kinds(unit: f64, pattern: BoxPattern) -> Body {
    let mut body = Body::new([unit; 3], [5; 3], pattern);
    let scaled = |path: Vec<[Vector3<f64>; 2]>| -> Vec<[Vector3<f64>; 2]> {
        path.into_iter().map(|s| s.map(|p| p * unit)).collect()
    };
    // A crack inside, a plane of faces, one through nodes and edges, an arc, a plug, a slit.
    body.sweep(
        &scaled(vec![[v(0.3, 0.3, 0.49), v(0.3, 0.7, 0.51)], [v(0.7, 0.3, 0.5), v(0.7, 0.7, 0.52)]]),
        1,
    );
    body.cut_plane(v(0.5, 0.5, 0.6) * unit, v(0.0, 0.0, 1.0), 2.0 * unit, 2);
    body.cut_plane(v(0.4, 0.4, 0.4) * unit, v(1.0, -1.0, 0.0), 2.0 * unit, 3);
    body.sweep(&scaled(arc(20)), 4);
    let plug =
        |k: usize| [0.3 + 0.17 * (TAU * k as f64 / 9.0).cos(), 0.7 + 0.17 * (TAU * k as f64 / 9.0).sin()];
    body.sweep(&scaled(upright(&(0..=9).map(|k| plug(k % 9)).collect::<Vec<_>>())), 5);
    body.sweep(
        &scaled(vec![[v(0.83, -0.2, 1.2), v(0.83, -0.2, 0.3)], [v(0.85, 0.7, 1.2), v(0.85, 0.7, 0.3)]]),
        6,
    );
    // And in a deformed state.
    for x in &mut body.x {
        *x = v(x.x + 0.2 * x.y, x.y - 0.1 * x.z, x.z + 0.15 * x.x * (x.y / unit));
    }
    body.cut_plane(v(0.6, 0.5, 0.3) * unit, v(0.7, 0.2, 0.4), 2.0 * unit, 7);
    body.sweep(
        &scaled(vec![[v(0.5, 0.5, -0.2), v(0.5, 0.5, 0.6)], [v(1.5, 0.6, -0.2), v(1.5, 0.6, 0.6)]]),
        8,
    );
    body
}

/// From micrometres to kilometres: only the shape counts, not its size.
#[test]
fn every_kind_of_cut_in_every_unit() {
    for pattern in [BoxPattern::Tet6, BoxPattern::Tet5 { parity: false }] {
        let metres = all_kinds(1.0, pattern);
        check::everything(&metres.cut);
        assert!(metres.cut.components().len() > 5);
        for unit in [1e-6, 1e-3, 0.1, 7.3, 1e3] {
            let other = all_kinds(unit, pattern);
            assert_eq!(other.topology(), metres.topology(), "{pattern:?}, {unit} m");
            assert!(other.cut.surface().triangles == metres.cut.surface().triangles, "{pattern:?}, {unit} m");
            assert!(other.cut.surface().tags == metres.cut.surface().tags, "{pattern:?}, {unit} m");
        }
    }
}

/// Random cuts too: sweeps that meet nothing exactly.
#[test]
fn random_cuts_in_every_unit() {
    for seed in 0..6 {
        let cut = |unit: f64| {
            let mut random = Rng::with_seed(500 + seed);
            let mut body = Body::new([unit; 3], [3; 3], BoxPattern::Tet6);
            for k in 0..15 {
                let mut at = || random.vector(0.9 * unit) + Vector3::repeat(0.5 * unit);
                let segments = [[at(), at()], [at(), at()], [at(), at()]];
                body.sweep(&segments, 1 + k / 2);
                body.x.iter_mut().for_each(|x| *x += random.vector(0.01 * unit));
            }
            body
        };
        let metres = cut(1.0);
        for unit in [1e-3, 1e3, 0.3] {
            let other = cut(unit);
            assert_eq!(other.topology(), metres.topology(), "seed {seed}, {unit} m");
            assert!(other.cut.surface().triangles == metres.cut.surface().triangles);
        }
    }
}
