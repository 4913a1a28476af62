//! Experiments on octree cells and multigrid, those of Dick, Georgii, Westermann 2011 at their sizes; on methods of
//! collision detection; on relaxation (Nienhuys 2003); on the convergence of cut meshes (Schoch et al. 2013); on ways to cut;
//! on fronts of cuts; on what enriched elements cost and how a slice falls; on masses and springs; on other simulators;
//! and on threads.
//!
//! Unlike the other cases of the study these are not scenes with changed keys, but measurements of the physics
//! itself. [`shape`] and [`model`] build solids and blades, [`system`] is the linear system of a step, and [`solve`]
//! and [`refine`] run solvers on it. Every experiment has a module of its own and gives a
//! [`ExperimentResult`]: tables, plots and pictures. [`printed`] has the figures of the paper.
//!
//! # Source
//! Dick, Georgii, Westermann 2011: A hexahedral multigrid approach for simulating cuts in deformable objects.
//! Jeřábková 2007: Interactive cutting of finite elements based deformable objects in virtual environments.

pub mod printed;

pub mod result;

pub mod shape;

pub mod model;

pub mod system;

pub mod solve;

pub mod refine;

mod bench;

mod tables;

mod convergence;

mod over_stiffness;

mod solvers;

mod layer;

mod sizes;

mod cube;

mod elements;

mod levels;

mod skin;

mod collision;

mod threads;

mod nienhuys;

mod nienhuys_cut;

mod schoch;

mod slits;

mod front;

mod enriched;

mod slice;

mod springs;

mod peers;

use nalgebra::Vector3;
use scindo_physics::body::Body;
use scindo_physics::material::Law;

pub use bench::ExperimentBench;
pub use result::{Column, ExperimentResult, Picture, Plots, Row, Table, Unit};

/// Why an experiment could not be made.
pub type Trouble = Box<dyn std::error::Error + Send + Sync>;

/// An experiment.
pub type Experiment = fn(&mut ExperimentBench<'_>) -> Result<ExperimentResult, Trouble>;

/// The laws, by their names in scenes.
const LAWS: [(Law, &str); 4] = [
    (Law::Linear, "linear"),
    (Law::Corotational, "corotational"),
    (Law::StVenantKirchhoff, "stvk"),
    (Law::NeoHookean, "neo-hookean"),
];

/// Holds the nodes of a body at x = 0.
fn hold_left(body: &mut Body) -> Result<(), Trouble> {
    let at_left = (0..).zip(body.rest_positions()).filter(|(_, X)| X.x < 1e-9);
    let held: Vec<u32> = at_left.map(|(n, _)| n).collect();
    Ok(body.fix(&held, [true; 3], Vector3::zeros())?)
}

/// ‖a − b‖ / ‖b‖; infinite if they are not of the same points.
fn distance(a: &[Vector3<f64>], b: &[Vector3<f64>]) -> f64 {
    if a.len() != b.len() {
        return f64::INFINITY;
    }
    let sum = |of: &mut dyn Iterator<Item = f64>| of.sum::<f64>().sqrt();
    let apart = sum(&mut a.iter().zip(b).map(|(a, b)| (a - b).norm_squared()));
    apart / sum(&mut b.iter().map(|b| b.norm_squared()))
}

/// Names of the experiments; those of the paper first.
pub const NAMES: [&str; 20] = [
    "dick-tables",
    "dick-convergence",
    "dick-solvers",
    "dick-layer",
    "dick-sizes",
    "cells-cube",
    "cells-elements",
    "cells-levels",
    "cells-skin",
    "collision",
    "threads",
    "nienhuys",
    "nienhuys-cut",
    "schoch",
    "slits",
    "front",
    "enriched",
    "slice",
    "springs",
    "peers",
];
/// How many of them are those of the paper.
pub const PAPERS: usize = 5;
/// How many of them are about octree cells.
pub const CELLS: usize = 9;

/// The experiment `name`.
fn find(name: &str) -> Option<Experiment> {
    match name {
        "dick-tables" => Some(tables::tables),
        "dick-convergence" => Some(convergence::convergence),
        "dick-solvers" => Some(solvers::solvers),
        "dick-layer" => Some(layer::layer),
        "dick-sizes" => Some(sizes::sizes),
        "cells-cube" => Some(cube::cubes),
        "cells-elements" => Some(elements::elements),
        "cells-levels" => Some(levels::levels),
        "cells-skin" => Some(skin::skin),
        "collision" => Some(collision::collision),
        "threads" => Some(threads::threads),
        "nienhuys" => Some(nienhuys::nienhuys),
        "nienhuys-cut" => Some(nienhuys_cut::cuts),
        "schoch" => Some(schoch::schoch),
        "slits" => Some(slits::slits),
        "front" => Some(front::front),
        "enriched" => Some(enriched::enriched),
        "slice" => Some(slice::slice),
        "springs" => Some(springs::springs),
        "peers" => Some(peers::peers),
        _ => None,
    }
}

/// Makes the experiment `name`. What keeps it from being made is part of the result.
pub fn study(name: &'static str, bench: &mut ExperimentBench<'_>) -> ExperimentResult {
    let made = match find(name) {
        Some(experiment) => experiment(bench),
        None => Err("there is no such experiment".into()),
    };
    let failed = |trouble: Trouble| ExperimentResult {
        name,
        title: name.to_owned(),
        trouble: Some(trouble.to_string()),
        ..ExperimentResult::default()
    };
    made.unwrap_or_else(failed)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;
