//! Steps of other simulators beside those of scindo, and what an equal error costs.
//!
//! # Source
//! The figures of SOFA and MuJoCo are measurements of ours, see [`MEASURED`].

use std::path::Path;
use std::time::Instant;

use nalgebra::Vector3;
use scindo_physics::body::SolveReport;
use scindo_physics::solver::StopReason;
use scindo_study::report::chart::{Chart, Line};
use scindo_study::report::result::Plots;
use scindo_study::report::result::{ExperimentResult, Table, Unit};
use scindo_world::assemble::BuildOptions;
use scindo_world::inputs::Inputs;
use scindo_world::scene::Scene;
use scindo_world::simulation::Simulation;

use super::threads::{BAR, HIPPO, Model, TEN, words};
use crate::lab::{ExperimentBench, Trouble};

/// Where the figures of others come from.
const MEASURED: &str = "SOFA v26.06 (built with -O3, double precision) and MuJoCo's flex were measured on 22 November 2026 on two \
    Xeon cores, in turns with scindo; their fastest steps are given. They were not measured on this machine, so a ratio \
    also compares two processors: on the Xeon scindo's step of the bar with ten iterations took 1.28 ms.";
/// Steps of a run, those of a large body, and those of the block before it lands, which takes more solves.
const STEPS: usize = 125;
const FEW: usize = 12;
const FALLING: usize = 7;
/// Measurements of the whole form, about.
const MEASUREMENTS: usize = 30;

/// A step of another simulator.
#[derive(Clone, Copy, Debug)]
struct Peer {
    name: &'static str,
    threads: usize,
    /// Fastest step, and the median of a run where the machine was quiet [ms].
    best_ms: f64,
    median_ms: Option<f64>,
}

/// One way in which scindo does the same.
#[derive(Clone, Debug)]
struct Own {
    name: String,
    threads: usize,
    scene: String,
    /// Every step must meet its tolerance.
    converges: bool,
}

/// The steps of a run.
#[derive(Clone, Debug)]
struct Run {
    best_s: f64,
    median_s: f64,
    /// Iterations per step.
    iterations: f64,
    /// Positions after every step [m].
    positions: Vec<Vec<Vector3<f64>>>,
}

const fn peer(name: &'static str, threads: usize, best_ms: f64, median_ms: Option<f64>) -> Peer {
    Peer { name, threads, best_ms, median_ms }
}

/// Ten iterations of conjugate gradients in each step.
const BAR_TEN: [Peer; 4] = [
    peer("SOFA, FastTetrahedralCorotational (QR)", 1, 4.3, Some(5.5)),
    peer("SOFA, FastTetrahedralCorotational (polar)", 1, 5.8, Some(7.4)),
    peer("SOFA, TetrahedronFEM (large)", 1, 12.8, Some(15.5)),
    peer("SOFA, ParallelTetrahedronFEM", 2, 9.0, Some(10.3)),
];
/// To a millionth in each step.
const BAR_CONVERGED: [Peer; 3] = [
    peer("SOFA, FastTetrahedralCorotational (polar), 300 iterations", 1, 50.0, Some(62.0)),
    peer("SOFA, TetrahedronFEM (large), 400 iterations", 1, 442.0, Some(605.0)),
    peer("SOFA, sparse LDL in each step", 1, 143.0, Some(166.0)),
];
const HIPPO_TEN: [Peer; 1] = [peer("SOFA, TetrahedronFEM (small)", 1, 12.2, Some(15.9))];
const LARGE_TEN: [Peer; 3] = [
    peer("SOFA, FastTetrahedralCorotational (QR)", 1, 69.0, None),
    peer("SOFA, FastTetrahedralCorotational (polar)", 1, 83.0, None),
    peer("SOFA, TetrahedronFEM (large)", 1, 180.0, Some(285.0)),
];
const CUBE_TEN: [Peer; 2] = [
    peer("SOFA, HexahedronFEM (polar)", 1, 626.0, None),
    peer("SOFA, HexahedronFEM (large)", 1, 585.0, None),
];
const CUBE_CONVERGED: [Peer; 1] = [peer("SOFA, HexahedronFEM (large), 250 iterations", 1, 17_900.0, None)];

/// Errors to reach on the bar, with what others take for them.
const AT_ERROR: [(f64, &str, &[Peer]); 2] = [
    (
        1e-2,
        "one per cent",
        &[
            peer("MuJoCo flex, CG, 140 iterations", 1, 44.0, Some(72.0)),
            peer("SOFA, FastTetrahedralCorotational (polar), 180 iterations", 1, 38.0, Some(42.0)),
        ],
    ),
    (1e-5, "10⁻⁵", &[peer("MuJoCo flex, Newton", 1, 87.0, Some(138.0))]),
];
/// Numbers of iterations that are tried for them, ascending.
const TRIED: [(&str, &[u32]); 2] = [
    ("pcg", &[20, 40, 60, 80, 100, 120, 150, 200, 250, 300]),
    ("two-level-pcg", &[2, 3, 4, 6, 8, 10, 12, 15, 20, 25, 30, 40]),
];

