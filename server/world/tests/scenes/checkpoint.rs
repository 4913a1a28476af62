//! A simulation that is restored from a checkpoint goes on with the same bits, on any number of threads.

use std::ops::Range;
use std::path::Path;
use std::sync::{Arc, LazyLock};

use nalgebra::{Isometry3, Vector3};
use scindo_tests::scene::{WORLD, block, cut, held};
use scindo_world::assemble::BuildOptions;
use scindo_world::inputs::{CutRequest, Inputs, ToolInput, ToolMode, ToolShape};
use scindo_world::scene::Scene;
use scindo_world::simulation::{CheckpointError, Simulation};

const THREADS: [usize; 3] = [1, 2, 3];

fn start(scene: &Scene, threads: usize) -> Simulation {
    let options = BuildOptions { threads, portable: false };
    Simulation::with_options(scene, scene.base_dir(), options).unwrap()
}

/// Steps that are compared after a restore.
const COMPARED: u64 = 25;

/// Runs `steps` steps with `inputs`, takes checkpoints at `at`, and goes on from each of them: in a fresh
/// simulation, and in the one that has gone on to the end. Returns the size of the last checkpoint [byte].
fn goes_on(scene: &Scene, steps: u64, at: &[u64], inputs: &dyn Fn(u64) -> Inputs) -> usize {
    let mut first = start(scene, 1);
    let (mut hashes, mut kept) = (Vec::new(), Vec::new());
    for step in 0..steps {
        if at.contains(&step) {
            kept.push((step, first.checkpoint().unwrap()));
        }
        first.step(&inputs(step));
        hashes.push(first.state_hash());
    }
    let mut fresh: Vec<Simulation> = THREADS.map(|threads| start(scene, threads)).into();
    fresh.push(first);
    for (index, (from, checkpoint)) in kept.iter().enumerate() {
        // The last simulation, and one of the others in turn.
        for which in [index % THREADS.len(), THREADS.len()] {
            let simulation = &mut fresh[which];
            simulation.restore(checkpoint).unwrap();
            assert_eq!(simulation.steps(), *from);
            for step in *from..steps.min(from + COMPARED) {
                simulation.step(&inputs(step));
                let same = simulation.state_hash() == hashes[step as usize];
                assert!(same, "from step {from}, simulation {which}: step {step} of {steps} differs");
            }
        }
    }
    kept.last().map_or(0, |(_, checkpoint)| checkpoint.len())
}

/// `n` different numbers below `below`, the same in every run.
fn random(n: usize, below: u64) -> Vec<u64> {
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    let mut numbers: Vec<u64> = Vec::new();
    while numbers.len() < n {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        let number = (state >> 33) % below;
        if !numbers.contains(&number) {
            numbers.push(number);
        }
    }
    numbers.sort_unstable();
    numbers
}

fn nothing(_: u64) -> Inputs {
    Inputs::default()
}

static BLOCK: LazyLock<String> = LazyLock::new(|| {
    let keys = "rayleigh = { stiffness_s = 0.02 }\n".to_owned() + &held("z");
    WORLD.to_owned() + &block("block", [[0.0; 3], [0.2, 0.1, 0.1]], [14, 7, 7], &keys)
});

/// A ball that presses and a cut of a client in every second step.
fn press_and_cut(step: u64) -> Inputs {
    let phase = step as f64 * 0.05;
    let tip = Vector3::new(0.1 + 0.05 * phase.sin(), 0.05, 0.103 - 0.006 * (0.3 * phase).sin());
    let ball = ToolInput {
        mode: if step % 60 < 30 { ToolMode::Touch } else { ToolMode::Grab },
        shape: Some(ToolShape::Sphere { radius_m: 0.01 }),
        seq: step,
        ..ToolInput::new("finger", "hand", Isometry3::translation(tip.x, tip.y, tip.z))
    };
    // Slits along x and y in turn, at places that fill the top evenly.
    let n = (step / 2) as f64;
    let (x, y) = (0.2 * (n * 0.618_034).fract(), 0.1 * (n * 0.754_878).fract());
    let along = if step.is_multiple_of(4) { Vector3::x() } else { Vector3::y() };
    let edge = |s: f64| {
        let place = Vector3::new(x, y, 0.0) + along * s;
        [place + Vector3::z() * 0.06, place + Vector3::z() * 0.12]
    };
    let cut = CutRequest {
        request: step,
        tool: Arc::from("knife"),
        body: None,
        segments: vec![edge(-0.008), edge(0.0), edge(0.008)],
    };
    Inputs {
        tools: vec![ball],
        cuts: if step.is_multiple_of(2) { vec![cut] } else { Vec::new() },
        ..Inputs::default()
    }
}

fn run(simulation: &mut Simulation, steps: Range<u64>) {
    for step in steps {
        simulation.step(&press_and_cut(step));
    }
}

/// Steps of the session with a hundred cuts.
const SESSION: u64 = 400;

#[test]
fn a_session_with_a_hundred_cuts_goes_on_from_twenty_random_steps() {
    let scene = Scene::from_toml(&BLOCK).unwrap();
    let mut counted = start(&scene, 2);
    run(&mut counted, 0..SESSION);
    assert!(counted.cuts_applied() >= 100, "only {} cuts were made", counted.cuts_applied());
    let bytes = goes_on(&scene, SESSION, &random(20, SESSION - 5), &press_and_cut);
    println!("checkpoint: {bytes} bytes of {} copies", counted.bodies()[0].body.n_copies());
}

