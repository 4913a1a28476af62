//! A_c, the matrix of a coarse space, and its factors.

use nalgebra::{Matrix3, Vector3};
use smallvec::SmallVec;

use super::interpolation::Interpolation;
use super::system::CoarseSystem;
use crate::assembly::BlockCsr;
use crate::operator::{Padded, Spring, padded, unpadded};
use crate::solver::{Cholesky, Filter};

/// Stiffness of a held direction over that of its node: enough to hold the lattice there.
const HELD: f64 = 10.0;
/// Added to the diagonal, relative to it: some combinations of coarse unknowns move no node, and single precision
/// needs them positive. Larger values follow where the first ones do not suffice.
const SHIFTS: [f64; 4] = [1e-6, 1e-5, 1e-4, 1e-3];
/// The same, relative to the largest diagonal entry: an unknown that moves next to nothing has next to no diagonal.
const LEAST: f64 = 1e-12;

/// Lower triangle of A_c, masses and factors.
#[derive(Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct CoarseMatrix {
    /// Row i has its columns j ≤ i.
    matrix: BlockCsr<f64>,
    /// Coarse mass [kg] of every block, the same along all axes.
    mass: Vec<f64>,
    /// Diagonal entries without the shift.
    diagonal: Vec<[f64; 3]>,
    cholesky: Cholesky<f32>,
    factored: bool,
    right: Vec<Vector3<f64>>,
    solution: Vec<Vector3<f64>>,
}

/// Coarse unknowns with the weights of a point in them.
type Row = SmallVec<[(u32, f64); 32]>;

impl CoarseMatrix {
    /// A matrix with the pattern of `matrix`, for nodes with these masses [kg]. `None` without memory for its factors.
    pub(super) fn new(matrix: BlockCsr<f64>, interpolation: &Interpolation, mass: &[f64]) -> Option<Self> {
        let mut cholesky = Cholesky::default();
        cholesky.analyse(&matrix).ok()?;
        let mut coarse_mass = vec![0.0; matrix.blocks.len()];
        for (node, mass) in (0..).zip(mass) {
            let corners = interpolation.corners_of_node(node);
            let w = interpolation.weights(node as usize);
            for (i, j) in pairs(corners) {
                if let Some(at) = matrix.position(corners[i] as usize, corners[j]) {
                    coarse_mass[at] += mass * f64::from(w[i] * w[j]);
                }
            }
        }
        let n = matrix.n_rows();
        let zero = vec![Vector3::zeros(); n];
        Some(Self {
            matrix,
            mass: coarse_mass,
            diagonal: vec![[0.0; 3]; n],
            cholesky,
            factored: false,
            right: zero.clone(),
            solution: zero,
        })
    }

    /// Whether there are factors.
    pub(super) fn is_factored(&self) -> bool {
        self.factored
    }

    /// A_c = factor M.
    pub(super) fn begin(&mut self, mass_factor: f64) {
        for (block, mass) in self.matrix.blocks.iter_mut().zip(&self.mass) {
            *block = [0.0; 9];
            [0, 4, 8].iter().for_each(|&k| block[k] = mass_factor * mass);
        }
    }

    /// The blocks, to be added to.
    pub(super) fn blocks_mut(&mut self) -> &mut [[f64; 9]] {
        &mut self.matrix.blocks
    }

    /// Adds springs and held directions.
    pub(super) fn add_springs(&mut self, interpolation: &Interpolation, system: &CoarseSystem<'_>) {
        let mut row = Row::new();
        for fixed in system.fixed {
            let d = &system.diagonal[fixed.copy as usize];
            let stiffness = HELD * f64::from(d[0] + d[4] + d[6]) / 3.0;
            row.clear();
            gather(interpolation, (fixed.copy, 1.0), &mut row);
            self.add(&row, &(stiffness * fixed.held.projection()));
        }
        for spring in system.springs {
            row.clear();
            for (copy, w) in spring.point.carriers() {
                gather(interpolation, (copy as u32, f64::from(w)), &mut row);
            }
            self.add(&row, &stiffness(spring));
        }
    }

