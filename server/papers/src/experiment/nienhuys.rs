//! Chapter 3 of Nienhuys' thesis: the cantilever of table 3.1 and the relaxation of the cube of figure 3.12.
//!
//! # Source
//! Nienhuys 2003: Cutting in deformable objects, §3.3.

use std::time::Instant;

use nalgebra::{Matrix3, Vector3};
use scindo_physics::assembly::{BlockCsr, Model, Tangent, Volumetric};
use scindo_physics::material::{Law, Material, Rayleigh};
use scindo_physics::mesh::{BoxPattern, box_mesh};
use scindo_study::report::chart::{Chart, Line};
use scindo_study::report::result::{ExperimentResult, Plots, Table, Unit};
use scindo_world::inputs::Inputs;
use scindo_world::scene::Scene;
use scindo_world::simulation::Simulation;

use crate::lab::{ExperimentBench, Trouble};

type V = Vector3<f64>;

const LENGTH: f64 = 1.2;
/// Deflection of the tip [m] of a thin beam, against which the thesis measures: 4 F/(E d) (l/h)³.
const THIN: f64 = 8.64e-3;
/// The thesis stops where ‖r‖ is this part of ‖f‖: in table 3.1, and afterwards.
const TO: [f64; 2] = [1e-8, 1e-3];
/// Meshes of table 3.1, and what it prints: nodes, iterations, mean and largest error [%].
const PRINTED: [([usize; 3], [f64; 4]); 5] = [
    ([16, 4, 4], [425.0, 377.0, 29.0, 29.3]),
    ([24, 6, 6], [1225.0, 561.0, 15.1, 15.3]),
    ([32, 8, 8], [2673.0, 723.0, 8.6, 8.8]),
    ([40, 10, 10], [4961.0, 882.0, 5.2, 5.3]),
    ([48, 12, 12], [8181.0, 1044.0, 3.2, 3.3]),
];
/// More iterations than any mesh here needs.
const PATIENCE: u32 = 20_000;

/// The cube of figure 3.12, as a scene. The thesis prints neither edge, modulus, density nor force.
const CUBE: &str = r#"
schema = 1
name = "dilated cube"
[world]
gravity_m_s2 = [0, 0, 0]
step_s = 0.04
[[body]]
id = "cube"
mesh = { box = { min_m = [0, 0, 0], max_m = [0.1, 0.1, 0.1], cells = [11, 11, 11], pattern = "oct6" } }
law = "linear"
young_pa = 2e4
poisson = 0.25
density_kg_m3 = 1000
integrator = "static"
solver = { method = "relaxation", iterations = 10, fixed_iterations = true, tolerance = 1e-3 }
[[body.fix]]
where = { slab = { axis = "z", from = 0, to = 0 } }
[[body.load]]
where = { slab = { axis = "x", from = 0, to = 0 } }
force_n = [-0.5, 0, 0]
[[body.load]]
where = { slab = { axis = "x", from = 1, to = 1 } }
force_n = [0.5, 0, 0]
"#;

