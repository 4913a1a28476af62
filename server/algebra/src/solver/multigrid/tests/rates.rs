//! Rates of the cycle and iterations of conjugate gradients with it.

use scindo_matter::element::MaterialPoint;
use scindo_matter::octree::{BoxShape, Octree, OctreeSettings};

use super::support::{Exact, Scene, V3, blade_grid, clamped, coefficients, cube, dot, turned_blades, vector};
use crate::operator::Spring;
use crate::solver::multigrid::{CoarsestSolve, Hierarchy, MultigridSettings, Smoother};

fn scene(octree: &Octree, poisson: f64) -> Scene {
    let fixed = clamped(octree, 2);
    Scene::new(octree, coefficients(poisson, 0.0), &fixed, MultigridSettings::default())
}

fn measured(mut scene: Scene) -> (f64, u32) {
    let rate = scene.rate();
    let b = scene.gravity();
    let (iterations, _) = scene.mg_pcg(&b, 1e-6);
    (rate, iterations)
}

fn assert_cycle_is_symmetric(scene: &mut Scene) {
    let [u, w] = [1, 2].map(|seed| {
        let mut v = vector(scene.exact.mass.len(), seed);
        scene.exact.filter(&mut v);
        v
    });
    let (Vu, Vw) = (scene.cycle(&u), scene.cycle(&w));
    let (one, other) = (dot(&w, &Vu), dot(&u, &Vw));
    assert!((one - other).abs() < 1e-3 * (dot(&u, &Vu) * dot(&w, &Vw)).sqrt());
}

#[test]
fn uncut_bodies_converge_at_a_rate_that_does_not_depend_on_their_size() {
    let small = measured(scene(&cube(16, 0), 0.3));
    let large = measured(scene(&cube(32, 0), 0.3));
    let adaptive = measured(scene(&cube(32, 3), 0.3));
    assert!(small.0 <= 0.45 && large.0 <= 0.45 && adaptive.0 <= 0.50);
    assert!(small.1 <= 12 && large.1 <= 12 && large.1 <= small.1 + 2 && adaptive.1 <= 12);
}

#[test]
fn nearly_incompressible_bodies_converge_more_slowly() {
    for poisson in [0.45, 0.49] {
        let (_, iterations) = measured(scene(&cube(16, 0), poisson));
        assert!(iterations < 60, "ν = {poisson}: {iterations} iterations");
    }
}

#[test]
fn bodies_cut_by_a_grid_of_blades_converge() {
    for (cells, planes) in [(16, vec![3, 7, 11]), (32, vec![5, 11, 17, 21, 27])] {
        for (levels, limit) in [(0, 0.82), (3, 0.85)] {
            let mut octree = cube(cells, levels);
            blade_grid(&mut octree, &planes);
            let name = format!("blade grid, {cells}³, {levels} levels");
            let (rate, iterations) = measured(scene(&octree, 0.3));
            assert!(rate <= limit && iterations <= 25, "{name}: rate {rate:.3}, {iterations} iterations");
        }
    }
}

/// Rods one or two cells wide, aligned with the blocks of cells that merge or not, with coarse levels smoothed no more
/// than the finest one; and how much smoothing them more helps.
#[test]
fn thin_rods_bend_on_coarse_levels() {
    for (width, first, limit) in [(1, 1, 0.6), (2, 2, 0.55), (2, 1, 0.85)] {
        let mut octree = cube(16, 0);
        blade_grid(&mut octree, &(first..16).step_by(width).collect::<Vec<_>>());
        let even = || {
            let smoother = Smoother::Chebyshev { degree: 2, most: 2 };
            let settings = MultigridSettings { smoother, ..MultigridSettings::default() };
            Scene::new(&octree, coefficients(0.3, 0.0), &clamped(&octree, 2), settings)
        };
        let (rate, iterations) = measured(even());
        let mut locked = even();
        locked.lock();
        let trilinear = measured(locked);
        let more = measured(scene(&octree, 0.3));
        let found = format!(
            "rods of {width} from {first}: {rate:.3}, {iterations}; trilinear {trilinear:.3?}; smoothed more {more:.3?}"
        );
        assert!(more.0 <= limit && more.1 <= 18, "{found}");
        assert!(rate < trilinear.0 && 3 * iterations < 2 * trilinear.1, "{found}");
        assert!(more.0 < rate && more.1 <= iterations, "{found}");
    }
}

