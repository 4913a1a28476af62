//! Turns any scene into a case: factors to vary, points to compare, a reference by refinement.

use std::path::Path;

use scindo_world::scene::{BodySpec, CheckedScene, Scene, SceneError, ToolSpec};
use scindo_world::simulation::Simulation;

use super::definition::{Case, Truth};
use super::ladder::Ladder;
use super::probe::{Point, probe_tables};
use super::refine::{Split, aligned, levels, uneven};
use super::subdivide::Subdivisions;
use super::vary::{self, OWN, Subject};
use crate::design::Configuration;
use crate::design::axes::{Axis, Factor, Setting, on_bodies, tolerance};
use crate::trial::Protocol;
use crate::trial::distance::Goal;

/// Compared points per body if the scene has no probes.
const POINTS: usize = 8;

/// Longest motion if the user sets none [frames]: in a full study, and in a quick one.
const MOST_FRAMES: [u32; 2] = [400, 50];

/// The user's choices for the study of a scene.
#[derive(Debug, Clone, Copy)]
pub struct Wishes<'a> {
    /// Simulated time of a motion [s]. `None`: as long as its events last and the time allows.
    pub seconds: Option<f64>,
    /// Use only coarse meshes and few frames.
    pub quick: bool,
    /// Cells along the longest side, instead of the default meshes; empty for the defaults.
    pub cells: &'a [usize],
    /// Threads to compare. Empty: one thread, as `scindo run` uses.
    pub threads: &'a [usize],
    /// Directory for refined copies of mesh files.
    pub directory: &'a Path,
}

/// Builds a case from a scene.
///
/// # Errors
/// Problems of the scene.
pub fn from_scene(scene: &Scene, wishes: Wishes<'_>) -> Result<Case, SceneError> {
    let scene = with_probes(scene)?;
    let checked = scene.checked();
    let tree = scene.to_json();
    let bodies: Vec<String> = checked.bodies.iter().map(|body| body.id.clone()).collect();
    let mut notes = Vec::new();
    let files = Subdivisions::write(checked, scene.base_dir(), wishes.directory).unwrap_or_else(|why| {
        notes.push(format!("the mesh file is not refined: {why}"));
        Subdivisions::default()
    });
    let of = Subject { scene: checked, tree: &tree, bodies: &bodies, files: &files };
    let axes = vary::axes(of, wishes.quick, wishes.cells, wishes.threads);
    let (protocol, fewest) = protocol(checked, of, wishes);
    if !axes.iter().any(|axis| axis.factor == Factor::Mesh) {
        notes.push(
            "no mesh of this scene can be refined: the error of the mesh is not part of the study".into(),
        );
    }
    let law = of.word("law", "corotational").unwrap_or_else(|| OWN.to_owned());
    let truth = Truth::Refined { law, ladders: ladders(of, &axes) };
    Ok(Case {
        title: scene.name().to_owned(),
        about: format!("The scene {}. Settings that are not listed are those of the scene.", scene.file()),
        name: slug(scene.name()),
        goal: goal(checked),
        blocks: vary::blocks(&axes, of),
        truth,
        bodies,
        protocol,
        fewest_frames: fewest,
        axes,
        notes,
        colour: Factor::Mesh,
        shape: Factor::Element,
        scene,
    })
}

/// The protocol of the runs, and the fewest frames that still show what happens.
fn protocol(scene: &CheckedScene, of: Subject<'_>, wishes: Wishes<'_>) -> (Protocol, u32) {
    let cuts = scene.cuts.iter().map(|cut| cut.at_s).reduce(f64::max);
    let paths = scene.tools.iter().filter_map(|tool| Some(tool.path.last()?.at_s));
    let settled = scene.bodies.iter().map(BodySpec::settled_s);
    let path_s = paths.chain(settled).fold(0.0, f64::max);
    let lies_still = of.word("integrator", "implicit-euler").as_deref() == Some("static");
    if lies_still && path_s == 0.0 && cuts.is_none_or(|at| at == 0.0) && wishes.seconds.is_none() {
        return (Protocol::Static, 0);
    }
    let frame_s = scene.step_s;
    let frames = |seconds: f64| ((seconds / frame_s).round() as u32).max(4);
    let most = frames(wishes.seconds.unwrap_or_else(|| cuts.unwrap_or(0.0).max(0.5).max(path_s - 0.5) + 0.5));
    let most = match wishes.seconds {
        Some(_) => most,
        None => most.clamp(20, MOST_FRAMES[usize::from(wishes.quick)]),
    };
    let fewest = match wishes.seconds {
        Some(_) => most,
        None => frames(0.3_f64.max(cuts.map_or(0.0, |at| at + 0.2)).max(path_s.min(2.0))).clamp(20, most),
    };
    (Protocol::Motion { frame_s, frames: most }, fewest)
}

