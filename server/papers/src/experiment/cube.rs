//! The stored cube of 40³ cells by three solvers, and iterations over sizes, cuts and Poisson's ratios.

use nalgebra::Vector3;
use scindo_physics::material::Material;
use scindo_physics::solver::multigrid::Smoother;
use scindo_study::report::result::{ExperimentResult, Table, Unit};
use serde_json::Value;

use crate::lab::{ExperimentBench, Trouble};
use crate::system::linear::{MATERIAL, Problem, System, norm};
use crate::system::model::{self, Grid, Model, ROTATION_DEG, grid_of_blades};
use crate::system::refine::{refine, refine_fastest};
use crate::system::solve::cholesky;

type V = Vector3<f64>;

/// The stored solution.
const STORED: &str = include_str!("../../cases/r7-cube40.json");
/// Cells across the cube of the stored solution.
const STORED_ACROSS: u32 = 40;
/// True residual at which solvers stop, relative to the loads.
const TO: f64 = 1e-6;
/// Tolerance and iterations of a round in single precision: of multigrid, and of block-Jacobi.
const ROUNDS: [[f64; 2]; 2] = [[1e-4, 60.0], [1e-4, 4_000.0]];
/// Cells across in the table of iterations, and the faces of cells at which blades stand.
const ACROSS: [(u32, &[u32]); 3] =
    [(16, &[3, 7, 11]), (32, &[5, 11, 17, 21, 27]), (64, &[11, 21, 33, 43, 53])];
/// Step of the runs with mass [s].
const STEP_S: f64 = 0.02;
/// Height to which the blades reach [m].
const TIP: f64 = 0.5;
/// Poisson's ratios, and cells across the cube that has them.
const POISSON: ([f64; 3], u32) = ([0.3, 0.45, 0.49], 32);

/// The experiment.
///
/// # Errors
/// The user ended the study.
pub(super) fn cubes(bench: &mut ExperimentBench<'_>) -> Result<ExperimentResult, Trouble> {
    let mut result = ExperimentResult {
        name: "cells-cube",
        title: "A cube of cells to a millionth".into(),
        about: "Linear equilibria on one thread until the residual in double precision is a millionth of the \
            loads. The first cube is clamped at x = 0 and bends under its weight; its solution at 40³ cells is \
            stored. The other cubes stand on the ground, and a radial force fans them out."
            .into(),
        notes: vec![
            "on this kind of machine SOFA needs 17.9 s for one step of 64,000 hexahedra to 1e-3".into(),
        ],
        ..ExperimentResult::default()
    };
    result.tables.push(of_stored(bench)?);
    result.tables.push(iterations(bench)?);
    Ok(result)
}

/// The clamped cube by all solvers.
fn of_stored(bench: &mut ExperimentBench<'_>) -> Result<Table, Trouble> {
    let across = if bench.is_quick() { STORED_ACROSS / 2 } else { STORED_ACROSS };
    let mut table = Table::new(
        &format!("{across}³ cells under their weight"),
        "Before: levels and their operators. Checks: residuals in double precision. Where a solution takes less than a few \
         seconds, it is the fastest of several. Off: largest difference from the \
         stored displacements of twelve points at 40³ cells, over the largest displacement; other sizes differ by \
         their discretisation.",
        &[
            ("unknowns", Unit::Count),
            ("iterations", Unit::Count),
            ("before", Unit::Seconds),
            ("solution", Unit::Seconds),
            ("checks", Unit::Seconds),
            ("residual", Unit::Number),
            ("off", Unit::Number),
        ],
    );
    let model = clamped(across)?;
    let material = Material { young_pa: 1e6, ..MATERIAL };
    let mut system =
        System::of_material(&model.octree, (model.held, model.pull), Problem::Equilibrium, material)?;
    let unknowns = Some(system.unknowns() as f64);
    for (name, multigrid) in [("CG with multigrid", true), ("CG with block-Jacobi", false)] {
        bench.begin(name, 3 + 3 * ACROSS.len() + POISSON.0.len())?;
        let (mut cycles, seconds) = system.multigrid(Smoother::default());
        let cycles = multigrid.then_some(&mut cycles);
        let refined = refine_fastest(&mut system, cycles, TO, ROUNDS[usize::from(!multigrid)]);
        table.row(
            name,
            &[
                unknowns,
                Some(refined.iterations.into()),
                multigrid.then_some(seconds.levels + seconds.coarse),
                Some(refined.solve_s),
                Some(refined.residual_s),
                Some(refined.left),
                Some(off(&system, across, &refined.u)?),
            ],
        );
    }
    bench.begin("sparse Cholesky", 3 + 3 * ACROSS.len() + POISSON.0.len())?;
    let (u, seconds) = cholesky(&system)?;
    let left = norm(&system.residual(&u)) / norm(system.load());
    let off = off(&system, across, &u)?;
    table.row("sparse Cholesky", &[unknowns, None, None, Some(seconds), None, Some(left), Some(off)]);
    Ok(table)
}

