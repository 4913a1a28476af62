//! Times of the phases of deforming: there when they are asked for, and then complete.

use scindo_physics::team::phase::Phase;
use scindo_world::inputs::Inputs;
use scindo_world::results::Results;
use scindo_world::scene::Scene;
use scindo_world::simulation::Stage;

use crate::start;

const SCENE: &str = include_str!("fast_and_nonlinear.toml");

#[test]
fn measured_phases_add_up_to_no_more_than_the_stage_that_deforms() {
    let mut sim = start(SCENE);
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
    let (mut silent, mut measured) = (start(SCENE), start(SCENE));
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
        let mut sim = start(SCENE);
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
