//! Complete plane cuts: generic, through nodes, edges and faces, crossing, repeated.

use super::*;

#[test]
fn a_generic_plane_makes_two_parts_of_the_right_volume() {
    for pattern in [BoxPattern::Tet6, BoxPattern::Tet5 { parity: false }] {
        let mut body = Body::new([1.0, 1.0, 2.0], [3, 3, 5], pattern);
        let report = body.cut_plane(v(0.5, 0.5, 0.77), v(0.0, 0.0, 1.0), 2.0, 1);
        check::everything(&body.cut);
        let mut volume = body.cut.components().volume;
        volume.sort_by(f64::total_cmp);
        assert_eq!(volume.len(), 2);
        assert!((volume[0] - 0.77).abs() < 1e-12 && (volume[1] - 1.23).abs() < 1e-12, "{volume:?}");
        assert_eq!((report.pending_edges, report.refused_edges, report.epoch), (0, 0, 1));
        assert!(body.cut.surface().tags.contains(&1) && body.cut.surface().tags.contains(&0));
    }
}

#[test]
fn an_oblique_plane_leaves_no_bridge() {
    let mut body = Body::unit(4);
    body.cut_plane(v(0.48, 0.51, 0.53), v(0.3, -0.7, 0.9), 3.0, 1);
    check::everything(&body.cut);
    assert_eq!(body.cut.components().len(), 2);
}

/// The plane holds a whole layer of nodes, edges and faces: no element is split, no sliver made.
#[test]
fn a_plane_along_a_face_layer_separates_without_splitting_an_element() {
    for pattern in [BoxPattern::Tet6, BoxPattern::Tet5 { parity: true }] {
        for shift in [0.0, 1e-9, -1e-9] {
            let mut body = Body::new([1.0; 3], [4; 3], pattern);
            let n = body.cut.pieces().len();
            let nodes = body.cut.n_copies();
            body.cut_plane(v(0.5, 0.5, 0.5 + shift), v(0.0, 0.0, 1.0), 2.0, 1);
            check::everything(&body.cut);
            assert_eq!(body.topology(), [2, n, nodes + 25], "shift {shift}");
            assert!(body.cut.components().volume.iter().all(|c| (c - 0.5).abs() < 1e-12));
        }
    }
}

/// A diagonal plane passes through nodes, along edges, along faces of the Kuhn split and through cells.
#[test]
fn planes_through_nodes_and_edges() {
    for normal in
        [v(1.0, -1.0, 0.0), v(1.0, 1.0, -1.0), v(1.0, 1.0, 0.0), v(2.0, -1.0, -1.0), v(1.0, 2.0, 3.0)]
    {
        for pattern in [BoxPattern::Tet6, BoxPattern::Tet5 { parity: false }] {
            let mut body = Body::new([1.0; 3], [4; 3], pattern);
            body.cut_plane(v(0.5, 0.5, 0.5), normal, 3.0, 1);
            check::everything(&body.cut);
            let parts = body.cut.components().volume;
            assert_eq!(parts.len(), 2, "{normal:?} {pattern:?}");
            assert!((parts[0] - 0.5).abs() < 1e-9, "{normal:?}: {parts:?}");
        }
    }
}

/// The plane halves all edges across it. The numbering of the mesh has no influence.
#[test]
fn all_edges_halved_in_any_numbering() {
    let mesh = box_mesh(Vector3::zeros(), Vector3::repeat(1.0), [3; 3], BoxPattern::Tet6);
    let mut backwards = mesh.clone();
    backwards.nodes.reverse();
    backwards.tets.reverse();
    let last = mesh.nodes.len() as u32 - 1;
    backwards.tets.iter_mut().flatten().for_each(|n| *n = last - *n);
    let topology = [mesh, backwards].map(|mesh| {
        let cut = CutMesh::new(mesh).unwrap();
        let mut body = Body { x: cut.rest_positions(), cut };
        body.cut_plane(v(0.5, 0.5, 0.5), v(0.0, 1.0, 0.0), 2.0, 1);
        check::everything(&body.cut);
        assert!(body.cut.components().volume.iter().all(|part| (part - 0.5).abs() < 1e-13));
        body.cut_plane(v(0.5, 0.5, 0.5), v(1.0, 1.0, 0.0), 2.0, 2);
        body.cut_plane(v(0.5, 0.5, 1.0 / 3.0), v(0.0, 0.0, 1.0), 2.0, 3);
        check::everything(&body.cut);
        body.topology()
    });
    assert_eq!(topology[0], topology[1]);
}