#[test]
fn quadratic_elements_that_are_cut_go_on() {
    let block = BLOCK.replace("[14, 7, 7]", "[6, 3, 3]").replace("young_pa", "element = \"tet10\"\nyoung_pa");
    let scene = Scene::from_toml(&block).unwrap();
    let mut counted = start(&scene, 2);
    for step in 0..200 {
        let solve = &counted.step(&press_and_cut(step)).bodies[0].solve;
        assert!(solve.notice.is_none() && !solve.is_unconverged(), "step {step}: {solve:?}");
    }
    assert!(counted.cuts_applied() >= 50, "only {} cuts were made", counted.cuts_applied());
    goes_on(&scene, 60, &random(4, 55), &press_and_cut);
}

#[test]
fn a_pressure_that_changes_and_follows_the_surface_goes_on() {
    let side = "[[body.load]]\nwhere = { slab = { axis = \"x\", from = 1, to = 1 } }\npressure_pa = 300\n";
    let text = format!("{}{side}table = [[0, 0], [0.1, 1], [0.3, 0.2]]\n", *BLOCK);
    goes_on(&Scene::from_toml(&text).unwrap(), 40, &random(4, 30), &press_and_cut);
}

/// A scene of the folder `scenes`.
fn example(name: &str) -> Scene {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    Scene::load(&folder.join(format!("{name}.toml"))).unwrap()
}

#[test]
fn cells_that_are_cut_and_adapted_go_on() {
    for name in ["probed-block", "slices", "three-cuts"] {
        goes_on(&example(name), 60, &random(3, 50), &nothing);
    }
}

#[test]
fn blades_forceps_and_scripts_go_on() {
    for name in ["cut-with-force", "two-hands", "cut-along-faces", "kidney", "vessel", "tendon"] {
        goes_on(&example(name), 120, &random(3, 100), &nothing);
    }
}

#[test]
fn every_way_of_computing_goes_on() {
    for name in [
        "ringing-bar",
        "swinging-bar",
        "relaxing-block",
        "relaxing-cuts",
        "fingertip",
        "half-cut-equilibrium",
    ] {
        goes_on(&example(name), 40, &random(3, 30), &nothing);
    }
}

/// Three blocks: one rests with friction on a slope and carries another; the third folds onto itself.
fn pile() -> String {
    let damped = "rayleigh = { stiffness_s = 0.02 }";
    [
        r#"
schema = 1
world = { gravity_m_s2 = [0, 0, -9.81], step_s = 0.01, contact = { friction = 0.4 } }
effects = { body_collision = true, self_collision = true, sleep = true }
obstacle = [{ id = "floor", half_space = { point_m = [0, 0, 0], normal = [0.1, 0, 1] }, friction = 0.5 }]
"#,
        &block("lower", [[0.0, 0.0, 0.01], [0.1, 0.1, 0.06]], [4, 4, 2], damped),
        &block("upper", [[0.02, 0.02, 0.065], [0.08, 0.08, 0.11]], [3, 3, 2], damped),
        &block(
            "cells",
            [[0.2, 0.0, 0.0], [0.3, 0.1, 0.08]],
            [5, 5, 4],
            &format!("element = \"octree\"\n{damped}"),
        ),
        &cut("cells", 0.1, [[[0.25, -0.1, 0.03], [0.25, -0.1, 0.2]], [[0.25, 0.2, 0.03], [0.25, 0.2, 0.2]]]),
    ]
    .concat()
}

#[test]
fn bodies_that_touch_and_stick_go_on() {
    goes_on(&Scene::from_toml(&pile()).unwrap(), 150, &random(6, 140), &nothing);
}

#[test]
fn damaged_and_foreign_checkpoints_are_refused_and_change_nothing() {
    let scene = Scene::from_toml(&BLOCK).unwrap();
    let mut sim = start(&scene, 1);
    run(&mut sim, 0..5);
    let (good, hash) = (sim.checkpoint().unwrap(), sim.state_hash());
    assert!(matches!(sim.restore(b"something else"), Err(CheckpointError::Foreign { .. })));
    for length in random(40, good.len() as u64) {
        assert!(sim.restore(&good[..length as usize]).is_err(), "{length} bytes of it");
    }
    for at in random(200, good.len() as u64) {
        let mut bad = good.clone();
        bad[at as usize] ^= 0x10;
        assert!(sim.restore(&bad).is_err(), "byte {at} was changed");
    }
    let mut other = start(&Scene::from_toml(&BLOCK.replace("\"block\"", "\"liver\"")).unwrap(), 1);
    let refused = other.restore(&good).unwrap_err();
    assert!(matches!(refused, CheckpointError::Bodies { .. }), "{refused}");
    assert_eq!(sim.state_hash(), hash);
    sim.restore(&good).unwrap();
    assert_eq!(sim.state_hash(), hash);
}

#[test]
fn values_that_were_changed_while_it_ran_are_kept() {
    let mut sim = start(&Scene::from_toml(&BLOCK).unwrap(), 1);
    run(&mut sim, 0..5);
    sim.set("body.block.young_pa", "5e4").unwrap();
    sim.step(&nothing(0));
    let checkpoint = sim.checkpoint().unwrap();
    let mut other = Simulation::new(&Scene::from_toml(&BLOCK).unwrap(), Path::new("")).unwrap();
    other.restore(&checkpoint).unwrap();
    assert_eq!(other.scene().bodies[0].young_pa, 5e4);
    for simulation in [&mut sim, &mut other] {
        simulation.undo().unwrap();
        run(simulation, 0..20);
    }
    assert_eq!(sim.state_hash(), other.state_hash());
}
