//! Properties of every law: finite everywhere, objective, Hooke's law at small strain, projected tangents
//! without negative eigenvalues.

use nalgebra::{Matrix3, Rotation3, SVector, Vector3};
use proptest::prelude::*;

use super::finite_difference::samples;
use super::*;

const LAME: Lame = Lame { mu: 1.3, lambda: 2.1 };

/// Zero, ±1e-12, flat, needle, inverted, mirrored, repeated stretches, huge.
fn degenerate() -> Vec<Matrix3<f64>> {
    let turned = Rotation3::new(Vector3::new(0.4, -1.1, 0.7)).into_inner();
    let stretches = |a, b, c| Matrix3::from_diagonal(&Vector3::new(a, b, c));
    let shapes = [
        Matrix3::zeros(),
        stretches(1e-12, 1e-12, 1e-12),
        stretches(-1e-12, -1e-12, -1e-12),
        stretches(1e-12, -1e-12, 0.0),
        stretches(1.0, 1.0, 0.0),
        stretches(1.0, 1.0, 1e-12),
        stretches(1.0, 1.0, -1e-12),
        stretches(1.0, 0.0, 0.0),
        stretches(1.0, 1e-12, -1e-12),
        stretches(20.0, 1e-3, 1e-3),
        -Matrix3::identity(),
        stretches(-1.0, 1.0, 1.0),
        stretches(0.7, 0.5, -0.5),
        stretches(0.05, 0.0, 0.0),
        stretches(0.04, 0.04, -0.04),
        stretches(1e6, 1e6, -1e6),
        Matrix3::identity() * 0.65,
    ];
    shapes.iter().flat_map(|F| [*F, turned * F, turned * F * turned]).collect()
}

#[test]
fn finite_at_every_degenerate_state() {
    for law in Law::ALL {
        for F in degenerate() {
            assert!(law.energy(&F, LAME).is_finite(), "{law:?} {F}");
            assert!(law.stress(&F, LAME).iter().all(|p| p.is_finite()), "{law:?} {F}");
            for kind in [Tangent::Exact, Tangent::Projected, Tangent::Held] {
                assert!(law.tangent(&F, LAME, kind).iter().all(|p| p.is_finite()), "{law:?} {kind:?} {F}");
            }
        }
    }
}

#[test]
fn projected_tangents_have_no_negative_eigenvalue() {
    for law in Law::ALL {
        for F in samples().into_iter().chain(degenerate()) {
            let exact = law.tangent(&F, LAME, Tangent::Exact);
            for kind in [Tangent::Projected, Tangent::Held] {
                let K = law.tangent(&F, LAME, kind);
                let least = K.symmetric_eigenvalues().min();
                assert!(least > -1e-12 * (1.0 + K.norm()), "{law:?} {kind:?} {least} at {F}");
            }
            let eigen = exact.symmetric_eigen();
            let clamped = eigen.eigenvectors
                * Matrix9::from_diagonal(&eigen.eigenvalues.map(|v| v.max(0.0)))
                * eigen.eigenvectors.transpose();
            let K = law.tangent(&F, LAME, Tangent::Projected);
            assert!((K - clamped).norm() < 1e-9 * (1.0 + exact.norm()), "{law:?} at {F}");
        }
    }
}

#[test]
fn rest_is_at_rest() {
    for law in Law::ALL {
        assert!(law.energy(&Matrix3::identity(), LAME).abs() < 1e-15);
        assert!(law.stress(&Matrix3::identity(), LAME).norm() < 1e-14);
    }
}

/// With its Lamé constants re-mapped, the Neo-Hookean law is also Hooke's law at rest.
#[test]
fn every_law_is_hookes_at_small_strain() {
    for lame in [LAME, Lame { mu: 1.0, lambda: 500.0 }, Lame { mu: 1.0, lambda: -0.3 }] {
        let hooke = Linear(lame).tangent();
        for law in Law::ALL {
            let K = law.tangent(&Matrix3::identity(), lame, Tangent::Exact);
            assert!((K - hooke).norm() < 1e-12 * hooke.norm(), "{law:?} {K}");
        }
    }
}

#[test]
fn a_non_finite_state_has_no_finite_energy() {
    for law in Law::ALL {
        for broken in [f64::NAN, f64::INFINITY] {
            let mut F = Matrix3::identity();
            F[(1, 2)] = broken;
            assert!(!law.energy(&F, LAME).is_finite(), "{law:?}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(500))]

    /// ψ(QF) = ψ(F) and P(QF) = Q P(F). With the axes of the material rotated, ψ(FQ) = ψ(F).
    #[test]
    fn objective_and_isotropic(f in prop::array::uniform9(-1.5..1.5f64), q in prop::array::uniform3(-3.0..3.0f64), size in -3..1i32) {
        let F = Matrix3::from_row_slice(&f) * 10f64.powi(size);
        let Q = Rotation3::new(Vector3::from(q)).into_inner();
        for law in Law::ALL.into_iter().filter(|law| *law != Law::Linear) {
            let (energy, P) = (law.energy(&F, LAME), law.stress(&F, LAME));
            prop_assert!((law.energy(&(Q * F), LAME) - energy).abs() < 1e-10 * (1.0 + energy));
            prop_assert!((law.energy(&(F * Q), LAME) - energy).abs() < 1e-10 * (1.0 + energy));
            // The rotation of a nearly flat inverted element is only as accurate as its stretches differ.
            let sigma = SignedSvd::new(&F).sigma;
            if sigma[1] + sigma[2] > 1e-3 * sigma[0] {
                let error = (law.stress(&(Q * F), LAME) - Q * P).norm();
                prop_assert!(error < 1e-9 * (1.0 + P.norm()), "{law:?} {error}");
            }
        }
    }

    /// The stress does no work under an infinitesimal rotation: P Fᵀ is symmetric.
    #[test]
    fn stress_gives_no_torque(f in prop::array::uniform9(-1.5..1.5f64)) {
        let F = Matrix3::from_row_slice(&f);
        for law in Law::ALL.into_iter().filter(|law| *law != Law::Linear) {
            let tau = law.stress(&F, LAME) * F.transpose();
            prop_assert!((tau - tau.transpose()).norm() < 1e-11 * (1.0 + tau.norm()));
        }
    }

    #[test]
    fn projected_curvature_is_never_below_zero_or_the_exact_one(f in prop::array::uniform9(-1.5..1.5f64), d in prop::array::uniform9(-1.0..1.0f64)) {
        let F = Matrix3::from_row_slice(&f);
        let d = SVector::<f64, 9>::from(d);
        for law in Law::ALL {
            let along = |kind| d.dot(&(law.tangent(&F, LAME, kind) * d));
            let (exact, projected) = (along(Tangent::Exact), along(Tangent::Projected));
            let noise = 1e-9 * (1.0 + law.tangent(&F, LAME, Tangent::Exact).norm());
            prop_assert!(projected > -noise && projected > exact - noise);
        }
    }
}
