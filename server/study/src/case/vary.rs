//! The factors to vary in a scene. The base of every axis is the scene's own setting, untouched.

use scindo_physics::body::Arithmetic;
use scindo_world::scene::raw::{RawElement, RawMethod};
use scindo_world::scene::{BodySpec, CellSplit, CheckedScene, MeshSource};
use serde_json::Value;

use super::refine::{cells, levels};
use super::subdivide::Subdivisions;
use crate::design::Block;
use crate::design::axes::{Axis, Factor, Setting, on_bodies, step, threads, tolerance};

/// All laws, as they are called in scenes.
pub const LAWS: [&str; 4] = ["linear", "corotational", "stvk", "neo-hookean"];

/// Label of a base that has no name of its own.
pub(super) const OWN: &str = "as in the scene";

/// A scene whose settings are varied.
#[derive(Debug, Clone, Copy)]
pub(super) struct Subject<'a> {
    /// The scene with its names resolved.
    pub scene: &'a CheckedScene,
    /// The scene as it was written.
    pub tree: &'a Value,
    /// Names of its bodies.
    pub bodies: &'a [String],
    /// Refined copies of its mesh files.
    pub files: &'a Subdivisions,
}

impl Subject<'_> {
    /// The value of a key if all bodies agree on it; `None` if they differ.
    pub(super) fn word(&self, key: &str, default: &str) -> Option<String> {
        let bodies = self.tree["body"].as_array()?;
        let of = |body: &Value| {
            let value = key.split('.').fold(body, |at, part| &at[part]);
            value.as_str().unwrap_or(default).to_owned()
        };
        let first = of(bodies.first()?);
        bodies.iter().all(|body| of(body) == first).then_some(first)
    }

    fn is_hex(&self) -> bool {
        self.scene.bodies.iter().any(|body| body.mesh.split() == Some(CellSplit::Hex))
    }

    fn are_blocks(&self) -> bool {
        self.scene.bodies.iter().all(|body| body.mesh.split().is_some())
    }
}

/// The axes of a scene. `cells_wanted`: cells along the longest side, which replace the default meshes.
pub(super) fn axes(
    of: Subject<'_>,
    quick: bool,
    cells_wanted: &[usize],
    threads_wanted: &[usize],
) -> Vec<Axis> {
    let integrator = of.word("integrator", "implicit-euler");
    let explicit = of.scene.bodies.iter().any(|body| body.mechanics.integrator.is_explicit());
    let is_static = integrator.as_deref() == Some("static");
    let mut axes = vec![words(of, Factor::Law, "law", "corotational", &LAWS), elements(of)];
    axes.extend(meshes(of, quick, cells_wanted));
    if !is_static {
        let mut all = vec!["implicit-euler", "bdf2", "newmark", "generalised-alpha"];
        if explicit {
            all.extend(["symplectic-euler", "midpoint", "rk4"]);
        }
        axes.push(words(of, Factor::Integrator, "integrator", "implicit-euler", &all));
        axes.push(steps(of.scene.step_s, if quick { &[2.0, 0.5] } else { &[2.0, 0.5, 0.25, 0.125] }));
    }
    if !explicit {
        let multigrid = of.scene.bodies.iter().all(|body| body.mechanics.method == RawMethod::MgPcg);
        let own = if multigrid { "mg-pcg" } else { "pcg" };
        let mut all = vec!["pcg", "cholesky"];
        // A coarse space goes with tetrahedra on the fast path.
        let tets = |body: &BodySpec| {
            body.mechanics.element == RawElement::Tet4 && body.mechanics.arithmetic() == Arithmetic::Single
        };
        if of.scene.bodies.iter().all(tets) {
            all.push("two-level-pcg");
        }
        axes.push(words(of, Factor::Solver, "solver.method", own, &all));
        axes.push(with_own(
            Factor::Tolerance,
            OWN,
            [1e-2, 1e-4, 1e-6].map(|t| tolerance(of.bodies, t)).to_vec(),
        ));
        let precision = of.word("solver.precision", "auto").unwrap_or_else(|| "auto".to_owned());
        let double = Setting::new("double", 1.0, on_bodies(of.bodies, "solver.precision", "\"double\""));
        axes.push(with_own(Factor::Precision, &precision, vec![double]));
    }
    if !threads_wanted.is_empty() {
        axes.push(threads(threads_wanted));
    }
    axes
}

/// An axis whose base is the unchanged scene, labelled `own`.
fn with_own(factor: Factor, own: &str, others: Vec<Setting>) -> Axis {
    let mut settings = vec![Setting::new(own, 0.0, Vec::new())];
    settings.extend(others.into_iter().filter(|setting| setting.label != own));
    Axis { factor, settings, base: 0 }
}

