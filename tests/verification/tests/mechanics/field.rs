//! Integrals over the elements of a model: loads of a body force, errors of a solution.

use nalgebra::Vector3;
use scindo_physics::assembly::Model;
use scindo_physics::element::ElementKind;
use scindo_physics::element::{hex8, quadrature, tet10};

/// A point of an element: shape functions of its nodes, rest position [m], weight [m³].
struct Point {
    N: Vec<f64>,
    X: Vector3<f64>,
    w: f64,
}

/// Points of a rule of degree 5 on every element.
fn points(model: &Model, e: usize) -> Vec<Point> {
    let corners: Vec<Vector3<f64>> = model.element(e).iter().map(|&n| model.rest()[n as usize]).collect();
    let place = |N: &[f64]| N.iter().zip(&corners).map(|(n, X)| *n * X).sum::<Vector3<f64>>();
    let tet = |xi: &Vector3<f64>| vec![1.0 - xi.sum(), xi.x, xi.y, xi.z];
    match model.kind() {
        ElementKind::Tet4 | ElementKind::Tet10 => quadrature::tet_degree_5()
            .iter()
            .map(|(xi, w)| {
                let N = if model.kind() == ElementKind::Tet4 { tet(xi) } else { tet10::shape(xi).to_vec() };
                Point { X: place(&N), N, w: w * model.volume(e) }
            })
            .collect(),
        ElementKind::Hex8 | ElementKind::Octree => {
            let X: [Vector3<f64>; 8] = corners.clone().try_into().unwrap();
            quadrature::cube_gauss(3)
                .iter()
                .map(|(xi, w)| {
                    let N = hex8::shape(xi).to_vec();
                    Point { X: place(&N), N, w: w * hex8::jacobian(&X, xi).determinant() }
                })
                .collect()
        }
    }
}

/// f_a = ∫ N_a b dV [N] of a body force density b(X) [N/m³], for uncut models.
pub(crate) fn consistent_load(model: &Model, b: &dyn Fn(&Vector3<f64>) -> Vector3<f64>) -> Vec<Vector3<f64>> {
    let mut f = vec![Vector3::zeros(); model.n_nodes()];
    for e in 0..model.n_elements() {
        for point in points(model, e) {
            let b = point.w * b(&point.X);
            for (&n, N) in model.element(e).iter().zip(&point.N) {
                f[n as usize] += *N * b;
            }
        }
    }
    f
}

/// √∫ ‖u_h − u‖² dV [m^5/2] of the solution at positions `x` [m].
pub(crate) fn l2_error(model: &Model, x: &[Vector3<f64>], u: &dyn Fn(&Vector3<f64>) -> Vector3<f64>) -> f64 {
    let mut sum = 0.0;
    for e in 0..model.n_elements() {
        for point in points(model, e) {
            let found: Vector3<f64> = model
                .element(e)
                .iter()
                .zip(&point.N)
                .map(|(&n, N)| *N * (x[n as usize] - model.rest()[n as usize]))
                .sum();
            sum += point.w * (found - u(&point.X)).norm_squared();
        }
    }
    sum.sqrt()
}
