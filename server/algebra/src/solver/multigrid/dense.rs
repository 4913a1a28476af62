//! Symmetric 24×24 matrices of single cells, by components.
//!
//! Rows and columns of the same components make a plane of 8×8 entries, whose columns are eight lanes. Rotations act
//! on components and interpolation acts on vertices, so both work on whole columns of planes.
//!
//! Loops instead of closures in all that works on registers: see [`Vector`](scindo_matter::element::Vector).

use nalgebra::{Matrix3, Vector3};
use scindo_matter::element::Held;
use scindo_matter::element::{LANES, Lanes, Vector8, for_eight};

use crate::operator::cells::{ENTRY, Matrix24};

/// Row c: weights of the new vertices in vertex c.
pub(super) type Weights = [[f32; 8]; 8];

/// Entries of a packed matrix.
pub(super) const PACKED: usize = 300;

/// A packed symmetric matrix: the planes in the order of [`Dense`], of those on the diagonal the upper triangles by
/// columns.
pub(super) type Packed = [f32; PACKED];

/// Stiffness of a prescribed inclined direction over the largest one of its vertex: far above the rounding of single
/// precision, far below what slows corrections.
const HELD_STIFFNESS: f32 = 1e-3;

/// Entries between the vertices, a column per lane register.
type Plane = [Lanes; 8];

/// A row by components: the entries of all vertices in a register each.
pub(super) type ByComponent = [Lanes; 3];

/// Where each plane begins in a packed matrix.
const BEGIN: [usize; 6] = [0, 36, 100, 164, 200, 264];

/// Components of rows and columns of the planes.
const COMPONENTS: [[usize; 2]; 6] = [[0, 0], [0, 1], [0, 2], [1, 1], [1, 2], [2, 2]];

/// A symmetric matrix whose row and column 3 c + i belong to vertex c and component i: the planes xx, xy, xz, yy, yz,
/// zz. Lane a of column b is the entry of vertices a and b.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct Dense([Plane; 6]);

/// The same matrix by the planes xx, yx, zx, yy, zy, zz.
pub(super) struct Flipped([Plane; 6]);

impl Dense {
    /// The matrix of these entries, of which the upper triangle is read.
    pub(super) fn new(entry: impl Fn(usize, usize) -> f32) -> Self {
        let mut out = Self::default();
        for s in 0..24 {
            (0..=s).for_each(|r| out.set(r, s, entry(r, s)));
        }
        out
    }

    /// The matrix that `packed` holds.
    #[inline(always)]
    pub(super) fn unpacked(packed: &Packed) -> Self {
        let mut out = Self::default();
        for (p, plane) in out.0.iter_mut().enumerate() {
            let mut from = BEGIN[p];
            for b in 0..8 {
                if is_diagonal(p) {
                    for a in 0..=b {
                        (plane[b].0[a], plane[a].0[b]) = (packed[from + a], packed[from + a]);
                    }
                    from += b + 1;
                } else {
                    plane[b].0.copy_from_slice(&packed[from..from + LANES]);
                    from += LANES;
                }
            }
        }
        out
    }

    /// The entries that determine it.
    #[inline(always)]
    pub(super) fn packed(&self) -> Packed {
        let mut out = [0.0; PACKED];
        for (p, plane) in self.0.iter().enumerate() {
            let mut to = BEGIN[p];
            for (b, column) in plane.iter().enumerate() {
                let n = if is_diagonal(p) { b + 1 } else { LANES };
                out[to..to + n].copy_from_slice(&column.0[..n]);
                to += n;
            }
        }
        out
    }

    /// Entry (r, s).
    #[inline(always)]
    pub(super) fn entry(&self, r: usize, s: usize) -> f32 {
        let ((a, i), (b, j)) = ((r / 3, r % 3), (s / 3, s % 3));
        let plane = &self.0[ENTRY[i][j]];
        if i <= j { plane[b].0[a] } else { plane[a].0[b] }
    }

