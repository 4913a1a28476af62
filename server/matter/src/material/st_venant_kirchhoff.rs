//! St. Venant–Kirchhoff elasticity, ψ = μ E:E + λ/2 tr²E with E = ½(FᵀF − I), made invertible.
//!
//! The plain law has a uniaxial stiffness ∝ 3σ² − 1, which turns negative at σ = 1/√3, and its mirror image σ
//! = −1 has no energy: an inverted element stays inverted. Below a stretch σ_c the energy is therefore
//! continued so that the stress passes linearly through σ = 0 and pushes every element back. Above σ_c
//! nothing changes.
//!
//! # Source
//! Irving, Teran, Fedkiw 2004, "Invertible finite elements for robust simulation of large
//! deformation"; as an energy: Stomakhin, Howes, Schroeder, Teran 2012, "Energetically consistent
//! invertible elasticity".
//!
//! # Derivation
//! In principal stretches ψ = μ Σ g(σ_i) + λ/2 (Σ e(σ_i))² with e = (σ² − 1)/2 and g = e². Below σ_c, g
//! continues as its second-order Taylor polynomial. e continues as a straight line, reached over a width w in
//! which e″ falls from 1 to 0. g″ and e′² are positive there, so ψ is convex in every stretch, and twice
//! continuously differentiable across σ_c.

use nalgebra::{Matrix3, Vector3};

use super::principal::{PAIRS, Principal};
use super::{Lame, Matrix9, SignedSvd, Tangent};

/// The law, and the stretch below which it is continued.
#[derive(Clone, Copy, Debug)]
pub struct StVenantKirchhoff {
    /// Elastic constants.
    pub lame: Lame,
    /// σ_c [1]; `f64::NEG_INFINITY` gives the plain law.
    pub continued_below: f64,
}

/// σ_c, where the plain uniaxial stiffness (3σ² − 1)/2 is still positive.
const CONTINUED_BELOW: f64 = 0.65;

/// w [1], the width over which e straightens.
const STRAIGHTENS_OVER: f64 = 0.12;

/// Distance of two stretches below which their difference quotient is replaced by its limit.
const SAME: f64 = 1e-6;

/// A function of one stretch with its first two derivatives.
type Jet = [f64; 3];

impl StVenantKirchhoff {
    /// The law continued below σ_c = 0.65.
    pub fn invertible(lame: Lame) -> Self {
        Self { lame, continued_below: CONTINUED_BELOW }
    }

    /// The law as published. It does not recover from inversion.
    pub fn plain(lame: Lame) -> Self {
        Self { lame, continued_below: f64::NEG_INFINITY }
    }

    /// ψ [J/m³].
    pub fn energy(&self, F: &Matrix3<f64>) -> f64 {
        if let Some(E) = self.untouched(F) {
            return self.lame.mu * E.norm_squared() + 0.5 * self.lame.lambda * E.trace().powi(2);
        }
        let sigma = SignedSvd::new(F).sigma;
        let volume = sigma.map(|s| self.green(s)[0]).sum();
        self.lame.mu * sigma.map(|s| self.green_squared(s)[0]).sum()
            + 0.5 * self.lame.lambda * volume * volume
    }

    /// P = F (2μ E + λ tr(E) I) [Pa] where no stretch is below σ_c.
    pub fn stress(&self, F: &Matrix3<f64>) -> Matrix3<f64> {
        if let Some(E) = self.untouched(F) {
            return F
                * (2.0 * self.lame.mu * E + Matrix3::from_diagonal_element(self.lame.lambda * E.trace()));
        }
        let svd = SignedSvd::new(F);
        self.principal(&svd.sigma).gradient(&svd)
    }

    /// ∂P/∂F [Pa].
    pub fn tangent(&self, F: &Matrix3<f64>, kind: Tangent) -> Matrix9 {
        let svd = SignedSvd::new(F);
        let principal = self.principal(&svd.sigma);
        match kind {
            Tangent::Exact => principal.hessian(&svd),
            Tangent::Projected | Tangent::Held => principal.projected().hessian(&svd),
        }
    }

    /// E = ½(FᵀF − I), if no decomposition is needed to know that every stretch is above σ_c.
    fn untouched(&self, F: &Matrix3<f64>) -> Option<Matrix3<f64>> {
        let E = 0.5 * (F.transpose() * F - Matrix3::identity());
        // Every eigenvalue (σ² − 1)/2 of E is at least −‖E‖.
        let least_square = 1.0 - 2.0 * E.norm();
        let limit = self.continued_below;
        let above = least_square > limit.max(0.0).powi(2) && F.determinant() > 0.0;
        (above || limit == f64::NEG_INFINITY).then_some(E)
    }

    /// e(σ) = (σ² − 1)/2. Below σ_c it bends into a straight line.
    fn green(&self, sigma: f64) -> Jet {
        let t = self.continued_below - sigma;
        if t <= 0.0 || t.is_nan() {
            return [0.5 * (sigma * sigma - 1.0), sigma, 1.0];
        }
        let (c, w) = (self.continued_below, STRAIGHTENS_OVER);
        let start = 0.5 * (c * c - 1.0);
        let u = t.min(w);
        let slope = c - u + 0.5 * u * u / w;
        let curved = start - c * u + 0.5 * u * u - u * u * u / (6.0 * w);
        [curved - slope * (t - u), slope, 1.0 - u / w]
    }

    /// g(σ) = e², below σ_c its Taylor polynomial of second order.
    fn green_squared(&self, sigma: f64) -> Jet {
        let s = if sigma < self.continued_below { self.continued_below } else { sigma };
        let d = sigma - s;
        let e = 0.5 * (s * s - 1.0);
        let (slope, curvature) = (2.0 * e * s, 2.0 * (e + s * s));
        [e * e + slope * d + 0.5 * curvature * d * d, slope + curvature * d, curvature]
    }

