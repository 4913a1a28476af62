//! The two pieces of a cut element: volume fractions and moments of the shape functions.

use nalgebra::{DMatrix, Matrix4, Vector4};

use super::basis::Side;
use super::error::EnrichmentError;

/// Volume fraction and moments of one side of a cut element.
#[derive(Clone, Debug, PartialEq)]
pub struct Piece {
    /// w = |Ω_piece| / |Ω_e|.
    pub fraction: f64,
    /// (1/|Ω_e|) ∫_piece N_i N_j dΩ, n × n.
    pub moments: DMatrix<f64>,
}

/// Pieces [L, R] of a bar with nodes at 0 and 1 that is cut at `c`, 0 < c < 1. Node 0 is on side L.
pub(super) fn bar_pieces(c: f64) -> Result<[Piece; 2], EnrichmentError> {
    if !(c > 0.0 && c < 1.0) {
        return Err(EnrichmentError::NotCut);
    }
    // ∫_0^c of (1−x)², x(1−x), x², in a form without cancellation for small c. R is the mirror image.
    let below = |c: f64| [c - c * c + c.powi(3) / 3.0, c * c * (0.5 - c / 3.0), c.powi(3) / 3.0];
    let [aa, ab, bb] = below(c);
    let left = DMatrix::from_row_slice(2, 2, &[aa, ab, ab, bb]);
    let [bb, ab, aa] = below(1.0 - c);
    let right = DMatrix::from_row_slice(2, 2, &[aa, ab, ab, bb]);
    Ok([Piece { fraction: c, moments: left }, Piece { fraction: 1.0 - c, moments: right }])
}

/// Sides of the nodes, and pieces [L, R], of a tet cut where the linear interpolant of `levels` vanishes.
/// Side L is where it is negative. No node may lie on the cut, and each side must have a node.
pub(super) fn tet_pieces(levels: [f64; 4]) -> Result<([Side; 4], [Piece; 2]), EnrichmentError> {
    if levels.iter().any(|&level| level == 0.0 || !level.is_finite()) {
        return Err(EnrichmentError::NotCut);
    }
    let sides = levels.map(|level| if level < 0.0 { Side::Left } else { Side::Right });
    let of = |side| move |&a: &usize| sides[a] == side;
    let left: Vec<usize> = (0..4).filter(of(Side::Left)).collect();
    let right: Vec<usize> = (0..4).filter(of(Side::Right)).collect();
    if left.is_empty() || right.is_empty() {
        return Err(EnrichmentError::NotCut);
    }
    let corner = |a: usize| Vector4::from_fn(|k, _| f64::from(u8::from(k == a)));
    // The point where the edge from a to b crosses the cut, in barycentric coordinates.
    let crossing = |a: usize, b: usize| {
        let t = levels[a] / (levels[a] - levels[b]);
        (1.0 - t) * corner(a) + t * corner(b)
    };
    // One node against three makes a tet and a prism, two against two make two prisms.
    let part = |own: &[usize], other: &[usize]| match (own, other) {
        ([a], [b, c, d]) => vec![[corner(*a), crossing(*a, *b), crossing(*a, *c), crossing(*a, *d)]],
        ([b, c, d], [a]) => prism(
            [corner(*b), corner(*c), corner(*d)],
            [crossing(*b, *a), crossing(*c, *a), crossing(*d, *a)],
        ),
        ([a, b], [c, d]) => prism(
            [corner(*a), crossing(*a, *c), crossing(*a, *d)],
            [corner(*b), crossing(*b, *c), crossing(*b, *d)],
        ),
        _ => Vec::new(),
    };
    Ok((sides, [tet_piece(&part(&left, &right)), tet_piece(&part(&right, &left))]))
}

/// Three tets that fill the prism between triangles `p` and `q`.
fn prism(p: [Vector4<f64>; 3], q: [Vector4<f64>; 3]) -> Vec<[Vector4<f64>; 4]> {
    vec![[p[0], p[1], p[2], q[2]], [p[0], p[1], q[1], q[2]], [p[0], q[0], q[1], q[2]]]
}

/// Sums over sub-tets with barycentric corners λ_0 … λ_3. The shape functions are the barycentric
/// coordinates, so ∫ N Nᵀ = |Ω_s|/20 (s sᵀ + Σ_k λ_k λ_kᵀ) with s = Σ_k λ_k.
fn tet_piece(sub_tets: &[[Vector4<f64>; 4]]) -> Piece {
    let mut fraction = 0.0;
    let mut moments = Matrix4::zeros();
    for corners in sub_tets {
        let w = Matrix4::from_columns(corners).determinant().abs();
        let s: Vector4<f64> = corners.iter().sum();
        fraction += w;
        moments += w / 20.0 * corners.iter().map(|c| c * c.transpose()).fold(s * s.transpose(), |m, c| m + c);
    }
    Piece { fraction, moments: DMatrix::from_fn(4, 4, |i, j| moments[(i, j)]) }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn pieces_of_a_tet_add_up_to_the_whole() {
        for levels in
            [[-0.3, 0.7, 0.7, 0.7], [0.9, 0.9, -0.1, 0.4], [-0.2, 0.8, -0.2, 0.8], [-1.0, -2.0, 3.0, -0.5]]
        {
            let (_, [left, right]) = tet_pieces(levels).unwrap();
            assert!((left.fraction + right.fraction - 1.0).abs() < 1e-15, "{levels:?}");
            let whole = left.moments + right.moments;
            let exact = DMatrix::from_fn(4, 4, |i, j| if i == j { 0.1 } else { 0.05 });
            assert!((whole - exact).amax() < 1e-15);
        }
    }

    #[test]
    fn fractions_of_equal_edge_parameters() {
        let t: f64 = 0.3;
        let (sides, [one, _]) = tet_pieces([-t, 1.0 - t, 1.0 - t, 1.0 - t]).unwrap();
        assert_eq!(sides, [Side::Left, Side::Right, Side::Right, Side::Right]);
        assert!((one.fraction - t.powi(3)).abs() < 1e-15);
        let (_, [two, _]) = tet_pieces([-t, -t, 1.0 - t, 1.0 - t]).unwrap();
        assert!((two.fraction - (3.0 * t * t - 2.0 * t.powi(3))).abs() < 1e-15);
    }

    #[test]
    fn an_element_that_is_not_cut_is_refused() {
        assert!(bar_pieces(0.0).is_err() && bar_pieces(1.0).is_err() && bar_pieces(f64::NAN).is_err());
        assert!(tet_pieces([1.0; 4]).is_err() && tet_pieces([0.0, 1.0, -1.0, 1.0]).is_err());
    }
}
