//! Input that a sweep refuses without changing anything, and the reset of all cuts.

use super::*;
use crate::cut::CutError;

#[test]
fn bad_input_is_refused_with_the_place() {
    let mut body = Body::unit(2);
    let before = (body.topology(), body.cut.epoch());
    let blade = BladeSweep {
        segments: vec![[v(-1.0, -1.0, 0.4), v(-1.0, 2.0, 0.4)], [v(2.0, -1.0, 0.4), v(2.0, 2.0, 0.4)]],
    };
    let mut sweep =
        |x: &[Vector3<f64>], blade: &BladeSweep, incision| body.cut.sweep(x, blade, incision).unwrap_err();
    let x = body.x.clone();
    assert_eq!(sweep(&x, &BladeSweep::default(), 1), CutError::NoSegment);
    assert_eq!(sweep(&x, &blade, 0), CutError::ReservedIncision);
    assert_eq!(sweep(&x[1..], &blade, 1), CutError::PositionCount { found: 26, expected: 27 });
    let mut bad = blade.clone();
    bad.segments[1][0].y = f64::NAN;
    assert_eq!(sweep(&x, &bad, 1), CutError::NonFiniteBlade { segment: 1 });
    let mut x = x;
    x[5].z = f64::INFINITY;
    assert_eq!(sweep(&x, &blade, 1), CutError::NonFinitePosition { copy: 5 });
    let long = BladeSweep { segments: vec![blade.segments[0]; 1025] };
    assert_eq!(sweep(&x, &long, 1), CutError::TooManySegments { found: 1025, limit: 1024 });
    assert_eq!((body.topology(), body.cut.epoch()), before);
}

#[test]
fn reset_undoes_every_cut_and_the_epoch_keeps_rising() {
    let mut body = Body::unit(2);
    let uncut = body.topology();
    body.cut_plane(v(0.5, 0.5, 0.4), v(0.0, 0.0, 1.0), 2.0, 1);
    let epoch = body.cut.epoch();
    body.cut.reset().unwrap();
    assert_eq!(body.topology(), uncut);
    assert!(body.cut.epoch() > epoch);
    check::everything(&body.cut);
    body.x = body.cut.rest_positions();
    body.cut_plane(v(0.5, 0.5, 0.4), v(0.0, 0.0, 1.0), 2.0, 1);
    assert_eq!(body.cut.components().len(), 2);
}
