//! Times of the phases of deforming: there when they are asked for, and then complete.

#![allow(clippy::unwrap_used)]

use std::path::Path;

use scindo_physics::phase::Phase;
use scindo_world::inputs::Inputs;
use scindo_world::results::Results;
use scindo_world::scene::Scene;
use scindo_world::simulation::{Simulation, Stage};

const SCENE: &str = r#"
schema = 1
world = { gravity_m_s2 = [0, 0, -9.81], step_s = 0.01 }
[[body]]
id = "fast"
mesh = { box = { min_m = [0, 0, 0], max_m = [0.1, 0.1, 0.1], cells = [6, 6, 6] } }
young_pa = 2e4
poisson = 0.4
density_kg_m3 = 1000
fix = [{ where = { slab = { axis = "z", from = 0, to = 0 } } }]
[[body]]
id = "nonlinear"
mesh = { box = { min_m = [1, 0, 0], max_m = [1.1, 0.1, 0.1], cells = [3, 3, 3] } }
law = "neo-hookean"
young_pa = 2e4
poisson = 0.4
density_kg_m3 = 1000
fix = [{ where = { slab = { axis = "z", from = 0, to = 0 } } }]
"#;

fn simulation() -> Simulation {
    Simulation::new(&Scene::from_toml(SCENE).unwrap(), Path::new("")).unwrap()
}

#[test]
fn measured_phases_add_up_to_no_more_than_the_stage_that_deforms() {
    let mut sim = simulation();
    sim.measure_phases(true);
    for _ in 0..5 {
        let report = sim.step(&Inputs::default()).clone();
        let (phases, deform) = (report.phases.total(), report.seconds.of(Stage::Deform));
        assert!(0.0 < phases && phases <= deform, "{phases} s of {deform} s");
        assert!(Phase::ALL.iter().all(|&phase| report.phases.of(phase) > 0.0), "{:?}", report.phases);
    }
    assert!(sim.total_phases().total() > sim.report().phases.total());
    sim.reset().unwrap();
    assert_eq!(sim.total_phases().total(), 0.0);
}

#[test]
fn phases_are_measured_only_when_asked_for_and_change_no_bit() {
    let (mut silent, mut measured) = (simulation(), simulation());
    measured.measure_phases(true);
    for _ in 0..5 {
        measured.step(&Inputs::default());
        assert_eq!(silent.step(&Inputs::default()).phases.total(), 0.0);
    }
    for (silent, measured) in silent.bodies().iter().zip(measured.bodies()) {
        assert_eq!(silent.body.positions(), measured.body.positions());
        assert_eq!(silent.body.velocities(), measured.body.velocities());
    }
    measured.measure_phases(false);
    assert_eq!(measured.step(&Inputs::default()).phases.total(), 0.0);
}

#[test]
fn the_summary_lists_phases_that_were_measured() {
    for on in [false, true] {
        let scene = Scene::from_toml(SCENE).unwrap();
        let mut sim = simulation();
        sim.measure_phases(on);
        let directory = tempfile::tempdir().unwrap();
        let mut results = Results::begin(directory.path(), &scene, &sim).unwrap();
        sim.step(&Inputs::default());
        results.record(&sim).unwrap();
        let timing = results.finish(&sim, "done").unwrap().timing;
        let names: Vec<&str> = timing.phases.iter().map(|phase| phase.name).collect();
        let all = Phase::ALL.map(Phase::name);
        assert_eq!(names, if on { &all[..] } else { &[] });
    }
}
