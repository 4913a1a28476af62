//! Figure 14: a stiff cube with a soft layer at half height, whose rods buckle at the layer once they are cut.

use nalgebra::Vector3;
use scindo_physics::body::{Body, BodySettings, PcgSettings};
use scindo_physics::material::{Law, Material, Region};
use scindo_physics::octree::Octree;
use scindo_physics::solver::Method;
use scindo_physics::solver::multigrid::Smoother;
use scindo_study::report::result::{ExperimentResult, Table, Unit};
use scindo_study::report::view;

use super::printed::{LAYERED, LAYERED_S};
use crate::lab::{ExperimentBench, Trouble};
use crate::system::linear::{MATERIAL, Problem, System};
use crate::system::model::{self, CUBE, Grid, Model, layered_cube};
use crate::system::solve::step_of_three;

/// Lowest and highest point of the soft layer [m], of a cube of 1 m.
const LAYER: [f64; 2] = [0.475, 0.525];
/// Height to which the blades reach [m]. The cube without the layer then has 321,698 leaves, the 321 K of the paper,
/// where the depth is not printed.
pub(super) const TIP: f64 = 0.2;
/// Young's moduli of the cube and of the layer [Pa]. A rod of 8 cm on the layer falls over under its own weight below
/// some 1e5 Pa.
const YOUNG_PA: [f64; 2] = [5e7, 5e4];
/// Gravity leans by three degrees, so that rods know where to fall [m/s²].
const GRAVITY: Vector3<f64> = Vector3::new(0.45, 0.25, -9.81);
/// Step [s] and number of steps.
const STEP_S: f64 = 0.04;
const STEPS: u32 = 10;
/// Cells across the cube of the picture.
const SMALL: u32 = 32;

/// The experiment.
///
/// # Errors
/// A cut that is refused, or the user ended the study.
pub(super) fn layer(bench: &mut ExperimentBench<'_>) -> Result<ExperimentResult, Trouble> {
    let mut result = ExperimentResult {
        name: "dick-layer",
        title: "A soft layer under stiff rods: figure 14".into(),
        about: format!(
            "A cube of {:.0e} Pa with a horizontal layer of {:.0e} Pa, a twentieth of its height, is cut by rotated \
             blades down through the layer and stands in gravity that leans by three degrees. Steps of 40 ms by \
             conjugate gradients with multigrid to 1e-3, on one thread; the step of the paper ends after three cycles, \
             however large its error. The same without the layer, and without cuts, is shown beside it.",
            YOUNG_PA[0], YOUNG_PA[1]
        ),
        ..ExperimentResult::default()
    };
    let mut table = Table::new(
        "Rods on a soft layer",
        "Sideways: mean horizontal motion of the top after 0.4 s, in edges of the cube. Here the octree is finest at \
         both faces of the layer; the counts of the paper are those without a layer.",
        &[
            ("cells", Unit::Count),
            ("after the cut", Unit::Count),
            ("cutting", Unit::Seconds),
            ("step of three cycles", Unit::Seconds),
            ("cutting and step", Unit::Seconds),
            ("step to 1e-3", Unit::Seconds),
            ("iterations", Unit::Number),
            ("sideways", Unit::Number),
        ],
    );
    let (across, levels) = if bench.is_quick() { (SMALL, 3) } else { (CUBE, 4) };
    // One run without the layer and one without the cut tell what each contributes.
    for (name, cut, soft) in
        [("layer, cut", true, true), ("no layer, cut", true, false), ("layer, uncut", false, true)]
    {
        bench.begin(name, 4)?;
        let run = run(across, levels, cut, soft)?;
        table.row(
            name,
            &[
                Some(run.cells[0]),
                Some(run.cells[1]),
                Some(run.cutting_s).filter(|_| cut),
                Some(run.cycles_s),
                Some(run.cutting_s + run.cycles_s),
                Some(run.step_s),
                Some(run.iterations),
                Some(run.sideways),
            ],
        );
    }
    // The paper prints the sum of cutting and step only.
    let [before, after] = LAYERED.map(Some);
    table.printed("figure 14", &[before, after, None, None, Some(LAYERED_S), None, None, None]);
    bench.begin("picture", 4)?;
    // The picture is of a cube with few cells, whose surface a page can carry.
    let small = run(SMALL, 3, true, true)?;
    result.pictures.push(view::surface(
        small.body.surface(),
        small.body.positions(),
        Vector3::z(),
        format!("The rods after 0.4 s, {SMALL} cells across"),
    ));
    result.tables.push(table);
    Ok(result)
}

