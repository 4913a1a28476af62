//! Operators of the levels against Pᵀ A P in double precision.

use crate::solver::multigrid::kernel::LevelKernel;
use nalgebra::{Matrix3, Rotation3};
use scindo_matter::element::FixedCopy;
use scindo_matter::element::Simd;
use scindo_matter::octree::Octree;
use scindo_matter::team::Team;

use super::levels::random_cuts;
use super::support::{Exact, V3, blade_grid, clamped, coefficients, cube, dot, vector};
use crate::operator::{Inverse3, padded};
use crate::solver::multigrid::galerkin::Galerkin;
use crate::solver::multigrid::level::Level;
use crate::solver::multigrid::matrices::CellMatrix;
use crate::solver::multigrid::{CellMaterial, Coefficients, Hierarchy};

/// Calls `visit` with the fine and coarse vertices and the blocks of P between levels `s` and `s` + 1.
fn for_rows(
    hierarchy: &Hierarchy,
    galerkin: &Galerkin,
    s: usize,
    mut visit: impl FnMut(usize, usize, Matrix3<f64>),
) {
    let (step, coarse) = (&hierarchy.steps[s], &hierarchy.levels[s + 1]);
    for v in 0..step.transfer.n_rows() {
        for (c, w) in step.transfer.row(v) {
            visit(v, c as usize, Matrix3::from_diagonal_element(f64::from(w)));
        }
        if !hierarchy.levels[s].has_slots() {
            continue;
        }
        let (child, _) = hierarchy.levels[s].slots_of(v).next().unwrap();
        galerkin.levels[s + 1].for_inner_row((coarse, step), (v as u32, child), |c, D| {
            visit(v, c as usize, D.map(f64::from));
        });
    }
}

/// Largest relative difference of A^ℓ x and Pᵀ … A … P x over all levels.
fn error(hierarchy: &Hierarchy, galerkin: &Galerkin, exact: &Exact) -> f64 {
    let mut team = Team::new(1).unwrap();
    let mut worst = 0.0_f64;
    for l in 0..hierarchy.n_levels() {
        let level = &hierarchy.levels[l];
        let x = vector(level.n_vertices, l);
        let mut fine = x.clone();
        for s in (0..l).rev() {
            let mut finer = vec![V3::zeros(); hierarchy.levels[s].n_vertices];
            for_rows(hierarchy, galerkin, s, |v, c, w| finer[v] += w * fine[c]);
            fine = finer;
        }
        let mut y = exact.apply(&fine);
        for s in 0..l {
            let mut coarse = vec![V3::zeros(); hierarchy.levels[s + 1].n_vertices];
            for_rows(hierarchy, galerkin, s, |v, c, w| coarse[c] += w.transpose() * y[v]);
            y = coarse;
        }
        let x32: Vec<_> = x.iter().map(padded).collect();
        let mut y32 = vec![[0.0; 4]; x.len()];
        let mut products = vec![[[0.0; 4]; 8]; level.cells.len()];
        if l > 0 {
            galerkin.operator(level, l).apply(&mut team, &x32, &mut y32, &mut products);
            // The kernels do the same.
            let mut kernel = LevelKernel::new(Simd::detect(), false);
            kernel.follow(&mut team, level, (galerkin, l, true));
            let mut by_kernel = vec![[0.0; 4]; x.len()];
            kernel.apply(&mut team, &galerkin.levels[l].mass, &x32, &mut by_kernel);
            for y32 in [&y32, &by_kernel] {
                let wide = |a: &[f32; 4]| V3::new(a[0].into(), a[1].into(), a[2].into());
                let difference: Vec<V3> = y32.iter().zip(&y).map(|(a, b)| wide(a) - b).collect();
                worst = worst.max((dot(&difference, &difference) / dot(&y, &y)).sqrt());
            }
            worst = worst.max(diagonals(&mut team, &mut kernel, galerkin, (level, l)));
        }
    }
    worst
}

/// A hundredth of the largest entry of M⁻¹ M − I, for the diagonal blocks M of single cells and their inverses by the
/// kernel.
fn diagonals(
    team: &mut Team,
    kernel: &mut LevelKernel,
    galerkin: &Galerkin,
    (level, l): (&Level, usize),
) -> f64 {
    let operator = galerkin.operator(level, l);
    let mut found = vec![Inverse3::default(); level.n_vertices];
    kernel.invert_diagonal(team, &galerkin.levels[l].mass, &mut found);
    let mut worst = 0.0_f64;
    for (v, found) in found.iter().enumerate() {
        let block = operator.diagonal(v);
        let held = [0, 4, 6].map(|at| block[at] == 0.0);
        for (k, x) in [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]].iter().enumerate() {
            // M⁻¹ M e = e, and 0 in directions that are held.
            let Mx = [[0, 1, 2], [1, 4, 5], [2, 5, 6]].map(|row| row.map(|at| block[at]));
            let [a, b, c] = Mx.map(|row| row[0] * x[0] + row[1] * x[1] + row[2] * x[2]);
            let y = found.times(&[a, b, c, 0.0]);
            for i in 0..3 {
                let expected = if i == k && !held[i] { 1.0 } else { 0.0 };
                if !held[k] {
                    worst = worst.max(0.01 * f64::from((y[i] - expected).abs()));
                }
            }
        }
    }
    worst
}

