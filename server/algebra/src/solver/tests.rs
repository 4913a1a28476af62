//! Every method in every precision on one stiff and sliver-ridden matrix; Newton on a curved valley.

#![allow(clippy::unwrap_used)]

use nalgebra::{Matrix3, Vector3};
use scindo_matter::element::{FixedCopy, Held};
use scindo_matter::team::Team;

use super::{
    Curvature, LinearReport, LinearSettings, LinearSolver, Method, Newton, NewtonSettings, Potential,
    Precision, StopReason,
};
use crate::assembly::BlockCsr;

const ALL: [(Method, Precision); 6] = [
    (Method::Cg, Precision::Mixed),
    (Method::Cg, Precision::Double),
    (Method::Pcg, Precision::Mixed),
    (Method::Pcg, Precision::Double),
    (Method::Cholesky, Precision::Mixed),
    (Method::Cholesky, Precision::Double),
];

/// Springs with a bending part between the neighbours of an n³ grid; `weak` scales one of its nodes.
fn grid(n: u32, stiffness: f64, weak: f64) -> BlockCsr<f64> {
    let id = |i: u32, j: u32, k: u32| i + n * (j + n * k);
    let mut edges = Vec::new();
    for (k, j, i) in (0..n).flat_map(|k| (0..n).flat_map(move |j| (0..n).map(move |i| (k, j, i)))) {
        for (di, dj, dk) in [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (0, 1, 1)] {
            if i + di < n && j + dj < n && k + dk < n {
                let along = Vector3::new(f64::from(di), f64::from(dj), f64::from(dk)).normalize();
                edges.push((id(i, j, k), id(i + di, j + dj, k + dk), along));
            }
        }
    }
    let mut rows = vec![Vec::new(); (n * n * n) as usize];
    for &(a, b, _) in &edges {
        rows[a as usize].push(b);
        rows[b as usize].push(a);
    }
    let mut A = BlockCsr::with_rows(rows);
    for (a, b, along) in edges {
        let size = if a == 1 || b == 1 { weak * stiffness } else { stiffness };
        let k: Matrix3<f64> = size * (along * along.transpose() + 0.1 * Matrix3::identity());
        for (row, column, sign) in [(a, a, 1.0), (b, b, 1.0), (a, b, -1.0), (b, a, -1.0)] {
            let at = A.position(row as usize, column).unwrap();
            for e in 0..9 {
                A.blocks[at][e] += sign * k[(e / 3, e % 3)];
            }
        }
    }
    A
}

fn held(n: u32) -> Vec<FixedCopy> {
    let all = (0..n * n).map(|c| FixedCopy { copy: n * c, held: Held::FULLY, position_m: [0.0; 3] });
    let mut held: Vec<_> = all.collect();
    held[3].held = Held::Axes([true, false, true]);
    held
}

fn load(n: usize) -> Vec<Vector3<f64>> {
    (0..n).map(|i| Vector3::new((i % 7) as f64, -1.0, (i % 5) as f64 - 2.0)).collect()
}

fn solved(
    A: &BlockCsr<f64>,
    fixed: &[FixedCopy],
    (method, precision): (Method, Precision),
    threads: usize,
) -> (LinearReport, Vec<Vector3<f64>>) {
    let settings = LinearSettings { method, precision, iterations: 3_000, tolerance: 1e-10 };
    let mut solver = LinearSolver::new(settings);
    let mut x = vec![Vector3::zeros(); A.n_rows()];
    solver.set_matrix(A, fixed);
    let mut team = Team::new(threads).unwrap();
    let report = solver.solve(&mut team, A, &load(A.n_rows()), &mut x, None);
    (report, x)
}

