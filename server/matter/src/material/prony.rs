//! Viscoelasticity: Maxwell elements (terms of a Prony series) beside the elastic law.
//!
//! Tissue that is held stretched relaxes, and under a constant load it creeps. The body's own law is what remains after a
//! long time. Every term adds a spring and a dashpot in series: a spring of gᵢ times the shear modulus μ, whose
//! strain dᵢ fades with the relaxation time τᵢ,
//!
//!   ḋᵢ = ė − dᵢ/τᵢ,   S = 2μ Σ gᵢ dᵢ,
//!
//! so a shear that is applied suddenly meets the modulus μ (1 + Σ gᵢ), and held it relaxes as
//! μ(t) = μ (1 + Σ gᵢ exp(−t/τᵢ)). e is the deviator of the strain: of the small strain in the linear law, of the Green
//! strain in the others, so that rotations stretch nothing. Changes of volume stay elastic.
//!
//! In a step of h [s] along which e changes evenly, dᵢ ends exactly at exp(−h/τᵢ) dᵢ + rᵢ (e⁺ − e) with
//! rᵢ = (1 − exp(−h/τᵢ)) τᵢ/h. The stress at the end is then that of one spring, 2μG (e⁺ − ē) with G = Σ gᵢ rᵢ, which is
//! at rest at the strain ē that the step begins with. Its energy μG |e⁺ − ē|² is convex in the strain, and the step stays
//! the minimum of a potential.
//!
//! # Source
//! Taylor, Pister, Goudreau 1970, "Thermomechanical analysis of viscoelastic solids" (the recursion); Simo 1987, "On a
//! fully three-dimensional finite-strain viscoelastic damage model" (deviatoric terms beside an elastic law); Ortiz,
//! Stainier 1999 (steps of inelastic solids as minima).

use std::ops::RangeInclusive;

use nalgebra::{Matrix3, SMatrix};

use super::{Law, MaterialError, Matrix9, Tangent, within};

/// Most terms of a body.
pub const MAX_PRONY: usize = 3;

/// A symmetric strain: xx, yy, zz, yz, xz, xy.
pub type Strain = [f64; 6];

/// One Maxwell element.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct PronyTerm {
    /// g: the shear modulus of its spring over that of the body.
    pub ratio: f64,
    /// τ [s]: time in which its stress falls to 1/e.
    pub time_s: f64,
}

/// The terms of a body.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Prony([Option<PronyTerm>; MAX_PRONY]);

impl Prony {
    /// Range of the ratio g.
    pub const RATIO: RangeInclusive<f64> = 0.0..=1e3;
    /// Range of the relaxation time τ [s].
    pub const TIME_S: RangeInclusive<f64> = 1e-6..=1e9;

    /// At most [`MAX_PRONY`] terms; further ones are left out.
    pub fn new(terms: impl IntoIterator<Item = PronyTerm>) -> Self {
        let mut prony = Self::default();
        prony.0.iter_mut().zip(terms).for_each(|(place, term)| *place = Some(term));
        prony
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.0[0].is_none()
    }

    /// Number of terms.
    pub fn len(&self) -> usize {
        self.iter().count()
    }

    /// The terms.
    pub fn iter(&self) -> impl Iterator<Item = &PronyTerm> {
        self.0.iter().flatten()
    }

    /// Checks that every constant is finite and in its range.
    ///
    /// # Errors
    /// The first that is not.
    pub fn check(&self) -> Result<(), MaterialError> {
        for term in self.iter() {
            within("prony.ratio", term.ratio, Self::RATIO)?;
            within("prony.time_s", term.time_s, Self::TIME_S)?;
        }
        Ok(())
    }

    /// The deviator e of the strain that relaxes.
    pub fn strain(law: Law, F: &Matrix3<f64>) -> Strain {
        let E = match law {
            Law::Linear => 0.5 * (F + F.transpose()) - Matrix3::identity(),
            _ => 0.5 * (F.transpose() * F - Matrix3::identity()),
        };
        let mean = E.trace() / 3.0;
        [E[(0, 0)] - mean, E[(1, 1)] - mean, E[(2, 2)] - mean, E[(1, 2)], E[(0, 2)], E[(0, 1)]]
    }

