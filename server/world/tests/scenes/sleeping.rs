//! Bodies that have come to rest sleep, and wake when something touches them.

use std::sync::Arc;

use nalgebra::{Isometry3, Vector3};
use scindo_allocations::allocations;
use scindo_tests::scene::{FLOOR, WORLD, block};
use scindo_world::inputs::{CutRequest, Inputs, ToolInput, ToolShape};
use scindo_world::simulation::Simulation;

use crate::{start, start_with};

/// A table with two blocks on each other, and a third one beside them.
fn table(effects: &str, blocks: &[(&str, [f64; 3])]) -> String {
    let keys = "young_pa = 1e5\nrayleigh = { stiffness_s = 0.005 }";
    let block = |&(id, at): &(&str, [f64; 3])| block(id, [at, at.map(|x| x + 0.06)], [3; 3], keys);
    format!("{WORLD}effects = {{ {effects} }}\n{FLOOR}{}", blocks.iter().map(block).collect::<String>())
}

fn three(effects: &str, threads: usize) -> Simulation {
    let blocks = [("low", [0.0, 0.0, 0.001]), ("high", [0.01, 0.005, 0.063]), ("beside", [0.2, 0.0, 0.001])];
    start_with(&table(effects, &blocks), threads)
}

fn asleep(sim: &Simulation) -> [bool; 3] {
    [0, 1, 2].map(|body| sim.is_asleep(body))
}

fn bits(sim: &Simulation) -> Vec<[u64; 6]> {
    let of = |(x, v): (&Vector3<f64>, &Vector3<f64>)| [x.x, x.y, x.z, v.x, v.y, v.z].map(f64::to_bits);
    let bodies = sim.bodies().iter().map(|body| &body.body);
    bodies.flat_map(|body| body.positions().iter().zip(body.velocities()).map(of)).collect()
}

fn run(sim: &mut Simulation, steps: usize, inputs: &Inputs) {
    for _ in 0..steps {
        sim.step(inputs);
    }
}

fn settled(threads: usize) -> Simulation {
    let mut sim = three("sleep = true, body_collision = true", threads);
    run(&mut sim, 1000, &Inputs::default());
    assert_eq!(asleep(&sim), [true; 3], "after {} s", sim.time_s());
    sim
}

/// A finger on top of the upper block, `deep` metres deep.
fn finger(deep: f64) -> Inputs {
    let tool = ToolInput {
        shape: Some(ToolShape::Sphere { radius_m: 0.008 }),
        ..ToolInput::new("finger", "hand", Isometry3::translation(0.04, 0.035, 0.13 - deep))
    };
    Inputs { tools: vec![tool], ..Inputs::default() }
}

#[test]
fn what_sleeps_keeps_its_bits_and_costs_no_solve() {
    let mut sim = settled(1);
    let (before, contacts) = (bits(&sim), sim.touch_reports().to_vec());
    let allocated = allocations();
    for _ in 0..200 {
        let report = sim.step(&Inputs::default());
        assert!(report.bodies.iter().all(|body| body.solve.iterations == 0));
    }
    assert_eq!(allocations(), allocated);
    assert!(bits(&sim) == before);
    // The upper block still presses on the lower one, and both on the table.
    assert_eq!(sim.touch_reports(), contacts);
    let weight = 9.81 * sim.bodies()[1].body.total_mass();
    assert!((-contacts[0].force_n.z / weight - 1.0).abs() < 0.01, "{contacts:?} {weight}");
    assert!((sim.rest_report(0).normal_n / (2.0 * weight) - 1.0).abs() < 0.01);
}

#[test]
fn a_touch_wakes_a_body_and_those_under_it_alone() {
    let mut sim = settled(1);
    let before = sim.bodies()[1].body.centre_of_mass();
    // Above the skin nothing happens.
    run(&mut sim, 5, &finger(-0.01));
    assert_eq!(asleep(&sim), [true; 3]);
    run(&mut sim, 20, &finger(0.008));
    assert_eq!(asleep(&sim), [false, false, true]);
    assert!(sim.bodies()[1].body.centre_of_mass().z < before.z - 1e-4, "it is pressed down");
    run(&mut sim, 800, &finger(-0.02));
    assert_eq!(asleep(&sim), [true; 3]);
    let back = (sim.bodies()[1].body.centre_of_mass() - before).norm();
    assert!(back < 1e-4, "and comes back: {back}");
}