/// The experiment.
///
/// # Errors
/// A scene that cannot be made, a step that does not reach its tolerance, or the user ended the study.
pub(super) fn peers(bench: &mut ExperimentBench<'_>) -> Result<ExperimentResult, Trouble> {
    let mut result = ExperimentResult {
        name: "peers",
        title: "Beside other simulators".into(),
        about: format!(
            "Steps of SOFA, MuJoCo and scindo by implicit Euler: of the bar of Jeřábková's thesis (12,800 corotational \
             tetrahedra, held at one end and bending under gravity, 40 ms a step), and of other bodies of as many elements \
             each: a linear block that falls, a finer bar, and a cube of hexahedra. Ten iterations of conjugate gradients compare \
             kernels; converged steps compare solvers, too. scindo computes the products in single precision and keeps the \
             state in double. {MEASURED}"
        ),
        ..ExperimentResult::default()
    };
    let quick = bench.is_quick();
    let few = if quick { 3 } else { FEW };
    let steps = if quick { 25 } else { STEPS };
    let bar = |solver: &str| BAR.scene(BAR.cells, solver);
    let ten = |name: &str, model: &Model, threads| own(name, threads, model.scene(model.cells, TEN));
    let to = |method: &str, tolerance: f64| {
        format!("iterations = 3000, tolerance = {tolerance:e}, precision = \"single\", method = \"{method}\"")
    };

    let ways = [ten("scindo, 1 thread", &BAR, 1), ten("scindo, 2 threads", &BAR, 2)];
    result.tables.push(beside(bench, "The bar, ten iterations in each step", steps, &ways, &BAR_TEN)?);
    let ways = ["pcg", "two-level-pcg"].map(|method| converging(&by(method), bar(&to(method, 1e-6))));
    let title = "The bar, each step to a millionth";
    result.tables.push(beside(bench, title, steps, &ways, &BAR_CONVERGED)?);
    at_equal_error(bench, steps, (&bar(&to("two-level-pcg", 1e-8)), &bar), &mut result)?;
    let ways = [ten("scindo, 1 thread", &HIPPO, 1)];
    let title = "A linear block of 20,800 tetrahedra that falls, ten iterations in each step";
    result.tables.push(beside(bench, title, FALLING, &ways, &HIPPO_TEN)?);
    if !quick {
        let finer = BAR.cells.map(|n| 2 * n);
        let ways =
            [1, 2].map(|threads| own(&format!("scindo, {}", words(threads)), threads, BAR.scene(finer, TEN)));
        let title = "A bar of 102,400 tetrahedra, ten iterations in each step";
        result.tables.push(beside(bench, title, few, &ways, &LARGE_TEN)?);
    }
    let across = if quick { 10 } else { 40 };
    let ways = [own("scindo, hex8", 1, cube(across, "hex8", TEN))];
    let title = format!("A cube of {across}³ corotational hexahedra, ten iterations in each step");
    // Figures of others are those of 40³ cells.
    let (ten, converged) = if quick { (&[][..], &[][..]) } else { (&CUBE_TEN[..], &CUBE_CONVERGED[..]) };
    result.tables.push(beside(bench, &title, few, &ways, ten)?);
    let ways = [("hex8", "pcg"), ("octree", "mg-pcg")].map(|(element, method)| {
        converging(&format!("scindo, {element}, {method}"), cube(across, element, &to(method, 1e-3)))
    });
    let title = format!("The cube of {across}³ hexahedra, each step to a thousandth");
    result.tables.push(beside(bench, &title, few, &ways, converged)?);
    Ok(result)
}

fn own(name: &str, threads: usize, scene: String) -> Own {
    Own { name: name.to_owned(), threads, scene, converges: false }
}

fn converging(name: &str, scene: String) -> Own {
    Own { converges: true, ..own(name, 1, scene) }
}

fn by(method: &str) -> String {
    format!("scindo, {method}")
}

/// A cube of hexahedra that is held at one side and bends under its weight.
fn cube(across: usize, element: &str, solver: &str) -> String {
    let (levels, pattern) =
        if element == "octree" { ("octree = { levels = 0 }\n", "") } else { ("", ", pattern = \"hex\"") };
    format!(
        "schema = 1\nname = \"cube\"\nworld = {{ gravity_m_s2 = [0, 0, -9.81], step_s = 0.04 }}\n[[body]]\nid = \"body\"\n\
         law = \"corotational\"\nyoung_pa = 1e5\npoisson = 0.33\ndensity_kg_m3 = 100\nelement = \"{element}\"\n{levels}\
         mesh = {{ box = {{ min_m = [0, 0, 0], max_m = [1, 1, 1], cells = [{across}, {across}, {across}]{pattern} }} }}\n\
         solver = {{ {solver} }}\n[[body.fix]]\nwhere = {{ slab = {{ axis = \"x\", from = 0, to = 0 }} }}\n"
    )
}

