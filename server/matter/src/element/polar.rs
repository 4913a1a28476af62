//! Rotation of one deformation gradient, for every F: stretched, inverted, flat or zero.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

/// Steps are capped at |ω| = 0.5, which is 106° per iteration.
const LARGEST_STEP: f64 = 0.5;
/// Curvatures are used by magnitude, so that every step descends, and are at least this share of ‖F‖.
const HESSIAN_FLOOR: f64 = 1e-9;
const MOST_ITERATIONS: usize = 60;

/// The rotation R that maximises tr(RᵀF), starting from `warm`.
///
/// For det F < 0 this is the proper rotation that leaves the smallest singular value negative, so a
/// corotational element is pushed back the short way. Where F does not define a rotation (rank ≤ 1), the
/// result stays as close to `warm` as F allows. This keeps it continuous in time.
///
/// # Derivation
/// With B = RᵀF, −tr(exp(−\[θ\])B) = −tr B + θ·g + ½ θᵀHθ + …, g_i = ε_ijk B_jk,
/// H = tr(B) I − sym B. Newton's step θ = −|H|⁻¹g is applied as a Cayley rotation with ω = θ/4; a
/// saddle is left along its most negative direction.
///
/// # Source
/// Müller, Bender, Chentanez, Macklin 2016, "A robust method to extract the rotational part of
/// deformations"; Kugelstadt, Koschier, Bender 2018, "Fast corotated FEM using operator splitting"
/// (with the off-diagonals of H negative, as the expansion demands).
pub fn polar_rotation(F: &Matrix3<f64>, warm: &Matrix3<f64>) -> Matrix3<f64> {
    let size = F.norm();
    if !(size > 1e-300 && size.is_finite()) {
        return *warm;
    }
    let F = F / size;
    let mut q = UnitQuaternion::from_matrix_eps(warm, 1e-12, 30, UnitQuaternion::identity());
    for _ in 0..MOST_ITERATIONS {
        let B = q.to_rotation_matrix().matrix().transpose() * F;
        let g = Vector3::new(B[(1, 2)] - B[(2, 1)], B[(2, 0)] - B[(0, 2)], B[(0, 1)] - B[(1, 0)]);
        let H = Matrix3::from_diagonal_element(B.trace()) - 0.5 * (B + B.transpose());
        let eigen = H.symmetric_eigen();
        let lowest = eigen.eigenvalues.imin();
        let least = eigen.eigenvalues[lowest];
        // The gradient vanishes at every stationary point; only a maximum of the trace ends the search.
        if g.norm() < 1e-14 {
            if least > -1e-12 {
                break;
            }
            let away: Vector3<f64> = eigen.eigenvectors.column(lowest).into();
            q = UnitQuaternion::new_normalize(*(q * cayley(0.4 * away)).quaternion());
            continue;
        }
        let components = eigen.eigenvectors.transpose() * g;
        let scaled =
            components.zip_map(&eigen.eigenvalues, |g, curvature| g / curvature.abs().max(HESSIAN_FLOOR));
        let mut omega = -0.25 * (eigen.eigenvectors * scaled);
        let length = omega.norm();
        if length > LARGEST_STEP {
            omega *= LARGEST_STEP / length;
        }
        q = UnitQuaternion::new_normalize(*(q * cayley(omega)).quaternion());
        if length < 1e-9 {
            break;
        }
    }
    q.to_rotation_matrix().into_inner()
}

/// The unit quaternion ((1−|ω|²), 2ω)/(1+|ω|²), a rotation by 4·atan|ω| about ω.
fn cayley(omega: Vector3<f64>) -> UnitQuaternion<f64> {
    let w = omega.norm_squared();
    let v = 2.0 * omega;
    UnitQuaternion::new_normalize(nalgebra::Quaternion::new(1.0 - w, v.x, v.y, v.z))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use nalgebra::Rotation3;
    use proptest::prelude::*;

    /// tr(R*ᵀF) of the best proper rotation, from the singular values: σ1 + σ2 ± σ3.
    fn best_trace(F: &Matrix3<f64>) -> f64 {
        let svd = F.svd(true, true);
        let mut s: Vec<f64> = svd.singular_values.iter().copied().collect();
        s.sort_by(|a, b| b.total_cmp(a));
        s[0] + s[1] + s[2] * F.determinant().signum()
    }

    fn assert_best(F: &Matrix3<f64>, warm: &Matrix3<f64>) {
        let R = polar_rotation(F, warm);
        assert!((R.transpose() * R - Matrix3::identity()).norm() < 1e-12);
        assert!(R.determinant() > 0.0);
        let missing = best_trace(F) - R.dot(F);
        assert!(missing.abs() < 1e-9 * F.norm(), "missing {missing:e} of {F} from {warm}");
    }

    fn entries() -> impl Strategy<Value = [f64; 9]> {
        prop::array::uniform9(-2.0..2.0f64)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]

        #[test]
        fn reaches_the_optimum_of_the_svd_from_a_cold_start(f in entries()) {
            let F = Matrix3::from_row_slice(&f);
            assert_best(&F, &Matrix3::identity());
        }

        #[test]
        fn reaches_the_optimum_for_rank_two_and_any_warm_start(f in entries(), w in prop::array::uniform3(-3.0..3.0f64)) {
            let mut F = Matrix3::from_row_slice(&f);
            let dependent = 0.3 * F.column(0) - 0.8 * F.column(1);
            F.set_column(2, &dependent);
            let warm = Rotation3::new(Vector3::from(w)).into_inner();
            assert_best(&F, &warm);
        }
    }

    #[test]
    fn no_direction_keeps_the_warm_start() {
        let warm = Rotation3::new(Vector3::new(0.3, -0.2, 0.9)).into_inner();
        assert_eq!(polar_rotation(&Matrix3::zeros(), &warm), warm);
        assert_eq!(polar_rotation(&Matrix3::from_element(f64::NAN), &warm), warm);
    }

    #[test]
    fn saddles_are_left() {
        let half_turn = Rotation3::new(Vector3::new(std::f64::consts::PI, 0.0, 0.0)).into_inner();
        assert_best(&Matrix3::identity(), &half_turn);
        assert_best(&Matrix3::from_diagonal(&Vector3::new(1.0, -0.9, -0.8)), &Matrix3::identity());
    }
}