    fn principal(&self, sigma: &Vector3<f64>) -> Principal {
        let Lame { mu, lambda } = self.lame;
        let (e, g) = (sigma.map(|s| self.green(s)), sigma.map(|s| self.green_squared(s)));
        let volume = e[0][0] + e[1][0] + e[2][0];
        let first = |i: usize| mu * g[i][1] + lambda * volume * e[i][1];
        let second = |i: usize| mu * g[i][2] + lambda * volume * e[i][2];
        let scaling =
            Matrix3::from_fn(|i, j| lambda * e[i][1] * e[j][1] + if i == j { second(i) } else { 0.0 });
        let (mut twist, mut flip) = (Vector3::zeros(), Vector3::zeros());
        for (k, (i, j)) in PAIRS.into_iter().enumerate() {
            let (a, b) = (sigma[i], sigma[j]);
            if a >= self.continued_below && b >= self.continued_below {
                twist[k] = lambda * volume + mu * (a * a - a * b + b * b - 1.0);
                flip[k] = lambda * volume + mu * (a * a + a * b + b * b - 1.0);
            } else {
                twist[k] = (first(i) + first(j)) / (a + b).max(SAME);
                let apart = (a - b).abs() > SAME;
                flip[k] = if apart { (first(i) - first(j)) / (a - b) } else { 0.5 * (second(i) + second(j)) };
            }
        }
        Principal { slope: Vector3::new(first(0), first(1), first(2)), scaling, twist, flip }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::finite_difference::{assert_triad, samples};
    use nalgebra::Rotation3;

    const LAME: Lame = Lame { mu: 1.3, lambda: 2.1 };

    #[test]
    fn triads_agree_with_finite_differences() {
        for law in [StVenantKirchhoff::plain(LAME), StVenantKirchhoff::invertible(LAME)] {
            for F in samples() {
                assert_triad(&F, |F| law.energy(F), |F| law.stress(F), |F| law.tangent(F, Tangent::Exact));
            }
        }
    }

    #[test]
    fn principal_form_is_the_same_law() {
        let turned = Rotation3::new(Vector3::new(0.4, -1.1, 0.7)).into_inner();
        for sigma in [Vector3::new(1.2, 0.9, 0.7), Vector3::new(0.66, 0.66, 0.66)] {
            let F = turned * Matrix3::from_diagonal(&sigma) * turned;
            let (law, plain) = (StVenantKirchhoff::invertible(LAME), StVenantKirchhoff::plain(LAME));
            let svd = SignedSvd::new(&F);
            assert!((law.principal(&svd.sigma).gradient(&svd) - plain.stress(&F)).norm() < 1e-13);
            assert!((law.energy(&F) - plain.energy(&F)).abs() < 1e-14);
        }
    }

    /// ψ, P and ∂P/∂F are continuous at σ_c.
    #[test]
    fn twice_continuous_where_the_continuation_begins() {
        let law = StVenantKirchhoff::invertible(LAME);
        let at = |sigma: f64| Matrix3::from_diagonal(&Vector3::new(1.1, 0.6, sigma));
        let (above, below) = (at(0.65 + 1e-9), at(0.65 - 1e-9));
        assert!((law.energy(&above) - law.energy(&below)).abs() < 1e-8);
        assert!((law.stress(&above) - law.stress(&below)).norm() < 1e-7);
        let jump = law.tangent(&above, Tangent::Exact) - law.tangent(&below, Tangent::Exact);
        assert!(jump.norm() < 1e-7, "{jump}");
    }

    /// Slope 3σ² − 1 in uniaxial strain, no force at σ = 0, and the mirror image at rest.
    #[test]
    fn plain_law_has_the_known_defects() {
        let law = StVenantKirchhoff::plain(LAME);
        let uniaxial = |sigma: f64| Matrix3::from_diagonal(&Vector3::new(sigma, 1.0, 1.0));
        for sigma in [1.3, 1.0, 1.0 / 3f64.sqrt(), 0.2, 0.0, -1.0] {
            let stiffness = law.tangent(&uniaxial(sigma), Tangent::Exact)[(0, 0)];
            let expected = 0.5 * (2.0 * LAME.mu + LAME.lambda) * (3.0 * sigma * sigma - 1.0);
            assert!((stiffness - expected).abs() < 1e-12);
        }
        assert!(law.stress(&uniaxial(0.0))[(0, 0)].abs() < 1e-15);
        assert!(law.stress(&uniaxial(-1.0)).norm() < 1e-15 && law.energy(&uniaxial(-1.0)).abs() < 1e-15);
    }

    /// Through σ = 0 and beyond the continued law pulls every axis back towards rest.
    #[test]
    fn continued_law_pushes_inverted_elements_back() {
        for lambda in [0.0, 1.3, 6.0, 60.0] {
            let law = StVenantKirchhoff::invertible(Lame { mu: 1.3, lambda });
            for (side, sigma) in [0.6, 0.3, 0.0, -0.3, -0.6, -1.0]
                .map(|sigma: f64| [(1.0, sigma), (sigma.abs(), sigma)])
                .concat()
            {
                let F = Matrix3::from_diagonal(&Vector3::new(side, side, sigma));
                assert!(law.stress(&F)[(2, 2)] < -0.1, "λ {lambda} σ {sigma}: {}", law.stress(&F));
            }
            let collapsed = law.stress(&Matrix3::zeros());
            assert!((0..3).all(|i| collapsed[(i, i)] < -0.1));
        }
    }
}
