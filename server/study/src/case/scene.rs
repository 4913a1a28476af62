//! Any scene as a case: what can be varied in it, points to compare, a reference by refinement.

use scindo_world::scene::{Scene, SceneError};
use scindo_world::simulation::Simulation;
use serde_json::Value;

use super::gold::{Point, probe_tables};
use super::shared::LAWS;
use super::{Case, Plan, Truth};
use crate::axes::{
    Axis, Factor, Setting, elements, precisions, step, steps, threads, tolerance, tolerances, words,
};
use crate::design::{Block, Configuration};
use crate::error::Goal;
use crate::trial::Protocol;

/// Points that are compared where the scene has no probe, per body.
const POINTS: usize = 6;

/// A case from a scene. `seconds` is the simulated time of a motion; none: one second, longer
/// where cuts or tools come later, at most 100 frames.
///
/// # Errors
/// What is wrong with the scene.
pub fn from_scene(scene: &Scene, seconds: Option<f64>, quick: bool) -> Result<Case, SceneError> {
    let scene = with_probes(scene)?;
    let tree = scene.to_json();
    let bodies: Vec<String> = scene.checked().bodies.iter().map(|body| body.id.clone()).collect();
    let word = |key: &str, default: &str| {
        let value = tree["body"].as_array().and_then(|all| all.first()).map(|body| &body[key]);
        value.and_then(Value::as_str).unwrap_or(default).to_owned()
    };
    let law = word("law", "corotational");
    let integrator = word("integrator", "implicit-euler");
    let frame_s = scene.checked().step_s;
    let protocol = if integrator == "static" {
        Protocol::Static
    } else {
        Protocol::Motion { frame_s, frames: frames(&scene, frame_s, seconds, quick) }
    };
    let axes = axes(&bodies, &tree, (&law, &integrator, frame_s), quick);
    let plans = plans(&bodies, &axes, &tree, frame_s, quick);
    let name = slug(scene.name());
    let probes = scene.checked().probes.len();
    Ok(Case {
        title: scene.name().to_owned(),
        about: format!(
            "The scene {}. {} compared at {probes} material points; every other setting is the scene’s own.",
            scene.file(),
            match protocol {
                Protocol::Static => "The equilibrium is".to_owned(),
                Protocol::Motion { frames, .. } => format!("{frames} frames of {} ms are", 1e3 * frame_s),
            }
        ),
        goal: goal(&scene),
        truth: Truth::Extrapolated { law, plans },
        blocks: blocks(&axes),
        name,
        scene,
        bodies,
        protocol,
        axes,
        colour: Factor::Law,
        shape: Factor::Integrator,
    })
}

/// Axes of a scene; the base of each is what the scene says.
fn axes(bodies: &[String], tree: &Value, now: (&str, &str, f64), quick: bool) -> Vec<Axis> {
    let (law, integrator, frame_s) = now;
    let is_static = integrator == "static";
    let mut tolerance = tolerances(bodies, &[1e-1, 1e-2, 1e-3, 1e-4, 1e-6, 1e-8], 0.0);
    tolerance.settings.insert(0, Setting::new("as in the scene", 0.5, Vec::new()));
    tolerance.base = 0;
    let mut axes = vec![words(Factor::Law, bodies, "law", &LAWS, law), own_elements(bodies, tree)];
    axes.extend(meshes(bodies, tree, if quick { &[0.5, 1.0] } else { &[0.5, 0.75, 1.0, 1.5] }, 1.0));
    if !is_static {
        let all = ["implicit-euler", "bdf2", "newmark", "symplectic-euler", "midpoint", "rk4"];
        axes.push(words(Factor::Integrator, bodies, "integrator", &all, integrator));
        let factors: &[f64] = if quick { &[2.0, 1.0, 0.5] } else { &[2.0, 1.0, 0.5, 0.25] };
        let sizes: Vec<f64> = factors.iter().map(|f| f * frame_s).collect();
        axes.push(steps(&sizes, frame_s));
    }
    let method = &tree["body"][0]["solver"]["method"];
    let method = method.as_str().unwrap_or("pcg");
    axes.push(words(Factor::Solver, bodies, "solver.method", &["pcg", "cg", "cholesky"], method));
    axes.push(tolerance);
    axes.push(precisions(bodies));
    axes.push(threads(&[1, 2]));
    axes
}

