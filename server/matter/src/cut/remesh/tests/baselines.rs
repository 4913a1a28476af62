//! The baselines: elements that are divided, elements that are removed.

use super::super::{MeshCut, SnapSettings};
use super::*;

fn divided(pattern: BoxPattern) -> Sample {
    Sample {
        snapper: Snapper::new(MeshCut::Subdivide, SnapSettings::default()),
        ..Sample::new([1.0; 3], [4; 3], pattern)
    }
}

fn removing() -> Sample {
    Sample { snapper: Snapper::new(MeshCut::Remove, SnapSettings::default()), ..Sample::unit(6) }
}

const PATTERNS: [BoxPattern; 3] =
    [BoxPattern::Tet6, BoxPattern::Tet5 { parity: false }, BoxPattern::Octahedral6];

#[test]
fn divided_elements_part_the_body_on_the_plane() {
    for pattern in PATTERNS {
        for (point, normal) in [
            (v(0.55, 0.5, 0.5), v(0.0, 0.0, 1.0)),
            (v(0.46, 0.46, 0.46), v(1.0, 0.2, -0.1)),
            (v(0.5, 0.52, 0.41), v(0.3, 1.0, 0.6)),
            (v(0.52, 0.52, 0.41), v(-0.5, 0.4, 0.9)),
            (v(0.625, 0.5, 0.5), v(1.0, 0.0, 0.0)),
        ] {
            let mut sample = divided(pattern);
            let elements = sample.mesh.tets.len();
            let report = sample.cut_plane(point, normal, 3.0, 1);
            sample.check();
            assert_eq!((sample.parts(), report.refused), (2, 0), "{pattern:?} {normal:?}: {report:?}");
            // The first plane is one of nodes and faces, which need no division.
            let is_divided = sample.mesh.tets.len() > elements;
            assert_eq!((is_divided, report.pending), (normal.z != 1.0, 0), "{report:?}");
            let n = normal.normalize();
            // A node counts as on the plane within a thousandth of an edge, 0.25 √3 at most.
            let off = |m: &u32| (sample.nodes[*m as usize].rest - point).dot(&n).abs();
            let farthest = sample.lip_nodes().iter().map(off).fold(0.0, f64::max);
            assert!(farthest < 5e-4, "{pattern:?} {normal:?}: {farthest:e}");
        }
    }
}

#[test]
fn a_division_in_forty_parts_parts_the_body_as_one() {
    for pattern in PATTERNS {
        let mut sample = divided(pattern);
        let edge = |s: f64| [v(s, -0.1, 0.47 + 0.1 * s), v(s, 1.1, 0.53 + 0.1 * s)];
        for k in 0..40 {
            sample.sweep(&[edge(-0.1 + 0.03 * f64::from(k)), edge(-0.1 + 0.03 * f64::from(k + 1))], 1);
            sample.check();
        }
        assert_eq!(sample.parts(), 2, "{pattern:?}");
    }
}

#[test]
fn an_incision_that_ends_inside_divides_its_front_without_parting_it() {
    let mut sample = divided(BoxPattern::Tet6);
    let edge = |s: f64| [v(s, -0.1, 0.59), v(s, 1.1, 0.65)];
    let first = sample.sweep(&[edge(-0.1), edge(0.6)], 1);
    sample.check();
    assert!(first.faces > 0 && first.duplicated > 0 && first.splits > 0, "{first:?}");
    assert_eq!(sample.parts(), 1);
    sample.sweep(&[edge(0.6), edge(1.1)], 1);
    sample.check();
    assert_eq!(sample.parts(), 2);
}

/// In a body that is stretched and moves: new nodes move with the material.
#[test]
fn twenty_divisions_of_a_moving_body_keep_volume_and_motion() {
    let mut random = Rng::with_seed(11);
    let mut sample = divided(BoxPattern::Tet6);
    let F = Matrix3::new(1.2, 0.1, 0.0, 0.0, 0.9, 0.2, -0.1, 0.0, 1.1);
    let L = Matrix3::new(0.0, 1.0, 0.0, -1.0, 0.0, 0.3, 0.0, 0.0, 0.2);
    sample.deform(F, L);
    for id in 1..=20 {
        let point = F * Vector3::from_fn(|_, _| 0.2 + 0.6 * random.f64());
        let normal = Vector3::from_fn(|_, _| random.f64() - 0.5);
        sample.cut_plane(point, normal, 0.1 + 0.4 * random.f64(), id);
        sample.check();
    }
    for node in &sample.nodes {
        assert!((node.x - F * node.rest).norm() < 1e-12 && (node.v - L * node.rest).norm() < 1e-12);
    }
    assert!(sample.mesh.tets.len() > 800);
}

#[test]
fn removed_elements_take_their_volume_along() {
    let mut sample = removing();
    let elements = sample.mesh.tets.len();
    let report = sample.cut_plane(v(0.46, 0.46, 0.46), v(1.0, 0.2, -0.1), 3.0, 1);
    let volume: f64 = sample.mesh.volumes().iter().sum();
    assert_eq!(sample.mesh.tets.len(), elements - report.elements);
    assert!(volume < 0.9 && volume > 0.5, "{volume}");
    sample.volume = volume;
    sample.check();
    assert_eq!(sample.parts(), 2);
    assert!(!sample.lip_nodes().is_empty());
    // The blade passes again through what is empty now.
    let again = sample.cut_plane(v(0.46, 0.46, 0.46), v(1.0, 0.2, -0.1), 3.0, 1);
    assert_eq!(again.elements, 0);
    sample.check();
}

#[test]
fn the_last_element_is_not_removed() {
    let mut sample = removing();
    for k in 0..40 {
        sample.cut_plane(v(0.0, 0.0, 0.025 * f64::from(k) + 0.01), v(0.0, 0.0, 1.0), 3.0, k as u32 + 1);
    }
    assert!(!sample.mesh.tets.is_empty());
    sample.mesh.check().unwrap();
}
