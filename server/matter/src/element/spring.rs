//! The spring: a one-dimensional element between two nodes.

use nalgebra::{Matrix3, Vector3};

use crate::material::Tangent;

/// A spring shorter than this fraction of its rest length has no direction.
const NO_DIRECTION: f64 = 1e-12;

/// A linear spring along the line between two nodes: ψ = k/2 (l − L)² \[J\].
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Spring {
    /// First node.
    pub a: u32,
    /// Second node.
    pub b: u32,
    /// Stiffness k [N/m], ≥ 0.
    pub stiffness_n_m: f64,
    /// Rest length L [m], ≥ 0.
    pub rest_length_m: f64,
}

impl Spring {
    /// Unit direction from `xa` to `xb`, and the length [m]. Coinciding ends have no direction.
    fn direction(&self, xa: &Vector3<f64>, xb: &Vector3<f64>) -> (Vector3<f64>, f64) {
        let d = xb - xa;
        let length = d.norm();
        if length > NO_DIRECTION * self.rest_length_m {
            (d / length, length)
        } else {
            (Vector3::zeros(), length)
        }
    }

    /// k/2 (l − L)² \[J\].
    pub fn energy(&self, xa: &Vector3<f64>, xb: &Vector3<f64>) -> f64 {
        0.5 * self.stiffness_n_m * (self.direction(xa, xb).1 - self.rest_length_m).powi(2)
    }

    /// ∂ψ/∂x_b = k (l − L) n [N]. The force at the other end is its negative.
    pub fn force(&self, xa: &Vector3<f64>, xb: &Vector3<f64>) -> Vector3<f64> {
        let (n, length) = self.direction(xa, xb);
        self.stiffness_n_m * (length - self.rest_length_m) * n
    }

    /// ∂²ψ/∂x_b² = k n nᵀ + k (1 − L/l)(I − n nᵀ) [N/m]. The second part is negative for a compressed spring
    /// and is then omitted, unless the tangent is [`Tangent::Exact`].
    pub fn stiffness(&self, xa: &Vector3<f64>, xb: &Vector3<f64>, kind: Tangent) -> Matrix3<f64> {
        let (n, length) = self.direction(xa, xb);
        let along = n * n.transpose();
        if n == Vector3::zeros() {
            return along;
        }
        let across = 1.0 - self.rest_length_m / length;
        let across = match kind {
            Tangent::Exact => across,
            Tangent::Projected => across.max(0.0),
            Tangent::Held => 0.0,
        };
        self.stiffness_n_m * (along + across * (Matrix3::identity() - along))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPRING: Spring = Spring { a: 0, b: 1, stiffness_n_m: 7.0, rest_length_m: 1.5 };

    #[test]
    fn triad_agrees_with_finite_differences() {
        let (xa, h) = (Vector3::new(0.1, 0.2, 0.3), 1e-6);
        for xb in [Vector3::new(1.0, -0.5, 2.0), Vector3::new(0.2, 0.6, 0.1)] {
            for i in 0..3 {
                let step = h * Vector3::ith(i, 1.0);
                let (above, below) = (xb + step, xb - step);
                let slope = (SPRING.energy(&xa, &above) - SPRING.energy(&xa, &below)) / (2.0 * h);
                assert!((slope - SPRING.force(&xa, &xb)[i]).abs() < 1e-8);
                let column = (SPRING.force(&xa, &above) - SPRING.force(&xa, &below)) / (2.0 * h);
                assert!((column - SPRING.stiffness(&xa, &xb, Tangent::Exact).column(i)).norm() < 1e-7);
            }
            for kind in [Tangent::Projected, Tangent::Held] {
                assert!(SPRING.stiffness(&xa, &xb, kind).symmetric_eigenvalues().min() > -1e-14);
            }
        }
    }

    #[test]
    fn coinciding_ends_stay_finite() {
        let x = Vector3::repeat(0.4);
        assert_eq!(SPRING.force(&x, &x), Vector3::zeros());
        for kind in [Tangent::Exact, Tangent::Projected, Tangent::Held] {
            assert_eq!(SPRING.stiffness(&x, &x, kind), Matrix3::zeros());
        }
    }
}
