//! Bodies of octree cells on the general path, in double precision: the reference for everything faster.

use nalgebra::{Matrix3, Vector3};
use scindo_physics::body::{
    Arithmetic, Body, BodySettings, ElementKind, Method, Outcome, PcgSettings, Scheme,
};
use scindo_physics::cut::{BladeSweep, SolidCells};
use scindo_physics::integrator::LooseParts;
use scindo_physics::material::{Law, Material, Rayleigh, Region};
use scindo_physics::mesh::box_hexes;
use scindo_physics::octree::{BoxShape, Octree, OctreeSettings};
use scindo_physics::space::OctreeSpace;
use scindo_physics::space::Space;
use scindo_physics::team::Team;

const LINEAR: Material = Material {
    young_pa: 1e6,
    poisson: 0.3,
    density_kg_m3: 1000.0,
    rayleigh: Rayleigh { mass_1_s: 0.0, stiffness_s: 0.0 },
    law: Law::Linear,
};
const FALL: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);

fn unit_cube(cells: u32, levels: u8) -> Octree {
    let shape = BoxShape { min: Vector3::zeros(), max: Vector3::repeat(1.0) };
    Octree::fill(&shape, OctreeSettings { cells, levels }, &|_| 0).unwrap()
}

fn body(octree: Octree, material: Material, settings: BodySettings) -> Body {
    Body::of_space(Box::new(OctreeSpace::new(octree)), material, settings).unwrap()
}

fn direct(scheme: Scheme) -> BodySettings {
    let solver = PcgSettings { iterations: 2000, tolerance: 1e-11 };
    BodySettings { scheme, method: Method::Cholesky, solver, ..BodySettings::default() }
}

fn at(body: &Body, inside: impl Fn(&Vector3<f64>) -> bool) -> Vec<u32> {
    (0..).zip(body.rest_positions()).filter(|(_, X)| inside(X)).map(|(n, _)| n).collect()
}

/// Displacement [m] of the vertex at `X` [m] under gravity, with the face x = 0 held.
fn sag(mut body: Body, X: Vector3<f64>) -> Vector3<f64> {
    let held = at(&body, |X| X.x < 1e-9);
    body.fix(&held, [true; 3], Vector3::zeros()).unwrap();
    let report = body.step(1.0, FALL, &[]);
    assert_eq!(report.outcome, Outcome::Advanced, "{report:?}");
    let found = at(&body, |p| (p - X).norm() < 1e-9);
    body.positions()[found[0] as usize] - X
}

/// Strain energies and corner displacements of reference R7 on coarse grids.
#[test]
fn coarse_grids_have_the_reference_solution() {
    let references = [
        (4, Vector3::new(0.009212639891299992, -4.089492789281112e-05, -0.026829049421700515)),
        (8, Vector3::new(0.009417049205520648, 3.6250991714351976e-05, -0.0280378711310351)),
    ];
    for (n, expected) in references {
        let u = sag(body(unit_cube(n, 0), LINEAR, direct(Scheme::Static)), Vector3::repeat(1.0));
        assert!((u - expected).norm() < 1e-8 * expected.norm(), "{n}: {u} {expected}");
        let hexes = box_hexes(Vector3::zeros(), Vector3::repeat(1.0), [n as usize; 3]);
        let hex8 = sag(Body::hex8(hexes, LINEAR, direct(Scheme::Static)).unwrap(), Vector3::repeat(1.0));
        assert!((u - hex8).norm() < 1e-10 * u.norm());
    }
}

#[test]
fn adaptive_grids_converge_to_the_uniform_answer() {
    let tip = |cells, levels| {
        sag(body(unit_cube(cells, levels), LINEAR, direct(Scheme::Static)), Vector3::repeat(1.0)).z
    };
    let uniform = tip(16, 0);
    for levels in 1..4 {
        let adaptive = tip(16, levels);
        assert!((adaptive / uniform - 1.0).abs() < 0.01, "{levels}: {adaptive} {uniform}");
    }
}