/// Makes `steps` steps.
fn run(Own { name, threads, scene, converges }: &Own, steps: usize, keep: bool) -> Result<Run, Trouble> {
    let options = BuildOptions { threads: *threads, portable: false };
    let scene = Scene::from_toml(scene)?;
    let mut simulation = Simulation::with_options(&scene, Path::new(""), options)?;
    let mut seconds = Vec::with_capacity(steps);
    let (mut iterations, mut positions) = (0, Vec::new());
    for step in 0..steps {
        let from = Instant::now();
        let solve = simulation.step(&Inputs::default()).bodies[0].solve;
        seconds.push(from.elapsed().as_secs_f64());
        iterations += solve.iterations;
        if *converges && solve.stop != StopReason::Converged {
            let SolveReport { residual, stop, .. } = solve;
            return Err(format!("{name}: step {step} ends at a residual of {residual:e} ({stop:?})").into());
        }
        if keep {
            positions.push(simulation.bodies()[0].body.positions().to_vec());
        }
    }
    seconds.sort_unstable_by(f64::total_cmp);
    let (best_s, median_s) = (seconds[0], seconds[seconds.len() / 2]);
    Ok(Run { best_s, median_s, iterations: f64::from(iterations) / steps as f64, positions })
}

fn table(title: &str, about: &str) -> Table {
    let columns = [
        ("fastest step", Unit::Seconds),
        ("median step", Unit::Seconds),
        ("iterations", Unit::Number),
        ("scindo is faster by", Unit::Times),
    ];
    Table::new(title, about, &columns)
}

/// Runs the ways of scindo, and puts each of the `peers` beside the fastest of them with as many threads.
fn beside(
    bench: &mut ExperimentBench<'_>,
    title: &str,
    steps: usize,
    ways: &[Own],
    peers: &[Peer],
) -> Result<Table, Trouble> {
    let mut table =
        table(title, &format!("Of {steps} steps. The last column divides fastest steps on as many threads."));
    let mut runs = Vec::new();
    for way in ways {
        bench.begin(format!("{title}: {}", way.name), MEASUREMENTS)?;
        let run = run(way, steps, false)?;
        table.row(&way.name, &[Some(run.best_s), Some(run.median_s), Some(run.iterations), None]);
        runs.push((way.threads, run.best_s));
    }
    add(&mut table, &runs, peers);
    Ok(table)
}

/// Adds `peers` beside the fastest of `runs` with as many threads; these are given with their fastest step [s].
fn add(table: &mut Table, runs: &[(usize, f64)], peers: &[Peer]) {
    for peer in peers {
        let own = runs.iter().filter(|(threads, _)| *threads == peer.threads).map(|(_, s)| *s);
        let best_s = 1e-3 * peer.best_ms;
        let faster = own.min_by(f64::total_cmp).map(|s| best_s / s);
        table.printed(peer.name, &[Some(best_s), peer.median_ms.map(|ms| 1e-3 * ms), None, faster]);
    }
}

