//! R3: the drooping bar to a preconditioned residual of 1e-10 by every solver.

use nalgebra::Vector3;
use scindo_physics::assembly::{BlockCsr, Model, Tangent, Volumetric};
use scindo_physics::element::FixedCopy;
use scindo_physics::integrator::{Relaxation, StaticProblem, find_equilibrium};
use scindo_physics::material::{Law, Material, Rayleigh};
use scindo_physics::mesh::{BoxPattern, box_mesh};
use scindo_physics::solver::{
    Curvature, LinearReport, LinearSettings, LinearSolver, Method, Newton, NewtonReport, NewtonSettings,
    Precision, StopReason,
};
use scindo_physics::team::Team;

const MIXED: Precision = Precision::Mixed;
const DOUBLE: Precision = Precision::Double;

/// The bar with its weight and its clamp.
struct Bar {
    model: Model,
    load: Vec<Vector3<f64>>,
    fixed: Vec<FixedCopy>,
}

fn bar(law: Law, cells: [usize; 3]) -> Bar {
    let pattern = BoxPattern::Tet5 { parity: false };
    let mesh = box_mesh(Vector3::zeros(), Vector3::new(1.0, 0.2, 0.2), cells, pattern);
    let material =
        Material { young_pa: 1e5, poisson: 0.33, density_kg_m3: 100.0, rayleigh: Rayleigh::default(), law };
    let model = Model::tet4(&mesh, &material, Volumetric::Full).unwrap();
    let load = model.lumped_mass(100.0).iter().map(|m| Vector3::new(0.0, -9.81 * m, 0.0)).collect();
    let clamp = |(copy, X): (u32, &Vector3<f64>)| {
        (X.x < 1e-9).then_some(FixedCopy { copy, held: [true; 3].into(), position_m: (*X).into() })
    };
    let fixed = (0..).zip(model.rest()).filter_map(clamp).collect();
    Bar { model, load, fixed }
}

impl Bar {
    fn mean_tip(&self, x: &[Vector3<f64>]) -> f64 {
        let tip = self.model.rest().iter().zip(x).filter(|(X, _)| X.x > 1.0 - 1e-9);
        let (sum, n) = tip.fold((0.0, 0.0), |(sum, n), (X, x)| (sum + x.y - X.y, n + 1.0));
        sum / n
    }

    fn equilibrium(&self, settings: NewtonSettings) -> (NewtonReport, Vec<Vector3<f64>>) {
        let mut x = self.model.rest().to_vec();
        let mut problem = StaticProblem::new(&self.model, &self.load);
        let mut newton = Newton::new(settings);
        let mut team = Team::new(1).unwrap();
        let report = find_equilibrium(&mut newton, &mut team, &mut problem, &self.fixed, &mut x);
        (report, x)
    }

    fn stiffness(&self) -> BlockCsr<f64> {
        let mut K = self.model.pattern();
        self.model.tangent(self.model.rest(), Tangent::Exact, &mut K);
        K
    }
}

fn linear(method: Method, precision: Precision, tolerance: f64) -> LinearSettings {
    LinearSettings { method, precision, iterations: 5_000, tolerance }
}

fn solve(bar: &Bar, K: &BlockCsr<f64>, settings: LinearSettings) -> (LinearReport, Vec<Vector3<f64>>) {
    let mut u = vec![Vector3::zeros(); bar.load.len()];
    let mut solver = LinearSolver::new(settings);
    solver.set_matrix(K, &bar.fixed);
    let report = solver.solve(&mut Team::new(1).unwrap(), K, &bar.load, &mut u, None);
    (report, u)
}

#[test]
fn every_linear_solver_reaches_1e_10_and_the_reference_tip() {
    let bar = bar(Law::Linear, [40, 8, 8]);
    let K = bar.stiffness();
    let tip = |u: &[Vector3<f64>]| {
        let x: Vec<_> = bar.model.rest().iter().zip(u).map(|(X, u)| X + u).collect();
        bar.mean_tip(&x)
    };
    let (_, exact) = solve(&bar, &K, linear(Method::Cholesky, DOUBLE, 1e-12));
    assert!((tip(&exact) / -0.362253595 - 1.0).abs() < 3e-9, "{}", tip(&exact));
    for method in [Method::Cg, Method::Pcg, Method::Cholesky] {
        for precision in [MIXED, DOUBLE] {
            let (report, u) = solve(&bar, &K, linear(method, precision, 1e-10));
            println!("{method:?} {precision:?}: {report:?}");
            assert_eq!(report.stop, StopReason::Converged);
            assert!(report.residual <= 1e-10);
            let worst = u.iter().zip(&exact).map(|(a, b)| (a - b).amax()).fold(0.0, f64::max);
            assert!(worst < 1e-8 * 0.36, "{method:?} {precision:?}: {worst:e}");
        }
    }
    // Single precision loses conjugacy, which costs about twice the iterations down to 1e-10.
    let count = |precision| solve(&bar, &K, linear(Method::Pcg, precision, 1e-10)).0.iterations;
    assert!(count(MIXED) < 3 * count(DOUBLE));
}

