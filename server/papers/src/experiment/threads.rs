//! What threads save: the two benchmarks of the thesis, their profile, their run time over the number of threads,
//! and the largest mesh in real time.
//!
//! # Source
//! Jeřábková 2007, chapter 5: table 5.1, figures 5.8 and 5.9.

use std::collections::BTreeSet;
use std::num::NonZero;
use std::path::Path;
use std::time::Instant;

use nalgebra::Vector3;
use scindo_physics::body::Body;
use scindo_physics::element::Simd;
use scindo_physics::mesh::{BoxPattern, box_mesh};
use scindo_physics::operator::{Elastic, ElasticUpdate, LinearOperator as _, OperatorChoice, Stiffness as _};
use scindo_physics::team::Team;
use scindo_physics::team::phase::Phase;
use scindo_study::report::chart::{Chart, Line};
use scindo_study::report::result::Plots;
use scindo_study::report::result::{ExperimentResult, Table, Unit};
use scindo_world::assemble::BuildOptions;
use scindo_world::inputs::Inputs;
use scindo_world::scene::Scene;
use scindo_world::simulation::Simulation;

use crate::lab::{ExperimentBench, Trouble};

/// Steps of 40 ms, as in the thesis.
const STEPS: usize = 125;
/// Keys of the solver: ten iterations of conjugate gradients in each step, as in the thesis. No step meets the tolerance,
/// so each makes all of them, in the precision of the fast path.
pub(super) const TEN: &str = "iterations = 10, tolerance = 1e-30, precision = \"single\"";
/// Simulated time [s], which is also the longest run time of a simulation in real time.
const SIMULATED_S: f64 = 5.0;
/// Every run is made this often, and once more to warm up; the least time counts.
const REPEATED: usize = 5;
/// More threads than these are measured at every second number only, up to the most.
const EVERY: usize = 4;
const MOST_THREADS: usize = 64;

/// A benchmark of the thesis, and what is printed of it.
pub(super) struct Model {
    name: &'static str,
    /// Cells of the block, five tetrahedra each, and its size [m].
    pub cells: [usize; 3],
    size_m: [f64; 3],
    law: &'static str,
    density_kg_m3: f64,
    /// Falls on a floor; otherwise it is held at x = 0.
    falls: bool,
    /// Printed run time on one thread [s], and shares of `ApplyInternalForces`, of `ModifiedCG`, and of the product
    /// with the matrix in the latter.
    printed: [f64; 4],
    /// Printed speed-ups: threads and factor.
    speed_ups: &'static [(usize, f64)],
    /// Printed sizes in real time: threads and tetrahedra.
    real_time: &'static [(usize, f64)],
}

/// A block in place of the animal, whose mesh is not printed: 20,870 tetrahedra there.
pub(super) const HIPPO: Model = Model {
    name: "Hippo",
    cells: [26, 16, 10],
    size_m: [2.0, 1.0, 0.8],
    law: "linear",
    density_kg_m3: 1000.0,
    falls: true,
    printed: [7.0, 0.58, 0.30, 0.60],
    speed_ups: &[(3, 2.0)],
    real_time: &[(1, 20_000.0), (3, 40_000.0)],
};

pub(super) const BAR: Model = Model {
    name: "Bar",
    cells: [40, 8, 8],
    size_m: [1.0, 0.2, 0.2],
    law: "corotational",
    density_kg_m3: 100.0,
    falls: false,
    printed: [36.4, 0.11, 0.88, 0.98],
    speed_ups: &[(4, 3.4), (8, 6.5)],
    real_time: &[(1, 3_000.0), (4, 10_500.0), (8, 13_000.0)],
};

/// A run of [`STEPS`] steps.
pub(super) struct Course {
    /// Run time [s], and of it the time in the phases of forces and of solving.
    pub seconds: f64,
    pub forces_s: f64,
    pub solve_s: f64,
    pub tetrahedra: usize,
    /// Positions at the end [m].
    pub positions: Vec<Vector3<f64>>,
    /// Iterations of all steps.
    pub iterations: u32,
}