/// Without tools, the surfaces of bodies that touch no bodies need not follow them: a first tool meets them where
/// they sleep.
#[test]
fn a_body_that_slept_before_the_first_tool_is_felt() {
    for effects in ["sleep = true, body_collision = false", "sleep = true"] {
        let mut sim = start(&table(effects, &[("high", [0.01, 0.005, 0.163])]));
        run(&mut sim, 1000, &Inputs::default());
        assert!(sim.is_asleep(0));
        let top = Vector3::new(0.04, 0.035, 0.06);
        let mut finger = finger(0.0);
        // Held over the block, and then pressed on it.
        for (above, touched) in [(0.05, false), (0.0045, true)] {
            finger.tools[0].pose = Isometry3::translation(top.x, top.y, top.z + above);
            run(&mut sim, 3, &finger);
            assert_eq!(!sim.is_asleep(0), touched, "{effects}, {above} m above");
        }
    }
}

#[test]
fn a_body_that_arrives_wakes_what_it_meets() {
    // One falls for 1.2 s while the others sleep.
    let blocks = [("below", [0.0, 0.0, 0.001]), ("far", [0.3, 0.0, 0.001]), ("thrown", [0.01, 0.0, 7.2])];
    let mut sim = start(&table("sleep = true, body_collision = true", &blocks));
    let mut slept = false;
    while !sim.is_asleep(0) || !slept {
        sim.step(&Inputs::default());
        slept |= sim.is_asleep(0) && sim.is_asleep(1);
    }
    while sim.is_asleep(0) {
        sim.step(&Inputs::default());
    }
    assert!((1.15..1.25).contains(&sim.time_s()), "it arrives after 1.2 s: {}", sim.time_s());
    assert!(sim.is_asleep(1), "the far one sleeps on");
}

#[test]
fn cuts_and_changed_values_wake_bodies() {
    let mut sim = settled(1);
    sim.set("world.gravity_m_s2", "[0, 0, -9]").unwrap();
    assert_eq!(asleep(&sim), [false; 3]);
    run(&mut sim, 1000, &Inputs::default());
    assert_eq!(asleep(&sim), [true; 3]);
    let high = Vector3::new(0.23, -0.01, 0.07);
    let low = Vector3::new(0.23, -0.01, 0.03);
    let along = Vector3::new(0.0, 0.08, 0.0);
    let cut = CutRequest {
        request: 1,
        tool: Arc::from("knife"),
        body: Some(Arc::from("beside")),
        segments: vec![[high, low], [high + along, low + along]],
    };
    run(&mut sim, 1, &Inputs { cuts: vec![cut], ..Inputs::default() });
    assert!(sim.cuts_applied() > 0);
    assert_eq!(asleep(&sim), [true, true, false]);
    sim.reset().unwrap();
    assert_eq!(asleep(&sim), [false; 3]);
}

#[test]
fn it_is_off_unless_asked_for_and_changes_nothing_before_the_first_sleep() {
    let (mut on, mut off) =
        (three("sleep = true, body_collision = true", 1), three("body_collision = true", 1));
    let mut together = 0;
    while asleep(&on) == [false; 3] {
        assert!(bits(&on) == bits(&off));
        run(&mut on, 1, &Inputs::default());
        run(&mut off, 1, &Inputs::default());
        together += 1;
    }
    assert!(together > 50, "{together}");
    run(&mut off, 1000, &Inputs::default());
    assert_eq!(asleep(&off), [false; 3]);
    assert!(on.plan().is_on("sleep") && !off.plan().is_on("sleep"));
    // Threads change no bit.
    assert!(bits(&settled(2)) == bits(&settled(1)));
}
