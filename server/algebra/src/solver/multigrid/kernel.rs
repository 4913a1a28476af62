//! The operator of a level in the kernels of cells: eight of them at once.

use nalgebra::Matrix3;
use scindo_matter::element::Simd;
use scindo_matter::team::{Team, blocks};

use super::dense::PLACES;
use super::follow::LevelChange;
use super::galerkin::Galerkin;
use super::lanczos::{factor, largest_ritz_value};
use super::level::Level;
use super::matrices::{CellMatrix, LevelMatrices};
use super::stiff_springs::Columns;
use crate::operator::cells::{
    CellLane, CellMatrix as LaneMatrix, CellOperator, Given, STORED, SectorTable, morton_order, slot_corners,
    slot_hanging, stored_entry,
};
use crate::operator::{BLOCK, Inverse3, LinearOperator, Padded, block_of, invert, rows};

/// Places of xx, yy, zz in a block.
const DIAGONAL: [usize; 3] = [0, 4, 6];

/// Places in a packed matrix of the entries of the upper triangle, row by row.
const UPPER: [u16; STORED] = {
    let (mut places, mut r) = ([0; STORED], 0);
    while r < 24 {
        let mut s = r;
        while s < 24 {
            places[stored_entry(r, s)] = PLACES[r][s];
            s += 1;
        }
        r += 1;
    }
    places
};

/// The cells of a level, arranged for the kernels by the first update.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct LevelKernel {
    simd: Simd,
    /// What a matrix of a cell's own is held as.
    stored: LaneMatrix,
    operator: CellOperator,
    /// Matrices that the cells were arranged with.
    arranged: Vec<LaneMatrix>,
    /// Cells that were arranged anew in this update.
    moved: Vec<bool>,
    /// Of cells that cuts added since the last update, the ones they were part of; their numbers come last.
    origin: Vec<u32>,
    /// Cells that cuts moved to other vertices since the last update.
    cut: Vec<u32>,
    /// Whether no matrix was given yet.
    fresh: bool,
}

impl LevelKernel {
    /// No cells yet: which of them have a matrix of their own is known at the first update. If these are to be `half`,
    /// they are rounded to half precision; products take half the time then.
    pub(super) fn new(simd: Simd, half: bool) -> Self {
        Self {
            simd,
            stored: if half { LaneMatrix::Half } else { LaneMatrix::Stored },
            operator: CellOperator::new(simd, &[], &[], &[], 0),
            arranged: Vec::new(),
            moved: Vec::new(),
            origin: Vec::new(),
            cut: Vec::new(),
            fresh: true,
        }
    }

    /// Arranges the cells of `level`.
    fn arrange(&mut self, level: &Level, matrices: &LevelMatrices) {
        let n = level.cells.len();
        let lanes: Vec<CellLane> =
            (0..n).map(|id| lane(level, id, lane_matrix(matrices.matrix[id], self.stored))).collect();
        self.operator =
            CellOperator::new(self.simd, &[], &lanes, &morton_order(&level.cells), level.n_vertices);
        self.arranged = lanes.iter().map(|lane| lane.matrix).collect();
        self.moved.resize(n, true);
        self.origin.clear();
        self.cut.clear();
    }

    /// Takes note of a cut, which the next update follows.
    pub(super) fn follow_cut(&mut self, change: &LevelChange) {
        self.origin.extend_from_slice(&change.origin);
        self.cut.extend_from_slice(&change.moved);
    }

    /// Takes the matrices that cells of a kind share.
    fn set_tables(&mut self, galerkin: &Galerkin) {
        let table = |shared: &super::dense::Dense| SectorTable::of_matrix(&shared.wide()).0;
        self.operator.set_tables(&galerkin.shared.iter().map(table).collect::<Vec<_>>());
    }

