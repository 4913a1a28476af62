//! Figure 10 of Schoch: error over degrees of freedom of his three test cases, for cuts inside elements and for meshes
//! made with the cut, by linear tetrahedra as in the paper and by quadratic ones.
//!
//! # Source
//! Schoch et al. 2013: Simulation of surgical cutting in soft tissue using the extended finite element method, §6.

use std::path::Path;

use scindo_study::case::Truth;
use scindo_study::reference::richardson::extrapolate;
use scindo_study::report::chart::{Chart, Line};
use scindo_study::report::result::{ExperimentResult, Plots, Table, Unit};
use scindo_study::trial::series::Series;
use scindo_study::trial::{self, Limits, Protocol};
use scindo_world::scene::Scene;

use crate::cases::cutting::{Inside, Pull, beam_mesh, gold, pulled, strips};
use crate::lab::{ExperimentBench, Trouble};

const SCENE: &str = include_str!("../../cases/r2-tc1.toml");
const LAWS: [&str; 2] = ["linear", "corotational"];
const INSIDE: Inside = Inside { plane: true, front: true };
const METHODS: [Way; 4] = [
    Way { name: "X-FEM", inside: INSIDE, element: "tet4" },
    Way { name: "pre-cut", inside: Inside::NOTHING, element: "tet4" },
    Way { name: "X-FEM quadratic", inside: INSIDE, element: "tet10" },
    Way { name: "pre-cut quadratic", inside: Inside::NOTHING, element: "tet10" },
];
/// Degrees of the elements, two of [`METHODS`] each.
const DEGREES: [&str; 2] = ["linear", "quadratic"];
/// Meshes of quadratic elements, which have eight times the nodes, in a whole study and in a quick one.
const QUADRATIC: [usize; 2] = [5, 1];
/// Cells across the beam, 30 mm, and how they share its 5, 10, 10 and 5 mm. Strips end on lines of cells.
const MESHES: [[usize; 4]; 8] = [
    [1, 1, 1, 1],
    [1, 2, 1, 1],
    [1, 2, 2, 1],
    [1, 2, 3, 1],
    [1, 3, 3, 1],
    [2, 3, 3, 1],
    [2, 3, 3, 2],
    [2, 4, 4, 2],
];
/// Those of a quick study.
const QUICK: [usize; 3] = [0, 2, 4];
/// Lines between which cells are of equal width [m].
const LINES_M: [f64; 5] = [0.0, 0.005, 0.015, 0.025, 0.03];
/// Steps over which the displacements of test case 3 grow.
const STEPS: u32 = 10;
/// Part of the printed displacements of test case 3.
const PART: f64 = 0.5;
/// A run may take this long [s].
const LIMITS: Limits = Limits { run_s: 900.0, repeat_s: 0.0, repeats: 1 };

/// Test cases and what pulls the beam; in the last one two strips do, for which no solution is stored.
const CASES: [(&str, Option<Pull>); 3] =
    [("test case 1", Some(Pull::Gravity)), ("test case 2", Some(Pull::Force)), ("test case 3", None)];

/// A way to cut, and the elements.
#[derive(Clone, Copy, Debug)]
struct Way {
    name: &'static str,
    /// What lies inside elements.
    inside: Inside,
    element: &'static str,
}

/// A run: degrees of freedom and displacements, or why there are none.
struct Run {
    mesh: usize,
    unknowns: usize,
    found: Result<Series, String>,
}

