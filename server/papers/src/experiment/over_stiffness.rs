//! How many times as long conjugate gradients take without multigrid, from much mass to little.

use scindo_physics::solver::multigrid::Smoother;
use scindo_study::report::chart::{Chart, Line};
use scindo_study::report::result::{ExperimentResult, Plots, Table, Unit};

use super::printed::{self, ARMADILLO, BUNNY, BUNNY_3, Printed};
use super::tables::ARMADILLO_ACROSS;
use crate::lab::{ExperimentBench, Trouble};
use crate::system::linear::{Problem, System};
use crate::system::model::{CUBE, Cuts, Grid, Model, animal, cube};
use crate::system::solve::{CONVERGED, PATIENCE, Solver, Until, run};

/// Stiffness numbers from much mass to little.
const STIFFNESS: [f64; 6] = [1e2, 1e3, 1e4, 1e5, 1e6, 1e7];
/// A small error to which times are compared, too.
const SMALL: f64 = 1e-3;

/// What the paper prints of a model, and what stands for it here.
type Entry = (Printed, fn() -> Result<Model, Trouble>);

/// The models of a quick study and of a whole one.
const QUICK: [Entry; 1] = [(BUNNY_3, || animal(None, 39, 2, Cuts::Curved))];
const WHOLE: [Entry; 3] = [
    (BUNNY, || animal(None, 155, 4, Cuts::Curved)),
    (printed::CUBE, || cube(CUBE, 4, Grid::Rotated)),
    (ARMADILLO, || animal(None, ARMADILLO_ACROSS, 5, Cuts::Curved)),
];

fn models(quick: bool) -> &'static [Entry] {
    if quick { &QUICK } else { &WHOLE }
}

/// Number of measurements.
pub(super) fn measurements(quick: bool) -> usize {
    models(quick).len() * STIFFNESS.len()
}

/// Adds a table, and a chart with two lines for every model. `total` counts the measurements of the whole experiment.
///
/// # Errors
/// The user ended the study.
pub(super) fn ratios(
    bench: &mut ExperimentBench<'_>,
    result: &mut ExperimentResult,
    total: usize,
) -> Result<(), Trouble> {
    let mut table = Table::new(
        "From much mass to little",
        "Seconds until ‖e‖/‖e₀‖ has fallen to what the paper prints for three cycles, and to 1e-3, with and without \
         multigrid inside conjugate gradients, and how many times as long it takes without. Operators of the coarse \
         levels are included; levels, which only a cut needs, are not.",
        &[
            ("s", Unit::Number),
            ("printed error", Unit::Number),
            ("multigrid, to it", Unit::Seconds),
            ("block-Jacobi, to it", Unit::Seconds),
            ("ratio to it", Unit::Times),
            ("multigrid, to 1e-3", Unit::Seconds),
            ("block-Jacobi, to 1e-3", Unit::Seconds),
            ("ratio to 1e-3", Unit::Times),
        ],
    );
    let mut chart = Chart::new("block-Jacobi over multigrid", "log₁₀ s", "times as long");
    let mut printed_ratios = Vec::new();
    for (printed, model) in models(bench.is_quick()) {
        chart.lines.extend(of(bench, (printed, &model()?), total, &mut table)?);
        let Printed { name, reduction, .. } = printed;
        printed_ratios.push(format!("{name}: {:.1} times to {reduction}", printed.ratio()));
    }
    result.tables.push(table);
    result.plots.push(Plots {
        caption: format!(
            "The paper prints no stiffness number with its ratios ({}).",
            printed_ratios.join(", ")
        ),
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
    table.printed(
        format!("{} of the paper", printed.name),
        &[
            None,
            Some(printed.reduction),
            Some(printed.multigrid_s),
            Some(printed.gradients[1]),
            Some(printed.ratio()),
            None,
            None,
            None,
        ],
    );
    Ok(lines)
}
