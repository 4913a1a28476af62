//! How many times as long conjugate gradients take without multigrid, from much mass to little.

use super::model::{CUBE, Cuts, Grid, Model, animal, cube};
use super::printed::{ARMADILLO, BUNNY, BUNNY_3, CUBE as PRINTED_CUBE, Printed};
use super::solve::{CONVERGED, PATIENCE, Solver, Until, run};
use super::system::{Problem, System};
use super::tables::ARMADILLO_ACROSS;
use super::{ExperimentBench, ExperimentResult, Plots, Table, Trouble, Unit};
use crate::stress::chart::{Chart, Line};
use scindo_physics::solver::multigrid::Smoother;

/// Stiffness numbers from much mass to little.
const STIFFNESS: [f64; 6] = [1e2, 1e3, 1e4, 1e5, 1e6, 1e7];
/// A small error to which times are compared, too.
const SMALL: f64 = 1e-3;

/// Models that the paper has a ratio of, in a quick study and in a whole one.
const MODELS: [usize; 2] = [1, 3];

/// Number of measurements.
pub fn measurements(quick: bool) -> usize {
    MODELS[usize::from(!quick)] * STIFFNESS.len()
}

/// Adds a table, and a chart with two lines for every model. `total` counts the measurements of the whole experiment.
///
/// # Errors
/// The user ended the study.
pub fn ratios(
    bench: &mut ExperimentBench<'_>,
    result: &mut ExperimentResult,
    total: usize,
) -> Result<(), Trouble> {
    let mut table = Table::new(
        "From much mass to little",
        "Seconds until ‖e‖/‖e₀‖ has fallen as far as by the three cycles of the paper, and to 1e-3, with and without \
         multigrid inside conjugate gradients, and how many times as long it takes without. Operators of the coarse \
         levels are included; levels, which only a cut needs, are not.",
        &[
            ("s", Unit::Number),
            ("‖e‖/‖e₀‖", Unit::Number),
            ("multigrid, so far", Unit::Seconds),
            ("block-Jacobi, so far", Unit::Seconds),
            ("ratio", Unit::Times),
            ("multigrid, to 1e-3", Unit::Seconds),
            ("block-Jacobi, to 1e-3", Unit::Seconds),
            ("ratio to 1e-3", Unit::Times),
        ],
    );
    let mut chart = Chart::new("block-Jacobi over multigrid", "log₁₀ s", "times as long");
    let models = if bench.is_quick() {
        vec![(BUNNY_3, animal(None, 39, 2, Cuts::Curved)?)]
    } else {
        vec![
            (BUNNY, animal(None, 155, 4, Cuts::Curved)?),
            (PRINTED_CUBE, cube(CUBE, 4, Grid::Rotated)?),
            (ARMADILLO, animal(None, ARMADILLO_ACROSS, 5, Cuts::Curved)?),
        ]
    };
    for (printed, model) in &models {
        let lines = of(bench, (printed, model), total, &mut table)?;
        chart.lines.extend(lines);
    }
    result.tables.push(table);
    result.plots.push(Plots {
        caption:
            "The paper has 7.5 times to 0.1 (bunny), 16.4 times to 0.0145 (cube) and 23.2 times to 0.019 \
            (armadillo), each at a stiffness number that it does not print."
                .into(),
        charts: vec![chart],
        ..Plots::default()
    });
    Ok(())
}

/// The rows of a model, and its lines of ratios.
fn of(
    bench: &mut ExperimentBench<'_>,
    (printed, model): (&Printed, &Model),
    total: usize,
    table: &mut Table,
) -> Result<[Line; 2], Trouble> {
    let cut = model.cut()?;
    let errors = [printed.reduction, SMALL];
    let mut lines = errors.map(|to| Line { name: format!("{}, to {to}", model.name), points: Vec::new() });
    for s in STIFFNESS {
        let problem = Problem::Step(s);
        let name = format!("{}, {}", model.name, problem.words());
        bench.begin(&*name, total)?;
        let mut system = System::new(cut.space.octree(), (model.held, model.pull), problem)?;
        let (exact, left) = system.converged();
        if left.is_nan() || left > CONVERGED {
            // No solution to measure errors by.
            table.row(name, &[Some(s), Some(printed.reduction), None, None, None, None, None, None]);
            continue;
        }
        let until = |iterations| Until { iterations, error: SMALL, seconds: 0.0 };
        let (mut multigrid, seconds) = system.multigrid(Smoother::default());
        let own = run(&mut system, Solver::of(&mut multigrid, true), &exact, until(PATIENCE[2]));
        drop(multigrid);
        let other = run(&mut system, Solver::Jacobi, &exact, until(PATIENCE[0]));
        let mut values = vec![Some(s), Some(printed.reduction)];
        for (to, line) in errors.into_iter().zip(&mut lines) {
            let own = own.seconds_to(to).map(|t| seconds.coarse + t);
            let other = other.seconds_to(to);
            let ratio = own.zip(other).map(|(own, other)| other / own);
            values.extend([own, other, ratio]);
            line.points.extend(ratio.map(|ratio| [s.log10(), ratio]));
        }
        table.row(name, &values);
    }
    let [_, seconds] = printed.gradients;
    let ratio = seconds / printed.multigrid_s;
    table.printed(
        format!("{} of the paper", printed.name),
        &[
            None,
            Some(printed.reduction),
            Some(printed.multigrid_s),
            Some(seconds),
            Some(ratio),
            None,
            None,
            None,
        ],
    );
    Ok(lines)
}
