//! What the front of a cut costs where it ends inside elements, over its place in them.
//!
//! # Source
//! Schoch et al. 2013: Simulation of surgical cutting in soft tissue using the extended finite element method, §6.

use std::path::Path;

use scindo_world::scene::Scene;

use super::{ExperimentBench, ExperimentResult, Plots, Table, Trouble, Unit};
use crate::case::Truth;
use crate::case::cutting::{Inside, Pull, beam_mesh, gold, pulled};
use crate::stress::chart::{Chart, Line};
use crate::trial::{self, Limits, Protocol};

const SCENE: &str = include_str!("../../cases/r2-tc1.toml");
const PULLS: [(&str, Pull); 2] = [("gravity", Pull::Gravity), ("force", Pull::Force)];
const LAWS: [&str; 2] = ["linear", "corotational"];
/// Where the front lies in its element: the share of it that the blade has covered.
const PLACES: [f64; 5] = [0.1, 0.3, 0.5, 0.7, 0.9];
/// Values of `cutting.front`.
const RULES: [&str; 2] = ["behind", "calibrated"];
/// Lines of cells across the beam [m], 6 cells; the front is at 0.015 and moves lines 2 and 3.
const LINES_M: [f64; 7] = [0.0, 0.005, 0.01, 0.015, 0.02, 0.025, 0.03];
/// A run may take this long [s].
const LIMITS: Limits = Limits { run_s: 900.0, repeat_s: 0.0, repeats: 1 };

