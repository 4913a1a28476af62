//! The same bits for any number of threads, and no allocation in a steady step.

use nalgebra::Vector3;
use scindo_allocations::{Counting, allocations};
use scindo_physics::assembly::{Model, Volumetric};
use scindo_physics::body::{Body, BodySettings, PointSpring, SpringKind};
use scindo_physics::cut::BladeSweep;
use scindo_physics::element::{MaterialPoint, Simd};
use scindo_physics::material::{Law, Material, Rayleigh, Tangent};
use scindo_physics::mesh::{BoxPattern, box_hexes, box_mesh};
use scindo_physics::octree::{BoxShape, Octree, OctreeSettings};
use scindo_physics::space::OctreeSpace;
use scindo_physics::team::Team;

use crate::{DOWN, SOFT, bar_mesh, hold_left, settings};

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn bar(threads: usize, simd: Simd) -> Body {
    let material = Material { rayleigh: Rayleigh { mass_1_s: 0.1, stiffness_s: 0.002 }, ..SOFT };
    let settings = BodySettings { threads, simd, ..settings(10, 1e-6) };
    let mut body = Body::new(bar_mesh(), material, settings).unwrap();
    hold_left(&mut body);
    body
}

fn push(body: &Body, height: f64) -> PointSpring {
    let copies = body.tets().unwrap().pieces()[6_000].copies;
    PointSpring {
        point: MaterialPoint::in_tet(copies, [0.25; 4]),
        kind: SpringKind::OneSided { normal: Vector3::y(), offset_m: height },
        stiffness_n_m: 500.0,
        max_force_n: 10.0,
    }
}

/// FNV-1a over the bits of positions and velocities.
fn hash(body: &Body) -> u64 {
    let values = body.positions().iter().chain(body.velocities()).flat_map(|v| [v.x, v.y, v.z]);
    values.fold(0xcbf2_9ce4_8422_2325, |h, v| (h ^ v.to_bits()).wrapping_mul(0x0000_0100_0000_01b3))
}

#[test]
fn the_number_of_threads_does_not_change_a_bit() {
    for simd in [Simd::Baseline, Simd::Avx2, Simd::Avx512] {
        let hashes: Vec<u64> = [1, 2, 3, 8]
            .into_iter()
            .map(|threads| {
                let mut body = bar(threads, simd);
                for _ in 0..15 {
                    let spring = push(&body, 0.1);
                    body.step(0.02, DOWN, &[spring]);
                }
                hash(&body)
            })
            .collect();
        assert!(hashes.iter().all(|h| *h == hashes[0]), "{simd:?}: {hashes:x?}");
    }
}

#[test]
fn instruction_sets_agree_to_single_precision() {
    let (mut fast, mut portable) = (bar(1, Simd::detect()), bar(1, Simd::Baseline));
    for _ in 0..10 {
        fast.step(0.02, DOWN, &[]);
        portable.step(0.02, DOWN, &[]);
    }
    let difference = fast.positions().iter().zip(portable.positions()).map(|(a, b)| (a - b).norm());
    assert!(difference.fold(0.0, f64::max) < 1e-4);
}

/// Sixteen lanes compute what eight do, in the same order. The bar turns far, so that batches beside each other need
/// different numbers of iterations for their rotations. A cut takes some of its strips of tetrahedra apart.
#[test]
fn two_batches_at_once_have_the_bits_of_one_after_the_other() {
    let hash_with = |simd| {
        let mut body = bar(1, simd);
        let mut octree = cells(simd);
        for k in 0..15 {
            if k == 8 {
                let at = |x: f64| [Vector3::new(x, -1.0, 0.11), Vector3::new(x, 1.0, 0.11)];
                let report = body.cut(&BladeSweep { segments: vec![at(0.4), at(0.6)] }, 1).unwrap();
                assert!(report.new_copies.len() > 20);
            }
            let spring = push(&body, 0.1);
            body.step(0.02, DOWN, &[spring]);
            octree.step(0.02, DOWN, &[]);
        }
        [hash(&body), hash(&octree)]
    };
    assert_eq!(hash_with(Simd::Avx512), hash_with(Simd::Avx2));
}

/// Octree cells of several sizes, held at their left.
fn cells(simd: Simd) -> Body {
    let shape = BoxShape { min: Vector3::zeros(), max: Vector3::new(0.4, 0.1, 0.1) };
    let octree = Octree::fill(&shape, OctreeSettings { cells: 22, levels: 2 }, &|_| 0).unwrap();
    let settings = BodySettings { simd, ..settings(10, 1e-6) };
    let mut body = Body::of_space(Box::new(OctreeSpace::new(octree)), SOFT, settings).unwrap();
    hold_left(&mut body);
    body
}

