//! Solving again allocates nothing, whatever the method.

use nalgebra::Vector3;
use scindo_allocations::allocations;
use scindo_physics::assembly::{Model, Tangent, Volumetric};
use scindo_physics::body::estimate::StressRecovery;
use scindo_physics::element::FixedCopy;
use scindo_physics::integrator::{Relaxation, StaticProblem, find_equilibrium};
use scindo_physics::mesh::{BoxPattern, box_mesh};
use scindo_physics::solver::{
    LinearSettings, LinearSolver, Method, Newton, NewtonSettings, Precision, StopReason,
};
use scindo_physics::team::Team;

use crate::SOFT;

/// A short bar, its weight and its clamp.
fn bar() -> (Model, Vec<Vector3<f64>>, Vec<FixedCopy>) {
    let size = Vector3::new(0.5, 0.2, 0.2);
    let mesh = box_mesh(Vector3::zeros(), size, [10, 4, 4], BoxPattern::Tet5 { parity: false });
    let model = Model::tet4(&mesh, &SOFT, Volumetric::Full).unwrap();
    let load = model.lumped_mass(100.0).iter().map(|m| Vector3::new(0.0, -9.81 * m, 0.0)).collect();
    let clamp = |(copy, X): (u32, &Vector3<f64>)| {
        (X.x == 0.0).then_some(FixedCopy { copy, held: [true; 3].into(), position_m: (*X).into() })
    };
    let fixed = (0..).zip(model.rest()).filter_map(clamp).collect();
    (model, load, fixed)
}

const HOW: [(Method, Precision); 6] = [
    (Method::Cg, Precision::Mixed),
    (Method::Cg, Precision::Double),
    (Method::Pcg, Precision::Mixed),
    (Method::Pcg, Precision::Double),
    (Method::Cholesky, Precision::Mixed),
    (Method::Cholesky, Precision::Double),
];

#[test]
fn a_repeated_linear_solve_does_not_allocate() {
    let (model, load, fixed) = bar();
    let mut team = Team::new(2).unwrap();
    let (mut K, mut u) = (model.pattern(), vec![Vector3::zeros(); load.len()]);
    for (method, precision) in HOW {
        let mut solver =
            LinearSolver::new(LinearSettings { method, precision, iterations: 2_000, tolerance: 1e-10 });
        let mut again = || {
            model.tangent(model.rest(), Tangent::Exact, &mut K);
            u.fill(Vector3::zeros());
            solver.set_matrix(&K, &fixed);
            assert_eq!(solver.solve(&mut team, &K, &load, &mut u, None).stop, StopReason::Converged);
        };
        again();
        let before = allocations();
        (0..3).for_each(|_| again());
        assert_eq!(allocations() - before, 0, "{method:?} {precision:?}");
    }
}

#[test]
fn newton_relaxation_and_estimates_do_not_allocate_when_repeated() {
    let (model, load, fixed) = bar();
    let mut team = Team::new(2).unwrap();
    let mut x = model.rest().to_vec();
    let (mut relaxation, mut recovery) = (Relaxation::new(1e-6), StressRecovery::default());
    for (method, precision) in HOW {
        let linear = LinearSettings { method, precision, ..LinearSettings::default() };
        let mut newton = Newton::new(NewtonSettings { linear, ..NewtonSettings::default() });
        let mut again = || {
            let mut problem = StaticProblem::new(&model, &load);
            x.copy_from_slice(model.rest());
            let report = find_equilibrium(&mut newton, &mut team, &mut problem, &fixed, &mut x);
            assert_eq!(report.stop, StopReason::Converged, "{report:?}");
            recovery.estimate(&model, &x, model.law(), model.lame());
            x.copy_from_slice(model.rest());
            relaxation.relax(&mut team, &mut problem, &fixed, &mut x, 10);
        };
        again();
        let before = allocations();
        again();
        assert_eq!(allocations() - before, 0, "{method:?} {precision:?}");
    }
}
