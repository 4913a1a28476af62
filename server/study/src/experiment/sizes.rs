//! Adaptive against uniform cells, and the time per cell from eight thousand cells on.

use super::model::{Grid, cube};
use super::solve::{Solver, Until, run};
use super::system::{Problem, System, smoothers};
use super::tables::S_CUBE;
use super::{ExperimentBench, ExperimentResult, Table, Trouble, Unit};

/// Finest cells across, and levels.
const SIZES: [(u32, u8); 4] = [(24, 3), (48, 4), (80, 4), (120, 3)];
/// Uniform grids up to this many cells across.
const UNIFORM: u32 = 80;

/// The experiment.
///
/// # Errors
/// The user ended the study.
pub fn sizes(bench: &mut ExperimentBench<'_>) -> Result<ExperimentResult, Trouble> {
    let mut result = ExperimentResult {
        name: "dick-sizes",
        title: "Time per cell, and what adaptivity saves".into(),
        about: "The cube with rotated blades, from few cells to many, with the default smoother on one thread: a \
            step is rotations, operators of all levels, and three cycles. Uniform grids have the finest cells \
            everywhere and the same cuts. All cubes have the same blades, so rods of the smallest one are two cells \
            wide, and thin rods have more coarse matrices per cell."
            .into(),
        ..ExperimentResult::default()
    };
    let mut table = Table::new(
        "Steps of cubes",
        "The paper has 11.2 to 13.6 µs per cell and step (6.4 to 8.4 µs of them multigrid), and steps 1.4 to 5.7 \
         times as fast as on uniform grids.",
        &[
            ("cells", Unit::Count),
            ("cutting", Unit::Seconds),
            ("levels", Unit::Seconds),
            ("step", Unit::Seconds),
            ("step per cell", Unit::Seconds),
            ("multigrid per cell", Unit::Seconds),
            ("uniform cells", Unit::Count),
            ("uniform step", Unit::Seconds),
            ("faster by", Unit::Times),
        ],
    );
    let mut memory = Table::new(
        "Bytes per cell",
        "Finest level: octree, kernels, positions, velocities and vectors. Coarse levels: cells, transfers, kernels \
         and vectors; stored matrices are those of coarse cells that are cut, not full or turned in themselves, with \
         their copies in the kernels.",
        &[
            ("cells", Unit::Count),
            ("finest level", Unit::Number),
            ("levels of multigrid", Unit::Number),
            ("stored matrices", Unit::Number),
        ],
    );
    let sizes = if bench.is_quick() { &SIZES[..3] } else { &SIZES[..] };
    for &(across, levels) in sizes {
        bench.begin(format!("{across} cells across"), sizes.len())?;
        let own = step(across, levels)?;
        memory.row(
            format!("{across} across, {levels} levels"),
            &[Some(own.cells), Some(own.bytes[0]), Some(own.bytes[1]), Some(own.bytes[2])],
        );
        let uniform = if across <= UNIFORM { Some(step(across, 0)?) } else { None };
        table.row(
            format!("{across} across, {levels} levels"),
            &[
                Some(own.cells),
                Some(own.cutting_s),
                Some(own.levels_s),
                Some(own.step_s),
                Some(own.step_s / own.cells),
                Some(own.multigrid_s / own.cells),
                uniform.as_ref().map(|u| u.cells),
                uniform.as_ref().map(|u| u.step_s),
                uniform.as_ref().map(|u| u.step_s / own.step_s),
            ],
        );
    }
    result.tables.extend([table, memory]);
    Ok(result)
}

struct Step {
    cells: f64,
    cutting_s: f64,
    levels_s: f64,
    step_s: f64,
    multigrid_s: f64,
    /// Bytes per cell: finest level, levels of multigrid, stored matrices.
    bytes: [f64; 3],
}

fn step(across: u32, levels: u8) -> Result<Step, Trouble> {
    let model = cube(across, levels, Grid::Rotated)?;
    let cut = model.cut()?;
    let mut system = System::new(cut.space.octree(), (model.held, model.pull), Problem::Step(S_CUBE))?;
    let operator_s = system.update();
    let (mut multigrid, seconds) = system.multigrid(smoothers()[1].1);
    let none = vec![nalgebra::Vector3::zeros(); system.unknowns() / 3];
    let until = Until { iterations: 3, error: -1.0, seconds: 0.0 };
    let course = run(&mut system, Solver::Cycles(&mut multigrid), &none, until);
    let multigrid_s = seconds.coarse + course.points.last().map_or(f64::NAN, |point| point.0);
    let [levels, stored] = multigrid.memory();
    drop(multigrid);
    let n = cut.space.octree().cells().len() as f64;
    Ok(Step {
        bytes: [system.memory(), levels, stored].map(|bytes| bytes as f64 / n),
        cells: cut.space.octree().cells().len() as f64,
        cutting_s: cut.seconds,
        levels_s: seconds.levels,
        step_s: operator_s + multigrid_s,
        multigrid_s,
    })
}
