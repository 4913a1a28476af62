//! Case 29, a grid of blades in octree cells with multigrid, and the patch test of hanging corners after cuts.

use std::collections::BTreeMap;

use scindo_physics::element::Points;
use scindo_physics::octree::{At, CutLink, Octree};
use scindo_physics::solver::multigrid::{Hierarchy, MultigridSettings};
use scindo_physics::space::OctreeSpace;
use scindo_physics::space::Space;
use scindo_physics::team::Team;
use scindo_study::report::chart::{Chart, Line};
use scindo_study::trial::random::Random;

use super::support::{V, plane};
use crate::lab::Trouble;
use crate::stress::case::{Case, Setting};
use crate::stress::evidence::Evidence;
use crate::system::linear::{MATERIAL, Problem, System};
use crate::system::model::{Grid, cube};
use crate::system::solve::{Solver, Until, decay, rate, run};

/// Case 29.
pub(super) const BLADES: Case = Case {
    number: Some(29),
    name: "blade-grid",
    title: "A grid of blades in octree cells, multigrid",
    set_up: "A cube of 32 finest cells across is cut to half depth by aligned and by rotated blades, and rods fan \
             out in the first step, of stiffness number E Δt²/(ρ h²) = 100. (`scindo accuracy dick-convergence` has \
             the sizes of the paper: 83,000 to 230,000 cells.)",
    rule: "Convergence factor at most 0.80, at most 25 iterations of conjugate gradients with a cycle to 1e-6 of \
           the error; worse without duplicated coarse cells: at least 1.3 times as many iterations.",
    source: "Dick 2011, Figs. 10 and 11",
    quick: true,
    run: blades,
};

/// Hanging corners.
pub(super) const PATCH: Case = Case {
    number: None,
    name: "cells-patch",
    title: "Octree cells: a linear displacement after random cuts",
    set_up: "An adaptive cube of 24 finest cells across and three levels gets twelve random cuts. Then all material \
             is displaced linearly.",
    rule: "The elastic energy is density times volume to 1e-10: hanging corners are where their edges and faces are. \
           Parts by links and by shared vertices are the same. Without cuts, no inner vertex feels a force. Cells \
           that were fine before a cut share the same vertices as cells that the cut made fine.",
    source: "Wang 2001; Dick 2011, §6.4",
    quick: true,
    run: patch,
};

/// Stiffness number of the step.
const S: f64 = 100.0;
/// Cycles between which the rate is taken.
const STABLE: [usize; 2] = [6, 16];

fn blades(setting: &Setting) -> Result<Evidence, Trouble> {
    let mut evidence = Evidence::default();
    let mut chart = Chart::new("error over cycles", "cycles", "‖e‖/‖e₀‖");
    chart.logarithmic = true;
    for grid in [Grid::Aligned, Grid::Rotated] {
        let model = cube(32, 3, grid)?;
        let cut = model.cut()?;
        let mut system = System::new(cut.space.octree(), (model.held, model.pull), Problem::Step(S))?;
        let (exact, left) = system.converged();
        evidence.at_most(format!("residual of the solution, {}", grid.name()), left, 1e-8, "");
        let whole = if setting.ablation.duplicates { Hierarchy::without_duplicates } else { Hierarchy::new };
        let mut iterations = [0.0; 2];
        for (levels, found) in [whole, Hierarchy::without_duplicates].into_iter().zip(&mut iterations) {
            let (mut multigrid, _) = system.multigrid_on(levels, MultigridSettings::default());
            let norms = decay(&mut system, &mut multigrid, &exact, STABLE[1]);
            let until = Until { iterations: 200, error: 3e-6, seconds: 0.0 };
            let course = run(&mut system, Solver::Preconditioned(&mut multigrid), &exact, until);
            *found = course.points.len() as f64;
            let which = if chart.lines.len().is_multiple_of(2) { "" } else { ", no duplicates" };
            let name = format!("{}{which}", grid.name());
            if which.is_empty() {
                evidence.at_most(format!("convergence factor, {name}"), rate(&norms, STABLE), 0.80, "");
                evidence.at_most(format!("iterations, {name}"), *found, 25.0, "");
            } else {
                evidence.tell(format!("convergence factor, {name}"), rate(&norms, STABLE), "");
                evidence.tell(format!("iterations, {name}"), *found, "");
            }
            let points = (0..).zip(norms).map(|(k, e)| [f64::from(k), e]).collect();
            chart.lines.push(Line { name, points });
        }
        let ratio = iterations[1] / iterations[0];
        evidence.at_least(
            format!("iterations without duplicates over with, {}", grid.name()),
            ratio,
            1.3,
            "",
        );
    }
    evidence.charts.push(chart);
    Ok(evidence)
}

