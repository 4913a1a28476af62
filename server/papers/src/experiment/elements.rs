//! Tetrahedra, hexahedra and octree cells at equal error, through scenes.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use scindo_study::reference::richardson::extrapolate;
use scindo_study::report::plot::{Failure, Mark, Plot};
use scindo_study::report::result::{ExperimentResult, Plots, Table, Unit};
use scindo_study::trial::{self, Limits, Protocol, Trial};
use scindo_world::scene::Scene;

use crate::lab::{ExperimentBench, Trouble};

/// The clamped cube.
const SCENE: &str = include_str!("../../cases/clamped.toml");
/// A cut from the free face to the middle, at half height.
const CUT: &str = r#"
[[cut]]
body = "cube"
at_s = 0.0
sweep_m = [[[1.5, -0.5, 0.5], [1.5, 1.5, 0.5]], [[0.5, -0.5, 0.5], [0.5, 1.5, 0.5]]]
"#;
/// A run may take this long [s].
const LIMITS: Limits = Limits { run_s: 120.0, repeat_s: 2.0, repeats: 5 };
/// Cells across.
const ACROSS: [usize; 5] = [8, 12, 16, 32, 64];

/// A kind of element.
struct Kind {
    name: &'static str,
    /// Keys of the body.
    set: &'static [&'static str],
    /// Most cells across that are tried.
    most: usize,
    /// Whether its bodies can be cut.
    cuts: bool,
}

const KINDS: [Kind; 5] = [
    Kind { name: "tet4, CG", set: &[], most: 32, cuts: true },
    Kind {
        name: "tet10, Cholesky",
        set: &["element=\"tet10\"", "solver.method=\"cholesky\""],
        most: 12,
        cuts: false,
    },
    Kind { name: "hex8, CG", set: &["element=\"hex8\"", "mesh.box.pattern=\"hex\""], most: 32, cuts: false },
    Kind { name: "octree, uniform", set: OCTREE, most: 64, cuts: true },
    Kind {
        name: "octree, two levels",
        set: &[
            "element=\"octree\"",
            "mesh.box.pattern=\"hex\"",
            "solver.method=\"mg-pcg\"",
            "octree.levels=2",
        ],
        most: 64,
        cuts: true,
    },
];
const OCTREE: &[&str] =
    &["element=\"octree\"", "mesh.box.pattern=\"hex\"", "solver.method=\"mg-pcg\"", "octree.levels=0"];
/// The kind from whose finest three runs the limit is extrapolated.
const LIMIT: usize = 3;

/// A run and the cells across it.
type Run = (usize, Trial);

/// The experiment.
///
/// # Errors
/// The user ended the study, or the limit is not known.
pub(super) fn elements(bench: &mut ExperimentBench<'_>) -> Result<ExperimentResult, Trouble> {
    let mut result = ExperimentResult {
        name: "cells-elements",
        title: "Tetrahedra and octree cells at equal error".into(),
        about: "A cube held at one face bends under its weight, linear and static, on one thread: whole, and cut \
            from the free face to the middle (X-FEM on tetrahedra, links of cells on the octree). Errors are those \
            of the displacements of five points, relative to the limit of uniform cells over their finest three \
            sizes. Times are those of a solution to 1e-6, set-up apart."
            .into(),
        ..ExperimentResult::default()
    };
    let mut table = Table::new(
        "Time at equal error",
        "Seconds at which a kind of element has the error of uniform cells, 32 across (16 in a quick study), \
         interpolated between its own runs. The limit itself is known to within ±.",
        &[
            ("error", Unit::Number),
            ("± of the limit", Unit::Number),
            ("time", Unit::Seconds),
            ("over octree, uniform", Unit::Times),
        ],
    );
    let mut uniform = Table::new(
        "Uniform and adaptive cells",
        "How far the two are apart, and from the limit.",
        &[
            ("uniform cells", Unit::Count),
            ("adaptive cells", Unit::Count),
            ("uniform: error", Unit::Number),
            ("adaptive: error", Unit::Number),
            ("apart", Unit::Number),
        ],
    );
    let mut plots = Plots {
        caption: "Error over time: left the whole cube, right the cut one.".into(),
        ..Plots::default()
    };
    for (name, cut) in [("whole", ""), ("cut", CUT)] {
        let scene = Scene::from_toml(&format!("{SCENE}{cut}"))?;
        let runs = runs(bench, &scene, !cut.is_empty(), name)?;
        // Nothing is known of the exact solution, so the limit of uniform cells stands for it, uncut and cut.
        let done: Vec<&Run> = runs[LIMIT].iter().filter(|run| run.1.is_done()).collect();
        let [.., first, second, third] = &done[..] else {
            return Err("fewer than three runs of uniform cells".into());
        };
        let sizes = [first, second, third].map(|run| 1.0 / run.0 as f64);
        let limit = extrapolate(sizes, [&first.1.series, &second.1.series, &third.1.series])
            .ok_or("uniform cells have no limit")?;
        let error = |trial: &Trial| trial.series.minus(&limit.value).norm() / limit.value.norm();
        let courses: Vec<Vec<[f64; 2]>> = runs.iter().map(|runs| course(runs, &error)).collect();
        plots.plots.push(plot(name, &runs, &error, limit.error_bar));
        // All kinds are asked for their time at one error, that of uniform cells of this size.
        let at = if bench.is_quick() { 16 } else { 32 };
        let goal = runs[LIMIT].iter().find(|run| run.0 == at).ok_or("no such run")?;
        let goal = (error(&goal.1), 1e-3 * goal.1.cost.median_ms);
        for (kind, course) in KINDS.iter().zip(&courses).filter(|(_, course)| !course.is_empty()) {
            let seconds = time_to(course, goal.0);
            let values =
                [Some(goal.0), Some(limit.error_bar), seconds, seconds.map(|seconds| seconds / goal.1)];
            table.row(format!("{name}, {}", kind.name), &values);
        }
        // Uniform and adaptive cells run at the same sizes; their difference is what larger cells inside cost.
        for ((across, own), (_, other)) in runs[LIMIT].iter().zip(&runs[LIMIT + 1]) {
            let apart = own.series.minus(&other.series).norm() / limit.value.norm();
            let values = [own.elements as f64, other.elements as f64, error(own), error(other), apart];
            uniform.row(format!("{name}, {across} across"), &values.map(Some));
        }
    }
    result.tables.extend([table, uniform]);
    result.plots.push(plots);
    Ok(result)
}

