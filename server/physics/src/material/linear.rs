//! Linear elasticity: ψ = μ ε:ε + λ/2 tr²ε with ε = sym F − I.
//!
//! # Source
//! Hooke's law in Lamé form; any text on linear elasticity.

use nalgebra::Matrix3;

use super::Lame;

/// The small-strain law. Not objective: a rotation alone gives stress.
#[derive(Clone, Copy, Debug)]
pub struct Linear(
    /// Elastic constants.
    pub Lame,
);

impl Linear {
    fn strain(F: &Matrix3<f64>) -> Matrix3<f64> {
        0.5 * (F + F.transpose()) - Matrix3::identity()
    }

    /// ψ = μ ε:ε + λ/2 tr²ε [J/m³].
    pub fn energy(&self, F: &Matrix3<f64>) -> f64 {
        let eps = Self::strain(F);
        self.0.mu * eps.norm_squared() + 0.5 * self.0.lambda * eps.trace().powi(2)
    }

    /// P = 2μ ε + λ tr(ε) I [Pa].
    pub fn stress(&self, F: &Matrix3<f64>) -> Matrix3<f64> {
        let eps = Self::strain(F);
        2.0 * self.0.mu * eps + Matrix3::from_diagonal_element(self.0.lambda * eps.trace())
    }

    /// dP = 2μ sym dF + λ tr(dF) I [Pa], the same for every F.
    pub fn tangent(&self, dF: &Matrix3<f64>) -> Matrix3<f64> {
        self.0.mu * (dF + dF.transpose()) + Matrix3::from_diagonal_element(self.0.lambda * dF.trace())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::finite_difference::{assert_triad, samples};

    #[test]
    fn triad_agrees_with_finite_differences() {
        let law = Linear(Lame { mu: 1.3, lambda: 2.1 });
        for F in samples() {
            assert_triad(&F, |F| law.energy(F), |F| law.stress(F), |_, dF| law.tangent(dF));
        }
    }
}
