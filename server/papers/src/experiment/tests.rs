//! Counts, rates and iterations on small bodies. Times are never tested.

use scindo_collision::Method;
use scindo_physics::material::Material;
use scindo_physics::octree::Shape;
use scindo_physics::space::Space;

use super::collision;
use super::printed::{BUNNY_2, BUNNY_3, CUBE as PRINTED, LAYERED};
use super::tables::{S_BUNNY_3, S_CUBE};
use super::{NAMES, cube as stored, find, layer, levels};
use crate::system::linear::{MATERIAL, PAPERS, Problem, System, norm};
use crate::system::model::{CUBE, Cuts, Grid, animal, cube, layered_cube};
use crate::system::refine::refine;
use crate::system::shape::Placed;
use crate::system::solve::{Solver, Until, cholesky, decay, iterations, rate, run};

/// The cubes of the paper have its numbers of leaves.
#[test]
fn cubes_have_the_printed_counts() {
    let uncut = cube(CUBE, 4, Grid::Uncut).unwrap();
    assert_eq!(uncut.octree.cells().len(), 83_299);
    let aligned = cube(CUBE, 4, Grid::Aligned).unwrap().cut().unwrap();
    assert_eq!(aligned.space.octree().cells().len(), 203_503);
    for (tip, printed) in [(0.5, PRINTED.cells[2]), (layer::TIP, LAYERED[1])] {
        let cut = layered_cube(CUBE, 4, (Grid::Rotated, tip), None).unwrap().cut().unwrap();
        let count = cut.space.octree().cells().len() as f64;
        assert!((count / printed - 1.0).abs() < 0.02, "{count} instead of {printed}");
    }
}

/// The animal has about as many leaves as the bunny, and its cuts leave it in one part.
#[test]
fn the_animal_resembles_the_bunny() {
    for (across, levels, printed) in [(77, 3, BUNNY_2), (39, 2, BUNNY_3)] {
        let model = animal(None, across, levels, Cuts::Curved).unwrap();
        let uniform = animal(None, across, 0, Cuts::Uncut).unwrap().octree.cells().len();
        let cut = model.cut().unwrap();
        let counts = [model.octree.cells().len(), uniform, cut.space.octree().cells().len()];
        for (count, printed) in counts.into_iter().zip(printed.cells) {
            assert!((count as f64 / printed - 1.0).abs() < 0.1, "{counts:?}");
        }
        assert_eq!(cut.space.components().len(), 1);
        assert_eq!(cut.space.flaws().surface, 0);
    }
}

/// Three cycles with the paper's smoother reduce the error as printed, and the converged solution is that of a
/// factorisation.
#[test]
fn small_systems_are_solved_as_printed() {
    let model = animal(None, 39, 2, Cuts::Curved).unwrap();
    let cut = model.cut().unwrap();
    let mut system =
        System::new(cut.space.octree(), (model.held, model.pull), Problem::Step(S_BUNNY_3)).unwrap();
    let (exact, left) = system.converged();
    assert!(left < 1e-8);
    assert!(norm(&system.residual(&exact)) < 1e-8 * norm(system.load()));
    let (direct, _) = cholesky(&system).unwrap();
    let off: f64 = direct.iter().zip(&exact).map(|(u, e)| (u - e).norm_squared()).sum();
    assert!(off.sqrt() < 1e-6 * norm(&exact));
    let (mut multigrid, _) = system.multigrid(PAPERS);
    let three = Until { iterations: 3, error: 0.0, seconds: 0.0 };
    let reduction = run(&mut system, Solver::Cycles(&mut multigrid), &exact, three).error(3);
    assert!((reduction / BUNNY_3.reduction - 1.0).abs() < 0.05, "{reduction}");
    let (mut multigrid, _) = system.multigrid(scindo_physics::solver::multigrid::Smoother::default());
    let found = iterations(&mut system, &mut multigrid, 1e-6).unwrap();
    assert!(found <= 25, "{found} iterations");
    let until = Until { iterations: 600, error: 1e-4, seconds: 0.0 };
    let gradients = run(&mut system, Solver::Jacobi, &exact, until);
    assert!(gradients.points.len() > 15 * found as usize);
}