/// A body after its steps.
pub(super) struct Rods {
    pub body: Body,
    /// Leaves before and after the cut.
    pub cells: [f64; 2],
    /// As the paper counts it; see [`model::Cut`].
    cutting_s: f64,
    /// Rotations, operators of all levels and three cycles [s].
    cycles_s: f64,
    /// Median of the steps [s].
    step_s: f64,
    /// Mean number of iterations per step.
    pub iterations: f64,
    /// Mean horizontal motion of the top [m].
    pub sideways: f64,
}

/// Cuts the cube and makes its steps; the layer is `soft` or not there.
///
/// # Errors
/// A cut that is refused.
pub(super) fn run(across: u32, levels: u8, cut: bool, soft: bool) -> Result<Rods, Trouble> {
    let region =
        Region { young_pa: YOUNG_PA[1], poisson: MATERIAL.poisson, density_kg_m3: MATERIAL.density_kg_m3 };
    let grid = if cut { Grid::Rotated } else { Grid::Uncut };
    let layer = soft.then_some((LAYER, region));
    let model = layered_cube(across, levels, (grid, TIP), layer)?;
    let before = model.octree.cells().len() as f64;
    let model::Cut { space, seconds: cutting_s, .. } = model.cut()?;
    let material = Material { young_pa: YOUNG_PA[0], law: Law::Corotational, ..MATERIAL };
    let cycles_s = three_cycles(&model, space.octree(), material)?;
    let settings = BodySettings {
        solver: PcgSettings { iterations: 200, tolerance: 1e-3 },
        method: Method::MgPcg,
        ..BodySettings::default()
    };
    let mut body = Body::of_space(Box::new(space), material, settings)?;
    let ground: Vec<u32> =
        (0..).zip(body.rest_positions()).filter(|(_, X)| (model.held)(X)).map(|(node, _)| node).collect();
    body.fix(&ground, [true; 3], Vector3::zeros())?;
    let (mut seconds, mut iterations) = (Vec::new(), 0);
    for _ in 0..STEPS {
        let started = std::time::Instant::now();
        iterations += body.step(STEP_S, GRAVITY, &[]).iterations;
        seconds.push(started.elapsed().as_secs_f64());
    }
    seconds.sort_by(f64::total_cmp);
    let moved = body.rest_positions().iter().zip(body.positions()).filter(|(X, _)| X.z > 1.0 - 1e-9);
    let (sum, n) = moved.fold((0.0, 0.0), |(sum, n), (X, x)| (sum + (x - X).xy().norm(), n + 1.0));
    Ok(Rods {
        cells: [before, body.n_elements() as f64],
        cutting_s,
        cycles_s,
        step_s: seconds[seconds.len() / 2],
        iterations: f64::from(iterations) / f64::from(STEPS),
        sideways: sum / n,
        body,
    })
}

/// Seconds of a step as in the paper: rotations, operators of all levels, and three cycles.
fn three_cycles(model: &Model, octree: &Octree, material: Material) -> Result<f64, Trouble> {
    let h = octree.lattice().h;
    let s = material.young_pa * STEP_S * STEP_S / (material.density_kg_m3 * h * h);
    let mut system = System::of_material(octree, (model.held, |_| GRAVITY), Problem::Step(s), material)?;
    Ok(step_of_three(&mut system, Smoother::default(), true).0)
}
