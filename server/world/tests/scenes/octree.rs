//! Scenes with bodies of octree cells, from the text to the results.

use std::path::Path;

use scindo_physics::body::Method;
use scindo_world::inputs::Inputs;
use scindo_world::mesh_in::MeshHealth;
use scindo_world::results::Results;
use scindo_world::scene::Scene;
use scindo_world::simulation::Simulation;

const BLOCK: &str = r#"
    schema = 1
    [world]
    gravity_m_s2 = [0, 0, -9.81]
    [[body]]
    id = "block"
    element = "octree"
    mesh = { box = { min_m = [0, 0, 0], max_m = [0.08, 0.04, 0.04], cells = [16, 8, 8] } }
    octree = { levels = 2 }
    young_pa = 2e5
    poisson = 0.3
    density_kg_m3 = 1000
    [[body.material]]
    where = { sphere = { centre_m = [0.05, 0.02, 0.02], radius_m = 0.012 } }
    young_pa = 2e6
    density_kg_m3 = 2000
    [[body.fix]]
    where = { slab = { axis = "x", from = 0, to = 0 } }
    [[body.load]]
    where = { slab = { axis = "x", from = 1, to = 1 } }
    force_n = [0, 0, -0.01]
    [[cut]]
    body = "block"
    at_s = 0.0
    sweep_m = [[[0.031, -0.01, 0.05], [0.031, 0.05, 0.05]], [[0.031, -0.01, 0.02], [0.031, 0.05, 0.02]]]
    [[probe]]
    id = "left"
    body = "block"
    point_m = [0.031, 0.02, 0.035]
    side = [-1, 0, 0]
    [[probe]]
    id = "right"
    body = "block"
    point_m = [0.031, 0.02, 0.035]
    side = [1, 0, 0]
"#;

fn start(text: &str) -> Result<Simulation, String> {
    let scene = Scene::from_toml(text).map_err(|error| error.to_string())?;
    Simulation::new(&scene, Path::new("")).map_err(|error| error.to_string())
}

fn refused(find: &str, replace: &str, parts: &[&str]) {
    assert!(BLOCK.contains(find), "{find}");
    let message = start(&BLOCK.replace(find, replace)).map(drop).unwrap_err();
    assert!(parts.iter().all(|part| message.contains(part)), "{parts:?} in: {message}");
}

#[test]
fn a_block_sags_and_is_cut_and_its_lips_part() {
    let mut sim = start(BLOCK).unwrap();
    let (scene, directory) = (Scene::from_toml(BLOCK).unwrap(), tempfile::tempdir().unwrap());
    let mut results = Results::begin(directory.path(), &scene, &sim).unwrap();
    assert_eq!(sim.warnings(), [""; 0]);
    let Some(MeshHealth::Octree(report)) = &sim.bodies()[0].health else { panic!("cells fill the block") };
    assert!(report.leaves < 16 * 8 * 8 && report.cells_of_region[0] > 50, "{report}");
    let sphere_m3 = 4.0 / 3.0 * std::f64::consts::PI * 0.012_f64.powi(3);
    let mass = sim.bodies()[0].body.total_mass();
    assert!((mass / (1000.0 * (0.08 * 0.04 * 0.04 + sphere_m3)) - 1.0).abs() < 0.03, "{mass}");
    for _ in 0..8 {
        sim.step(&Inputs::default());
        results.record(&sim).unwrap();
    }
    assert_eq!((sim.cuts_applied(), sim.failures()), (1, Vec::<String>::new()));
    let [left, right] = [0, 1].map(|i| sim.probe_position(&sim.probes()[i]));
    assert!(right.x - left.x > 1e-4, "{left} {right}");
    let body = &sim.bodies()[0].body;
    assert!(body.surface().tags.contains(&1) && body.can_be_cut() && body.tets().is_none());
    results.finish(&sim, "done").unwrap();
    assert!(std::fs::metadata(directory.path().join("final.vtu")).unwrap().len() > 10_000);
    sim.reset().unwrap();
    assert!(!sim.step(&Inputs::default()).bodies[0].solve.is_unconverged());
}

#[test]
fn an_organ_of_cells_follows_its_surface() {
    let text = BLOCK
        .replace(
            "box = { min_m = [0, 0, 0], max_m = [0.08, 0.04, 0.04], cells = [16, 8, 8] }",
            "organ = { cells = 24 }",
        )
        .split("[[body.material]]")
        .next()
        .unwrap()
        .to_owned();
    let sim = start(&text).unwrap();
    let Some(MeshHealth::Octree(report)) = &sim.bodies()[0].health else { panic!("cells fill the organ") };
    let surface = report.surface.as_ref().unwrap();
    assert!((report.volume_m3 / surface.volume_m3 - 1.0).abs() < 0.03 && surface.is_clean(), "{report}");
    assert!((sim.bodies()[0].cell_m() - report.spacing_m).abs() < 1e-15);
}

