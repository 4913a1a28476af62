//! Several bodies of a scene share one set of threads and are stepped side by side: the bits are those of
//! bodies stepped one after another, and none disturbs another.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use nalgebra::Vector3;
use scindo_physics::body::Outcome;
use scindo_tests::scene::WORLD;
use scindo_world::assemble::BuildOptions;
use scindo_world::inputs::Inputs;
use scindo_world::report::Event;
use scindo_world::scene::Scene;
use scindo_world::simulation::Simulation;

use crate::start_with;

/// Two and a half thousand tetrahedra on the fast path, which a finger presses and a blade cuts.
const LARGE: &str = r#"
[[cut]]
body = "large"
at_s = 0.05
sweep_m = [[[0.05, -1, 0.06], [0.05, -1, 1]], [[0.05, 0.06, 0.06], [0.05, 0.06, 1]]]
[[tool]]
id = "finger"
shape = { sphere = { radius_m = 0.01 } }
path = [{ at_s = 0.0, tip_m = [0.07, 0.05, 0.115] }, { at_s = 0.2, tip_m = [0.07, 0.05, 0.1] }]
[[body]]
id = "large"
mesh = { box = { min_m = [0, 0, 0], max_m = [0.1, 0.1, 0.1], cells = [8, 8, 8], pattern = "tet5" } }
young_pa = 2e4
poisson = 0.4
density_kg_m3 = 1000
rayleigh = { stiffness_s = 0.02 }
fix = [{ where = { slab = { axis = "z", from = 0, to = 0 } } }]
"#;

/// Newton's method on the general path.
const CURVED: &str = r#"
[[body]]
id = "curved"
mesh = { box = { min_m = [0.2, 0, 0], max_m = [0.3, 0.05, 0.05], cells = [6, 3, 3] } }
law = "neo-hookean"
young_pa = 1e4
poisson = 0.4
density_kg_m3 = 1000
fix = [{ where = { slab = { axis = "x", from = 0, to = 0 } } }]
"#;

/// A load on the end of that body, far beyond its stiffness.
const TORN: &str = r#"load = [{ where = { slab = { axis = "x", from = 1, to = 1 } }, force_n = [1e9, 2e9, 0] }]
"#;

/// A body that nothing holds.
const FREE: &str = r#"
[[body]]
id = "free"
mesh = { box = { min_m = [0.4, 0, 0.1], max_m = [0.45, 0.05, 0.15], cells = [3, 3, 3] } }
young_pa = 1e4
poisson = 0.3
density_kg_m3 = 1000
"#;

fn simulation(parts: &[&str], threads: usize) -> Simulation {
    start_with(&format!("{WORLD}{}", parts.concat()), threads)
}

/// Positions [m] and velocities [m/s] of a body.
type State = (Vec<Vector3<f64>>, Vec<Vector3<f64>>);

fn state(sim: &Simulation, id: &str) -> State {
    let body = &sim.bodies().iter().find(|body| &*body.id == id).unwrap().body;
    (body.positions().to_vec(), body.velocities().to_vec())
}

/// All events of so many steps, and after each step what was solved.
fn run(sim: &mut Simulation, steps: usize) -> (Vec<Event>, Vec<String>) {
    let (mut events, mut solved) = (Vec::new(), Vec::new());
    for _ in 0..steps {
        let report = sim.step(&Inputs::default());
        events.extend(report.events.iter().cloned());
        solved.extend(report.bodies.iter().map(|body| format!("{:?}", body.solve)));
    }
    (events, solved)
}

#[test]
fn the_number_of_threads_does_not_change_a_bit_of_several_bodies() {
    for (parts, ids) in [
        (vec![LARGE, CURVED], vec!["large", "curved"]),
        (vec![LARGE, CURVED, FREE], vec!["large", "curved", "free"]),
    ] {
        let outcome = |threads| {
            let mut sim = simulation(&parts, threads);
            let told = run(&mut sim, 30);
            assert!(sim.cuts_applied() > 0 && sim.tools().iter().next().unwrap().force_n.z > 0.01);
            (told, ids.iter().map(|id| state(&sim, id)).collect::<Vec<State>>())
        };
        let one = outcome(1);
        for threads in [2, 3, 5] {
            assert_eq!(one, outcome(threads), "{ids:?} on {threads} threads");
        }
    }
}

