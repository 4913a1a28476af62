//! Pairs of near triangles against a test of all pairs, at rest, in motion, and without allocation.

use scindo_allocations::allocations;
use scindo_collision::SurfaceBvh;

/// A surface folded along x, so that its far ends approach each other.
fn folded(positions: &[[f32; 3]], angle: f32) -> Vec<[f32; 3]> {
    let fold = |p: &[f32; 3]| {
        let (sin, cos) = (p[0] / 0.1 * angle).sin_cos();
        let radius = 0.1 / angle + p[1];
        [radius * sin, radius * cos, p[2]]
    };
    positions.iter().map(fold).collect()
}

/// Lower and upper corners of the boxes around each triangle in both states.
fn boxes(states: [&[[f32; 3]]; 2], triangles: &[[u32; 3]]) -> Vec<[[f64; 3]; 2]> {
    let bound = |t: &[u32; 3]| {
        let points = states.iter().flat_map(|x| t.map(|v| x[v as usize].map(f64::from)));
        points.fold([[f64::MAX; 3], [f64::MIN; 3]], |[low, high], p| {
            [[0, 1, 2].map(|i| low[i].min(p[i])), [0, 1, 2].map(|i| high[i].max(p[i]))]
        })
    };
    triangles.iter().map(bound).collect()
}

fn near(a: &[[f64; 3]; 2], b: &[[f64; 3]; 2], margin: f64) -> bool {
    (0..3).all(|i| a[0][i] - b[1][i] <= margin && b[0][i] - a[1][i] <= margin)
}

fn all_pairs(
    a: &[[[f64; 3]; 2]],
    b: &[[[f64; 3]; 2]],
    margin: f64,
    keep: impl Fn(usize, usize) -> bool,
) -> Vec<[u32; 2]> {
    let mut pairs = Vec::new();
    for (i, first) in a.iter().enumerate() {
        for (j, second) in b.iter().enumerate() {
            if keep(i, j) && near(first, second, margin) {
                pairs.push([i as u32, j as u32]);
            }
        }
    }
    pairs
}

#[test]
fn pairs_of_a_surface_with_itself_are_those_of_all_pairs() {
    let (positions, triangles) = crate::shapes::block([0.1, 0.01, 0.03], 8);
    let mut surface = SurfaceBvh::new(&positions, &triangles).unwrap();
    let apart = |i: usize, j: usize| i < j && !triangles[i].iter().any(|v| triangles[j].contains(v));
    let (mut before, mut pairs, mut active_pairs, mut found) = (positions.clone(), vec![], vec![], 0);
    for angle in [1.0, 2.0, 2.8, 3.0] {
        let now = folded(&positions, angle);
        surface.refit(&now).unwrap();
        let boxes = boxes([&before, &now], &triangles);
        for margin in [0.0, 0.004] {
            surface.self_pairs(margin, &mut pairs);
            assert_eq!(pairs, all_pairs(&boxes, &boxes, margin, apart), "angle {angle}, margin {margin}");
            found += pairs.len();
            let active: Vec<u32> = (0..triangles.len() as u32).step_by(7).rev().collect();
            surface.self_pairs_of(&active, margin, &mut active_pairs);
            pairs.retain(|pair| pair.iter().any(|t| t % 7 == 0));
            assert_eq!(active_pairs, pairs);
        }
        before = now;
    }
    assert!(found > 1000);
}

#[test]
fn pairs_of_two_surfaces_are_those_of_all_pairs() {
    let ball = crate::shapes::ball(0.05, 7);
    let block = crate::shapes::block([0.1, 0.02, 0.03], 5);
    let first = SurfaceBvh::new(&ball.0, &ball.1).unwrap();
    let mut second = SurfaceBvh::new(&block.0, &block.1).unwrap();
    let (mut before, mut pairs, mut turned) = (block.0.clone(), vec![], vec![]);
    for shift in [0.0, 0.05, 0.072, 0.2] {
        let now: Vec<_> = block.0.iter().map(|p| [p[0], p[1] + shift, p[2]]).collect();
        second.refit(&now).unwrap();
        let a = boxes([&ball.0, &ball.0], &ball.1);
        let b = boxes([&before, &now], &block.1);
        for margin in [0.0, 0.003] {
            first.pairs_with(&second, margin, &mut pairs);
            assert_eq!(pairs, all_pairs(&a, &b, margin, |_, _| true), "shift {shift}, margin {margin}");
            second.pairs_with(&first, margin, &mut turned);
            assert_eq!(pairs.len(), turned.len());
            assert!(turned.is_sorted());
            assert!(turned.iter().all(|[i, j]| pairs.binary_search(&[*j, *i]).is_ok()));
        }
        before = now;
    }
    let empty = SurfaceBvh::new(&[], &[]).unwrap();
    first.pairs_with(&empty, 1.0, &mut pairs);
    assert!(pairs.is_empty());
    empty.self_pairs(1.0, &mut pairs);
    assert!(pairs.is_empty());
}

#[test]
fn pairs_do_not_allocate_once_their_memory_suffices() {
    let (positions, triangles) = crate::shapes::block([0.1, 0.01, 0.03], 12);
    let mut surface = SurfaceBvh::new(&positions, &triangles).unwrap();
    let frames = [1.0, 2.9].map(|angle| folded(&positions, angle));
    let (mut own, mut mutual, mut counted) = (Vec::new(), Vec::new(), 0);
    for round in 0..3 {
        let before = allocations();
        for frame in &frames {
            surface.refit(frame).unwrap();
            surface.self_pairs(0.002, &mut own);
            surface.pairs_with(&surface, 0.0, &mut mutual);
            counted += own.len() + mutual.len();
        }
        assert!(round == 0 || allocations() == before);
    }
    assert!(counted > 0);
}