/// The experiment.
///
/// # Errors
/// The user ended the study.
pub(super) fn schoch(bench: &mut ExperimentBench<'_>) -> Result<ExperimentResult, Trouble> {
    let mut result = ExperimentResult {
        name: "schoch",
        title: "Convergence on a half-cut beam: figure 10 of Schoch".into(),
        about: format!(
            "The beam of 30 × 60 × 200 mm, E = 300 kPa, ν = 0.35, held at its base and cut through to half its depth, on \
             meshes of five tetrahedra per cell. Test case 1: gravity across it. Test case 2: its end is pulled, by 5 N on \
             a strip, because a line that is moved has no limit in three dimensions. Test case 3: two strips of its end are \
             moved apart and sideways, by {PART} of what is printed; at all of it elements at the ends of the strips turn \
             inside out. For `X-FEM` the plane of the cut and its front lie a third of a cell inside elements; the mesh of \
             `pre-cut` has faces there. The paper has linear elements; quadratic ones are run on the coarser meshes. \
             Errors are ‖u − u*‖/‖u*‖ over 24 points of the beam.",
        ),
        ..ExperimentResult::default()
    };
    let all = |way: &Way| meshes(way, bench.is_quick());
    let of_ways: Vec<Vec<usize>> = METHODS.iter().map(all).collect();
    let total = CASES.len() * LAWS.len() * of_ways.iter().map(Vec::len).sum::<usize>();
    let mut orders = DEGREES.map(|degree| {
        Table::new(
            &format!("Orders of convergence, {degree} elements"),
            "The slope of the error over the size of cells, fitted to all meshes in logarithms; the front of a cut, where \
             stress is singular, allows 1 in the limit for elements of any degree. Finest errors are those of the finest mesh that both \
             methods solved, and the ratio is that of these. References of test cases 1 and 2 are stored solutions by \
             hexahedra of order 3 and 4; that of test case 3 is the limit of the three finest pre-cut meshes of linear \
             elements, which favours these.",
            &[
                ("order, X-FEM", Unit::Number),
                ("order, pre-cut", Unit::Number),
                ("finest error, X-FEM", Unit::Number),
                ("finest error, pre-cut", Unit::Number),
                ("X-FEM over pre-cut", Unit::Times),
                ("± of the reference", Unit::Number),
            ],
        )
    });
    let mut points = DEGREES.map(|degree| {
        Table::new(
            &format!("Errors, {degree} elements"),
            "Every run that gave a result.",
            &[
                ("degrees of freedom", Unit::Count),
                ("error, X-FEM", Unit::Number),
                ("error, pre-cut", Unit::Number),
            ],
        )
    });
    let mut plots = Plots { caption: "Error over degrees of freedom.".into(), ..Plots::default() };
    for (case, pull) in CASES {
        let mut chart = Chart::new(case, "degrees of freedom [log₁₀]", "error");
        chart.logarithmic = true;
        for law in LAWS {
            let name = format!("{case} {law}");
            let mut runs = Vec::new();
            // All ways run before any error is known: where no solution is stored, their own runs give the reference.
            for (way, meshes) in METHODS.iter().zip(&of_ways) {
                let mut of_way = Vec::new();
                for &mesh in meshes {
                    let what = format!("{name}, {}, {} cells across", way.name, cells(mesh));
                    bench.begin(what.clone(), total)?;
                    let run = run(bench, pull, law, mesh, way)?;
                    if let Err(reason) = &run.found {
                        result.notes.push(format!("{what}: {reason}"));
                    }
                    of_way.push(run);
                }
                runs.push(of_way);
            }
            // Entry 1 is that of pre-cut meshes of linear elements.
            let Some((truth, error_bar)) = reference(pull, law, &runs[1]) else {
                result.notes.push(format!("{name}: no reference, because pre-cut meshes have no limit"));
                continue;
            };
            let courses: Vec<Vec<Point>> = runs.iter().map(|runs| course(runs, &truth)).collect();
            // A single point is no line, but it has its place in the table.
            for (way, course) in METHODS.iter().zip(&courses).filter(|(_, course)| course.len() > 1) {
                let points = course.iter().map(|point| [point.unknowns.log10(), point.error]).collect();
                chart.lines.push(Line { name: format!("{law}, {}", way.name), points });
            }
            // Each degree has a course of X-FEM and one of pre-cut meshes.
            for (degree, pair) in courses.chunks(2).enumerate() {
                let (xfem, precut) = (&pair[0], &pair[1]);
                let [of_xfem, of_precut] = [slope(xfem), slope(precut)];
                let both = |mesh: usize| Some((at(xfem, mesh)?.error, at(precut, mesh)?.error));
                // Only errors on the same mesh have a meaningful ratio.
                let finest = (0..MESHES.len()).rev().find_map(both);
                let [xfem_error, precut_error] = [finest.map(|both| both.0), finest.map(|both| both.1)];
                let ratio = finest.map(|(xfem, precut)| xfem / precut);
                let row = [of_xfem, of_precut, xfem_error, precut_error, ratio, Some(error_bar)];
                orders[degree].row(&*name, &row);
                for &mesh in &of_ways[2 * degree] {
                    let [xfem, precut] = [at(xfem, mesh), at(precut, mesh)];
                    let unknowns = xfem.or(precut).map(|point| point.unknowns);
                    let errors = [xfem, precut].map(|point| point.map(|point| point.error));
                    let row = [unknowns, errors[0], errors[1]];
                    points[degree].row(format!("{name}, {} across", cells(mesh)), &row);
                }
            }
        }
        plots.charts.push(chart);
    }
    result.plots.push(plots);
    result.tables.extend(orders.into_iter().chain(points));
    Ok(result)
}

