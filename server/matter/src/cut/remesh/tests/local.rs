//! A cut looks only near the sweep, and copies only what it changes.

use std::collections::BTreeMap;

use super::*;
use crate::cut::remesh::complex::{Before, Complex};
use crate::cut::remesh::memory::Memory;
use crate::cut::remesh::select::cross;
use crate::cut::{ElementsAround, sweep_bounds, sweep_triangles};

#[test]
fn a_small_cut_costs_as_much_in_a_mesh_of_sixteen_times_the_size() {
    let edge = |s: f64| [v(0.3 + s, 0.41, 0.72), v(0.3 + s, 0.43, 1.1)];
    // The first advance is too short to open anything.
    let cut = |length: usize| {
        let size = [length as f64, 1.0, 1.0];
        let mut sample = Sample::new(size, [10 * length, 10, 10], BoxPattern::Tet6);
        let advance = sample.sweep(&[edge(0.0), edge(0.01)], 1);
        let cut = sample.sweep(&[edge(0.01), edge(0.3)], 1);
        sample.check();
        (advance, cut, sample.mesh.tets.len())
    };
    let (small, large) = (cut(1), cut(16));
    assert!(large.2 > 15 * small.2);
    let result = |report: SnapReport| SnapReport { examined: 0, copied: 0, ..report };
    assert_eq!((result(small.0), result(small.1)), (result(large.0), result(large.1)));
    assert!(small.0.faces == 0 && small.0.copied == 0 && large.0.copied == 0, "{small:?}");
    assert!(small.1.faces > 5 && small.1.copied > 0, "{small:?}");
    // The same up to where runs and pages begin.
    for (small, large) in [(small.0.examined, large.0.examined), (small.1.examined, large.1.examined)] {
        assert!(
            large > 0 && large < 2 * small + 500,
            "{large} elements looked at, {small} in the small mesh"
        );
    }
    assert!(large.1.copied < 2 * small.1.copied, "{large:?} {small:?}");
}

#[test]
fn a_search_near_the_sweep_finds_what_a_search_of_the_whole_mesh_finds() {
    let mut random = Rng::with_seed(11);
    let mut sample = Sample::new([1.0; 3], [7; 3], BoxPattern::Octahedral6);
    sample.nodes.iter_mut().for_each(|node| node.x += random.vector(0.02));
    let [x, v] = sample.state();
    let mut mesh = sample.cut_mesh();
    let around = ElementsAround::new(x.len(), &sample.mesh.tets);
    let data = |n: u32, node: &mut SnapNode| *node = sample.nodes[n as usize];
    let nodes = Nodes { rest: &sample.mesh.nodes, x: &x, v: &v, data: &data };
    let complex = Complex::new(Before { tets: &sample.mesh.tets, around: &around, nodes }, BTreeMap::new());
    let mut fewer = 0;
    for _ in 0..60 {
        let middle = Vector3::repeat(0.5) + random.vector(0.5);
        let blade = [middle + random.vector(0.3), middle + random.vector(0.3)];
        let shift = random.vector(0.3);
        let blade = BladeSweep { segments: vec![blade, blade.map(|end| end + shift)] };
        let triangles = sweep_triangles(None, &blade, &x);
        let (near, examined) = mesh.pieces_near(&x, &sweep_bounds(&triangles, &blade));
        let all: Vec<u32> = (0..sample.mesh.tets.len() as u32).collect();
        let [mut here, mut everywhere] = [Memory::default(), Memory::default()];
        cross(&complex, near, &triangles, &mut here);
        cross(&complex, &all, &triangles, &mut everywhere);
        assert_eq!(here, everywhere);
        assert!(near.len() <= examined && examined <= all.len());
        fewer += usize::from(!here.crossings.is_empty() && near.len() < all.len() / 2);
    }
    assert!(fewer > 30, "{fewer} searches were worth it");
}
