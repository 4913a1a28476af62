//! Figure 12: error over time of direct and iterative solvers, their initialisation included.

use scindo_study::report::plot::{Mark, Plot};
use scindo_study::report::result::{ExperimentResult, Plots, Table, Unit};

use super::over_stiffness;
use super::tables::{S_BUNNY_2, S_BUNNY_3, S_CUBE};
use crate::lab::{ExperimentBench, Trouble};
use crate::system::linear::{Problem, System, norm, smoothers};
use crate::system::model::{CUBE, Cuts, Grid, Model, animal, cube};
use crate::system::solve::{CONVERGED, Course, FLOOR, PATIENCE, Solver, Until, cholesky, run};

/// Least error that is drawn.
const LEAST: f64 = 1e-6;
/// Points of a curve at most.
const POINTS: usize = 60;
/// Cells up to which a factorisation is tried, in a full study and in a quick one.
const DIRECT: [usize; 2] = [45_000, 12_000];
/// Names of the solvers, in the order of their colours.
const NAMES: [&str; 6] =
    ["Cholesky", "CG, block-Jacobi", "MG, SOR", "MG, Chebyshev", "CG with MG, Chebyshev", "CG with MG, SOR"];

/// The experiment.
///
/// # Errors
/// The user ended the study.
pub(super) fn solvers(bench: &mut ExperimentBench<'_>) -> Result<ExperimentResult, Trouble> {
    let mut result = ExperimentResult {
        name: "dick-solvers",
        title: "Solvers on cut cells: figure 12".into(),
        about: "The first step after the cut from displacements of 0, on one thread. Times include what a solver \
            needs before it begins: levels and operators of the coarse levels, or analysis and factorisation. \
            Iterations work in single precision, which ends at a few millionths."
            .into(),
        notes: vec![
            "SOR sweeps forward before and after the correction, so that the cycle is not symmetric: as a \
             preconditioner of conjugate gradients it does not converge reliably (the paper's CGMG must have \
             swept backward once)"
                .into(),
        ],
        ..ExperimentResult::default()
    };
    let mut table = Table::new(
        "Time to an error",
        "Seconds from the beginning until ‖e‖/‖e₀‖ has fallen so far. The crosses of the paper are the structural \
         times: levels, which only a cut needs.",
        &[
            ("cells", Unit::Count),
            ("levels", Unit::Seconds),
            ("before the first iteration", Unit::Seconds),
            ("to 0.1", Unit::Seconds),
            ("to 0.01", Unit::Seconds),
            ("to 1e-4", Unit::Seconds),
            ("iterations to 1e-4", Unit::Count),
        ],
    );
    let mut models = vec![
        (animal(None, 39, 2, Cuts::Curved)?, S_BUNNY_3),
        (animal(None, 77, 3, Cuts::Curved)?, S_BUNNY_2),
    ];
    if !bench.is_quick() {
        models.push((cube(CUBE, 4, Grid::Rotated)?, S_CUBE));
    }
    let direct = DIRECT[usize::from(bench.is_quick())];
    let total = 2 * models.len() + over_stiffness::measurements(bench.is_quick());
    for (model, s) in &models {
        let mut plots =
            Plots { caption: format!("{}: left with mass, right without.", model.name), ..Plots::default() };
        for problem in [Problem::Step(*s), Problem::Equilibrium] {
            bench.begin(format!("{}, {}", model.name, problem.words()), total)?;
            match of(model, problem, direct, &mut table)? {
                Ok(plot) => plots.plots.push(plot),
                Err(left) => result.notes.push(format!(
                    "{}, {}: no solution to measure errors by, because its residual stays at {left:.0e} of the load",
                    model.name,
                    problem.words()
                )),
            }
        }
        result.plots.push(plots);
    }
    result.tables.push(table);
    over_stiffness::ratios(bench, &mut result, total)?;
    Ok(result)
}

/// The errors of all solvers; the residual of the solution if this is not converged.
fn of(
    model: &Model,
    problem: Problem,
    direct: usize,
    table: &mut Table,
) -> Result<Result<Plot, f64>, Trouble> {
    let cut = model.cut()?;
    let cells = cut.space.octree().cells().len();
    let mut system = System::new(cut.space.octree(), (model.held, model.pull), problem)?;
    let (exact, left) = system.converged();
    // An error of the solution would pass for an error of every solver.
    if left.is_nan() || left > CONVERGED {
        return Ok(Err(left));
    }
    let until = |iterations| Until { iterations, error: FLOOR, seconds: 0.0 };
    let mut plot = Plot {
        size: [520.0, 420.0],
        x_label: "time, initialisation included".into(),
        y_label: "‖e‖/‖e₀‖".into(),
        marks: Vec::new(),
        failures: Vec::new(),
        error_bar: 0.0,
        budget_ms: None,
        colours: Vec::new(),
        shapes: vec![(0, String::new())],
        title: Some(format!("{}, {}", model.name, problem.words())),
    };
    let mut add = |number: usize, levels: Option<f64>, course: &Course| {
        let name = NAMES[number];
        plot.colours.push((number, name.to_owned()));
        let stride = course.points.len().div_ceil(POINTS).max(1);
        for (k, (seconds, error)) in course.points.iter().enumerate().filter(|(k, _)| k % stride == 0) {
            plot.marks.push(Mark {
                x: 1e3 * (course.begin_s + seconds),
                // Below, only the factorisation in double precision goes on.
                y: error.max(LEAST),
                colour: number,
                shape: 0,
                rank: None,
                title: format!("{name}, after {} iterations: {error:.2e}", k + 1),
            });
        }
        let to = |error: f64| course.seconds_to(error).map(|seconds| course.begin_s + seconds);
        let iterations = course.points.iter().position(|point| point.1 <= 1e-4).map(|k| (k + 1) as f64);
        table.row(
            format!("{}, {}: {name}", model.name, problem.words()),
            &[
                Some(cells as f64),
                levels,
                Some(course.begin_s).filter(|s| *s > 0.0),
                to(0.1),
                to(0.01),
                to(1e-4),
                iterations.filter(|_| number > 0),
            ],
        );
    };
    // Factors fill in, so a direct solver is out of the question for larger bodies.
    if cells <= direct {
        let (u, seconds) = cholesky(&system)?;
        let off: f64 = u.iter().zip(&exact).map(|(u, e)| (u - e).norm_squared()).sum();
        // A factorisation has no error to show before its end, so its curve is a single point.
        let points = vec![(seconds, off.sqrt() / norm(&exact))];
        add(0, None, &Course { begin_s: 0.0, points });
    }
    add(1, None, &run(&mut system, Solver::Jacobi, &exact, until(PATIENCE[0])));
    for (i, (_, smoother)) in smoothers().into_iter().enumerate() {
        let (mut multigrid, seconds) = system.multigrid(smoother);
        let begin_s = seconds.levels + seconds.coarse;
        let course = run(&mut system, Solver::Cycles(&mut multigrid), &exact, until(PATIENCE[1 + i]));
        add(2 + i, Some(seconds.levels), &Course { begin_s, ..course });
        // The same levels in conjugate gradients; they had to be made for either, so both times include them.
        let course = run(&mut system, Solver::Preconditioned(&mut multigrid), &exact, until(PATIENCE[1 + i]));
        // The names of these two stand in the opposite order.
        add(5 - i, Some(seconds.levels), &Course { begin_s, ..course });
    }
    Ok(Ok(plot))
}