#[test]
fn a_body_beside_others_moves_as_it_does_alone() {
    let mut together = simulation(&[LARGE, CURVED, FREE], 3);
    run(&mut together, 20);
    for (part, id) in [(LARGE, "large"), (CURVED, "curved"), (FREE, "free")] {
        let mut alone = simulation(&[part], 1);
        run(&mut alone, 20);
        assert_eq!(state(&alone, id), state(&together, id), "{id}");
    }
}

#[test]
fn a_body_that_has_fallen_asleep_leaves_the_others_as_they_are() {
    let outcome = |threads| {
        let mut sim = simulation(&[FREE, CURVED], threads);
        let told = run(&mut sim, 110);
        assert!(told.0.iter().any(|event| event.name == "part-asleep"), "{:?}", told.0);
        assert!(sim.bodies()[0].body.sleeps() && !sim.bodies()[1].body.sleeps());
        (told, state(&sim, "free"), state(&sim, "curved"))
    };
    let one = outcome(1);
    for threads in [2, 3] {
        assert_eq!(one, outcome(threads), "{threads} threads");
    }
    let mut alone = simulation(&[CURVED], 1);
    run(&mut alone, 110);
    assert_eq!(one.2, state(&alone, "curved"));
}

#[test]
fn a_raised_stop_flag_leaves_every_body_where_it_was() {
    for threads in [1, 2, 3] {
        let mut sim = simulation(&[LARGE, CURVED, FREE], threads);
        let flag = Arc::new(AtomicBool::new(false));
        sim.set_stop_flag(&flag);
        run(&mut sim, 3);
        let ids = ["large", "curved", "free"];
        let before = ids.map(|id| state(&sim, id));
        flag.store(true, Ordering::Relaxed);
        let outcomes = |sim: &mut Simulation| {
            sim.step(&Inputs::default()).bodies.iter().map(|body| body.solve.outcome).collect::<Vec<_>>()
        };
        assert_eq!(outcomes(&mut sim), [Outcome::Interrupted; 3], "{threads} threads");
        assert_eq!(before, ids.map(|id| state(&sim, id)));
        flag.store(false, Ordering::Relaxed);
        assert_eq!(outcomes(&mut sim), [Outcome::Advanced; 3], "{threads} threads");
    }
}

#[test]
fn a_body_that_diverges_does_not_disturb_the_others() {
    let outcome = |threads| {
        // A load that tears the body apart, so that no part of a step succeeds.
        let torn = CURVED.to_owned() + TORN;
        let mut sim = simulation(&[&torn, LARGE], threads);
        let told = run(&mut sim, 15);
        let held = format!("outcome: {:?}", Outcome::Held);
        assert!(told.1[0].contains(&held), "{}", told.1[0]);
        (told, state(&sim, "curved"), state(&sim, "large"))
    };
    let one = outcome(1);
    for threads in [2, 3] {
        assert_eq!(one, outcome(threads), "{threads} threads");
    }
    let mut alone = simulation(&[LARGE], 1);
    run(&mut alone, 15);
    assert_eq!(one.2, state(&alone, "large"));
}

#[test]
fn too_many_threads_are_refused_for_any_number_of_bodies() {
    for parts in [vec![LARGE], vec![LARGE, CURVED]] {
        let scene = Scene::from_toml(&format!("{WORLD}{}", parts.concat())).unwrap();
        for threads in [0, 65] {
            let options = BuildOptions { threads, portable: false };
            let error = Simulation::with_options(&scene, Path::new(""), options).unwrap_err().to_string();
            assert!(error.contains(".threads") && error.contains(&format!("found {threads}")), "{error}");
        }
    }
}
