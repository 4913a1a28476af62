use scindo_matter::element::FixedCopy;
use scindo_matter::element::MaterialPoint;
use scindo_matter::octree::Octree;
use scindo_matter::team::Team;

use super::support::{Exact, V3, blade_grid, clamped, coefficients, cube, vector};
use crate::operator::{BLOCK, LinearOperator, Padded, Preconditioner, Spring, filter, padded, unpadded};
use crate::solver::multigrid::{Composite, Hierarchy, MultigridSettings};
use crate::solver::{Pcg, PcgSettings, StopReason};

/// Springs along a direction and in all directions, in cells at both ends of the list.
fn springs(octree: &Octree, stiffness: f32) -> Vec<Spring> {
    let at = |id: usize, direction| {
        let weights = [0.3, 0.1, 0.05, 0.15, 0.1, 0.1, 0.12, 0.08];
        let carriers = octree.vertices()[id].into_iter().zip(weights);
        Spring { point: MaterialPoint::new(carriers), direction, stiffness }
    };
    vec![at(0, Some([0.6, 0.0, 0.8])), at(octree.cells().len() - 1, None), at(1, Some([0.0, 1.0, 0.0]))]
}

fn made(octree: &Octree, fixed: &[FixedCopy], level: usize, stiffness: f32) -> (Team, Exact, Composite) {
    let with = coefficients(0.3, 2e4);
    let mut exact = Exact::new(octree, &with, fixed);
    exact.turn(|p: V3| 3.0 * V3::new((7.0 * p.y).sin(), (5.0 * p.z).cos(), p.x));
    exact.springs = springs(octree, stiffness);
    let mut team = Team::new(1).unwrap();
    let settings = MultigridSettings { same_rotation_rad: 0.0, ..MultigridSettings::default() };
    let mut composite = Composite::new(Hierarchy::with(octree, 60, true), settings, level);
    composite.update(&mut team, (&with, fixed), &|id| exact.rotation(id));
    composite.set_springs(&mut team, &exact.springs);
    (team, exact, composite)
}

fn random(n: usize, held: &[FixedCopy]) -> Vec<Padded> {
    let mut d: Vec<Padded> = vector(n, 3).iter().map(padded).collect();
    filter(held, &mut d);
    d
}

fn partly(octree: &Octree) -> Vec<FixedCopy> {
    let axes = |copy: u32| [2, 3, 5].map(|n| copy.is_multiple_of(n));
    let all = (0..octree.n_vertices() as u32).step_by(7);
    all.map(|copy| FixedCopy { copy, held: axes(copy).into(), position_m: [0.0; 3] }).collect()
}

#[test]
fn the_operator_is_that_of_the_finest_level_on_prolongations() {
    let mut grid = cube(16, 2);
    blade_grid(&mut grid, &[3, 8, 13]);
    for octree in [cube(8, 0), cube(16, 2), grid] {
        for fixed in [Vec::new(), clamped(&octree, 0), partly(&octree)] {
            for level in [1, 2] {
                let (mut team, exact, mut composite) = made(&octree, &fixed, level, 3e5);
                let d = random(composite.n_vertices(), composite.held());
                let mut u = vec![[0.0; 4]; octree.n_vertices()];
                composite.prolong(&mut team, &d, &fixed, &mut u);
                let u64: Vec<V3> = u.iter().map(unpadded).collect();
                let f: Vec<Padded> = exact.apply(&u64).iter().map(padded).collect();
                let (mut ours, mut theirs) = (vec![[0.0; 4]; d.len()], vec![[0.0; 4]; d.len()]);
                composite.restrict(&mut team, &f, &mut theirs);
                composite.parts().0.apply(&mut team, &d, &mut ours);
                let norm = |v: &mut dyn Iterator<Item = V3>| v.map(|v| v.norm_squared()).sum::<f64>().sqrt();
                let size = norm(&mut theirs.iter().map(unpadded));
                let wrong =
                    norm(&mut ours.iter().zip(&theirs).map(|(a, b)| unpadded(a) - unpadded(b))) / size;
                assert!(wrong < 3e-6, "level {level}, {} held: {wrong:e}", fixed.len());
                // Restriction is the transpose of prolongation.
                let dot = |a: &[Padded], b: &[Padded]| -> f64 {
                    a.iter().zip(b).map(|(a, b)| unpadded(a).dot(&unpadded(b))).sum()
                };
                let (left, right) = (dot(&f, &u), dot(&theirs, &d));
                assert!((left - right).abs() < 1e-4 * left.abs(), "{left} {right}");
            }
        }
    }
}

#[test]
fn its_equations_take_few_iterations() {
    let mut grid = cube(16, 2);
    blade_grid(&mut grid, &[3, 8, 13]);
    for (octree, most) in [(cube(16, 0), 9), (grid, 16)] {
        for level in [1, 2] {
            for stiffness in [0.0, 1e9] {
                let (mut team, _, mut composite) = made(&octree, &clamped(&octree, 0), level, stiffness);
                let n = composite.n_vertices();
                let mut pcg = Pcg::default();
                pcg.resize(n);
                pcg.r = random(n, composite.held());
                let (b, mut x) = (pcg.r.clone(), vec![[0.0; 4]; n]);
                let (mut A, mut M) = composite.parts();
                // Springs too stiff for cycles are left to block-Jacobi.
                assert_eq!(M.uses_operator(), stiffness == 0.0);
                let mut partial = vec![0.0; n.div_ceil(BLOCK)];
                let reference = M.apply(&mut team, &mut A, &b, &mut x.clone(), &mut partial).sqrt();
                let settings = PcgSettings { iterations: 2000, tolerance: 1e-5 };
                let report = pcg.solve(&mut team, &mut A, &mut M, &mut x, (reference, settings));
                assert_eq!(report.stop, StopReason::Converged, "level {level}: {report:?}");
                assert!(stiffness > 0.0 || report.iterations <= most, "level {level}: {report:?}");
            }
        }
    }
}
