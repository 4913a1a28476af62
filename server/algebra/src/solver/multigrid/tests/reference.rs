//! The reference cube R7: 40³ cells, clamped at x = 0, under its weight.

use super::support::{Scene, V3, clamped, coefficients, cube, dot};
use crate::operator::padded;
use crate::solver::multigrid::{Cycle, MultigridSettings};
use crate::solver::{Pcg, PcgSettings, StopReason};

/// Lattice point and displacement [m] of probes, from `tests/reference/R7/cube40.json`.
const PROBES: [([i32; 3], [f64; 3]); 6] = [
    ([40, 0, 0], [-0.009_560_557_092_143_8, 3.474_621_058_310_4e-5, -0.028_655_633_375_569]),
    ([40, 40, 40], [0.009_560_557_092_143_8, 3.474_621_058_309_7e-5, -0.028_655_633_375_569]),
    ([40, 20, 0], [-0.009_853_591_548_500_7, 0.0, -0.028_812_177_150_565]),
    ([20, 0, 40], [0.008_898_848_878_458_7, 9.654_854_653_727_7e-4, -0.015_802_043_235_751]),
    ([1, 1, 1], [-7.637_951_846_727_5e-4, -5.715_520_472_344_7e-4, -7.783_342_156_591_7e-4]),
    ([10, 30, 10], [-0.001_914_612_397_312_1, 3.808_571_230_332_6e-4, -0.007_497_257_943_356_1]),
];
/// Its energy [J].
const ENERGY: f64 = 73.951_364_143_615_08;

/// Single precision inside, residuals in double precision outside.
#[test]
fn refined_solutions_reach_the_reference() {
    let octree = cube(40, 0);
    let fixed = clamped(&octree, 0);
    let mut scene = Scene::new(&octree, coefficients(0.3, 0.0), &fixed, MultigridSettings::default());
    let b = scene.gravity();
    let mut x = vec![V3::zeros(); b.len()];
    let mut pcg = Pcg::default();
    pcg.resize(b.len());
    let mut iterations = Vec::new();
    for _ in 0..4 {
        let Ax = scene.exact.apply(&x);
        let mut r: Vec<V3> = b.iter().zip(&Ax).map(|(b, Ax)| b - Ax).collect();
        scene.exact.filter(&mut r);
        let scale = 1.0 / dot(&r, &r).sqrt();
        pcg.r.iter_mut().zip(&r).for_each(|(to, r)| *to = padded(&(scale * r)));
        let Scene { team, fine, inverse, multigrid, .. } = &mut scene;
        let mut V = Cycle { multigrid, inverse, largest: 0.0 };
        let rz = pcg.precondition(team, fine, &mut V);
        let settings = PcgSettings { iterations: 20, tolerance: 1e-3 };
        let mut change = vec![[0.0; 4]; b.len()];
        let report = pcg.run(team, fine, &mut V, &mut change, (rz, rz.sqrt(), settings));
        assert_eq!(report.stop, StopReason::Converged);
        iterations.push(report.iterations);
        for (x, c) in x.iter_mut().zip(&change) {
            *x += V3::new(c[0].into(), c[1].into(), c[2].into()) / scale;
        }
    }
    assert!(iterations.iter().sum::<u32>() <= 24, "{iterations:?}");
    let largest = 0.028_812_177_150_565;
    for (at, u) in PROBES {
        let v = octree.points().iter().position(|p| *p == at).unwrap();
        let error = (x[v] - V3::from(u)).norm() / largest;
        assert!(error < 1e-8, "{at:?}: {} instead of {u:?}, {error:e}", x[v]);
    }
    let energy = 0.5 * dot(&b, &x);
    assert!((energy / ENERGY - 1.0).abs() < 1e-8, "{energy}");
}
