//! The linear tetrahedron in double precision. It is the reference for the fast kernels, and computes
//! energies, reactions and static residuals.

use nalgebra::{Matrix3, Vector3};

use crate::material::{Lame, Law};

/// The six edges of a tetrahedron as pairs of local node numbers.
pub const TET_EDGES: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];

/// F = Σ_a x_a ⊗ g_a [1] of an element with its nodes at `x` [m] and rest gradients `g` [1/m], from differences
/// to the first node so that rigid shifts cancel exactly.
#[inline]
pub fn deformation_gradient<const N: usize>(x: &[Vector3<f64>; N], g: &[Vector3<f64>]) -> Matrix3<f64> {
    let mut F = Matrix3::zeros();
    for a in 1..N {
        F += (x[a] - x[0]) * g[a].transpose();
    }
    F
}

/// Elastic energy w V ψ(F) [J] of a piece of volume `volume_m3` = w V.
pub fn piece_energy(law: Law, lame: Lame, F: &Matrix3<f64>, volume_m3: f64) -> f64 {
    volume_m3 * law.energy(F, lame)
}

/// Internal forces f_a = w V P g_a [N] of a piece. They are subtracted from the loads.
pub fn piece_forces(stress: &Matrix3<f64>, g: &[Vector3<f64>; 4], volume_m3: f64) -> [Vector3<f64>; 4] {
    let f = [1, 2, 3].map(|a| volume_m3 * (stress * g[a]));
    [-(f[0] + f[1] + f[2]), f[0], f[1], f[2]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{tet_gradients, tet_volume};

    const REST: [Vector3<f64>; 4] = [
        Vector3::new(0.1, 0.0, 0.0),
        Vector3::new(1.0, 0.2, 0.1),
        Vector3::new(0.0, 1.1, 0.0),
        Vector3::new(0.2, 0.1, 0.9),
    ];

    #[test]
    fn affine_maps_are_recovered() {
        let A = Matrix3::new(1.2, 0.3, -0.1, 0.05, 0.8, 0.2, -0.3, 0.1, 1.1);
        let F = deformation_gradient(&REST.map(|X| A * X + Vector3::repeat(5.0)), &tet_gradients(&REST));
        assert!((F - A).norm() < 1e-13);
    }

    #[test]
    fn forces_are_the_gradient_of_the_energy() {
        let (law, lame) = (Law::Corotational, Lame { mu: 2.0, lambda: 3.0 });
        let (g, volume) = (tet_gradients(&REST), tet_volume(&REST));
        let mut x = REST.map(|X| Vector3::new(1.3 * X.y, -X.x + 0.2 * X.z, X.z * X.z));
        let energy = |x: &[Vector3<f64>; 4]| {
            let F = deformation_gradient(x, &g);
            piece_energy(law, lame, &F, volume)
        };
        let F = deformation_gradient(&x, &g);
        let f = piece_forces(&law.stress(&F, lame), &g, volume);
        let h = 1e-6;
        for a in 0..4 {
            for i in 0..3 {
                x[a][i] += h;
                let above = energy(&x);
                x[a][i] -= 2.0 * h;
                let below = energy(&x);
                x[a][i] += h;
                assert!(((above - below) / (2.0 * h) - f[a][i]).abs() < 1e-8);
            }
        }
    }
}
