//! Closest points and sides against brute force and against formulas.

use nalgebra::Vector3;
use proptest::prelude::*;
use scindo_collision::closest_segment_triangle;
use scindo_collision::{Capsule, SurfaceBvh, barycentric_point, closest_point_on_triangle};

type V = Vector3<f64>;

fn point(extent: f64) -> impl Strategy<Value = V> {
    [-extent..extent, -extent..extent, -extent..extent].prop_map(|[x, y, z]| V::new(x, y, z))
}

fn brute_force(surface: &SurfaceBvh, p: V) -> f64 {
    (0..surface.triangle_count() as u32)
        .map(|t| {
            let corners = surface.triangle(t);
            (barycentric_point(&corners, closest_point_on_triangle(p, &corners)) - p).norm()
        })
        .fold(f64::INFINITY, f64::min)
}

proptest! {
    #[test]
    fn closest_point_equals_brute_force(p in point(0.2)) {
        let (positions, triangles) = crate::shapes::ball(0.1, 8);
        let surface = SurfaceBvh::new(&positions, &triangles).unwrap();
        let found = surface.closest_point(p, 1.0).unwrap();
        prop_assert!((found.signed_distance.abs() - brute_force(&surface, p)).abs() < 1e-7);
        let on_triangle = barycentric_point(&surface.triangle(found.triangle), found.barycentric);
        prop_assert!((on_triangle - found.point).norm() < 1e-12);
        prop_assert!((found.normal.norm() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn sides_of_a_block_are_exact(p in point(0.2)) {
        let half = [0.1f32, 0.05, 0.08];
        let (positions, triangles) = crate::shapes::block(half, 5);
        let surface = SurfaceBvh::new(&positions, &triangles).unwrap();
        let h = V::new(f64::from(half[0]), f64::from(half[1]), f64::from(half[2]));
        let beyond = p.abs() - h;
        let outside = beyond.sup(&V::zeros()).norm();
        let signed = if outside > 0.0 { outside } else { beyond.max() };
        let found = surface.closest_point(p, 1.0).unwrap();
        prop_assert!((found.signed_distance - signed).abs() < 1e-7, "{found:?} {signed}");
        prop_assert_eq!(surface.contains(p), signed < 0.0);
    }

    #[test]
    fn triangles_near_a_capsule_equal_brute_force(a in point(0.15), b in point(0.15)) {
        let (positions, triangles) = crate::shapes::ball(0.1, 6);
        let surface = SurfaceBvh::new(&positions, &triangles).unwrap();
        let capsule = Capsule { core: [a, b], radius: 0.01 };
        let mut found = Vec::new();
        surface.triangles_near(&capsule, 0.005, |near| found.push(near.triangle));
        found.sort_unstable();
        let expected: Vec<u32> = (0..surface.triangle_count() as u32)
            .filter(|&t| {
                closest_segment_triangle([a, b], &surface.triangle(t)).distance_squared
                    <= 0.015 * 0.015
            })
            .collect();
        prop_assert_eq!(&found, &expected);
        let nearest = surface.closest_triangle(&capsule, 0.005);
        prop_assert_eq!(nearest.is_some(), !expected.is_empty());
    }
}

#[test]
fn rays_through_vertices_and_edges_count_once() {
    let (positions, triangles) = crate::shapes::block([0.1; 3], 4);
    let surface = SurfaceBvh::new(&positions, &triangles).unwrap();
    // The lattice of the faces is 0.05 m: these rays run through vertices, edges and diagonals.
    for y in [-0.05, 0.0, 0.025, 0.05] {
        for z in [-0.05, 0.0, 0.025, 0.05] {
            assert!(surface.contains(V::new(0.0, y, z)), "{y} {z}");
            assert!(!surface.contains(V::new(-0.3, y, z)), "{y} {z}");
            assert!(!surface.contains(V::new(0.3, y, z)), "{y} {z}");
        }
    }
}

#[test]
fn the_lips_of_a_closed_cut_do_not_mislead_the_side() {
    // Two blocks that share the plane x = 0, as a body does right after a cut.
    let (a, triangles_a) = crate::shapes::block([0.05; 3], 3);
    let n = a.len() as u32;
    let mut positions: Vec<_> = a.iter().map(|p| [p[0] - 0.05, p[1], p[2]]).collect();
    positions.extend(a.iter().map(|p| [p[0] + 0.05, p[1], p[2]]));
    let mut triangles = triangles_a.clone();
    triangles.extend(triangles_a.iter().map(|t| t.map(|v| v + n)));
    let surface = SurfaceBvh::new(&positions, &triangles).unwrap();
    for x in [-0.02, -1e-4, 1e-4, 0.02] {
        assert!(surface.contains(V::new(x, 0.011, 0.007)));
    }
    // Pressed 2 mm into each other: still inside.
    for p in &mut positions[n as usize..] {
        p[0] -= 0.002;
    }
    let surface = SurfaceBvh::new(&positions, &triangles).unwrap();
    assert!(surface.contains(V::new(-0.0005, 0.011, 0.007)));
    assert!(!surface.contains(V::new(-0.11, 0.011, 0.007)));
}

#[test]
fn nothing_is_found_beyond_reach_or_without_triangles() {
    let (positions, triangles) = crate::shapes::ball(0.1, 3);
    let surface = SurfaceBvh::new(&positions, &triangles).unwrap();
    assert!(surface.closest_point(V::new(1.0, 0.0, 0.0), 0.5).is_none());
    let empty = SurfaceBvh::new(&[], &[]).unwrap();
    assert!(empty.closest_point(V::zeros(), 1.0).is_none());
    assert!(!empty.contains(V::zeros()));
    assert!(empty.bounds().is_none());
}
