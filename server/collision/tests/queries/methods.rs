//! Every method of broad phase answers every query like a look at all triangles: on random surfaces, after
//! deformation, and after triangles were replaced as by a cut.

use fastrand::Rng;
use nalgebra::Vector3;
use scindo_allocations::allocations;
use scindo_collision::{
    Capsule, CapsuleMotion, Method, SurfaceBvh, barycentric_point, closest_point_on_triangle,
    closest_segment_triangle,
};

use crate::shapes::vector;

type V = Vector3<f64>;

/// Triangles without connection, of sizes over four orders of magnitude; some are points or needles.
fn soup(random: &mut Rng, n: usize) -> crate::shapes::Surface {
    let mut positions = Vec::new();
    for i in 0..n {
        let centre = vector(random, 0.1);
        let size = 0.05 * 10f64.powf(-4.0 * random.f64());
        let corner = |_| (centre + vector(random, size)).map(|x| x as f32).into();
        let mut corners: [[f32; 3]; 3] = [(); 3].map(corner);
        if i % 17 == 0 {
            corners[1] = corners[0];
        }
        if i % 51 == 0 {
            corners[2] = corners[0];
        }
        positions.extend(corners);
    }
    (positions, (0..n as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect())
}

/// A large deformation: twisted and stretched.
fn twisted(positions: &[[f32; 3]], angle: f32) -> Vec<[f32; 3]> {
    let twist = |p: &[f32; 3]| {
        let (sin, cos) = (angle * p[2] * 10.0).sin_cos();
        [p[0] * cos - p[1] * sin, (p[0] * sin + p[1] * cos) * (1.0 + angle), p[2] + 0.3 * angle * p[0]]
    };
    positions.iter().map(twist).collect()
}

/// All queries at some random places against a look at all triangles.
fn assert_answers(surface: &SurfaceBvh, random: &mut Rng, what: &str) {
    let what = format!("{} {what}", surface.method().name());
    let all = 0..surface.triangle_count() as u32;
    for _ in 0..12 {
        let (a, b) = (vector(random, 0.15), vector(random, 0.15));
        let capsule = Capsule { core: [a, b], radius: 0.01 * random.f64() };
        let reach = 0.01 * random.f64();
        let mut near = Vec::new();
        surface.triangles_near(&capsule, reach, |t| near.push(t.triangle));
        near.sort_unstable();
        let distance = |t: u32| closest_segment_triangle([a, b], &surface.triangle(t)).distance_squared;
        let within = |t: &u32| distance(*t) <= (capsule.radius + reach).powi(2);
        assert_eq!(near, all.clone().filter(within).collect::<Vec<_>>(), "{what}: near");

        let least = |distance: &dyn Fn(u32) -> f64| {
            all.clone().map(|t| (distance(t), t)).min_by(|x, y| x.partial_cmp(y).unwrap())
        };
        let (squared, first) = least(&distance).unwrap();
        let found = surface.closest_triangle(&capsule, 1.0).unwrap();
        assert_eq!((found.closest.distance_squared, found.triangle), (squared, first), "{what}: closest");
        let to_point = |t: u32| {
            let corners = surface.triangle(t);
            (barycentric_point(&corners, closest_point_on_triangle(a, &corners)) - a).norm_squared()
        };
        let (squared, first) = least(&to_point).unwrap();
        let found = surface.closest_point(a, f64::MAX).unwrap();
        assert_eq!(found.triangle, first, "{what}: closest point");
        assert!((found.signed_distance.abs() - squared.sqrt()).abs() <= 1e-12);
        assert!(surface.closest_point(a, squared.sqrt() * 0.99).is_none(), "{what}: out of reach");
    }
}

/// Sweeps and sides, compared to those of another surface with the same triangles.
fn assert_equal(surface: &SurfaceBvh, other: &SurfaceBvh, random: &mut Rng, what: &str) -> usize {
    let what = format!("{} {what}", surface.method().name());
    let mut hits = 0;
    for _ in 0..20 {
        let (a, b) = (vector(random, 0.2), vector(random, 0.03));
        let motion = CapsuleMotion { start: [a, a + b], end: [b - a, -a], radius: 0.002 };
        assert_eq!(surface.sweep(&motion), other.sweep(&motion), "{what}: sweep");
        let moving = surface.sweep_moving(&motion);
        assert_eq!(moving, other.sweep_moving(&motion), "{what}: moving");
        hits += usize::from(moving.is_some());
        let resting = CapsuleMotion { start: [b, a], end: [b, a], radius: 0.002 };
        assert_eq!(surface.sweep_moving(&resting), other.sweep_moving(&resting), "{what}: resting");
        assert_eq!(surface.contains(b), other.contains(b), "{what}: side");
    }
    let (mut pairs, mut others) = (Vec::new(), Vec::new());
    for margin in [0.0, 0.003] {
        surface.self_pairs(margin, &mut pairs);
        other.self_pairs(margin, &mut others);
        assert_eq!(pairs, others, "{what}: pairs");
        hits += pairs.len();
        surface.pairs_with(other, margin, &mut pairs);
        other.pairs_with(surface, margin, &mut others);
        others.iter_mut().for_each(|pair| pair.swap(0, 1));
        others.sort_unstable();
        assert_eq!(pairs, others, "{what}: pairs of two");
        assert!(pairs.len() >= surface.triangle_count());
    }
    hits
}

/// All pairs by looking at every pair.
fn brute_pairs(surface: &SurfaceBvh) -> Vec<[u32; 2]> {
    let boxes: Vec<_> = (0..surface.triangle_count() as u32)
        .map(|t| {
            let points = [surface.triangle(t), surface.previous_triangle(t)].concat();
            points.iter().fold([points[0]; 2], |[low, high], p| [low.inf(p), high.sup(p)])
        })
        .collect();
    let apart = |i: u32, j: u32| !surface.corners(i).iter().any(|v| surface.corners(j).contains(v));
    let n = boxes.len() as u32;
    let meet = |i: u32, j: u32| {
        let ([a, b], [c, d]) = (boxes[i as usize], boxes[j as usize]);
        (0..3).all(|k| a[k] <= d[k] && c[k] <= b[k])
    };
    (0..n).flat_map(|i| (i + 1..n).map(move |j| [i, j])).filter(|&[i, j]| apart(i, j) && meet(i, j)).collect()
}

#[test]
fn every_method_answers_like_a_look_at_all_triangles() {
    let mut random = Rng::with_seed(1);
    let surfaces = [
        ("soup", soup(&mut random, 700)),
        ("ball", crate::shapes::ball(0.1, 9)),
        ("one", soup(&mut random, 1)),
    ];
    for (name, (positions, triangles)) in surfaces {
        let mut surfaces =
            Method::ALL.map(|method| SurfaceBvh::with_method(method, &positions, &triangles).unwrap());
        for angle in [0.0, 0.05, 0.8, -0.6] {
            let now = twisted(&positions, angle);
            let mut hits = 0;
            for i in 0..Method::ALL.len() {
                surfaces[i].refit(&now).unwrap();
                assert_answers(&surfaces[i], &mut random, &format!("{name} {angle}"));
                let (others, rest) = surfaces.split_at(i);
                hits += others.first().map_or(1, |other| assert_equal(&rest[0], other, &mut random, name));
            }
            let mut pairs = Vec::new();
            surfaces[0].self_pairs(0.0, &mut pairs);
            assert_eq!(pairs, brute_pairs(&surfaces[0]));
            assert!(hits > 3 || name == "one");
        }
    }
}

#[test]
fn triangles_replaced_as_by_a_cut_are_found_and_the_old_ones_are_not() {
    let mut random = Rng::with_seed(2);
    for method in Method::ALL {
        let (mut positions, mut triangles) = crate::shapes::ball(0.1, 12);
        let mut surface = SurfaceBvh::with_method(method, &positions, &triangles).unwrap();
        for round in 0..30 {
            let mut expected = 0;
            if round % 10 == 9 {
                // Triangles vanish, as after a reset.
                let n = triangles.len() - 40;
                triangles.truncate(n);
                expected = 40;
            } else {
                // Triangles are divided in three and opened.
                let first = random.usize(0..triangles.len() - 10);
                for t in first..first + 10 {
                    let [a, b, c] = triangles[t];
                    let middle = [a, b, c].map(|v| V::from(positions[v as usize].map(f64::from)));
                    let middle = middle.iter().sum::<V>() / 3.0 * (0.8 + 0.3 * random.f64());
                    let m = positions.len() as u32;
                    positions.push(middle.map(|x| x as f32).into());
                    triangles[t] = [a, b, m];
                    triangles.extend([[b, c, m], [c, a, m]]);
                    expected += 3;
                }
            }
            let now = twisted(&positions, 0.02 * f64::from(round) as f32);
            let changed = surface.change_topology(&now, &triangles).unwrap();
            assert_eq!(changed, expected);
            assert!(surface.rebuilds() == 0 || round > 9, "{} round {round}", method.name());
            let fresh = SurfaceBvh::with_method(method, &now, &triangles).unwrap();
            assert_answers(&surface, &mut random, &format!("round {round}"));
            assert_equal(&surface, &fresh, &mut random, &format!("round {round}"));
            for v in (0..positions.len() as u32).step_by(31) {
                let at = |v: u32| V::from(now[v as usize].map(f64::from));
                let (a, b) = (surface.closest_point(at(v), 1.0), fresh.closest_point(at(v), 1.0));
                assert_eq!(a, b, "the same pseudo-normals");
            }
        }
        let unused = positions.len() as u32;
        assert!(surface.change_topology(&positions, &[[0, 1, unused]]).is_err());
        assert_eq!(surface.triangle_count(), triangles.len(), "not changed by what was refused");
        assert_eq!(surface.change_topology(&[], &[]).unwrap(), triangles.len());
        assert_eq!(surface.closest_point(V::zeros(), 1.0), None);
        let (positions, triangles) = crate::shapes::ball(0.1, 3);
        surface.change_topology(&positions, &triangles).unwrap();
        assert_answers(&surface, &mut random, "from nothing");
    }
}

#[test]
fn a_cut_leaves_an_arrangement_as_good_as_it_was() {
    // Large enough that the spheres near the root of a tree overlap each other far beyond a triangle.
    let (mut positions, mut triangles) = crate::shapes::ball(0.1, 60);
    let whole = (positions.clone(), triangles.clone());
    for t in 20_000..20_100 {
        let corners = triangles[t];
        let middle = [0, 1, 2].map(|k| corners.iter().map(|&v| positions[v as usize][k] / 3.0).sum());
        let m = positions.len() as u32;
        positions.push(middle);
        let [a, b, c] = corners;
        triangles[t] = [a, b, m];
        triangles.extend([[b, c, m], [c, a, m]]);
    }
    for method in Method::ALL {
        let mut surface = SurfaceBvh::with_method(method, &whole.0, &whole.1).unwrap();
        surface.change_topology(&positions, &triangles).unwrap();
        let quality = surface.quality();
        assert!((0.98..1.01).contains(&quality), "{}: {quality}", method.name());
        assert_eq!(surface.rebuilds(), 0);
    }
}

#[test]
fn a_worn_tree_is_arranged_anew() {
    // Points of a plane are shuffled: every node then covers the whole plane.
    let n = 4000;
    let mut random = Rng::with_seed(3);
    let places: Vec<[f32; 2]> = (0..n).map(|i| [(i % 63) as f32 * 0.01, (i / 63) as f32 * 0.01]).collect();
    let at = |places: &[[f32; 2]]| -> Vec<[f32; 3]> {
        let corners =
            |p: &[f32; 2]| [[p[0], p[1], 0.0], [p[0] + 0.004, p[1], 0.0], [p[0], p[1] + 0.004, 0.0]];
        places.iter().flat_map(corners).collect()
    };
    let triangles: Vec<[u32; 3]> = (0..n as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let mut shuffled = places.clone();
    for i in 0..n {
        shuffled.swap(i, random.usize(0..n));
    }
    for method in [Method::AabbTree, Method::Octree, Method::SphereTree] {
        let mut surface = SurfaceBvh::with_method(method, &at(&places), &triangles).unwrap();
        assert_eq!(surface.quality(), 1.0);
        let stretched: Vec<_> = at(&places).iter().map(|p| p.map(|x| 3.0 * x)).collect();
        for _ in 0..3 {
            surface.refit(&stretched).unwrap();
            surface.forget_motion();
            assert!(surface.quality() < 1.01, "a uniform scale does not matter");
        }
        assert_eq!(surface.rebuilds(), 0);
        for _ in 0..3 {
            surface.refit(&at(&shuffled)).unwrap();
            surface.forget_motion();
        }
        assert!(surface.rebuilds() > 0, "{}", method.name());
        assert!(surface.quality() < 1.5);
        assert_answers(&surface, &mut random, "shuffled");
    }
}

#[test]
fn no_method_allocates_in_a_steady_state() {
    let (positions, triangles) = crate::shapes::ball(0.1, 16);
    let frames: Vec<_> = [0.0, 0.02, 0.05].map(|angle| twisted(&positions, angle)).to_vec();
    for method in Method::ALL {
        let mut surface = SurfaceBvh::with_method(method, &positions, &triangles).unwrap();
        let (mut pairs, mut seen) = (Vec::new(), 0);
        surface.self_pairs(0.01, &mut pairs);
        pairs.reserve(20_000);
        let before = allocations();
        for frame in &frames {
            surface.refit(frame).unwrap();
            let p = V::new(0.02, 0.1, 0.01);
            let capsule = Capsule { core: [p, p * 0.5], radius: 0.005 };
            surface.triangles_near(&capsule, 0.002, |_| seen += 1);
            seen += usize::from(surface.closest_point(p, f64::MAX).is_some());
            let motion = CapsuleMotion { start: [p * 2.0; 2], end: [V::zeros(); 2], radius: 0.002 };
            seen += usize::from(surface.sweep_moving(&motion).is_some());
            seen += usize::from(surface.contains(p));
            surface.self_pairs(0.0, &mut pairs);
            surface.pairs_with(&surface, 0.0, &mut pairs);
        }
        assert_eq!(allocations(), before, "{}", method.name());
        assert!(seen > 9);
    }
}

#[test]
fn surfaces_of_coinciding_triangles_do_not_make_a_tree_deep() {
    // Divided nowhere, and inserted one by one into one leaf after another.
    let corners = [[0.0, 0.0, 0.0], [0.01, 0.0, 0.0], [0.0, 0.01, 0.0]];
    for method in Method::ALL {
        let (mut positions, mut triangles) = (Vec::new(), Vec::new());
        for i in 0..2000u32 {
            positions.extend(corners);
            triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
        }
        let mut surface = SurfaceBvh::with_method(method, &positions, &triangles).unwrap();
        for i in 2000..2600u32 {
            positions.extend(corners.map(|p| p.map(|x: f32| x + 1.1f32.powi(-(i as i32 - 2000)))));
            triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
            surface.change_topology(&positions, &triangles).unwrap();
        }
        let mut count = 0;
        surface.triangles_near(&Capsule { core: [V::zeros(); 2], radius: 10.0 }, 0.0, |_| count += 1);
        assert_eq!(count, 2600);
    }
}
