//! Branches that begin exactly on another incision: in its middle or at its end.

use super::kinds::upright;
use super::*;

/// Boxes of several meshes: numbers of cells, and the pattern that divides them.
fn bodies() -> Vec<([usize; 3], BoxPattern)> {
    vec![
        ([5; 3], BoxPattern::Tet6),
        ([4, 7, 3], BoxPattern::Tet6),
        ([5; 3], BoxPattern::Tet5 { parity: false }),
        ([6, 3, 4], BoxPattern::Tet5 { parity: true }),
    ]
}

/// The third cut begins or ends on a straight arm of a bent one.
#[test]
fn a_branch_from_the_middle_of_an_arm_takes_the_body_apart() {
    for (cells, pattern) in bodies() {
        let path = [[-0.2, 0.31], [0.52, 0.43], [0.61, 1.2]];
        let on_arm = |s: f64| [0, 1].map(|k| path[0][k] + (path[1][k] - path[0][k]) * s);
        for branch in [[on_arm(0.7), [0.45, -0.3]], [[0.3, 1.3], on_arm(0.8)]] {
            let mut body = Body::new([1.0; 3], cells, pattern);
            body.sweep(&upright(&path), 1);
            body.sweep(&upright(&branch), 2);
            check::everything(&body.cut);
            let parts = body.cut.components().volume;
            assert_eq!(parts.len(), 3, "{cells:?} {pattern:?} {branch:?}: {parts:?}");
        }
    }
}

/// A stroke stops inside the body, in an element it has not left, and continues in another direction: a bend
/// of the same incision.
#[test]
fn going_on_from_where_a_stroke_has_ended() {
    for (cells, pattern) in bodies() {
        let path = upright(&[[-0.2, 0.31], [0.52, 0.43], [0.61, 1.2]]);
        let mut body = Body::new([1.0; 3], cells, pattern);
        body.sweep(&path[..2], 1);
        assert_eq!(body.cut.components().len(), 1);
        body.sweep(&path[1..], 1);
        check::everything(&body.cut);
        assert_eq!(body.cut.components().len(), 2, "{cells:?} {pattern:?}");
    }
}