    /// Sets entries (r, s) and (s, r).
    pub(super) fn set(&mut self, r: usize, s: usize, value: f32) {
        let ((a, i), (b, j)) = ((r / 3, r % 3), (s / 3, s % 3));
        let plane = &mut self.0[ENTRY[i][j]];
        if i <= j {
            plane[b].0[a] = value;
        }
        if i >= j {
            plane[a].0[b] = value;
        }
    }

    /// Row r, which is column r, too.
    #[inline(always)]
    pub(super) fn row(&self, r: usize) -> [f32; 24] {
        std::array::from_fn(|s| self.entry(r, s))
    }

    /// All entries.
    pub(super) fn rows(&self) -> Rows {
        std::array::from_fn(|r| self.row(r))
    }

    /// The same in double precision.
    pub(super) fn wide(&self) -> Matrix24 {
        self.rows().map(|row| row.map(f64::from))
    }

    /// The same by planes below the diagonal.
    #[inline(always)]
    pub(super) fn flipped<V: Vector8>(&self) -> Flipped {
        let [xx, xy, xz, yy, yz, zz] = &self.0;
        Flipped([*xx, transposed::<V>(xy), transposed::<V>(xz), *yy, transposed::<V>(yz), *zz])
    }

    /// Q A Qᵀ, with the rotation `Q` on every vertex.
    #[inline(always)]
    pub(super) fn rotated<V: Vector8>(&self, Q: &Matrix3<f32>) -> Self {
        let mut out = Self::default();
        rotate::<V, false>(&self.flipped::<V>(), self, Q, &mut out.0);
        out
    }

    /// The same by planes below the diagonal.
    #[inline(always)]
    pub(super) fn rotated_flipped<V: Vector8>(&self, Q: &Matrix3<f32>) -> Flipped {
        let mut out = Self::default();
        rotate::<V, true>(&self.flipped::<V>(), self, Q, &mut out.0);
        Flipped(out.0)
    }

    /// Tᵀ A T, where row c of `T` has the weights of the new vertices in the old vertex c.
    #[inline(always)]
    pub(super) fn carried<V: Vector8>(&self, T: &Weights) -> Self {
        let mut out = self.0;
        for plane in &mut out {
            // Columns, then rows.
            for _ in 0..2 {
                *plane = transposed::<V>(&times_weights::<V>(plane, T));
            }
        }
        Self(out)
    }

    /// Sets rows and columns of the `fixed` components of vertex `c` to 0.
    pub(super) fn hold(&mut self, c: usize, fixed: u8) {
        for (plane, [i, j]) in self.0.iter_mut().zip(COMPONENTS) {
            if fixed >> i & 1 == 1 {
                plane.iter_mut().for_each(|column| column.0[c] = 0.0);
            }
            if fixed >> j & 1 == 1 {
                plane[c] = Lanes::default();
            }
        }
    }

    /// Filters the prescribed directions of vertex `c`: A ← P A P + s H, with a small stiffness s that keeps the
    /// block definite whatever single precision makes of P A P. More stiffness only makes corrections smaller.
    pub(super) fn filter(&mut self, c: usize, held: &Held) {
        let size = (3 * c..3 * c + 3).map(|r| self.entry(r, r)).fold(0.0, f32::max);
        let (P, H) = (held.filter().map(|p| p as f32), held.projection().map(|h| h as f32));
        for s in (0..24).filter(|s| s / 3 != c) {
            let v = P * Vector3::from_fn(|k, _| self.entry(3 * c + k, s));
            (0..3).for_each(|k| self.set(3 * c + k, s, v[k]));
        }
        let block = P * self.block(c, c) * P + H * (HELD_STIFFNESS * size);
        for j in 0..3 {
            (0..=j).for_each(|i| self.set(3 * c + i, 3 * c + j, block[(i, j)]));
        }
    }

    /// Adds `m` to the diagonal of vertex `c`.
    pub(super) fn add_mass(&mut self, c: usize, m: f32) {
        for i in 0..3 {
            self.0[ENTRY[i][i]][c].0[c] += m;
        }
    }

