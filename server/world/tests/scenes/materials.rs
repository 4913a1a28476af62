//! Regions of other materials in bodies of tetrahedra and hexahedra, from the scene to the results.

#![allow(non_snake_case)] // the symbols of the field: X

use std::path::Path;

use nalgebra::Vector3;
use scindo_physics::mesh::{BoxPattern, TetMesh, box_mesh};
use scindo_world::format::{CellGroup, GMSH_PHYSICAL, MeshFile, read_mesh};
use scindo_world::inputs::Inputs;
use scindo_world::mesh_in::write_mesh;
use scindo_world::results::Results;
use scindo_world::scene::Scene;
use scindo_world::simulation::Simulation;

/// A bar of 0.1 m × 0.02 m × 0.02 m, pulled with 1 N. `MESH` and `MATERIAL` are replaced.
const BAR: &str = r#"
    schema = 1
    [world]
    gravity_m_s2 = [0, 0, 0]
    [[body]]
    id = "bar"
    mesh = MESH
    law = "linear"
    integrator = "static"
    young_pa = 1e5
    poisson = 0.0
    density_kg_m3 = 1000
    solver = { tolerance = 1e-6 }
    [[body.material]]
    MATERIAL
    young_pa = 4e5
    density_kg_m3 = 3000
    [[body.fix]]
    where = { slab = { axis = "x", from = 0, to = 0 } }
    [[body.load]]
    where = { slab = { axis = "x", from = 1, to = 1 } }
    force_n = [1, 0, 0]
"#;
const SIZE: [f64; 3] = [0.1, 0.02, 0.02];

fn bar(mesh: &str, material: &str) -> String {
    BAR.replace("MESH", mesh).replace("MATERIAL", material)
}

fn boxed(pattern: &str) -> String {
    format!("{{ box = {{ min_m = [0, 0, 0], max_m = {SIZE:?}, cells = [10, 2, 2]{pattern} }} }}")
}

fn start(text: &str, folder: &Path) -> Result<Simulation, String> {
    let scene = Scene::from_toml(text).map_err(|error| error.to_string())?;
    Simulation::new(&scene, folder).map_err(|error| error.to_string())
}

/// The mesh of the bar in millimetres, and its half beyond the middle.
fn halves() -> (TetMesh, Vec<u32>) {
    let size = Vector3::from(SIZE) * 1000.0;
    let mesh = box_mesh(Vector3::zeros(), size, [10, 2, 2], BoxPattern::Tet6);
    let centre = |e: &u32| mesh.corners(*e as usize).iter().map(|x| x.x).sum::<f64>() / 4.0;
    let far = (0..mesh.tets.len() as u32).filter(|e| centre(e) > 50.0).collect();
    (mesh, far)
}

fn group(number: i64, name: &str, tets: Vec<u32>) -> CellGroup {
    CellGroup { array: GMSH_PHYSICAL.into(), number, name: Some(name.into()), tets }
}

/// How far the end of the bar has moved, relative to two halves in series, F L / (E A) each.
fn stretch(simulation: &mut Simulation) -> f64 {
    simulation.step(&Inputs::default());
    let body = &simulation.bodies()[0].body;
    let area = SIZE[1] * SIZE[2];
    let exact = SIZE[0] / 2.0 / area * (1.0 / 1e5 + 1.0 / 4e5);
    let ends = body.positions().iter().zip(body.rest_positions()).filter(|(_, X)| X.x > SIZE[0] - 1e-9);
    let (sum, n) = ends.fold((0.0, 0), |(sum, n), (x, X)| (sum + x.x - X.x, n + 1));
    sum / f64::from(n) / exact
}

