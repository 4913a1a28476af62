//! Quadrature on a piece of a quadratic tetrahedron.
//!
//! A piece has any shape, but stiffness and loads of a straight-sided element are integrals of polynomials of
//! degree 2. Four points of equal weight with the piece's own centre and second moments integrate these exactly:
//! with the centre μ and the covariance Σ = L Lᵀ of the piece they are ξ_k = μ + L s_k, where the s_k are the
//! alternating corners of the cube [−1, 1]³, whose mean is 0 and whose covariance is I. So a cut element costs per
//! piece what a whole one costs, however many fragments the piece consists of.
//!
//! Masses are integrals of degree 4. They are summed over the fragments by a rule of degree 5.

use nalgebra::{Matrix3, SymmetricEigen, Vector3};

use super::quadrature::{QuadraturePoint, tet_degree_5};
use super::tet10;

/// Alternating corners of the cube: Σ s = 0, Σ s sᵀ = 4 I.
const ALTERNATING: [Vector3<f64>; 4] = [
    Vector3::new(1.0, 1.0, 1.0),
    Vector3::new(1.0, -1.0, -1.0),
    Vector3::new(-1.0, 1.0, -1.0),
    Vector3::new(-1.0, -1.0, 1.0),
];

/// Least standard deviation of a piece in any direction, in reference coordinates; a layer of 0.17 has it.
///
/// The energy of a curvature across a thin piece vanishes with the square of the thickness. The work of lumped weights,
/// which sit at nodes far outside the piece, does not, and would curve it without bound; extremely thin pieces would
/// drown in rounding. So thinner pieces resist curvature as one of this thickness. Centre and volume stay exact, hence so
/// do all linear displacements.
const LEAST_DEVIATION: f64 = 0.05;

/// Barycentric coordinates of the corners of a fragment, and its volume as a fraction of the element.
pub type Fragment = ([[f64; 4]; 4], f64);

/// Four points in reference coordinates, exact for linear polynomials on the piece that consists of these
/// `fragments`, and for quadratic ones if it is not [thin](LEAST_DEVIATION); the weights sum to 1.
pub fn piece_degree_2<I: Iterator<Item = Fragment>>(fragments: &impl Fn() -> I) -> [QuadraturePoint; 4] {
    let (mut fraction, mut centre) = (0.0, Vector3::zeros());
    for (corners, part) in fragments() {
        fraction += part;
        corners.iter().for_each(|corner| centre += 0.25 * part * reference(corner));
    }
    centre /= fraction;
    // ∫ d dᵀ over a tetrahedron is V/20 (Σ d Σ dᵀ + Σ d dᵀ) with the sums over its corners.
    let mut covariance = Matrix3::zeros();
    for (corners, part) in fragments() {
        let d = corners.map(|corner| reference(&corner) - centre);
        let sum: Vector3<f64> = d.iter().sum();
        let own: Matrix3<f64> = d.iter().map(|d| d * d.transpose()).sum();
        covariance += part / (20.0 * fraction) * (sum * sum.transpose() + own);
    }
    let SymmetricEigen { eigenvectors, eigenvalues } = covariance.symmetric_eigen();
    let L = eigenvectors
        * Matrix3::from_diagonal(&eigenvalues.map(|value| value.max(LEAST_DEVIATION.powi(2)).sqrt()));
    ALTERNATING.map(|s| (centre + L * s, 0.25))
}

/// ∫ N_a N_b dV / V of the ten shape functions over a piece, with the volume V of the whole element.
pub fn piece_products(fragments: impl Iterator<Item = Fragment>) -> [[f64; 10]; 10] {
    let rule = tet_degree_5();
    let mut M = [[0.0; 10]; 10];
    for (corners, part) in fragments {
        let X = corners.map(|corner| reference(&corner));
        for (xi, w) in &rule {
            let L = [1.0 - xi.x - xi.y - xi.z, xi.x, xi.y, xi.z];
            let N = tet10::shape(&X.iter().zip(L).map(|(X, L)| L * X).sum());
            for (row, a) in M.iter_mut().zip(N) {
                row.iter_mut().zip(N).for_each(|(entry, b)| *entry += part * w * a * b);
            }
        }
    }
    M
}

fn reference(barycentric: &[f64; 4]) -> Vector3<f64> {
    Vector3::new(barycentric[1], barycentric[2], barycentric[3])
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    /// A corner cut off at this part of three edges.
    fn corner(part: f64) -> Fragment {
        let edge = |a: usize, k: usize| if a == 0 { 1.0 - part } else { part * f64::from(a == k) };
        let at = |k: usize| std::array::from_fn(|a| if k == 0 { f64::from(a == 0) } else { edge(a, k) });
        (std::array::from_fn(at), part.powi(3))
    }

    fn whole() -> Fragment {
        (std::array::from_fn(|k| std::array::from_fn(|a| f64::from(a == k))), 1.0)
    }

    /// Every product of two of 1, ξ, η, ζ has the same mean by four points and by the rule of degree 5.
    #[test]
    fn quadratic_polynomials_are_exact_on_any_piece() {
        let apart =
            ([[0.0, 0.5, 0.5, 0.0], [0.1, 0.2, 0.7, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.3, 0.4, 0.3]], 0.02);
        for fragments in [vec![whole()], vec![corner(0.6)], vec![corner(0.5), apart], vec![corner(0.1)]] {
            let thin = fragments == [corner(0.1)];
            let volume: f64 = fragments.iter().map(|f| f.1).sum();
            let four = piece_degree_2(&|| fragments.iter().copied());
            let monomials = |p: &Vector3<f64>| [1.0, p.x, p.y, p.z];
            for (a, b) in (0..4).flat_map(|a| (0..4).map(move |b| (a, b))) {
                let value = |p: &Vector3<f64>| monomials(p)[a] * monomials(p)[b];
                let found: f64 = four.iter().map(|(p, w)| w * value(p)).sum();
                let mut exact = 0.0;
                for (corners, part) in &fragments {
                    for (xi, w) in tet_degree_5() {
                        let L = [1.0 - xi.x - xi.y - xi.z, xi.x, xi.y, xi.z];
                        let p = corners.iter().zip(L).map(|(corner, L)| L * reference(corner)).sum();
                        exact += part / volume * w * value(&p);
                    }
                }
                // Of the thin piece the linear ones alone, and the others as of a thicker one.
                let off = if thin && a.min(b) > 0 { 0.05_f64.powi(2) } else { 1e-15 };
                assert!((found - exact).abs() < off, "{a} {b}: {found} {exact}");
            }
        }
    }

    #[test]
    fn products_of_a_whole_element_are_those_of_the_element() {
        let (found, exact) = (piece_products([whole()].into_iter()), tet10::shape_products());
        for (found, exact) in found.iter().flatten().zip(exact.iter().flatten()) {
            assert!((found - exact).abs() < 1e-15);
        }
    }
}