/// Cycles converge on the uncut cube as printed, and more slowly on the cut ones.
#[test]
fn rates_are_those_of_the_paper_where_nothing_is_cut() {
    let of = |grid| {
        let model = cube(32, 3, grid).unwrap();
        let cut = model.cut().unwrap();
        let mut system =
            System::new(cut.space.octree(), (model.held, model.pull), Problem::Step(S_CUBE)).unwrap();
        let (exact, _) = system.converged();
        let (mut multigrid, _) = system.multigrid(PAPERS);
        rate(&decay(&mut system, &mut multigrid, &exact, 16), [6, 16])
    };
    let [uncut, rotated] = [Grid::Uncut, Grid::Rotated].map(of);
    assert!((uncut - 0.66).abs() < 0.1 && rotated > uncut && rotated < 0.85, "rates {uncut:.3} {rotated:.3}");
}

/// Refinement reaches the stored solution of 40³ cells at all of its points.
#[test]
fn the_stored_cube_is_reached() {
    let model = stored::clamped(40).unwrap();
    let material = Material { young_pa: 1e6, ..MATERIAL };
    let loads = (model.held, model.pull);
    let mut system = System::of_material(&model.octree, loads, Problem::Equilibrium, material).unwrap();
    let (mut multigrid, _) = system.multigrid(scindo_physics::solver::multigrid::Smoother::default());
    let rough = refine(&mut system, Some(&mut multigrid), 1e-6, [1e-4, 60.0]);
    assert!(
        rough.left <= 1e-6 && rough.iterations <= 12,
        "{} iterations, {:e}",
        rough.iterations,
        rough.left
    );
    let fine = refine(&mut system, Some(&mut multigrid), 1e-9, [1e-4, 60.0]);
    let off = stored::off(&system, 40, &fine.u).unwrap();
    assert!(fine.left <= 1e-9 && off < 1e-8, "off by {off:e}, residual {:e}", fine.left);
}

#[test]
fn rods_buckle_at_the_soft_layer() {
    let run = |cut, soft| layer::run(24, 3, cut, soft).unwrap().sideways;
    let (rods, stiff, uncut) = (run(true, true), run(true, false), run(false, true));
    assert!(rods > 10.0 * stiff && rods > 10.0 * uncut, "sideways {rods:.4} {stiff:.4} {uncut:.4}");
}

/// Coarser levels have fewer unknowns and larger errors, cut or not.
#[test]
fn coarse_levels_trade_accuracy_for_unknowns() {
    for grid in [Grid::Uncut, Grid::Rotated] {
        let [finest, one, two] = [0, 1, 2].map(|level| levels::run(24, 2, grid, level).unwrap());
        let (a, b) = (one.errors(&finest)[1], two.errors(&finest)[1]);
        assert_eq!(finest.errors(&finest), [0.0; 2]);
        assert!(2.0 * one.unknowns < finest.unknowns && two.unknowns < one.unknowns, "{}", grid.name());
        assert!(a > 0.0 && a < b && b < 0.6, "{}: errors {a:.3} {b:.3}", grid.name());
        assert!(one.iterations > 0.0 && two.iterations > 0.0);
    }
}

#[test]
fn solids_are_placed_at_the_origin() {
    let shape = scindo_physics::octree::BoxShape { min: [1.0, 2.0, 3.0].into(), max: [3.0, 3.0, 3.5].into() };
    let placed = Placed::new(&shape);
    let bounds = placed.bounds().map(<[f64; 3]>::from);
    assert_eq!(bounds, [[0.0; 3], [1.0, 0.5, 0.25]]);
    assert!(placed.contains(&[0.5, 0.4, 0.2].into()) && !placed.contains(&[0.5, 0.6, 0.2].into()));
}

/// Every method does all work of the experiment, and a cut in the surface leaves no method behind.
#[test]
fn collision_is_measured_with_every_method() {
    let surface = collision::dented(12);
    assert_eq!(surface.1.len(), 12 * 12 * 12);
    let mut edges = std::collections::BTreeMap::new();
    for [a, b, c] in &surface.1 {
        for (a, b) in [(a, b), (b, c), (c, a)] {
            *edges.entry((a.min(b), a.max(b))).or_insert(0) += if a < b { 1 } else { -1 };
        }
    }
    assert!(edges.values().all(|sum| *sum == 0), "closed and turned one way");
    for method in Method::ALL {
        let times = collision::measure(method, &surface).unwrap();
        assert!(times.iter().all(|s| s.is_finite() && *s >= 0.0) && times[0] > 0.0, "{method:?}: {times:?}");
    }
}

#[test]
fn every_name_is_an_experiment() {
    assert!(NAMES.iter().all(|name| find(name).is_some()) && find("dick").is_none());
}
