//! Families of parallel fibres in a matrix of any law: muscle, tendon, layered tissue.
//!
//! One family makes a body transversely isotropic, two or three families along perpendicular directions make it
//! orthotropic. Each adds an energy ψ_f(ε) of its own strain ε to that of the matrix:
//!
//! - in the linear law ε = a·e a with the small strain e, and ψ_f = k₁ ε²/2 in tension and compression;
//! - in all others ε = (|F a|² − 1)/2, the Green strain along the fibre. Fibres carry tension only; under compression
//!   they buckle. ψ_f = k₁ ε²/2, or k₁ (exp(k₂ ε²) − 1)/(2 k₂) for fibres that stiffen.
//!
//! All of these are convex in the strain, and their tangents positive semidefinite, so Newton's method descends.
//!
//! # Source
//! Holzapfel, Gasser, Ogden 2000, "A new constitutive framework for arterial wall mechanics" (the energy, and fibres that
//! carry tension only); Lekhnitskii 1963, "Theory of elasticity of an anisotropic elastic body" (linear).

use std::ops::RangeInclusive;

use nalgebra::{Matrix3, SVector, Vector3};

use super::{Law, MaterialError, Matrix9, within};

/// Most families of a body.
pub const MAX_FIBRES: usize = 3;

/// A family of parallel fibres.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Fibre {
    /// Direction a at rest, a unit vector.
    pub direction: Vector3<f64>,
    /// k₁ [Pa]: what the family adds to the modulus along it, at small strains.
    pub stiffness_pa: f64,
    /// k₂ [1], ≥ 0: how fast it stiffens; 0: not at all. The linear law ignores it.
    pub stiffening: f64,
}

/// The families of a body.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Fibres([Option<Fibre>; MAX_FIBRES]);

impl Fibres {
    /// Range of the stiffness k₁ [Pa].
    pub const STIFFNESS_PA: RangeInclusive<f64> = 0.0..=1e13;
    /// Range of the stiffening k₂.
    pub const STIFFENING: RangeInclusive<f64> = 0.0..=1e3;

    /// At most [`MAX_FIBRES`] families; further ones are left out. Directions need not be of unit length.
    pub fn new(families: impl IntoIterator<Item = Fibre>) -> Self {
        let mut fibres = Self::default();
        for (place, fibre) in fibres.0.iter_mut().zip(families) {
            *place = Some(Fibre { direction: fibre.direction.normalize(), ..fibre });
        }
        fibres
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.0[0].is_none()
    }

    /// The families.
    pub fn iter(&self) -> impl Iterator<Item = &Fibre> {
        self.0.iter().flatten()
    }

    /// Checks that every constant is finite and in its range.
    ///
    /// # Errors
    /// The first that is not; a direction without a length.
    pub fn check(&self) -> Result<(), MaterialError> {
        for fibre in self.iter() {
            within("fibre.direction", fibre.direction.norm(), 0.999..=1.001)?;
            within("fibre.stiffness_pa", fibre.stiffness_pa, Self::STIFFNESS_PA)?;
            within("fibre.stiffening", fibre.stiffening, Self::STIFFENING)?;
        }
        Ok(())
    }

    /// Energy density [J/m³] of all families.
    pub fn energy(&self, law: Law, F: &Matrix3<f64>) -> f64 {
        self.iter().map(|fibre| fibre.along(law, F).0[0]).sum()
    }

    /// First Piola–Kirchhoff stress [Pa] of all families.
    pub fn stress(&self, law: Law, F: &Matrix3<f64>) -> Matrix3<f64> {
        let of = |fibre: &Fibre| {
            let ([_, slope, _], gradient) = fibre.along(law, F);
            slope * gradient
        };
        self.iter().map(of).sum()
    }

    /// ∂P/∂F [Pa] of all families, with F stacked by columns.
    pub fn tangent(&self, law: Law, F: &Matrix3<f64>) -> Matrix9 {
        let mut tangent = Matrix9::zeros();
        for fibre in self.iter() {
            let ([_, slope, curvature], gradient) = fibre.along(law, F);
            let d = SVector::<f64, 9>::from_column_slice(gradient.as_slice());
            tangent += curvature * d * d.transpose();
            if law != Law::Linear {
                let a = fibre.direction;
                for (column, row) in (0..3).flat_map(|j| (0..3).map(move |i| (i, j))) {
                    for k in 0..3 {
                        tangent[(3 * row + k, 3 * column + k)] += slope * a[row] * a[column];
                    }
                }
            }
        }
        tangent
    }
}

