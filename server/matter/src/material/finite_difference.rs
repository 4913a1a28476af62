//! Central differences of energy and stress, for the tests of the laws.

use nalgebra::{Matrix3, Rotation3, Vector3};

use super::Matrix9;

/// Deformation gradients: rest, stretched and rotated, strongly compressed, inverted, nearly flat, with
/// repeated stretches, and with one stretch just beside a repeated one.
pub(super) fn samples() -> Vec<Matrix3<f64>> {
    let turned = Rotation3::new(Vector3::new(0.4, -1.1, 0.7)).into_inner();
    let sheared = Matrix3::new(1.2, 0.3, -0.1, 0.05, 0.8, 0.2, -0.3, 0.1, 1.1);
    let stretches = |a, b, c| Matrix3::from_diagonal(&Vector3::new(a, b, c));
    vec![
        Matrix3::identity(),
        sheared,
        turned * sheared,
        turned * stretches(0.2, 0.5, 0.7),
        turned * stretches(1.3, 0.9, -0.4) * turned,
        turned * stretches(1.4, 0.6, -0.5),
        stretches(1.1, 0.9, 1e-6),
        turned * stretches(0.5, 0.5, 0.5) * turned,
        turned * stretches(1.2, 1.2, 0.3) * turned,
        turned * stretches(1.2, 1.2 + 1e-9, 0.4) * turned,
        turned * stretches(20.0, 1.0, 1.0) * turned.transpose(),
    ]
}

/// Compares P with differences of ψ, and ∂P/∂F with differences of P, at F.
pub(super) fn assert_triad(
    F: &Matrix3<f64>,
    energy: impl Fn(&Matrix3<f64>) -> f64,
    stress: impl Fn(&Matrix3<f64>) -> Matrix3<f64>,
    tangent: impl Fn(&Matrix3<f64>) -> Matrix9,
) {
    assert_triad_within(F, 1e-5, 1e-6, energy, stress, tangent);
}

/// The same with differences over ±`h` and a tolerance relative to 1 + size.
pub(super) fn assert_triad_within(
    F: &Matrix3<f64>,
    h: f64,
    bound: f64,
    energy: impl Fn(&Matrix3<f64>) -> f64,
    stress: impl Fn(&Matrix3<f64>) -> Matrix3<f64>,
    tangent: impl Fn(&Matrix3<f64>) -> Matrix9,
) {
    let (psi, P, dP) = (energy(F), stress(F), tangent(F));
    assert!((dP - dP.transpose()).norm() < 1e-9 * (1.0 + dP.norm()), "tangent not symmetric at {F}");
    // Round-off in the differences themselves.
    let noise = 4e-16 * (1.0 + psi.abs()) / h;
    for n in 0..9 {
        let mut dF = Matrix3::zeros();
        dF[n] = h;
        let dpsi = (energy(&(F + dF)) - energy(&(F - dF))) / (2.0 * h);
        assert!((dpsi - P[n]).abs() < 0.1 * bound * (1.0 + P.norm()) + noise, "P at {F}: {dpsi} {P}");
        let differences = (stress(&(F + dF)) - stress(&(F - dF))) / (2.0 * h);
        let column = Matrix3::from_column_slice(dP.column(n).into_owned().as_slice());
        assert!(
            (differences - column).norm() < bound * (1.0 + dP.norm()) + noise,
            "dP/dF_{n} at {F}: {differences} {column}"
        );
    }
}
