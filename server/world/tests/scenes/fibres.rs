//! Bodies with fibres, from the scene to forces: stiffer along them, in motion and in equilibrium, whole and cut.

#![allow(non_snake_case)] // the symbols of the field: X

use std::path::Path;

use nalgebra::Vector3;
use scindo_world::inputs::Inputs;
use scindo_world::scene::Scene;
use scindo_world::simulation::Simulation;

/// A bar of 0.1 m × 0.02 m × 0.02 m, drawn out by 2 % between ends that let its sides contract.
const BAR: &str = r#"
schema = 1
world = { step_s = 0.02 }
[[body]]
id = "bar"
mesh = { box = { min_m = [0, 0, 0], max_m = [0.1, 0.02, 0.02], cells = [10, 2, 2], pattern = "tet6" } }
young_pa = 1e5
poisson = 0.3
density_kg_m3 = 1000
integrator = "static"
solver = { tolerance = 1e-8 }
fibre = [FIBRES]
REST
[[body.fix]]
where = { slab = { axis = "x", from = 0, to = 0 } }
axes = "x"
[[body.fix]]
where = { slab = { axis = "x", from = 1, to = 1 } }
axes = "x"
displacement_m = [0.002, 0, 0]
[[body.fix]]
where = { box = { min_m = [-1e-9, -1e-9, -1e-9], max_m = [1e-9, 1e-9, 1e-9] } }
[[body.fix]]
where = { box = { min_m = [-1e-9, 0.0199, -1e-9], max_m = [1e-9, 0.0201, 1e-9] } }
axes = "z"
"#;

fn bar(fibres: &str, rest: &str) -> Simulation {
    let text = BAR.replace("FIBRES", fibres).replace("REST", rest);
    Simulation::new(&Scene::from_toml(&text).unwrap(), Path::new("")).unwrap()
}

/// Force on the drawn end [N].
fn pull(simulation: &mut Simulation) -> f64 {
    simulation.step(&Inputs::default());
    let body = &simulation.bodies()[0];
    body.body.reaction(&body.fix_groups[1], Vector3::zeros()).x
}

#[test]
fn fibres_add_to_the_stiffness_along_them() {
    let plain = pull(&mut bar("", "law = \"linear\""));
    assert!((plain - 1e5 * 0.02 * 4e-4).abs() < 1e-5, "E ε A: {plain}");
    for (rest, bound) in [
        ("law = \"linear\"", 1e-5),
        ("law = \"linear\"\nelement = \"tet10\"", 1e-5),
        // Green strain, and the area of the contracted bar.
        ("law = \"corotational\"", 0.04),
        ("law = \"stvk\"", 0.04),
        ("law = \"neo-hookean\"", 0.04),
    ] {
        let along = pull(&mut bar("{ direction = [2, 0, 0], stiffness_pa = 3e5 }", rest));
        assert!((along / plain - 4.0).abs() < 4.0 * bound, "{rest}: {along} of {plain}");
        let across = pull(&mut bar("{ direction = [0, 1, 0], stiffness_pa = 3e5 }", rest));
        assert!((across / plain - 1.0).abs() < 0.2, "{rest}, across: {across} of {plain}");
    }
}

#[test]
fn a_cut_body_with_fibres_moves_and_stays_finite() {
    let text = r#"
schema = 1
world = { gravity_m_s2 = [9.81, 0, 0], step_s = 0.01 }
[[body]]
id = "muscle"
mesh = { box = { min_m = [0, 0, 0], max_m = [0.1, 0.03, 0.02], cells = [10, 3, 2], pattern = "tet6" } }
law = "corotational"
young_pa = 4e3
poisson = 0.4
density_kg_m3 = 1000
rayleigh = { stiffness_s = 0.01 }
fix = [{ where = { slab = { axis = "x", from = 0, to = 0 } } }]
FIBRE
[[cut]]
body = "muscle"
at_s = 0.02
sweep_m = [[[0.03, 0.015, -0.05], [0.03, 0.015, 0.05]], [[0.11, 0.015, -0.05], [0.11, 0.015, 0.05]]]
"#;
    let stretch = |fibre: &str| {
        let scene = Scene::from_toml(&text.replace("FIBRE", fibre)).unwrap();
        let mut simulation = Simulation::new(&scene, Path::new("")).unwrap();
        for _ in 0..40 {
            simulation.step(&Inputs::default());
        }
        let body = &simulation.bodies()[0].body;
        let (x, X) = (body.positions(), body.rest_positions());
        assert!(x.iter().all(|x| x.iter().all(|c| c.is_finite())));
        assert!(body.n_copies() > 11 * 4 * 3, "it is cut");
        x.iter().zip(X).map(|(x, X)| x.x - X.x).fold(0.0, f64::max)
    };
    let plain = stretch("");
    let with = stretch("fibre = [{ direction = [1, 0, 0], stiffness_pa = 16e3, stiffening = 5 }]");
    assert!(
        with < 0.3 * plain && with > 0.1 * plain,
        "it stretches by {with} m with fibres, by {plain} m without"
    );
}

#[test]
fn what_fibres_do_not_go_with_is_said() {
    for (fibres, rest, words) in [
        ("{ direction = [0, 0, 0], stiffness_pa = 1e4 }", "", "fibre.0.direction"),
        ("{ direction = [1, 0, 0], stiffness_pa = 0 }", "", "fibre.0.stiffness_pa"),
        (
            "{ direction = [1, 0, 0], stiffness_pa = 1e4, stiffening = 1 }",
            "law = \"linear\"",
            "fibre.0.stiffening",
        ),
        ("{ direction = [1, 0, 0], stiffness_pa = 1e4, stifening = 1 }", "", "stiffening"),
        ("{ direction = [1, 0, 0], stiffness_pa = 1e4 }", "effects = { error_estimate = true }", ""),
    ] {
        // The effect stands at the top level.
        let text = BAR.replace("FIBRES", fibres);
        let text = match rest.strip_prefix("effects") {
            Some(effects) => format!("effects{effects}\n{}", text.replace("REST", "")),
            None => text.replace("REST", rest),
        };
        let error = Scene::from_toml(&text).unwrap_err().to_string();
        let expected = if words.is_empty() { "error_estimate" } else { words };
        assert!(error.contains(expected), "{error}");
    }
    let four = ["{ direction = [1, 0, 0], stiffness_pa = 1e4 }"; 4].join(", ");
    assert!(Scene::from_toml(&BAR.replace("FIBRES", &four).replace("REST", "")).is_err());
    let single = BAR
        .replace("solver = { tolerance = 1e-8 }", "solver = { precision = \"single\" }")
        .replace("FIBRES", "{ direction = [1, 0, 0], stiffness_pa = 1e4 }")
        .replace("REST", "law = \"linear\"");
    assert!(Scene::from_toml(&single).unwrap_err().to_string().contains("fibres"));
}
