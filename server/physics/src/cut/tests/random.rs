//! Random cuts: whatever the blade does, the state stays whole.

use super::*;
use crate::cut::fragments::MAX_FRAGMENTS_PER_ELEMENT;

#[test]
fn twenty_random_planes_through_one_ring() {
    for seed in 0..4 {
        let mut random = Random(seed);
        let mut body = Body::unit(3);
        for k in 0..20 {
            body.cut_plane(v(0.5, 0.5, 0.5) + random.vector(0.1), random.vector(1.0), 3.0, k + 1);
            check::surface_is_closed_and_manifold(body.cut.surface());
            check::volumes(&body.cut);
        }
        check::everything(&body.cut);
        let most = body.cut.fragments.count.iter().max();
        assert!(most.is_some_and(|&m| m <= MAX_FRAGMENTS_PER_ELEMENT));
    }
}

/// Short random sweeps of random blades, some continued, while the copies move at random.
#[test]
fn random_sweeps_keep_everything_whole() {
    for seed in 0..60 {
        let mut random = Random(1000 + seed);
        let pattern =
            if seed % 2 == 0 { BoxPattern::Tet6 } else { BoxPattern::Tet5 { parity: seed % 4 == 1 } };
        let mut body = Body::new([1.0; 3], [2 + seed as usize % 3; 3], pattern);
        for k in 0..12 {
            let [mut tip, mut heel] =
                [random.vector(0.9), random.vector(0.9)].map(|r| r + Vector3::repeat(0.5));
            let mut segments = vec![[tip, heel]];
            for _ in 0..3 {
                tip += random.vector(0.4);
                heel += random.vector(0.4);
                segments.push([tip, heel]);
            }
            // Now and then exactly on lattice planes.
            if k % 4 == 3 {
                segments.iter_mut().flatten().for_each(|p| p.z = 0.5);
            }
            body.sweep(&segments, 1 + k / 2);
            for x in &mut body.x {
                *x += random.vector(0.02);
            }
            check::everything(&body.cut);
        }
    }
}
