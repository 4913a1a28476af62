//! Incisions that go on ahead of the blade.

use super::growth::advance;
use super::*;

const REACH: f64 = 0.7;

fn ahead(cells: usize) -> Body {
    let mut body = Body::unit(cells);
    body.cut.set_front_reach(REACH);
    body
}

/// Area of one lip at rest [m²].
fn opened(body: &Body) -> f64 {
    let (surface, x) = (body.cut.surface(), body.cut.rest_positions());
    let area = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(|v| surface.vertices[v as usize].position(&x));
        0.5 * (b - a).cross(&(c - a)).norm()
    };
    let lips = surface.triangles.iter().zip(&surface.tags).filter(|(_, tag)| **tag == 1);
    0.5 * lips.map(|(triangle, _)| area(triangle)).sum::<f64>()
}

/// Wherever the blade stops, the incision ends ahead of it by no more than the reach, and on average by more than half
/// an element farther than if it stayed behind.
#[test]
fn an_incision_goes_ahead_by_its_reach_at_most() {
    let (cells, n) = (6, 40);
    let h = 1.0 / cells as f64;
    // Edges of these tetrahedra are up to √3 h long, and 1.3 h on average.
    let most = REACH * 1.32 * h;
    let mean = |reach: f64| {
        let areas = (0..n).map(|k| {
            let to = 0.3 + 2.0 * h * (f64::from(k) + 0.5) / f64::from(n);
            let mut body = Body::unit(cells);
            body.cut.set_front_reach(reach);
            advance(&mut body, to, 0.47, 1, 1);
            let (surface, x) = (body.cut.surface(), body.cut.rest_positions());
            let lips = surface.triangles.iter().zip(&surface.tags).filter(|(_, tag)| **tag == 1);
            let corners = lips.flat_map(|(triangle, _)| triangle);
            let end = corners.map(|&v| surface.vertices[v as usize].position(&x).x).fold(0.0, f64::max);
            assert!(end < to + if reach > 0.0 { most } else { 1e-6 }, "blade at {to}, front at {end}");
            (opened(&body) - to) / h
        });
        areas.sum::<f64>() / f64::from(n)
    };
    let (ahead, behind) = (mean(REACH), mean(0.0));
    assert!(ahead - behind > 0.5 && behind < -0.3, "{ahead} {behind}");
}

/// Many small advances go ahead of the blade, but not beyond one long advance.
#[test]
fn small_advances_open_no_more_than_a_long_one() {
    for to in [0.37, 0.55, 0.63, 0.71] {
        let (mut behind, mut whole, mut grown) = (Body::unit(6), ahead(6), ahead(6));
        advance(&mut behind, to, 0.51, 1, 1);
        advance(&mut whole, to, 0.51, 1, 1);
        advance(&mut grown, to, 0.51, 200, 1);
        check::everything(&whole.cut);
        check::everything(&grown.cut);
        let [behind, whole, grown] = [&behind, &whole, &grown].map(opened);
        assert!(behind + 1e-3 < grown && grown < whole + 1e-9, "to {to}: {behind} {grown} {whole}");
    }
}

/// A cut that stops and goes on is the cut that never stopped.
#[test]
fn a_cut_goes_on_through_elements_that_were_cut_ahead_of_the_blade() {
    let mut body = ahead(5);
    advance(&mut body, 0.55, 0.47, 1, 1);
    let blade = |x: f64| [v(x, -0.1, 0.47), v(x, 1.1, 0.47)];
    body.sweep(&[blade(0.55), blade(1.1)], 1);
    check::everything(&body.cut);
    let mut whole = ahead(5);
    advance(&mut whole, 1.1, 0.47, 1, 1);
    assert_eq!(body.topology(), whole.topology());
    assert_eq!((body.cut.components().len(), body.cut.pending_faces().len()), (2, 0));
}

/// A blade that trembles back and forth covers no more than once.
#[test]
fn going_back_and_forth_opens_no_more() {
    let h = 0.2;
    let blade = |x: f64| [v(x, -0.1, 0.47), v(x, 1.1, 0.47)];
    let mut body = ahead(5);
    body.sweep(&[blade(-0.1), blade(2.2 * h)], 1);
    let before = body.topology();
    for _ in 0..20 {
        body.sweep(&[blade(2.2 * h), blade(2.1 * h)], 1);
        body.sweep(&[blade(2.1 * h), blade(2.2 * h)], 1);
    }
    assert_eq!(body.topology(), before);
}