    /// Adds another matrix.
    #[inline(always)]
    pub(super) fn add<V: Vector8>(&mut self, other: &Self) {
        for (column, other) in self.0.as_flattened_mut().iter_mut().zip(other.0.as_flattened()) {
            *column = (V::load(column) + V::load(other)).store();
        }
    }

    /// Subtracts Xᵀ X, of which these are the rows.
    #[inline(always)]
    pub(super) fn subtract_square<V: Vector8>(&mut self, X: &[ByComponent]) {
        for (plane, [i, j]) in self.0.iter_mut().zip(COMPONENTS) {
            let mut columns = [V::splat(0.0); 8];
            for_eight!(b => {
                columns[b] = V::load(&plane[b]);
            });
            for row in X {
                let x = V::load(&row[i]);
                for_eight!(b => {
                    columns[b] = V::splat(-row[j].0[b]).mul_add(x, columns[b]);
                });
            }
            for_eight!(b => {
                plane[b] = columns[b].store();
            });
        }
    }

    /// Block of vertices `a` and `b`.
    pub(super) fn block(&self, a: usize, b: usize) -> Matrix3<f32> {
        Matrix3::from_fn(|i, j| self.entry(3 * a + i, 3 * b + j))
    }
}

impl Flipped {
    /// Adds the matrix of a child to `sum`, the matrix of its parent over the parent's corners: Tᵀ A T with the
    /// trilinear weights T. The child is number `octant` of eight, and none of its corners hangs.
    ///
    /// # Derivation
    /// Slot j = c ⊕ `octant` of corner c is a corner of the parent for j = 0, and along each axis whose bit is set in
    /// j it lies in the middle. So T is the product of one factor per axis, each with the weights 1 and ½, ½.
    #[inline(always)]
    pub(super) fn add_to_parent<V: Vector8>(&self, octant: usize, sum: &mut Dense) {
        let octant = octant & 7;
        for (plane, sum) in self.0.iter().zip(&mut sum.0) {
            let mut columns = *plane;
            halve::<V>(&mut columns, octant);
            // Planes below the diagonal become those above it.
            columns = transposed::<V>(&columns);
            halve::<V>(&mut columns, octant);
            for (sum, column) in sum.iter_mut().zip(&columns) {
                *sum = (V::load(sum) + V::load(column)).store();
            }
        }
    }
}

const fn is_diagonal(plane: usize) -> bool {
    matches!(plane, 0 | 3 | 5)
}

/// The planes above the diagonal of Q A Qᵀ, or those below it.
#[inline(always)]
fn rotate<V: Vector8, const FLIPPED: bool>(
    below: &Flipped,
    A: &Dense,
    Q: &Matrix3<f32>,
    out: &mut [Plane; 6],
) {
    let mut q = [[V::splat(0.0); 3]; 3];
    for k in 0..3 {
        for l in 0..3 {
            q[k][l] = V::splat(Q[(k, l)]);
        }
    }
    for b in 0..8 {
        let [xx, xy, xz, yy, yz, zz] = &A.0;
        let [_, yx, zx, _, zy, _] = &below.0;
        let P = [
            [V::load(&xx[b]), V::load(&xy[b]), V::load(&xz[b])],
            [V::load(&yx[b]), V::load(&yy[b]), V::load(&yz[b])],
            [V::load(&zx[b]), V::load(&zy[b]), V::load(&zz[b])],
        ];
        for k in 0..3 {
            let mut row = q[k];
            for l in 0..3 {
                row[l] = q[k][0].mul_add(P[0][l], q[k][1].mul_add(P[1][l], q[k][2] * P[2][l]));
            }
            for l in if FLIPPED { 0..k + 1 } else { k..3 } {
                let entry = row[0].mul_add(q[l][0], row[1].mul_add(q[l][1], row[2] * q[l][2]));
                out[ENTRY[k][l]][b] = entry.store();
            }
        }
    }
}