impl Fibre {
    /// ψ_f and its derivatives by the strain ε [J/m³, Pa, Pa], and ∂ε/∂F.
    fn along(&self, law: Law, F: &Matrix3<f64>) -> ([f64; 3], Matrix3<f64>) {
        let (a, k) = (self.direction, self.stiffness_pa);
        let Fa = F * a;
        if law == Law::Linear {
            let strain = a.dot(&Fa) - 1.0;
            return ([0.5 * k * strain * strain, k * strain, k], a * a.transpose());
        }
        let strain = 0.5 * (Fa.norm_squared() - 1.0);
        let gradient = Fa * a.transpose();
        if strain <= 0.0 {
            return ([0.0; 3], gradient);
        }
        let exponent = self.stiffening * strain * strain;
        let energy = match self.stiffening {
            0.0 => 0.5 * k * strain * strain,
            k2 => 0.5 * k / k2 * exponent.exp_m1(),
        };
        let growth = exponent.exp();
        ([energy, k * strain * growth, k * (1.0 + 2.0 * exponent) * growth], gradient)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use nalgebra::Rotation3;

    use super::super::finite_difference::{assert_triad, samples};
    use super::*;

    fn families(stiffening: f64) -> Fibres {
        let along = |x, y, z| Fibre { direction: Vector3::new(x, y, z), stiffness_pa: 1.7, stiffening };
        Fibres::new([along(2.0, 0.0, 0.0), along(0.3, -0.4, 1.1)])
    }

    #[test]
    fn stress_and_tangent_are_derivatives_of_the_energy() {
        let small = |F: &&Matrix3<f64>| F.norm() < 5.0;
        for law in Law::ALL {
            for stiffening in [0.0, 0.4] {
                let fibres = families(stiffening);
                for F in samples().iter().filter(small) {
                    // At rest itself fibres go from compression to tension.
                    let F = F * Matrix3::new(1.01, 0.02, 0.0, 0.0, 1.02, 0.01, 0.0, 0.0, 1.03);
                    assert_triad(
                        &F,
                        |F| fibres.energy(law, F),
                        |F| fibres.stress(law, F),
                        |F| fibres.tangent(law, F),
                    );
                }
            }
        }
    }

    #[test]
    fn no_tangent_has_a_negative_eigenvalue() {
        for F in samples() {
            for law in Law::ALL {
                let K = families(0.0).tangent(law, &F);
                assert!(K.symmetric_eigenvalues().min() > -1e-12 * (1.0 + K.norm()), "{law:?} {F}");
            }
        }
    }

    #[test]
    fn fibres_turn_with_the_body_and_carry_tension_only() {
        let fibres = families(0.5);
        let Q = Rotation3::new(Vector3::new(0.4, -1.1, 0.7)).into_inner();
        let F = Matrix3::new(1.2, 0.3, -0.1, 0.05, 1.1, 0.2, -0.3, 0.1, 1.1);
        let law = Law::Corotational;
        assert!((fibres.energy(law, &(Q * F)) - fibres.energy(law, &F)).abs() < 1e-12);
        assert!((fibres.stress(law, &(Q * F)) - Q * fibres.stress(law, &F)).norm() < 1e-12);
        let pressed = Matrix3::identity() * 0.9;
        assert_eq!(fibres.stress(law, &pressed), Matrix3::zeros());
        assert!(fibres.stress(Law::Linear, &pressed).norm() > 0.1);
        assert_eq!(fibres.stress(law, &Q).map(|p| (1e9 * p).round()), Matrix3::zeros(), "rest is at rest");
    }

    #[test]
    fn what_is_out_of_range_is_named() {
        families(1.0).check().unwrap();
        let broken = |fibre: Fibre| Fibres::new([fibre]).check().unwrap_err().quantity;
        let fibre = Fibre { direction: Vector3::x(), stiffness_pa: 1.0, stiffening: 0.0 };
        assert_eq!(broken(Fibre { direction: Vector3::zeros(), ..fibre }), "fibre.direction");
        assert_eq!(broken(Fibre { stiffness_pa: -1.0, ..fibre }), "fibre.stiffness_pa");
        assert_eq!(broken(Fibre { stiffening: f64::NAN, ..fibre }), "fibre.stiffening");
    }
}
