//! Estimates of the error against errors that are known.

use nalgebra::{Matrix3, Vector3};
use scindo_physics::assembly::{Model, Tangent, Volumetric};
use scindo_physics::body::estimate::{CutTets, MeshError, StressRecovery, Tets};
use scindo_physics::body::{Body, BodySettings};
use scindo_physics::cut::BladeSweep;
use scindo_physics::element::FixedCopy;
use scindo_physics::element::quadrature::tet_degree_5;
use scindo_physics::material::{Lame, Law, Material, Rayleigh};
use scindo_physics::mesh::{BoxPattern, TetMesh, box_mesh};
use scindo_physics::solver::{LinearSettings, LinearSolver, Method, StopReason};
use scindo_physics::team::Team;

const PI: f64 = std::f64::consts::PI;
/// Amplitude [m]: small, so that every law is linear.
const SIZE: f64 = 1e-6;
const DIRECTION: Vector3<f64> = Vector3::new(1.0, -0.5, 0.3);

fn soft(law: Law, poisson: f64) -> Material {
    Material { young_pa: 1e4, poisson, density_kg_m3: 1e3, rayleigh: Rayleigh::default(), law }
}

/// u = SIZE sin πx sin πy sin πz d: its value, gradient, and the body force −div σ that it takes.
fn manufactured(X: &Vector3<f64>, lame: Lame) -> (Vector3<f64>, Matrix3<f64>, Vector3<f64>) {
    let (s, c) = (X.map(|x| (PI * x).sin()), X.map(|x| (PI * x).cos()));
    let value = SIZE * s.x * s.y * s.z;
    let slope = SIZE * PI * Vector3::new(c.x * s.y * s.z, s.x * c.y * s.z, s.x * s.y * c.z);
    let second = |i: usize, j: usize| {
        let factor = |k: usize| if k == i || k == j { c[k] } else { s[k] };
        let product: f64 = (0..3).map(factor).product();
        PI * PI * if i == j { -value } else { SIZE * product }
    };
    let laplacian = -3.0 * PI * PI * value;
    let force = Vector3::from_fn(|i, _| {
        let mixed: f64 = (0..3).map(|j| DIRECTION[j] * second(i, j)).sum();
        -lame.mu * laplacian * DIRECTION[i] - (lame.lambda + lame.mu) * mixed
    });
    (value * DIRECTION, DIRECTION * slope.transpose(), force)
}

fn stress(gradient: &Matrix3<f64>, Lame { mu, lambda }: Lame) -> Matrix3<f64> {
    let strain = 0.5 * (gradient + gradient.transpose());
    2.0 * mu * strain + lambda * strain.trace() * Matrix3::identity()
}

fn complementary(stress: &Matrix3<f64>, Lame { mu, lambda }: Lame) -> f64 {
    let trace = stress.trace();
    (stress.norm_squared() - lambda / (3.0 * lambda + 2.0 * mu) * trace * trace) / (2.0 * mu)
}

/// Point of a barycentric coordinate in element `e`.
fn point(mesh: &TetMesh, e: usize, N: &[f64; 4]) -> Vector3<f64> {
    mesh.corners(e).iter().zip(N).map(|(X, N)| *N * X).sum()
}

fn barycentric(xi: &Vector3<f64>) -> [f64; 4] {
    [1.0 - xi.sum(), xi.x, xi.y, xi.z]
}