/// Adds tables and a plot to `result`: per error the fewest iterations of each method that keep it, and what a step costs
/// with them. `converged` is the scene of the truth, `scene` that of a solver.
fn at_equal_error(
    bench: &mut ExperimentBench<'_>,
    steps: usize,
    (converged, scene): (&str, &dyn Fn(&str) -> String),
    result: &mut ExperimentResult,
) -> Result<(), Trouble> {
    bench.begin("the bar, converged", MEASUREMENTS)?;
    let truth = run(&converging("scindo, converged", converged.to_owned()), steps, true)?;
    let rest = Simulation::new(&Scene::from_toml(converged)?, Path::new(""))?;
    let rest = rest.bodies()[0].body.rest_positions().to_vec();
    let mut chart = Chart::new("Error over the time of a step", "step [ms]", "error");
    chart.logarithmic = true;
    let mut known: Vec<Vec<(Run, f64)>> = vec![Vec::new(); TRIED.len()];
    for (error, in_words, peers) in AT_ERROR {
        let mut table = table(
            &format!("The bar at an error of {in_words}"),
            "The fewest iterations in each step that keep the error below this: the largest distance from the steps whose \
             linear systems are solved to 10⁻⁸, over the largest displacement, in the norm over all nodes. The steps of others had \
             errors of this size when they were measured; in which norm was not noted.",
        );
        let mut runs = Vec::new();
        for ((method, tried), known) in TRIED.iter().zip(&mut known) {
            let found = loop {
                if let Some((run, _)) = known.iter().find(|(_, off)| *off <= error) {
                    break Some(run);
                }
                let Some(iterations) = tried.get(known.len()) else { break None };
                bench.begin(format!("the bar, {method}, {iterations} iterations"), MEASUREMENTS)?;
                let solver = format!(
                    "iterations = {iterations}, tolerance = 1e-30, precision = \"single\", method = \"{method}\""
                );
                let run = run(&own(&by(method), 1, scene(&solver)), steps, true)?;
                let off = off(&run, &truth, &rest);
                known.push((run, off));
            };
            let Some(run) = found else { continue };
            table.row(by(method), &[Some(run.best_s), Some(run.median_s), Some(run.iterations), None]);
            runs.push((1, run.best_s));
        }
        add(&mut table, &runs, peers);
        result.tables.push(table);
        chart.lines.extend(peers.iter().map(|peer| {
            let ends = [peer.best_ms, peer.median_ms.unwrap_or(peer.best_ms)];
            Line { name: peer.name.to_owned(), points: ends.map(|ms| [ms, error]).into() }
        }));
    }
    for ((method, _), known) in TRIED.iter().zip(&known) {
        let points = known.iter().map(|(run, off)| [1e3 * run.best_s, *off]).collect();
        chart.lines.push(Line { name: by(method), points });
    }
    result.plots.push(Plots {
        caption: "Errors of the bar. For scindo the fastest steps with more and more iterations; for others from the fastest \
                  step to the median."
            .into(),
        charts: vec![chart],
        ..Plots::default()
    });
    Ok(())
}

/// Largest distance of two runs over the largest displacement of the second.
fn off(run: &Run, truth: &Run, rest: &[Vector3<f64>]) -> f64 {
    let norm = |a: &[Vector3<f64>], b: &[Vector3<f64>]| {
        a.iter().zip(b).map(|(a, b)| (a - b).norm_squared()).sum::<f64>().sqrt()
    };
    let largest = |of: &mut dyn Iterator<Item = f64>| of.fold(0.0, f64::max);
    let apart = largest(&mut run.positions.iter().zip(&truth.positions).map(|(a, b)| norm(a, b)));
    apart / largest(&mut truth.positions.iter().map(|x| norm(x, rest)))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn peers_stand_beside_the_fastest_way_with_as_many_threads() {
        let mut table = table("", "");
        let peers = [peer("a", 1, 6.0, Some(7.0)), peer("b", 2, 6.0, None), peer("c", 3, 6.0, None)];
        add(&mut table, &[(1, 3e-3), (1, 2e-3), (2, 1e-3)], &peers);
        let values: Vec<_> = table.rows.iter().map(|row| (row.values[1], row.values[3])).collect();
        assert_eq!(values, [(Some(7e-3), Some(3.0)), (None, Some(6.0)), (None, None)]);
        assert!(table.rows.iter().all(|row| row.printed && row.values[0] == Some(6e-3)));
    }

    /// More iterations come closer to the converged steps, and steps that must converge do.
    #[test]
    fn errors_fall_with_the_iterations() {
        let small = |solver: &str| BAR.scene([10, 2, 2], solver);
        let converged = small("iterations = 500, tolerance = 1e-7, precision = \"single\"");
        let truth = run(&converging("truth", converged.clone()), 10, true).unwrap();
        let rest = Simulation::new(&Scene::from_toml(&converged).unwrap(), Path::new("")).unwrap();
        let rest = rest.bodies()[0].body.rest_positions().to_vec();
        let off = |n: u32| {
            let solver = format!("iterations = {n}, tolerance = 1e-30, precision = \"single\"");
            let run = run(&own("few", 1, small(&solver)), 10, true).unwrap();
            assert_eq!(run.iterations, f64::from(n));
            off(&run, &truth, &rest)
        };
        let [few, more, many] = [5, 20, 80].map(off);
        assert!(few > 2.0 * more && more > 2.0 * many && many < 1e-3, "{few:e} {more:e} {many:e}");
        let short = "iterations = 2, tolerance = 1e-7, precision = \"single\"";
        let refused = run(&converging("short", small(short)), 2, false).unwrap_err().to_string();
        assert!(refused.contains("step 0"), "{refused}");
    }

    #[test]
    fn cubes_are_made_of_both_elements() {
        for (element, method) in [("hex8", "pcg"), ("octree", "mg-pcg")] {
            let solver =
                format!("iterations = 200, tolerance = 1e-3, precision = \"single\", method = \"{method}\"");
            let run = run(&converging(element, cube(6, element, &solver)), 2, true).unwrap();
            assert!(run.positions[1].iter().flatten().all(|x| x.is_finite()), "{element}");
        }
    }
}
