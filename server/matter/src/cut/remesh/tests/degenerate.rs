//! Classification and removal of degenerate elements.

use std::collections::{BTreeMap, BTreeSet};

use super::*;
use crate::cut::ElementsAround;
use crate::cut::remesh::clean::clean;
use crate::cut::remesh::collapse::collapse;
use crate::cut::remesh::complex::{Before, Complex};
use crate::cut::remesh::shape::{FLAT, Kind, aspect, kind};

fn corners(height: f64, apex: [f64; 2]) -> [Vector3<f64>; 4] {
    [v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.0), v(0.0, 1.0, 0.0), v(apex[0], apex[1], height)]
}

#[test]
fn kinds_are_told_by_their_large_angles() {
    assert_eq!(kind(&corners(1e-3, [0.3, 0.3])), Kind::Cap(3));
    let sliver = corners(1e-3, [0.8, 0.8]);
    assert!(matches!(kind(&sliver), Kind::Sliver(..)), "{:?}", kind(&sliver));
    let spindle = corners(1e-3, [0.5, 1e-5]);
    assert_eq!(kind(&spindle), Kind::Spindle([2, 3]));
    let needle = [v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.0), v(0.5, 1.0, 0.0), v(0.5, 1.0, 1e-3)];
    assert_eq!(kind(&needle), Kind::Needle);
    for x in [corners(1e-3, [0.3, 0.3]), sliver, spindle, needle] {
        assert!((0.0..FLAT).contains(&aspect(&x)), "{}", aspect(&x));
    }
    assert!(aspect(&corners(1.0, [0.0, 0.0])) > 0.4);
}

/// What `edit` makes of the complex of a body.
fn edited<R>(sample: &Sample, edit: impl FnOnce(&mut Complex<'_>) -> R) -> R {
    let (tets, rest) = (&sample.mesh.tets[..], &sample.mesh.nodes[..]);
    let (around, [x, v]) = (ElementsAround::new(rest.len(), tets), sample.state());
    let data = |n: u32, node: &mut SnapNode| *node = sample.nodes[n as usize];
    let nodes = Nodes { rest, x: &x, v: &v, data: &data };
    edit(&mut Complex::new(Before { tets, around: &around, nodes }, BTreeMap::new()))
}

fn volume(complex: &Complex) -> f64 {
    let alive = (0..complex.n_slots() as u32).filter(|&t| complex.is_alive(t));
    alive.map(|t| det(&complex.rest(t)) / 6.0).sum()
}

/// A node inside the box, moved towards a place until elements are flat.
#[test]
fn flat_elements_go_and_the_volume_stays() {
    // Node 0,0,0 of the inner grid is 2,2,2 of a 4×4×4 box; its neighbours are a cell away.
    let inner = 2 + 5 * (2 + 5 * 2);
    let places = [v(0.2505, 0.5, 0.5), v(0.2505, 0.2505, 0.2505), v(0.5, 0.5, 0.2503), v(0.375, 0.3752, 0.5)];
    for place in places {
        let mut sample = Sample::unit(4);
        (sample.nodes[inner].rest, sample.nodes[inner].x, sample.mesh.nodes[inner]) = (place, place, place);
        edited(&sample, |complex| {
            let all: BTreeSet<u32> = (0..complex.n_slots() as u32).collect();
            let flat = |complex: &Complex| {
                let alive = (0..complex.n_slots() as u32).filter(|&t| complex.is_alive(t));
                alive.filter(|&t| aspect(&complex.rest(t)) < FLAT).count()
            };
            let before = (flat(complex), volume(complex));
            let cleaned = clean(complex, all);
            assert_eq!(flat(complex), cleaned.left);
            assert!(before.0 == 0 || cleaned.left < before.0, "{place:?}: {} flat, {cleaned:?}", before.0);
            assert!((volume(complex) / before.1 - 1.0).abs() < 1e-12);
        });
    }
}

#[test]
fn a_collapse_that_would_pinch_the_body_is_refused() {
    // An edge through the body between two nodes of its skin.
    let sample = Sample::unit(1);
    edited(&sample, |complex| {
        assert_eq!(collapse(complex, 0, 7, 0.0), None);
        assert!((volume(complex) - 1.0).abs() < 1e-14);
    });
}

#[test]
fn what_is_undone_leaves_no_trace() {
    let sample = Sample::unit(2);
    let elements = |complex: &Complex| -> Vec<[u32; 4]> {
        (0..complex.n_slots() as u32).map(|t| complex.tet(t)).collect()
    };
    edited(&sample, |complex| {
        let mark = complex.mark();
        let before = elements(complex);
        let m = crate::cut::remesh::collapse::split_edge(complex, 0, 13, 0.3);
        crate::cut::remesh::collapse::split_face(complex, 0, 1, [0.2, 0.3, 0.5]);
        assert!(complex.around(m).len() >= 6 && (volume(complex) - 1.0).abs() < 1e-12);
        complex.undo(mark);
        assert!(before == elements(complex) && complex.n_nodes() == sample.nodes.len());
        for (n, node) in (0u32..).zip(&sample.nodes) {
            assert_eq!(complex.node(n), *node);
            let uncut = edited(&sample, |uncut| uncut.around(n).to_vec());
            assert_eq!(complex.around(n), uncut);
        }
    });
}