/// Rods, and a slender beam without mass: what bends them strains cells little, so rounding could stiffen them most.
#[test]
fn half_precision_keeps_the_rate() {
    let mut rods = cube(16, 0);
    blade_grid(&mut rods, &[2, 4, 6, 8, 10, 12, 14]);
    let shape = BoxShape { min: V3::zeros(), max: V3::new(0.078125, 0.078125, 1.0) };
    let beam = Octree::fill(&shape, OctreeSettings { cells: 64, levels: 0 }, &|_| 0).unwrap();
    for (name, octree) in [("rods", rods), ("beam", beam)] {
        let [single, half] = [false, true].map(|half_precision| {
            let settings = MultigridSettings { half_precision, ..MultigridSettings::default() };
            measured(Scene::new(&octree, coefficients(0.3, 0.0), &clamped(&octree, 2), settings))
        });
        assert!((half.0 - single.0).abs() < 0.01, "{name}: rates {:.3} and {:.3}", single.0, half.0);
        assert!(half.1 <= single.1 + 1, "{name}: {} and {} iterations", single.1, half.1);
    }
}

/// A W-cycle takes fewer turns where cuts leave the coarse levels with bad corrections, and stays symmetric.
#[test]
fn visiting_coarse_levels_twice_helps_where_much_is_cut() {
    let mut octree = cube(32, 2);
    blade_grid(&mut octree, &[5, 9, 14, 18, 23, 27]);
    let [once, twice, thrice] = [1, 2, 3].map(|visits| {
        let settings = MultigridSettings { visits, ..MultigridSettings::default() };
        let mut scene = Scene::new(&octree, coefficients(0.3, 0.0), &clamped(&octree, 2), settings);
        assert!(scene.multigrid.report().0.len() > 3);
        assert_cycle_is_symmetric(&mut scene);
        measured(scene)
    });
    let found = format!("{once:.3?} {twice:.3?} {thrice:.3?}");
    assert!(twice.0 < once.0 && twice.1 < once.1 && thrice.0 < twice.0, "{found}");
}

/// Rods of some cells across, whose coarse cells hold several of them: their bending is so soft that the second visit
/// of a level needs its residual in single precision.
#[test]
fn turned_rods_converge() {
    let octree = turned_blades(cube(32, 2), 9);
    assert!(octree.cells().len() > 20_000);
    let [once, twice] = [1, 2].map(|visits| {
        let settings = MultigridSettings { visits, ..MultigridSettings::default() };
        let (with, fixed) = (coefficients(0.3, 0.0), clamped(&octree, 2));
        measured(Scene::of(Exact::new(&octree, &with, &fixed), with, Hierarchy::new(&octree), settings))
    });
    let found = format!("{once:.3?} {twice:.3?}");
    assert!(once.0 < 0.82 && once.1 <= 25 && twice.0 < 0.6 && twice.1 < once.1, "{found}");
}

#[test]
fn without_duplicates_cuts_slow_the_cycle_down() {
    let mut octree = cube(16, 0);
    blade_grid(&mut octree, &[3, 7, 11]);
    let fixed = clamped(&octree, 2);
    let with = coefficients(0.3, 0.0);
    let [cut, blind] = [true, false].map(|duplicates| {
        let exact = Exact::new(&octree, &with, &fixed);
        let hierarchy = Hierarchy::with(&octree, 600, duplicates);
        measured(Scene::of(exact, with.clone(), hierarchy, MultigridSettings::default()))
    });
    assert!(blind.0 > cut.0 + 0.05 && f64::from(blind.1) > 1.3 * f64::from(cut.1));
}

