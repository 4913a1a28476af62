//! Planes, incisions in parts, bodies that moved.

use super::*;

/// Planes through the unit cube, some of them along mesh faces or through mesh nodes.
fn planes() -> Vec<(Vector3<f64>, Vector3<f64>)> {
    let middle = v(0.5, 0.5, 0.5);
    vec![
        (middle, v(1.0, 0.0, 0.0)),
        (middle, v(1.0, 1.0, 1.0)),
        (v(0.55, 0.5, 0.5), v(0.0, 0.0, 1.0)),
        (v(0.46, 0.46, 0.46), v(1.0, 0.2, -0.1)),
        (v(0.5, 0.52, 0.41), v(0.3, 1.0, 0.6)),
        (v(0.5, 0.52, 0.41), v(-0.5, 0.4, 0.9)),
        (v(0.625, 0.5, 0.5), v(1.0, 0.0, 0.0)),
    ]
}

#[test]
fn a_plane_parts_the_body_in_two_on_the_plane() {
    for pattern in [BoxPattern::Tet6, BoxPattern::Tet5 { parity: false }, BoxPattern::Octahedral6] {
        for (point, normal) in planes() {
            let mut sample = Sample::new([1.0; 3], [4; 3], pattern);
            let elements = sample.mesh.tets.len();
            let report = sample.cut_plane(point, normal, 3.0, 1);
            sample.check();
            assert_eq!(sample.parts(), 2, "{pattern:?} {point:?} {normal:?}: {report:?}");
            let n = normal.normalize();
            let off = |m: u32| (sample.nodes[m as usize].rest - point).dot(&n).abs();
            let farthest = sample.lip_nodes().into_iter().map(off).fold(0.0, f64::max);
            assert!(farthest < 1e-9, "{pattern:?} {normal:?}: {farthest:e}, {report:?}");
            assert!(10 * sample.mesh.tets.len() <= 12 * elements, "{report:?}");
            let volumes = sample.cut_mesh().components().volume;
            let below = volumes.iter().fold(1.0, |a: f64, b| a.min(*b));
            assert!(below > 0.3, "{volumes:?}");
        }
    }
}

/// A plane that halves every edge it crosses. Nodes on both sides are as far from it.
#[test]
fn a_plane_that_halves_every_edge_has_nearly_all_lip_nodes_on_it() {
    for pattern in [BoxPattern::Tet6, BoxPattern::Tet5 { parity: false }, BoxPattern::Octahedral6] {
        for normal in [v(1.0, 0.0, 0.0), v(0.0, -1.0, 0.0), v(0.0, 0.0, 1.0), v(0.0, 0.0, -1.0)] {
            let mut sample = Sample::new([1.0; 3], [5; 3], pattern);
            let report = sample.cut_plane(v(0.5, 0.5, 0.5), normal, 3.0, 1);
            sample.check();
            assert_eq!(sample.parts(), 2, "{pattern:?} {normal:?}: {report:?}");
            let lips = sample.lip_nodes();
            let off = |m: u32| (sample.nodes[m as usize].rest - v(0.5, 0.5, 0.5)).dot(&normal).abs();
            let on = lips.iter().filter(|&&m| off(m) < 1e-9).count();
            assert!(10 * on >= 9 * lips.len(), "{pattern:?} {normal:?}: {on} of {}, {report:?}", lips.len());
        }
    }
}

#[test]
fn an_incision_that_ends_inside_opens_and_goes_on() {
    let mut sample = Sample::unit(6);
    let edge = |s: f64| [v(s, -0.1, 0.47), v(s, 1.1, 0.53)];
    let first = sample.sweep(&[edge(-0.1), edge(0.52)], 1);
    sample.check();
    assert!(first.faces > 0 && first.duplicated > 0 && sample.parts() == 1, "{first:?}");
    let second = sample.sweep(&[edge(0.52), edge(1.1)], 1);
    sample.check();
    assert_eq!(sample.parts(), 2, "{second:?}");
}

