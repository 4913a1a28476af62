//! Cuts in parts, one incision each.

use super::super::{MeshCut, SnapSettings};
use super::*;

const PATTERNS: [BoxPattern; 3] =
    [BoxPattern::Tet6, BoxPattern::Tet5 { parity: false }, BoxPattern::Octahedral6];

/// `n` strips of a square of half width 2 in the plane through `point` with the unit `normal`.
fn strips(point: Vector3<f64>, normal: Vector3<f64>, turn: f64, n: usize) -> Vec<[[Vector3<f64>; 2]; 2]> {
    let helper = if normal.x.abs() < 0.6 { Vector3::x() } else { Vector3::y() };
    let across = normal.cross(&helper).normalize();
    let (u, w) = (across, normal.cross(&across));
    let (along, beside) = (u * turn.cos() + w * turn.sin(), w * turn.cos() - u * turn.sin());
    let segment = |k: usize| {
        let at = point + along * (2.0 * k as f64 / n as f64 - 1.0);
        [at - beside * 2.0, at + beside * 2.0]
    };
    (0..n).map(|k| [segment(k), segment(k + 1)]).collect()
}

/// Strips that part the body together leave it in two, in whatever order they are swept.
#[test]
fn strips_of_a_plane_part_the_body_in_two() {
    let mut random = Rng::with_seed(3);
    for how in [MeshCut::Snap, MeshCut::Subdivide, MeshCut::Remove] {
        for pattern in PATTERNS {
            for n in [2, 3, 4, 7, 12] {
                let (point, normal) =
                    (Vector3::repeat(0.5) + random.vector(0.1), random.vector(1.0).normalize());
                let mut strips = strips(point, normal, random.f64() * 3.0, n);
                let mut sample = Sample::new([1.0; 3], [5; 3], pattern);
                sample.snapper = Snapper::new(how, SnapSettings::default());
                if random.bool() {
                    strips.reverse();
                }
                if random.bool() {
                    random.shuffle(&mut strips);
                }
                (1..).zip(&strips).for_each(|(id, strip)| _ = sample.sweep(strip, id));
                if how != MeshCut::Remove {
                    sample.check();
                }
                let volumes = sample.cut_mesh().components().volume;
                let large = volumes.iter().filter(|volume| **volume > 0.1).count();
                assert_eq!(large, 2, "{how:?} {pattern:?}, {n} strips {point:?} {normal:?}: {volumes:?}");
            }
        }
    }
}