#[test]
fn every_method_in_every_precision_finds_the_same_solution() {
    for stiffness in [1.0, 1e9] {
        let (A, fixed) = (grid(9, stiffness, 1e-9), held(9));
        let (_, exact) = solved(&A, &fixed, (Method::Cholesky, Precision::Double), 1);
        let size = exact.iter().map(|x| x.amax()).fold(0.0, f64::max);
        for how in ALL {
            let (report, x) = solved(&A, &fixed, how, 1);
            // Without a preconditioner the sliver is out of reach, and the report must tell so.
            if how.0 == Method::Cg {
                assert!(report.stop != StopReason::Converged || report.residual <= 1e-10, "{report:?}");
                continue;
            }
            assert_eq!(report.stop, StopReason::Converged, "{how:?}: {report:?}");
            assert!(report.residual <= 1e-10);
            let worst = x.iter().zip(&exact).map(|(a, b)| (a - b).amax()).fold(0.0, f64::max);
            assert!(worst < 1e-7 * size, "{how:?}: {worst:e} of {size:e}");
            assert!(fixed.iter().all(|f| f.held.part_of(&x[f.copy as usize]) == Vector3::zeros()));
        }
    }
}

#[test]
fn plain_gradients_reach_the_tolerance_too_where_nothing_is_a_sliver() {
    let (A, fixed) = (grid(9, 1e4, 1.0), held(9));
    let (_, exact) = solved(&A, &fixed, (Method::Cholesky, Precision::Double), 1);
    let size = exact.iter().map(|x| x.amax()).fold(0.0, f64::max);
    for precision in [Precision::Mixed, Precision::Double] {
        let (report, x) = solved(&A, &fixed, (Method::Cg, precision), 1);
        assert_eq!(report.stop, StopReason::Converged, "{report:?}");
        let worst = x.iter().zip(&exact).map(|(a, b)| (a - b).amax()).fold(0.0, f64::max);
        assert!(worst < 1e-8 * size, "{precision:?}: {worst:e} of {size:e}");
    }
}

#[test]
fn the_number_of_threads_does_not_change_a_bit() {
    let (A, fixed) = (grid(9, 1e4, 1e-3), held(9));
    for how in ALL {
        let bits = |threads| {
            let (report, x) = solved(&A, &fixed, how, threads);
            (
                report,
                x.iter().flat_map(|x| x.iter().map(|v| v.to_bits()).collect::<Vec<_>>()).collect::<Vec<_>>(),
            )
        };
        assert_eq!(bits(1), bits(2), "{how:?}");
    }
}

#[test]
fn an_indefinite_matrix_is_reported_and_the_iterate_stays_finite() {
    let (mut A, fixed) = (grid(6, 1e4, 1.0), held(6));
    A.add_to_diagonal(100, &Matrix3::from_diagonal(&Vector3::new(0.0, -1e6, 0.0)));
    for how in ALL {
        let (report, x) = solved(&A, &fixed, how, 1);
        assert_eq!(report.stop, StopReason::NonPositiveCurvature, "{how:?}: {report:?}");
        assert!(x.iter().all(|x| x.amax().is_finite()));
        assert!(report.residual.is_finite());
        // In the order of elimination the negative pivot may come later, but on no held direction.
        assert_eq!(report.pivot.is_some(), how.0 == Method::Cholesky);
    }
}

/// A grid of springs of which one displacement of one node is pushed away instead of held.
fn pushed_away(n: u32, node: usize, axis: usize) -> BlockCsr<f64> {
    let mut A = grid(n, 1.0, 1.0);
    A.blocks.fill([0.0; 9]);
    for i in 0..A.n_rows() {
        A.add_to_diagonal(i, &Matrix3::identity());
    }
    let mut push = Matrix3::zeros();
    push[(axis, axis)] = -2.0;
    A.add_to_diagonal(node, &push);
    A
}

/// Small matrices are factorised by columns, large ones by supernodes; the two count differently.
#[test]
fn the_failed_pivot_is_named_whatever_its_place() {
    for n in [2, 3, 9] {
        let last = (n * n * n - 1) as usize;
        for (node, axis) in [(0, 0), (0, 2), (last / 2, 1), (last, 0), (last, 2)] {
            let (report, _) =
                solved(&pushed_away(n, node, axis), &[], (Method::Cholesky, Precision::Double), 1);
            assert_eq!(report.stop, StopReason::NonPositiveCurvature);
            assert_eq!(report.pivot, Some((3 * node + axis) as u32), "{n}: {node}, {axis}");
        }
    }
}

