//! Bodies on obstacles: they land, rest, slide and stick, and nothing goes through.

use std::sync::LazyLock;

use nalgebra::Vector3;
use scindo_allocations::allocations;
use scindo_physics::body::Outcome;
use scindo_tests::scene::{FLOOR, WORLD, block};
use scindo_world::inputs::Inputs;
use scindo_world::results::Results;
use scindo_world::scene::Scene;
use scindo_world::simulation::Simulation;

use crate::{start, start_with};

/// A block 5 mm above a floor.
static BLOCK: LazyLock<String> = LazyLock::new(|| {
    let corners = [[-0.05, -0.05, 0.005], [0.05, 0.05, 0.065]];
    [WORLD, &block("block", corners, [5, 5, 3], "rayleigh = { stiffness_s = 0.005 }"), FLOOR].concat()
});

/// Steps and checks what holds in every step: it advances, and nothing sinks in by more than `depth` cells.
fn steps(sim: &mut Simulation, n: usize, depth: f64) {
    for _ in 0..n {
        sim.step(&Inputs::default());
        for (i, body) in sim.bodies().iter().enumerate() {
            let report = sim.rest_report(i);
            assert_eq!(sim.report().bodies[i].solve.outcome, Outcome::Advanced);
            assert!(report.deepest_m <= depth * body.cell_m(), "step {}: {report:?}", sim.steps());
        }
    }
}

fn lowest(sim: &Simulation) -> f64 {
    sim.bodies()[0].body.positions().iter().map(|x| x.z).fold(f64::INFINITY, f64::min)
}

fn speed(sim: &Simulation) -> f64 {
    let body = &sim.bodies()[0].body;
    (2.0 * body.kinetic_energy() / body.total_mass()).sqrt()
}

#[test]
fn a_block_lands_and_comes_to_rest_on_the_floor() {
    let mut sim = start(&BLOCK);
    steps(&mut sim, 300, 0.05);
    let (body, report) = (&sim.bodies()[0].body, *sim.rest_report(0));
    let weight = 9.81 * body.total_mass();
    assert!((report.force_n.z / weight - 1.0).abs() < 1e-3, "{report:?} {weight}");
    assert!(lowest(&sim) > -0.05 * sim.bodies()[0].cell_m() && speed(&sim) < 1e-5, "{}", speed(&sim));
    // A minute later it is still where it was.
    let before = body.centre_of_mass();
    steps(&mut sim, 6000, 0.05);
    let drift = (sim.bodies()[0].body.centre_of_mass() - before).norm();
    assert!(drift < 1e-7, "{drift}");
}

#[test]
fn every_shape_stops_a_body_that_falls_on_it() {
    let shapes = [
        "box = { min_m = [-0.2, -0.2, -0.03], max_m = [0.2, 0.2, 0] }",
        "sphere = { centre_m = [0, 0, -0.5], radius_m = 0.5 }",
        "capsule = { ends_m = [[-1, 0, -0.3], [1, 0, -0.3]], radius_m = 0.3 }",
    ];
    for shape in shapes {
        let text = BLOCK.replace("half_space = { point_m = [0, 0, 0], normal = [0, 0, 1] }", shape);
        // It falls so fast that it passes a cell in a step.
        let text = text.replace("0.005], max_m", "0.505], max_m").replace("0.065], cells", "0.565], cells");
        let mut sim = start(&text);
        steps(&mut sim, 400, 0.5);
        assert!(sim.rest_report(0).deepest_m < 0.05 * sim.bodies()[0].cell_m(), "{shape}");
        assert!(lowest(&sim) > -0.03 && speed(&sim) < 0.01, "{shape}: {} {}", lowest(&sim), speed(&sim));
    }
}

