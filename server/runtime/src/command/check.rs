//! `scindo check`: what is wrong, what is odd, which effects are on and what they will cost.

use std::process::ExitCode;

use scindo_world::scene::Scene;
use scindo_world::simulation::{SimBody, Simulation};
use serde_json::{Value, json};

use crate::cli::CheckArgs;
use crate::error::RuntimeError;
use crate::say::say;

/// Builds the scene without stepping it.
pub fn check(args: &CheckArgs) -> Result<ExitCode, RuntimeError> {
    let Some(path) = args.scene.as_deref().filter(|_| !args.schema) else {
        say!("{:#}", Scene::json_schema());
        return Ok(ExitCode::SUCCESS);
    };
    let scene = Scene::load_with(path, &args.set)?;
    let simulation = Simulation::new(&scene, scene.base_dir())?;
    if args.json {
        say!("{:#}", as_json(&scene, &simulation));
    } else {
        print(&scene, &simulation);
    }
    Ok(ExitCode::SUCCESS)
}

fn as_json(scene: &Scene, simulation: &Simulation) -> Value {
    let plan = simulation.plan();
    json!({
        "scene": scene.name(),
        "step_s": simulation.step_s(),
        "predicted_ms": plan.predicted_ms(),
        "effects": plan.effects,
        "bodies": simulation.bodies().iter().map(body_as_json).collect::<Vec<_>>(),
        "warnings": simulation.warnings(),
    })
}

fn body_as_json(body: &SimBody) -> Value {
    let size = body.size();
    json!({
        "id": &*body.id,
        "elements": size.elements,
        "nodes": body.body.cut_mesh().mesh().nodes.len(),
        "surface_vertices": size.vertices,
        "surface_triangles": size.triangles,
        "volume_m3": body.rest_volume_m3,
        "mesh": body.health,
    })
}

fn print(scene: &Scene, simulation: &Simulation) {
    say!("{}: {}", scene.file(), scene.name());
    for body in simulation.bodies() {
        let (size, nodes) = (body.size(), body.body.cut_mesh().mesh().nodes.len());
        say!(
            "  body {}: {} elements, {nodes} nodes, {} surface triangles, {:.4e} m3",
            body.id,
            size.elements,
            size.triangles,
            body.rest_volume_m3
        );
        if let Some(health) = &body.health {
            health.to_string().lines().for_each(|line| say!("    {line}"));
        }
    }
    let plan = simulation.plan();
    say!("{:<22} {:<4} {:>9}  why", "effect", "", "ms/step");
    for effect in &plan.effects {
        let (switch, cost) =
            if effect.on { ("on", format!("{:.3}", effect.predicted_ms)) } else { ("off", String::new()) };
        say!("{:<22} {switch:<4} {cost:>9}  {}", effect.name, effect.why);
    }
    say!("predicted {:.3} ms per step of {} ms", plan.predicted_ms(), 1e3 * simulation.step_s());
    for warning in simulation.warnings() {
        say!("warning: {warning}");
    }
}
