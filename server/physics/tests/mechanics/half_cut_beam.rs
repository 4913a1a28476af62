//! Schoch's half-cut beam of St. Venant–Kirchhoff material: its equilibrium costs few Newton steps, and is
//! the one to which descent by a line search leads.

use nalgebra::Vector3;
use scindo_allocations::allocations;
use scindo_physics::assembly::{Model, Volumetric};
use scindo_physics::cut::{BladeSweep, CutMesh};
use scindo_physics::element::FixedCopy;
use scindo_physics::integrator::{StaticProblem, find_equilibrium};
use scindo_physics::material::{Law, Material, Rayleigh};
use scindo_physics::mesh::{BoxPattern, box_mesh};
use scindo_physics::solver::{
    Curvature, LinearSettings, Method, Newton, NewtonReport, NewtonSettings, Precision, StopReason,
};
use scindo_physics::team::Team;

const DENSITY: f64 = 1070.0;
const TOLERANCE: f64 = 1e-6;

/// The beam of 3 × 6 × 21 cells, held at z = 0 and cut through its elements at z = 0.1 m to half its depth.
fn beam(law: Law) -> (Model, Vec<FixedCopy>) {
    let size = Vector3::new(0.03, 0.06, 0.2);
    let mesh = box_mesh(Vector3::zeros(), size, [3, 6, 21], BoxPattern::Tet5 { parity: false });
    let mut cut = CutMesh::new(mesh).unwrap();
    let blade = |x: f64| [Vector3::new(x, -0.01, 0.1), Vector3::new(x, 0.07, 0.1)];
    let x = cut.rest_positions();
    cut.sweep(&x, &BladeSweep { segments: vec![blade(-0.01), blade(0.015)] }, 1).unwrap();
    let rayleigh = Rayleigh { mass_1_s: 0.0, stiffness_s: 0.0 };
    let material = Material { young_pa: 3e5, poisson: 0.35, density_kg_m3: DENSITY, rayleigh, law };
    let model = Model::tet4_cut(&cut, &material, Volumetric::Full).unwrap();
    let clamp = |(copy, X): (u32, &Vector3<f64>)| {
        (X.z == 0.0).then_some(FixedCopy { copy, held: [true; 3].into(), position_m: (*X).into() })
    };
    let fixed = (0..).zip(model.rest()).filter_map(clamp).collect();
    (model, fixed)
}

fn weights(model: &Model, gravity: Vector3<f64>) -> Vec<Vector3<f64>> {
    model.shape_integrals().iter().map(|v| DENSITY * v * gravity).collect()
}

fn newton(method: Method, curvature: Curvature, forcing: f64) -> Newton {
    let linear =
        LinearSettings { method, precision: Precision::Double, iterations: 5_000, tolerance: forcing };
    Newton::new(NewtonSettings { tolerance: TOLERANCE, curvature, linear, ..NewtonSettings::default() })
}

/// Equilibrium from rest under the weight along x at `gravity` [m/s²].
fn equilibrium(
    law: Law,
    mut newton: Newton,
    gravity: Vector3<f64>,
    threads: usize,
) -> (NewtonReport, Vec<Vector3<f64>>) {
    let (model, fixed) = beam(law);
    let load = weights(&model, gravity);
    let (mut x, mut team) = (model.rest().to_vec(), Team::new(threads).unwrap());
    let mut problem = StaticProblem::new(&model, &load);
    (find_equilibrium(&mut newton, &mut team, &mut problem, &fixed, &mut x), x)
}

fn farthest(x: &[Vector3<f64>], y: &[Vector3<f64>]) -> f64 {
    x.iter().zip(y).map(|(x, y)| (x - y).norm()).fold(0.0, f64::max)
}

const ACROSS: Vector3<f64> = Vector3::new(9.81, 0.0, 0.0);

/// Bending by half the length of the beam: five steps, and five times the iterations of the linear solve.
#[test]
fn bending_takes_few_steps_and_iterations_and_ends_where_descent_does() {
    let law = Law::StVenantKirchhoff;
    let (one, _) = equilibrium(Law::Linear, newton(Method::Pcg, Curvature::Exact, TOLERANCE), ACROSS, 1);
    assert_eq!((one.steps, one.stop), (1, StopReason::Converged), "{one:?}");
    let (descent, there) = equilibrium(law, newton(Method::Cholesky, Curvature::Definite, 0.1), ACROSS, 1);
    assert_eq!(descent.stop, StopReason::Converged, "{descent:?}");
    for method in [Method::Pcg, Method::Cholesky] {
        let (report, x) = equilibrium(law, newton(method, Curvature::Exact, 0.1), ACROSS, 1);
        assert_eq!(report.stop, StopReason::Converged, "{report:?}");
        assert!(report.residual <= TOLERANCE && report.steps <= 5, "{report:?}");
        let most = if method == Method::Pcg { 5 * one.linear_iterations } else { report.steps };
        assert!(report.linear_iterations <= most, "{report:?} against {one:?}");
        assert!((report.potential / descent.potential - 1.0).abs() < 1e-9);
        assert!(farthest(&x, &there) < 1e-5 * 0.2, "{:e} m", farthest(&x, &there));
        let (on_two, x_on_two) = equilibrium(law, newton(method, Curvature::Exact, 0.1), ACROSS, 2);
        assert!(on_two == report && x_on_two == x, "other bits on two threads");
    }
}

/// Under ten times its weight along its axis the beam buckles: full steps lead nowhere and are taken back.
#[test]
fn buckling_is_left_to_the_line_search_and_never_called_converged_too_early() {
    let gravity = Vector3::new(0.0, 0.0, -98.1);
    for method in [Method::Pcg, Method::Cholesky] {
        let (report, x) =
            equilibrium(Law::StVenantKirchhoff, newton(method, Curvature::Exact, 0.1), gravity, 1);
        assert_eq!(report.stop, StopReason::Converged, "{report:?}");
        let (model, fixed) = beam(Law::StVenantKirchhoff);
        let (load, mut f) = (weights(&model, gravity), vec![Vector3::zeros(); x.len()]);
        model.internal_forces(&x, &mut f);
        let free = |copy: usize| fixed.iter().all(|f| f.copy as usize != copy);
        let left = (0..x.len()).filter(|&c| free(c)).map(|c| (f[c] - load[c]).norm()).fold(0.0, f64::max);
        let largest = load.iter().map(|f| f.norm()).fold(0.0, f64::max);
        assert!(left < 1e-3 * largest, "{left:e} of {largest:e} N are not balanced");
        assert!(report.potential < 0.0 && farthest(&x, model.rest()) > 0.01, "{report:?}");
    }
}

#[test]
fn finding_it_again_does_not_allocate() {
    let (model, fixed) = beam(Law::StVenantKirchhoff);
    let (load, mut team) = (weights(&model, ACROSS), Team::new(2).unwrap());
    for method in [Method::Pcg, Method::Cholesky] {
        let (mut newton, mut x) = (newton(method, Curvature::Exact, 0.1), model.rest().to_vec());
        let mut again = || {
            x.copy_from_slice(model.rest());
            let mut problem = StaticProblem::new(&model, &load);
            find_equilibrium(&mut newton, &mut team, &mut problem, &fixed, &mut x).steps
        };
        let steps = again();
        let before = allocations();
        assert_eq!((again(), allocations() - before), (steps, 0), "{method:?}");
    }
}
