//! Tables 1 and 2: what cutting and a step cost, and multigrid against conjugate gradients.

use scindo_physics::octree::Shape;
use scindo_physics::solver::multigrid::Smoother;
use scindo_study::report::result::{ExperimentResult, Table, Unit};
use scindo_world::format::{MeshFile, read_mesh};
use scindo_world::mesh_in::{SolidSurface, memory_for_meshes};

use super::printed::{self, PICTURES, Picture, Printed};
use crate::lab::{ExperimentBench, Trouble};
use crate::system::linear::{Problem, System, smoothers};
use crate::system::model::{CUBE, Cuts, Grid, Model, animal, cube};
use crate::system::shape::Placed;
use crate::system::solve::{Until, block_jacobi, step_of_three, three_cycles};

/// Most iterations of conjugate gradients.
const PATIENCE: usize = 6_000;

/// Models of a whole study and of a quick one.
const MODELS: [&str; 5] = ["Bunny", "Cube", "Armadillo", "Bunny 2", "Bunny 3"];
const SMALL: [&str; 2] = ["Bunny 3", "Bunny 2"];
/// Finest cells across the animals that have as many cells after the cut as the armadillo, and before it as the solid of
/// figure 13.
pub(super) const ARMADILLO_ACROSS: u32 = 283;
const SLICED: u32 = 260;

/// Memory of a uniform grid with all that a step needs [bytes per cell].
const BYTES_PER_CELL: f64 = 1_500.0;

/// A model of the tables.
struct Entry {
    printed: Printed,
    adaptive: Model,
    uniform: Option<Model>,
    /// Leaves of the uniform grid at the finest resolution.
    uniform_cells: usize,
    s: f64,
}

/// The experiment.
///
/// # Errors
/// A surface that cannot be read, or the user ended the study.
pub(super) fn tables(bench: &mut ExperimentBench<'_>) -> Result<ExperimentResult, Trouble> {
    let mut result = ExperimentResult {
        name: "dick-tables",
        title: "Cutting octree cells: tables 1 and 2".into(),
        about: "Bodies are cut at rest and make their first step, from displacements of 0, on one thread. A step \
            is rotations and blocks of the finest level, the operators of all levels, and three cycles. The \
            error is the distance from the converged solution. Parts are timed several times, and the least time \
            counts: other work on the machine only makes it longer. The paper prints neither material nor time step: \
            the stiffness number s = E Δt²/(ρ h²) of each model is the one with which three cycles with the \
            paper's smoother, V(1,1) with SOR and ω = 1.7, reduce the error as printed."
            .into(),
        ..ExperimentResult::default()
    };
    let solid = read(bench, &mut result)?;
    let solid = solid.as_ref().map(|solid| Placed::new(solid));
    let solid = solid.as_ref().map(|solid| solid as &dyn Shape);
    if solid.is_none() {
        result.notes.push(
            "the Stanford bunny is not part of the program: a smooth solid in the shape of an animal with two \
             ears stands in for it, of about as many cells; `--surface FILE` takes another one"
                .into(),
        );
    }
    let mut tables = Tables::new();
    let names: &[&str] = if bench.is_quick() { &SMALL } else { &MODELS };
    let runs = names.len() + if bench.is_quick() { 0 } else { PICTURES.len() };
    for name in names {
        bench.begin(*name, runs)?;
        let mut entry = entry(name, solid, bench.is_quick())?;
        if entry.uniform.is_some() && memory_for_meshes() < BYTES_PER_CELL * entry.uniform_cells as f64 {
            entry.uniform = None;
            result.notes.push(format!("{name}: this machine has too little memory for the uniform grid"));
        }
        measure(&entry, &mut tables)?;
    }
    if !bench.is_quick() {
        for picture in &PICTURES {
            bench.begin(picture.name, runs)?;
            let (model, s) = match picture.name {
                "figure 11, left" => (cube(CUBE, 4, Grid::Aligned)?, S_CUBE),
                "figure 13" => (animal(solid, SLICED, 5, Cuts::Slices)?, S_BUNNY),
                "figure 15, middle" => (animal(solid, 155, 4, Cuts::Crossed)?, S_BUNNY),
                _ => (animal(solid, 155, 4, Cuts::Apart)?, S_BUNNY),
            };
            measure_picture(picture, &model, s, &mut tables.costs)?;
        }
    }
    result.tables.extend([tables.costs, tables.solvers, tables.parts]);
    Ok(result)
}

/// The tables of the experiment.
struct Tables {
    costs: Table,
    solvers: Table,
    parts: Table,
}