/// The experiment.
///
/// # Errors
/// A scene that cannot be made, or the user ended the study.
pub(super) fn threads(bench: &mut ExperimentBench<'_>) -> Result<ExperimentResult, Trouble> {
    let cores = std::thread::available_parallelism().map_or(1, NonZero::get);
    let mut result = ExperimentResult {
        name: "threads",
        title: "Threads: run time, profile and speed-up".into(),
        about: format!(
            "The benchmarks of chapter 5 of Jeřábková's thesis: 125 steps of 40 ms by implicit Euler with 10 \
             iterations of conjugate gradients each, 5 s of simulated time. The Bar is hers (12,800 tetrahedra, \
             corotational, held at one end, bending under gravity). For the Hippo stands a block of 20,800 \
             tetrahedra (linear, falling on a floor, which hers does as well). She used processors of 2006 with 2 to 8 \
             cores; this machine has {cores}. The least time of {REPEATED} runs counts."
        ),
        ..ExperimentResult::default()
    };
    let counts = counts(cores);
    let total = 2 * counts.len() + if bench.is_quick() { 0 } else { 2 };
    let mut profile = Table::new(
        "Profile on one thread (table 5.1)",
        "Shares of the run time in forces, rotations and diagonal blocks (ApplyInternalForces), and in conjugate \
         gradients (ModifiedCG). The last column is the share of products with the matrix in conjugate gradients: the \
         time of a product alone times their number.",
        &[
            ("run time", Unit::Seconds),
            ("forces", Unit::Share),
            ("conjugate gradients", Unit::Share),
            ("rest", Unit::Share),
            ("products in them", Unit::Share),
            ("3×3 blocks", Unit::Count),
            ("matrix [MB]", Unit::Number),
        ],
    );
    let mut charts = [Chart::new("Run time of 5 s", "threads", "s"), Chart::new("Speed-up", "threads", "")];
    charts[0].logarithmic = true;
    let ends = [counts[0], *counts.last().unwrap_or(&1)].map(|n| n as f64);
    // Runs below this line are faster than real time.
    charts[0].lines.push(Line { name: "real time".into(), points: ends.map(|n| [n, SIMULATED_S]).into() });
    for model in [&HIPPO, &BAR] {
        let mut courses = Vec::new();
        for &n in &counts {
            bench.begin(format!("{} on {n} threads", model.name), total)?;
            courses.push((n, model.course(model.cells, n)?));
        }
        // The first run is on one thread, the measure of profile and speed-up.
        let (_, alone) = &courses[0];
        // A speed-up of a computation that comes out differently would mean nothing.
        model.check(&courses)?;
        // Phases do not tell products from the rest of a solve, so a product is timed alone.
        let product_s = model.product_s()? * f64::from(alone.iterations);
        let rest = alone.seconds - alone.forces_s - alone.solve_s;
        let [blocks, stored] = model.blocks();
        let [seconds, forces, gradients, products] = model.printed;
        profile.row(
            model.name,
            &[
                Some(alone.seconds),
                Some(alone.forces_s / alone.seconds),
                Some(alone.solve_s / alone.seconds),
                Some(rest / alone.seconds),
                Some((product_s / alone.solve_s).min(1.0)),
                Some(blocks as f64),
                Some(stored as f64 * BLOCK_BYTES / 1e6),
            ],
        );
        profile.printed(
            format!("{}, printed", model.name),
            &[
                Some(seconds),
                Some(forces),
                Some(gradients),
                Some(1.0 - forces - gradients),
                Some(products),
                None,
                None,
            ],
        );
        result.tables.push(model.table(&courses));
        let points = |y: &dyn Fn(&Course) -> f64| courses.iter().map(|(n, c)| [*n as f64, y(c)]).collect();
        charts[0].lines.push(Line { name: model.name.into(), points: points(&|c| c.seconds) });
        let speed_up = points(&|c| alone.seconds / c.seconds);
        charts[1].lines.push(Line { name: model.name.into(), points: speed_up });
        let printed = model.speed_ups.iter().map(|&(n, factor)| [n as f64, factor]);
        let printed = [[1.0, 1.0]].into_iter().chain(printed.filter(|[n, _]| *n <= ends[1])).collect();
        charts[1].lines.push(Line { name: format!("{}, printed", model.name), points: printed });
        if !bench.is_quick() {
            bench.begin(format!("the largest {} in real time", model.name), total)?;
            result.notes.push(model.largest(alone)?);
        }
    }
    result.tables.insert(0, profile);
    result.plots.push(Plots {
        caption: "Run time and speed-up over the number of threads (figures 5.8 and 5.9).".into(),
        charts: charts.into(),
        ..Plots::default()
    });
    result.notes.push("all numbers of threads give the same positions, bit for bit".into());
    if cores < 8 {
        result.notes.push(format!(
            "the printed speed-ups of 4 and 8 threads have no counterpart here, because this machine has {cores} cores"
        ));
    }
    Ok(result)
}