/// The point of a course on a mesh.
fn at(course: &[Point], mesh: usize) -> Option<&Point> {
    course.iter().find(|point| point.mesh == mesh)
}

/// The meshes that are solved in a way.
fn meshes(way: &Way, quick: bool) -> Vec<usize> {
    match (way.element, quick) {
        ("tet10", quick) => (0..QUADRATIC[usize::from(quick)]).collect(),
        (_, true) => QUICK.to_vec(),
        (_, false) => (0..MESHES.len()).collect(),
    }
}

/// Cells across the beam.
fn cells(mesh: usize) -> usize {
    MESHES[mesh].iter().sum()
}

/// Solves a test case on a mesh.
fn run(
    bench: &ExperimentBench<'_>,
    pull: Option<Pull>,
    law: &str,
    mesh: usize,
    way: &Way,
) -> Result<Run, Trouble> {
    let scene = scene(pull, law, mesh, way)?;
    let protocol = match pull {
        None => Protocol::Motion { frame_s: 1.0, frames: STEPS },
        Some(_) => Protocol::Static,
    };
    let trial = trial::run(&scene, Path::new("."), 1, protocol, LIMITS, bench.stop()).ok_or("interrupted")?;
    let found = match trial.is_done() {
        // Of a motion only where it arrives.
        true => Ok(last(&trial.series)),
        false => Err(trial.reason),
    };
    Ok(Run { mesh, unknowns: trial.unknowns, found })
}

fn scene(pull: Option<Pull>, law: &str, mesh: usize, way: &Way) -> Result<Scene, Trouble> {
    let n = cells(mesh);
    let cell_m = 0.03 / n as f64;
    let parts = LINES_M.windows(2).zip(MESHES[mesh]);
    let along = |([from, to], count): ([f64; 2], usize)| {
        (1..=count).map(move |k| from + (to - from) * k as f64 / count as f64)
    };
    let x_m: Vec<f64> = std::iter::once(0.0)
        .chain(parts.flat_map(|(ends, count)| along(([ends[0], ends[1]], count))))
        .collect();
    let half_z = (0.1 / cell_m).round() as usize;
    let mut set = vec![
        gold(Pull::Force).probes("beam"),
        format!("body.beam.law=\"{law}\""),
        format!("body.beam.element=\"{}\"", way.element),
        format!("body.beam.mesh={}", beam_mesh(&x_m, 2 * n, half_z, way.inside)),
    ];
    match pull {
        Some(pull) => set.extend(pulled(pull)),
        None => {
            set.extend(strips(PART));
            set.push(format!("body.beam.displacement_over_s={STEPS}"));
        }
    }
    Ok(Scene::from_toml(SCENE)?.apply_sets(&set)?)
}

/// The last instant of a series.
fn last(series: &Series) -> Series {
    match series.frames.len().checked_sub(1) {
        Some(i) => Series {
            frames: vec![0],
            displacement_m: series.at(i).to_vec(),
            energy_j: vec![series.energy_j[i]],
        },
        None => Series::default(),
    }
}

/// The solution that errors are measured against, and its relative error bar.
fn reference(pull: Option<Pull>, law: &str, precut: &[Run]) -> Option<(Series, f64)> {
    if let Some(pull) = pull {
        let Truth::Known { series, error_bar, .. } = gold(pull).truth(law, None, "") else { return None };
        return Some((series, error_bar));
    }
    let done: Vec<(usize, &Series)> =
        precut.iter().filter_map(|run| Some((run.mesh, run.found.as_ref().ok()?))).collect();
    let [.., first, second, third] = &done[..] else { return None };
    let sizes = [first, second, third].map(|(mesh, _)| 1.0 / cells(*mesh) as f64);
    let limit = extrapolate(sizes, [first.1, second.1, third.1])?;
    Some((limit.value, limit.error_bar))
}