/// A linear field of positions, cut or not, across level changes: no force on any vertex inside the body.
#[test]
fn constant_stress_is_in_balance_across_level_changes_and_along_cuts() {
    let F = Matrix3::new(1.1, 0.1, 0.0, -0.05, 0.9, 0.2, 0.02, 0.0, 1.05);
    for law in [Law::Linear, Law::Corotational, Law::NeoHookean] {
        let turn = *nalgebra::Rotation3::from_euler_angles(0.4, -0.3, 1.0).matrix();
        let F = if law == Law::Linear { F } else { turn * F };
        let mut body = body(unit_cube(12, 2), Material { law, ..LINEAR }, direct(Scheme::ImplicitEuler));
        let edge = |z: f64| [Vector3::new(-0.1, 0.45, z), Vector3::new(0.55, 0.45, z)];
        let report = body.cut(&BladeSweep { segments: vec![edge(1.1), edge(0.4)] }, 1).unwrap();
        assert!(report.faces_opened > 10 && report.new_copies.iter().any(|new| new.between.is_none()));
        let x: Vec<Vector3<f64>> = body.rest_positions().iter().map(|X| F * X).collect();
        let v = vec![Vector3::zeros(); x.len()];
        body.set_state(&x, &v).unwrap();
        // The blade lies in a plane of cell faces: on its lips there is the traction of the stress, elsewhere
        // inside there is nothing.
        let f = body.internal_forces();
        let scale = f.iter().map(Vector3::norm).fold(0.0, f64::max);
        for (f, X) in f.iter().zip(body.rest_positions()) {
            let inside = X.iter().all(|c| *c > 1e-9 && *c < 1.0 - 1e-9);
            let at_cut = (X.y - 0.45).abs() < 0.1;
            assert!(!inside || at_cut || f.norm() < 1e-10 * scale, "{law:?} {X} {f}");
        }
        let total: Vector3<f64> = f.iter().sum();
        assert!(total.norm() < 1e-10 * scale);
    }
}

#[test]
fn a_cut_keeps_mass_momentum_and_the_moving_field_and_the_parts_fall_freely() {
    let material = Material { law: Law::Corotational, young_pa: 1e4, ..LINEAR };
    let solver = PcgSettings { iterations: 400, tolerance: 1e-9 };
    let settings = BodySettings { solver, ..BodySettings::default() };
    let mut body = body(unit_cube(8, 2), material, settings);
    let spin =
        |X: &Vector3<f64>| Vector3::new(0.3, -0.2, 0.1).cross(X) + Vector3::new(0.1, 0.0, 0.2) * X.z * X.z;
    let v: Vec<Vector3<f64>> = body.rest_positions().iter().map(spin).collect();
    let x = body.positions().to_vec();
    body.set_state(&x, &v).unwrap();
    for _ in 0..3 {
        assert_eq!(body.step(0.01, FALL, &[]).outcome, Outcome::Advanced);
    }
    let before = (body.total_mass(), body.momentum(), body.centre_of_mass(), body.elastic_energy());
    let middle = body.centre_of_mass();
    let edge = |z: f64| [middle + Vector3::new(-2.0, 0.1, z), middle + Vector3::new(2.0, -0.2, z)];
    let report = body.cut(&BladeSweep { segments: vec![edge(2.0), edge(-2.0)] }, 1).unwrap();
    assert!(report.new_copies.iter().any(|new| new.between.is_some()), "leaves are divided");
    assert_eq!(body.components().len(), 2);
    assert!((body.total_mass() / before.0 - 1.0).abs() < 1e-12);
    assert!((body.momentum() - before.1).norm() < 1e-12 * before.1.norm());
    assert!((body.centre_of_mass() - before.2).norm() < 1e-12);
    assert!((body.elastic_energy() / before.3 - 1.0).abs() < 1e-2);
    let (c, p) = (body.centre_of_mass(), body.momentum());
    for _ in 0..10 {
        assert_eq!(body.step(0.01, FALL, &[]).outcome, Outcome::Advanced);
    }
    let gained = (body.momentum() - p) / body.total_mass();
    assert!((gained - FALL * 0.1).norm() < 1e-6, "{gained}");
    assert!(body.centre_of_mass().z < c.z);
    body.reset().unwrap();
    assert_eq!((body.components().len(), body.n_copies()), (1, unit_cube(8, 2).n_vertices()));
    assert_eq!(body.step(0.01, FALL, &[]).outcome, Outcome::Advanced);
}