#[test]
fn the_smoothers_of_the_paper_converge_as_printed() {
    let octree = cube(16, 0);
    let fixed = clamped(&octree, 2);
    for (omega, limit) in [(1.0, 0.5), (1.7, 0.8)] {
        let smoother = Smoother::GaussSeidel { sweeps: 1, omega };
        let settings = MultigridSettings { smoother, ..MultigridSettings::default() };
        let mut scene = Scene::new(&octree, coefficients(0.3, 0.0), &fixed, settings);
        let rate = scene.rate();
        assert!(rate <= limit, "V(1,1), ω = {omega}: rate {rate:.3}");
    }
}

/// Springs are on the finest level only; the cycle stays a symmetric preconditioner, and each spring costs a few
/// iterations.
#[test]
fn springs_cost_few_iterations() {
    let mut octree = cube(12, 2);
    blade_grid(&mut octree, &[6]);
    let mut scene = scene(&octree, 0.3);
    let free = measured(self::scene(&octree, 0.3));
    let id = octree.cells().len() - 1;
    let cell = octree.vertices()[id];
    let point = |weights: [f32; 8]| MaterialPoint::new(cell.into_iter().zip(weights));
    for stiffness in [1e3, 1e4, 1e5] {
        let springs = [
            Spring { point: point([0.0, 0.0, 0.0, 0.0, 0.5, 0.3, 0.15, 0.05]), direction: None, stiffness },
            Spring {
                point: point([0.0, 0.3, 0.0, 0.2, 0.0, 0.4, 0.0, 0.1]),
                direction: Some([0.6, 0.0, 0.8]),
                stiffness,
            },
        ];
        scene.add_springs(&springs, 4.0);
        assert_cycle_is_symmetric(&mut scene);
        let b = scene.gravity();
        let (iterations, _) = scene.mg_pcg(&b, 1e-6);
        assert!(iterations <= free.1 + 12, "springs of {stiffness:e} N/m: {iterations} iterations");
    }
}

/// Where all levels take springs, their stiffness hardly matters, and some may act on prescribed vertices.
#[test]
fn stiff_springs_on_all_levels_keep_the_rate() {
    let mut octree = cube(16, 2);
    blade_grid(&mut octree, &[8]);
    let free = measured(scene(&octree, 0.3));
    let weights = [0.3, 0.1, 0.05, 0.15, 0.1, 0.1, 0.12, 0.08_f32];
    for (stiffness, n) in [(1e6, 1), (1e7, 12), (1e9, 12), (1e9, 40)] {
        let of = |k: usize| {
            let id = (k * octree.cells().len() / n + 7 * k) % octree.cells().len();
            let carriers = octree.vertices()[id].into_iter().zip(weights);
            let direction = [None, Some([0.6, 0.0, 0.8]), Some([0.0, 1.0, 0.0])][k % 3];
            Spring { point: MaterialPoint::new(carriers), direction, stiffness }
        };
        let springs: Vec<Spring> = (0..n).map(of).collect();
        let mut scene = scene(&octree, 0.3);
        scene.add_stiff_springs(&springs);
        assert_cycle_is_symmetric(&mut scene);
        let b = scene.gravity();
        let (iterations, _) = scene.mg_pcg(&b, 1e-6);
        let found = format!("{n} springs of {stiffness:e}: {iterations} iterations, {} without", free.1);
        assert!(iterations <= 2 * free.1, "{found}");
    }
}

/// Where coarsening ends above the size for a factorisation, a polynomial of high degree takes its place.
#[test]
fn a_large_coarsest_level_is_smoothed() {
    let octree = cube(24, 0);
    let (fixed, with) = (clamped(&octree, 2), coefficients(0.3, 0.0));
    let exact = Exact::new(&octree, &with, &fixed);
    let hierarchy = Hierarchy::with(&octree, 8_000, true);
    let scene = Scene::of(exact, with, hierarchy, MultigridSettings::default());
    let (levels, coarsest) = scene.multigrid.report();
    assert!(levels.len() == 2 && 3 * levels[1].vertices > 3_000);
    assert_eq!(coarsest, CoarsestSolve::Sweeps { degree: 24 });
    let (rate, iterations) = measured(scene);
    assert!(rate < 0.9 && iterations <= 20);
}
