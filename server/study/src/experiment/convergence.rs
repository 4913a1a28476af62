//! Figure 10: how cycles converge on the cube uncut and cut by aligned and rotated blades, and with less and less
//! mass.

use scindo_physics::solver::multigrid::Smoother;

use super::model::{CUBE, Cuts, Grid, Model, animal, cube};
use super::printed::RATES;
use super::solve::{decay, rate};
use super::system::{Problem, System, smoothers};
use super::tables::S_CUBE;
use super::{ExperimentBench, ExperimentResult, Plots, Table, Trouble, Unit};
use crate::stress::chart::{Chart, Line};

/// Cycles of a run, and those between which the rate is taken.
const CYCLES: usize = 24;
const STABLE: [usize; 2] = [8, 24];
/// Stiffness numbers that stand for more and more mass.
const MASSES: [f64; 3] = [1e5, 1e4, 1e3];

/// The experiment.
///
/// # Errors
/// The user ended the study.
pub fn convergence(bench: &mut ExperimentBench<'_>) -> Result<ExperimentResult, Trouble> {
    let mut result = ExperimentResult {
        name: "dick-convergence",
        title: "Convergence of multigrid on cut cells: figure 10".into(),
        about: "The first step of a cube, uncut and cut to half depth, with a force that fans its rods out; and of \
            the animal with three cuts, from much mass to none. Errors are those of the iteration of cycles \
            e ← e − V A e, from the error of displacements 0."
            .into(),
        ..ExperimentResult::default()
    };
    let mut rates = Table::new(
        "Rates",
        "Mean factor per cycle from cycle 8 to 24. SOR is the smoother of the paper, V(1,1) and ω = 1.7; Chebyshev \
         is the default.",
        &[
            ("cells", Unit::Count),
            ("SOR", Unit::Number),
            ("Chebyshev", Unit::Number),
            ("paper", Unit::Number),
        ],
    );
    let (across, levels) = if bench.is_quick() { (32, 3) } else { (CUBE, 4) };
    let grids = [Grid::Uncut, Grid::Aligned, Grid::Rotated];
    let total = 2 * grids.len() + MASSES.len() + 1;
    for (problem, caption) in
        [(Problem::Step(S_CUBE), "with the mass of table 2"), (Problem::Equilibrium, "without mass")]
    {
        let mut charts = charts("cube");
        for (grid, printed) in grids.into_iter().zip(RATES) {
            bench.begin(format!("cube, {}, {caption}", grid.name()), total)?;
            let model = cube(across, levels, grid)?;
            let (cells, found) = of(&model, problem, grid.name(), &mut charts)?;
            let printed = Some(printed).filter(|_| problem != Problem::Equilibrium);
            rates.row(
                format!("{}, {}", model.name, problem.words()),
                &[Some(cells), Some(found[0]), Some(found[1]), printed],
            );
        }
        result.plots.push(Plots {
            caption: format!("The cube {caption}: error over cycles, left with SOR, right with Chebyshev."),
            charts: charts.into(),
            ..Plots::default()
        });
    }
    let model = if bench.is_quick() {
        animal(None, 39, 2, Cuts::Curved)?
    } else {
        animal(None, 77, 3, Cuts::Curved)?
    };
    let mut charts = charts("animal");
    for problem in [Problem::Equilibrium].into_iter().chain(MASSES.map(Problem::Step)) {
        bench.begin(format!("animal, {}", problem.words()), total)?;
        let (cells, found) = of(&model, problem, &problem.words(), &mut charts)?;
        rates.row(
            format!("{}, {}", model.name, problem.words()),
            &[Some(cells), Some(found[0]), Some(found[1]), None],
        );
    }
    result.plots.push(Plots {
        caption:
            "The animal with less and less mass (the paper shows its Armadillo, with a rate of at most 0.85 \
            without mass)."
                .into(),
        charts: charts.into(),
        ..Plots::default()
    });
    result.tables.push(rates);
    Ok(result)
}

fn charts(what: &str) -> [Chart; 2] {
    smoothers().map(|(name, _)| {
        let mut chart = Chart::new(&format!("{what}, {name}"), "cycles", "‖e‖/‖e₀‖");
        chart.logarithmic = true;
        chart
    })
}

/// Cells and rates of a cut model with both smoothers; the errors become lines of the charts.
fn of(
    model: &Model,
    problem: Problem,
    name: &str,
    charts: &mut [Chart; 2],
) -> Result<(f64, [f64; 2]), Trouble> {
    let cut = model.cut()?;
    let mut system = System::new(cut.space.octree(), (model.held, model.pull), problem)?;
    let (exact, _) = system.converged();
    let mut found = [0.0; 2];
    for (((_, smoother), chart), found) in smoothers().into_iter().zip(charts).zip(&mut found) {
        let norms = norms(&mut system, smoother, &exact);
        *found = rate(&norms, STABLE);
        let points = (0..).zip(&norms).map(|(k, e)| [f64::from(k), *e]).collect();
        chart.lines.push(Line { name: name.to_owned(), points });
    }
    Ok((cut.space.octree().cells().len() as f64, found))
}

fn norms(system: &mut System, smoother: Smoother, exact: &[nalgebra::Vector3<f64>]) -> Vec<f64> {
    let (mut multigrid, _) = system.multigrid(smoother);
    decay(system, &mut multigrid, exact, CYCLES)
}