    /// Follows an update of the matrices of level `l`; `anew` if those of the kinds changed.
    pub(super) fn follow(
        &mut self,
        team: &mut Team,
        level: &Level,
        (galerkin, l, anew): (&Galerkin, usize, bool),
    ) {
        if self.fresh {
            self.arrange(level, &galerkin.levels[l]);
        }
        // A cut can bring new kinds even where the constants stay.
        if anew || self.operator.n_tables() != galerkin.shared.len() {
            self.set_tables(galerkin);
        }
        let matrices = &galerkin.levels[l];
        let Self { operator, arranged, moved, origin, cut, stored, .. } = self;
        let lane_matrix = |matrix| lane_matrix(matrix, *stored);
        let (known, n) = (arranged.len(), level.cells.len());
        moved.resize(n, true);
        let mut any = !cut.is_empty();
        for ((arranged, moved), &matrix) in arranged.iter_mut().zip(&mut *moved).zip(&matrices.matrix) {
            let now = lane_matrix(matrix);
            *moved = *arranged != now;
            if *moved {
                (*arranged, any) = (now, true);
            }
        }
        arranged.extend(matrices.matrix[known..].iter().map(|&matrix| lane_matrix(matrix)));
        // All cells of a chunk that is arranged anew lose their matrices.
        if any {
            let lane = |id: u32| lane(level, id as usize, lane_matrix(matrices.matrix[id as usize]));
            // Without a cut the vertices stay, and only cells whose matrix is held in another form move.
            let renewed = if !cut.is_empty() {
                moved[known..].fill(true);
                cut.drain(..).for_each(|id| moved[id as usize] = true);
                let changed: Vec<u32> =
                    (0u32..).zip(&*moved).filter(|(_, moved)| **moved).map(|(id, _)| id).collect();
                // A new cell may come from one that an earlier cut of the series added: back to one that is arranged.
                let source = |mut id: u32| {
                    while let Some(new) = (id as usize).checked_sub(known) {
                        id = origin[new];
                    }
                    id
                };
                operator.follow(&changed, [n, level.n_vertices], &lane, &source)
            } else {
                operator.rearrange(team, lane, |id| moved[id as usize])
            };
            for chunk in renewed {
                operator.members(chunk).for_each(|id| moved[id as usize] = true);
            }
        }
        origin.clear();
        self.take_matrices(team, matrices);
    }

    /// Takes rotations and stored matrices.
    fn take_matrices(&mut self, team: &mut Team, matrices: &LevelMatrices) {
        let Self { operator, moved, fresh, .. } = self;
        let rotation =
            |id: u32| -> Matrix3<f32> { matrices.frame[id as usize].to_rotation_matrix().into_inner() };
        operator.set_rotations(team, rotation);
        operator.set_stored_rotations(team, rotation);
        let (moved, fresh) = (&*moved, std::mem::take(fresh));
        // Stored matrices are large, so only those that changed or lost their place are copied.
        operator.set_stored(team, &UPPER, |id| {
            let id = id as usize;
            let entries = match matrices.matrix[id] {
                CellMatrix::Stored(place) => &matrices.stored[place as usize].matrix,
                CellMatrix::Shared(_) => &[0.0; STORED],
            };
            Given { entries, changed: fresh || moved[id] || matrices.changed[id] }
        });
    }

    /// Bytes in use: all but stored matrices, and these.
    pub(super) fn memory(&self) -> [usize; 2] {
        let [operator, stored] = self.operator.memory();
        let lists = size_of_val(&self.arranged[..]) + size_of_val(&self.moved[..]);
        [operator + lists, stored]
    }

    /// Inverses of the diagonal blocks of A, with the lumped `mass` of every vertex; 0 in directions without
    /// stiffness and mass.
    pub(super) fn invert_diagonal(&mut self, team: &mut Team, mass: &[f32], out: &mut [Inverse3]) {
        self.operator.update_diagonals(team);
        let operator = &self.operator;
        team.for_blocks(blocks(out, BLOCK), |block, out| {
            let mut sums = [[0.0; 8]; BLOCK];
            let sums = &mut sums[..out.len()];
            for (sum, &mass) in sums.iter_mut().zip(block_of(mass, block)) {
                DIAGONAL.into_iter().for_each(|at| sum[at] = mass);
            }
            operator.add_diagonals(block, sums);
            for (out, sum) in out.iter_mut().zip(sums) {
                *out = invert(sum, DIAGONAL.map(|at| sum[at] == 0.0));
            }
        });
    }