/// A cube in which every seventh tetrahedron has a flat one on a face, held at its left.
fn ruined_cube(threads: usize) -> Body {
    let mut mesh = box_mesh(Vector3::zeros(), Vector3::repeat(0.1), [4; 3], BoxPattern::Tet6);
    for e in (0..mesh.tets.len()).step_by(7) {
        let weights = [1e-4, 0.3333, 0.3333, 0.3333];
        let point = mesh.corners(e).iter().zip(weights).map(|(X, w)| w * X).sum();
        let (nodes, apex) = (mesh.tets[e], mesh.nodes.len() as u32);
        mesh.nodes.push(point);
        for k in 0..4 {
            let mut tet = nodes;
            tet[k] = apex;
            if k == 0 { mesh.tets[e] = tet } else { mesh.tets.push(tet) }
        }
    }
    let settings = BodySettings { threads, ..settings(500, 1e-5) };
    let mut body = Body::new(mesh, SOFT, settings).unwrap();
    hold_left(&mut body);
    body
}

/// The same bits and no allocation, even if the solver works in other variables. Springs on copies of
/// flat elements cost hardly any iterations.
#[test]
fn degenerate_elements_change_none_of_that() {
    let mut hashes = Vec::new();
    for threads in [1, 2, 3] {
        let mut body = ruined_cube(threads);
        let last = *body.tets().unwrap().pieces().last().unwrap();
        let grab = PointSpring {
            point: MaterialPoint::in_tet(last.copies, [0.1, 0.2, 0.3, 0.4]),
            kind: SpringKind::Hold { target_m: Vector3::new(0.1, 0.12, 0.1) },
            stiffness_n_m: 2_000.0,
            max_force_n: 50.0,
        };
        let free = (0..5).map(|_| body.step(0.02, DOWN, &[]).iterations).max().unwrap();
        let sprung = (0..5).map(|_| body.step(0.02, DOWN, &[grab]).iterations).max().unwrap();
        assert!(sprung <= 2 * free, "{sprung} iterations with a spring, {free} without");
        assert!(body.stiff_motions().substituted > 0);
        let before = allocations();
        for _ in 0..10 {
            body.step(0.02, DOWN, &[grab]);
        }
        assert_eq!(allocations() - before, 0, "with {threads} threads");
        hashes.push(hash(&body));
    }
    assert!(hashes.iter().all(|h| *h == hashes[0]), "{hashes:x?}");
}

#[test]
fn a_steady_step_does_not_allocate() {
    for threads in [1, 2] {
        let mut body = bar(threads, Simd::detect());
        let spring = push(&body, 0.1);
        let mut surface = Vec::new();
        for _ in 0..3 {
            body.step(0.02, DOWN, &[spring]);
            body.surface_positions(&mut surface);
        }
        let before = allocations();
        for _ in 0..20 {
            body.step(0.02, DOWN, &[spring]);
            body.surface_positions(&mut surface);
        }
        let allocated = allocations() - before;
        assert_eq!(allocated, 0, "with {threads} threads");
    }
}

#[test]
fn assembling_a_model_again_does_not_allocate() {
    let (size, cells) = (Vector3::new(1.0, 0.8, 0.6), [5, 4, 3]);
    let tets = box_mesh(Vector3::zeros(), size, cells, BoxPattern::Tet6);
    let hexes = box_hexes(Vector3::zeros(), size, cells);
    let soft = Material { law: Law::NeoHookean, ..SOFT };
    let averaged = Volumetric::NodeAveraged { kept: 0.05 };
    let models = [
        Model::tet4(&tets, &soft, averaged).unwrap(),
        Model::tet10(&tets, &SOFT).unwrap(),
        Model::hex8(&hexes, &soft, Volumetric::Selective).unwrap(),
    ];
    for model in models {
        let x: Vec<_> = model.rest().iter().map(|X| X + 0.1 * Vector3::new(X.y * X.z, 0.0, X.x)).collect();
        let (mut f, mut K) = (vec![Vector3::zeros(); x.len()], model.pattern());
        for threads in [1, 2] {
            let mut team = Team::new(threads).unwrap();
            let mut assemble = || {
                model.tangent_by(&mut team, &x, Tangent::Projected, &mut K);
                model.internal_forces_by(&mut team, &x, &mut f) + model.energy_by(&mut team, &x)
            };
            assemble();
            let before = allocations();
            assemble();
            assert_eq!(allocations() - before, 0, "{:?} on {threads} threads", model.kind());
        }
    }
}
