//! A refitted tree answers like a new one, and neither refit nor queries allocate.

use nalgebra::Vector3;
use scindo_allocations::allocations;
use scindo_collision::{Capsule, CapsuleMotion, SurfaceBvh, SurfaceError};

type V = Vector3<f64>;

/// A wave that runs through the surface.
fn waved(positions: &[[f32; 3]], phase: f32) -> Vec<[f32; 3]> {
    let wave = |p: &[f32; 3]| {
        let s = 1.0 + 0.3 * (20.0 * p[0] + phase).sin();
        [p[0] * s, p[1] + 0.02 * (30.0 * p[2] + phase).cos(), p[2] * s]
    };
    positions.iter().map(wave).collect()
}

#[test]
fn refit_equals_rebuild() {
    let (positions, triangles) = crate::shapes::ball(0.1, 10);
    let mut refitted = SurfaceBvh::new(&positions, &triangles).unwrap();
    for step in 0..20 {
        let now = waved(&positions, step as f32 * 0.4);
        refitted.refit(&now).unwrap();
        let rebuilt = SurfaceBvh::new(&now, &triangles).unwrap();
        for i in 0..50 {
            let angle = f64::from(i) * 0.7;
            let p = V::new(angle.cos(), angle.sin(), (angle * 0.3).cos()) * (0.05 + 0.004 * angle);
            let (a, b) = (refitted.closest_point(p, 1.0), rebuilt.closest_point(p, 1.0));
            let (a, b) = (a.unwrap(), b.unwrap());
            assert!((a.signed_distance.abs() - b.signed_distance.abs()).abs() < 1e-7);
            assert_eq!(refitted.contains(p), rebuilt.contains(p));
            let motion = CapsuleMotion { start: [p * 3.0; 2], end: [-p; 2], radius: 0.003 };
            let (a, b) = (refitted.sweep(&motion), rebuilt.sweep(&motion));
            assert_eq!(a.is_some(), b.is_some());
            if let (Some(a), Some(b)) = (a, b) {
                assert!((a.time - b.time).abs() < 1e-9);
            }
        }
    }
}

#[test]
fn refit_and_queries_do_not_allocate() {
    let (positions, triangles) = crate::shapes::ball(0.1, 24);
    let mut surface = SurfaceBvh::new(&positions, &triangles).unwrap();
    let frames: Vec<_> = (0..4).map(|i| waved(&positions, i as f32)).collect();
    let before = allocations();
    let mut seen = 0usize;
    for frame in &frames {
        surface.refit(frame).unwrap();
        let p = V::new(0.02, 0.13, 0.01);
        let capsule = Capsule { core: [p, p * 0.5], radius: 0.005 };
        surface.triangles_near(&capsule, 0.002, |_| seen += 1);
        seen += usize::from(surface.closest_point(p, 1.0).is_some());
        seen += usize::from(surface.closest_triangle(&capsule, 0.0).is_some());
        seen += usize::from(surface.contains(p));
        let motion = CapsuleMotion { start: [p * 2.0; 2], end: [V::zeros(); 2], radius: 0.002 };
        seen += usize::from(surface.sweep(&motion).is_some());
        seen += usize::from(surface.sweep_moving(&motion).is_some());
    }
    assert_eq!(allocations(), before);
    assert!(seen > 16);
}

#[test]
fn bad_surfaces_are_refused_and_bad_vertices_kept_out() {
    let (positions, triangles) = crate::shapes::ball(0.1, 2);
    assert_eq!(
        SurfaceBvh::new(&positions, &[[0, 1, 9999]]).unwrap_err(),
        SurfaceError::VertexOutOfRange { triangle: 0, vertex: 9999, vertices: positions.len() }
    );
    let mut surface = SurfaceBvh::new(&positions, &triangles).unwrap();
    assert!(surface.refit(&positions[1..]).is_err());
    let mut broken = positions.clone();
    broken[3][1] = f32::NAN;
    surface.refit(&broken).unwrap();
    assert_eq!(surface.refused_vertices(), 1);
    assert!(surface.closest_point(V::new(0.2, 0.0, 0.0), 1.0).unwrap().signed_distance > 0.09);
}