#[test]
fn what_does_not_go_with_an_octree_is_refused() {
    refused("cells = [16, 8, 8]", "cells = [16, 8, 9]", &["mesh.box.cells", "are cubes", "[16, 8, 8]"]);
    refused("element = \"octree\"", "", &["body.block.octree", "write element = \"octree\""]);
    refused("levels = 2", "levels = 9", &["body.block.octree.levels"]);
    let pcg = ["body.block.octree.simulate_level", "found 1 with solver.method = `pcg`", "mg-pcg"];
    let with_pcg = "octree = { levels = 2, simulate_level = 1 }\n    solver = { method = \"pcg\" }";
    refused("octree = { levels = 2 }", with_pcg, &pcg);
    refused("levels = 2", "levels = 1, simulate_level = 2", &["simulate_level", "at most levels = 1"]);
    let method = "young_pa = 2e5\n    law = \"neo-hookean\"\n    solver = { method = \"multigrid\" }";
    refused("young_pa = 2e5", method, &["found `multigrid` with a law", "pcg"]);
    let xfem = "young_pa = 2e5\n    cutting = { method = \"xfem\" }";
    refused("young_pa = 2e5", xfem, &["found `xfem` with octree", "cut along links"]);
    refused(
        "young_pa = 2e5",
        "young_pa = 2e5\n    skin = {}",
        &["body.block.skin", "no faces of elements", "own"],
    );
    let bare = "where = { sphere = { centre_m = [0.05, 0.02, 0.02], radius_m = 0.012 } }\n    young_pa = 2e6\n    density_kg_m3 = 2000";
    refused(bare, "where = { slab = { axis = \"x\", from = 0, to = 1 } }", &["material of the body"]);
    refused(
        "where = { sphere",
        "surface = \"a.obj\"\n    where = { sphere",
        &["exactly one of where, surface"],
    );
    refused(
        "where = { sphere = { centre_m = [0.05, 0.02, 0.02], radius_m = 0.012 } }",
        "surface = \"none.obj\"",
        &["none.obj"],
    );
}

#[test]
fn cells_are_solved_by_multigrid_where_the_scene_leaves_it_open() {
    let plan_of = |line: &str| {
        let sim = start(&BLOCK.replace("young_pa = 2e5", &format!("young_pa = 2e5\n    {line}"))).unwrap();
        let plan = sim.plan();
        let effect = plan.effects.iter().find(|effect| effect.name == "deformation block").unwrap();
        (sim.bodies()[0].body.settings().method, effect.why.clone())
    };
    let (method, why) = plan_of("");
    assert_eq!(method, Method::MgPcg);
    assert!(why.contains("cg preconditioned by multigrid by default"), "{why}");
    let (method, why) = plan_of("solver = { method = \"mg-pcg\" }");
    assert!(method == Method::MgPcg && !why.contains("by default"), "{why}");
    assert_eq!(plan_of("solver = { method = \"pcg\" }").0, Method::Pcg);
    for line in [
        "law = \"neo-hookean\"",
        "integrator = \"symplectic-euler\"",
        "mass = \"consistent\"",
        "solver = { precision = \"double\" }",
        "solver = { tolerance = 1e-9 }",
        "solver = { newton_steps = 3 }",
    ] {
        assert_eq!(plan_of(line).0, Method::Pcg, "{line}");
    }
}

/// The lips of the cut part, and the surface is as fine, whatever level is simulated.
#[test]
fn a_coarse_level_carries_the_cut_the_surface_and_the_probes() {
    let run = |level: u8| {
        let octree = format!(
            "octree = {{ levels = 2, simulate_level = {level} }}\n    solver = {{ method = \"mg-pcg\" }}"
        );
        let mut sim =
            start(&BLOCK.replace("octree = { levels = 2 }", &octree).replace("[16, 8, 8]", "[32, 16, 16]"))
                .unwrap();
        for _ in 0..12 {
            assert!(!sim.step(&Inputs::default()).bodies[0].solve.is_unconverged());
        }
        assert_eq!((sim.cuts_applied(), sim.failures()), (1, Vec::<String>::new()));
        let [left, right] = [0, 1].map(|i| sim.probe_position(&sim.probes()[i]));
        (sim.bodies()[0].body.surface().triangles.len(), [right.x - left.x, right.z])
    };
    let (triangles, [gap, low]) = run(0);
    let mut before = 0.0;
    for level in [1, 2] {
        let (same, [wide, z]) = run(level);
        let (wide, off) = (wide / gap, (z - low).abs());
        assert_eq!(same, triangles);
        assert!(wide > 0.4 && wide < 1.05 && off > before, "level {level}: {wide} of {gap:e}, {off:e} off");
        before = off;
    }
    assert!(before < 1e-3, "{before:e}");
}

