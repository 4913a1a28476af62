//! Viscoelastic bodies from the scene to forces: what relaxes, what saved states keep, and what is refused.

use std::path::Path;

use nalgebra::Vector3;
use scindo_world::inputs::Inputs;
use scindo_world::scene::Scene;
use scindo_world::simulation::Simulation;

/// A block that is sheared by 5 % within its first step and held there.
const BLOCK: &str = r#"
schema = 1
world = { step_s = 0.02 }
[[body]]
id = "block"
mesh = { box = { min_m = [0, 0, 0], max_m = [0.1, 0.1, 0.02], cells = [10, 10, 2], pattern = "tet6" } }
young_pa = 1e4
poisson = 0.3
density_kg_m3 = 1000
integrator = "static"
solver = { tolerance = 1e-8 }
prony = [PRONY]
REST
[[body.fix]]
where = { slab = { axis = "z", from = 0, to = 0 } }
[[body.fix]]
where = { slab = { axis = "z", from = 1, to = 1 } }
displacement_m = [0.001, 0, 0]
"#;

fn scene(prony: &str, rest: &str) -> Result<Scene, String> {
    let text = BLOCK.replace("PRONY", prony);
    let text = if rest.contains("hex8") { text.replace("tet6", "hex") } else { text };
    // An effect stands at the top level.
    let text = match rest.strip_prefix("effects") {
        Some(effects) => format!("effects{effects}\n{}", text.replace("REST", "")),
        None => text.replace("REST", rest),
    };
    Scene::from_toml(&text).map_err(|e| e.to_string())
}

/// Force on the upper face [N] after each of `steps` steps.
fn pulls(simulation: &mut Simulation, steps: usize) -> Vec<f64> {
    let mut pulls = Vec::new();
    for _ in 0..steps {
        simulation.step(&Inputs::default());
        let body = &simulation.bodies()[0];
        pulls.push(body.body.reaction(&body.fix_groups[1], Vector3::zeros()).x);
    }
    pulls
}

#[test]
fn a_sheared_block_relaxes_to_the_stiffness_of_its_law() {
    for rest in [
        "law = \"linear\"",
        "law = \"corotational\"",
        "law = \"neo-hookean\"",
        "element = \"tet10\"",
        "element = \"hex8\"",
    ] {
        let run = |prony: &str| {
            pulls(&mut Simulation::new(&scene(prony, rest).unwrap(), Path::new("")).unwrap(), 60)
        };
        let elastic = run("")[0];
        let viscous = run("{ ratio = 1.0, time_s = 0.2 }, { ratio = 0.5, time_s = 1e4 }");
        // In the first step of a tenth of τ the spring of the first term loses 4.8 % of its stress.
        let left = |k: i32| 1.5 - 1.0 + 0.951_626 * (-0.1 * f64::from(k)).exp();
        for (k, pull) in (0..).zip(&viscous) {
            // Shear of a flat block; the edges, where the free sides contract, are a small part of it.
            let expected = elastic * (1.0 + left(k));
            assert!(
                (pull / expected - 1.0).abs() < 0.02,
                "{rest}, step {k}: {pull} N, expected {expected} N"
            );
        }
    }
}

#[test]
fn a_saved_state_goes_on_to_the_bit() {
    let text = r#"
schema = 1
world = { gravity_m_s2 = [0, 0, -9.81], step_s = 0.01 }
[[body]]
id = "organ"
mesh = { box = { min_m = [0, 0, 0], max_m = [0.1, 0.04, 0.04], cells = [8, 3, 3], pattern = "tet6" } }
law = "corotational"
young_pa = 2e4
poisson = 0.4
density_kg_m3 = 1000
integrator = "bdf2"
fix = [{ where = { slab = { axis = "x", from = 0, to = 0 } } }]
prony = [{ ratio = 1.5, time_s = 0.1 }]
[[cut]]
body = "organ"
at_s = 0.06
sweep_m = [[[0.05, -0.05, 0.02], [0.05, 0.09, 0.02]], [[0.05, -0.05, 0.09], [0.05, 0.09, 0.09]]]
"#;
    let scene = Scene::from_toml(text).unwrap();
    let mut simulation = Simulation::new(&scene, Path::new("")).unwrap();
    let run = |simulation: &mut Simulation| {
        for _ in 0..10 {
            simulation.step(&Inputs::default());
        }
        simulation.bodies()[0].body.positions().to_vec()
    };
    run(&mut simulation);
    let saved = simulation.checkpoint().unwrap();
    let expected = run(&mut simulation);
    let mut again = Simulation::new(&scene, Path::new("")).unwrap();
    again.restore(&saved).unwrap();
    assert_eq!(run(&mut again), expected);
}

#[test]
fn what_a_prony_series_does_not_go_with_is_said() {
    let term = "{ ratio = 0.5, time_s = 1 }";
    for (prony, rest, words) in [
        ("{ ratio = 0, time_s = 1 }", "", "prony.0.ratio"),
        ("{ ratio = 0.5, time_s = 0 }", "", "prony.0.time_s"),
        ("{ ratio = 0.5, tau_s = 1 }", "", "time_s"),
        (
            "{ ratio = 0.5, time_s = 1 }, { ratio = 0.5, time_s = 1 }, { ratio = 0.5, time_s = 1 }, { ratio = 0.5, time_s = 1 }",
            "",
            "prony",
        ),
        (term, "cutting = { method = \"snap\" }", "keeps the elements"),
        (term, "effects = { error_estimate = true }", "viscoelasticity"),
    ] {
        let error = scene(prony, rest).unwrap_err();
        assert!(error.contains(words), "{words}: {error}");
    }
    let swap = |solver: &str, integrator: &str| {
        let text = BLOCK.replace("PRONY", term).replace("REST", "");
        let text = text.replace("solver = { tolerance = 1e-8 }", solver);
        let text = text.replace("integrator = \"static\"", &format!("integrator = \"{integrator}\""));
        Scene::from_toml(&text).unwrap_err().to_string()
    };
    let error = swap("", "rk4");
    assert!(error.contains("implicit integrator") && error.contains("rk4"), "{error}");
    let error = swap("solver = { method = \"relaxation\", iterations = 10 }", "static");
    assert!(error.contains("another solver"), "{error}");
    let error = swap("solver = { precision = \"single\" }", "bdf2");
    assert!(error.contains("viscoelasticity"), "{error}");
}