    /// What of the strains is left after `h` [s], and what stays of a strain that grew evenly meanwhile: exp(−h/τ) and
    /// r of every term; 1 and 1 for h = 0.
    pub fn fading(&self, h: f64) -> impl Iterator<Item = [f64; 3]> + use<'_> {
        self.iter().map(move |term| {
            let x = h / term.time_s;
            let rate = if x > 0.0 { -(-x).exp_m1() / x } else { 1.0 };
            [term.ratio, (-x).exp(), rate]
        })
    }

    /// G = Σ g r of a step of `h` [s]: the stiffness of the terms over that of the body.
    pub fn stiffness(&self, h: f64) -> f64 {
        self.fading(h).map(|[ratio, _, rate]| ratio * rate).sum()
    }

    /// ē of a step of `h` [s] from the strain `e`, with the strains `d` of the springs then.
    pub fn start(&self, h: f64, e: &Strain, d: &[Strain]) -> Strain {
        let G = self.stiffness(h);
        let mut start = [0.0; 6];
        if G > 0.0 {
            for ([ratio, kept, rate], d) in self.fading(h).zip(d) {
                for (start, (e, d)) in start.iter_mut().zip(e.iter().zip(d)) {
                    *start += ratio * (rate * e - kept * d) / G;
                }
            }
        }
        start
    }

    /// Moves the strains `d` of the springs on by `h` [s], in which e grows by `growth`.
    pub fn advance(&self, h: f64, growth: &Strain, d: &mut [Strain]) {
        for ([_, kept, rate], d) in self.fading(h).zip(d) {
            for (d, growth) in d.iter_mut().zip(growth) {
                *d = kept * *d + rate * growth;
            }
        }
    }

    /// Energy density [J/m³] in springs with strains `d`, in a body of shear modulus `mu` [Pa].
    pub fn stored(&self, mu: f64, d: &[Strain]) -> f64 {
        self.iter().zip(d).map(|(term, d)| mu * term.ratio * square(d)).sum()
    }

    /// Σ g d of springs with strains `d`: their stress over 2μ.
    pub fn sum(&self, d: &[Strain]) -> Strain {
        let mut sum = [0.0; 6];
        for (term, d) in self.iter().zip(d) {
            sum.iter_mut().zip(d).for_each(|(sum, d)| *sum += term.ratio * d);
        }
        sum
    }
}

/// The springs of all terms in a step: one spring of modulus μG that is at rest at the strain ē.
#[derive(Clone, Copy, Debug)]
pub struct PronySpring {
    /// μG [Pa].
    pub modulus: f64,
    /// ē.
    pub start: Strain,
}

impl PronySpring {
    /// Energy density [J/m³] at F.
    pub fn energy(&self, law: Law, F: &Matrix3<f64>) -> f64 {
        self.modulus * square(&self.strain(law, F))
    }

    /// First Piola–Kirchhoff stress [Pa] at F.
    pub fn stress(&self, law: Law, F: &Matrix3<f64>) -> Matrix3<f64> {
        first_piola(law, F, &self.second_piola(law, F))
    }

    /// ∂P/∂F [Pa] with F stacked by columns; positive semidefinite unless it is [exact](Tangent::Exact).
    pub fn tangent(&self, law: Law, F: &Matrix3<f64>, kind: Tangent) -> Matrix9 {
        let identity = Matrix3::identity();
        // dE = ½ (AᵀdF + dFᵀA), with A = I in the linear law.
        let A = if law == Law::Linear { &identity } else { F };
        let mut strains = SMatrix::<f64, 9, 9>::zeros();
        for column in 0..9 {
            let mut dF = Matrix3::zeros();
            dF[column] = 1.0;
            let dE = 0.5 * (A.transpose() * dF + dF.transpose() * A);
            let dE = dE - Matrix3::from_diagonal_element(dE.trace() / 3.0);
            strains.column_mut(column).copy_from_slice(dE.as_slice());
        }
        let mut tangent = 2.0 * self.modulus * strains.transpose() * strains;
        if law != Law::Linear {
            let S = self.second_piola(law, F);
            let S = if kind == Tangent::Exact { S } else { semidefinite(&S) };
            for (column, row) in (0..3).flat_map(|j| (0..3).map(move |i| (i, j))) {
                for k in 0..3 {
                    tangent[(3 * row + k, 3 * column + k)] += S[(row, column)];
                }
            }
        }
        tangent
    }

