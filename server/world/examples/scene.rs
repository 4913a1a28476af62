//! A scene in a string: a block under a falling load, with a cut and a probe, stepped by hand.
//!
//! `cargo run -p scindo-world --example scene`

use std::error::Error;
use std::path::Path;

use scindo_world::inputs::Inputs;
use scindo_world::scene::Scene;
use scindo_world::simulation::Simulation;

const SCENE: &str = r#"
schema = 1
name = "a first scene"

[world]
gravity_m_s2 = [0, 0, -9.81]
step_s = 0.02

[[body]]
id = "block"
mesh = { box = { min_m = [0, 0, 0], max_m = [0.1, 0.1, 0.05], cells = [8, 8, 4] } }
young_pa = 2e4
poisson = 0.45
density_kg_m3 = 1050

[[body.fix]]
where = { slab = { axis = "x", from = 0, to = 0 } }

[[cut]]
body = "block"
at_s = 0.4
sweep_m = [[[0.05, -0.01, 0.06], [0.05, 0.11, 0.06]], [[0.05, -0.01, 0.02], [0.05, 0.11, 0.02]]]

[[probe]]
id = "corner"
body = "block"
point_m = [0.1, 0.1, 0.05]
"#;

fn main() -> Result<(), Box<dyn Error>> {
    // Mistakes come with line, value, range and what to change.
    let scene = Scene::from_toml(SCENE)?;
    let mut simulation = Simulation::new(&scene, Path::new(""))?;
    for step in 1..=50 {
        let report = simulation.step(&Inputs::default()).clone();
        for event in &report.events {
            println!("{:.2} s: {}: {}", simulation.time_s(), event.name, event.message);
        }
        if step % 10 == 0 {
            let body = &simulation.bodies()[0];
            let corner = simulation.probe_position(&simulation.probes()[0]);
            let iterations = report.bodies[0].solve.iterations;
            println!(
                "{:.2} s: corner at {:.4} m, {} copies of nodes, {iterations} iterations",
                simulation.time_s(),
                corner.z,
                body.body.n_copies()
            );
        }
    }
    Ok(())
}
