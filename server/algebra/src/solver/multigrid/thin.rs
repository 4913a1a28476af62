//! Thin cells, whose inner vertices move as in equilibrium instead of trilinearly.
//!
//! # Derivation
//! Where cuts leave rods and slices, a coarse cell may have no neighbours on both sides of an axis. Cells of length a
//! bend a part of thickness t only with a parasitic shear, which stiffens it by about 1 + (G/E)(a/t)². Under trilinear
//! prolongation that is four times more on every level, and corrections by the coarse levels come out too small by
//! as much: shear locking.
//!
//! An inner vertex belongs to children of one coarse cell alone. So its row of P can be anything that depends on the
//! vertices of that cell, and the operator stays a sum over cells. It follows the other vertices as the equilibrium
//! of the children does: P_i = W_i + D with A_ii D = −(A W)_i, for the trilinear weights W. That makes Pᵀ A P as soft
//! as it can be, and the matrix of the cell becomes
//!
//! Pᵀ A P = Wᵀ A W − (A W)_iᵀ A_ii⁻¹ (A W)_i.
//!
//! Only vertices in the middle between two others are taken, so that those that remain still determine the coarse
//! vertices.
//!
//! # Limit
//! Vertices that several cells share move trilinearly. A rod that lies across the border of blocks is not thin before
//! the level on which one block holds it, and bends too stiffly up to there.
//!
//! # Source
//! Wan, Chan, Smith 2000: An energy-minimizing interpolation for robust multigrid methods. Nesme, Kry, Jeřábková,
//! Faure 2009: Preserving topology and elasticity for embedded deformable models (shape functions of composite
//! elements).

use nalgebra::Matrix3;
use scindo_matter::element::{LANES, Lanes, Vector8};

use super::dense::{ByComponent, Dense};
use super::level::{Level, NONE, place_in, trilinear};
use super::step::Step;
use crate::operator::Padded;

/// Vertices of the 2³ children of a cell.
const VERTICES: usize = 27;
/// Those of them in the middle between others.
pub(super) const INNER: usize = VERTICES - 8;
const UNKNOWNS: usize = 3 * INNER;
/// Registers of a row.
const ROW: usize = UNKNOWNS.div_ceil(LANES);
/// Pivots below this part of their diagonal entry are none: nothing holds the inner vertices then, and what is left is
/// rounding.
const PIVOT: f32 = 1e-4;

/// Inner vertices of a thin cell, and D.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Inner {
    /// Fine vertices.
    pub(super) vertices: Vec<u32>,
    /// Rows of D in the frame of the coarse cell, three for each vertex, over the vertices that carry the cell.
    pub(super) change: Vec<[f32; 24]>,
}

/// Room for what passes between the vertices of a thin cell.
pub(super) type Passed = [Padded; INNER];

impl Inner {
    /// Forgets all.
    pub(super) fn clear(&mut self) {
        self.vertices.clear();
        self.change.clear();
    }

    /// Whether there are none.
    pub(super) fn is_empty(&self) -> bool {
        self.vertices.is_empty()
    }

    /// Bytes in use.
    pub(super) fn memory(&self) -> usize {
        size_of_val(&self.vertices[..]) + size_of_val(&self.change[..])
    }

    /// R D Rᵀ between inner vertex `i` and vertex `c` of the cell.
    pub(super) fn block(&self, i: usize, c: usize, R: &Matrix3<f32>) -> Matrix3<f32> {
        R * Matrix3::from_fn(|r, s| self.change[3 * i + r][3 * c + s]) * R.transpose()
    }
}

/// Whether cell `id` is merged and has no neighbours on both sides of an axis.
pub(super) fn is_thin(level: &Level, id: usize) -> bool {
    if level.leaf[id] || level.hanging[id] != 0 {
        return false;
    }
    let linked = level.links.get(id).iter().fold(0_u8, |linked, link| linked | 1 << (link % 8));
    (0..3).any(|axis| linked >> (2 * axis) & 3 == 0)
}

/// The bit of a place among the children, in halves of the side of their cell.
fn bit(place: [i32; 3]) -> u32 {
    1 << (place[0] + 3 * place[1] + 9 * place[2])
}

/// Room for the equations of the inner vertices of one cell after the other.
pub(super) struct Equations {
    /// A_ii, of which the upper triangle is used.
    A: [[Lanes; ROW]; UNKNOWNS],
    /// (A W)_i: a register of the cell's corners for every component.
    AW: [ByComponent; UNKNOWNS],
}

impl Default for Equations {
    fn default() -> Self {
        Self { A: [[Lanes::default(); ROW]; UNKNOWNS], AW: [Default::default(); UNKNOWNS] }
    }
}

