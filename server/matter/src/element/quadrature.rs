//! Quadrature rules: points in reference coordinates and weights.
//!
//! Reference tetrahedron: ξ, η, ζ ≥ 0, ξ + η + ζ ≤ 1, with weights that sum to 1 (fractions of the
//! volume). Reference cube: [−1, 1]³, with weights that sum to 8.

use nalgebra::Vector3;

/// A point in reference coordinates and its weight.
pub type QuadraturePoint = (Vector3<f64>, f64);

/// Four points, exact for quadratic polynomials on the tetrahedron: a = (5 − √5)/20.
///
/// # Source
/// Hammer, Stroud 1956, "Numerical integration over simplexes".
pub fn tet_degree_2() -> [QuadraturePoint; 4] {
    let a = (5.0 - 5.0_f64.sqrt()) / 20.0;
    corner_orbit(a).map(|p| (p, 0.25))
}

/// Fourteen points with positive weights, exact for polynomials of degree 5 on the tetrahedron.
///
/// # Source
/// Walkington 2000, "Quadrature on simplices of arbitrary dimension".
pub fn tet_degree_5() -> [QuadraturePoint; 14] {
    const A: [f64; 3] = [0.310_885_919_263_300_6, 0.092_735_250_310_891_23, 0.045_503_704_125_649_65];
    const W: [f64; 3] = [0.112_687_925_718_015_85, 0.073_493_043_116_361_95, 0.042_546_020_777_081_466];
    let (first, second) = (corner_orbit(A[0]), corner_orbit(A[1]));
    let third = edge_orbit(A[2]);
    std::array::from_fn(|i| match i {
        0..4 => (first[i], W[0]),
        4..8 => (second[i - 4], W[1]),
        _ => (third[i - 8], W[2]),
    })
}

/// Gauss–Legendre rule with `n` = 1, 2 or 3 points per axis on the cube; other `n` give 3.
pub fn cube_gauss(n: usize) -> Vec<QuadraturePoint> {
    let g2 = 1.0 / 3.0_f64.sqrt();
    let g3 = 0.6_f64.sqrt();
    let line: &[(f64, f64)] = match n {
        1 => &[(0.0, 2.0)],
        2 => &[(-g2, 1.0), (g2, 1.0)],
        _ => &[(-g3, 5.0 / 9.0), (0.0, 8.0 / 9.0), (g3, 5.0 / 9.0)],
    };
    let mut points = Vec::with_capacity(line.len().pow(3));
    for &(z, wz) in line {
        for &(y, wy) in line {
            for &(x, wx) in line {
                points.push((Vector3::new(x, y, z), wx * wy * wz));
            }
        }
    }
    points
}

/// The points of [`cube_gauss`] with `n` = 2, without memory of their own. All weights are 1.
pub fn cube_gauss_2() -> [Vector3<f64>; 8] {
    let g = 1.0 / 3.0_f64.sqrt();
    std::array::from_fn(|q| Vector3::from_fn(|k, _| if q >> k & 1 == 1 { g } else { -g }))
}

/// Points with barycentric coordinates (a, a, a, 1 − 3a) in every order.
fn corner_orbit(a: f64) -> [Vector3<f64>; 4] {
    let b = 1.0 - 3.0 * a;
    [Vector3::repeat(a), Vector3::new(b, a, a), Vector3::new(a, b, a), Vector3::new(a, a, b)]
}

/// Points with barycentric coordinates (a, a, ½ − a, ½ − a) in every order.
fn edge_orbit(a: f64) -> [Vector3<f64>; 6] {
    let b = 0.5 - a;
    [
        Vector3::new(a, b, b),
        Vector3::new(b, a, b),
        Vector3::new(b, b, a),
        Vector3::new(a, a, b),
        Vector3::new(a, b, a),
        Vector3::new(b, a, a),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eight_points_are_the_same_with_and_without_memory() {
        let known: Vec<QuadraturePoint> = cube_gauss_2().map(|xi| (xi, 1.0)).to_vec();
        assert_eq!(cube_gauss(2), known);
    }

    fn factorial(n: i32) -> f64 {
        (1..=n).map(f64::from).product()
    }

    /// ∫ ξ^i η^j ζ^k over the tetrahedron is i! j! k! / (i + j + k + 3)!.
    fn assert_tet(points: &[QuadraturePoint], degree: i32) {
        for i in 0..=degree {
            for j in 0..=degree - i {
                for k in 0..=degree - i - j {
                    let sum: f64 =
                        points.iter().map(|(p, w)| w * p.x.powi(i) * p.y.powi(j) * p.z.powi(k)).sum();
                    let exact = 6.0 * factorial(i) * factorial(j) * factorial(k) / factorial(i + j + k + 3);
                    assert!((sum - exact).abs() < 1e-15, "{i} {j} {k}: {sum} {exact}");
                }
            }
        }
    }

    #[test]
    fn tet_rules_are_exact_to_their_degree() {
        assert_tet(&tet_degree_2(), 2);
        assert_tet(&tet_degree_5(), 5);
    }

    #[test]
    fn cube_rules_are_exact_to_their_degree() {
        for n in 1..=3 {
            for i in 0..2 * n as i32 {
                let sum: f64 = cube_gauss(n).iter().map(|(p, w)| w * p.x.powi(i) * (1.0 + p.y)).sum();
                let exact = if i % 2 == 0 { 8.0 / f64::from(i + 1) } else { 0.0 };
                assert!((sum - exact).abs() < 1e-14, "{n} {i}");
            }
        }
    }
}
