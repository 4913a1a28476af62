//! The quadratic tetrahedron with ten nodes: corners, then the midpoints of the edges [`TET_EDGES`].
//!
//! On a straight-sided element the four-point rule integrates the linear stiffness exactly; a single
//! point would leave rank 6 of 24. Row sums of the mass matrix are negative at corners (−m/20), so the
//! lumped mass is scaled from the diagonal instead (HRZ): m/36 per corner, 4m/27 per edge.
//!
//! # Source
//! Hinton, Rock, Zienkiewicz 1976, "A note on mass lumping and related processes in the finite element
//! method"; Hughes 2000, *The Finite Element Method*, ch. 3.

use nalgebra::Vector3;

use super::TET_EDGES;
use super::quadrature::tet_degree_5;

/// Share of the lumped (HRZ) mass that each corner gets.
pub const HRZ_CORNER: f64 = 1.0 / 36.0;
/// Share of the lumped (HRZ) mass that each mid-edge node gets.
pub const HRZ_EDGE: f64 = 4.0 / 27.0;
/// Share of every node in the lumped (HRZ) mass.
pub const HRZ: [f64; 10] = of_nodes(HRZ_CORNER, HRZ_EDGE);
/// ∫ N_a dV / V of a corner.
pub const INTEGRAL_CORNER: f64 = -1.0 / 20.0;
/// ∫ N_a dV / V of a mid-edge node.
pub const INTEGRAL_EDGE: f64 = 1.0 / 5.0;
/// ∫ N_a dV / V of every node.
pub const INTEGRALS: [f64; 10] = of_nodes(INTEGRAL_CORNER, INTEGRAL_EDGE);

const fn of_nodes(corner: f64, edge: f64) -> [f64; 10] {
    [corner, corner, corner, corner, edge, edge, edge, edge, edge, edge]
}

fn barycentric(xi: &Vector3<f64>) -> [f64; 4] {
    [1.0 - xi.x - xi.y - xi.z, xi.x, xi.y, xi.z]
}

/// Shape functions at ξ: L_a (2 L_a − 1) at corners, 4 L_a L_b at midpoints.
pub fn shape(xi: &Vector3<f64>) -> [f64; 10] {
    let L = barycentric(xi);
    std::array::from_fn(|n| {
        if n < 4 {
            L[n] * (2.0 * L[n] - 1.0)
        } else {
            let [a, b] = TET_EDGES[n - 4];
            4.0 * L[a] * L[b]
        }
    })
}

/// Gradients ∇N_a [1/m] at ξ of the straight-sided element whose linear shape functions have the
/// gradients `g` [1/m].
pub fn gradients(xi: &Vector3<f64>, g: &[Vector3<f64>; 4]) -> [Vector3<f64>; 10] {
    let L = barycentric(xi);
    std::array::from_fn(|n| {
        if n < 4 {
            (4.0 * L[n] - 1.0) * g[n]
        } else {
            let [a, b] = TET_EDGES[n - 4];
            4.0 * (L[a] * g[b] + L[b] * g[a])
        }
    })
}

/// ∫ N_a N_b dV / V on a straight-sided element, by a rule of degree 5 (degree 4 is needed).
pub fn shape_products() -> [[f64; 10]; 10] {
    let mut M = [[0.0; 10]; 10];
    for (xi, w) in tet_degree_5() {
        let N = shape(&xi);
        for a in 0..10 {
            for b in 0..10 {
                M[a][b] += w * N[a] * N[b];
            }
        }
    }
    M
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::tet_gradients;

    const CORNERS: [Vector3<f64>; 4] = [
        Vector3::new(0.0, 0.0, 0.0),
        Vector3::new(1.0, 0.0, 0.0),
        Vector3::new(0.0, 1.0, 0.0),
        Vector3::new(0.0, 0.0, 1.0),
    ];

    #[test]
    fn shape_functions_are_one_at_their_node_and_sum_to_one() {
        for n in 0..10 {
            let xi = if n < 4 {
                CORNERS[n]
            } else {
                0.5 * (CORNERS[TET_EDGES[n - 4][0]] + CORNERS[TET_EDGES[n - 4][1]])
            };
            for (m, N) in shape(&xi).into_iter().enumerate() {
                assert!((N - f64::from(m == n)).abs() < 1e-15);
            }
        }
        assert!((shape(&Vector3::new(0.1, 0.25, 0.3)).iter().sum::<f64>() - 1.0).abs() < 1e-15);
    }

    #[test]
    fn gradients_are_the_derivatives_of_the_shape_functions() {
        let (xi, h) = (Vector3::new(0.2, 0.3, 0.1), 1e-6);
        let g = gradients(&xi, &tet_gradients(&CORNERS));
        for i in 0..3 {
            let step = h * Vector3::ith(i, 1.0);
            let (above, below) = (shape(&(xi + step)), shape(&(xi - step)));
            for n in 0..10 {
                assert!(((above[n] - below[n]) / (2.0 * h) - g[n][i]).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn masses_are_those_of_the_literature() {
        let M = shape_products();
        let trace: f64 = (0..10).map(|a| M[a][a]).sum();
        for a in 0..10 {
            let (hrz, integral) =
                if a < 4 { (HRZ_CORNER, INTEGRAL_CORNER) } else { (HRZ_EDGE, INTEGRAL_EDGE) };
            assert!((M[a][a] / trace - hrz).abs() < 1e-15);
            assert!((M[a].iter().sum::<f64>() - integral).abs() < 1e-15);
        }
        assert!((4.0 * HRZ_CORNER + 6.0 * HRZ_EDGE - 1.0).abs() < 1e-15);
    }
}
