//! Linear elasticity: ψ = μ ε:ε + λ/2 tr²ε with ε = sym F − I.
//!
//! # Source
//! Hooke's law in Lamé form; any text on linear elasticity.

use nalgebra::Matrix3;

use super::{Lame, Matrix9};

/// The small-strain law. It is not objective: a rotation alone causes stress.
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

    /// ∂P/∂F = 2μ sym + λ I⊗I [Pa], the same for every F and positive semidefinite.
    pub fn tangent(&self) -> Matrix9 {
        let Lame { mu, lambda } = self.0;
        Matrix9::from_fn(|m, n| {
            let (i, j, k, l) = (m % 3, m / 3, n % 3, n / 3);
            let delta = |a: usize, b: usize| f64::from(u8::from(a == b));
            mu * (delta(i, k) * delta(j, l) + delta(i, l) * delta(j, k)) + lambda * delta(i, j) * delta(k, l)
        })
    }

    /// θ = tr ε [1], the change of volume to first order in the strain.
    pub fn theta(F: &Matrix3<f64>) -> f64 {
        F.trace() - 3.0
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
            assert_triad(&F, |F| law.energy(F), |F| law.stress(F), |_| law.tangent());
        }
    }
}