#[test]
fn hexahedra_that_are_cubes_take_the_kernels_of_cells() {
    let block = |cells: &str, more: &str| {
        let text = format!(
            "schema = 1\nworld = {{ gravity_m_s2 = [0, 0, -9.81] }}\n[[body]]\nid = \"block\"\n\
             element = \"hex8\"\nyoung_pa = 2e5\npoisson = 0.3\ndensity_kg_m3 = 1000\n{more}\n\
             mesh = {{ box = {{ min_m = [0.01, 0, 0], max_m = [0.09, 0.04, 0.06], cells = {cells}, \
             pattern = \"hex\" }} }}\nfix = [{{ where = {{ slab = {{ axis = \"x\", from = 0, to = 0 }} }} }}]\n"
        );
        start(&text)
    };
    let mut sim = block("[8, 4, 6]", "").unwrap();
    assert!(sim.bodies()[0].body.is_fast() && sim.warnings().is_empty(), "{:?}", sim.warnings());
    let why = |sim: &Simulation| {
        let plan = sim.plan();
        plan.effects.iter().find(|effect| effect.name == "deformation block").unwrap().why.clone()
    };
    assert!(why(&sim).contains("192 hex8") && why(&sim).contains("fast path"), "{}", why(&sim));
    // Numbers and surface are those of the mesh, as on the general path.
    let mut general = block("[8, 4, 6]", "solver = { precision = \"double\" }").unwrap();
    assert!(!general.bodies()[0].body.is_fast());
    for _ in 0..20 {
        sim.step(&Inputs::default());
        general.step(&Inputs::default());
    }
    let [a, b] = [&sim, &general].map(|sim| &sim.bodies()[0].body);
    assert_eq!(a.rest_positions(), b.rest_positions());
    assert_eq!(a.surface().triangles, b.surface().triangles);
    let moved = sim.bodies()[0].displacement_m();
    let apart = a.positions().iter().zip(b.positions()).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
    assert!(moved > 1e-4 && apart < 0.02 * moved, "{apart} {moved}");
    let cuboids = block("[8, 4, 7]", "").unwrap();
    assert!(why(&cuboids).contains("general path for element hex8 without equal cubes"), "{}", why(&cuboids));
    assert!(block("[8, 4, 6]", "solver = { method = \"mg-pcg\" }").is_ok());
    let message = block("[8, 4, 7]", "solver = { method = \"mg-pcg\" }").map(drop).unwrap_err();
    assert!(message.contains("hex8 on a box of equal cubes"), "{message}");
}

#[test]
fn an_equilibrium_of_corotational_cells_takes_the_fast_path() {
    let text = BLOCK
        .replace("young_pa = 2e5", "integrator = \"static\"\n    young_pa = 5e4")
        .replace("octree = { levels = 2 }", "octree = { levels = 2 }\n    solver = { tolerance = 1e-6 }");
    let mut sim = start(&text).unwrap();
    assert!(sim.bodies()[0].body.is_fast());
    assert_eq!(sim.bodies()[0].body.settings().method, Method::MgPcg);
    let solve = sim.step(&Inputs::default()).bodies[0].solve;
    assert!(!solve.is_unconverged() && solve.newton_steps > 2, "{solve:?}");
    assert!(sim.bodies()[0].displacement_m() > 1e-3);
    assert_eq!(sim.failures(), Vec::<String>::new());
}

/// A pressure follows the surface, so an equilibrium under it is searched on the general path. In motion it is taken where
/// cells move to, on the fast path, and the end is the same.
#[test]
fn an_equilibrium_of_cells_under_pressure_takes_the_general_path() {
    let pressed = BLOCK
        .replace("force_n = [0, 0, -0.01]", "pressure_pa = -1500")
        .replace("gravity_m_s2 = [0, 0, -9.81]", "gravity_m_s2 = [0, 0, 0]")
        .replace("young_pa = 2e5", "integrator = \"static\"\n    young_pa = 5e4")
        .replace("octree = { levels = 2 }", "octree = { levels = 2 }\n    solver = { tolerance = 1e-6 }");
    let mut sim = start(&pressed).unwrap();
    let plan = sim.plan();
    let why = &plan.effects.iter().find(|effect| effect.name == "deformation block").unwrap().why;
    assert!(why.contains("general path for a pressure in equilibrium"), "{why}");
    let solve = sim.step(&Inputs::default()).bodies[0].solve;
    assert!(!solve.is_unconverged(), "{solve:?}");
    let damped = "integrator = \"implicit-euler\"\n    rayleigh = { mass_1_s = 20 }";
    let mut moving = start(&pressed.replace("integrator = \"static\"", damped)).unwrap();
    assert!(moving.bodies()[0].body.is_fast());
    for _ in 0..400 {
        moving.step(&Inputs::default());
    }
    let ends = [&sim, &moving].map(|sim| &sim.bodies()[0].body);
    // Pulled out by about p L/E, and more around the cut.
    let moved = sim.bodies()[0].displacement_m();
    let apart = ends[0].positions().iter().zip(ends[1].positions()).map(|(a, b)| (a - b).norm());
    let apart = apart.fold(0.0, f64::max);
    assert!((2e-3..2e-2).contains(&moved) && apart < 0.01 * moved, "{apart} {moved}");
}
