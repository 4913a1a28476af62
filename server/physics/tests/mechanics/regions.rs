//! Regions of other materials in bodies of tetrahedra and hexahedra.

use nalgebra::Vector3;
use scindo_allocations::allocations;
use scindo_physics::assembly::{Model, ModelError, Volumetric};
use scindo_physics::body::estimate::StressRecovery;
use scindo_physics::body::{
    Ablation, Arithmetic, Body, BodyError, BodySettings, CuttingMethod, Outcome, PcgSettings, Scheme,
};
use scindo_physics::cut::BladeSweep;
use scindo_physics::element::ElementKind;
use scindo_physics::material::{Law, Material, Rayleigh, Region, Regions, RegionsError};
use scindo_physics::mesh::{BoxPattern, HexMesh, TetMesh, box_hexes, box_mesh};
use scindo_physics::space::Tets;

/// Of the body. Its Poisson's ratio is 0, so that bars stretch without thinning.
const SOFT: Material = Material {
    young_pa: 1e5,
    poisson: 0.0,
    density_kg_m3: 1000.0,
    rayleigh: Rayleigh { mass_1_s: 0.0, stiffness_s: 0.0 },
    law: Law::Linear,
};

/// Of the region.
const STIFF: Region = Region { young_pa: 4e5, poisson: 0.0, density_kg_m3: 3000.0 };

/// Size of the bar [m].
const SIZE: Vector3<f64> = Vector3::new(1.0, 0.25, 0.25);

fn tets() -> TetMesh {
    box_mesh(Vector3::zeros(), SIZE, [8, 2, 2], BoxPattern::Tet6)
}

/// The tetrahedra or hexahedra with their centres beyond half of `axis` are stiff.
fn beyond_half(axis: usize, centres: impl Iterator<Item = Vector3<f64>>, stiff: Region) -> Regions {
    let inside = |centre: Vector3<f64>| u16::from(centre[axis] > SIZE[axis] / 2.0);
    Regions::new(vec![stiff], centres.map(inside).collect()).unwrap()
}

fn centres(mesh: &TetMesh) -> impl Iterator<Item = Vector3<f64>> + '_ {
    (0..mesh.tets.len()).map(|e| mesh.corners(e).iter().sum::<Vector3<f64>>() / 4.0)
}

fn hex_centres(mesh: &HexMesh) -> impl Iterator<Item = Vector3<f64>> + '_ {
    (0..mesh.hexes.len()).map(|e| mesh.corners(e).iter().sum::<Vector3<f64>>() / 8.0)
}

/// Bodies of every element and way to solve whose half beyond the middle of `axis` is stiff.
fn bodies(axis: usize, material: Material, stiff: Region, settings: BodySettings) -> Vec<Body> {
    let mesh = tets();
    let regions = beyond_half(axis, centres(&mesh), stiff);
    let hexes = box_hexes(Vector3::zeros(), SIZE, [8, 2, 2]);
    let mut made = Vec::new();
    for arithmetic in [Arithmetic::Single, Arithmetic::Double] {
        let settings = BodySettings { arithmetic: Some(arithmetic), ..settings };
        made.push(Body::with_regions(mesh.clone(), regions.clone(), material, settings).unwrap());
        let mut cubes = Tets::hexahedra(hexes.clone()).unwrap();
        cubes.set_regions(beyond_half(axis, hex_centres(&hexes), stiff)).unwrap();
        made.push(Body::of_space(Box::new(cubes), material, settings).unwrap());
    }
    let quadratic = BodySettings { element: ElementKind::Tet10, ..settings };
    made.push(Body::with_regions(mesh, regions, material, quadratic).unwrap());
    made
}

fn nodes_at(body: &Body, x: f64) -> Vec<u32> {
    let at = |(_, X): &(u32, &Vector3<f64>)| (X.x - x).abs() < 1e-9;
    (0..).zip(body.rest_positions()).filter(at).map(|(n, _)| n).collect()
}

fn equilibrium() -> BodySettings {
    let solver = PcgSettings { iterations: 2000, tolerance: 1e-6 };
    BodySettings { scheme: Scheme::Static, solver, ..BodySettings::default() }
}