/// The experiment.
///
/// # Errors
/// A beam or cube whose solution does not converge, or the user ended the study.
pub(super) fn nienhuys(bench: &mut ExperimentBench<'_>) -> Result<ExperimentResult, Trouble> {
    let mut result = ExperimentResult {
        name: "nienhuys",
        title: "Relaxation: table 3.1 and figure 3.12".into(),
        about: "The beam of 1.2 × 0.2 × 0.3 m with 3 N at its tip, E = 1 MPa, ν = 0, on the meshes of the thesis, by \
            conjugate gradients in double precision from displacements 0 until ‖r‖ < 1e-8 ‖f‖; and the cube of 7,986 \
            tetrahedra with ν = ¼, pulled at two sides, along the path that a scene takes."
            .into(),
        ..ExperimentResult::default()
    };
    let quick = bench.is_quick();
    let meshes = if quick { &PRINTED[..3] } else { &PRINTED[..] };
    let mut table = Table::new(
        "Table 3.1: error of the tip, and iterations",
        "Errors in per cent of the deflection of a thin beam, 8.64 mm; a solid beam bends by 8.784 mm (Timoshenko), to \
         which finer meshes converge. The same force at every node of the tip. Preconditioned: by 3×3 diagonal blocks, \
         to the same ‖r‖. The 8,181 nodes of the last row of the thesis must be 8,281 = 49 × 13 × 13.",
        &[
            ("nodes", Unit::Count),
            ("elements", Unit::Count),
            ("iterations", Unit::Count),
            ("mean error [%]", Unit::Number),
            ("largest error [%]", Unit::Number),
            ("preconditioned: iterations", Unit::Count),
            ("solution", Unit::Seconds),
            ("preconditioned", Unit::Seconds),
        ],
    );
    let mut lines =
        ["mean error", "mean error, printed"].map(|name| Line { name: name.into(), points: Vec::new() });
    for &(cells, [nodes, iterations, mean, largest]) in meshes {
        let name = format!("{} × {} × {}", cells[0], cells[1], cells[2]);
        bench.begin(format!("beam of {name} cells"), meshes.len() + 1)?;
        let beam = beam(cells)?;
        lines[0].points.push([cells[0] as f64, beam.errors[0]]);
        lines[1].points.push([cells[0] as f64, mean]);
        // The thesis iterates without a preconditioner, so its iterations compare with those of the plain solve.
        let [plain, blocks] = beam.solves;
        table.row(
            &*name,
            &[
                beam.counts[0] as f64,
                beam.counts[1] as f64,
                f64::from(plain.0),
                beam.errors[0],
                beam.errors[1],
                f64::from(blocks.0),
                plain.1,
                blocks.1,
            ]
            .map(Some),
        );
        table.printed(
            format!("{name} of the thesis"),
            &[Some(nodes), None, Some(iterations), Some(mean), Some(largest), None, None, None],
        );
    }
    let mut chart = Chart::new("Error of the tip", "cells along the beam", "error [%]");
    chart.logarithmic = true;
    chart.lines.extend(lines);
    result.plots.push(Plots {
        caption: "Table 3.1 as a figure: the printed errors and those found here lie on each other.".into(),
        charts: vec![chart],
        ..Plots::default()
    });
    // The cube goes the way of a scene, because the figure is about the speed of a running simulation.
    bench.begin("dilated cube", meshes.len() + 1)?;
    let cube = cube()?;
    let mut relaxation = Table::new(
        "Figure 3.12: the dilated cube",
        "Iterations to 1e-3 as a scene makes them, ten per step, and how many a second; the thesis measured on a \
         Pentium III at 1 GHz.",
        &[
            ("nodes", Unit::Count),
            ("elements", Unit::Count),
            ("iterations", Unit::Count),
            ("iterations per second", Unit::Count),
            ("solution", Unit::Seconds),
        ],
    );
    relaxation.row("one thread", &cube.map(Some));
    // The thesis prints from 100 to 300 iterations at 55 a second, so both ends stand below.
    relaxation.printed(
        "thesis, fewest",
        &[Some(1728.0), Some(7986.0), Some(100.0), Some(55.0), Some(100.0 / 55.0)],
    );
    relaxation
        .printed("thesis, most", &[Some(1728.0), Some(7986.0), Some(300.0), Some(55.0), Some(300.0 / 55.0)]);
    result.tables.extend([table, relaxation]);
    Ok(result)
}

/// The beam on one mesh.
struct Beam {
    /// Nodes and elements.
    counts: [usize; 2],
    /// Mean and largest error of the nodes of the tip [%].
    errors: [f64; 2],
    /// Iterations and seconds: plain, and preconditioned by diagonal blocks.
    solves: [(u32, f64); 2],
}

fn beam(cells: [usize; 3]) -> Result<Beam, Trouble> {
    let rayleigh = Rayleigh { mass_1_s: 0.0, stiffness_s: 0.0 };
    let material = Material { young_pa: 1e6, poisson: 0.0, density_kg_m3: 1e3, law: Law::Linear, rayleigh };
    let mesh = box_mesh(V::zeros(), V::new(LENGTH, 0.2, 0.3), cells, BoxPattern::Octahedral6);
    let model = Model::tet4(&mesh, &material, Volumetric::Full)?;
    let mut K = model.pattern();
    model.tangent(model.rest(), Tangent::Exact, &mut K);
    let is_tip = |n: &usize| model.rest()[*n].x > LENGTH - 1e-9;
    let tip: Vec<usize> = (0..model.n_nodes()).filter(is_tip).collect();
    let held: Vec<bool> = model.rest().iter().map(|X| X.x < 1e-9).collect();
    let mut f = vec![V::zeros(); model.n_nodes()];
    tip.iter().for_each(|&n| f[n].y = -3.0 / tip.len() as f64);
    let solve = |preconditioned: bool| -> Result<(Vec<V>, u32, f64), Trouble> {
        let started = Instant::now();
        let start = Start { u: &vec![V::zeros(); f.len()], f: &f };
        let (u, iterations) = gradients(&K, &held, start, TO[0], preconditioned)?;
        Ok((u, iterations, started.elapsed().as_secs_f64()))
    };
    let (u, plain, plain_s) = solve(false)?;
    let (_, blocks, blocks_s) = solve(true)?;
    let error = |u_y: f64| 100.0 * (1.0 + u_y / THIN);
    let deflections = || tip.iter().map(|&n| u[n].y);
    Ok(Beam {
        counts: [model.n_nodes(), model.n_elements()],
        errors: [
            error(deflections().sum::<f64>() / tip.len() as f64),
            error(deflections().fold(f64::NEG_INFINITY, f64::max)),
        ],
        solves: [(plain, plain_s), (blocks, blocks_s)],
    })
}

