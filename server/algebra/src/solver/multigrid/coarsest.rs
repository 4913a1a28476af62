//! The coarsest level: a factorisation, or sweeps where it is too large for one.

use nalgebra::{UnitQuaternion, Vector3};
use scindo_matter::element::Lanes;

use super::galerkin::Galerkin;
use super::hierarchy::{COARSE_ENOUGH, Hierarchy};
use super::stiff_springs::Columns;
use crate::assembly::BlockCsr;
use crate::operator::Padded;
use crate::solver::{Cholesky, Filter};

/// How the coarsest level is solved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CoarsestSolve {
    /// Exactly, by sparse Cholesky factorisation.
    Cholesky,
    /// By a Chebyshev polynomial of this degree: coarsening stalled above the size for a factorisation, or the
    /// matrix is not positive definite.
    Sweeps {
        /// Products with the coarsest operator.
        degree: u32,
    },
}

/// Degree of the polynomial that takes the place of a factorisation.
const SWEEPS: u32 = 24;

/// The matrix of the coarsest level and its factors.
#[derive(Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Coarsest {
    matrix: BlockCsr<f64>,
    cholesky: Cholesky<f64>,
    /// Whether the pattern was analysed.
    analysed: bool,
    factored: bool,
    /// Frames of the cells when it was factored.
    frames: Vec<UnitQuaternion<f32>>,
    r: Vec<Vector3<f64>>,
    z: Vec<Vector3<f64>>,
    /// Positions of the 64 blocks of every cell.
    #[serde(with = "scindo_matter::storage::saved::arrays")]
    places: Vec<[u32; 64]>,
    /// Prescribed directions, where this is the level that is solved on.
    held: Filter,
    /// Stiff springs that are in the matrix.
    springs: Columns,
    /// Blocks that have these, in the order in which they were changed, and what they were before.
    before: Vec<(u32, [f64; 9])>,
    /// Whether the matrix has changed since it was factored.
    stale: bool,
}

impl Coarsest {
    /// Analyses the pattern of the coarsest level, if it is small enough.
    pub(super) fn new(hierarchy: &Hierarchy) -> Self {
        Self::reusing(Cholesky::default(), hierarchy)
    }

    /// The same in place of another one, in its memory: a cut within milliseconds would wait for new pages.
    pub(super) fn renew(&mut self, hierarchy: &Hierarchy) {
        *self = Self::reusing(std::mem::take(&mut self.cholesky), hierarchy);
    }

    fn reusing(mut cholesky: Cholesky<f64>, hierarchy: &Hierarchy) -> Self {
        let Some(level) = hierarchy.levels.last().filter(|level| 3 * level.n_vertices <= COARSE_ENOUGH)
        else {
            return Self::default();
        };
        let mut rows = vec![Vec::new(); level.n_vertices];
        for vertices in &level.vertices {
            vertices.iter().for_each(|&v| rows[v as usize].extend_from_slice(vertices));
        }
        let matrix = BlockCsr::with_rows(rows);
        let place = |a: u32, b: u32| matrix.position(a as usize, b).map_or(0, |at| at as u32);
        let places =
            level.vertices.iter().map(|v| std::array::from_fn(|i| place(v[i / 8], v[i % 8]))).collect();
        let analysed = cholesky.analyse(&matrix).is_ok();
        let n = level.n_vertices;
        Self {
            matrix,
            cholesky,
            analysed,
            places,
            r: vec![Vector3::zeros(); n],
            z: vec![Vector3::zeros(); n],
            ..Self::default()
        }
    }

    /// How it is solved.
    pub(super) fn solve_kind(&self) -> CoarsestSolve {
        if self.factored { CoarsestSolve::Cholesky } else { CoarsestSolve::Sweeps { degree: SWEEPS } }
    }

    /// Follows the matrices, if they changed or the frame of a cell turned by more than `tolerance` [rad].
    pub(super) fn update(
        &mut self,
        hierarchy: &Hierarchy,
        galerkin: &Galerkin,
        changed: bool,
        tolerance: f64,
    ) {
        if !self.analysed {
            return;
        }
        let last = hierarchy.levels.len() - 1;
        let frames = &galerkin.levels[last].frame;
        let turned =
            |(a, b): (&UnitQuaternion<f32>, &UnitQuaternion<f32>)| f64::from(a.angle_to(b)) > tolerance;
        if !changed && self.frames.len() == frames.len() && !frames.iter().zip(&self.frames).any(turned) {
            return;
        }
        self.frames.clone_from(frames);
        self.matrix.clear();
        for (id, places) in self.places.iter().enumerate() {
            let R = frames[id].to_rotation_matrix().into_inner();
            let A = galerkin.cell_matrix(hierarchy, last, id).rotated::<Lanes>(&R).rows();
            for (a, places) in places.chunks_exact(8).enumerate() {
                for (b, &at) in places.iter().enumerate() {
                    let block = &mut self.matrix.blocks[at as usize];
                    for i in 0..3 {
                        for j in 0..3 {
                            block[3 * i + j] += f64::from(A[3 * a + i][3 * b + j]);
                        }
                    }
                }
            }
        }
        self.held = Filter::default();
        // If it is the only one that is solved on, directions may be prescribed.
        if last == galerkin.first {
            self.held.set_held(galerkin.held());
        }
        self.before.clear();
        self.stale = true;
        // Those who have springs set them anew after an update.
        if self.springs.is_empty() {
            self.factorise();
        }
        self.springs.clear();
    }

    /// Adds these stiff springs to the matrix, in place of those that it has, and factorises it if they differ.
    /// Returns `false` if a spring couples vertices of no common cell; the matrix has no springs then.
    pub(super) fn set_springs(&mut self, columns: &Columns) -> bool {
        if !self.analysed {
            return true;
        }
        let mut fits = true;
        if self.springs != *columns {
            for (at, block) in self.before.drain(..).rev() {
                self.matrix.blocks[at as usize] = block;
            }
            self.springs.copy_from(columns);
            self.stale = true;
            fits = columns.iter().all(|column| self.add(column));
            if !fits {
                self.set_springs(&Columns::default());
            }
        }
        self.factorise();
        fits
    }

    /// A + u uᵀ. Returns whether the pattern has all entries of it.
    fn add(&mut self, column: &[(u32, [f64; 3])]) -> bool {
        for (a, u) in column {
            for (b, w) in column {
                let Some(at) = self.matrix.position(*a as usize, *b) else { return false };
                let block = &mut self.matrix.blocks[at];
                self.before.push((at as u32, *block));
                for (e, entry) in block.iter_mut().enumerate() {
                    *entry += u[e / 3] * w[e % 3];
                }
            }
        }
        true
    }

    /// Factorises the matrix if it has changed.
    fn factorise(&mut self) {
        if std::mem::take(&mut self.stale) {
            self.factored = self.cholesky.factorise(&self.matrix, &self.held).is_ok();
        }
    }

    /// x = A⁻¹ b with the factors.
    pub(super) fn solve(&mut self, b: &[Padded], x: &mut [Padded]) {
        self.factorise();
        for (r, b) in self.r.iter_mut().zip(b) {
            *r = Vector3::new(f64::from(b[0]), f64::from(b[1]), f64::from(b[2]));
        }
        self.cholesky.solve(&self.r, &mut self.z, 1.0);
        for (x, z) in x.iter_mut().zip(&self.z) {
            *x = crate::operator::padded(z);
        }
    }
}