/// Runs of all kinds, coarse to fine.
fn runs(
    bench: &mut ExperimentBench<'_>,
    scene: &Scene,
    is_cut: bool,
    name: &str,
) -> Result<Vec<Vec<Run>>, Trouble> {
    let most = if bench.is_quick() { 16 } else { 64 };
    let total = 2 * KINDS.len() * ACROSS.len();
    let mut all = Vec::new();
    for kind in &KINDS {
        let mut runs = Vec::new();
        for across in ACROSS.into_iter().filter(|&n| n <= most.min(kind.most) && (kind.cuts || !is_cut)) {
            bench.begin(format!("{name} cube, {}, {across} across", kind.name), total)?;
            let mut set = vec![format!("body.cube.mesh.box.cells=[{across},{across},{across}]")];
            set.extend(kind.set.iter().map(|set| format!("body.cube.{set}")));
            let stop: &AtomicBool = bench.stop();
            let trial =
                trial::run(&scene.apply_sets(&set)?, Path::new("."), 1, Protocol::Static, LIMITS, stop);
            runs.push((across, trial.ok_or("interrupted")?));
        }
        all.push(runs);
    }
    Ok(all)
}

/// Seconds and errors of the runs that gave a result.
fn course(runs: &[Run], error: &impl Fn(&Trial) -> f64) -> Vec<[f64; 2]> {
    let done = runs.iter().filter(|run| run.1.is_done());
    done.map(|(_, trial)| [1e-3 * trial.cost.median_ms, error(trial)]).collect()
}

/// Seconds at which the error falls to `goal`, between two runs or beyond the last by their slope in logarithms.
fn time_to(course: &[[f64; 2]], goal: f64) -> Option<f64> {
    let at = course.iter().position(|point| point[1] <= goal).unwrap_or(course.len().saturating_sub(1));
    let [a, b] = [course.get(at.max(1) - 1)?, course.get(at.max(1))?].map(|p| p.map(f64::ln));
    let slope = (b[0] - a[0]) / (b[1] - a[1]);
    // Errors that do not fall tell nothing.
    (slope < 0.0).then(|| (a[0] + slope * (goal.ln() - a[1])).exp())
}

fn plot(name: &str, runs: &[Vec<Run>], error: &impl Fn(&Trial) -> f64, error_bar: f64) -> Plot {
    let mut plot = Plot {
        size: [520.0, 420.0],
        x_label: "time of a solution".into(),
        y_label: "error of displacements".into(),
        marks: Vec::new(),
        failures: Vec::new(),
        error_bar,
        budget_ms: None,
        colours: Vec::new(),
        shapes: vec![(0, String::new())],
        title: Some(format!("{name} cube")),
    };
    for (colour, (kind, runs)) in KINDS.iter().zip(runs).enumerate() {
        if !runs.is_empty() {
            plot.colours.push((colour, kind.name.to_owned()));
        }
        for (across, trial) in runs {
            let title = format!("{}, {across} across", kind.name);
            if trial.is_done() {
                let (x, y) = (trial.cost.median_ms, error(trial));
                let title = format!("{title}: {y:.2e} in {x:.1} ms");
                plot.marks.push(Mark { x, y, colour, shape: 0, rank: None, title });
            } else {
                plot.failures.push(Failure { x: None, title: format!("{title}: {}", trial.reason) });
            }
        }
    }
    plot
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_follow_slopes() {
        let course = [[1.0, 0.1], [10.0, 0.01], [100.0, 0.001]];
        let close =
            |found: Option<f64>, expected: f64| found.is_some_and(|t| (t / expected - 1.0).abs() < 1e-9);
        assert!(close(time_to(&course, 0.01), 10.0) && close(time_to(&course, 0.001), 100.0));
        assert!(close(time_to(&course, 1e-4), 1000.0) && close(time_to(&course, 1.0), 0.1));
        assert!(time_to(&[[1.0, 0.1], [2.0, 0.2]], 0.01).is_none() && time_to(&[[1.0, 0.1]], 0.2).is_none());
    }
}