#[test]
fn crossing_cuts_make_four_parts_and_three_make_eight() {
    for offset in [0.0, 0.013] {
        let mut body = Body::unit(4);
        for (k, normal) in [Vector3::x(), Vector3::y(), Vector3::z()].into_iter().enumerate() {
            body.cut_plane(v(0.5, 0.5, 0.5) + Vector3::repeat(offset), normal, 2.0, k as u32 + 1);
            check::everything(&body.cut);
            assert_eq!(body.cut.components().len(), 2 << k, "offset {offset}");
        }
    }
}

/// The second cut ends on the first: T; then a cut inside one of the parts.
#[test]
fn branching_cuts() {
    let mut body = Body::unit(5);
    body.cut_plane(v(0.43, 0.5, 0.5), v(1.0, 0.0, 0.0), 2.0, 1);
    body.sweep(&[[v(0.43, -1.0, 0.52), v(0.43, 2.0, 0.52)], [v(2.0, -1.0, 0.52), v(2.0, 2.0, 0.52)]], 2);
    check::everything(&body.cut);
    assert_eq!(body.cut.components().len(), 3);
    body.sweep(&[[v(-1.0, -1.0, 0.3), v(-1.0, 2.0, 0.3)], [v(0.43, -1.0, 0.3), v(0.43, 2.0, 0.3)]], 3);
    check::everything(&body.cut);
    assert_eq!(body.cut.components().len(), 4);
}

#[test]
fn the_same_cut_fifty_times_adds_nothing_after_the_first() {
    let mut body = Body::unit(3);
    body.cut_plane(v(0.5, 0.5, 0.45), v(0.1, 0.2, 1.0), 2.0, 1);
    let (topology, fragments) = (body.topology(), body.cut.fragments.tets.len());
    for k in 0..50 {
        let report = body.cut_plane(v(0.5, 0.5, 0.45), v(0.1, 0.2, 1.0), 2.0, 1 + k % 7);
        assert!(report.new_copies.is_empty());
        assert_eq!((body.topology(), body.cut.fragments.tets.len()), (topology, fragments), "cut {k}");
    }
    check::everything(&body.cut);
}

#[test]
fn millimetres_and_metres_give_the_same_topology() {
    let cuts = [
        (v(0.5, 0.5, 0.5), v(0.0, 0.0, 1.0)),
        (v(0.5, 0.5, 0.5), v(1.0, 1.0, 0.0)),
        (v(0.4, 0.5, 0.6), v(1.0, 0.3, 0.2)),
    ];
    let topology = [1.0, 1e-3, 1e3, 0.1].map(|unit| {
        let mut body = Body::new([unit; 3], [4; 3], BoxPattern::Tet6);
        for (k, (point, normal)) in cuts.iter().enumerate() {
            body.cut_plane(point * unit, *normal, 2.0 * unit, k as u32 + 1);
        }
        check::everything(&body.cut);
        (body.topology(), body.cut.surface().triangles.clone())
    });
    assert!(topology.iter().all(|t| *t == topology[0]));
}

/// A blade whose ends lie exactly in the skin cuts through.
#[test]
fn a_blade_that_ends_exactly_on_the_skin_cuts_the_skin() {
    let mut body = Body::new([0.03, 0.06, 0.2], [4, 8, 24], BoxPattern::Tet5 { parity: false });
    body.sweep(&[[v(0.0, 0.0, 0.103), v(0.0, 0.06, 0.103)], [v(0.03, 0.0, 0.103), v(0.03, 0.06, 0.103)]], 1);
    check::everything(&body.cut);
    assert_eq!(body.cut.components().len(), 2);
}

#[test]
fn a_stretched_rotated_and_inverted_body_is_cut_where_it_is() {
    for scale in [v(1.0, 2.5, 0.4), v(-1.0, 1.0, 1.0)] {
        let mut body = Body::unit(4);
        let turn = nalgebra::Rotation3::from_euler_angles(0.4, 1.1, -0.7);
        for x in &mut body.x {
            *x = turn * x.component_mul(&scale) + v(5.0, -3.0, 2.0);
        }
        let middle = turn * (v(0.5, 0.5, 0.37).component_mul(&scale)) + v(5.0, -3.0, 2.0);
        body.cut_plane(middle, turn * v(0.0, 0.0, 1.0), 5.0, 1);
        check::everything(&body.cut);
        let mut parts = body.cut.components().volume;
        parts.sort_by(f64::total_cmp);
        assert!(parts.len() == 2 && (parts[0] - 0.37).abs() < 1e-9, "{parts:?}");
    }
}