#[test]
fn a_cut_in_forty_parts_parts_the_body_as_one() {
    let mut sample = Sample::unit(5);
    let edge = |s: f64| [v(s, -0.1, 0.47 + 0.1 * s), v(s, 1.1, 0.53 + 0.1 * s)];
    for k in 0..40 {
        sample.sweep(&[edge(-0.1 + 0.03 * f64::from(k)), edge(-0.1 + 0.03 * f64::from(k + 1))], 1);
        sample.check();
    }
    assert_eq!(sample.parts(), 2);
}

#[test]
fn a_round_cut_takes_a_plug_out() {
    let mut sample = Sample::unit(8);
    let edge = |k: usize| {
        let (s, c) = (std::f64::consts::TAU * k as f64 / 24.0).sin_cos();
        [v(0.5 + 0.3 * c, 0.5 + 0.3 * s, -0.1), v(0.5 + 0.3 * c, 0.5 + 0.3 * s, 1.1)]
    };
    let segments: Vec<_> = (0..=24).map(edge).collect();
    let report = sample.sweep(&segments, 1);
    sample.check();
    assert_eq!(sample.parts(), 2, "{report:?}");
}

#[test]
fn the_same_cut_in_metres_and_in_millimetres_gives_the_same_mesh() {
    for (point, normal) in planes() {
        let cut = |scale: f64| {
            let mut sample = Sample::new([scale; 3], [4; 3], BoxPattern::Tet6);
            sample.cut_plane(point * scale, normal, 3.0 * scale, 1);
            sample.cut_plane(point * scale, v(0.1, -0.9, 0.3), 3.0 * scale, 2);
            sample
        };
        let (metres, millimetres) = (cut(1.0), cut(1e3));
        assert_eq!(metres.mesh.tets, millimetres.mesh.tets, "{normal:?}");
        for (a, b) in metres.mesh.nodes.iter().zip(&millimetres.mesh.nodes) {
            assert!((a - b / 1e3).norm() < 1e-9);
        }
    }
}

#[test]
fn both_configurations_and_velocities_stay_consistent() {
    let mut sample = Sample::unit(5);
    let F = Matrix3::new(0.9, -0.5, 0.1, 0.4, 1.1, 0.2, 0.0, -0.1, 1.2);
    let L = Matrix3::new(0.0, -2.0, 0.3, 1.0, 0.5, 0.0, 0.7, 0.0, -1.0);
    sample.deform(F, L);
    let report = sample.cut_plane(F * v(0.5, 0.52, 0.43), F * v(0.2, 0.1, 1.0), 3.0, 1);
    assert!(report.moved > 20 && sample.parts() == 2, "{report:?}");
    sample.check();
    for node in &sample.nodes {
        assert!((node.x - F * node.rest).norm() < 1e-12 && (node.v - L * node.rest).norm() < 1e-12);
    }
    let n = (F * v(0.2, 0.1, 1.0)).normalize();
    let on = |m: &&u32| (sample.nodes[**m as usize].x - F * v(0.5, 0.52, 0.43)).dot(&n).abs() < 1e-9;
    let lips = sample.lip_nodes();
    assert!(5 * lips.iter().filter(on).count() >= 4 * lips.len());
}

#[test]
fn held_nodes_stay_and_loads_keep_their_sum() {
    let mut sample = Sample::unit(4);
    for node in &mut sample.nodes {
        node.point_force = v(1.0, 2.0, 3.0);
        node.fixed = (node.rest.z == 0.0).then_some((crate::element::Held::FULLY, Vector3::zeros()));
    }
    let before: Vector3<f64> = sample.nodes.iter().map(|n| n.point_force).sum();
    let held: Vec<_> = sample.nodes.iter().filter(|n| n.fixed.is_some()).map(|n| n.rest).collect();
    sample.cut_plane(v(0.46, 0.46, 0.46), v(1.0, 0.2, -0.1), 3.0, 1);
    let after: Vector3<f64> = sample.nodes.iter().map(|n| n.point_force).sum();
    assert!((after - before).norm() < 1e-9 * before.norm());
    let now: Vec<_> = sample.nodes.iter().filter(|n| n.fixed.is_some()).map(|n| n.rest).collect();
    assert!(now.len() > held.len() && held.iter().all(|x| now.contains(x)));
    // An edge between held nodes cannot lose either, so it is divided, and its new node is held.
    assert!(now.iter().all(|x| x.z == 0.0) && now.iter().any(|x| !held.contains(x)));
}