/// Two bars one after the other: each stretches by F L / (E A).
#[test]
fn bars_in_series_stretch_as_their_moduli() {
    for mut body in bodies(0, SOFT, STIFF, equilibrium()) {
        let (held, end) = (nodes_at(&body, 0.0), nodes_at(&body, 1.0));
        body.fix(&held, [true; 3], Vector3::zeros()).unwrap();
        let force = 100.0;
        body.add_surface_force(&end, Vector3::new(force, 0.0, 0.0)).unwrap();
        let report = body.step(1.0, Vector3::zeros(), &[]);
        assert_eq!(report.outcome, Outcome::Advanced, "{report:?}");
        let strain = |young: f64| force / (young * SIZE.y * SIZE.z);
        let exact = |X: f64| strain(SOFT.young_pa) * X.min(0.5) + strain(STIFF.young_pa) * (X - 0.5).max(0.0);
        for (x, X) in body.positions().iter().zip(body.rest_positions()) {
            let apart = (x - X - Vector3::new(exact(X.x), 0.0, 0.0)).norm();
            let (element, fast) = (body.settings().element, body.is_fast());
            assert!(apart < 2e-5 * exact(1.0), "{element:?} {fast}: {apart:e} at {X:?}");
        }
        // ½ F u at the end.
        let energy = 0.5 * force * exact(1.0);
        assert!((body.elastic_energy() / energy - 1.0).abs() < 1e-4);
    }
}

#[test]
fn a_dense_region_weighs_more() {
    let gravity = Vector3::new(0.0, 0.0, -9.81);
    let volume = SIZE.product();
    let (light, heavy) = (SOFT.density_kg_m3 * volume / 2.0, STIFF.density_kg_m3 * volume / 2.0);
    for mut body in bodies(0, SOFT, STIFF, equilibrium()) {
        let element = body.settings().element;
        let mass: f64 = body.masses().iter().sum();
        assert!((mass / (light + heavy) - 1.0).abs() < 1e-12, "{element:?}");
        let centre = (0.25 * light + 0.75 * heavy) / (light + heavy);
        assert!((body.centre_of_mass().x / centre - 1.0).abs() < 1e-12, "{element:?}");
        let held = nodes_at(&body, 0.0);
        body.fix(&held, [true; 3], Vector3::zeros()).unwrap();
        assert_eq!(body.step(1.0, gravity, &[]).outcome, Outcome::Advanced);
        let reaction = body.reaction(&held, gravity).z;
        assert!((reaction / (9.81 * (light + heavy)) - 1.0).abs() < 1e-4, "{element:?}: {reaction}");
    }
}

/// A swinging bar of two materials after 0.2 s in steps of `h` [s], cut across both after half of them.
fn swing(settings: BodySettings, mesh: &TetMesh, h: f64) -> Body {
    let material = Material { law: Law::Corotational, poisson: 0.3, ..SOFT };
    let stiff = Region { poisson: 0.45, ..STIFF };
    let regions = beyond_half(2, centres(mesh), stiff);
    let mut body = Body::with_regions(mesh.clone(), regions, material, settings).unwrap();
    let held = nodes_at(&body, 0.0);
    body.fix(&held, [true; 3], Vector3::zeros()).unwrap();
    let steps = (0.2 / h).round() as usize;
    for step in 0..steps {
        if 2 * step == steps {
            let segment = |z: f64| [Vector3::new(0.47, -0.1, z), Vector3::new(0.47, 0.4, z - 0.1)];
            let sweep = BladeSweep { segments: vec![segment(0.4), segment(0.05)] };
            assert!(body.cut(&sweep, 1).unwrap().elements_cut > 8);
        }
        let report = body.step(h, Vector3::new(0.0, 0.0, -9.81), &[]);
        assert_eq!(report.outcome, Outcome::Advanced);
    }
    body
}