/// Ways to the reference, best first. Quadratic tetrahedra converge faster, so they precede the scene's own element;
/// where a scene cuts, the front of the cut limits both, and the cheaper element comes first. Second order in time
/// precedes the scene's own integrator. Ways that the scene's check refuses drop out when they are tried.
fn ladders(of: Subject<'_>, axes: &[Axis]) -> Vec<Ladder> {
    let own = Configuration::base(axes);
    let explicit = of.scene.bodies.iter().any(|body| body.mechanics.integrator.is_explicit());
    let moves = axes.iter().any(|axis| axis.factor == Factor::Integrator);
    let quadratic = Setting::new("tet10", 0.0, vary::element(of, "tet10"));
    let bdf2 = Setting::new("bdf2", 0.0, on_bodies(of.bodies, "integrator", "\"bdf2\""));
    let mut integrators = vec![(None, "the scene’s own integrator")];
    if moves && !explicit {
        integrators.insert(0, (Some(&bdf2), "BDF2"));
    } else if !moves {
        integrators[0].1 = "equilibrium";
    }
    let cuts = !of.scene.cuts.is_empty() || of.scene.tools.iter().any(ToolSpec::cuts);
    let elements = if cuts { [None, Some(&quadratic)] } else { [Some(&quadratic), None] };
    let mut ladders = Vec::new();
    for (integrator, how) in integrators {
        for element in elements.into_iter().filter(|e| e.is_none() || !explicit) {
            let mut configuration = if explicit { own.clone() } else { tight(of, &own) };
            if let Some(bdf2) = integrator {
                configuration = configuration.with(Factor::Integrator, bdf2);
            }
            let split = if element.is_some() { Split::Tets } else { Split::Own };
            if let Some(element) = element {
                configuration = configuration.with(Factor::Element, element);
            }
            let mut meshes = levels(of.scene, &|factor| aligned(of.scene, of.files, factor, split));
            if meshes.len() < 3 {
                // No mesh has faces where the regions end. The study reports what they select instead.
                meshes = levels(of.scene, &|factor| uneven(of.scene, of.files, factor, split));
            }
            let element = element.map_or_else(|| own.label(Factor::Element).to_owned(), |e| e.label.clone());
            ladders.push(Ladder {
                configuration,
                meshes,
                step_s: moves.then_some(of.scene.step_s),
                words: format!("{element}, {how}"),
            });
        }
    }
    ladders
}

/// The scene's own settings, solved to the last significant digits.
fn tight(of: Subject<'_>, own: &Configuration) -> Configuration {
    let mut exact = tolerance(of.bodies, 1e-8);
    exact.set.extend(on_bodies(of.bodies, "solver.precision", "\"double\""));
    for body in &of.scene.bodies {
        if body.mechanics.newton_steps.is_some_and(|steps| steps < 20) {
            exact.set.push(format!("body.{}.solver.newton_steps=20", body.id));
        }
    }
    let relaxes = of.word("solver.method", "pcg").as_deref() == Some("relaxation");
    let direct = Setting::new("cholesky", 0.0, on_bodies(of.bodies, "solver.method", "\"cholesky\""));
    let solver = if relaxes { own.with(Factor::Solver, &direct) } else { own.clone() };
    solver.with(Factor::Tolerance, &exact)
}

fn goal(scene: &CheckedScene) -> Goal {
    match scene.probes.as_slice() {
        [first, ..] if !first.id.starts_with(CHOSEN) => {
            Goal { words: format!("displacement of probe {}", first.id), probe: Some(0), direction: None }
        }
        _ => Goal { words: "largest displacement of a point".into(), probe: None, direction: None },
    }
}

/// Prefix of the names of chosen probes.
const CHOSEN: &str = "chosen-";

/// Returns the scene itself if it has probes. Otherwise it adds material points throughout the bodies, as
/// deep inside as possible so that coarser meshes hold them as well.
fn with_probes(scene: &Scene) -> Result<Scene, SceneError> {
    if !scene.checked().probes.is_empty() {
        return Ok(scene.clone());
    }
    let simulation = Simulation::new(scene, scene.base_dir())?;
    let mut tables = Vec::new();
    for body in simulation.bodies() {
        let points: Vec<Point> = points(body)
            .into_iter()
            .enumerate()
            .map(|(i, point_m)| Point { id: format!("{CHOSEN}{}-{i}", body.id), point_m, side: None })
            .collect();
        tables.push(probe_tables(&body.id, &points));
    }
    scene.apply_sets(&[format!("probe=[{}]", tables.join(", "))])
}

/// Centroids of elements. A body is cut into [`POINTS`] slices along its longest side, and the element
/// deepest below the surface is taken from each.
fn points(body: &scindo_world::simulation::SimBody) -> Vec<[f64; 3]> {
    let mut centres: Vec<nalgebra::Vector3<f64>> = Vec::new();
    let rest = body.body.rest_positions();
    body.body.for_pieces(&mut |_, copies, volumes| {
        let parts = copies.iter().zip(volumes).map(|(&copy, volume)| *volume * rest[copy as usize]);
        centres.push(parts.sum::<nalgebra::Vector3<f64>>() / volumes.iter().sum::<f64>());
    });
    let [low, high] = body.body.bounds();
    let axis = (high - low).imax();
    let x = body.body.rest_positions();
    let skin: Vec<_> = body.body.surface().vertices.iter().map(|v| v.position(x)).collect();
    let skin: Vec<_> = skin.iter().step_by(skin.len().div_ceil(500).max(1)).collect();
    let every = centres.len().div_ceil(2_000).max(1);
    let mut best = [const { None::<(f64, [f64; 3])> }; POINTS];
    for centre in centres.into_iter().step_by(every) {
        let share = (centre[axis] - low[axis]) / (high[axis] - low[axis]);
        let slice = ((share * POINTS as f64) as usize).min(POINTS - 1);
        let depth = skin.iter().map(|s| (*s - centre).norm_squared()).fold(f64::INFINITY, f64::min);
        if best[slice].is_none_or(|(deepest, _)| depth > deepest) {
            best[slice] = Some((depth, centre.into()));
        }
    }
    best.into_iter().flatten().map(|(_, point)| point).collect()
}

/// Reduces a name to letters, digits and dashes.
fn slug(name: &str) -> String {
    let plain: String =
        name.chars().map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '-' }).collect();
    let parts: Vec<&str> = plain.split('-').filter(|part| !part.is_empty()).collect();
    if parts.is_empty() { "scene".to_owned() } else { parts.join("-") }
}