/// Where conjugate gradients start.
#[derive(Clone, Copy)]
pub(super) struct Start<'a> {
    /// Displacements [m]; those of held nodes stay.
    pub u: &'a [V],
    /// Loads [N].
    pub f: &'a [V],
}

/// Conjugate gradients as in the thesis, until ‖r‖ is below the part `to` of ‖f‖ of the nodes that are not held: entries of held nodes are zeroed, and ‖r‖₂ decides. The solvers of the program
/// stop in the norm of their preconditioner instead, which would give other numbers of iterations.
pub(super) fn gradients(
    K: &BlockCsr<f64>,
    held: &[bool],
    Start { u, f }: Start<'_>,
    to: f64,
    preconditioned: bool,
) -> Result<(Vec<V>, u32), Trouble> {
    let n = f.len();
    let inverse = |i: usize| match preconditioned {
        true => K.diagonal(i).try_inverse().unwrap_or_else(Matrix3::identity),
        false => Matrix3::identity(),
    };
    let inverses: Vec<Matrix3<f64>> = (0..n).map(inverse).collect();
    let zero =
        |v: &mut [V]| v.iter_mut().zip(held).filter(|(_, held)| **held).for_each(|(v, _)| *v = V::zeros());
    let dot = |a: &[V], b: &[V]| a.iter().zip(b).map(|(a, b)| a.dot(b)).sum::<f64>();
    let precondition = |r: &[V]| -> Vec<V> { r.iter().zip(&inverses).map(|(r, M)| M * r).collect() };
    let (mut x, mut r, mut q) = (u.to_vec(), f.to_vec(), vec![V::zeros(); n]);
    zero(&mut r);
    let target = to * dot(&r, &r).sqrt();
    K.multiply(&x, &mut q);
    r.iter_mut().zip(&q).for_each(|(r, q)| *r -= q);
    zero(&mut r);
    let mut p = precondition(&r);
    let mut rz = dot(&r, &p);
    for iteration in 0..PATIENCE {
        if dot(&r, &r).sqrt() < target {
            return Ok((x, iteration));
        }
        K.multiply(&p, &mut q);
        zero(&mut q);
        let alpha = rz / dot(&p, &q);
        for ((x, r), (p, q)) in x.iter_mut().zip(&mut r).zip(p.iter().zip(&q)) {
            *x += alpha * p;
            *r -= alpha * q;
        }
        let z = precondition(&r);
        let next = dot(&r, &z);
        p.iter_mut().zip(&z).for_each(|(p, z)| *p = z + next / rz * *p);
        rz = next;
    }
    Err(format!("conjugate gradients did not converge in {PATIENCE} iterations").into())
}

/// Nodes, elements, iterations until the cube is at rest, iterations per second, and seconds.
fn cube() -> Result<[f64; 5], Trouble> {
    let scene = Scene::from_toml(CUBE)?;
    let mut best: Option<[f64; 5]> = None;
    for _ in 0..3 {
        let mut simulation = Simulation::new(&scene, std::path::Path::new("."))?;
        let (mut iterations, mut seconds) = (0, 0.0);
        loop {
            let started = Instant::now();
            let report = simulation.step(&Inputs::default());
            seconds += started.elapsed().as_secs_f64();
            let solve = &report.bodies.first().ok_or("the scene has a body")?.solve;
            iterations += solve.iterations;
            if solve.residual <= solve.tolerance {
                break;
            }
            if iterations > PATIENCE {
                return Err("the relaxation does not converge".into());
            }
        }
        let body = &simulation.bodies()[0].body;
        let iterations = f64::from(iterations);
        let run =
            [body.n_nodes() as f64, body.n_elements() as f64, iterations, iterations / seconds, seconds];
        if best.is_none_or(|best| run[4] < best[4]) {
            best = Some(run);
        }
    }
    best.ok_or_else(|| "the cube was not solved".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Errors to the printed digit, and the iterations of the thesis to a tenth.
    #[test]
    fn the_coarsest_beam_is_that_of_the_table() {
        let (cells, [nodes, iterations, mean, largest]) = PRINTED[0];
        let beam = beam(cells).unwrap();
        assert_eq!(beam.counts[0] as f64, nodes);
        assert!((beam.errors[0] - mean).abs() < 0.05, "{:?}", beam.errors);
        assert!((beam.errors[1] - largest).abs() < 0.05, "{:?}", beam.errors);
        let [plain, blocks] = beam.solves.map(|solve| f64::from(solve.0));
        assert!((plain / iterations - 1.0).abs() < 0.1, "{plain} iterations instead of {iterations}");
        assert!(blocks < plain);
    }

    #[test]
    fn the_cube_has_the_printed_size_and_settles() {
        let [nodes, elements, iterations, ..] = cube().unwrap();
        assert_eq!([nodes, elements], [1728.0, 7986.0]);
        assert!((10.0..=300.0).contains(&iterations), "{iterations} iterations");
    }
}
