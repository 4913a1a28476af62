//! Many random cuts of one body.

use super::*;

#[test]
fn a_hundred_random_cuts_leave_a_sound_body() {
    for (seed, pattern) in [(1, BoxPattern::Tet6), (2, BoxPattern::Tet5 { parity: false })] {
        let mut random = Rng::with_seed(seed);
        let mut sample = Sample::new([1.0; 3], [5; 3], pattern);
        let mut sum = SnapReport::default();
        for id in 1..=100 {
            let middle = v(0.5, 0.5, 0.5) + random.vector(0.5);
            let a = [middle + random.vector(0.7), middle + random.vector(0.7)];
            let shift = random.vector(0.7);
            let b = [a[0] + shift, a[1] + shift + random.vector(0.1)];
            let report = sample.sweep(&[a, b], 1 + id / 2);
            sum.faces += report.faces;
            sum.collapses += report.collapses;
            sum.degenerate = report.degenerate;
            sample.check();
        }
        assert!(sum.faces > 300, "{sum:?}");
    }
}

#[test]
fn the_same_cuts_give_the_same_mesh() {
    let cut = || {
        let mut random = Rng::with_seed(7);
        let mut sample = Sample::unit(4);
        for id in 1..=10 {
            sample.cut_plane(v(0.5, 0.5, 0.5) + random.vector(0.3), random.vector(1.0), 0.8, id);
        }
        sample.mesh
    };
    assert_eq!(cut(), cut());
}
