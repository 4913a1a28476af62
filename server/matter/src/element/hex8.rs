//! The trilinear hexahedron with eight nodes: corner c = a + 2 b + 4 d, with a, b, d ∈ {0, 1} along
//! the reference axes of [−1, 1]³.
//!
//! # Source
//! Hughes 2000, *The Finite Element Method*, ch. 3; selective reduced integration: Malkus, Hughes 1978.

use nalgebra::{Matrix3, Vector3};

use super::quadrature::cube_gauss;

/// Reference coordinates of corner `c`.
pub fn corner(c: usize) -> Vector3<f64> {
    let sign = |bit: usize| if (c >> bit) & 1 == 1 { 1.0 } else { -1.0 };
    Vector3::new(sign(0), sign(1), sign(2))
}

/// Shape functions at ξ: ⅛ (1 ± ξ)(1 ± η)(1 ± ζ).
pub fn shape(xi: &Vector3<f64>) -> [f64; 8] {
    std::array::from_fn(|c| {
        let s = corner(c);
        0.125 * (1.0 + s.x * xi.x) * (1.0 + s.y * xi.y) * (1.0 + s.z * xi.z)
    })
}

/// ∂N_a/∂ξ at ξ.
pub fn reference_gradients(xi: &Vector3<f64>) -> [Vector3<f64>; 8] {
    std::array::from_fn(|c| {
        let s = corner(c);
        let f = Vector3::new(1.0 + s.x * xi.x, 1.0 + s.y * xi.y, 1.0 + s.z * xi.z);
        0.125 * Vector3::new(s.x * f.y * f.z, s.y * f.z * f.x, s.z * f.x * f.y)
    })
}

/// J = ∂X/∂ξ [m] at ξ of the element with corners `X` [m].
pub fn jacobian(X: &[Vector3<f64>; 8], xi: &Vector3<f64>) -> Matrix3<f64> {
    let d = reference_gradients(xi);
    (0..8).fold(Matrix3::zeros(), |J, c| J + X[c] * d[c].transpose())
}

/// Gradients ∇N_a [1/m] at ξ, and det J [m³]. `None` where J is singular.
pub fn gradients(X: &[Vector3<f64>; 8], xi: &Vector3<f64>) -> Option<([Vector3<f64>; 8], f64)> {
    let J = jacobian(X, xi);
    let inverse = J.try_inverse()?.transpose();
    Some((reference_gradients(xi).map(|d| inverse * d), J.determinant()))
}

/// ∫ N_a N_b dV [m³], by 3×3×3 Gauss points (exact on parallelepipeds).
pub fn shape_products(X: &[Vector3<f64>; 8]) -> [[f64; 8]; 8] {
    let mut M = [[0.0; 8]; 8];
    for (xi, w) in cube_gauss(3) {
        let (N, volume) = (shape(&xi), w * jacobian(X, &xi).determinant());
        for a in 0..8 {
            for b in 0..8 {
                M[a][b] += volume * N[a] * N[b];
            }
        }
    }
    M
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn distorted() -> [Vector3<f64>; 8] {
        std::array::from_fn(|c| {
            let k = c as f64;
            corner(c) + 0.15 * Vector3::new((3.0 * k).sin(), (5.0 * k).cos(), (7.0 * k).sin())
        })
    }

    #[test]
    fn shape_functions_are_one_at_their_node() {
        for c in 0..8 {
            for (b, N) in shape(&corner(c)).into_iter().enumerate() {
                assert!((N - f64::from(b == c)).abs() < 1e-15);
            }
        }
    }

    #[test]
    fn gradients_of_linear_fields_are_exact() {
        let X = distorted();
        let A = Matrix3::new(1.0, 0.2, 0.3, -0.4, 0.9, 0.1, 0.2, 0.5, 1.3);
        for (xi, _) in cube_gauss(2) {
            let (g, volume) = gradients(&X, &xi).unwrap();
            let F = (0..8).fold(Matrix3::zeros(), |F, c| F + A * X[c] * g[c].transpose());
            assert!((F - A).norm() < 1e-14 && volume > 0.0);
        }
    }

    #[test]
    fn products_of_a_box_are_tensor_products() {
        let X: [Vector3<f64>; 8] =
            std::array::from_fn(|c| corner(c).component_mul(&Vector3::new(0.5, 1.0, 1.5)));
        let M = shape_products(&X);
        // ∫ over a line of unit length is 1/3 for the same node and 1/6 for the other.
        for a in 0..8_usize {
            for b in 0..8 {
                let same = 3 - (a ^ b).count_ones() as i32;
                let exact = 6.0 * (2.0_f64.powi(same) / 216.0);
                assert!((M[a][b] - exact).abs() < 1e-14);
            }
        }
    }
}