impl Tables {
    fn new() -> Self {
        let costs = Table::new(
            "Table 1: cells and times",
            "Uniform: a grid of finest cells only. All blades cut at once. Cutting is what the paper counts as such: links, \
             refinement, vertices, and the kernels of the cells anew. The surface, and the levels of multigrid, are what \
             else a cut costs. Rows of the paper are from one core at 2.8 GHz.",
            &[
                ("cells", Unit::Count),
                ("uniform", Unit::Count),
                ("after the cut", Unit::Count),
                ("cutting", Unit::Seconds),
                ("surface", Unit::Seconds),
                ("levels", Unit::Seconds),
                ("step", Unit::Seconds),
                ("cutting and step", Unit::Seconds),
                ("uniform step", Unit::Seconds),
                ("per cell", Unit::Seconds),
            ],
        );
        let solvers = Table::new(
            "Table 2: multigrid against conjugate gradients",
            "Multigrid: operators of the coarse levels and three cycles. Conjugate gradients are preconditioned by the \
         3×3 diagonal blocks. Ratio: their time to the same error over that of multigrid.",
            &[
                ("s", Unit::Number),
                ("multigrid", Unit::Seconds),
                ("its ‖e₃‖/‖e₀‖", Unit::Number),
                ("CG: ‖e‖/‖e₀‖ in that time", Unit::Number),
                ("CG: time to ‖e₃‖", Unit::Seconds),
                ("ratio", Unit::Times),
            ],
        );
        let parts = Table::new(
            "Parts of a step",
            "What the step of table 1 consists of, and what multigrid needs besides after a cut: levels, and the \
             largest eigenvalues for its smoothers.",
            &[
                ("rotations", Unit::Seconds),
                ("coarse operators", Unit::Seconds),
                ("three cycles", Unit::Seconds),
                ("step", Unit::Seconds),
                ("levels", Unit::Seconds),
                ("eigenvalues", Unit::Seconds),
            ],
        );
        Self { costs, solvers, parts }
    }
}

fn read(bench: &ExperimentBench<'_>, result: &mut ExperimentResult) -> Result<Option<SolidSurface>, Trouble> {
    let Some(path) = bench.surface() else { return Ok(None) };
    let MeshFile::Surface(surface) = read_mesh(path)? else {
        return Err(format!("{} is not a surface", path.display()).into());
    };
    let (solid, _) = SolidSurface::new(&surface, 1.0)?;
    result.notes.push(format!("the solid is that of `{}`", path.display()));
    Ok(Some(solid))
}

fn entry(name: &str, solid: Option<&dyn Shape>, quick: bool) -> Result<Entry, Trouble> {
    let of = |printed: Printed, across: u32, levels: u8, s: f64| -> Result<Entry, Trouble> {
        let uniform = animal(solid, across, 0, Cuts::Curved)?;
        let uniform_cells = uniform.octree.cells().len();
        let adaptive = animal(solid, across, levels, Cuts::Curved)?;
        Ok(Entry { printed, adaptive, uniform: Some(uniform).filter(|_| !quick), uniform_cells, s })
    };
    match name {
        "Bunny" => of(printed::BUNNY, 155, 4, S_BUNNY),
        "Bunny 2" => of(printed::BUNNY_2, 77, 3, S_BUNNY_2),
        "Bunny 3" => of(printed::BUNNY_3, 39, 2, S_BUNNY_3),
        "Armadillo" => of(printed::ARMADILLO, ARMADILLO_ACROSS, 5, S_ARMADILLO),
        _ => Ok(Entry {
            printed: printed::CUBE,
            adaptive: cube(CUBE, 4, Grid::Rotated)?,
            uniform: Some(cube(CUBE, 0, Grid::Rotated)?),
            uniform_cells: CUBE.pow(3) as usize,
            s: S_CUBE,
        }),
    }
}

/// Stiffness numbers with which three cycles reduce the error as printed.
pub(super) const S_BUNNY: f64 = 34_950.0;
pub(super) const S_CUBE: f64 = 970.0;
const S_ARMADILLO: f64 = 15_770.0;
pub(super) const S_BUNNY_2: f64 = 13_250.0;
pub(super) const S_BUNNY_3: f64 = 4_110.0;

