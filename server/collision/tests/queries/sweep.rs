//! Times of impact against formulas, and the promise that nothing tunnels.

use nalgebra::Vector3;
use proptest::prelude::*;
use scindo_collision::{CapsuleMotion, SWEEP_TOLERANCE_M, SurfaceBvh, closest_segment_triangle};

type V = Vector3<f64>;

fn ball(from: V, to: V, radius: f64) -> CapsuleMotion {
    CapsuleMotion { start: [from; 2], end: [to; 2], radius }
}

fn lone_triangle() -> SurfaceBvh {
    let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    SurfaceBvh::new(&positions, &[[0, 1, 2]]).unwrap()
}

#[test]
fn a_sphere_meets_a_plane_when_it_should() {
    let (positions, triangles) = crate::shapes::block([1.0, 1.0, 0.5], 4);
    let surface = SurfaceBvh::new(&positions, &triangles).unwrap();
    let motion = ball(V::new(0.1, 0.2, 2.5), V::new(0.3, 0.1, -1.5), 0.25);
    let hit = surface.sweep(&motion).unwrap();
    // The centre is at 0.5 + 0.25 after (2.5 - 0.75) / 4 of the way.
    assert!((hit.time - 1.75 / 4.0).abs() < SWEEP_TOLERANCE_M);
    assert!((hit.normal - V::z()).norm() < 1e-6);
    assert!((hit.point.z - 0.5).abs() < 1e-6);
}

#[test]
fn a_sphere_meets_an_edge_and_a_corner_when_it_should() {
    let surface = lone_triangle();
    let radius = 0.1;
    // Past the edge y = 0, whose nearest point is half a radius to the side.
    let motion = ball(V::new(0.5, -0.05, 1.0), V::new(0.5, -0.05, -1.0), radius);
    let hit = surface.sweep(&motion).unwrap();
    let height = (radius * radius - 0.05f64.powi(2)).sqrt();
    assert!((hit.time - (1.0 - height) / 2.0).abs() < 1e-5, "{hit:?}");
    assert!((hit.point - V::new(0.5, 0.0, 0.0)).norm() < 1e-5);
    // Past the corner at the origin.
    let motion = ball(V::new(-0.03, -0.04, 1.0), V::new(-0.03, -0.04, -1.0), radius);
    let hit = surface.sweep(&motion).unwrap();
    let height = (radius * radius - 0.05f64.powi(2)).sqrt();
    assert!((hit.time - (1.0 - height) / 2.0).abs() < 1e-5, "{hit:?}");
    // A radius and a bit to the side: a miss.
    let aside = -1.001 * radius;
    assert!(surface.sweep(&ball(V::new(0.5, aside, 1.0), V::new(0.5, aside, -1.0), radius)).is_none());
}

#[test]
fn a_capsule_meets_a_corner_with_its_side() {
    let surface = lone_triangle();
    let motion = CapsuleMotion {
        start: [V::new(-1.0, -0.5, 0.5), V::new(1.0, -0.5, 0.5)],
        end: [V::new(-1.0, 0.5, -0.5), V::new(1.0, 0.5, -0.5)],
        radius: 0.1,
    };
    let hit = surface.sweep(&motion).unwrap();
    // The axis is parallel to the edge y = 0 and passes through it at half time.
    let expected = 0.5 - 0.1 / 2f64.sqrt();
    assert!((hit.time - expected).abs() < 1e-5, "{hit:?}");
}

#[test]
fn touching_blocks_the_way_in_but_not_the_way_out_or_along() {
    let surface = lone_triangle();
    let at = V::new(0.2, 0.2, 0.1);
    assert_eq!(surface.sweep(&ball(at, at - V::z(), 0.1)).unwrap().time, 0.0);
    assert!(surface.sweep(&ball(at, at + V::z(), 0.1)).is_none());
    assert!(surface.sweep(&ball(at, at + V::x(), 0.1)).is_none());
    // From behind, everything may leave.
    let below = V::new(0.2, 0.2, -0.05);
    assert!(surface.sweep(&ball(below, below + V::z(), 0.1)).is_none());
}

#[test]
fn a_surface_that_moves_onto_a_resting_tool_hits_it() {
    let (positions, triangles) = crate::shapes::block([0.1, 0.1, 0.005], 6);
    let mut surface = SurfaceBvh::new(&positions, &triangles).unwrap();
    let raised: Vec<_> = positions.iter().map(|p| [p[0], p[1], p[2] + 0.05]).collect();
    surface.refit(&raised).unwrap();
    let at = V::new(0.013, 0.021, 0.03);
    let hit = surface.sweep_moving(&ball(at, at, 0.002)).unwrap();
    // Top at 0.005 + 0.05 t meets the sphere's lower pole at 0.028.
    assert!((hit.time - 0.023 / 0.05).abs() < 1e-4, "{hit:?}");
    surface.forget_motion();
    assert!(surface.sweep_moving(&ball(at, at, 0.002)).is_none());
}

proptest! {
    #[test]
    fn no_ball_passes_a_thin_slab(
        x in -0.05..0.05f64, y in -0.05..0.05f64, dx in -0.03..0.03f64, dy in -0.03..0.03f64,
    ) {
        let (positions, triangles) = crate::shapes::block([0.1, 0.1, 0.005], 10);
        let surface = SurfaceBvh::new(&positions, &triangles).unwrap();
        let motion = ball(V::new(x, y, 0.02), V::new(x + dx, y + dy, -0.03), 0.002);
        let hit = surface.sweep(&motion).unwrap();
        prop_assert!((motion.core_at(hit.time)[0].z - 0.007).abs() < 2.0 * SWEEP_TOLERANCE_M);
    }

    #[test]
    fn until_impact_a_capsule_stays_clear(
        a in [-0.3..0.3f64, -0.3..0.3, 0.15..0.3], b in [-0.3..0.3f64, -0.3..0.3, 0.15..0.3],
        c in [-0.2..0.2f64, -0.2..0.2, -0.3..0.3], d in [-0.2..0.2f64, -0.2..0.2, -0.3..0.3],
    ) {
        let (positions, triangles) = crate::shapes::ball(0.1, 5);
        let surface = SurfaceBvh::new(&positions, &triangles).unwrap();
        let motion = CapsuleMotion {
            start: [V::from(a), V::from(b)], end: [V::from(c), V::from(d)], radius: 0.01,
        };
        let clearance = |time: f64| {
            let core = motion.core_at(time);
            (0..surface.triangle_count() as u32)
                .map(|t| closest_segment_triangle(core, &surface.triangle(t)).distance_squared)
                .fold(f64::INFINITY, f64::min).sqrt() - motion.radius
        };
        let hit = surface.sweep(&motion);
        let until = hit.map_or(1.0, |h| h.time);
        for i in 0..=20 {
            prop_assert!(clearance(until * f64::from(i) / 20.0) > -1e-9);
        }
        if let Some(hit) = hit {
            // Grazing edges converge slowly and may be stopped a little early, never late.
            prop_assert!(clearance(hit.time) <= 20.0 * SWEEP_TOLERANCE_M, "{}", clearance(hit.time));
        }
    }
}
