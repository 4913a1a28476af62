//! Figure 10: how cycles converge on the cube uncut and cut by aligned and rotated blades, and with less and less
//! mass.

use std::time::Instant;

use scindo_physics::solver::multigrid::MultigridSettings;
use scindo_study::report::chart::{Chart, Line};
use scindo_study::report::result::{ExperimentResult, Plots, Table, Unit};

use super::printed::RATES;
use super::tables::S_CUBE;
use crate::lab::{ExperimentBench, Trouble};
use crate::system::linear::{Problem, System, smoothers};
use crate::system::model::{CUBE, Cuts, Grid, Model, animal, cube};
use crate::system::solve::{decay, rate};

/// Cycles of a run, and those between which the rate is taken.
const CYCLES: usize = 24;
const STABLE: [usize; 2] = [8, 24];
/// Stiffness numbers that stand for more and more mass.
const MASSES: [f64; 3] = [1e5, 1e4, 1e3];

/// The experiment.
///
/// # Errors
/// The user ended the study.
pub(super) fn convergence(bench: &mut ExperimentBench<'_>) -> Result<ExperimentResult, Trouble> {
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
         is the default. Its W-cycle works twice on every coarse level; how much longer than its V-cycle it takes is \
         beside it.",
        &[
            ("cells", Unit::Count),
            ("SOR", Unit::Number),
            ("Chebyshev", Unit::Number),
            ("W-cycle", Unit::Number),
            ("paper", Unit::Number),
            ("W over V", Unit::Times),
        ],
    );
    let (across, levels) = if bench.is_quick() { (32, 3) } else { (CUBE, 4) };
    let grids = [Grid::Uncut, Grid::Aligned, Grid::Rotated];
    let total = 2 * grids.len() + MASSES.len() + 1;
    // Mass makes a system easier for cycles, so every grid is solved with and without it.
    for (problem, caption) in
        [(Problem::Step(S_CUBE), "with the mass of table 2"), (Problem::Equilibrium, "without mass")]
    {
        let mut charts = charts("cube");
        for (grid, printed) in grids.into_iter().zip(RATES) {
            bench.begin(format!("cube, {}, {caption}", grid.name()), total)?;
            let model = cube(across, levels, grid)?;
            let (cells, found) = of(&model, problem, grid.name(), &mut charts)?;
            // The rates of the paper are those with mass.
            let printed = Some(printed).filter(|_| problem != Problem::Equilibrium);
            rates.row(format!("{}, {}", model.name, problem.words()), &row(cells, &found, printed));
        }
        result.plots.push(Plots {
            caption: format!(
                "The cube {caption}: error over cycles; SOR, Chebyshev, and Chebyshev in W-cycles."
            ),
            charts: charts.into(),
            ..Plots::default()
        });
    }
    // One cut body from no mass to more and more of it, so that the rate changes by nothing else.
    let model = if bench.is_quick() {
        animal(None, 39, 2, Cuts::Curved)?
    } else {
        animal(None, 77, 3, Cuts::Curved)?
    };
    let mut charts = charts("animal");
    for problem in [Problem::Equilibrium].into_iter().chain(MASSES.map(Problem::Step)) {
        bench.begin(format!("animal, {}", problem.words()), total)?;
        let (cells, found) = of(&model, problem, &problem.words(), &mut charts)?;
        rates.row(format!("{}, {}", model.name, problem.words()), &row(cells, &found, None));
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

/// The cycles that are compared, with their names.
fn kinds() -> [(&'static str, MultigridSettings); 3] {
    let default = MultigridSettings::default();
    let [sor, chebyshev] =
        smoothers().map(|(name, smoother)| (name, MultigridSettings { smoother, ..default }));
    [sor, chebyshev, ("W-cycle", MultigridSettings { visits: 2, ..default })]
}

/// Rates of the cycles, and seconds of each.
type Found = [(f64, f64); 3];

fn row(cells: f64, found: &Found, printed: Option<f64>) -> [Option<f64>; 6] {
    let [sor, v, w] = *found;
    [Some(cells), Some(sor.0), Some(v.0), Some(w.0), printed, Some(w.1 / v.1)]
}

fn charts(what: &str) -> [Chart; 3] {
    kinds().map(|(name, _)| {
        let mut chart = Chart::new(&format!("{what}, {name}"), "cycles", "‖e‖/‖e₀‖");
        chart.logarithmic = true;
        chart
    })
}

/// Cells and rates of a cut model with all cycles; the errors become lines of the charts.
fn of(model: &Model, problem: Problem, name: &str, charts: &mut [Chart; 3]) -> Result<(f64, Found), Trouble> {
    let cut = model.cut()?;
    let mut system = System::new(cut.space.octree(), (model.held, model.pull), problem)?;
    let (exact, _) = system.converged();
    let mut found = [(0.0, 0.0); 3];
    for (((_, settings), chart), found) in kinds().into_iter().zip(charts).zip(&mut found) {
        let (mut multigrid, _) = system.multigrid_with(settings);
        let started = Instant::now();
        let norms = decay(&mut system, &mut multigrid, &exact, CYCLES);
        *found = (rate(&norms, STABLE), started.elapsed().as_secs_f64() / CYCLES as f64);
        let points = (0..).zip(&norms).map(|(k, e)| [f64::from(k), *e]).collect();
        chart.lines.push(Line { name: name.to_owned(), points });
    }
    Ok((cut.space.octree().cells().len() as f64, found))
}