    /// Adds w wᵀ ⊗ K.
    fn add(&mut self, row: &Row, K: &Matrix3<f64>) {
        for &(i, wi) in row {
            for &(j, wj) in row.iter().filter(|r| r.0 <= i) {
                match self.matrix.position(i as usize, j) {
                    Some(at) => add(&mut self.matrix.blocks[at], wi * wj, K),
                    // A spring between unknowns of no common element: more on the diagonal keeps it definite.
                    None => [i, j].iter().for_each(|&i| {
                        if let Some(at) = self.matrix.position(i as usize, i) {
                            add(&mut self.matrix.blocks[at], (wi * wj).abs(), K);
                        }
                    }),
                }
            }
        }
    }

    /// Factorises the matrix.
    pub(super) fn factorise(&mut self) {
        let last = |i: usize, matrix: &BlockCsr<f64>| matrix.row(i).end - 1; // the diagonal block
        let mut largest = 0.0_f64;
        for (i, known) in self.diagonal.iter_mut().enumerate() {
            let block = &self.matrix.blocks[last(i, &self.matrix)];
            *known = [block[0], block[4], block[8]];
            largest = known.iter().copied().fold(largest, f64::max);
        }
        self.factored = false;
        for shift in SHIFTS {
            for (i, known) in self.diagonal.iter().enumerate() {
                let at = last(i, &self.matrix);
                for k in 0..3 {
                    self.matrix.blocks[at][4 * k] = known[k] * (1.0 + shift) + largest * LEAST;
                }
            }
            if self.cholesky.factorise(&self.matrix, &Filter::default()).is_ok() {
                self.factored = true;
                return;
            }
        }
    }

    /// u = A_c⁻¹ b; 0 without factors.
    pub(super) fn solve(&mut self, b: &[Padded], u: &mut [Padded]) {
        // Single precision could not hold the forces of a very heavy or a very light body.
        let scale = b.iter().flatten().fold(0.0_f32, |most, b| most.max(b.abs()));
        if !(self.factored && scale > 0.0 && scale.is_finite()) {
            return u.fill([0.0; 4]);
        }
        self.right.iter_mut().zip(b).for_each(|(right, b)| *right = unpadded(b));
        self.cholesky.solve(&self.right, &mut self.solution, f64::from(scale));
        u.iter_mut().zip(&self.solution).for_each(|(u, z)| *u = padded(z));
    }
}

/// Pairs of corners (i, j) whose block is in the lower triangle.
fn pairs(corners: &[u32; 8]) -> impl Iterator<Item = (usize, usize)> + '_ {
    (0..8).flat_map(move |i| (0..8).map(move |j| (i, j)).filter(|&(i, j)| corners[j] <= corners[i]))
}

/// Adds the weights of a node to a row.
fn gather(interpolation: &Interpolation, (node, w): (u32, f64), row: &mut Row) {
    let corners = interpolation.corners_of_node(node);
    for (&corner, weight) in corners.iter().zip(interpolation.weights(node as usize)) {
        let w = w * f64::from(weight);
        match row.iter_mut().find(|r| r.0 == corner) {
            Some(found) => found.1 += w,
            None if w != 0.0 => row.push((corner, w)),
            None => {}
        }
    }
}

fn stiffness(spring: &Spring) -> Matrix3<f64> {
    let k = f64::from(spring.stiffness);
    match spring.direction {
        Some(n) => {
            let n = Vector3::from(n.map(f64::from));
            k * n * n.transpose()
        }
        None => Matrix3::from_diagonal_element(k),
    }
}

fn add(block: &mut [f64; 9], factor: f64, K: &Matrix3<f64>) {
    for (e, entry) in block.iter_mut().enumerate() {
        *entry += factor * K[(e / 3, e % 3)];
    }
}
