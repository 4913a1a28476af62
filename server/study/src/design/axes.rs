//! The factors of a study: axes, their settings, and the keys of the scene that a setting changes.

use serde::{Deserialize, Serialize};

use crate::words::short;

/// A property of a scene that a study varies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Factor {
    /// Constitutive law.
    Law,
    /// Finite element, with its remedy against locking.
    Element,
    /// Method of cutting.
    Cutting,
    /// Number of cells of the mesh.
    Mesh,
    /// Time integration.
    Integrator,
    /// Time step.
    Step,
    /// Linear solver.
    Solver,
    /// Tolerance at which the solver stops.
    Tolerance,
    /// Floating-point precision.
    Precision,
    /// Number of threads that work on a step.
    Threads,
}

impl Factor {
    /// All factors, in the order of the columns of a table.
    pub const ALL: [Factor; 10] = [
        Factor::Law,
        Factor::Element,
        Factor::Cutting,
        Factor::Mesh,
        Factor::Integrator,
        Factor::Step,
        Factor::Solver,
        Factor::Tolerance,
        Factor::Precision,
        Factor::Threads,
    ];

    /// Name in tables and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Factor::Law => "law",
            Factor::Element => "element",
            Factor::Cutting => "cutting",
            Factor::Mesh => "mesh",
            Factor::Integrator => "integrator",
            Factor::Step => "step",
            Factor::Solver => "solver",
            Factor::Tolerance => "tolerance",
            Factor::Precision => "precision",
            Factor::Threads => "threads",
        }
    }
}

/// One value of a factor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Setting {
    /// Name for people, unique within its axis.
    pub label: String,
    /// Overrides of the scene, as `key=value`.
    pub set: Vec<String>,
    /// Number of threads, if this is a setting of [`Factor::Threads`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub threads: Option<usize>,
    /// Cells along the longest side, step [s] or tolerance; used to sort and refine.
    #[serde(default)]
    pub size: f64,
}

impl Setting {
    /// A setting that changes the keys `set`.
    pub fn new(label: impl Into<String>, size: f64, set: Vec<String>) -> Self {
        Self { label: label.into(), set, threads: None, size }
    }
}

/// The settings of a factor that a case tries.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// The factor that is varied.
    pub factor: Factor,
    /// The values to try.
    pub settings: Vec<Setting>,
    /// Index of the base, around which the others are varied one at a time.
    pub base: usize,
}

impl Axis {
    /// An axis whose base is the setting labelled `base`, or the first.
    pub fn new(factor: Factor, settings: Vec<Setting>, base: &str) -> Self {
        let base = settings.iter().position(|s| s.label == base).unwrap_or(0);
        Self { factor, settings, base }
    }

    /// The setting called `label`.
    pub fn find(&self, label: &str) -> Option<&Setting> {
        self.settings.iter().find(|s| s.label == label)
    }

    /// The base setting; `None` if no setting is left after narrowing.
    pub fn base(&self) -> Option<&Setting> {
        self.settings.get(self.base)
    }
}

/// `body.<id>.<key>=<value>` for every body.
pub fn on_bodies(bodies: &[String], key: &str, value: &str) -> Vec<String> {
    bodies.iter().map(|id| format!("body.{id}.{key}={value}")).collect()
}

/// An axis over values of one key, such as `law`.
pub fn words(factor: Factor, bodies: &[String], key: &str, words: &[&str], base: &str) -> Axis {
    let setting = |(i, word): (usize, &&str)| {
        Setting::new(*word, i as f64, on_bodies(bodies, key, &format!("\"{word}\"")))
    };
    Axis::new(factor, words.iter().enumerate().map(setting).collect(), base)
}

/// Precision of the arithmetic. The program's own choice (single where allowed, otherwise mixed) sets no key.
pub fn precisions(bodies: &[String]) -> Axis {
    let words = ["single", "mixed", "double"].into_iter().enumerate();
    let word = |(i, word): (usize, &str)| {
        Setting::new(word, i as f64 + 1.0, on_bodies(bodies, "solver.precision", &format!("\"{word}\"")))
    };
    let automatic = Setting::new("auto", 0.0, Vec::new());
    Axis::new(Factor::Precision, [automatic].into_iter().chain(words.map(word)).collect(), "auto")
}