#[test]
fn every_way_to_name_a_region_gives_the_same_bar() {
    let folder = tempfile::tempdir().unwrap();
    let (mesh, far) = halves();
    let near: Vec<u32> = (0..mesh.tets.len() as u32).filter(|e| !far.contains(e)).collect();
    let groups = [group(3, "soft half", near), group(8, "stiff half", far)];
    write_mesh(&folder.path().join("bar.msh"), &mesh, &groups).unwrap();
    write_mesh(&folder.path().join("bar.vtu"), &mesh, &groups).unwrap();
    let file = |name: &str| format!("{{ file = \"{name}\", scale = 0.001 }}");
    let slab = "where = { slab = { axis = \"x\", from = 0.5, to = 1.0 } }";
    let half_space = "where = { half_space = { point_m = [0.05, 0, 0], normal = [1, 0, 0] } }";
    let ways = [
        (boxed(""), slab.to_owned()),
        (boxed(", pattern = \"hex\""), half_space.to_owned()),
        (file("bar.msh"), "group = \"stiff half\"".to_owned()),
        (file("bar.msh"), "group = \"8\"".to_owned()),
        (file("bar.vtu"), format!("group = \"8\"\narray = \"{GMSH_PHYSICAL}\"")),
    ];
    for (mesh, material) in ways {
        for element in ["", "element = \"tet10\"\n"] {
            let is_hex = mesh.contains("\"hex\"");
            let element = if is_hex { "element = \"hex8\"\n" } else { element };
            let text = bar(&mesh, &material).replace("law =", &format!("{element}law ="));
            let mut simulation = start(&text, folder.path()).unwrap();
            assert!(simulation.warnings().is_empty(), "{:?}", simulation.warnings());
            let found = stretch(&mut simulation);
            assert!((found - 1.0).abs() < 1e-4, "{material} {element}: {found}");
            let mass: f64 = simulation.bodies()[0].body.masses().iter().sum();
            let expected = SIZE.iter().product::<f64>() * 2000.0;
            assert!((mass / expected - 1.0).abs() < 1e-9, "{material} {element}: {mass} kg");
        }
    }
}

#[test]
fn results_tell_the_material_of_every_cell() {
    let folder = tempfile::tempdir().unwrap();
    let text = bar(&boxed(""), "where = { slab = { axis = \"x\", from = 0.5, to = 1.0 } }");
    let scene = Scene::from_toml(&text).unwrap();
    let mut simulation = Simulation::new(&scene, folder.path()).unwrap();
    let mut results = Results::begin(folder.path(), &scene, &simulation).unwrap();
    simulation.step(&Inputs::default());
    results.record(&simulation).unwrap();
    results.finish(&simulation, "done").unwrap();
    let MeshFile::Volume(volume) = read_mesh(&folder.path().join("final.vtu")).unwrap() else { panic!() };
    let region = |number: i64| {
        let found = volume.groups.iter().find(|group| group.array == "region" && group.number == number);
        found.unwrap().tets.len()
    };
    assert_eq!([region(0), region(1)], [100, 100]);
}

#[test]
fn regions_that_cannot_be_found_are_explained() {
    let folder = tempfile::tempdir().unwrap();
    let (mesh, far) = halves();
    write_mesh(&folder.path().join("bar.msh"), &mesh, &[group(8, "stiff half", far)]).unwrap();
    let file = "{ file = \"bar.msh\", scale = 0.001 }";
    let refused = |material: &str, parts: &[&str]| {
        let message = start(&bar(file, material), folder.path()).map(drop).unwrap_err();
        assert!(parts.iter().all(|part| message.contains(part)), "{parts:?} in: {message}");
    };
    refused(
        "group = \"tumor\"",
        &["body.bar.material.0", "found group \"tumor\", allowed here: \"stiff half\""],
    );
    refused("group = \"3\"", &["found group \"3\""]);
    refused("group = \"8\"\narray = \"label\"", &["found group \"8\""]);
    refused("surface = \"none.stl\"", &["body.bar.material.0", "none.stl"]);
    refused("surface = \"bar.msh\"", &["a closed surface is needed here"]);
    let outside = bar(&boxed(""), "where = { sphere = { centre_m = [9, 9, 9], radius_m = 0.1 } }");
    let simulation = start(&outside, folder.path()).unwrap();
    let warnings = simulation.warnings();
    assert!(
        warnings.iter().any(|doubt| doubt.contains("material.0: no element has its centre")),
        "{warnings:?}"
    );
}

/// Palpation: the finger presses equally deep beside the stiff ball and above it, and above soft tissue in its place.
#[test]
fn a_finger_feels_the_stiff_ball_in_the_example() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/tumour.toml");
    let start = |set: &[String]| {
        let scene = Scene::load_with(&path, set).unwrap();
        Simulation::new(&scene, path.parent().unwrap()).unwrap()
    };
    let (mut stiff, mut soft) = (start(&[]), start(&["body.organ.material.0.young_pa=15e3".to_owned()]));
    let force_at = |simulation: &mut Simulation, time_s: f64| {
        while simulation.time_s() < time_s {
            simulation.step(&Inputs::default());
        }
        simulation.tools().iter().next().unwrap().force_n.norm()
    };
    let beside = force_at(&mut stiff, 1.8);
    let above = force_at(&mut stiff, 4.8);
    let without = force_at(&mut soft, 4.8);
    assert!(beside > 0.4 && above > 1.7 * beside, "{beside} N beside, {above} N above");
    assert!(above > 1.35 * without, "{without} N without the ball, {above} N with it");
}