/// One step: seconds of the parts, and of three cycles.
fn measure(entry: &Entry, tables: &mut Tables) -> Result<(), Trouble> {
    let Entry { printed, adaptive, uniform, uniform_cells, s } = entry;
    let cut = adaptive.cut()?;
    let cells = cut.space.octree().cells().len();
    let mut system = System::new(cut.space.octree(), (adaptive.held, adaptive.pull), Problem::Step(*s))?;
    let operator_s = system.update();
    let (exact, left) = system.converged();
    // A solution that is not converged would pass for an error of the solvers.
    if left.is_nan() || left > 1e-7 {
        return Err(format!("{}: the solution is not converged", adaptive.name).into());
    }
    // The uniform grid is cut alike, so that its step differs by the cells alone.
    let mut of_uniform = match uniform {
        Some(model) => {
            let cut = model.cut()?;
            Some(System::new(cut.space.octree(), (model.held, model.pull), Problem::Step(*s))?)
        }
        None => None,
    };
    let [sor, chebyshev] = smoothers();
    let ways = [
        (sor.0, sor.1, false),
        (chebyshev.0, chebyshev.1, false),
        ("Chebyshev in CG", chebyshev.1, true),
        ("Chebyshev of degree 1 in CG", Smoother::Chebyshev { degree: 1, most: 8 }, true),
    ];
    let mut runs = Vec::new();
    let mut until = Until { iterations: PATIENCE, error: 1.0, seconds: 0.0 };
    for (name, smoother, in_gradients) in ways {
        let (mut multigrid, seconds) = system.multigrid(smoother);
        let course = three_cycles(&mut system, &mut multigrid, in_gradients, &exact);
        // The levels of the uniform grid follow, and both together may be too much memory.
        drop(multigrid);
        let uniform_s = of_uniform.as_mut().map(|system| step_of_three(system, smoother, in_gradients).0);
        let multigrid_s = seconds.coarse + course.points.last().map_or(f64::NAN, |point| point.0);
        // One run of conjugate gradients serves all ways: down to the least error, and for the longest time.
        until.error = until.error.min(course.error(3));
        until.seconds = until.seconds.max(multigrid_s);
        runs.push((name, seconds, course, multigrid_s, uniform_s));
    }
    let gradients = block_jacobi(&mut system, &exact, until);
    for (name, seconds, course, multigrid_s, uniform_s) in runs {
        let step_s = operator_s + multigrid_s;
        tables.parts.row(
            format!("{}, {name}", adaptive.name),
            &[
                operator_s,
                seconds.coarse,
                multigrid_s - seconds.coarse,
                step_s,
                seconds.levels,
                seconds.eigenvalues,
            ]
            .map(Some),
        );
        tables.costs.row(
            format!("{}, {name}", adaptive.name),
            &[
                Some(adaptive.octree.cells().len() as f64),
                Some(*uniform_cells as f64),
                Some(cells as f64),
                Some(cut.seconds),
                Some(cut.surface_s),
                Some(seconds.levels),
                Some(step_s),
                Some(cut.seconds + step_s),
                uniform_s,
                Some(step_s / cells as f64),
            ],
        );
        let to_same = gradients.seconds_to(course.error(3));
        tables.solvers.row(
            format!("{}, {name}", adaptive.name),
            &[
                Some(*s),
                Some(multigrid_s),
                Some(course.error(3)),
                Some(gradients.error_after(multigrid_s)),
                to_same,
                to_same.map(|t| t / multigrid_s),
            ],
        );
    }
    let [before, uniform, after] = printed.cells.map(Some);
    let [cutting, step, uniform_step] = printed.seconds.map(Some);
    let per_cell = Some(printed.seconds[1] / printed.cells[2]);
    let name = format!("{} of the paper", printed.name);
    let both = Some(printed.seconds[0] + printed.seconds[1]);
    let values = [before, uniform, after, cutting, None, None, step, both, uniform_step, per_cell];
    tables.costs.printed(&*name, &values);
    let [error, seconds] = printed.gradients.map(Some);
    let ratio = Some(printed.ratio());
    tables
        .solvers
        .printed(name, &[None, Some(printed.multigrid_s), Some(printed.reduction), error, seconds, ratio]);
    Ok(())
}

/// Cells, and times of cutting and of a step, of a picture's stand-in.
fn measure_picture(picture: &Picture, model: &Model, s: f64, costs: &mut Table) -> Result<(), Trouble> {
    let cut = model.cut()?;
    let cells = cut.space.octree().cells().len() as f64;
    let mut system = System::new(cut.space.octree(), (model.held, model.pull), Problem::Step(s))?;
    let (step_s, seconds) = step_of_three(&mut system, Smoother::default(), true);
    costs.row(
        format!("{}, {}", picture.name, model.name),
        &[
            Some(model.octree.cells().len() as f64),
            None,
            Some(cells),
            Some(cut.seconds),
            Some(cut.surface_s),
            Some(seconds.levels),
            Some(step_s),
            Some(cut.seconds + step_s),
            None,
            Some(step_s / cells),
        ],
    );
    let [before, after] = picture.cells;
    let both = Some(picture.both_s);
    costs.printed(
        format!("{} of the paper", picture.name),
        &[before, None, after, None, None, None, None, both, None, None],
    );
    Ok(())
}