#[test]
fn held_faces_stay_held_where_leaves_are_divided() {
    let mut body = body(unit_cube(8, 2), LINEAR, direct(Scheme::Static));
    // A slab: its inner vertices belong to coarse leaves.
    let held = at(&body, |X| X.x < 0.51);
    body.fix(&held, [true, true, false], Vector3::new(0.01, 0.0, 0.0)).unwrap();
    body.fix(&at(&body, |X| X.x < 1e-9), [true; 3], Vector3::new(0.01, 0.0, 0.0)).unwrap();
    let edge = |z: f64| [Vector3::new(-0.1, 0.4, z), Vector3::new(1.1, 0.47, z)];
    body.cut(&BladeSweep { segments: vec![edge(1.1), edge(0.2)] }, 1).unwrap();
    body.step(1.0, FALL, &[]);
    for (x, X) in body.positions().iter().zip(body.rest_positions()) {
        assert!(X.x > 0.51 || (x - X - Vector3::x() * 0.01).xy().norm() < 1e-12, "{X} {x}");
    }
    assert_eq!(body.settings().element, ElementKind::Octree);
}

/// Two materials one above the other, with ν = 0: the stress is uniform, and each stretches by σ/E.
#[test]
fn materials_in_series_share_the_stress() {
    let shape = BoxShape { min: Vector3::zeros(), max: Vector3::repeat(1.0) };
    let settings = OctreeSettings { cells: 12, levels: 2 };
    let mut octree = Octree::fill(&shape, settings, &|p| u16::from(p.z > 0.5)).unwrap();
    octree.set_regions(vec![Region { young_pa: 1e4, poisson: 0.0, density_kg_m3: 500.0 }]);
    for law in [Law::Linear, Law::Corotational] {
        let material = Material { law, poisson: 0.0, ..LINEAR };
        let mut body = body(octree.clone(), material, direct(Scheme::Static));
        assert!((body.total_mass() - 750.0).abs() < 1e-9);
        assert!((body.centre_of_mass().z - (1000.0 * 0.125 + 500.0 * 0.375) / 750.0).abs() < 1e-12);
        body.fix(&at(&body, |X| X.z < 1e-9), [true; 3], Vector3::zeros()).unwrap();
        let top = at(&body, |X| X.z > 1.0 - 1e-9);
        body.add_surface_force(&top, Vector3::new(0.0, 0.0, 100.0)).unwrap();
        assert_eq!(body.step(1.0, Vector3::zeros(), &[]).outcome, Outcome::Advanced);
        let rise = body.positions()[top[0] as usize].z - 1.0;
        let expected = 100.0 * (0.5 / 1e6 + 0.5 / 1e4);
        assert!((rise / expected - 1.0).abs() < 1e-9, "{law:?}: {rise} {expected}");
        let energy = 0.5 * 100.0 * expected;
        assert!((body.elastic_energy() / energy - 1.0).abs() < 1e-9);
    }
}

#[test]
fn the_surface_follows_cuts_and_a_reset_and_encloses_the_volume() {
    let mut body =
        body(unit_cube(8, 2), Material { law: Law::Corotational, ..LINEAR }, BodySettings::default());
    let whole = body.surface().clone();
    assert!((whole.volume(body.positions()) - 1.0).abs() < 1e-9);
    let epoch = body.epoch();
    for (incision, z) in [(1, 0.31), (2, 0.72)] {
        let edge = |x: f64| [Vector3::new(x, -0.2, z), Vector3::new(x, 0.8, z + 0.1)];
        body.cut(&BladeSweep { segments: vec![edge(-0.1), edge(0.6)] }, incision).unwrap();
        assert_eq!(body.surface().n_defects(), 0);
        assert!(body.surface().tags.contains(&incision));
        assert!(body.opened_area(incision) > 0.3);
    }
    assert!(body.epoch() > epoch);
    assert!((body.surface().volume(body.positions()) - 1.0).abs() < 1e-2);
    body.step(0.01, FALL, &[]);
    assert_eq!(body.flaws().surface, 0);
    body.reset().unwrap();
    assert_eq!(*body.surface(), whole);
}