#[test]
fn a_surface_from_a_file_is_an_obstacle() {
    let dir = std::env::temp_dir().join(format!("scindo-obstacle-{}", std::process::id()));
    std::fs::create_dir_all(&dir).unwrap();
    // A wedge whose triangles face inwards, in millimetres.
    let wedge = "v -200 -200 -100\nv 200 -200 -100\nv 200 200 -100\nv -200 200 -100\nv -200 0 0\nv 200 0 0\n\
                 f 1 2 3\nf 1 3 4\nf 1 6 2\nf 1 5 6\nf 4 3 6\nf 4 6 5\nf 1 4 5\nf 2 6 3\n";
    std::fs::write(dir.join("wedge.obj"), wedge).unwrap();
    let surface = "surface = { file = \"wedge.obj\", scale = 0.001 }";
    let text = BLOCK.replace("half_space = { point_m = [0, 0, 0], normal = [0, 0, 1] }", surface);
    let scene = Scene::from_toml(&text).unwrap();
    let mut sim = Simulation::new(&scene, &dir).unwrap();
    steps(&mut sim, 30, 0.5);
    assert!(sim.rest_report(0).contacts > 0, "it lies on the ridge");
    std::fs::write(dir.join("wedge.obj"), wedge.replace("f 2 6 3\n", "")).unwrap();
    let error = Simulation::new(&scene, &dir).unwrap_err().to_string();
    assert!(error.contains("obstacle.floor") && error.contains("closed surface"), "{error}");
    std::fs::remove_dir_all(&dir).unwrap();
}

/// The block on a slope whose angle is `share` of the critical one, in the frame of the slope.
fn slope(share: f64) -> String {
    let angle = (share * 0.5_f64).atan();
    let (x, z) = (9.81 * angle.sin(), -9.81 * angle.cos());
    BLOCK
        .replace("[0, 0, -9.81]", &format!("[{x}, 0, {z}]"))
        .replace("0.005], max_m", "0.0], max_m")
        .replace("0.065], cells", "0.06], cells")
        .replace("normal = [0, 0, 1] }", "normal = [0, 0, 1] }\nfriction = 0.5")
}

#[test]
fn a_block_sticks_or_slides_on_the_right_side_of_the_critical_angle() {
    let mut sim = start(&slope(0.95));
    steps(&mut sim, 400, 0.05);
    let before = sim.bodies()[0].body.centre_of_mass();
    steps(&mut sim, 1000, 0.05);
    let crept = (sim.bodies()[0].body.centre_of_mass() - before).norm();
    assert!(crept < 1e-7, "{crept}");

    let mut sim = start(&slope(1.05));
    steps(&mut sim, 200, 0.05);
    let before = sim.bodies()[0].body.momentum().x;
    steps(&mut sim, 200, 0.05);
    let body = &sim.bodies()[0].body;
    let found = (body.momentum().x - before) / body.total_mass() / 2.0;
    let angle = (1.05 * 0.5_f64).atan();
    let expected = 9.81 * (angle.sin() - 0.5 * angle.cos());
    assert!((found / expected - 1.0).abs() < 0.02, "{found} {expected}");
}

#[test]
fn octree_bodies_and_nonlinear_laws_rest_too() {
    for (key, value) in [
        ("young_pa = 2e4", "young_pa = 2e4\n element = \"octree\""),
        ("young_pa = 2e4", "young_pa = 2e4\n law = \"neo-hookean\""),
    ] {
        let text = BLOCK.replace(key, value).replace("cells = [5, 5, 3]", "cells = [10, 10, 6]");
        let mut sim = start(&text);
        steps(&mut sim, 150, 0.1);
        let report = sim.rest_report(0);
        let weight = 9.81 * sim.bodies()[0].body.total_mass();
        assert!((report.force_n.z / weight - 1.0).abs() < 1e-2, "{value}: {report:?} {weight}");
    }
}

