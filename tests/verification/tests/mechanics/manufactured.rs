//! Orders of convergence by manufactured solutions: a smooth displacement is chosen, the body force
//! that belongs to it follows from the law, and the error of the solution is measured in L2.
//!
//! # Source
//! Roache 2002, "Code verification by the method of manufactured solutions". Expected orders of the
//! displacement in L2: polynomial degree + 1.

use nalgebra::{Matrix3, Vector3};
use scindo_physics::assembly::{Model, Volumetric};
use scindo_physics::element::ElementKind;
use scindo_physics::element::FixedCopy;
use scindo_physics::material::{Lame, Law};
use scindo_physics::mesh::{BoxPattern, box_hexes, box_mesh};

use crate::field::{consistent_load, l2_error};
use crate::support::{equilibrium, held, material};

use std::f64::consts::PI;

/// Size of the displacement [m] on the unit cube.
const AMPLITUDE: f64 = 0.05;

fn displacement(X: &Vector3<f64>) -> Vector3<f64> {
    let [x, y, z] = [X.x, X.y, X.z];
    AMPLITUDE
        * Vector3::new(
            (PI * x).sin() * (0.5 * PI * y).cos() + y * z,
            (0.5 * PI * z).sin() * (PI * x).cos(),
            (0.5 * PI * (x + y)).sin() * z,
        )
}

/// ∂u/∂X.
fn gradient(X: &Vector3<f64>) -> Matrix3<f64> {
    let [x, y, z] = [X.x, X.y, X.z];
    let (sum, half) = (0.5 * PI * (x + y), 0.5 * PI);
    let slope = half * sum.cos() * z;
    let rows = [
        [PI * (PI * x).cos() * (half * y).cos(), -half * (PI * x).sin() * (half * y).sin() + z, y],
        [-PI * (half * z).sin() * (PI * x).sin(), 0.0, half * (half * z).cos() * (PI * x).cos()],
        [slope, slope, sum.sin()],
    ];
    AMPLITUDE * Matrix3::from_fn(|i, j| rows[i][j])
}

/// Body force density b = −Div P(I + ∂u/∂X) [N/m³]; the derivative is a central difference of sixth
/// order, exact to about 1e-12.
fn body_force(law: Law, lame: Lame, X: &Vector3<f64>) -> Vector3<f64> {
    const H: f64 = 4e-3;
    let stress = |X: Vector3<f64>| law.stress(&(Matrix3::identity() + gradient(&X)), lame);
    let mut b = Vector3::zeros();
    for k in 0..3 {
        let difference = |steps: f64| {
            let step = steps * H * Vector3::ith(k, 1.0);
            (stress(X + step) - stress(X - step)).column(k).into_owned()
        };
        b -= (45.0 * difference(1.0) - 9.0 * difference(2.0) + difference(3.0)) / (60.0 * H);
    }
    b
}

fn model(kind: ElementKind, cells: usize, law: Law) -> Model {
    let material = material(1.0, 0.3, 1.0, law);
    let (low, high) = (Vector3::zeros(), Vector3::repeat(1.0));
    match kind {
        ElementKind::Tet4 => {
            Model::tet4(&box_mesh(low, high, [cells; 3], BoxPattern::Tet6), &material, Volumetric::Full)
        }
        ElementKind::Tet10 => Model::tet10(&box_mesh(low, high, [cells; 3], BoxPattern::Tet6), &material),
        ElementKind::Hex8 | ElementKind::Octree => {
            Model::hex8(&box_hexes(low, high, [cells; 3]), &material, Volumetric::Full)
        }
    }
    .unwrap()
}

fn error(kind: ElementKind, cells: usize, law: Law) -> f64 {
    let model = model(kind, cells, law);
    let exact: Vec<_> = model.rest().iter().map(|X| X + displacement(X)).collect();
    let outside = |X: &Vector3<f64>| X.iter().any(|c| *c < 1e-9 || *c > 1.0 - 1e-9);
    let fixed: Vec<FixedCopy> = (0..exact.len())
        .filter(|&n| outside(&model.rest()[n]))
        .map(|n| held(n, [true; 3], exact[n]))
        .collect();
    let load = consistent_load(&model, &|X| body_force(law, model.lame(), X));
    let x = equilibrium(&model, &load, &fixed, &exact);
    l2_error(&model, &x, &displacement)
}

fn assert_order(kind: ElementKind, law: Law, cells: [usize; 3], expected: f64) {
    let errors = cells.map(|n| error(kind, n, law));
    let order = |k: usize| (errors[k] / errors[k + 1]).ln() / (cells[k + 1] as f64 / cells[k] as f64).ln();
    println!("{kind:?} {law:?}: errors {errors:?} m, orders {:.3} {:.3}", order(0), order(1));
    assert!(order(1) > expected - 0.1 && order(1) < expected + 0.3, "{kind:?} {law:?}: {errors:?}");
}

#[test]
fn linear_tetrahedra_are_of_second_order() {
    assert_order(ElementKind::Tet4, Law::Linear, [3, 6, 12], 2.0);
    assert_order(ElementKind::Tet4, Law::NeoHookean, [3, 6, 12], 2.0);
}

#[test]
fn quadratic_tetrahedra_are_of_third_order() {
    assert_order(ElementKind::Tet10, Law::Linear, [2, 4, 8], 3.0);
    assert_order(ElementKind::Tet10, Law::StVenantKirchhoff, [2, 4, 8], 3.0);
}

#[test]
fn hexahedra_are_of_second_order() {
    assert_order(ElementKind::Hex8, Law::Linear, [4, 8, 16], 2.0);
    assert_order(ElementKind::Hex8, Law::Corotational, [4, 8, 16], 2.0);
}