    /// A bound from below of the largest eigenvalue of D⁻¹A on the vertices `near`, ascending, with all others held: the
    /// operator of these `cells` around them has changed. `inverse` is D⁻¹.
    pub(super) fn largest_near(
        &mut self,
        (cells, near): (impl Iterator<Item = u32>, &[u32]),
        (mass, inverse): (&[f32], &[Inverse3]),
        iterations: usize,
    ) -> f64 {
        let patch = self.operator.patch(cells, near);
        let mut r: Vec<Padded> = near.iter().map(|&v| noise(v)).collect();
        let mut q = vec![[0.0; 4]; near.len()];
        let (mut z, mut p) = (q.clone(), q.clone());
        largest_ritz_value(iterations, |alpha, before| {
            for ((r, q), (z, &v)) in r.iter_mut().zip(&q).zip(z.iter_mut().zip(near)) {
                (0..4).for_each(|k| r[k] -= alpha * q[k]);
                *z = inverse[v as usize].times(r);
            }
            let product = rows::dot(&r, &z);
            let beta = factor(product, before) as f32;
            p.iter_mut().zip(&z).for_each(|(p, z)| rows::direction(p, z, beta));
            self.operator.multiply_patch(&patch, &p, &mut q);
            for ((q, p), &v) in q.iter_mut().zip(&p).zip(near) {
                (0..4).for_each(|k| q[k] += mass[v as usize] * p[k]);
            }
            [product, rows::dot(&p, &q)]
        })
    }

    /// y = A x, with the lumped `mass` of every vertex.
    pub(super) fn apply(&mut self, team: &mut Team, mass: &[f32], x: &[Padded], y: &mut [Padded]) {
        self.start(team, x);
        let kernel = &*self;
        team.for_blocks(blocks(y, BLOCK), |block, y| kernel.finish(block, mass, block_of(x, block), y));
    }

    /// First half of a product with `x`.
    pub(super) fn start(&mut self, team: &mut Team, x: &[Padded]) {
        self.operator.multiply(team, x);
    }

    /// Second half: y = A x of the vertices of block number `block`, where `x` has their entries.
    #[inline]
    pub(super) fn finish(&self, block: usize, mass: &[f32], x: &[Padded], y: &mut [Padded]) {
        for (y, (x, &mass)) in y.iter_mut().zip(x.iter().zip(block_of(mass, block))) {
            *y = x.map(|x| mass * x);
        }
        self.operator.add_products(block, y);
    }
}

/// The operator of a level, with its stiff springs.
#[derive(Debug)]
pub(super) struct LevelSystem<'a> {
    /// The cells.
    pub kernel: &'a mut LevelKernel,
    /// Lumped mass of every vertex.
    pub mass: &'a [f32],
    /// The springs.
    pub columns: &'a Columns,
}

impl LinearOperator for LevelSystem<'_> {
    fn apply(&mut self, team: &mut Team, x: &[Padded], y: &mut [Padded]) {
        self.kernel.apply(team, self.mass, x, y);
        self.columns.add_to(x, y);
    }

    fn start(&mut self, team: &mut Team, x: &[Padded]) -> bool {
        let halves = self.columns.is_empty();
        if halves {
            self.kernel.start(team, x);
        }
        halves
    }

    fn finish(&self, block: usize, x: &[Padded], y: &mut [Padded]) {
        self.kernel.finish(block, self.mass, x, y);
    }
}

/// Numbers between −1 and 1 that depend on a vertex: where estimates of eigenvalues start.
pub(super) fn noise(v: u32) -> Padded {
    let number = |k: u32| (v.wrapping_mul(3).wrapping_add(k)).wrapping_mul(2_654_435_761) >> 8;
    [0, 1, 2, 3].map(|k| if k < 3 { number(k) as f32 / (1 << 23) as f32 - 1.0 } else { 0.0 })
}

fn lane(level: &Level, id: usize, matrix: LaneMatrix) -> CellLane {
    let (octant, vertices) = (level.cells[id].octant() as u8, level.vertices[id]);
    match matrix {
        LaneMatrix::Table(_) => CellLane {
            vertices: slot_corners(vertices, octant),
            octant,
            hanging: slot_hanging(level.hanging[id], octant),
            matrix,
            factor: 1.0,
        },
        // A stored matrix is over the vertices themselves.
        _ => CellLane { vertices, octant: 0, hanging: 0, matrix, factor: 1.0 },
    }
}

fn lane_matrix(matrix: CellMatrix, stored: LaneMatrix) -> LaneMatrix {
    match matrix {
        CellMatrix::Shared(kind) => LaneMatrix::Table(kind as u16),
        CellMatrix::Stored(_) => stored,
    }
}
