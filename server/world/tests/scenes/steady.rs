//! A steady step allocates nothing: not with a tool pressing, not with a snapshot taken.

use std::path::Path;

use scindo_allocations::allocations;
use scindo_world::assemble::BuildOptions;
use scindo_world::inputs::{Inputs, Wants};
use scindo_world::scene::Scene;
use scindo_world::simulation::Simulation;
use scindo_world::snapshot::Snapshot;

const PRESSED: &str = r#"
schema = 1
world = { gravity_m_s2 = [0, 0, -9.81], step_s = 0.01 }
cut = [{ body = "block", sweep_m = [[[0.05, -1, 0.06], [0.05, -1, 1]], [[0.05, 1, 0.06], [0.05, 1, 1]]] }]
[[body]]
id = "block"
mesh = { box = { min_m = [0, 0, 0], max_m = [0.1, 0.1, 0.1], cells = [6, 6, 6] } }
young_pa = 2e4
poisson = 0.4
density_kg_m3 = 1000
rayleigh = { stiffness_s = 0.02 }
fix = [{ where = { slab = { axis = "z", from = 0, to = 0 } } }]
[[tool]]
id = "finger"
shape = { sphere = { radius_m = 0.01 } }
path = [
  { at_s = 0.0, tip_m = [0.07, 0.05, 0.130] },
  { at_s = 0.3, tip_m = [0.07, 0.05, 0.103] },
  { at_s = 2.0, tip_m = [0.07, 0.05, 0.100] },
]
[[probe]]
id = "top"
body = "block"
point_m = [0.07, 0.05, 0.1]
"#;

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
    let mut sim = Simulation::new(&Scene::from_toml(PRESSED).unwrap(), Path::new("")).unwrap();
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
    let second = r#"
[[body]]
id = "beside"
mesh = { box = { min_m = [0.2, 0, 0], max_m = [0.3, 0.1, 0.1], cells = [6, 6, 6] } }
young_pa = 2e4
poisson = 0.4
density_kg_m3 = 1000
fix = [{ where = { slab = { axis = "z", from = 0, to = 0 } } }]
"#;
    let scene = Scene::from_toml(&format!("{PRESSED}{second}")).unwrap();
    // Only this thread is counted: alone it steps both bodies, beside another one of them.
    for threads in [1, 2] {
        let options = BuildOptions { threads, portable: false };
        let mut sim = Simulation::with_options(&scene, Path::new(""), options).unwrap();
        let inputs = Inputs::default();
        for _ in 0..60 {
            sim.step(&inputs);
        }
        let before = allocations();
        for _ in 0..50 {
            sim.step(&inputs);
        }
        assert_eq!(allocations() - before, 0, "{threads} threads");
    }
}