/// Value of `cutting.front` and place of the front in its element; `None` for a mesh made with the cut.
type Cut = Option<(&'static str, f64)>;

/// The experiment.
///
/// # Errors
/// The user ended the study.
pub fn front(bench: &mut ExperimentBench<'_>) -> Result<ExperimentResult, Trouble> {
    let mut result = ExperimentResult {
        name: "front",
        title: "The front of a cut inside elements".into(),
        about: format!(
            "Schoch’s beam of 30 × 60 × 200 mm, cut through to half its depth, 6 cells of five linear tetrahedra across. The \
             plane of the cut lies a third of a cell inside elements, and its front at several places between two \
             lines of cells: at {:.1} the blade has only just entered the last cells, at {:.1} it has almost left them. \
             With cutting.front = \"behind\", the default, an element opens when the blade has left it; with \
             \"calibrated\" the cut goes on ahead of the blade by 0.7 of the mean length of an element’s edges. The mesh of \
             `pre-cut` has as many cells, with faces at the true front. Errors are ‖u − u*‖/‖u*‖ over 24 points of \
             the beam, against stored solutions by hexahedra of order 3 and 4.",
            PLACES[0],
            PLACES[PLACES.len() - 1],
        ),
        ..ExperimentResult::default()
    };
    let total = PULLS.len() * LAWS.len() * (1 + RULES.len() * PLACES.len());
    let mut plots =
        Plots { caption: "Error over the place of the front in its cell.".into(), ..Plots::default() };
    let mut table = Table::new(
        "Errors",
        "Places are shares of the last cell that the blade has covered. The ratio is that of the error of `calibrated` to \
         that of the pre-cut mesh.",
        &[
            ("error, behind", Unit::Number),
            ("error, calibrated", Unit::Number),
            ("error, pre-cut", Unit::Number),
            ("calibrated over pre-cut", Unit::Times),
        ],
    );
    for (pull_name, pull) in PULLS {
        let mut chart = Chart::new(pull_name, "place of the front", "error");
        for law in LAWS {
            let name = format!("{pull_name}, {law}");
            bench.begin(format!("{name}, pre-cut"), total)?;
            let precut = error(bench, pull, law, None)?;
            let mut lines = RULES.map(|rule| Line { name: format!("{law}, {rule}"), points: Vec::new() });
            let mut ratios = Vec::new();
            for place in PLACES {
                let mut errors = [None; 2];
                for (k, rule) in RULES.into_iter().enumerate() {
                    bench.begin(format!("{name}, front at {place}, {rule}"), total)?;
                    match error(bench, pull, law, Some((rule, place)))? {
                        Ok(found) => {
                            errors[k] = Some(found);
                            lines[k].points.push([place, found]);
                        }
                        Err(reason) => {
                            result.notes.push(format!("{name}, front at {place}, {rule}: {reason}"));
                        }
                    }
                }
                let precut = precut.as_ref().ok().copied();
                let ratio = errors[1].zip(precut).map(|(calibrated, precut)| calibrated / precut);
                ratios.extend(ratio);
                table.row(format!("{pull_name}, {law}, {place}"), &[errors[0], errors[1], precut, ratio]);
            }
            let mean = (!ratios.is_empty()).then(|| ratios.iter().sum::<f64>() / ratios.len() as f64);
            table.row(format!("{pull_name}, {law}, mean"), &[None, None, None, mean]);
            match precut {
                Ok(error) => {
                    let points = [PLACES[0], PLACES[PLACES.len() - 1]].map(|place| [place, error]).to_vec();
                    chart.lines.push(Line { name: format!("{law}, pre-cut"), points });
                }
                Err(reason) => result.notes.push(format!("{name}, pre-cut: {reason}")),
            }
            chart.lines.extend(lines);
        }
        plots.charts.push(chart);
    }
    result.tables.push(table);
    result.plots.push(plots);
    Ok(result)
}

/// Relative error of a run, or why it has none.
fn error(
    bench: &ExperimentBench<'_>,
    pull: Pull,
    law: &str,
    cut: Cut,
) -> Result<Result<f64, String>, Trouble> {
    let scene = scene(pull, law, cut)?;
    let trial =
        trial::run(&scene, Path::new("."), 1, Protocol::Static, LIMITS, bench.stop()).ok_or("interrupted")?;
    if !trial.is_done() {
        return Ok(Err(trial.reason));
    }
    let Truth::Known { series, .. } = gold(pull).truth(law, None, "") else {
        return Err("there is no stored solution".into());
    };
    Ok(Ok(trial.series.minus(&series).norm() / series.norm()))
}

fn scene(pull: Pull, law: &str, cut: Cut) -> Result<Scene, Trouble> {
    let (mut x_m, mut set) = (LINES_M.to_vec(), Vec::new());
    let mut inside = Inside::NOTHING;
    if let Some((rule, place)) = cut {
        let (front, width) = (LINES_M[3], LINES_M[3] - LINES_M[2]);
        x_m[2] = front - place * width;
        x_m[3] = front + (1.0 - place) * width;
        inside.plane = true;
        set.push(format!("body.beam.cutting.front=\"{rule}\""));
    }
    let half_z = 20;
    set.extend([
        gold(Pull::Force).probes("beam"),
        format!("body.beam.law=\"{law}\""),
        format!("body.beam.mesh={}", beam_mesh(&x_m, 2 * (LINES_M.len() - 1), half_z, inside)),
    ]);
    set.extend(pulled(pull));
    Ok(Scene::from_toml(SCENE)?.apply_sets(&set)?)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use std::sync::atomic::AtomicBool;

    use super::*;

    /// A front in the middle of an element costs as much as one on its border, and no more than half of what it costs
    /// where the cut stays behind the blade.
    #[test]
    fn a_calibrated_front_costs_no_accuracy() {
        let stop = AtomicBool::new(false);
        let error = |cut: Cut| {
            let scene = scene(Pull::Force, LAWS[0], cut).unwrap();
            let trial = trial::run(&scene, Path::new("."), 1, Protocol::Static, LIMITS, &stop).unwrap();
            assert!(trial.is_done(), "{}", trial.reason);
            let Truth::Known { series, .. } = gold(Pull::Force).truth(LAWS[0], None, "") else { panic!() };
            trial.series.minus(&series).norm() / series.norm()
        };
        let precut = error(None);
        for place in [PLACES[0], PLACES[2], PLACES[4]] {
            let [behind, calibrated] = RULES.map(|rule| error(Some((rule, place))));
            assert!(calibrated < 1.3 * precut, "front at {place}: {calibrated}, pre-cut {precut}");
            assert!(behind > 1.4 * precut, "front at {place}: {behind}, pre-cut {precut}");
        }
    }
}
