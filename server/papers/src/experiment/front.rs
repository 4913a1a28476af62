//! What the front of a cut costs where it ends inside elements, over its place in them.
//!
//! # Source
//! Schoch et al. 2013: Simulation of surgical cutting in soft tissue using the extended finite element method, §6.

mod blade;

use std::path::Path;
use std::sync::atomic::AtomicBool;

use scindo_study::case::Truth;
use scindo_study::report::chart::{Chart, Line};
use scindo_study::report::result::{ExperimentResult, Plots, Table, Unit};
use scindo_study::trial::series::Series;
use scindo_study::trial::{self, Limits, Protocol};
use scindo_world::scene::Scene;

use crate::cases::cutting::{Inside, Pull, beam_mesh, gold, pulled};
use crate::lab::{ExperimentBench, Trouble};
use blade::{ADVANCES, Depth};

const SCENE: &str = include_str!("../../cases/r2-tc1.toml");
const PULLS: [(&str, Pull); 2] = [("gravity", Pull::Gravity), ("force", Pull::Force)];
const LAWS: [&str; 2] = ["linear", "corotational"];
/// Where the front lies in its element: the share of it that the blade has covered.
const PLACES: [f64; 5] = [0.1, 0.3, 0.5, 0.7, 0.9];
/// The place at which a blade advances in a quick study.
const QUICK: [f64; 1] = [0.5];
/// The plane of the cut and its front [m].
const DEPTH: Depth = Depth { plane_m: 0.1, front_m: 0.015 };
/// Lines of cells across the beam [m], 6 cells; the front is at 0.015 and moves lines 2 and 3.
const LINES_M: [f64; 7] = [0.0, 0.005, 0.01, 0.015, 0.02, 0.025, 0.03];
/// A run may take this long [s].
const LIMITS: Limits = Limits { run_s: 900.0, repeat_s: 0.0, repeats: 1 };

/// How a cut is made.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Way {
    /// In one stroke, with `cutting.front` = behind.
    Behind,
    /// In one stroke, with `cutting.front` = calibrated.
    Calibrated,
    /// The same by a blade that advances through the loaded beam.
    Advancing,
}

const WAYS: [Way; 3] = [Way::Behind, Way::Calibrated, Way::Advancing];

impl Way {
    fn name(self) -> &'static str {
        match self {
            Self::Behind => "behind",
            Self::Calibrated => "calibrated",
            Self::Advancing => "advancing",
        }
    }

    /// Value of `cutting.front`.
    fn rule(self) -> &'static str {
        if self == Self::Behind { "behind" } else { "calibrated" }
    }
}

/// Way to cut and place of the front in its element; `None` for a mesh made with the cut.
type Cut = Option<(Way, f64)>;