/// A run with a result.
struct Point {
    mesh: usize,
    unknowns: f64,
    error: f64,
}

/// The runs that gave a result, against the `truth`.
fn course(runs: &[Run], truth: &Series) -> Vec<Point> {
    let point = |run: &Run| {
        let error = run.found.as_ref().ok()?.minus(truth).norm() / truth.norm();
        Some(Point { mesh: run.mesh, unknowns: run.unknowns as f64, error })
    };
    runs.iter().filter_map(point).collect()
}

/// Order of convergence per size of cells: the slope of least squares through all points in logarithms. `None` for fewer
/// than three.
fn slope(course: &[Point]) -> Option<f64> {
    let points: Vec<[f64; 2]> =
        course.iter().map(|point| [-(cells(point.mesh) as f64).ln(), point.error.ln()]).collect();
    let n = points.len() as f64;
    let mean = |k: usize| points.iter().map(|p| p[k]).sum::<f64>() / n;
    let (x, y) = (mean(0), mean(1));
    let spread: f64 = points.iter().map(|p| (p[0] - x).powi(2)).sum();
    let common: f64 = points.iter().map(|p| (p[0] - x) * (p[1] - y)).sum();
    (points.len() >= 3 && spread > 0.0).then(|| common / spread)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use std::sync::atomic::AtomicBool;

    use super::*;

    #[test]
    fn slopes_are_orders_per_size_of_cells() {
        let error = |mesh: usize| 0.3 * (cells(mesh) as f64).powf(-1.5);
        let course: Vec<Point> =
            (0..MESHES.len()).map(|mesh| Point { mesh, unknowns: 1.0, error: error(mesh) }).collect();
        assert!((slope(&course).unwrap() - 1.5).abs() < 1e-9);
        assert_eq!(slope(&course[..2]), None);
    }

    #[test]
    fn meshes_become_finer_and_every_scene_is_one() {
        assert!((1..8).all(|mesh| cells(mesh) > cells(mesh - 1)));
        for (_, pull) in CASES {
            for law in LAWS {
                for way in &METHODS {
                    for mesh in [0, 7] {
                        scene(pull, law, mesh, way).unwrap();
                    }
                }
            }
        }
    }

    /// On the coarsest mesh: each method within what elements of 7.5 mm can do, and quadratic elements better than linear
    /// ones. A front behind the blade costs accuracy, a calibrated one does not.
    #[test]
    fn a_front_behind_the_blade_costs_accuracy_on_coarse_meshes() {
        let stop = AtomicBool::new(false);
        let error_with = |way: Way, more: &[&str]| {
            let more: Vec<String> = more.iter().map(|set| (*set).to_owned()).collect();
            let scene = scene(Some(Pull::Force), "linear", 0, &way).unwrap().apply_sets(&more).unwrap();
            let trial = trial::run(&scene, Path::new("."), 1, Protocol::Static, LIMITS, &stop).unwrap();
            assert!(trial.is_done(), "{}", trial.reason);
            let (truth, _) = reference(Some(Pull::Force), "linear", &[]).unwrap();
            trial.series.minus(&truth).norm() / truth.norm()
        };
        let [behind, precut, quadratic, quadratic_precut] = METHODS.map(|way| error_with(way, &[]));
        let calibrated = error_with(METHODS[0], &["body.beam.cutting.front=\"calibrated\""]);
        assert!(precut < behind && behind < 0.6 && precut > 0.02, "{behind} {precut}");
        assert!(
            calibrated < 1.3 * precut && quadratic < behind,
            "{calibrated} {precut} {quadratic} {behind}"
        );
        assert!(
            quadratic_precut < quadratic && quadratic_precut < precut,
            "{quadratic} {quadratic_precut} {precut}"
        );
        assert!(quadratic_precut > 1e-3, "{quadratic_precut}");
    }
}
