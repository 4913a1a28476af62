//! By default cuts are smooth: their surface lies on the blade, whatever the mesh.

use super::super::shape::aspect;
use super::*;

/// Cells along each edge of the samples.
const CELLS: usize = 6;

/// Largest distance of the cut surface from the blade, in cells.
const SMOOTH: f64 = 0.1;

/// The unit cube, or a cylinder of diameter and height 1 along z, whose nodes are moved at random along the skin and
/// inside it, by up to a part `jitter` of a cell.
fn irregular(pattern: BoxPattern, is_round: bool, jitter: f64, random: &mut Rng) -> Sample {
    let mut sample = Sample::new([1.0; 3], [CELLS; 3], pattern);
    for (node, rest) in sample.nodes.iter_mut().zip(&mut sample.mesh.nodes) {
        let shift = random.vector(jitter / CELLS as f64);
        let mut x = rest.zip_map(&shift, |x, by| if x > 0.0 && x < 1.0 { x + by } else { x });
        if is_round {
            // The square to the disc, by ellipses.
            let (a, b) = (2.0 * x.x - 1.0, 2.0 * x.y - 1.0);
            let (u, w) = (a * (1.0 - 0.5 * b * b).sqrt(), b * (1.0 - 0.5 * a * a).sqrt());
            x = v(0.5 + 0.5 * u, 0.5 + 0.5 * w, x.z);
        }
        (*rest, node.rest, node.x) = (x, x, x);
    }
    sample.mesh.check().unwrap();
    sample.volume = sample.mesh.volumes().iter().sum();
    sample
}

/// Largest distance of a node of the lips from the nearest plane, a point and its unit normal, in cells.
fn off(sample: &Sample, planes: &[[Vector3<f64>; 2]]) -> f64 {
    let distance = |n: u32| {
        let x = sample.nodes[n as usize].rest;
        planes.iter().map(|[point, normal]| (x - point).dot(normal).abs()).fold(f64::INFINITY, f64::min)
    };
    sample.lip_nodes().into_iter().map(distance).fold(0.0, f64::max) * CELLS as f64
}

fn least_aspect(sample: &Sample) -> f64 {
    let aspect = |tet: &[u32; 4]| aspect(&tet.map(|n| sample.mesh.nodes[n as usize]));
    sample.mesh.tets.iter().map(aspect).fold(1.0, f64::min)
}

const PATTERNS: [BoxPattern; 3] =
    [BoxPattern::Tet6, BoxPattern::Tet5 { parity: false }, BoxPattern::Octahedral6];

#[test]
fn three_cuts_of_any_direction_are_smooth_in_any_mesh() {
    let mut random = Rng::with_seed(5);
    let mut sum = SnapReport::default();
    for pattern in PATTERNS {
        for (is_round, jitter) in [(false, 0.0), (false, 0.15), (true, 0.0), (true, 0.15)] {
            let mut sample = irregular(pattern, is_round, jitter, &mut random);
            let elements = sample.mesh.tets.len();
            let mut planes = Vec::new();
            for id in 1..=3 {
                let (point, normal) = (Vector3::repeat(0.5) + random.vector(0.15), random.vector(1.0));
                planes.push([point, normal.normalize()]);
                let report = sample.cut_plane(point, normal, 3.0, id);
                sample.check();
                let off = off(&sample, &planes);
                assert!(off < SMOOTH, "{pattern:?} {is_round} {jitter}, cut {id}: {off} cells, {report:?}");
                (sum.moved, sum.splits) = (sum.moved + report.moved, sum.splits + report.splits);
            }
            let (flattest, grown) = (least_aspect(&sample), sample.mesh.tets.len() as f64 / elements as f64);
            assert!(flattest > 0.002, "{pattern:?} {is_round} {jitter}: {flattest}");
            assert!(grown < 1.5 && sample.parts() > 3, "{pattern:?} {is_round} {jitter}: {grown}");
        }
    }
    assert!(sum.moved > 2 * sum.splits, "{sum:?}");
}

/// A blade that advances through a body that is stretched, turns and moves. In the end the cut is as smooth as one
/// stroke.
#[test]
fn a_blade_that_advances_cuts_smoothly() {
    let mut random = Rng::with_seed(6);
    let edge = |s: f64| [v(s, -0.3, 0.42 + 0.2 * s), v(s, 1.3, 0.52 + 0.2 * s)];
    let normal = (edge(1.0)[0] - edge(0.0)[0]).cross(&(edge(0.0)[1] - edge(0.0)[0])).normalize();
    for pattern in PATTERNS {
        for is_round in [false, true] {
            let mut sample = irregular(pattern, is_round, 0.15, &mut random);
            for k in 0..30 {
                let angle = 0.05 * f64::from(k);
                let F = nalgebra::Rotation3::new(v(0.3, angle, 0.2)).matrix() * (1.0 + 0.01 * f64::from(k));
                sample.deform(F, Matrix3::identity());
                let edges = [k, k + 1].map(|k| edge(-0.1 + 0.041 * f64::from(k)).map(|x| F * x));
                sample.sweep(&edges, 1);
                sample.check();
            }
            let off = off(&sample, &[[edge(0.0)[0], normal]]);
            assert!(sample.parts() == 2 && off < SMOOTH, "{pattern:?} {is_round}: {off} cells");
        }
    }
}

/// Neither a held node nor a corner moves; elements beside it are divided.
#[test]
fn held_nodes_and_corners_stay_where_they_are() {
    let mut sample = Sample::unit(CELLS);
    for node in &mut sample.nodes {
        node.fixed = (node.rest.x < 0.4).then_some((crate::element::Held::FULLY, Vector3::zeros()));
    }
    let is_corner = |x: &Vector3<f64>| x.iter().all(|c| *c == 0.0 || *c == 1.0);
    let kept = |sample: &Sample| -> Vec<Vector3<f64>> {
        let nodes = sample.nodes.iter().filter(|n| n.fixed.is_some() || is_corner(&n.rest));
        nodes.map(|n| n.rest).collect()
    };
    let before = kept(&sample);
    // The plane passes close to two corners.
    let (point, normal) = (v(0.0, 0.03, 0.03), v(0.2, 1.0, -1.02));
    let report = sample.cut_plane(point, normal, 3.0, 1);
    sample.check();
    let after = kept(&sample);
    assert!(before.iter().all(|x| after.contains(x)) && report.splits > 10, "{report:?}");
    let off = off(&sample, &[[point, normal.normalize()]]);
    assert!(sample.parts() == 2 && off < SMOOTH, "{off} cells, {report:?}");
}