/// The inner vertices of a cell.
pub(super) struct Thin<'a> {
    vertices: [u32; VERTICES],
    /// Trilinear weights of the cell's corners.
    weights: [Lanes; VERTICES],
    /// Number among the inner ones, or [`INNER`].
    inner: [usize; VERTICES],
    n: usize,
    known: usize,
    diagonal: [[f32; 3]; VERTICES],
    equations: &'a mut Equations,
}

impl<'a> Thin<'a> {
    /// Those of thin cell `id` of `coarse`; `is_held` tells which fine vertices are held in some direction. `None` if
    /// it has such, if it has no inner vertices, or if its children rest on others than their corners.
    pub(super) fn new(
        (fine, coarse): (&Level, &Level),
        step: &Step,
        id: usize,
        is_held: impl Fn(u32) -> bool,
        equations: &'a mut Equations,
    ) -> Option<Self> {
        // Only the slots tell which cells share a vertex.
        if !fine.has_slots() {
            return None;
        }
        let cell = &coarse.cells[id];
        let children = step.children_of(id);
        let mut thin = Self {
            vertices: [NONE; VERTICES],
            weights: [Lanes::default(); VERTICES],
            inner: [INNER; VERTICES],
            n: 0,
            known: 0,
            diagonal: [[0.0; 3]; VERTICES],
            equations,
        };
        let mut places = [[0; 3]; VERTICES];
        let (mut known, mut taken) = (0, 0_u32);
        for child in children.iter().map(|&child| child as usize) {
            if fine.hanging[child] != 0 || fine.cells[child].level == cell.level {
                return None;
            }
            for (c, &v) in fine.vertices[child].iter().enumerate() {
                let place = place_in(fine, child, c, cell);
                taken |= bit(place);
                if is_held(v) {
                    return None;
                }
                if !thin.vertices[..known].contains(&v) {
                    // Parts that touch without a link have more.
                    if known == VERTICES {
                        return None;
                    }
                    thin.weights[known] = Lanes(trilinear(place));
                    (thin.vertices[known], places[known]) = (v, place);
                    known += 1;
                }
            }
        }
        thin.known = known;
        for i in 0..known {
            let v = thin.vertices[i];
            // A trilinear function is known here from two others, which are not between any along this axis. So the
            // vertices that are never between others determine the coarse ones, as all of them did.
            let between = (0..3).any(|k| {
                let end = |at| bit([0, 1, 2].map(|a| if a == k { at } else { places[i][a] }));
                places[i][k] == 1 && taken & end(0) != 0 && taken & end(2) != 0
            });
            // A vertex that another coarse cell also has must move trilinearly for both.
            let own = |(child, _): (usize, usize)| step.parent[child] as usize == id;
            if between && fine.slots_of(v as usize).all(own) {
                if thin.n == INNER {
                    return None;
                }
                thin.inner[i] = thin.n;
                thin.n += 1;
            }
        }
        // The room still holds the equations of the cell before.
        let n = 3 * thin.n;
        thin.equations.A[..n].fill([Lanes::default(); ROW]);
        thin.equations.AW[..n].fill(Default::default());
        (n > 0).then_some(thin)
    }

    /// Adds the matrix of a child, in the frame of the cell.
    #[inline(always)]
    pub(super) fn add<V: Vector8>(&mut self, fine: &Level, child: usize, A: &Dense) {
        let places = fine.vertices[child].map(|v| self.vertices.iter().position(|w| *w == v).unwrap_or(0));
        for (c, &place) in places.iter().enumerate() {
            (0..3).for_each(|k| self.diagonal[place][k] += A.entry(3 * c + k, 3 * c + k));
        }
        for (c, &row) in places.iter().enumerate().filter(|(_, row)| self.inner[**row] < INNER) {
            for r in 0..3 {
                let entries = A.row(3 * c + r);
                let at = 3 * self.inner[row] + r;
                let mut of_corners = load::<V, 3>(&self.equations.AW[at], 0);
                for (entries, &column) in entries.chunks_exact(3).zip(&places) {
                    let weights = V::load(&self.weights[column]);
                    for k in 0..3 {
                        of_corners[k] = V::splat(entries[k]).mul_add(weights, of_corners[k]);
                    }
                    if self.inner[column] < INNER {
                        let first = 3 * self.inner[column];
                        let of_inner = &mut self.equations.A[at];
                        (0..3).for_each(|k| *entry_mut(of_inner, first + k) += entries[k]);
                    }
                }
                store(of_corners, &mut self.equations.AW[at], 0);
            }
        }
    }