/// Elements and their remedies against locking. `pattern` splits the cells of a block into tetrahedra.
/// Without it the mesh is no block, hence there are no hexahedra.
pub fn elements(bodies: &[String], pattern: Option<&str>, base: &str) -> Axis {
    let setting = |(i, label): (usize, &&str)| {
        let (element, locking) = label.split_once(' ').unwrap_or((label, "none"));
        let mut set = on_bodies(bodies, "element", &format!("\"{element}\""));
        set.extend(on_bodies(bodies, "locking", &format!("\"{locking}\"")));
        if let Some(split) = pattern {
            let pattern = if element == "hex8" { "hex" } else { split };
            set.extend(on_bodies(bodies, "mesh.box.pattern", &format!("\"{pattern}\"")));
        }
        Setting::new(*label, i as f64, set)
    };
    let all = ["tet4", "tet4 node-averaged", "tet10", "hex8", "hex8 selective"];
    let some = if pattern.is_some() { &all[..] } else { &all[..3] };
    Axis::new(Factor::Element, some.iter().enumerate().map(setting).collect(), base)
}

/// Tolerances of the linear solver: relative preconditioned residuals, with enough iterations to reach them.
pub fn tolerances(bodies: &[String], tolerances: &[f64], base: f64) -> Axis {
    let settings = tolerances.iter().map(|t| tolerance(bodies, *t)).collect();
    Axis::new(Factor::Tolerance, settings, &tolerance_label(base))
}

/// A setting with one tolerance.
pub fn tolerance(bodies: &[String], tolerance: f64) -> Setting {
    let mut set = on_bodies(bodies, "solver.tolerance", &format!("{tolerance:e}"));
    set.extend(on_bodies(bodies, "solver.iterations", "20000"));
    Setting::new(tolerance_label(tolerance), tolerance, set)
}

/// A fixed number of iterations, whatever residual they leave: a setting for speed, not a solution.
pub fn iterations(bodies: &[String], iterations: u32) -> Setting {
    let mut set = on_bodies(bodies, "solver.tolerance", "1e-12");
    set.extend(on_bodies(bodies, "solver.iterations", &iterations.to_string()));
    Setting::new(format!("{iterations} iterations"), 1.0, set)
}

fn tolerance_label(tolerance: f64) -> String {
    format!("{tolerance:.0e}")
}

/// Time steps [s]; `base_s` is the base.
pub fn steps(steps_s: &[f64], base_s: f64) -> Axis {
    Axis::new(Factor::Step, steps_s.iter().map(|h| step(*h)).collect(), &step(base_s).label)
}

/// A setting with one time step [s].
pub fn step(step_s: f64) -> Setting {
    Setting::new(format!("{} ms", short(1e3 * step_s)), step_s, vec![format!("world.step_s={step_s:?}")])
}

/// Numbers of threads to compare.
pub fn threads(threads: &[usize]) -> Axis {
    let setting =
        |n: &usize| Setting { threads: Some(*n), ..Setting::new(n.to_string(), *n as f64, Vec::new()) };
    Axis::new(Factor::Threads, threads.iter().map(setting).collect(), "1")
}

/// Meshes of a block. The size of a setting is its number of cells along the longest side.
pub fn cells(body: &str, cells: &[[usize; 3]], base: [usize; 3]) -> Axis {
    let settings = cells.iter().map(|c| block(body, *c)).collect();
    Axis::new(Factor::Mesh, settings, &cells_label(base))
}

/// A setting with one mesh of a block.
pub fn block(body: &str, cells: [usize; 3]) -> Setting {
    let [x, y, z] = cells;
    let set = vec![format!("body.{body}.mesh.box.cells=[{x},{y},{z}]")];
    Setting::new(cells_label(cells), x.max(y).max(z) as f64, set)
}

fn cells_label([x, y, z]: [usize; 3]) -> String {
    format!("{x}×{y}×{z}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_are_short() {
        assert_eq!(step(0.04).label, "40 ms");
        assert_eq!(step(0.0025).label, "2.5 ms");
        assert_eq!(tolerance(&["b".into()], 1e-6).label, "1e-6");
    }

    #[test]
    fn a_setting_names_keys_of_every_body() {
        let bodies = ["a".to_owned(), "b".to_owned()];
        let axis = words(Factor::Law, &bodies, "law", &["linear", "stvk"], "stvk");
        assert_eq!(axis.base, 1);
        assert_eq!(axis.settings[0].set, ["body.a.law=\"linear\"", "body.b.law=\"linear\""]);
    }
}
