//! A sweep taken in parts gives the same result as in one call.

use super::*;
use crate::cut::{CutError, CutLimits, Work};

/// Random blade positions through a unit box and beyond [m].
fn zigzag(random: &mut Rng, segments: usize) -> BladeSweep {
    let mut place = || random.vector(0.8) + Vector3::repeat(0.5);
    BladeSweep { segments: (0..segments).map(|_| [place(), place()]).collect() }
}

/// Fragments, pieces, volumes, nodes of copies, triangles and tags.
type Bits = (Vec<[u32; 4]>, Vec<[u32; 4]>, Vec<u64>, Vec<u32>, Vec<[u32; 3]>, Vec<u32>);

/// Everything that a later step or sweep reads, bit by bit.
fn bits(cut: &CutMesh) -> Bits {
    let volumes = cut.copy_volume().iter().map(|v| v.to_bits()).collect();
    let copies = cut.pieces().iter().map(|p| p.copies).collect();
    let surface = cut.surface();
    (
        cut.fragments.tets.clone(),
        copies,
        volumes,
        cut.copy_node().to_vec(),
        surface.triangles.clone(),
        surface.tags.clone(),
    )
}

fn sweep_in_parts(body: &mut Body, blade: &BladeSweep, incision: u32, fragments: u64) -> usize {
    let mut sweep = body.cut.begin_sweep(&body.x, blade, incision, CutLimits::NONE).unwrap();
    let mut parts = 1;
    while !body.cut.detect(&body.x, &mut sweep, &mut Work::new(fragments)) {
        parts += 1;
    }
    let report = body.cut.complete(&body.x, sweep, &mut Work::unlimited());
    for new in &report.new_copies {
        body.x.push(body.x[new.parent as usize]);
    }
    parts
}

#[test]
fn a_sweep_in_parts_has_the_bits_of_one_at_once() {
    let mut random = Rng::with_seed(5);
    for (cells, segments) in [(2, 40), (3, 20), (4, 10)] {
        let (mut whole, mut parted) = (Body::unit(cells), Body::unit(cells));
        for incision in 1..4 {
            let blade = zigzag(&mut random, segments);
            whole.sweep(&blade.segments, incision);
            let parts = sweep_in_parts(&mut parted, &blade, incision, 50);
            assert!(parts > 5, "{parts}");
            assert!(bits(&whole.cut) == bits(&parted.cut), "{cells} cells, incision {incision}");
            for (a, b) in whole.x.iter_mut().zip(&mut parted.x) {
                *a += random.vector(0.01);
                *b = *a;
            }
        }
        check::everything(&parted.cut);
    }
}

#[test]
fn a_body_takes_no_more_fragments_than_it_may_hold() {
    let limits = CutLimits { fragments: 300, pieces: usize::MAX, copies: usize::MAX };
    let mut body = Body::unit(2);
    let mut random = Rng::with_seed(9);
    let mut refused = 0;
    for incision in 1..20 {
        let blade = zigzag(&mut random, 10);
        match body.cut.begin_sweep(&body.x, &blade, incision, limits) {
            Ok(mut sweep) => {
                assert!(body.cut.detect(&body.x, &mut sweep, &mut Work::unlimited()));
                let report = body.cut.complete(&body.x, sweep, &mut Work::unlimited());
                report.new_copies.iter().for_each(|new| body.x.push(body.x[new.parent as usize]));
                refused += report.refused_edges;
            }
            Err(error) => {
                assert!(matches!(error, CutError::Full { what: "fragments", limit: 300, .. }), "{error}");
                refused += 1;
            }
        }
        assert!(body.cut.fragments.tets.len() <= 300);
        check::everything(&body.cut);
    }
    assert!(refused > 0);
}

#[test]
fn limits_name_what_is_full() {
    let limits = CutLimits::of_mesh(1000, 300);
    assert_eq!(limits.check(1000, 1000, 300), Ok(()));
    let full = limits.check(limits.fragments - 1, limits.pieces, 300);
    assert!(matches!(full, Err(CutError::Full { what: "pieces", .. })));
    assert!(full.unwrap_err().to_string().contains("reset it to cut again"));
}