/// What world, runtime and studies ask of any body.
#[test]
fn an_octree_answers_what_any_body_is_asked() {
    let mut body = body(unit_cube(10, 2), LINEAR, BodySettings::default());
    assert!(body.tets().is_none() && body.can_be_cut() && body.mesh_error(&mut Default::default()).is_none());
    assert_eq!(body.bounds(), [Vector3::zeros(), Vector3::repeat(1.0)]);
    assert!((body.element_size() - 0.1).abs() < 1e-12);
    // The cut lies between the centres at 0.45 and 0.55, above the faces there.
    let edge = |z: f64| [Vector3::new(-0.1, 0.53, z), Vector3::new(1.1, 0.53, z)];
    let area = body.swept_area(&BladeSweep { segments: vec![edge(1.1), edge(0.2)] });
    assert!((area - 0.8).abs() < 1e-6, "{area}");
    let points = [(Vector3::new(0.33, 0.53, 0.7), true), (Vector3::new(0.33, 0.53, 0.05), false)];
    let mut probes: Vec<_> = points
        .iter()
        .flat_map(|(X, _)| [Vector3::y(), -Vector3::y()].map(|side| body.locate(*X, Some(side)).unwrap()))
        .collect();
    assert!(body.locate(Vector3::new(0.5, 0.5, 1.3), None).is_none());
    body.cut(&BladeSweep { segments: vec![edge(1.1), edge(0.2)] }, 1).unwrap();
    for (pair, (X, apart)) in probes.chunks_mut(2).zip(points) {
        let [above, below] = [0, 1].map(|k| body.carriers(&mut pair[k]));
        for carriers in [&above, &below] {
            let at: Vector3<f64> =
                carriers.iter().map(|(v, w)| *w * body.rest_positions()[*v as usize]).sum();
            assert!((at - X).norm() < 1e-12);
        }
        assert_eq!(above != below, apart, "{X}");
    }
    // The parts that fill the body, and the stress of each.
    let (mut volume, mut parts) = (0.0, 0);
    body.for_pieces(&mut |element, copies, volumes| {
        assert_eq!((element, copies.len()), (parts, 8));
        volume += volumes.iter().sum::<f64>();
        parts += 1;
    });
    assert!((volume - 1.0).abs() < 1e-12);
    assert_eq!((parts, body.cauchy_stresses().len()), (body.n_pieces(), body.n_pieces()));
    let solid = body.solid();
    let SolidCells::Hexes(hexes) = &solid.cells else { panic!("cells are hexahedra") };
    assert_eq!((hexes.len(), solid.origins.len()), (parts, parts));
    let filled: f64 = hexes
        .iter()
        .map(|hex| {
            let at = |c: usize| solid.vertices[hex[c] as usize].position(body.rest_positions());
            (at(1) - at(0)).cross(&(at(2) - at(0))).dot(&(at(4) - at(0)))
        })
        .sum();
    assert!((filled - 1.0).abs() < 1e-12, "{filled}");
}

/// Both ways of stepping, from the same state, cut in the same way.
#[test]
fn the_kernels_step_like_the_discrete_model() {
    let shape = BoxShape { min: Vector3::zeros(), max: Vector3::new(0.5, 0.2, 0.2) };
    let mut octree =
        Octree::fill(&shape, OctreeSettings { cells: 20, levels: 2 }, &|p| u16::from(p.x > 0.3)).unwrap();
    octree.set_regions(vec![Region { young_pa: 4e5, poisson: 0.4, density_kg_m3: 500.0 }]);
    let edge = |z: f64| [Vector3::new(0.2, -0.1, z), Vector3::new(0.24, 0.3, z)];
    let blade = BladeSweep { segments: vec![edge(0.3), edge(0.07)] };
    for law in [Law::Linear, Law::Corotational] {
        for scheme in [
            Scheme::ImplicitEuler,
            Scheme::Bdf2,
            Scheme::Newmark { beta: 0.25, gamma: 0.5 },
            Scheme::GeneralisedAlpha { spectral_radius: 0.8 },
        ] {
            let moved = [None, Some(Arithmetic::Double)].map(|arithmetic| {
                let solver = PcgSettings { iterations: 2000, tolerance: 1e-6 };
                let settings = BodySettings { solver, scheme, arithmetic, ..BodySettings::default() };
                let mut body = body(octree.clone(), Material { law, ..LINEAR }, settings);
                assert_eq!(body.is_fast(), arithmetic.is_none());
                body.fix(&at(&body, |X| X.x < 1e-9), [true; 3], Vector3::zeros()).unwrap();
                for k in 0..8 {
                    if k == 4 {
                        body.cut(&blade, 1).unwrap();
                    }
                    let report = body.step(0.005, FALL, &[]);
                    assert_eq!(report.outcome, Outcome::Advanced, "{report:?}");
                }
                body.positions().iter().zip(body.rest_positions()).map(|(x, X)| x - X).collect::<Vec<_>>()
            });
            let largest = |u: &mut dyn Iterator<Item = f64>| u.fold(0.0, f64::max);
            let size = largest(&mut moved[1].iter().map(Vector3::norm));
            let apart = largest(&mut moved[0].iter().zip(&moved[1]).map(|(a, b)| (a - b).norm()));
            // One rotation per cell and one per quadrature point differ a little.
            let allowed = if law == Law::Linear { 1e-4 } else { 5e-3 };
            assert!(size > 1e-3 && apart < allowed * size, "{law:?} {scheme:?}: {}", apart / size);
        }
    }
}