fn patch(setting: &Setting) -> Result<Evidence, Trouble> {
    let mut evidence = Evidence::default();
    let mut octree = cube(24, 3, Grid::Uncut)?.octree;
    if setting.ablation.stale_vertices {
        octree.keep_stale_vertices();
    }
    let measured = |octree: &Octree| {
        let mut octree = octree.clone();
        if setting.ablation.hanging_weights {
            octree.forget_hanging();
        }
        octree
    };
    let uncut = measured(&octree);
    let mut forces = vec![V::zeros(); uncut.n_vertices()];
    uncut.elastic_forces(&MATERIAL, &displaced(&uncut), &mut forces);
    let inner = |X: &V| X.iter().all(|c| *c > 1e-9 && *c < 1.0 - 1e-9);
    let rest = uncut.rest_positions();
    let most = rest.iter().zip(&forces).filter(|(X, _)| inner(X));
    let most =
        most.map(|(_, f)| f.amax()).fold(0.0, f64::max) / (MATERIAL.young_pa * uncut.lattice().h.powi(2));
    evidence.at_most("largest force on an inner vertex, in E h²", most, 1e-10, "");
    let (mut team, mut space) = (Team::alone(), OctreeSpace::new(octree));
    let mut random = Random(11);
    let (mut worst, mut apart) = (0.0_f64, 0);
    let density = strained();
    for incision in 1..=12 {
        let (through, normal) = (random.vector(0.3), random.vector(1.0) + V::repeat(1e-3));
        let x = space.rest_positions();
        space.cut(&mut team, &x, &plane(V::repeat(0.5) + through, normal, 0.35), incision)?;
        let cut = measured(space.octree());
        let volume: f64 = (0..cut.cells().len()).map(|id| cut.cell_volume(id)).sum();
        let energy = cut.energy(&MATERIAL, &displaced(&cut));
        worst = worst.max((energy / (density * volume) - 1.0).abs());
        apart += space.components().len().abs_diff(super::cells::parts_by_vertices(&cut));
    }
    evidence.tell("cells", space.octree().cells().len() as f64, "");
    evidence.at_most("largest error of the energy", worst, 1e-10, "");
    evidence.exactly("difference between parts by links and by vertices", apart, 0);
    evidence.exactly("corners carried otherwise if cells were fine before a cut", order_of_work(setting)?, 0);
    Ok(evidence)
}

/// Cuts the corner off a cell beside a coarser one, once in coarse cells and once in cells that are as fine as the
/// cut needs: in the second, corners far from the cut must follow the new vertex of the coarser cell. Returns the
/// number of corners that are carried otherwise.
fn order_of_work(setting: &Setting) -> Result<usize, Trouble> {
    let mut octree = cube(24, 3, Grid::Uncut)?.octree;
    let corner: At = [11; 3];
    // A cell that does not touch the cut, and hangs on the coarser cell beside it.
    octree.refine(&[[11, 13, 13]], 0);
    let link = |axis: u8| {
        let normal = [V::ith(usize::from(axis), 1.0); 2];
        ((corner, axis), CutLink { at: [0.5; 2], normal, incision: 1 })
    };
    let cuts = [0, 1, 2].map(link);
    let (mut at_once, mut later) = (octree.clone(), octree);
    at_once.cut(&cuts);
    let ends: Vec<At> = (0..3).map(|axis| Octree::across(corner, 2 * axis + 1)).chain([corner]).collect();
    later.refine(&ends, 0);
    if setting.ablation.stale_vertices {
        later.keep_stale_vertices();
    }
    later.cut(&cuts);
    let [one, other] = [&at_once, &later].map(shared_corners);
    Ok(one.len().abs_diff(other.len()) + one.iter().zip(&other).filter(|(a, b)| a != b).count())
}

/// Which corners of cells share a vertex, whatever its number: every corner has the number of the first one.
fn shared_corners(octree: &Octree) -> Vec<(At, usize)> {
    let mut cells: Vec<(At, [u32; 8])> =
        octree.cells().iter().zip(octree.vertices()).map(|(cell, v)| (cell.at, *v)).collect();
    cells.sort_unstable();
    let mut first = BTreeMap::new();
    let corners = cells.iter().flat_map(|(at, vertices)| vertices.map(|v| (*at, v)));
    corners.enumerate().map(|(i, (at, vertex))| (at, *first.entry(vertex).or_insert(i))).collect()
}

/// The displacement gradient.
fn gradient() -> nalgebra::Matrix3<f64> {
    nalgebra::Matrix3::new(0.02, 0.01, -0.03, 0.04, -0.01, 0.02, 0.0, 0.03, 0.05)
}

fn displaced(octree: &Octree) -> Vec<V> {
    octree.rest_positions().iter().map(|X| X + gradient() * X).collect()
}

/// Elastic energy density [J/m³].
fn strained() -> f64 {
    MATERIAL.law.energy(&(nalgebra::Matrix3::identity() + gradient()), MATERIAL.lame())
}
