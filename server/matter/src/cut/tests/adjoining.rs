//! Cuts that share a part of their borders act as one.

use super::*;

type Segment = [Vector3<f64>; 2];

/// The part of the plane z = 0.47 m + `slope` x between two corners, as a sweep.
fn patch([x, y]: [f64; 2], [to_x, to_y]: [f64; 2], slope: f64) -> Vec<Segment> {
    let at = |x: f64, y: f64| v(x, y, 0.47 + slope * x);
    vec![[at(x, y), at(x, to_y)], [at(to_x, y), at(to_x, to_y)]]
}

/// The patch from x = −0.1 m to 0.63 m in `n` parts, with the blade along y.
fn strips(n: usize, slope: f64) -> Vec<Vec<Segment>> {
    let at = |k: usize| -0.1 + 0.73 * k as f64 / n as f64;
    (0..n).map(|k| patch([at(k), -0.1], [at(k + 1), 1.1], slope)).collect()
}

/// A sweep in the other direction, with tip and heel exchanged.
fn turned(sweep: &[Segment]) -> Vec<Segment> {
    sweep.iter().rev().map(|[tip, heel]| [*heel, *tip]).collect()
}

/// The body after sweeps, each an incision of its own.
fn cut(sweeps: &[Vec<Segment>]) -> Body {
    let mut body = Body::unit(6);
    for (incision, sweep) in (1..).zip(sweeps) {
        body.sweep(sweep, incision);
    }
    check::everything(&body.cut);
    body
}

#[test]
fn parts_of_a_cut_open_what_the_whole_does() {
    for slope in [0.0, 0.13] {
        let whole = cut(&strips(1, slope)).topology();
        for n in [2, 4, 8, 20] {
            let parts = strips(n, slope);
            assert_eq!(cut(&parts).topology(), whole, "{n} parts, slope {slope}");
            let back: Vec<Vec<Segment>> = parts.iter().rev().cloned().collect();
            assert_eq!(cut(&back).topology(), whole, "{n} parts, the last first");
            let other: Vec<Vec<Segment>> = parts.iter().map(|sweep| turned(sweep)).collect();
            assert_eq!(cut(&other).topology(), whole, "{n} parts from the other side");
            let (odd, even): (Vec<_>, Vec<_>) = (0..n).partition(|k| k % 2 == 1);
            let gaps: Vec<Vec<Segment>> = odd.into_iter().chain(even).map(|k| parts[k].clone()).collect();
            assert_eq!(cut(&gaps).topology(), whole, "{n} parts, every other first");
        }
    }
}

/// Strips whose ends overlap, as by a blade that is set on again behind where it was taken off.
#[test]
fn parts_that_overlap_open_what_the_whole_does() {
    for slope in [0.0, 0.13] {
        let whole = cut(&strips(1, slope)).topology();
        for (n, overlap) in [(2, 0.01), (2, 0.15), (4, 0.02), (8, 0.05)] {
            let at = |k: usize| -0.1 + 0.73 * k as f64 / n as f64;
            let parts: Vec<Vec<Segment>> =
                (0..n).map(|k| patch([at(k) - overlap, -0.1], [at(k + 1), 1.1], slope)).collect();
            assert_eq!(cut(&parts).topology(), whole, "{n} parts, slope {slope}, overlap {overlap}");
            let back: Vec<Vec<Segment>> = parts.iter().rev().cloned().collect();
            assert_eq!(cut(&back).topology(), whole, "{n} parts, the last first, overlap {overlap}");
        }
    }
}

/// A cut at the place of an earlier one, in tissue that has moved far from there, is another cut.
#[test]
fn cuts_at_one_place_in_tissue_that_has_passed_are_two() {
    for (moved, joined) in [(0.0, vec![1]), (0.1, vec![1]), (0.5, vec![])] {
        let mut body = Body::unit(6);
        body.sweep(&patch([-0.1, -0.1], [0.4, 1.1], 0.0), 1);
        body.x.iter_mut().for_each(|x| x.z += moved);
        let report = body.sweep(&patch([0.3, -0.1], [0.8, 1.1], 0.0), 2);
        assert_eq!(report.joined, joined, "moved by {moved} m");
    }
}

/// Three through cuts, of which the third goes on across the first: they cut a triangular prism out, and two corners
/// beside the crossing stay on.
#[test]
fn a_cut_may_cross_an_earlier_part_of_itself() {
    let wall = |[x, y]: [f64; 2], [to_x, to_y]: [f64; 2]| {
        vec![[v(x, y, -0.1), v(x, y, 1.1)], [v(to_x, to_y, -0.1), v(to_x, to_y, 1.1)]]
    };
    let body = cut(&[
        wall([0.13, 0.31], [0.87, 0.33]),
        wall([0.87, 0.33], [0.58, 0.86]),
        wall([0.58, 0.86], [0.37, 0.07]),
    ]);
    assert_eq!(body.cut.components().len(), 2);
}

#[test]
fn patches_that_share_a_part_of_an_edge_open_what_the_whole_does() {
    let whole = cut(&strips(1, 0.1)).topology();
    // Bricks: no corner lies on another one.
    let bricks = [
        patch([-0.1, -0.1], [0.3, 0.43], 0.1),
        patch([-0.1, 0.43], [0.45, 1.1], 0.1),
        patch([0.3, -0.1], [0.63, 0.43], 0.1),
        patch([0.45, 0.43], [0.63, 1.1], 0.1),
    ];
    for first in 0..4 {
        let order: Vec<Vec<Segment>> = (0..4).map(|k| bricks[(first + k) % 4].clone()).collect();
        assert_eq!(cut(&order).topology(), whole, "brick {first} first");
    }
}
