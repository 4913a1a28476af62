//! Inverses of symmetric 3×3 blocks.

use nalgebra::Matrix3;
use scindo_matter::element::Held;

use super::{Block6, Padded};

/// The inverse of one symmetric 3×3 block in 32 bytes, which a step streams through once per iteration:
/// rows (xx, xy, yy, 0) and (xz, yz, zz, 0), so that a shuffle of the two is a column.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Inverse3(pub [Padded; 2]);

impl Inverse3 {
    /// M⁻¹ r.
    #[inline(always)]
    pub fn times(&self, r: &Padded) -> Padded {
        // Written as three scaled columns, the form that suits a vector unit.
        let column = |j: usize| -> Padded { self.columns()[j].map(|m| m * r[j]) };
        let (a, b, c) = (column(0), column(1), column(2));
        std::array::from_fn(|i| a[i] + b[i] + c[i])
    }

    /// The columns of M⁻¹.
    #[inline(always)]
    pub fn columns(&self) -> [Padded; 3] {
        let [[xx, xy, yy, _], [xz, yz, zz, _]] = self.0;
        [[xx, xy, xz, 0.0], [xy, yy, yz, 0.0], [xz, yz, zz, 0.0]]
    }
}

/// Below this trace the inverse would leave single precision; nothing visible is as light.
const LEAST_TRACE: f64 = 1e-34;

/// Inverse of a symmetric block by cofactors, scaled by its trace so that pieces of any size stay
/// within single precision; a copy without mass and stiffness does not move.
#[inline]
pub fn invert(block: &Block6, fixed: [bool; 3]) -> Inverse3 {
    let [xx, xy, xz, _, yy, yz, zz, _] = block.map(f64::from);
    let trace = xx + yy + zz;
    if !(trace > LEAST_TRACE && trace.is_finite()) {
        return Inverse3::default();
    }
    let s = 1.0 / trace;
    let [xx, xy, xz, yy, yz, zz] = hold([xx, xy, xz, yy, yz, zz].map(|v| v * s), fixed, 1.0);
    // Cofactors; a block that is not definite, if only by rounding, falls back to its trace.
    let (cxx, cxy, cxz) = (yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy);
    let (cyy, cyz, czz) = (xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy);
    let det = xx * cxx + xy * cxy + xz * cxz;
    let definite = xx > 0.0 && czz > 0.0 && det > 1e-12;
    let inverse = if definite {
        let t = s / det;
        [cxx, cxy, cxz, cyy, cyz, czz].map(|c| (c * t) as f32)
    } else {
        let d = (3.0 * s) as f32;
        [d, 0.0, 0.0, d, 0.0, d]
    };
    let [xx, xy, xz, yy, yz, zz] = hold(inverse, fixed, 0.0);
    Inverse3([[xx, xy, yy, 0.0], [xz, yz, zz, 0.0]])
}

/// Inverse of a symmetric block in the free directions, 0 in those of `held`: P (P A P + s H)⁻¹ P.
pub fn invert_free(block: &Block6, held: Held) -> Inverse3 {
    if let Some(axes) = held.axes() {
        return invert(block, axes);
    }
    let [xx, xy, xz, _, yy, yz, zz, _] = block.map(f64::from);
    let trace = xx + yy + zz;
    if !(trace > LEAST_TRACE && trace.is_finite()) {
        return Inverse3::default();
    }
    let A = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz) / trace;
    let definite = held.filter_block(&A, 1.0).cholesky().map(|factor| factor.inverse());
    let inverse = definite.unwrap_or(Matrix3::identity() * 3.0) / trace;
    let M = held.filter_block(&inverse, 0.0).map(|m| m as f32);
    Inverse3([[M.m11, M.m12, M.m22, 0.0], [M.m13, M.m23, M.m33, 0.0]])
}

/// A symmetric block (xx, xy, xz, yy, yz, zz) without the rows and columns of the fixed directions, which
/// have this diagonal instead.
#[inline(always)]
fn hold<T: Copy + From<u8>>(
    [mut xx, mut xy, mut xz, mut yy, mut yz, mut zz]: [T; 6],
    fixed: [bool; 3],
    diagonal: T,
) -> [T; 6] {
    let zero = T::from(0);
    if fixed[0] {
        (xx, xy, xz) = (diagonal, zero, zero);
    }
    if fixed[1] {
        (yy, xy, yz) = (diagonal, zero, zero);
    }
    if fixed[2] {
        (zz, xz, yz) = (diagonal, zero, zero);
    }
    [xx, xy, xz, yy, yz, zz]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inverts_from_planet_to_sliver_and_respects_fixed_axes() {
        for size in [1e20_f32, 1.0, 1e-25] {
            let block = [4.0, 1.0, 0.5, 0.0, 3.0, -0.2, 5.0, 0.0].map(|v| v * size);
            let columns = invert(&block, [false; 3]).columns();
            let A = Matrix3::new(4.0, 1.0, 0.5, 1.0, 3.0, -0.2, 0.5, -0.2, 5.0);
            let B = Matrix3::from_fn(|i, j| columns[j][i] * size);
            assert!((A * B - Matrix3::identity()).norm() < 1e-6);
            let columns = invert(&block, [true, false, false]).columns();
            assert_eq!(columns[0], [0.0; 4]);
            let det = 3.0 * 5.0 - 0.2 * 0.2;
            assert!((columns[1][1] * size - 5.0 / det).abs() < 1e-6);
            assert!((columns[2][1] * size - 0.2 / det).abs() < 1e-6);
        }
    }

    #[test]
    fn respects_inclined_directions_at_any_size() {
        let held = Held::along(nalgebra::Vector3::new(1.0, -2.0, 0.5)).unwrap();
        let A = Matrix3::new(4.0, 1.0, 0.5, 1.0, 3.0, -0.2, 0.5, -0.2, 5.0);
        for size in [1e20_f32, 1.0, 1e-25] {
            let block = [4.0, 1.0, 0.5, 0.0, 3.0, -0.2, 5.0, 0.0].map(|v| v * size);
            let columns = invert_free(&block, held).columns();
            let M = Matrix3::from_fn(|i, j| f64::from(columns[j][i] * size));
            let P = held.filter();
            assert!((M * P * A * P - P).norm() < 1e-6 && (held.projection() * M).norm() < 1e-6);
        }
        assert_eq!(invert_free(&[f32::NAN; 8], held), Inverse3::default());
    }

    #[test]
    fn nothing_and_nonsense_stay_put() {
        for block in [[0.0; 8], [f32::NAN; 8], [f32::INFINITY; 8], [-1.0; 8], [1e-40; 8]] {
            assert_eq!(invert(&block, [false; 3]), Inverse3::default());
        }
    }
}