/// One thread, up to as many as the machine has.
fn counts(cores: usize) -> Vec<usize> {
    let step = |n: &usize| if *n < EVERY { n + 1 } else { n + n / 2 - n % 2 };
    let mut counts: Vec<usize> = std::iter::successors(Some(1), |n| Some(step(n)))
        .take_while(|n| *n < cores.min(MOST_THREADS))
        .collect();
    counts.push(cores.min(MOST_THREADS));
    counts
}

/// A block of 3×3 numbers in single precision [bytes].
const BLOCK_BYTES: f64 = 36.0;

impl Model {
    /// Non-zero 3×3 blocks of the stiffness matrix, and those of one triangle of it with the diagonal.
    fn blocks(&self) -> [usize; 2] {
        let mesh =
            box_mesh(Vector3::zeros(), self.size_m.into(), self.cells, BoxPattern::Tet5 { parity: false });
        let (mut edges, nodes) = (BTreeSet::new(), mesh.nodes.len());
        for tet in &mesh.tets {
            for (k, &a) in tet.iter().enumerate() {
                edges.extend(tet[k + 1..].iter().map(|&b| (a.min(b), a.max(b))));
            }
        }
        [nodes + 2 * edges.len(), nodes + edges.len()]
    }

    /// The scene with these cells and the keys `solver` of the solver.
    pub(super) fn scene(&self, cells: [usize; 3], solver: &str) -> String {
        let Self { law, density_kg_m3, size_m: [x, y, z], .. } = self;
        let [a, b, c] = cells;
        let base = if self.falls { 0.5 } else { 0.0 };
        let held = match self.falls {
            true => {
                "[[obstacle]]\nid = \"floor\"\nhalf_space = { point_m = [0, 0, 0], normal = [0, 0, 1] }\n"
            }
            false => "[[body.fix]]\nwhere = { slab = { axis = \"x\", from = 0, to = 0 } }\n",
        };
        format!(
            "schema = 1\nname = \"{name}\"\nworld = {{ gravity_m_s2 = [0, 0, -9.81], step_s = 0.04 }}\n[[body]]\n\
             id = \"body\"\nlaw = \"{law}\"\nyoung_pa = 1e5\npoisson = 0.33\ndensity_kg_m3 = {density_kg_m3}\n\
             mesh = {{ box = {{ min_m = [0, 0, {base}], max_m = [{x}, {y}, {top}], cells = [{a}, {b}, {c}], \
             pattern = \"tet5\" }} }}\nsolver = {{ {solver} }}\n{held}",
            name = self.name,
            top = base + z,
        )
    }

    fn simulation(&self, cells: [usize; 3], threads: usize) -> Result<Simulation, Trouble> {
        let options = BuildOptions { threads, portable: false };
        let scene = Scene::from_toml(&self.scene(cells, TEN))?;
        Ok(Simulation::with_options(&scene, Path::new(""), options)?)
    }

    /// The fastest of some runs.
    pub(super) fn course(&self, cells: [usize; 3], threads: usize) -> Result<Course, Trouble> {
        let mut best: Option<Course> = None;
        for _ in 0..=REPEATED {
            let course = self.run(cells, threads)?;
            if best.as_ref().is_none_or(|best| course.seconds < best.seconds) {
                best = Some(course);
            }
        }
        best.ok_or_else(|| "no run was made".into())
    }

    fn run(&self, cells: [usize; 3], threads: usize) -> Result<Course, Trouble> {
        let mut simulation = self.simulation(cells, threads)?;
        simulation.measure_phases(true);
        let inputs = Inputs::default();
        let mut iterations = 0;
        let start = Instant::now();
        for _ in 0..STEPS {
            iterations += simulation.step(&inputs).bodies[0].solve.iterations;
        }
        let seconds = start.elapsed().as_secs_f64();
        let phases = simulation.total_phases();
        let body = &simulation.bodies()[0].body;
        Ok(Course {
            seconds,
            forces_s: phases.of(Phase::Operator) + phases.of(Phase::Residual),
            solve_s: phases.of(Phase::Solve),
            tetrahedra: body.n_elements(),
            positions: body.positions().to_vec(),
            iterations,
        })
    }

    /// All runs end at the same positions, which are finite.
    fn check(&self, courses: &[(usize, Course)]) -> Result<(), Trouble> {
        let first = &courses[0].1.positions;
        if !first.iter().flatten().all(|x| x.is_finite()) {
            return Err(format!("{}: a position is not finite", self.name).into());
        }
        match courses.iter().find(|(_, course)| course.positions != *first) {
            Some((n, _)) => Err(format!("{}: {n} threads end at other positions than one", self.name).into()),
            None => Ok(()),
        }
    }

