//! Adaptive against uniform cells, and the time per cell from eight thousand cells on.

use scindo_study::report::result::{ExperimentResult, Table, Unit};

use super::tables::S_CUBE;
use crate::lab::{ExperimentBench, Trouble};
use crate::system::linear::{Problem, System, smoothers};
use crate::system::model::{Cuts, Grid, Model, animal, cube};
use crate::system::solve::three_cycles;

/// Finest cells across, and levels.
const SIZES: [(u32, u8); 4] = [(24, 3), (48, 4), (80, 4), (120, 3)];
/// The same of the animal.
const ANIMALS: [(u32, u8); 4] = [(39, 2), (77, 3), (155, 4), (290, 5)];
/// Uniform grids up to this many cells across.
const UNIFORM: u32 = 80;

/// The experiment.
///
/// # Errors
/// The user ended the study.
pub(super) fn sizes(bench: &mut ExperimentBench<'_>) -> Result<ExperimentResult, Trouble> {
    let mut result = ExperimentResult {
        name: "dick-sizes",
        title: "Time per cell, and what adaptivity saves".into(),
        about: "The cube with rotated blades and the animal with its curved cuts, from few cells to many, with the default \
            smoother on one thread: a step is rotations, operators of all levels, and three cycles. Uniform grids have the \
            finest cells everywhere and the same cuts. All cubes have the same blades, so rods of the smallest one are two \
            cells wide, and thin rods have more coarse matrices per cell. The animal is the same body at every size."
            .into(),
        ..ExperimentResult::default()
    };
    let columns = [
        ("cells", Unit::Count),
        ("cutting", Unit::Seconds),
        ("levels", Unit::Seconds),
        ("step", Unit::Seconds),
        ("step per cell", Unit::Seconds),
        ("multigrid per cell", Unit::Seconds),
    ];
    let uniform =
        [("uniform cells", Unit::Count), ("uniform step", Unit::Seconds), ("faster by", Unit::Times)];
    let mut table = Table::new(
        "Steps of cubes",
        "The paper has 11.2 to 13.6 µs per cell and step (6.4 to 8.4 µs of them multigrid), and steps 1.4 to 5.7 \
         times as fast as on uniform grids.",
        &[columns.as_slice(), &uniform].concat(),
    );
    let mut animals = Table::new("Steps of the animal", "One body, cut alike at every size.", &columns);
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
    // The largest bodies take most of the time, so a quick study goes without them.
    let sizes = |all: &'static [(u32, u8); 4]| if bench.is_quick() { &all[..3] } else { &all[..] };
    let (cubes, bodies) = (sizes(&SIZES), sizes(&ANIMALS));
    let runs = cubes.len() + bodies.len();
    for &(across, levels) in cubes {
        let label = format!("{across} across, {levels} levels");
        bench.begin(format!("cube, {across} cells across"), runs)?;
        let own = step(&cube(across, levels, Grid::Rotated)?)?;
        memory.row(format!("cube, {label}"), &own.memory());
        // Beyond that size a uniform grid has too many cells to be worth the wait; its columns stay empty.
        let uniform = if across <= UNIFORM { Some(step(&cube(across, 0, Grid::Rotated)?)?) } else { None };
        let beside = [
            uniform.as_ref().map(|u| u.cells),
            uniform.as_ref().map(|u| u.step_s),
            uniform.as_ref().map(|u| u.step_s / own.step_s),
        ];
        table.row(label, &[own.times().as_slice(), &beside].concat());
    }
    // Rods of a coarse cube are few cells wide, while the animal is the same body at every size.
    for &(across, levels) in bodies {
        let label = format!("{across} across, {levels} levels");
        bench.begin(format!("animal, {across} cells across"), runs)?;
        let own = step(&animal(None, across, levels, Cuts::Curved)?)?;
        memory.row(format!("animal, {label}"), &own.memory());
        animals.row(label, &own.times());
    }
    result.tables.extend([table, animals, memory]);
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

impl Step {
    /// Cells, and times of cutting, levels, step; then per cell.
    fn times(&self) -> [Option<f64>; 6] {
        let Self { cells, cutting_s, levels_s, step_s, multigrid_s, .. } = *self;
        [cells, cutting_s, levels_s, step_s, step_s / cells, multigrid_s / cells].map(Some)
    }

    fn memory(&self) -> [Option<f64>; 4] {
        let [finest, levels, stored] = self.bytes;
        [self.cells, finest, levels, stored].map(Some)
    }
}

fn step(model: &Model) -> Result<Step, Trouble> {
    let cut = model.cut()?;
    let mut system = System::new(cut.space.octree(), (model.held, model.pull), Problem::Step(S_CUBE))?;
    let operator_s = system.update();
    let (mut multigrid, seconds) = system.multigrid(smoothers()[1].1);
    let none = vec![nalgebra::Vector3::zeros(); system.unknowns() / 3];
    let course = three_cycles(&mut system, &mut multigrid, false, &none);
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
