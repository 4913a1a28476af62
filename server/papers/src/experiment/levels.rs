//! Accuracy against time with a coarse level as the one that is simulated.

use nalgebra::Vector3;
use scindo_physics::body::{Body, BodySettings, Outcome, PcgSettings};
use scindo_physics::material::{Law, Material};
use scindo_physics::solver::Method;
use scindo_physics::space::OctreeSpace;
use scindo_study::report::result::{ExperimentResult, Table, Unit};
use scindo_study::report::view;

use crate::lab::{ExperimentBench, Trouble};
use crate::system::linear::MATERIAL;
use crate::system::model::{Grid, Model, cube};

/// Finest cells across, and levels of coarsening.
const SIZE: (u32, u8) = (64, 3);
const QUICK: (u32, u8) = (32, 3);
/// Young's modulus [Pa]: a block that sways visibly, and rods that lean.
const YOUNG_PA: f64 = 2e5;
/// Gravity with a sideways part [m/s²].
const GRAVITY: Vector3<f64> = Vector3::new(2.0, 1.0, -9.0);
/// Step [s] and number of steps.
const STEP_S: f64 = 0.02;
const STEPS: u32 = 15;

/// The experiment.
///
/// # Errors
/// A cut that is refused, or the user ended the study.
pub(super) fn levels(bench: &mut ExperimentBench<'_>) -> Result<ExperimentResult, Trouble> {
    let (across, coarsening) = if bench.is_quick() { QUICK } else { SIZE };
    let mut result = ExperimentResult {
        name: "cells-levels",
        title: "Simulating a coarse level: composite elements".into(),
        about: format!(
            "A cube of {across} cells across stands on the ground in gravity that leans, uncut, and cut to half its \
             height by rotated blades. `simulate_level` 1 and 2 solve on composite elements 2 and 4 finest cells \
             wide (Nesme et al. 2009; Wu, Dick, Westermann 2011); vertices, cuts and surface stay those of the finest \
             cells. {STEPS} steps of 20 ms by conjugate gradients with multigrid to 1e-3, on one thread."
        ),
        ..ExperimentResult::default()
    };
    let mut table = Table::new(
        "Accuracy against time",
        "Unknowns are those of the simulated level. Step: median of the later half. The errors are relative to level \
         0 after the last step: of the mean displacement of the top (tip), and in the mean square over all vertices.",
        &[
            ("level", Unit::Count),
            ("cells", Unit::Count),
            ("unknowns", Unit::Count),
            ("iterations", Unit::Number),
            ("step", Unit::Seconds),
            ("faster by", Unit::Times),
            ("error of the tip", Unit::Number),
            ("error", Unit::Number),
        ],
    );
    for grid in [Grid::Uncut, Grid::Rotated] {
        // Level 0 comes first: all others are measured against it.
        let mut finest: Option<Run> = None;
        for level in 0..=BodySettings::COARSEST_SIMULATED {
            bench.begin(format!("{}, level {level}", grid.name()), 6)?;
            let run = run(across, coarsening, grid, level)?;
            let against = finest.as_ref().unwrap_or(&run);
            let errors = run.errors(against);
            table.row(
                format!("{}, level {level}", grid.name()),
                &[
                    Some(f64::from(level)),
                    Some(run.body.n_elements() as f64),
                    Some(run.unknowns),
                    Some(run.iterations),
                    Some(run.step_s),
                    Some(against.step_s / run.step_s),
                    Some(errors[0]),
                    Some(errors[1]),
                ],
            );
            // Rods show what composite elements make of a body; the uncut block hardly does.
            if grid == Grid::Rotated {
                result.pictures.push(view::surface(
                    run.body.surface(),
                    run.body.positions(),
                    Vector3::z(),
                    format!("Level {level}"),
                ));
            }
            // Only the first body of a grid is kept, so no more than two are in memory.
            finest.get_or_insert(run);
        }
    }
    result.tables.push(table);
    Ok(result)
}

/// A body after its steps.
pub(super) struct Run {
    body: Body,
    /// Unknowns of the simulated level.
    pub unknowns: f64,
    /// Mean number of iterations per step.
    pub iterations: f64,
    /// Median of the later half of the steps [s].
    step_s: f64,
}

impl Run {
    /// Relative errors against the same body on the finest level: of the mean displacement of the top, and in the
    /// mean square over all vertices.
    pub(super) fn errors(&self, finest: &Self) -> [f64; 2] {
        let moved = |body: &Body| -> Vec<Vector3<f64>> {
            body.positions().iter().zip(body.rest_positions()).map(|(x, X)| x - X).collect()
        };
        let (ours, theirs) = (moved(&self.body), moved(&finest.body));
        let top = |u: &[Vector3<f64>]| -> Vector3<f64> {
            let rest = finest.body.rest_positions();
            u.iter().zip(rest).filter(|(_, X)| X.z > 1.0 - 1e-9).map(|(u, _)| u).sum()
        };
        let tip = (top(&ours) - top(&theirs)).norm() / top(&theirs).norm();
        let off: f64 = ours.iter().zip(&theirs).map(|(a, b)| (a - b).norm_squared()).sum();
        let size: f64 = theirs.iter().map(Vector3::norm_squared).sum();
        [tip, (off / size).sqrt()]
    }
}

/// Makes the steps of a cube with `level` simulated.
///
/// # Errors
/// A cut that is refused, or a step that fails.
pub(super) fn run(across: u32, coarsening: u8, grid: Grid, level: u8) -> Result<Run, Trouble> {
    let Model { octree, blades, held, .. } = cube(across, coarsening, grid)?;
    let material = Material { young_pa: YOUNG_PA, law: Law::Corotational, ..MATERIAL };
    let settings = BodySettings {
        solver: PcgSettings { iterations: 200, tolerance: 1e-3 },
        method: Method::MgPcg,
        simulate_level: level,
        ..BodySettings::default()
    };
    let mut body = Body::of_space(Box::new(OctreeSpace::new(octree)), material, settings)?;
    let ground: Vec<u32> =
        (0..).zip(body.rest_positions()).filter(|(_, X)| held(X)).map(|(node, _)| node).collect();
    body.fix(&ground, [true; 3], Vector3::zeros())?;
    for (incision, blade) in (1..).zip(&blades) {
        body.cut(blade, incision)?;
    }
    let (mut seconds, mut iterations) = (Vec::new(), 0);
    for _ in 0..STEPS {
        let started = std::time::Instant::now();
        let report = body.step(STEP_S, GRAVITY, &[]);
        seconds.push(started.elapsed().as_secs_f64());
        if report.outcome != Outcome::Advanced {
            return Err(format!("a step on level {level} failed: {:?}", report.outcome).into());
        }
        iterations += report.iterations;
    }
    let mut later = seconds.split_off(seconds.len() / 2);
    later.sort_by(f64::total_cmp);
    let levels = body.levels().map(|(levels, _)| levels).unwrap_or_default();
    Ok(Run {
        unknowns: levels.get(usize::from(level)).map_or(f64::NAN, |l| 3.0 * l.vertices as f64),
        iterations: f64::from(iterations) / f64::from(STEPS),
        step_s: later[later.len() / 2],
        body,
    })
}