#[test]
fn what_nothing_holds_fails_at_the_last_pivot_without_a_panic() {
    for n in [2, 3, 9] {
        // Springs alone: three translations are free, and the last pivots are rounding of either sign.
        let (report, x) = solved(&grid(n, 1e4, 1.0), &[], (Method::Cholesky, Precision::Double), 1);
        assert!(report.stop != StopReason::Converged || report.residual <= 1e-10, "{report:?}");
        assert!(x.iter().all(|x| x.amax().is_finite()));
    }
}

#[test]
fn nonsense_is_reported_and_never_called_converged() {
    let (mut A, fixed) = (grid(4, 1e4, 1.0), held(4));
    A.add_to_diagonal(30, &Matrix3::repeat(f64::NAN));
    for how in ALL {
        let (report, _) = solved(&A, &fixed, how, 1);
        let refused = matches!(report.stop, StopReason::NonFinite | StopReason::NonPositiveCurvature);
        assert!(refused, "{how:?}: {report:?}");
    }
}

#[test]
fn iterations_that_run_out_are_reported_with_the_true_residual() {
    let (A, fixed) = (grid(9, 1e4, 1.0), held(9));
    let settings = LinearSettings { iterations: 5, ..LinearSettings::default() };
    let mut solver = LinearSolver::new(settings);
    solver.set_matrix(&A, &fixed);
    let (b, mut x) = (load(A.n_rows()), vec![Vector3::zeros(); A.n_rows()]);
    let report = solver.solve(&mut Team::new(1).unwrap(), &A, &b, &mut x, None);
    assert_eq!((report.stop, report.iterations), (StopReason::IterationLimit, 5));
    let mut r = vec![Vector3::zeros(); b.len()];
    A.multiply(&x, &mut r);
    r.iter_mut().zip(&b).for_each(|(r, b)| *r = b - *r);
    let true_residual = solver.norm(&r) / solver.norm(&b);
    assert!((report.residual / true_residual - 1.0).abs() < 1e-12);
}

/// ‖x* − x_k‖_A against its estimate from four iterations later.
#[test]
fn the_algebraic_error_is_estimated_within_a_small_factor() {
    let (A, fixed) = (grid(9, 1e4, 1.0), held(9));
    let (_, exact) = solved(&A, &fixed, (Method::Cholesky, Precision::Double), 1);
    for (iterations, precision) in
        [(20, Precision::Mixed), (20, Precision::Double), (60, Precision::Mixed), (60, Precision::Double)]
    {
        let run = |iterations| {
            let settings = LinearSettings { method: Method::Pcg, precision, iterations, tolerance: 1e-14 };
            let mut solver = LinearSolver::new(settings);
            solver.set_matrix(&A, &fixed);
            let mut x = vec![Vector3::zeros(); A.n_rows()];
            let report = solver.solve(&mut Team::new(1).unwrap(), &A, &load(x.len()), &mut x, None);
            let e: Vec<_> = x.iter().zip(&exact).map(|(x, exact)| exact - x).collect();
            (report, A.bilinear(&e, &e).sqrt())
        };
        let (report, now) = run(iterations);
        let (_, then) = run(iterations - 4);
        assert!(report.algebraic_error <= 1.001 * then, "lower bound: {report:?} against {then}");
        assert!(report.algebraic_error >= 0.3 * then.max(now), "sharp: {report:?} against {then}, {now}");
    }
}

/// Φ = Σ over copies of a stretched spring on a ring of radius 1 and couplings: curved, not convex.
struct Ring {
    n: usize,
}

impl Potential for Ring {
    fn value(&mut self, team: &mut Team, x: &[Vector3<f64>]) -> f64 {
        let mut g = vec![Vector3::zeros(); self.n];
        self.gradient(team, x, &mut g)
    }

    fn gradient(&mut self, _: &mut Team, x: &[Vector3<f64>], g: &mut [Vector3<f64>]) -> f64 {
        let mut phi = 0.0;
        g.fill(Vector3::zeros());
        for i in 0..self.n {
            let s = x[i].norm_squared() - 1.0;
            phi += 5.0 * s * s + x[i].y;
            g[i] += 20.0 * s * x[i] + Vector3::y();
            if i > 0 {
                let d = x[i] - x[i - 1];
                phi += 0.5 * d.norm_squared();
                g[i] += d;
                g[i - 1] -= d;
            }
        }
        phi
    }

