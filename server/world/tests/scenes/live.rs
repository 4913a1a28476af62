//! What changes while a scene runs: every key on the list has its effect, present values have none.

use nalgebra::Vector3;
use scindo_tests::scene::{WORLD, block, held};
use scindo_world::inputs::Inputs;
use scindo_world::simulation::Simulation;

use crate::start;

/// A bar that hangs from its end, on the path that `how` asks for.
fn bar(how: &str) -> Simulation {
    let keys = format!("{how}\nyoung_pa = 1e5\npoisson = 0.3\n{}", held("z").replace("= 0", "= 1"));
    let head = WORLD.replace("-9.81", "-1") + "effects = { energy = false }\n";
    start(&(head + &block("bar", [[0.0; 3], [0.05, 0.05, 0.2]], [2, 2, 6], &keys)))
}

const FAST: &str = "rayleigh = { mass_1_s = 1.0, stiffness_s = 0.01 }\nsolver = { tolerance = 1e-5 }";
const GENERAL: &str = "law = \"neo-hookean\"\nrayleigh = { mass_1_s = 1.0, stiffness_s = 0.01 }";
const BDF2: &str = "integrator = \"bdf2\"\nlocking = \"node-averaged\"";
const EXPLICIT: &str = "integrator = \"rk4\"\nrayleigh = { mass_1_s = 1.0 }";
const STATIC: &str = "integrator = \"static\"\nsolver = { tolerance = 1e-8, iterations = 500 }";
const RELAXED: &str = "integrator = \"static\"\nsolver = { method = \"relaxation\", iterations = 300 }";
const FACTORED: &str = "law = \"linear\"\nsolver = { method = \"cholesky\", tolerance = 1e-8 }";

fn run(sim: &mut Simulation, steps: usize) {
    for _ in 0..steps {
        sim.step(&Inputs::default());
    }
}

fn positions(sim: &Simulation) -> Vec<Vector3<f64>> {
    sim.bodies()[0].body.positions().to_vec()
}

/// How far the free end hangs down [m].
fn sag(sim: &Simulation) -> f64 {
    -sim.bodies()[0].body.positions().iter().map(|x| x.z).fold(0.0, f64::min)
}

#[test]
fn a_present_value_set_again_changes_no_bit() {
    for how in [FAST, GENERAL, BDF2, EXPLICIT, STATIC, RELAXED, FACTORED] {
        let (mut untouched, mut sim) = (bar(how), bar(how));
        for _ in 0..6 {
            for parameter in sim.parameters() {
                sim.set(&parameter.key, &parameter.value.to_string()).unwrap();
            }
            run(&mut sim, 2);
            run(&mut untouched, 2);
        }
        assert_eq!(positions(&sim), positions(&untouched), "{how}");
    }
}

#[test]
fn every_key_of_every_path_changes_the_motion_or_the_report() {
    for how in [FAST, GENERAL, BDF2, EXPLICIT, STATIC, FACTORED] {
        let mut untouched = bar(how);
        run(&mut untouched, 8);
        for parameter in bar(how).parameters() {
            let other = match parameter.key.rsplit('.').next().unwrap() {
                "gravity_m_s2" => "[0, 0.5, -1]",
                "energy" | "error_estimate" => "true",
                "young_pa" => "3e4",
                "poisson" => "0.2",
                "mass_1_s" => "5.0",
                "stiffness_s" => "0.03",
                "iterations" => "2",
                "tolerance" => "0.3",
                key => panic!("{key} has no test"),
            };
            let mut sim = bar(how);
            // An equilibrium that is found stays, whatever the solver may do from then on.
            let before = if how == STATIC { 0 } else { 4 };
            run(&mut sim, before);
            sim.set(&parameter.key, other).unwrap();
            run(&mut sim, 8 - before);
            let reported = |sim: &Simulation| {
                let report = &sim.report().bodies[0];
                (report.energy.is_some(), report.mesh_error.is_some())
            };
            let changed = positions(&sim) != positions(&untouched) || reported(&sim) != reported(&untouched);
            assert!(changed, "{} has no effect: {how}", parameter.key);
        }
    }
}

#[test]
fn a_bar_half_as_stiff_hangs_twice_as_far() {
    for (how, steps) in [(STATIC, 2), (FAST, 250), (FACTORED, 1)] {
        let damped = if how == FACTORED { format!("integrator = \"static\"\n{how}") } else { how.to_owned() };
        let mut sim = bar(&damped);
        run(&mut sim, steps);
        let before = sag(&sim);
        sim.set("body.bar.young_pa", "5e4").unwrap();
        run(&mut sim, steps);
        let ratio = sag(&sim) / before;
        assert!((ratio - 2.0).abs() < 0.02, "{before} m, then {ratio} times as much: {damped}");
        sim.set("world.gravity_m_s2", "[0, 0, -2]").unwrap();
        run(&mut sim, steps);
        let ratio = sag(&sim) / before;
        assert!((ratio - 4.0).abs() < 0.08, "{before} m, then {ratio} times as much: {damped}");
    }
}

#[test]
fn a_key_that_is_refused_leaves_everything_as_it_was() {
    let (mut untouched, mut sim) = (bar(FAST), bar(FAST));
    for (key, value, said) in [
        ("body.bar.solver.method", "\"cholesky\"", "cannot change while the scene runs"),
        ("body.bar.solver.newton_steps", "5", "These can: world.gravity_m_s2"),
        ("body.bar.density_kg_m3", "500", "body.bar.young_pa"),
        ("body.bar.solver.iterations", "1000000", "1.0 to 10000.0"),
        ("world.gravity_m_s2", "[0, nan, 0]", "magnitude"),
        ("world.gravty_m_s2", "1", "did you mean"),
    ] {
        let refusal = sim.set(key, value).unwrap_err();
        assert!(refusal.contains(said), "{key}: {refusal}");
    }
    assert_eq!(sim.parameters(), untouched.parameters());
    run(&mut sim, 5);
    run(&mut untouched, 5);
    assert_eq!(positions(&sim), positions(&untouched));
}

#[test]
fn the_plan_follows_what_is_set() {
    let mut sim = bar(FAST);
    assert!(sim.plan().is_on("gravity") && sim.plan().is_on("damping") && !sim.plan().is_on("energies"));
    sim.set("world.gravity_m_s2", "[0, 0, 0]").unwrap();
    sim.set("body.bar.rayleigh.mass_1_s", "0").unwrap();
    sim.set("body.bar.rayleigh.stiffness_s", "0").unwrap();
    sim.set("effects.energy", "true").unwrap();
    assert!(!sim.plan().is_on("gravity") && !sim.plan().is_on("damping") && sim.plan().is_on("energies"));
}