#[inline(always)]
fn transposed<V: Vector8>(plane: &Plane) -> Plane {
    let [a, b, c, d, e, f, g, h] = plane;
    let rows = V::transposed([
        V::load(a),
        V::load(b),
        V::load(c),
        V::load(d),
        V::load(e),
        V::load(f),
        V::load(g),
        V::load(h),
    ]);
    let mut out = *plane;
    for k in 0..8 {
        out[k] = rows[k].store();
    }
    out
}

/// Columns times the trilinear weights of the child number `octant`, in place.
#[inline(always)]
fn halve<V: Vector8>(columns: &mut Plane, octant: usize) {
    let mut x = [V::splat(0.0); 8];
    for_eight!(j => {
        x[j] = V::load(&columns[j ^ octant]);
    });
    let half = V::splat(0.5);
    for axis in [1, 2, 4] {
        for_eight!(j => {
            if j & axis == 0 {
                x[j] = half.mul_add(x[j | axis], x[j]);
                x[j | axis] = half * x[j | axis];
            }
        });
    }
    for_eight!(j => {
        columns[j ^ octant] = x[j].store();
    });
}

/// Columns times T.
#[inline(always)]
fn times_weights<V: Vector8>(columns: &Plane, T: &Weights) -> Plane {
    let mut sums = [V::splat(0.0); 8];
    for c in 0..8 {
        let column = V::load(&columns[c]);
        // Most weights are 0, but to find these would take longer.
        for_eight!(b => {
            sums[b] = V::splat(T[c][b]).mul_add(column, sums[b]);
        });
    }
    let mut out = *columns;
    for_eight!(b => {
        out[b] = sums[b].store();
    });
    out
}

/// All entries of a matrix, row by row: what sweeps over vertices read.
pub(super) type Rows = [[f32; 24]; 24];

/// A u.
#[inline]
pub(super) fn times(A: &Rows, u: &[f32; 24]) -> [f32; 24] {
    let mut out = [0.0; 24];
    // Symmetric: rows are columns, and sums of columns need not wait for each other.
    for (column, u) in A.iter().zip(u) {
        out.iter_mut().zip(column).for_each(|(out, a)| *out += u * a);
    }
    out
}

/// Rows 3 c … 3 c + 2 of A u.
#[inline]
pub(super) fn times_at(A: &Rows, c: usize, u: &[f32; 24]) -> [f32; 3] {
    [0, 1, 2].map(|i| A[3 * c + i].iter().zip(u).map(|(a, u)| a * u).sum())
}

/// A u of a packed matrix.
#[inline]
pub(super) fn times_packed(A: &Packed, u: &[f32; 24]) -> [f32; 24] {
    times(&Dense::unpacked(A).rows(), u)
}

/// Rows 3 c … 3 c + 2 of A u of a packed matrix.
#[inline]
pub(super) fn rows_packed(A: &Packed, c: usize, u: &[f32; 24]) -> [f32; 3] {
    [0, 1, 2].map(|i| PLACES[3 * c + i].iter().zip(u).map(|(&at, u)| A[usize::from(at)] * u).sum())
}

/// Places of all entries in a packed matrix, row by row.
pub(super) const PLACES: [[u16; 24]; 24] = {
    let (mut places, mut k) = ([[0; 24]; 24], 0);
    while k < 576 {
        places[k / 24][k % 24] = at(k / 24, k % 24) as u16;
        k += 1;
    }
    places
};

/// Place of entry (a, b), a ≤ b, of an upper triangle by columns.
const fn triangle(a: usize, b: usize) -> usize {
    b * (b + 1) / 2 + a
}

/// Place of entry (r, s) of a packed matrix.
pub(super) const fn at(r: usize, s: usize) -> usize {
    let (a, i, b, j) = (r / 3, r % 3, s / 3, s % 3);
    let begin = BEGIN[ENTRY[i][j]];
    if i == j {
        begin + if a < b { triangle(a, b) } else { triangle(b, a) }
    } else if i < j {
        begin + LANES * b + a
    } else {
        begin + LANES * a + b
    }
}

#[cfg(test)]
mod tests {
    use std::array::from_fn;