/// Solution of the manufactured problem on `cells`³ cells: estimate and true ‖u − u_h‖_E.
fn estimated(cells: usize, pattern: BoxPattern, law: Law, poisson: f64) -> (MeshError, f64) {
    let mesh = box_mesh(Vector3::zeros(), Vector3::repeat(1.0), [cells; 3], pattern);
    let material = soft(law, poisson);
    let lame = material.lame();
    let model = Model::tet4(&mesh, &material, Volumetric::Full).unwrap();
    let quadrature = tet_degree_5();
    let mut load = vec![Vector3::zeros(); mesh.nodes.len()];
    for (e, tet) in mesh.tets.iter().enumerate() {
        for (xi, weight) in &quadrature {
            let N = barycentric(xi);
            let (_, _, force) = manufactured(&point(&mesh, e, &N), lame);
            let w = weight * mesh.volume(e);
            tet.iter().zip(N).for_each(|(&a, N)| load[a as usize] += w * N * force);
        }
    }
    let edge = |X: &Vector3<f64>| X.iter().any(|x| *x < 1e-9 || *x > 1.0 - 1e-9);
    let hold = |(copy, X): (u32, &Vector3<f64>)| {
        edge(X).then_some(FixedCopy { copy, held: [true; 3].into(), position_m: (*X).into() })
    };
    let fixed: Vec<_> = (0..).zip(&mesh.nodes).filter_map(hold).collect();
    let mut K = model.pattern();
    model.tangent(model.rest(), Tangent::Exact, &mut K);
    let mut solver = LinearSolver::new(LinearSettings { method: Method::Pcg, ..LinearSettings::default() });
    solver.set_matrix(&K, &fixed);
    let mut u = vec![Vector3::zeros(); mesh.nodes.len()];
    let report = solver.solve(&mut Team::new(1).unwrap(), &K, &load, &mut u, None);
    assert_eq!(report.stop, StopReason::Converged);
    let x: Vec<_> = mesh.nodes.iter().zip(&u).map(|(X, u)| X + u).collect();
    let estimate = StressRecovery::default().estimate(&model, &x, law, lame);
    let mut exact = 0.0;
    for (e, tet) in mesh.tets.iter().enumerate() {
        let gradients = mesh.gradients(e);
        let gradient = tet.iter().zip(&gradients).map(|(&a, g)| u[a as usize] * g.transpose()).sum();
        let sigma = stress(&gradient, lame);
        for (xi, weight) in &quadrature {
            let (_, true_gradient, _) = manufactured(&point(&mesh, e, &barycentric(xi)), lame);
            let missed = stress(&true_gradient, lame) - sigma;
            exact += weight * mesh.volume(e) * complementary(&missed, lame);
        }
    }
    (estimate, exact.sqrt())
}

#[test]
fn stress_recovery_is_effective_on_a_manufactured_solution() {
    for (pattern, law, poisson) in [
        (BoxPattern::Tet6, Law::Linear, 0.3),
        (BoxPattern::Tet5 { parity: false }, Law::Linear, 0.3),
        (BoxPattern::Tet5 { parity: false }, Law::Corotational, 0.3),
        (BoxPattern::Octahedral6, Law::StVenantKirchhoff, 0.0),
        (BoxPattern::Tet5 { parity: true }, Law::Linear, 0.45),
    ] {
        let mut errors = Vec::new();
        for cells in [8, 16] {
            let (estimate, exact) = estimated(cells, pattern, law, poisson);
            let effectivity = estimate.eta / exact;
            println!("{pattern:?} {law:?} ν = {poisson}, {cells}³: θ = {effectivity:.3}, {estimate:?}");
            assert!((0.7..=1.5).contains(&effectivity), "{effectivity}");
            assert_eq!(estimate.left_out, 0);
            errors.push(exact);
        }
        let order = (errors[0] / errors[1]).log2();
        assert!((order - 1.0).abs() < 0.15, "energy norm falls with h: {order}");
    }
}

#[test]
fn stress_is_never_averaged_across_a_cut() {
    let mesh = box_mesh(Vector3::zeros(), Vector3::repeat(0.1), [4; 3], BoxPattern::Tet6);
    for law in [Law::Linear, Law::Corotational, Law::StVenantKirchhoff] {
        let material = soft(law, 0.3);
        // The fast path knows two laws; the mesh and its cut are those of any.
        let carrier = Material { law: Law::Linear, ..material };
        let mut body = Body::new(mesh.clone(), carrier, BodySettings::default()).unwrap();
        let segment = |y: f64| [Vector3::new(0.041, y, -0.5), Vector3::new(0.041, y, 0.5)];
        let stretched = |body: &Body| -> Vec<Vector3<f64>> {
            let parts = body.parts();
            let rest = body.rest_positions();
            let left = parts.of_copy[0];
            let of = |(c, X): (usize, &Vector3<f64>)| {
                if parts.of_copy[c] == left { *X } else { Vector3::new(X.x * 1.1, X.y, X.z * 0.97) }
            };
            rest.iter().enumerate().map(of).collect()
        };
        let mut recovery = StressRecovery::default();
        body.cut(&BladeSweep { segments: vec![segment(-0.5), segment(0.5)] }, 1).unwrap();
        assert_eq!(body.parts().len(), 2);
        let tets = body.tets().unwrap();
        let cut = CutTets::new(tets.mesh(), tets.pieces(), body.n_copies(), tets.regions());
        let error = recovery.estimate(&cut, &stretched(&body), law, material.lame());
        println!("{law:?}: {error:?}");
        assert!(error.energy_norm > 1e-3 && error.eta < 1e-7 * error.energy_norm);
        assert_eq!(recovery.eta_squared().len(), cut.count());
    }
}