/// The cube of the stored solution, with other numbers of cells.
///
/// # Errors
/// More cells than a lattice may have.
pub(super) fn clamped(across: u32) -> Result<Model, Trouble> {
    let model = model::cube(across, 0, Grid::Uncut)?;
    Ok(Model { held: |X| X.x == 0.0, pull: |_| V::new(0.0, 0.0, -9.81), ..model })
}

/// The largest difference from the stored displacements over the largest of these.
///
/// # Errors
/// The stored solution cannot be read.
pub(super) fn off(system: &System, across: u32, u: &[V]) -> Result<f64, Trouble> {
    let stored: Value = serde_json::from_str(STORED)?;
    let probes = stored["probes"].as_object().ok_or("no probes in the stored solution")?;
    let largest = stored["max_abs_u"].as_f64().ok_or("no `max_abs_u` in the stored solution")?;
    let mut most = 0.0_f64;
    for (name, probe) in probes {
        let three = |key: &str| -> Option<V> {
            let values = probe[key].as_array()?;
            Some(V::new(values.first()?.as_f64()?, values.get(1)?.as_f64()?, values.get(2)?.as_f64()?))
        };
        let (at, expected) =
            three("ijk").zip(three("u")).ok_or_else(|| format!("no point in probe {name}"))?;
        let at = at * f64::from(across) / f64::from(STORED_ACROSS);
        // Points that are no vertices of a coarser cube have nothing to be compared with.
        let is_here = |p: &[i32; 3]| (0..3).all(|k| f64::from(p[k]) == at[k]);
        if let Some(v) = system.octree().points().iter().position(is_here) {
            most = most.max((u[v] / system.scale() - expected).amax() / largest);
        }
    }
    Ok(most)
}

/// Iterations of conjugate gradients with multigrid.
fn iterations(bench: &mut ExperimentBench<'_>) -> Result<Table, Trouble> {
    let mut table = Table::new(
        "Iterations of conjugate gradients with multigrid",
        "From 16³ to 64³ cells, uncut and cut to half depth by a grid of blades along faces of cells and turned; and \
         with other Poisson's ratios. Equilibria, and the first step of 20 ms. Blades turned by 37° leave rods of \
         few cells with stairs along their sides.",
        &[
            ("cells", Unit::Count),
            ("unknowns", Unit::Count),
            ("iterations", Unit::Count),
            ("solution", Unit::Seconds),
            ("residual", Unit::Number),
            ("with mass: iterations", Unit::Count),
            ("solution", Unit::Seconds),
            ("residual", Unit::Number),
        ],
    );
    let most = if bench.is_quick() { 32 } else { 64 };
    for (across, faces) in ACROSS.into_iter().filter(|&(n, _)| n <= most) {
        let places: Vec<f64> = faces.iter().map(|&face| f64::from(face) / f64::from(across)).collect();
        for grid in [Grid::Uncut, Grid::Aligned, Grid::Rotated] {
            let name = format!("{across}³, {}", grid.name());
            bench.begin(name.clone(), 3 + 3 * ACROSS.len() + POISSON.0.len())?;
            let blades = match grid {
                Grid::Uncut => Vec::new(),
                Grid::Aligned => grid_of_blades(&places, 0.0, TIP),
                Grid::Rotated => grid_of_blades(&places, ROTATION_DEG, TIP),
            };
            let model = Model { blades, ..model::cube(across, 0, Grid::Uncut)? };
            row(&mut table, &model, (name, MATERIAL))?;
        }
    }
    for poisson in POISSON.0 {
        let name = format!("{}³, uncut, ν = {poisson}", POISSON.1);
        bench.begin(name.clone(), 3 + 3 * ACROSS.len() + POISSON.0.len())?;
        row(&mut table, &model::cube(POISSON.1, 0, Grid::Uncut)?, (name, Material { poisson, ..MATERIAL }))?;
    }
    Ok(table)
}

fn row(table: &mut Table, model: &Model, (name, material): (String, Material)) -> Result<(), Trouble> {
    let cut = model.cut()?;
    let octree = cut.space.octree();
    let h = octree.lattice().h;
    let stiffness = material.young_pa * STEP_S * STEP_S / (material.density_kg_m3 * h * h);
    let mut values = vec![Some(octree.cells().len() as f64)];
    for problem in [Problem::Equilibrium, Problem::Step(stiffness)] {
        let mut system = System::of_material(octree, (model.held, model.pull), problem, material)?;
        let (mut multigrid, _) = system.multigrid(Smoother::default());
        let refined = refine(&mut system, Some(&mut multigrid), TO, ROUNDS[0]);
        if values.len() == 1 {
            values.push(Some(system.unknowns() as f64));
        }
        values.extend([f64::from(refined.iterations), refined.solve_s, refined.left].map(Some));
    }
    table.row(name, &values);
    Ok(())
}