/// Elements; the base is the scene's own, as it stands.
fn own_elements(bodies: &[String], tree: &Value) -> Axis {
    let first = &tree["body"][0];
    let word = |key: &str, default: &'static str| first[key].as_str().unwrap_or(default).to_owned();
    let base = match (word("element", "tet4"), word("locking", "none")) {
        (element, locking) if locking == "none" => element,
        (element, locking) => format!("{element} {locking}"),
    };
    let blocks = tree["body"].as_array().is_some_and(|all| all.iter().all(|b| b["mesh"]["box"].is_object()));
    let pattern = first["mesh"]["box"]["pattern"].as_str().filter(|pattern| *pattern != "hex");
    let mut axis = elements(bodies, blocks.then(|| pattern.unwrap_or("tet5")), &base);
    if let Some(own) = axis.settings.get_mut(axis.base).filter(|setting| setting.label == base) {
        own.set.clear();
    }
    axis
}

/// Meshes with the cells of every body times a factor; none where no body's mesh can be refined.
fn meshes(bodies: &[String], tree: &Value, factors: &[f64], base: f64) -> Option<Axis> {
    let settings: Vec<Setting> = factors.iter().filter_map(|factor| scaled(bodies, tree, *factor)).collect();
    let label = scaled(bodies, tree, base)?.label;
    Some(Axis::new(Factor::Mesh, settings, &label))
}

/// All meshes of the scene, refined by a factor.
fn scaled(bodies: &[String], tree: &Value, factor: f64) -> Option<Setting> {
    let times = |n: f64| ((n * factor).round() as usize).max(1);
    let mut set = Vec::new();
    let mut labels = Vec::new();
    let mut size = 0.0_f64;
    for (id, body) in bodies.iter().zip(tree["body"].as_array()?) {
        let mesh = &body["mesh"];
        if let Some(cells) = mesh["box"]["cells"].as_array() {
            let cells: Vec<usize> = cells.iter().filter_map(Value::as_f64).map(times).collect();
            size = cells.iter().fold(size, |most, n| most.max(*n as f64));
            set.push(format!("body.{id}.mesh.box.cells={cells:?}"));
            labels.push(cells.iter().map(ToString::to_string).collect::<Vec<_>>().join("×"));
        }
        for (key, cells) in [("mesh.cells", &mesh["cells"]), ("mesh.organ.cells", &mesh["organ"]["cells"])] {
            if let Some(cells) = cells.as_f64().map(times) {
                size = size.max(cells as f64);
                set.push(format!("body.{id}.{key}={cells}"));
                labels.push(format!("{cells} cells"));
            }
        }
    }
    (!set.is_empty()).then(|| Setting::new(labels.join(" and "), size, set))
}

/// The reference: the scene's own base, refined in mesh and step.
fn plans(bodies: &[String], axes: &[Axis], tree: &Value, frame_s: f64, quick: bool) -> Vec<Plan> {
    let mut configuration = Configuration::base(axes).with(Factor::Tolerance, &tolerance(bodies, 1e-8));
    let finest = if quick { [0.5, 0.75, 1.0] } else { [1.0, 1.5, 2.0] };
    let meshes = finest.map(|factor| scaled(bodies, tree, factor));
    let meshes = match meshes {
        [Some(a), Some(b), Some(c)] if a.size < b.size && b.size < c.size => Some([a, b, c]),
        _ => None,
    };
    let moves = axes.iter().any(|axis| axis.factor == Factor::Step);
    let steps = moves.then(|| [0.5, 0.25, 0.125].map(|factor| step(factor * frame_s)));
    let mut plans = Vec::new();
    if let Some(bdf2) = axes.iter().find(|a| a.factor == Factor::Integrator).and_then(|a| a.find("bdf2")) {
        let base = configuration.clone();
        configuration = configuration.with(Factor::Integrator, bdf2);
        plans.push(Plan {
            configuration,
            meshes: meshes.clone(),
            steps: steps.clone(),
            words: "BDF2".into(),
        });
        configuration = base;
    }
    plans.push(Plan { configuration, meshes, steps, words: "the scene’s own integrator".into() });
    plans
}

