//! A steady step allocates nothing: not with a tool pressing, not with a snapshot taken.

use std::sync::LazyLock;

use scindo_allocations::allocations;
use scindo_tests::scene::{WORLD, ball, block, cut, held, probe};
use scindo_world::inputs::{Inputs, Wants};
use scindo_world::simulation::Simulation;
use scindo_world::snapshot::Snapshot;

use crate::{run, start, start_with};

static PRESSED: LazyLock<String> = LazyLock::new(|| {
    let path = [(0.0, 0.13), (0.3, 0.103), (2.0, 0.1)].map(|(at_s, z)| (at_s, [0.07, 0.05, z]));
    let keys = "rayleigh = { stiffness_s = 0.02 }\n".to_owned() + &held("z");
    let sweep = [[[0.05, -1.0, 0.06], [0.05, -1.0, 1.0]], [[0.05, 1.0, 0.06], [0.05, 1.0, 1.0]]];
    [
        WORLD,
        &block("block", [[0.0; 3], [0.1; 3]], [6; 3], &keys),
        &cut("block", 0.0, sweep),
        &ball("finger", 0.01, &path),
        &probe("top", "block", [0.07, 0.05, 0.1]),
    ]
    .concat()
});

#[test]
fn a_steady_step_with_contact_and_snapshot_allocates_nothing() {
    steady(false);
}

#[test]
fn measuring_the_phases_of_a_steady_step_allocates_nothing() {
    steady(true);
}

/// Steps with contact and snapshot until all is steady, then counts.
fn steady(phases: bool) {
    let mut sim = start(&PRESSED);
    sim.measure_phases(phases);
    let wants = Wants { surface: vec![true], contact: true, energy: false, ..Wants::default() };
    let inputs = Inputs { wants: wants.clone(), ..Inputs::default() };
    let mut snapshot = Snapshot::default();
    let mut step = |sim: &mut Simulation| {
        sim.step(&inputs);
        sim.snapshot_into(&wants, &mut snapshot);
    };
    (0..60).for_each(|_| step(&mut sim));
    let force = sim.tools().iter().next().unwrap().force_n;
    assert!(force.z > 0.05, "the finger presses with {force}");
    let before = allocations();
    (0..50).for_each(|_| step(&mut sim));
    assert_eq!(allocations() - before, 0);
}

#[test]
fn a_steady_step_of_bodies_side_by_side_allocates_nothing() {
    let text = PRESSED.clone() + &block("beside", [[0.2, 0.0, 0.0], [0.3, 0.1, 0.1]], [6; 3], &held("z"));
    // Only this thread is counted: alone it steps both bodies, beside another one of them.
    for threads in [1, 2] {
        let mut sim = start_with(&text, threads);
        run(&mut sim, 60);
        let before = allocations();
        run(&mut sim, 50);
        assert_eq!(allocations() - before, 0, "{threads} threads");
    }
}
