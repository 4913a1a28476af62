//! Experiments on octree cells and multigrid, those of Dick, Georgii, Westermann 2011 at their sizes; on methods of
//! collision detection; on relaxation (Nienhuys 2003); on the convergence of cut meshes (Schoch et al. 2013); on ways to cut;
//! on fronts of cuts; on what enriched elements cost and how a slice falls; on masses and springs; on other simulators;
//! and on threads.
//!
//! Unlike the accuracy [cases](crate::cases) these are not scenes with changed keys, but measurements of the physics
//! itself. Every experiment has a module of its own and gives an [`ExperimentResult`]: tables, plots and pictures.
//! [`printed`] has the figures of the paper on octree cells. This file is the catalogue of the experiments.
//!
//! # Source
//! Dick, Georgii, Westermann 2011: A hexahedral multigrid approach for simulating cuts in deformable objects.
//! Jeřábková 2007: Interactive cutting of finite elements based deformable objects in virtual environments.

mod printed;

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

use scindo_study::report::result::ExperimentResult;

use crate::lab::{ExperimentBench, Trouble};

type Experiment = fn(&mut ExperimentBench<'_>) -> Result<ExperimentResult, Trouble>;

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
const PAPERS: usize = 5;
/// How many of them are about octree cells.
const CELLS: usize = 9;

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

/// The experiments that a name stands for: one, a group, or none.
pub fn named(name: &str) -> &'static [&'static str] {
    match NAMES.iter().position(|known| *known == name) {
        Some(i) => &NAMES[i..=i],
        None if name == "cells" => &NAMES[..CELLS],
        None if name == "dick" => &NAMES[..PAPERS],
        None => &[],
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