fn words(of: Subject<'_>, factor: Factor, key: &str, default: &str, all: &[&str]) -> Axis {
    let own = of.word(key, default);
    let setting = |(i, word): (usize, &&str)| {
        Setting::new(*word, 1.0 + i as f64, on_bodies(of.bodies, key, &format!("\"{word}\"")))
    };
    with_own(factor, own.as_deref().unwrap_or(OWN), all.iter().enumerate().map(setting).collect())
}

/// Elements with their remedies against locking, if the mesh of every body supports them.
fn elements(of: Subject<'_>) -> Axis {
    let own = match (of.word("element", "tet4"), of.word("locking", "none")) {
        (Some(element), Some(locking)) if locking == "none" => element,
        (Some(element), Some(locking)) => format!("{element} {locking}"),
        _ => OWN.to_owned(),
    };
    let mut labels = vec!["tet4", "tet4 node-averaged", "tet10"];
    if of.are_blocks() {
        labels.extend(["hex8", "hex8 selective"]);
    }
    let setting = |(i, label): (usize, &&str)| Setting::new(*label, 1.0 + i as f64, element(of, label));
    with_own(Factor::Element, &own, labels.iter().enumerate().map(setting).collect())
}

/// Overrides for an element, with the split of cells that it needs.
pub(super) fn element(of: Subject<'_>, label: &str) -> Vec<String> {
    let (element, locking) = label.split_once(' ').unwrap_or((label, "none"));
    let mut set = on_bodies(of.bodies, "element", &format!("\"{element}\""));
    set.extend(on_bodies(of.bodies, "locking", &format!("\"{locking}\"")));
    for body in &of.scene.bodies {
        let kind = match body.mesh {
            MeshSource::Box { .. } => "box",
            MeshSource::Grid { .. } => "grid",
            _ => continue,
        };
        let is_hex = body.mesh.split() == Some(CellSplit::Hex);
        let pattern = match (element == "hex8", is_hex) {
            (true, false) => "hex",
            (false, true) => "tet6",
            _ => continue,
        };
        set.push(format!("body.{}.mesh.{kind}.pattern=\"{pattern}\"", body.id));
    }
    set
}

/// Meshes as a user would write them; `None` if no mesh can be changed.
fn meshes(of: Subject<'_>, quick: bool, wanted: &[usize]) -> Option<Axis> {
    let make = |factor: f64| cells(of.scene, of.files, factor);
    let own = make(1.0)?;
    let others: Vec<Setting> = if wanted.is_empty() {
        let range = if quick { 0.45..1.5 } else { 0.3..2.9 };
        levels(of.scene, &make).into_iter().filter(|setting| range.contains(&setting.size)).collect()
    } else {
        let longest = of.scene.bodies.iter().map(longest).fold(0.0, f64::max);
        wanted.iter().filter_map(|n| make(*n as f64 / longest)).collect()
    };
    let mut axis = with_own(Factor::Mesh, &own.label, others);
    axis.settings[0].size = 1.0;
    (axis.settings.len() > 1).then_some(axis)
}

/// Cells along the longest side of a body.
fn longest(body: &scindo_world::scene::BodySpec) -> f64 {
    match &body.mesh {
        MeshSource::Box { cells, .. } => cells.iter().copied().max().unwrap_or(1) as f64,
        MeshSource::Grid { lines_m, .. } => lines_m.iter().map(|l| l.len() - 1).max().unwrap_or(1) as f64,
        MeshSource::Surface { cells, .. } | MeshSource::Organ { cells, .. } => *cells as f64,
        MeshSource::File { .. } => 1.0,
    }
}

fn steps(own_s: f64, factors: &[f64]) -> Axis {
    let own = step(own_s);
    let mut axis = with_own(Factor::Step, &own.label, factors.iter().map(|f| step(f * own_s)).collect());
    axis.settings[0].size = own_s;
    axis
}

/// Factors that interact: mesh and step first, then mesh with element, tolerance and law.
pub(super) fn blocks(axes: &[Axis], of: Subject<'_>) -> Vec<Block> {
    let labels = |factor: Factor| {
        let axis = axes.iter().find(|axis| axis.factor == factor);
        axis.map(|axis| axis.settings.iter().map(|s| s.label.clone()).collect::<Vec<_>>()).unwrap_or_default()
    };
    let some = |labels: &[&str]| labels.iter().map(|label| (*label).to_owned()).collect::<Vec<_>>();
    let meshes = || (Factor::Mesh, labels(Factor::Mesh));
    let elements =
        if of.is_hex() { some(&["hex8", "hex8 selective", "tet10"]) } else { some(&["tet10", "hex8"]) };
    vec![
        Block(vec![meshes(), (Factor::Step, labels(Factor::Step))]),
        Block(vec![meshes(), (Factor::Element, elements)]),
        Block(vec![meshes(), (Factor::Tolerance, some(&["1e-2", "1e-4"]))]),
        Block(vec![meshes(), (Factor::Law, some(&["linear"]))]),
        Block(vec![meshes(), (Factor::Integrator, some(&["bdf2", "newmark", "generalised-alpha"]))]),
    ]
}