    fn pattern(&mut self) -> BlockCsr<f64> {
        let n = self.n as u32;
        BlockCsr::with_rows((0..n).map(|i| (i.saturating_sub(1)..(i + 2).min(n)).collect()).collect())
    }

    fn hessian(&mut self, _: &mut Team, x: &[Vector3<f64>], curvature: Curvature, H: &mut BlockCsr<f64>) {
        H.clear();
        for i in 0..self.n {
            let s = x[i].norm_squared() - 1.0;
            let s = if curvature == Curvature::Definite { s.max(0.0) } else { s };
            H.add_to_diagonal(i, &(20.0 * s * Matrix3::identity() + 40.0 * x[i] * x[i].transpose()));
            if i > 0 {
                H.add_to_diagonal(i, &Matrix3::identity());
                H.add_to_diagonal(i - 1, &Matrix3::identity());
                for (r, c) in [(i, i - 1), (i - 1, i)] {
                    let at = H.position(r, c as u32).unwrap();
                    (0..3).for_each(|k| H.blocks[at][4 * k] -= 1.0);
                }
            }
        }
    }

    fn loads(&mut self, loads: &mut [Vector3<f64>]) {
        loads.fill(Vector3::y());
    }
}

#[test]
fn newton_descends_to_the_minimum_from_anywhere() {
    let (n, mut team) = (40, Team::new(1).unwrap());
    let fixed = [FixedCopy { copy: 0, held: Held::FULLY, position_m: [1.0, 0.0, 0.0] }];
    for curvature in [Curvature::Exact, Curvature::Definite] {
        for (method, precision) in ALL {
            for start in [1e-3, 0.5, 1.0, 300.0] {
                let linear = LinearSettings { method, precision, iterations: 500, tolerance: 0.1 };
                let settings = NewtonSettings { tolerance: 1e-10, curvature, linear, ..Default::default() };
                let mut newton = Newton::new(settings);
                let mut x: Vec<_> =
                    (0..n).map(|i| start * Vector3::new(1.0, 0.1 * (i % 3) as f64, 0.2)).collect();
                x[0] = Vector3::x();
                let report = newton.minimise(&mut team, &mut Ring { n }, &mut x, &fixed);
                assert_eq!(
                    report.stop,
                    StopReason::Converged,
                    "{method:?} {curvature:?} {start}: {report:?}"
                );
                assert!(report.residual <= 1e-10 && report.steps < 60, "{report:?}");
                assert!((x[n - 1] - Vector3::new(0.0, -1.02, 0.0)).norm() < 0.05, "{}", x[n - 1]);
                assert_eq!(x[0], Vector3::x());
            }
        }
    }
}

#[test]
fn newton_takes_no_step_where_everything_is_infinite() {
    let mut x = vec![Vector3::repeat(1e200); 4];
    let before = x.clone();
    let report = Newton::default().minimise(&mut Team::new(1).unwrap(), &mut Ring { n: 4 }, &mut x, &[]);
    assert_eq!(report.stop, StopReason::NonFinite);
    assert_eq!(x, before);
}

/// Φ = ½ Σ kᵢ (xᵢ − xᵢ₋₁)² − f·x with springs from 1 to 1e10: at 1e-15 rounding is all that is left.
struct Chain {
    n: usize,
}

impl Chain {
    fn stiffness(i: usize) -> f64 {
        [1.0, 1e10, 3e4][i % 3]
    }
}

impl Potential for Chain {
    fn value(&mut self, team: &mut Team, x: &[Vector3<f64>]) -> f64 {
        let mut g = vec![Vector3::zeros(); self.n];
        self.gradient(team, x, &mut g)
    }

    fn gradient(&mut self, _: &mut Team, x: &[Vector3<f64>], g: &mut [Vector3<f64>]) -> f64 {
        let f = Vector3::new(1.0, 0.3, 0.1);
        let mut phi = 0.0;
        g.fill(-f);
        for i in 0..self.n {
            phi -= f.dot(&x[i]);
            let d = if i > 0 { x[i] - x[i - 1] } else { x[i] };
            phi += 0.5 * Self::stiffness(i) * d.norm_squared();
            g[i] += Self::stiffness(i) * d;
            if i > 0 {
                g[i - 1] -= Self::stiffness(i) * d;
            }
        }
        phi
    }