    use nalgebra::{Rotation3, SMatrix};

    use super::super::level::trilinear;
    use super::*;

    type Exact = SMatrix<f64, 24, 24>;

    fn matrix() -> Dense {
        Dense::new(|r, s| ((3 * r + 5 * s) as f32 * 0.37).sin() + if r == s { 4.0 } else { 0.0 })
    }

    fn exact(A: &Dense) -> Exact {
        Exact::from_fn(|r, s| f64::from(A.entry(r, s)))
    }

    fn assert_near(found: &Dense, expected: &Exact) {
        assert!((exact(found) - expected).amax() < 1e-5 * expected.amax());
    }

    #[test]
    fn packing_keeps_every_entry_in_its_place() {
        let A = matrix();
        let packed = A.packed();
        for (r, s) in (0..576).map(|k| (k / 24, k % 24)) {
            assert_eq!(packed[at(r, s)], A.entry(r, s));
            assert_eq!(A.entry(r, s), A.entry(s, r));
        }
        assert_eq!(Dense::unpacked(&packed), A);
    }

    #[test]
    fn rotations_and_weights_do_what_matrices_do() {
        let A = matrix();
        let turn = Rotation3::new(Vector3::new(0.3, -1.1, 0.7)).into_inner();
        let Q = Exact::from_fn(|r, s| if r / 3 == s / 3 { turn[(r % 3, s % 3)] } else { 0.0 });
        let turned = Q * exact(&A) * Q.transpose();
        assert_near(&A.rotated::<Lanes>(&turn.map(|q| q as f32)), &turned);
        for octant in 0..8 {
            let T: Weights =
                from_fn(|c| trilinear([0, 1, 2].map(|k| ((octant >> k & 1) + (c >> k & 1)) as i32)));
            let full = Exact::from_fn(|r, s| if r % 3 == s % 3 { T[r / 3][s / 3].into() } else { 0.0 });
            assert_near(&A.carried::<Lanes>(&T), &(full.transpose() * exact(&A) * full));
            let mut sum = matrix();
            A.rotated_flipped::<Lanes>(&turn.map(|q| q as f32)).add_to_parent::<Lanes>(octant, &mut sum);
            assert_near(&sum, &(exact(&A) + full.transpose() * turned * full));
            let mut sum = Dense::default();
            A.flipped::<Lanes>().add_to_parent::<Lanes>(octant, &mut sum);
            assert_near(&sum, &(full.transpose() * exact(&A) * full));
        }
        let T = [[0, 0, 1], [1, 0, 2], [2, 1, 0], [0, 2, 2], [1, 1, 1], [2, 0, 0], [0, 1, 0], [2, 2, 1]];
        let T = T.map(trilinear);
        let full = Exact::from_fn(|r, s| if r % 3 == s % 3 { T[r / 3][s / 3].into() } else { 0.0 });
        assert_near(&A.carried::<Lanes>(&T), &(full.transpose() * exact(&A) * full));
    }

    #[test]
    fn products_and_held_directions_do_what_matrices_do() {
        let A = matrix();
        let u: [f32; 24] = std::array::from_fn(|r| (r as f32 * 0.9).cos());
        let expected = exact(&A) * SMatrix::<f64, 24, 1>::from_fn(|r, _| u[r].into());
        for (r, (a, b)) in times(&A.rows(), &u).into_iter().zip(times_packed(&A.packed(), &u)).enumerate() {
            let rows = rows_packed(&A.packed(), r / 3, &u);
            let own = times_at(&A.rows(), r / 3, &u);
            for found in [a, b, rows[r % 3], own[r % 3]] {
                assert!((f64::from(found) - expected[r]).abs() < 1e-4);
            }
        }
        let mut held = A;
        held.hold(5, 0b101);
        for (r, s) in (0..576).map(|k| (k / 24, k % 24)) {
            let zero = [15, 17].contains(&r) || [15, 17].contains(&s);
            assert_eq!(held.entry(r, s), if zero { 0.0 } else { A.entry(r, s) });
        }
    }
}