fn check(octree: &Octree, with: &Coefficients, fixed: &[FixedCopy], turn: impl Fn(V3) -> V3) -> f64 {
    let mut team = Team::new(1).unwrap();
    let mut hierarchy = Hierarchy::with(octree, 60, true);
    // Thin cells on the finest level are found by its slots.
    hierarchy.list_finest_slots();
    assert!(hierarchy.n_levels() > 2);
    let mut exact = Exact::new(octree, with, fixed);
    exact.turn(turn);
    let mut galerkin = Galerkin::new(&hierarchy);
    // Other constants before: of what is in use already, nothing that they changed stays.
    let stiff = Coefficients { scale: 3.0 * with.scale, ..with.clone() };
    let heavy = Coefficients { mass_factor: 2.0 + with.mass_factor, ..with.clone() };
    for with in [&heavy, &stiff, with] {
        galerkin.update(&mut team, &hierarchy, (with, fixed), &|id| exact.rotation(id), 0.0);
    }
    error(&hierarchy, &galerkin, &exact)
}

#[test]
fn operators_are_galerkin_products() {
    let with = coefficients(0.3, 0.0);
    let heavy = coefficients(0.45, 2e4);
    let none = |_: V3| V3::zeros();
    let wild = |p: V3| 3.0 * V3::new((7.0 * p.y).sin(), (5.0 * p.z).cos(), p.x);
    let mut grid = cube(16, 2);
    blade_grid(&mut grid, &[3, 8, 13]);
    let bodies =
        [cube(8, 0), cube(16, 2), cube(16, 3), grid, random_cuts(8, 0, 0.3, 1), random_cuts(16, 2, 0.003, 2)];
    for (b, octree) in bodies.iter().enumerate() {
        let clamp = clamped(octree, 0);
        // Some prescribed in single directions, inside the body, too.
        let partly: Vec<FixedCopy> = (0..octree.n_vertices() as u32)
            .step_by(7)
            .map(|copy| FixedCopy {
                copy,
                held: [copy % 2 == 0, copy % 3 == 0, copy % 5 == 0].into(),
                position_m: [0.0; 3],
            })
            .collect();
        let errors = [
            check(octree, &with, &[], none),
            check(octree, &heavy, &[], none),
            check(octree, &heavy, &clamp, wild),
            check(octree, &heavy, &partly, wild),
        ];
        assert!(errors.iter().all(|&e| e < 3e-6), "body {b}: {errors:?}");
    }
}

#[test]
fn materials_are_kept_apart() {
    let shape = scindo_matter::octree::BoxShape { min: V3::zeros(), max: V3::repeat(1.0) };
    let settings = scindo_matter::octree::OctreeSettings { cells: 16, levels: 2 };
    let octree = Octree::fill(&shape, settings, &|p| u16::from(p.z > 0.5)).unwrap();
    let soft = coefficients(0.2, 1.0).materials[0];
    let with = coefficients(0.45, 1.0);
    let hard = CellMaterial { density_kg_m3: 3000.0, ..with.materials[0] };
    let with = Coefficients { materials: vec![soft, hard], ..with };
    assert!(check(&octree, &with, &clamped(&octree, 2), |p| p) < 3e-6);
}

/// A rigid rotation of everything computes nothing again, and the operators turn with it.
#[test]
fn rigid_rotations_refresh_nothing() {
    let mut team = Team::new(1).unwrap();
    let mut octree = cube(16, 2);
    blade_grid(&mut octree, &[5]);
    let with = coefficients(0.3, 1e3);
    let hierarchy = Hierarchy::with(&octree, 60, true);
    let mut galerkin = Galerkin::new(&hierarchy);
    let mut exact = Exact::new(&octree, &with, &[]);
    let bend = |p: V3| V3::new(0.0, 0.6 * p.x, 0.0);
    exact.turn(bend);
    let update = |galerkin: &mut Galerkin, team: &mut Team, exact: &Exact, tolerance: f64| {
        let rotation = |id: u32| exact.rotation(id);
        let updated = galerkin.update(team, &hierarchy, (&with, &[]), &rotation, tolerance);
        [updated.constants, updated.matrices]
    };
    assert_eq!(update(&mut galerkin, &mut team, &exact, 1e-4), [true, true]);
    for turn in 1..4 {
        let Q = Rotation3::new(V3::new(0.3, -0.8, 0.5) * f64::from(turn)).into_inner();
        exact.turn(bend);
        exact.rotations.iter_mut().for_each(|R| *R = Q * *R);
        assert_eq!(update(&mut galerkin, &mut team, &exact, 1e-4), [false, false]);
        assert!(error(&hierarchy, &galerkin, &exact) < 2e-4);
    }
    // Bending on by more than the tolerance does.
    exact.turn(|p| 1.5 * bend(p));
    assert_eq!(update(&mut galerkin, &mut team, &exact, 1e-4), [false, true]);
    assert!(error(&hierarchy, &galerkin, &exact) < 2e-4);
    // With a wide tolerance almost everything inside counts as cubes.
    update(&mut galerkin, &mut team, &exact, 0.1);
    let stored =
        |g: &Galerkin| g.levels[1].matrix.iter().filter(|m| matches!(m, CellMatrix::Stored(_))).count();
    let (wide, all) = (stored(&galerkin), hierarchy.levels[1].cells.len());
    assert!(wide < all / 3, "{wide} of {all}");
    assert!(error(&hierarchy, &galerkin, &exact) < 0.1);
}
