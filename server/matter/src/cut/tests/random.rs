//! Random cuts: whatever the blade does, the state stays whole.

use super::*;
use crate::cut::topology::fragments::MAX_FRAGMENTS_PER_ELEMENT;

#[test]
fn twenty_random_planes_through_one_ring() {
    for seed in 0..4 {
        let mut random = Rng::with_seed(seed);
        let mut body = Body::unit(3);
        for k in 0..20 {
            body.cut_plane(v(0.5, 0.5, 0.5) + random.vector(0.1), random.vector(1.0), 3.0, k + 1);
            surface_is_closed_and_manifold(body.cut.surface());
            check::volumes(&body.cut);
        }
        check::everything(&body.cut);
        let most = body.cut.fragments.count.iter().max();
        assert!(most.is_some_and(|&m| m <= MAX_FRAGMENTS_PER_ELEMENT));
    }
}

/// Random sweeps of random blades through one body, some continued, some exactly on lattice planes,
/// while the copies move at random; all checks after every `check_every` sweeps.
fn cut_at_random(seed: u64, sweeps: u32, check_every: u32, reach: f64) {
    let mut random = Rng::with_seed(1000 + seed);
    let pattern =
        if seed.is_multiple_of(2) { BoxPattern::Tet6 } else { BoxPattern::Tet5 { parity: seed % 4 == 1 } };
    let cells = 2 + seed as usize % 3;
    let mut body = Body::new([1.0; 3], [cells; 3], pattern);
    body.cut.set_front_reach(reach);
    let mut refused = 0;
    for k in 0..sweeps {
        let [mut tip, mut heel] = [random.vector(0.9), random.vector(0.9)].map(|r| r + Vector3::repeat(0.5));
        let mut segments = vec![[tip, heel]];
        for _ in 0..3 {
            tip += random.vector(0.4);
            heel += random.vector(0.4);
            segments.push([tip, heel]);
        }
        if k % 4 == 3 {
            let axis = (k / 4 + seed as u32) as usize % 3;
            let plane = 1.0 / cells as f64;
            segments.iter_mut().flatten().for_each(|p| p[axis] = plane);
        }
        refused += body.sweep(&segments, 1 + k / 2).refused_edges;
        for x in &mut body.x {
            *x += random.vector(0.01);
        }
        if k % check_every == check_every - 1 {
            check::everything(&body.cut);
        }
    }
    check::everything(&body.cut);
    assert!(refused == 0 || body.cut.fragments.count.iter().any(|&c| c > 200));
}

#[test]
fn random_sweeps_keep_everything_whole() {
    for seed in 0..60 {
        cut_at_random(seed, 12, 1, 0.0);
        cut_at_random(seed, 12, 1, 0.7);
    }
}

/// Fifty sweeps through each body. After a change of the algorithm run all 200 bodies, which takes minutes:
/// `SCINDO_LONG_TESTS=1 cargo test -p scindo-physics fifty_random`.
#[test]
fn fifty_random_sweeps_through_each_body() {
    let bodies = if std::env::var_os("SCINDO_LONG_TESTS").is_some() { 200 } else { 4 };
    for seed in 0..bodies {
        cut_at_random(10_000 + seed, 50, 10, 0.0);
    }
}

/// Whatever state the copies are in, a sweep neither panics nor breaks the topology.
#[test]
fn collapsed_flat_and_huge_states() {
    let ruin: [fn(Vector3<f64>) -> Vector3<f64>; 5] =
        [|_| Vector3::repeat(0.5), |x| v(x.x, x.y, 0.5), |x| v(x.x, 0.5, 0.5), |x| x * 1e200, |x| x * 1e-200];
    for (k, ruin) in ruin.into_iter().enumerate() {
        let mut body = Body::unit(3);
        body.cut_plane(v(0.5, 0.5, 0.4), v(0.0, 0.2, 1.0), 0.5, 1);
        body.x.iter_mut().for_each(|x| *x = ruin(*x));
        for incision in 1..4 {
            body.cut_plane(v(0.5, 0.5, 0.5), v(0.3, 0.2, 1.0), 1.0, incision);
            body.cut_plane(v(0.5, 0.5, 0.5), v(0.0, 0.0, 1.0), 1e199, incision);
        }
        surface_is_closed_and_manifold(body.cut.surface());
        check::volumes(&body.cut);
        check::copies_are_components(&body.cut);
        assert!(body.cut.epoch() > 0, "state {k}");
    }
}

#[test]
fn an_element_at_its_cap_refuses_and_says_so() {
    let mut random = Rng::with_seed(3);
    let mut body = Body::unit(1);
    let mut refused = 0;
    for k in 0..60 {
        refused += body
            .cut_plane(v(0.5, 0.5, 0.5) + random.vector(0.3), random.vector(1.0), 3.0, k + 1)
            .refused_edges;
    }
    assert!(refused > 0);
    assert!(body.cut.fragments.count.iter().all(|&c| c <= MAX_FRAGMENTS_PER_ELEMENT));
    check::everything(&body.cut);
}