    fn pattern(&mut self) -> BlockCsr<f64> {
        Ring { n: self.n }.pattern()
    }

    fn hessian(&mut self, _: &mut Team, _: &[Vector3<f64>], _: Curvature, H: &mut BlockCsr<f64>) {
        H.clear();
        for i in 0..self.n {
            let k = Self::stiffness(i) * Matrix3::identity();
            H.add_to_diagonal(i, &k);
            if i > 0 {
                H.add_to_diagonal(i - 1, &k);
                for (r, c) in [(i, i - 1), (i - 1, i)] {
                    let at = H.position(r, c as u32).unwrap();
                    (0..3).for_each(|d| H.blocks[at][4 * d] -= k[(0, 0)]);
                }
            }
        }
    }

    fn loads(&mut self, loads: &mut [Vector3<f64>]) {
        loads.fill(Vector3::new(1.0, 0.3, 0.1));
    }
}

#[test]
fn newton_stops_at_its_round_off_floor() {
    let (n, mut team) = (200, Team::new(1).unwrap());
    let linear = LinearSettings {
        method: Method::Cholesky,
        precision: Precision::Double,
        iterations: 50,
        tolerance: 0.1,
    };
    let settings = NewtonSettings { tolerance: 1e-16, linear, ..Default::default() };
    let mut newton = Newton::new(settings);
    let mut x = vec![Vector3::zeros(); n];
    let report = newton.minimise(&mut team, &mut Chain { n }, &mut x, &[]);
    assert_eq!(report.stop, StopReason::Stagnated, "{report:?}");
    assert!(report.steps < 12 && report.residual < 1e-2, "{report:?}");
}

/// Φ = ½ x² + 9/2 max(x − 1, 0)² in every direction: ten times softer below 1 than above.
struct Softening;

impl Softening {
    fn stiffness(x: f64) -> f64 {
        if x > 1.0 { 10.0 } else { 1.0 }
    }
}

impl Potential for Softening {
    fn value(&mut self, team: &mut Team, x: &[Vector3<f64>]) -> f64 {
        self.gradient(team, x, &mut [Vector3::zeros()])
    }

    fn gradient(&mut self, _: &mut Team, x: &[Vector3<f64>], g: &mut [Vector3<f64>]) -> f64 {
        let beyond = x[0].map(|x| (x - 1.0).max(0.0));
        g[0] = x[0] + 9.0 * beyond;
        0.5 * x[0].norm_squared() + 4.5 * beyond.norm_squared()
    }

    fn pattern(&mut self) -> BlockCsr<f64> {
        BlockCsr::with_rows(vec![vec![0]])
    }

    fn hessian(&mut self, _: &mut Team, x: &[Vector3<f64>], _: Curvature, H: &mut BlockCsr<f64>) {
        H.clear();
        H.add_to_diagonal(0, &Matrix3::from_diagonal(&x[0].map(Self::stiffness)));
    }

    fn loads(&mut self, loads: &mut [Vector3<f64>]) {
        loads.fill(Vector3::zeros());
    }
}

/// The first step ends at 0.9, with 0.82 of the forces it began with. By the stiffness there they are 2.6 times
/// the first ones.
#[test]
fn convergence_is_judged_by_the_stiffness_at_the_end() {
    let linear = LinearSettings { precision: Precision::Double, tolerance: 1e-12, ..Default::default() };
    let settings = NewtonSettings { tolerance: 0.85, linear, ..Default::default() };
    let mut x = vec![Vector3::repeat(1.01)];
    let report = Newton::new(settings).minimise(&mut Team::new(1).unwrap(), &mut Softening, &mut x, &[]);
    assert_eq!((report.stop, report.steps), (StopReason::Converged, 2), "{report:?} at {}", x[0]);
    assert!(x[0].norm() < 1e-9, "{}", x[0]);
}