    /// Seconds of one product with the stiffness of the body at rest, on one thread.
    fn product_s(&self) -> Result<f64, Trouble> {
        let simulation = self.simulation(self.cells, 1)?;
        let body: &Body = &simulation.bodies()[0].body;
        let (Some(tets), material) = (body.tets(), body.material()) else {
            return Err(format!("{}: the body has no tetrahedra", self.name).into());
        };
        let n = body.n_copies();
        let mut team = Team::new(1)?;
        let mut elastic = Elastic::new(Simd::detect(), tets.mesh(), tets.pieces(), n);
        elastic.set_choice(OperatorChoice::Auto);
        let with = ElasticUpdate { lame: material.lame(), law: material.law, scale: 1.0 };
        let (mut f, mut blocks) = (vec![[0.0; 4]; n], vec![[0.0; 8]; n]);
        elastic.update_all(&mut team, &with, body.positions(), &mut f, &mut blocks);
        let x = vec![[0.3, -0.1, 0.2, 0.0]; n];
        let mut y = x.clone();
        let mut least = f64::INFINITY;
        for _ in 0..20 * REPEATED {
            let start = Instant::now();
            elastic.apply(&mut team, &x, &mut y);
            least = least.min(start.elapsed().as_secs_f64());
        }
        Ok(least)
    }

    fn table(&self, courses: &[(usize, Course)]) -> Table {
        let alone = &courses[0].1;
        let mut table = Table::new(
            &format!("{} on more threads", self.name),
            "Tetrahedra in real time: those of the run, times 5 s over its run time, because the work grows with their \
             number.",
            &[
                ("run time", Unit::Seconds),
                ("speed-up", Unit::Times),
                ("tetrahedra in real time", Unit::Count),
            ],
        );
        for (n, course) in courses {
            let size = course.tetrahedra as f64 * SIMULATED_S / course.seconds;
            let values = [Some(course.seconds), Some(alone.seconds / course.seconds), Some(size)];
            table.row(words(*n), &values);
        }
        let printed = |list: &[(usize, f64)], n: usize| list.iter().find(|(m, _)| *m == n).map(|(_, x)| *x);
        let mut known: Vec<usize> = self.speed_ups.iter().chain(self.real_time).map(|(n, _)| *n).collect();
        known.sort_unstable();
        known.dedup();
        for n in known {
            let seconds = (n == 1).then_some(self.printed[0]);
            let values = [seconds, printed(self.speed_ups, n), printed(self.real_time, n)];
            table.printed(format!("{}, printed", words(n)), &values);
        }
        table
    }

    /// A mesh of the size that should run in real time on one thread: what it takes.
    fn largest(&self, alone: &Course) -> Result<String, Trouble> {
        let wider = (SIMULATED_S / alone.seconds).cbrt();
        let cells = self.cells.map(|n| ((n as f64 * wider).round() as usize).max(1));
        let course = self.run(cells, 1)?;
        Ok(format!(
            "a {} of {} tetrahedra takes {:.1} s on one thread for {SIMULATED_S} s",
            self.name, course.tetrahedra, course.seconds
        ))
    }
}

pub(super) fn words(threads: usize) -> String {
    if threads == 1 { "1 thread".to_owned() } else { format!("{threads} threads") }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn the_numbers_of_threads_end_with_all_cores() {
        assert_eq!(counts(1), [1]);
        assert_eq!(counts(2), [1, 2]);
        assert_eq!(counts(16), [1, 2, 3, 4, 6, 9, 12, 16]);
        assert_eq!(counts(500).last(), Some(&MOST_THREADS));
    }

    /// The bar has the printed counts, bends and keeps its bits; the animal's stand-in falls on the floor.
    #[test]
    fn the_benchmarks_are_those_of_the_thesis() {
        let bar = BAR.simulation(BAR.cells, 1).unwrap();
        let body = &bar.bodies()[0].body;
        assert_eq!((body.n_elements(), body.n_copies()), (12_800, 3_321));
        let courses = [1, 2, 3].map(|n| (n, BAR.run([10, 2, 2], n).unwrap()));
        BAR.check(&courses).unwrap();
        assert_eq!(courses[0].1.iterations, STEPS as u32 * 10);
        let lowest = |course: &Course| course.positions.iter().map(|x| x.z).fold(f64::INFINITY, f64::min);
        assert!(lowest(&courses[0].1) < -0.1, "the bar bends");
        let hippo = HIPPO.run([6, 4, 2], 1).unwrap();
        assert!(lowest(&hippo).abs() < 0.05, "it lies on the floor: {}", lowest(&hippo));
    }
}