#[test]
fn threads_change_no_bit_a_reset_starts_anew_and_a_steady_step_allocates_nothing() {
    let text = slope(1.05);
    let [mut one, mut two] = [1, 2].map(|threads| start_with(&text, threads));
    for sim in [&mut one, &mut two] {
        steps(sim, 60, 0.05);
    }
    assert_eq!(one.bodies()[0].body.positions(), two.bodies()[0].body.positions());
    let now = one.bodies()[0].body.positions().to_vec();
    one.reset().unwrap();
    assert_eq!(one.rest_report(0).contacts, 0);
    steps(&mut one, 60, 0.05);
    assert_eq!(one.bodies()[0].body.positions(), now);
    let before = allocations();
    steps(&mut one, 20, 0.05);
    assert_eq!(allocations() - before, 0);
}

#[test]
fn without_obstacles_nothing_changes() {
    let free = BLOCK.split("[[obstacle]]").next().unwrap();
    let off = BLOCK.replace("world =", "effects = { obstacles = false }\nworld =");
    for text in [free, &off] {
        let mut sim = start(text);
        steps(&mut sim, 10, 0.0);
        assert_eq!(sim.bodies()[0].body.spring_forces().len(), 0);
        assert!(!sim.plan().is_on("obstacles"));
        let v = sim.bodies()[0].body.momentum() / sim.bodies()[0].body.total_mass();
        assert!((v - Vector3::new(0.0, 0.0, -0.981)).norm() < 1e-9, "{v}");
    }
}

#[test]
fn what_begins_in_an_obstacle_is_told_and_what_lies_on_one_is_no_loose_body() {
    assert_eq!(start(&BLOCK).warnings(), &[] as &[String]);
    let inside = start(&BLOCK.replace("point_m = [0, 0, 0]", "point_m = [0, 0, 0.03]"));
    assert!(inside.warnings()[0].contains("begins inside the obstacle `floor`"), "{:?}", inside.warnings());
    let beside = start(
        &BLOCK.replace("normal = [0, 0, 1]", "normal = [1, 0, 0]").replace("point_m = [0,", "point_m = [-1,"),
    );
    assert!(beside.warnings()[0].contains("nothing holds the body"), "{:?}", beside.warnings());
    let other = BLOCK[BLOCK.find("[[body]]").unwrap()..BLOCK.find("[[obstacle]]").unwrap()]
        .replace("\"block\"", "\"twin\"");
    let twins =
        format!("{}{other}", *BLOCK).replace("world =", "effects = { body_collision = true }\nworld =");
    let twins = start(&twins.replacen("min_m = [-0.05", "min_m = [-0.03", 1));
    assert!(twins.warnings().iter().any(|w| w.contains("begins inside `")), "{:?}", twins.warnings());
}

#[test]
fn forces_of_contact_are_written_step_by_step() {
    let directory = std::env::temp_dir().join(format!("scindo-contacts-{}", std::process::id()));
    let scene = Scene::from_toml(&BLOCK).unwrap();
    let mut sim = start(&BLOCK);
    let mut results = Results::begin(&directory, &scene, &sim).unwrap();
    for _ in 0..100 {
        sim.step(&Inputs::default());
        results.record(&sim).unwrap();
    }
    results.finish(&sim, "done").unwrap();
    let text = std::fs::read_to_string(directory.join("contacts.csv")).unwrap();
    let header = "step,time_s,kind,on,by,contacts,deepest_m,fx_n,fy_n,fz_n,normal_n";
    assert_eq!(text.lines().next(), Some(header));
    let last: Vec<&str> = text.lines().last().unwrap().split(',').collect();
    assert_eq!((last[0], &last[2..5]), ("100", &["obstacle", "block", "floor"][..]));
    let weight = 9.81 * sim.bodies()[0].body.total_mass();
    assert!((last[9].parse::<f64>().unwrap() / weight - 1.0).abs() < 0.01, "{last:?} {weight}");
    // It falls for the first steps.
    assert!(text.lines().count() < 100);
    std::fs::remove_dir_all(&directory).unwrap();
}
