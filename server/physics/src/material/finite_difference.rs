//! Central differences of a triad, for the tests of the laws.

use nalgebra::{Matrix3, Rotation3, Vector3};

/// Deformation gradients: rest, stretched and turned, strongly compressed, inverted, nearly flat.
pub fn samples() -> Vec<Matrix3<f64>> {
    let turned = Rotation3::new(Vector3::new(0.4, -1.1, 0.7)).into_inner();
    let sheared = Matrix3::new(1.2, 0.3, -0.1, 0.05, 0.8, 0.2, -0.3, 0.1, 1.1);
    vec![
        Matrix3::identity(),
        sheared,
        turned * sheared,
        turned * Matrix3::from_diagonal(&Vector3::new(0.2, 0.5, 0.7)),
        turned * Matrix3::from_diagonal(&Vector3::new(1.3, 0.9, -0.4)) * turned,
        Matrix3::from_diagonal(&Vector3::new(1.1, 0.9, 1e-6)),
    ]
}

/// Holds P against ∂ψ/∂F and dP against ∂P/∂F : dF at F.
pub fn assert_triad(
    F: &Matrix3<f64>,
    energy: impl Fn(&Matrix3<f64>) -> f64,
    stress: impl Fn(&Matrix3<f64>) -> Matrix3<f64>,
    tangent: impl Fn(&Matrix3<f64>, &Matrix3<f64>) -> Matrix3<f64>,
) {
    let h = 1e-5;
    let P = stress(F);
    for i in 0..3 {
        for j in 0..3 {
            let mut dF = Matrix3::zeros();
            dF[(i, j)] = 1.0;
            let dpsi = (energy(&(F + h * dF)) - energy(&(F - h * dF))) / (2.0 * h);
            assert!((dpsi - P[(i, j)]).abs() < 1e-7 * (1.0 + P.norm()), "P at {F}: {dpsi} {P}");
            let differences = (stress(&(F + h * dF)) - stress(&(F - h * dF))) / (2.0 * h);
            let dP = tangent(F, &dF);
            assert!((differences - dP).norm() < 1e-6 * (1.0 + dP.norm()), "dP at {F}: {differences} {dP}");
        }
    }
}