/// The experiment.
///
/// # Errors
/// The user ended the study.
pub(super) fn front(bench: &mut ExperimentBench<'_>) -> Result<ExperimentResult, Trouble> {
    let mut result = ExperimentResult {
        name: "front",
        title: "The front of a cut inside elements".into(),
        about: format!(
            "Schoch’s beam of 30 × 60 × 200 mm, cut through to half its depth, 6 cells of five linear tetrahedra across. The \
             plane of the cut lies a third of a cell inside elements, and its front at several places between two \
             lines of cells: at {:.1} the blade has only just entered the last cells, at {:.1} it has almost left them. \
             With cutting.front = \"behind\", the default, an element opens when the blade has left it; with \
             \"calibrated\" the cut goes on ahead of the blade by 0.7 of the mean length of an element’s edges. These cuts \
             are made in one stroke, before the load. `advancing` is the calibrated cut of a blade that goes through the \
             loaded beam in {ADVANCES} steps, with an equilibrium after each. The mesh of `pre-cut` has as many cells, with \
             faces at the true front. Errors are ‖u − u*‖/‖u*‖ over 24 points of the beam, against stored solutions by \
             hexahedra of order 3 and 4.",
            PLACES[0],
            PLACES[PLACES.len() - 1],
        ),
        ..ExperimentResult::default()
    };
    let advancing = if bench.is_quick() { &QUICK[..] } else { &PLACES[..] };
    let total = PULLS.len() * LAWS.len() * (1 + (WAYS.len() - 1) * PLACES.len() + advancing.len());
    let mut plots =
        Plots { caption: "Error over the place of the front in its cell.".into(), ..Plots::default() };
    let mut table = Table::new(
        "Errors",
        "Places are shares of the last cell that the blade has covered. Ratios are those of the errors of `calibrated` and \
         `advancing` to that of the pre-cut mesh.",
        &[
            ("error, behind", Unit::Number),
            ("error, calibrated", Unit::Number),
            ("error, advancing", Unit::Number),
            ("error, pre-cut", Unit::Number),
            ("calibrated over pre-cut", Unit::Times),
            ("advancing over pre-cut", Unit::Times),
        ],
    );
    for (pull_name, pull) in PULLS {
        let mut chart = Chart::new(pull_name, "place of the front", "error");
        for law in LAWS {
            let name = format!("{pull_name}, {law}");
            bench.begin(format!("{name}, pre-cut"), total)?;
            // A mesh with faces at the true front knows no place in an element, so one run serves all of them.
            let precut = error(bench, pull, law, None)?;
            let mut lines =
                WAYS.map(|way| Line { name: format!("{law}, {}", way.name()), points: Vec::new() });
            let mut ratios = [Vec::new(), Vec::new()];
            for place in PLACES {
                let mut errors = [None; WAYS.len()];
                for (k, way) in WAYS.into_iter().enumerate() {
                    // An advancing blade costs an equilibrium per step, so a quick study spares most of its places.
                    if way == Way::Advancing && !advancing.contains(&place) {
                        continue;
                    }
                    let what = format!("{name}, front at {place}, {}", way.name());
                    bench.begin(what.clone(), total)?;
                    // A run without a result leaves a note and a gap; only the end of the study ends the experiment.
                    match error(bench, pull, law, Some((way, place)))? {
                        Ok(found) => {
                            errors[k] = Some(found);
                            lines[k].points.push([place, found]);
                        }
                        Err(reason) => result.notes.push(format!("{what}: {reason}")),
                    }
                }
                let precut = precut.as_ref().ok().copied();
                let [behind, calibrated, advancing] = errors;
                let over = [calibrated, advancing].map(|error| Some(error? / precut?));
                ratios.iter_mut().zip(over).for_each(|(ratios, over)| ratios.extend(over));
                let row = [behind, calibrated, advancing, precut, over[0], over[1]];
                table.row(format!("{pull_name}, {law}, {place}"), &row);
            }
            let [calibrated, advancing] =
                ratios.map(|all| (!all.is_empty()).then(|| all.iter().sum::<f64>() / all.len() as f64));
            table.row(format!("{pull_name}, {law}, mean"), &[None, None, None, None, calibrated, advancing]);
            // The same error at all places: a level line for the others to be held against.
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
    let Truth::Known { series, .. } = gold(pull).truth(law, None, "") else {
        return Err("there is no stored solution".into());
    };
    let found = displacements(pull, law, cut, bench.stop())?;
    Ok(found.map(|found| found.minus(&series).norm() / series.norm()))
}

/// Displacements of a run, or why there are none.
fn displacements(
    pull: Pull,
    law: &str,
    cut: Cut,
    stop: &AtomicBool,
) -> Result<Result<Series, String>, Trouble> {
    let scene = scene(pull, law, cut)?;
    if let Some((Way::Advancing, _)) = cut {
        let whole = scene.apply_sets(&["cut=[]".to_owned()])?;
        return blade::advance(&whole, DEPTH, &gold(pull).probes, stop);
    }
    let trial = trial::run(&scene, Path::new("."), 1, Protocol::Static, LIMITS, stop).ok_or("interrupted")?;
    Ok(if trial.is_done() { Ok(trial.series) } else { Err(trial.reason) })
}

fn scene(pull: Pull, law: &str, cut: Cut) -> Result<Scene, Trouble> {
    let (mut x_m, mut set) = (LINES_M.to_vec(), Vec::new());
    let mut inside = Inside::NOTHING;
    if let Some((way, place)) = cut {
        let (front, width) = (LINES_M[3], LINES_M[3] - LINES_M[2]);
        x_m[2] = front - place * width;
        x_m[3] = front + (1.0 - place) * width;
        inside.plane = true;
        set.push(format!("body.beam.cutting.front=\"{}\"", way.rule()));
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
    use super::*;

    /// A front in the middle of an element costs as much as one on its border, and no more than half of what it costs
    /// where the cut stays behind the blade; a blade that advances through the loaded beam changes little.
    #[test]
    fn a_calibrated_front_costs_no_accuracy() {
        let stop = AtomicBool::new(false);
        let Truth::Known { series, .. } = gold(Pull::Force).truth(LAWS[0], None, "") else { panic!() };
        let error = |cut: Cut| {
            let found = displacements(Pull::Force, LAWS[0], cut, &stop).unwrap().unwrap();
            found.minus(&series).norm() / series.norm()
        };
        let precut = error(None);
        for place in [PLACES[0], PLACES[2], PLACES[4]] {
            let [behind, calibrated] = [Way::Behind, Way::Calibrated].map(|way| error(Some((way, place))));
            assert!(calibrated < 1.3 * precut, "front at {place}: {calibrated}, pre-cut {precut}");
            assert!(behind > 1.4 * precut, "front at {place}: {behind}, pre-cut {precut}");
        }
        let advancing = error(Some((Way::Advancing, PLACES[2])));
        assert!(advancing < 1.3 * precut, "a blade that advances: {advancing}, pre-cut {precut}");
    }
}