    /// Makes Pᵀ A P of `sum` = Wᵀ A W, and writes the inner vertices and D. Leaves both as they are with no inner
    /// vertices if A_ii is not positive definite, or if another vertex has no stiffness because it rests on held ones:
    /// what moves that alone would then have none either.
    #[inline(always)]
    pub(super) fn relax<V: Vector8>(self, sum: &mut Dense, inner: &mut Inner) {
        if self.diagonal[..self.known].iter().flatten().any(|d| *d <= 0.0) {
            return;
        }
        let n = 3 * self.n;
        let Equations { A: U, AW: X } = self.equations;
        // A_ii = Uᵀ U, row by row, in place.
        let mut reciprocal = [0.0; UNKNOWNS];
        for i in 0..n {
            let least = PIVOT * entry(&U[i], i);
            let first = i / LANES;
            match n.div_ceil(LANES) - first {
                1 => eliminate::<V, 1>(U, i, first),
                2 => eliminate::<V, 2>(U, i, first),
                3 => eliminate::<V, 3>(U, i, first),
                4 => eliminate::<V, 4>(U, i, first),
                5 => eliminate::<V, 5>(U, i, first),
                6 => eliminate::<V, 6>(U, i, first),
                7 => eliminate::<V, 7>(U, i, first),
                _ => eliminate::<V, 8>(U, i, first),
            }
            let pivot = entry(&U[i], i);
            if pivot <= least || pivot.is_nan() {
                return;
            }
            reciprocal[i] = 1.0 / pivot.sqrt();
            let scale = V::splat(reciprocal[i]);
            for register in &mut U[i][first..] {
                *register = (scale * V::load(register)).store();
            }
        }
        // X = U⁻ᵀ (A W)_i, so that (A W)_iᵀ A_ii⁻¹ (A W)_i = Xᵀ X.
        for i in 0..n {
            let mut row = load::<V, 3>(&X[i], 0);
            for j in 0..i {
                subtract(&mut row, entry(&U[j], i), &X[j], 0);
            }
            scale_and_store::<V>(row, reciprocal[i], &mut X[i]);
        }
        sum.subtract_square::<V>(&X[..n]);
        // D = −U⁻¹ X.
        for i in (0..n).rev() {
            let mut row = load::<V, 3>(&X[i], 0);
            for k in i + 1..n {
                subtract(&mut row, entry(&U[i], k), &X[k], 0);
            }
            scale_and_store::<V>(row, reciprocal[i], &mut X[i]);
        }
        inner.change.extend(X[..n].iter().map(|row| std::array::from_fn(|s| -row[s % 3].0[s / 3])));
        let numbers = self.vertices.iter().zip(self.inner).filter(|(_, number)| *number < INNER);
        inner.vertices.extend(numbers.map(|(v, _)| *v));
    }
}

/// Subtracts from row `i` of A_ii, from register `first` on, what the rows above make of it. What is before the diagonal
/// is of no meaning.
#[inline(always)]
fn eliminate<V: Vector8, const N: usize>(U: &mut [[Lanes; ROW]; UNKNOWNS], i: usize, first: usize) {
    let mut row = load::<V, N>(&U[i], first);
    for above in &U[..i] {
        subtract(&mut row, entry(above, i), above, first);
    }
    store(row, &mut U[i], first);
}

/// Entry `at` of a row.
#[inline(always)]
fn entry(row: &[Lanes], at: usize) -> f32 {
    row[at / LANES].0[at % LANES]
}

#[inline(always)]
fn entry_mut(row: &mut [Lanes], at: usize) -> &mut f32 {
    &mut row[at / LANES].0[at % LANES]
}

/// N registers of a row from register `first` on.
#[inline(always)]
fn load<V: Vector8, const N: usize>(row: &[Lanes], first: usize) -> [V; N] {
    let mut out = [V::splat(0.0); N];
    for k in 0..N {
        out[k] = V::load(&row[first + k]);
    }
    out
}

#[inline(always)]
fn store<V: Vector8, const N: usize>(from: [V; N], row: &mut [Lanes], first: usize) {
    for k in 0..N {
        row[first + k] = from[k].store();
    }
}

/// row −= f · other, of which register `first` is the first that counts.
#[inline(always)]
fn subtract<V: Vector8, const N: usize>(row: &mut [V; N], f: f32, other: &[Lanes], first: usize) {
    let f = V::splat(-f);
    for k in 0..N {
        row[k] = f.mul_add(V::load(&other[first + k]), row[k]);
    }
}

#[inline(always)]
fn scale_and_store<V: Vector8>(mut row: [V; 3], factor: f32, to: &mut ByComponent) {
    for register in &mut row {
        *register = V::splat(factor) * *register;
    }
    store(row, to, 0);
}