#[test]
fn steps_have_the_same_bits_for_any_number_of_threads() {
    let run = |threads| {
        let material = Material { law: Law::Corotational, young_pa: 1e5, ..LINEAR };
        let mut body = body(unit_cube(12, 2), material, BodySettings { threads, ..BodySettings::default() });
        body.fix(&at(&body, |X| X.z < 1e-9), [true; 3], Vector3::zeros()).unwrap();
        let edge = |x: f64| [Vector3::new(x, -0.2, 0.52), Vector3::new(x, 1.2, 0.55)];
        for k in 0..10 {
            if k == 5 {
                body.cut(&BladeSweep { segments: vec![edge(-0.1), edge(0.7)] }, 1).unwrap();
            }
            body.step(0.01, Vector3::new(3.0, 0.0, -9.81), &[]);
        }
        body.positions().to_vec()
    };
    assert_eq!(run(1), run(2));
    assert_eq!(run(1), run(3));
}

/// A cut brings masses and parts up to date around the blade alone.
#[test]
fn what_follows_a_cut_locally_is_what_follows_from_the_whole_body() {
    let material = Material { law: Law::Corotational, young_pa: 1e5, ..LINEAR };
    let mut space = OctreeSpace::new(unit_cube(12, 2));
    let settings = BodySettings { method: Method::MgPcg, ..BodySettings::default() };
    let mut body = body(unit_cube(12, 2), material, settings);
    let mut parts = Vec::new();
    for (incision, (at, depth)) in
        (1..).zip([(0.31, 0.6), (0.48, 0.2), (0.48, -0.1), (0.77, 0.5), (0.2, -0.1)])
    {
        let edge = |z: f64| [Vector3::new(at, -0.1, z), Vector3::new(at + 0.05, 1.1, z)];
        let blade = BladeSweep { segments: vec![edge(1.1), edge(depth)] };
        body.cut(&blade, incision).unwrap();
        space.cut(&mut Team::alone(), &space.rest_positions(), &blade, incision).unwrap();
        let mass: Vec<f64> = space.octree().vertex_volumes().iter().map(|v| 1000.0 * v).collect();
        assert_eq!(body.masses(), mass, "incision {incision}");
        let whole = LooseParts::connected(|visit| space.for_groups(visit), &mass, &[]);
        assert_eq!(*body.parts(), whole, "incision {incision}");
        parts.push(whole.len());
    }
    assert_eq!(parts, [1, 1, 2, 2, 3]);
}

/// A cut divides leaves around the blade; undone at once, the body is as it was.
#[test]
fn undoing_a_cut_leaves_the_field_of_the_leaves_it_divided() {
    for scheme in [Scheme::ImplicitEuler, Scheme::Bdf2] {
        let material = Material { young_pa: 2e5, law: Law::Corotational, ..LINEAR };
        let mut body = body(unit_cube(16, 2), material, direct(scheme));
        let held = at(&body, |X| X.x < 1e-9);
        body.fix(&held, [true; 3], Vector3::zeros()).unwrap();
        for _ in 0..5 {
            body.step(0.02, FALL, &[]);
        }
        let before = (body.positions().to_vec(), body.velocities().to_vec(), body.elastic_energy());
        let topology = body.topology();
        let segment = |y: f64| [Vector3::new(0.2, y, 0.52), Vector3::new(1.5, y, 0.47)];
        body.cut(&BladeSweep { segments: vec![segment(-0.5), segment(1.5)] }, 1).unwrap();
        assert!(body.n_copies() > before.0.len());
        body.restore(topology).unwrap();
        assert_eq!(body.n_copies(), before.0.len());
        let apart = |a: &[Vector3<f64>], b: &[Vector3<f64>]| {
            a.iter().zip(b).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max)
        };
        let (x, v) = (apart(body.positions(), &before.0), apart(body.velocities(), &before.1));
        assert!(x < 1e-12 && v < 1e-12, "{x} m, {v} m/s");
        assert!((body.elastic_energy() / before.2 - 1.0).abs() < 1e-9);
    }
}