#[test]
fn newton_reaches_1e_10_with_every_solver() {
    for (law, tip) in [(Law::Corotational, -0.333432806), (Law::StVenantKirchhoff, -0.334336007)] {
        let bar = bar(law, [40, 8, 8]);
        let mut first: Option<Vec<Vector3<f64>>> = None;
        for (method, precision, curvature) in [
            (Method::Cholesky, DOUBLE, Curvature::Exact),
            (Method::Cholesky, MIXED, Curvature::Definite),
            (Method::Pcg, MIXED, Curvature::Exact),
        ] {
            let linear = linear(method, precision, 0.1);
            let (report, x) = bar.equilibrium(NewtonSettings {
                tolerance: 1e-10,
                curvature,
                linear,
                ..NewtonSettings::default()
            });
            println!("{law:?} {method:?} {precision:?} {curvature:?}: {report:?}");
            assert_eq!(report.stop, StopReason::Converged);
            assert!(report.residual <= 1e-10);
            assert!((bar.mean_tip(&x) / tip - 1.0).abs() < 3e-9, "{}", bar.mean_tip(&x));
            let first = first.get_or_insert(x.clone());
            let worst = x.iter().zip(&*first).map(|(a, b)| (a - b).amax()).fold(0.0, f64::max);
            assert!(worst < 1e-7, "{method:?}: {worst:e}");
        }
    }
}

#[test]
fn an_indefinite_tangent_is_reported_and_newton_gets_past_it() {
    // Squeezed to half its length the bar is past buckling: the exact tangent is indefinite.
    let bar = bar(Law::Corotational, [10, 2, 2]);
    let squeezed: Vec<_> = bar.model.rest().iter().map(|X| Vector3::new(0.5 * X.x, X.y, X.z)).collect();
    let mut K = bar.model.pattern();
    bar.model.tangent(&squeezed, Tangent::Exact, &mut K);
    for (method, precision) in [(Method::Cg, DOUBLE), (Method::Pcg, MIXED), (Method::Cholesky, MIXED)] {
        let (report, u) = solve(&bar, &K, linear(method, precision, 1e-10));
        assert_eq!(report.stop, StopReason::NonPositiveCurvature, "{method:?}: {report:?}");
        assert!(u.iter().all(|u| u.amax().is_finite()));
    }
    for method in [Method::Pcg, Method::Cholesky] {
        let mut x = squeezed.clone();
        let settings = NewtonSettings {
            tolerance: 1e-9,
            curvature: Curvature::Exact,
            linear: linear(method, MIXED, 0.1),
            ..NewtonSettings::default()
        };
        let mut problem = StaticProblem::new(&bar.model, &bar.load);
        let mut team = Team::new(1).unwrap();
        let report =
            find_equilibrium(&mut Newton::new(settings), &mut team, &mut problem, &bar.fixed, &mut x);
        println!("{method:?}: {report:?}");
        assert_eq!(report.stop, StopReason::Converged);
        assert!(report.indefinite > 0, "{report:?}");
    }
}

#[test]
fn relaxation_keeps_its_iterate_from_frame_to_frame() {
    let bar = bar(Law::Corotational, [10, 2, 2]);
    let settings = NewtonSettings { tolerance: 1e-10, ..NewtonSettings::default() };
    let (_, exact) = bar.equilibrium(settings);
    let mut problem = StaticProblem::new(&bar.model, &bar.load);
    let mut team = Team::new(1).unwrap();
    // Iterations, the last report and the shape after at most `frames` of `per_frame` iterations.
    let mut run = |per_frame: u32, frames: u32, forget: bool| {
        let mut relaxation = Relaxation::new(1e-6);
        let mut x = bar.model.rest().to_vec();
        let (mut iterations, mut report) = (0, Default::default());
        for frame in 0..frames {
            if forget {
                relaxation.forget();
            }
            report = relaxation.relax(&mut team, &mut problem, &bar.fixed, &mut x, per_frame);
            assert_eq!(report.restarted, frame == 0 || forget);
            iterations += report.iterations;
            if report.stop != StopReason::IterationLimit {
                break;
            }
        }
        println!("{per_frame} per frame: {iterations}, {report:?}");
        (iterations, report, x)
    };
    let (at_once, report, x) = run(5_000, 1, false);
    assert_eq!(report.stop, StopReason::Converged);
    let worst = x.iter().zip(&exact).map(|(a, b)| (a - b).amax()).fold(0.0, f64::max);
    assert!(worst < 1e-4, "{worst:e}");
    let (in_frames, report, same) = run(10, 500, false);
    assert_eq!((report.stop, in_frames, same), (StopReason::Converged, at_once, x));
    let (_, forgetful, _) = run(10, in_frames.div_ceil(10), true);
    assert!(forgetful.residual > 1e3 * report.residual, "{forgetful:?}");
}