/// Law × mesh, step × mesh, tolerance × mesh.
fn blocks(axes: &[Axis]) -> Vec<Block> {
    let labels = |factor: Factor| {
        let axis = axes.iter().find(|axis| axis.factor == factor);
        axis.map(|axis| axis.settings.iter().map(|s| s.label.clone()).collect()).unwrap_or_default()
    };
    let cheap = vec!["1e-2".to_owned(), "1e-4".to_owned()];
    let simple = vec!["linear".to_owned(), "corotational".to_owned()];
    vec![
        Block(vec![(Factor::Mesh, labels(Factor::Mesh)), (Factor::Law, simple)]),
        Block(vec![(Factor::Mesh, labels(Factor::Mesh)), (Factor::Step, labels(Factor::Step))]),
        Block(vec![(Factor::Mesh, labels(Factor::Mesh)), (Factor::Tolerance, cheap)]),
    ]
}

fn goal(scene: &Scene) -> Goal {
    match scene.checked().probes.as_slice() {
        [first, ..] if !first.id.starts_with(CHOSEN) => {
            Goal { words: format!("displacement of probe {}", first.id), probe: Some(0), direction: None }
        }
        _ => Goal { words: "largest displacement of a point".into(), probe: None, direction: None },
    }
}

/// Simulated frames of a motion.
fn frames(scene: &Scene, frame_s: f64, seconds: Option<f64>, quick: bool) -> u32 {
    let checked = scene.checked();
    let cuts = checked.cuts.iter().map(|cut| cut.at_s + 0.5);
    let paths = checked.tools.iter().filter_map(|tool| tool.path.last()).map(|pose| pose.at_s);
    let until = seconds.unwrap_or_else(|| cuts.chain(paths).fold(1.0, f64::max));
    let most = if seconds.is_some() {
        10_000
    } else if quick {
        25
    } else {
        100
    };
    ((until / frame_s).round() as u32).clamp(1, most)
}

/// How the names of chosen probes begin.
const CHOSEN: &str = "chosen-";

/// The scene itself if it has probes; else with some material points spread through its bodies.
fn with_probes(scene: &Scene) -> Result<Scene, SceneError> {
    if !scene.checked().probes.is_empty() {
        return Ok(scene.clone());
    }
    let simulation = Simulation::new(scene, scene.base_dir())?;
    let mut tables = Vec::new();
    for body in simulation.bodies() {
        let mesh = body.body.cut_mesh().mesh();
        let n = mesh.tets.len();
        let mut points = Vec::new();
        for i in 0..POINTS.min(n) {
            let corners = mesh.corners((2 * i + 1) * n / (2 * POINTS.min(n)));
            let centre = [0, 1, 2].map(|axis| corners.iter().map(|x| x[axis]).sum::<f64>() / 4.0);
            points.push(Point { id: format!("{CHOSEN}{}-{i}", body.id), point_m: centre, side: None });
        }
        tables.push(probe_tables(&body.id, &points));
    }
    scene.apply_sets(&[format!("probe=[{}]", tables.join(", "))])
}

/// Letters, digits and dashes only.
fn slug(name: &str) -> String {
    let plain: String =
        name.chars().map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '-' }).collect();
    let parts: Vec<&str> = plain.split('-').filter(|part| !part.is_empty()).collect();
    if parts.is_empty() { "scene".to_owned() } else { parts.join("-") }
}