    fn strain(&self, law: Law, F: &Matrix3<f64>) -> Strain {
        let mut strain = Prony::strain(law, F);
        strain.iter_mut().zip(&self.start).for_each(|(strain, start)| *strain -= start);
        strain
    }

    fn second_piola(&self, law: Law, F: &Matrix3<f64>) -> Matrix3<f64> {
        2.0 * self.modulus * matrix(&self.strain(law, F))
    }
}

/// First Piola–Kirchhoff stress of the second one, `S`; the same in the linear law.
pub fn first_piola(law: Law, F: &Matrix3<f64>, S: &Matrix3<f64>) -> Matrix3<f64> {
    if law == Law::Linear { *S } else { F * S }
}

/// A strain as a matrix.
pub fn matrix(&[xx, yy, zz, yz, xz, xy]: &Strain) -> Matrix3<f64> {
    Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
}

/// e:e.
fn square(&[xx, yy, zz, yz, xz, xy]: &Strain) -> f64 {
    xx * xx + yy * yy + zz * zz + 2.0 * (yz * yz + xz * xz + xy * xy)
}

/// The nearest positive semidefinite matrix; one that is not finite stays as it is.
fn semidefinite(S: &Matrix3<f64>) -> Matrix3<f64> {
    if !S.iter().all(|s| s.is_finite()) {
        return *S;
    }
    let eigen = S.symmetric_eigen();
    let kept = eigen.eigenvalues.map(|value| value.max(0.0));
    eigen.eigenvectors * Matrix3::from_diagonal(&kept) * eigen.eigenvectors.transpose()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use nalgebra::{Rotation3, Vector3};

    use super::super::finite_difference::{assert_triad, samples};
    use super::*;

    fn two() -> Prony {
        Prony::new([PronyTerm { ratio: 0.7, time_s: 0.2 }, PronyTerm { ratio: 1.5, time_s: 3.0 }])
    }

    #[test]
    fn stress_and_tangent_are_derivatives_of_the_energy() {
        let spring = PronySpring { modulus: 1.3, start: [0.1, -0.3, 0.2, 0.05, -0.2, 0.15] };
        for law in Law::ALL {
            for F in samples().iter().filter(|F| F.norm() < 5.0) {
                assert_triad(
                    F,
                    |F| spring.energy(law, F),
                    |F| spring.stress(law, F),
                    |F| spring.tangent(law, F, Tangent::Exact),
                );
            }
        }
    }

    #[test]
    fn definite_tangents_have_no_negative_eigenvalue() {
        let spring = PronySpring { modulus: 1.3, start: [0.9, -0.3, -0.6, 0.05, -0.2, 0.15] };
        let mut indefinite = 0;
        for F in samples() {
            for law in Law::ALL {
                let of = |kind| spring.tangent(law, &F, kind);
                let (K, exact) = (of(Tangent::Projected), of(Tangent::Exact));
                let rounding = 1e-12 * (1.0 + K.norm());
                assert!(K.symmetric_eigenvalues().min() > -rounding, "{law:?} {F}");
                indefinite += u32::from(exact.symmetric_eigenvalues().min() < -1e-3);
            }
        }
        assert!(indefinite > 0, "the samples must show what the projection is for");
    }

    #[test]
    fn springs_turn_with_the_body_and_rest_at_rest() {
        let spring = PronySpring { modulus: 2.0, start: [0.1, 0.1, -0.2, 0.0, 0.3, 0.0] };
        let Q = Rotation3::new(Vector3::new(0.4, -1.1, 0.7)).into_inner();
        let F = Matrix3::new(1.2, 0.3, -0.1, 0.05, 1.1, 0.2, -0.3, 0.1, 1.1);
        let law = Law::Corotational;
        assert!((spring.stress(law, &(Q * F)) - Q * spring.stress(law, &F)).norm() < 1e-12);
        let torque = spring.stress(law, &F) * F.transpose();
        assert!((torque - torque.transpose()).norm() < 1e-12, "the stress must balance moments");
        let fresh = PronySpring { modulus: 2.0, start: [0.0; 6] };
        assert!(fresh.stress(law, &Q).norm() < 1e-12);
        let swollen = Matrix3::identity() * 1.3;
        assert!(fresh.stress(law, &swollen).norm() < 1e-12, "volume stays elastic");
    }

    /// A strain that grows evenly and then stays: ∫ exp(−(t−s)/τ) ė ds in closed form, whatever the steps.
    #[test]
    fn strains_of_springs_follow_a_ramp_and_a_hold_exactly() {
        let prony = two();
        for steps in [1, 7, 40] {
            let (ramp_s, hold_s) = (0.5, 2.0);
            let h = ramp_s / f64::from(steps);
            let mut d = [[0.0; 6]; 2];
            for _ in 0..steps {
                prony.advance(h, &[0.0, 0.0, 0.0, 0.0, 0.0, 0.03 * h], &mut d);
            }
            prony.advance(hold_s, &[0.0; 6], &mut d);
            for (term, d) in prony.iter().zip(d) {
                let tau = term.time_s;
                let expected = 0.03 * tau * (1.0 - (-ramp_s / tau).exp()) * (-hold_s / tau).exp();
                assert!((d[5] / expected - 1.0).abs() < 1e-12, "{steps} steps: {} {expected}", d[5]);
            }
        }
    }

    #[test]
    fn the_stress_at_the_end_of_a_step_is_that_of_the_spring_of_the_step() {
        let (prony, mu, law) = (two(), 3.0, Law::Corotational);
        let before = Matrix3::new(1.1, 0.1, 0.0, 0.0, 0.95, 0.05, 0.02, 0.0, 1.0);
        let after = Matrix3::new(1.2, 0.0, 0.1, 0.1, 0.9, 0.05, 0.0, 0.03, 1.1);
        let mut d = [[0.02, -0.01, -0.01, 0.03, 0.0, 0.01], [0.1, 0.0, -0.1, 0.0, 0.02, 0.0]];
        for h in [0.0, 1e-9, 0.05, 40.0] {
            let start = prony.start(h, &Prony::strain(law, &before), &d);
            let spring = PronySpring { modulus: mu * prony.stiffness(h), start };
            let mut growth = Prony::strain(law, &after);
            growth.iter_mut().zip(Prony::strain(law, &before)).for_each(|(growth, e)| *growth -= e);
            prony.advance(h, &growth, &mut d);
            let S = 2.0 * mu * matrix(&prony.sum(&d));
            let expected = first_piola(law, &after, &S);
            assert!((spring.stress(law, &after) - expected).norm() < 1e-11, "h = {h}");
        }
    }

    #[test]
    fn what_is_out_of_range_is_named() {
        two().check().unwrap();
        assert_eq!((two().len(), two().is_empty(), Prony::default().is_empty()), (2, false, true));
        let broken = |term| Prony::new([term]).check().unwrap_err().quantity;
        assert_eq!(broken(PronyTerm { ratio: -0.1, time_s: 1.0 }), "prony.ratio");
        assert_eq!(broken(PronyTerm { ratio: 0.5, time_s: 0.0 }), "prony.time_s");
        assert_eq!(broken(PronyTerm { ratio: f64::NAN, time_s: 1.0 }), "prony.ratio");
    }
}