#[test]
fn the_fast_path_moves_a_cut_bar_of_two_materials_as_the_general_one() {
    let mesh = box_mesh(Vector3::zeros(), SIZE, [16, 4, 4], BoxPattern::Tet6);
    let solver = PcgSettings { iterations: 500, tolerance: 1e-8 };
    // Single precision leaves twists out where they hardly matter to a step.
    for (twists, h) in [(true, 0.01), (false, 0.0025)] {
        let ablation = Ablation { twists, ..Ablation::default() };
        let with = |arithmetic, threads| {
            let settings = BodySettings {
                arithmetic: Some(arithmetic),
                solver,
                threads,
                ablation,
                ..BodySettings::default()
            };
            swing(settings, &mesh, h)
        };
        let (fast, general) = (with(Arithmetic::Single, 1), with(Arithmetic::Double, 1));
        assert!(fast.is_fast() && !general.is_fast());
        let moved = |body: &Body| {
            let moved = body.positions().iter().zip(body.rest_positions()).map(|(x, X)| (x - X).norm());
            moved.fold(0.0, f64::max)
        };
        let apart = fast.positions().iter().zip(general.positions()).map(|(a, b)| (a - b).norm());
        let apart = apart.fold(0.0, f64::max);
        assert!(moved(&general) > 0.01 && apart < 1e-4 * moved(&general), "{apart:e} of {}", moved(&general));
        assert_eq!(with(Arithmetic::Single, 3).positions(), fast.positions());
    }
}

/// The stress of bars side by side jumps where they meet; this is no error of the mesh.
#[test]
fn recovered_stress_does_not_reach_into_another_material() {
    let mesh = tets();
    let regions = beyond_half(2, centres(&mesh), STIFF);
    let one = Body::new(mesh.clone(), SOFT, BodySettings::default()).unwrap();
    let two = Body::with_regions(mesh, regions, SOFT, BodySettings::default()).unwrap();
    let stretched: Vec<_> = one.rest_positions().iter().map(|X| Vector3::new(1.01 * X.x, X.y, X.z)).collect();
    let estimate = |mut body: Body| {
        body.set_state(&stretched, &vec![Vector3::zeros(); stretched.len()]).unwrap();
        body.mesh_error(&mut StressRecovery::default()).unwrap()
    };
    let (one, two) = (estimate(one), estimate(two));
    assert!(two.eta < 1e-10 * two.energy_norm, "{two:?}");
    assert!((two.energy_norm.powi(2) / one.energy_norm.powi(2) - 2.5).abs() < 1e-9, "{one:?} {two:?}");
}

#[test]
fn a_steady_step_of_two_materials_allocates_nothing() {
    let mesh = tets();
    let regions = beyond_half(0, centres(&mesh), STIFF);
    let material = Material { law: Law::Corotational, ..SOFT };
    let mut body = Body::with_regions(mesh, regions, material, BodySettings::default()).unwrap();
    let held = nodes_at(&body, 0.0);
    body.fix(&held, [true; 3], Vector3::zeros()).unwrap();
    let mut steps = |n: usize| {
        (0..n).for_each(|_| assert_eq!(body.step(0.01, crate::DOWN, &[]).outcome, Outcome::Advanced));
    };
    steps(3);
    let before = allocations();
    steps(5);
    assert_eq!(allocations(), before);
}

#[test]
fn regions_that_do_not_fit_are_refused() {
    let mesh = tets();
    let regions = beyond_half(0, centres(&mesh), STIFF);
    let settings = BodySettings::default();
    let short = Regions::new(vec![STIFF], vec![1; 3]).unwrap();
    let refused = Body::with_regions(mesh.clone(), short, SOFT, settings).unwrap_err();
    let expected = mesh.tets.len();
    assert!(
        matches!(refused, BodyError::Regions(RegionsError::Length { found: 3, expected: e }) if e == expected)
    );
    let along_faces = BodySettings { cutting: CuttingMethod::Snap, ..settings };
    let refused = Body::with_regions(mesh.clone(), regions.clone(), SOFT, along_faces).unwrap_err();
    assert!(matches!(refused, BodyError::Combination { .. }), "{refused}");
    let averaged = Volumetric::NodeAveraged { kept: 0.05 };
    let model = Model::tet4(&mesh, &SOFT, averaged).unwrap();
    assert_eq!(model.with_regions(regions).unwrap_err(), ModelError::AveragedRegions);

    let unknown = Regions::new(vec![STIFF], vec![0, 2]).unwrap_err();
    assert_eq!(unknown.to_string(), "element 1 is of region 2, but there are 1 regions");
    let broken = Region { poisson: 0.5, ..STIFF };
    let refused = Regions::new(vec![STIFF, broken], vec![0, 2]).unwrap_err();
    assert!(refused.to_string().starts_with("region 2: poisson = 5e-1 is outside"), "{refused}");
    assert!(Regions::new(vec![STIFF], vec![0; 4]).unwrap().is_empty(), "no element is of the region");
}
