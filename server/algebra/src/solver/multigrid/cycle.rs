//! Cycles over the levels of a body.

use nalgebra::{Matrix3, Vector3};
use scindo_matter::element::FixedCopy;
use scindo_matter::element::Simd;
use scindo_matter::octree::Octree;
use scindo_matter::storage::reserve::resize_reserving;
use scindo_matter::team::{Team, blocks};

use super::bounds::LeafBounds;
use super::coarsest::{Coarsest, CoarsestSolve};
use super::follow::LevelChange;
use super::galerkin::{Coefficients, Galerkin};
use super::hierarchy::Hierarchy;
use super::kernel::{LevelKernel, LevelSystem, noise};
use super::lanczos::{factor, largest_ritz_value};
use super::matrices::CellMatrix;
use super::smoother::{Diagonal, Smoother, Smoothing, Stage, chebyshev, degree_on, gauss_seidel, subtract};
use super::stiff_springs::{Columns, SpringBlocks, Sprung};
use crate::operator::{BLOCK, Inverse3, LinearOperator, Padded, Spring, block_of, filter, rows};

/// Lanczos iterations for the largest eigenvalue of D⁻¹A.
const ITERATIONS: usize = 15;
/// They estimate it from below; the smoother must not see a larger one.
const SAFETY: f64 = 1.05;

/// Settings of the cycles.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct MultigridSettings {
    /// Smoother, before and after each correction.
    pub smoother: Smoother,
    /// Rotations within a merged cell that differ from their mean by no more than this [rad] count as equal. 0
    /// gives exact Galerkin operators.
    pub same_rotation_rad: f64,
    /// Whether matrices of coarse cells are rounded to half precision where smoothing multiplies with them: cycles
    /// wait for memory less. Coarser matrices are made of those in single precision. Without effect on cycles with
    /// several visits, where residuals of smooth solutions of a coarse level count: they are smaller than the rounding.
    pub half_precision: bool,
    /// How often a cycle works on every coarse level before it goes back to the finer one: once in a V-cycle, twice in a
    /// W-cycle. The coarsest level is solved each time.
    pub visits: u8,
    /// Instructions of the kernels.
    pub simd: Simd,
}

/// The order in which a cycle goes through the levels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum CycleShape {
    /// Down to the coarsest level and up again.
    #[default]
    V,
    /// From every level twice down to the next one.
    W,
}

impl From<CycleShape> for MultigridSettings {
    fn from(shape: CycleShape) -> Self {
        let visits = match shape {
            CycleShape::V => 1,
            CycleShape::W => 2,
        };
        Self { visits, ..Self::default() }
    }
}

impl Default for MultigridSettings {
    fn default() -> Self {
        Self {
            smoother: Smoother::default(),
            same_rotation_rad: 0.1,
            half_precision: true,
            visits: 1,
            simd: Simd::detect(),
        }
    }
}

/// Figures of one level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LevelReport {
    /// Number of cells.
    pub cells: usize,
    /// Number of vertices.
    pub vertices: usize,
    /// Cells with a matrix of their own.
    pub stored: usize,
    /// Estimate of the largest eigenvalue of D⁻¹A, from above.
    pub largest_eigenvalue: f64,
}

/// Multigrid for one body: hierarchy, operators and vectors.
///
/// Nothing is allocated between cuts, unless more cells need a matrix of their own.
#[derive(Debug, serde::Serialize, serde::Deserialize)]
pub struct Multigrid {
    settings: MultigridSettings,
    pub(super) hierarchy: Hierarchy,
    pub(super) galerkin: Galerkin,
    coarsest: Coarsest,
    pub(super) levels: Vec<Vectors>,
    /// The level that is solved on. Its operator is given from outside.
    pub(super) first: usize,
    /// Prescribed directions there.
    fixed: Vec<FixedCopy>,
    /// Whether λ has to be estimated anew.
    stale: bool,
    /// Cells by level that cuts changed since λ was estimated.
    cut: Vec<Vec<u32>>,
    leaf_bounds: LeafBounds,
    partial: Vec<f64>,
}

/// Vectors of one level, one entry per vertex. The level that is solved on has its solution outside; finer ones
/// have scratch for restriction and prolongation alone.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Vectors {
    pub(super) inverse: Vec<Inverse3>,
    pub(super) largest: f64,
    pub(super) x: Vec<Padded>,
    pub(super) b: Vec<Padded>,
    r: Vec<Padded>,
    d: Vec<Padded>,
    q: Vec<Padded>,
    /// Right-hand side, and solution so far, of levels that are visited more than once.
    whole: [Vec<Padded>; 2],
    /// Below the level that is solved on its operator.
    pub(super) kernel: Option<LevelKernel>,
    /// Stiff springs.
    columns: Columns,
    spring_blocks: SpringBlocks,
}

impl Vectors {
    /// Follows the `change` of level `l`, which has `n` vertices now; the equations are on level `first`.
    fn follow(&mut self, (l, first): (usize, usize), n: usize, change: &LevelChange) {
        let Self { inverse, x, b, r, d, q, kernel, whole: [all, known], .. } = self;
        let inner = l > 0 && l != first;
        let again = !all.is_empty();
        let vectors = [
            (x, inner),
            (b, inner),
            (r, l >= first),
            (d, l >= first),
            (q, l >= first),
            (all, again),
            (known, again),
        ];
        for (vector, used) in vectors {
            if used {
                resize_reserving(vector, n, [0.0; 4]);
            }
        }
        if l > first {
            resize_reserving(inverse, n, Inverse3::default());
        }
        if let Some(kernel) = kernel {
            kernel.follow_cut(change);
        }
    }
}

/// Columns of stiff springs up to which cycles take them: their dense factors stay small beside the vectors.
const MOST_COLUMNS: usize = 128;

impl Multigrid {
    /// Multigrid on `hierarchy`. [`update`](Self::update) comes before the first cycle.
    pub fn new(hierarchy: Hierarchy, settings: MultigridSettings) -> Self {
        Self::on_level(hierarchy, settings, 0)
    }

    /// The same with equations on level `first`, if there is one, and else on the coarsest level.
    pub(super) fn on_level(mut hierarchy: Hierarchy, settings: MultigridSettings, first: usize) -> Self {
        // Thin cells above the finest level are found by its slots.
        if first == 0 || matches!(settings.smoother, Smoother::GaussSeidel { .. }) {
            hierarchy.list_finest_slots();
        }
        let first = first.min(hierarchy.n_levels() - 1);
        let mut galerkin = Galerkin::new(&hierarchy);
        galerkin.solve_on(&hierarchy, first);
        let levels = hierarchy.levels.iter().enumerate().map(|(l, level)| {
            let n = level.n_vertices;
            let if_needed = |needed: bool| if needed { vec![[0.0; 4]; n] } else { Vec::new() };
            let (zeros, inner) = (|| if_needed(l >= first), || if_needed(l > 0 && l != first));
            // On the level that is solved on a kernel is the operator of the equations.
            let half = settings.half_precision && settings.visits < 2 && l > first;
            let kernel = (l > 0 && l >= first).then(|| LevelKernel::new(settings.simd, half));
            Vectors {
                inverse: if l > first { vec![Inverse3::default(); n] } else { Vec::new() },
                largest: if l < first { 0.0 } else { 1.0 },
                x: inner(),
                b: inner(),
                r: zeros(),
                d: zeros(),
                q: zeros(),
                whole: [(); 2].map(|()| if_needed(l > first && settings.visits > 1)),
                kernel,
                columns: Columns::default(),
                spring_blocks: SpringBlocks::default(),
            }
        });
        let levels = levels.collect();
        Self {
            settings,
            galerkin,
            coarsest: Coarsest::new(&hierarchy),
            levels,
            first,
            fixed: Vec::new(),
            stale: true,
            cut: vec![Vec::new(); hierarchy.levels.len()],
            leaf_bounds: LeafBounds::default(),
            partial: vec![0.0; hierarchy.levels[first].n_vertices.div_ceil(BLOCK)],
            hierarchy,
        }
    }

    /// Follows a cut of `octree` that changed the leaves `changed`, ascending, and left the numbers of all others; an
    /// [update](Self::update) comes next. The task `beside` is run meanwhile. Returns `false` if the levels have to be
    /// made anew, and this is then of no more use.
    pub fn follow(
        &mut self,
        team: &mut Team,
        (octree, changed): (&Octree, &[u32]),
        beside: &mut (dyn FnMut() + Send),
    ) -> bool {
        let Self { hierarchy, galerkin, levels, first, .. } = self;
        let mut changes = None;
        team.run(&mut [&mut || changes = hierarchy.follow(octree, changed), beside]);
        let Some(changes) = changes else { return false };
        hierarchy.follow_transfers(team, &changes, &mut |hierarchy| {
            galerkin.follow(hierarchy, &changes);
            for (l, (change, vectors)) in changes.iter().zip(&mut *levels).enumerate() {
                vectors.follow((l, *first), hierarchy.levels[l].n_vertices, change);
            }
        });
        galerkin.hold_coarse(hierarchy);
        self.forget_springs();
        if changes.last().is_some_and(|change| !change.moved.is_empty()) {
            self.coarsest.renew(&self.hierarchy);
        }
        self.partial.resize(self.hierarchy.levels[self.first].n_vertices.div_ceil(BLOCK), 0.0);
        changes.into_iter().zip(&mut self.cut).for_each(|(change, cut)| cut.extend(change.cells));
        true
    }

    /// Brings the coarse operators up to date with the constants, the prescribed directions and the rotation of
    /// every leaf. What has not changed is kept. [`estimate_eigenvalues`](Self::estimate_eigenvalues) comes next.
    pub fn update(
        &mut self,
        team: &mut Team,
        (with, fixed): (&Coefficients, &[FixedCopy]),
        rotation: &(dyn Fn(u32) -> Matrix3<f32> + Sync),
    ) {
        let Self { settings, hierarchy, galerkin, coarsest, levels, first, .. } = self;
        let tolerance = settings.same_rotation_rad;
        let updated = galerkin.update(team, hierarchy, (with, fixed), rotation, tolerance);
        self.fixed.clear();
        if *first == 0 {
            self.fixed.extend_from_slice(fixed);
        } else {
            let held = |&(copy, held)| FixedCopy { copy, held, position_m: [0.0; 3] };
            self.fixed.extend(galerkin.held().iter().map(held));
        }
        for l in (*first).max(1)..levels.len() {
            let Vectors { kernel: Some(kernel), inverse, .. } = &mut levels[l] else { continue };
            kernel.follow(team, &hierarchy.levels[l], (galerkin, l, updated.constants));
            if l > *first {
                kernel.invert_diagonal(team, &galerkin.levels[l].mass, inverse);
            }
        }
        coarsest.update(hierarchy, galerkin, updated.matrices, tolerance);
        self.stale |= updated.constants || updated.released;
    }

    /// Lets the cycles take these stiff `springs` of the operator of the finest level on all levels, after an update.
    /// `inverse` gives the inverse of its diagonal block of a vertex without springs. Returns a bound of the largest
    /// eigenvalue of the smoother on that level, or `None` if the springs are too many; the cycles take none then.
    pub fn set_springs(&mut self, springs: &[Spring], inverse: impl Fn(u32) -> Inverse3) -> Option<f64> {
        let Self { hierarchy, levels, fixed, galerkin, leaf_bounds, coarsest, first, .. } = self;
        if *first > 0 {
            return None;
        }
        let free = |copy: u32, mut w: [f64; 3]| {
            if let Ok(at) = fixed.binary_search_by_key(&copy, |f| f.copy) {
                let mut v = Vector3::from(w);
                fixed[at].held.clear(&mut v);
                w = v.into();
            }
            w
        };
        levels[0].columns.set(springs, free);
        let mut fits = levels[0].columns.len() <= MOST_COLUMNS;
        for l in 0..levels.len() {
            let (finer, level) = levels.split_at_mut(l);
            let Vectors { inverse: own, columns, spring_blocks, .. } = &mut level[0];
            if let Some(finer) = finer.last().filter(|_| fits) {
                let (fine, coarse, step) =
                    (&hierarchy.levels[l - 1], &hierarchy.levels[l], &hierarchy.steps[l - 1]);
                columns.restrict(&finer.columns, &step.transfer, |v, visit| {
                    let child = if fine.has_slots() { fine.slots_of(v as usize).next() } else { None };
                    if let Some((child, _)) = child {
                        galerkin.levels[l].for_inner_row((coarse, step), (v, child), visit);
                    }
                });
            }
            fits =
                fits && spring_blocks.prepare(columns, |v| if l == 0 { inverse(v) } else { own[v as usize] });
        }
        fits = fits && levels.last().is_some_and(|last| coarsest.set_springs(&last.columns));
        if !fits {
            self.clear_springs();
            return None;
        }
        let bound = galerkin.coefficients().map(|with| leaf_bounds.largest(&hierarchy.levels[0], &[], with));
        Some(bound.unwrap_or(0.0).max(1.0))
    }

    /// Lets the cycles take no stiff springs.
    pub fn clear_springs(&mut self) {
        self.forget_springs();
        self.coarsest.set_springs(&Columns::default());
    }

    fn forget_springs(&mut self) {
        self.levels.iter_mut().for_each(|level| level.columns.clear());
    }

    /// Whether the last update had these constants and prescribed directions.
    pub fn is_made_for(&self, with: &Coefficients, fixed: &[FixedCopy]) -> bool {
        self.galerkin.is_made_for(with, fixed)
    }

    /// Estimates the largest eigenvalue of D⁻¹A of every level if constants changed or prescribed directions were
    /// released since the last time. `A` is the operator of the finest level and `inverse` has the inverses of its
    /// diagonal blocks. After cuts the estimates [rise](Self::raise_eigenvalues) where that is necessary.
    pub fn estimate_eigenvalues(
        &mut self,
        team: &mut Team,
        A: &mut dyn LinearOperator,
        inverse: &[Inverse3],
    ) {
        if std::mem::take(&mut self.stale) {
            self.cut.iter_mut().for_each(Vec::clear);
            self.leaf_bounds.clear();
            for l in self.first..self.levels.len() {
                self.estimate(team, (&mut *A, inverse), l, ITERATIONS);
            }
        } else if self.cut.iter().any(|cut| !cut.is_empty()) {
            self.raise_eigenvalues(team, A, inverse);
        }
    }

    /// Raises the estimates after cuts, so that the smoother sees no larger eigenvalues.
    ///
    /// On the finest level a [bound](super::bounds) holds however the body is cut. On coarse levels a cut changes the
    /// equations of the vertices of touched cells alone, and A and D are sums over cells that stay the same elsewhere.
    /// An eigenvalue above those before belongs to a vector around these vertices, and Lanczos iterations there find it
    /// as surely as those on all vertices: from below, with the same safety factor. That is no proof. A Chebyshev
    /// polynomial with the weights of the smoother still diminishes vectors somewhat above the given eigenvalue: up to
    /// 1.17 times with degree 2, and 1.03 times with degree 8. Tests of random cuts show that estimates with the safety factor are not
    /// below.
    fn raise_eigenvalues(&mut self, team: &mut Team, A: &mut dyn LinearOperator, inverse: &[Inverse3]) {
        for l in 0..self.levels.len() {
            let mut cells = std::mem::take(&mut self.cut[l]);
            if l < self.first {
                continue;
            }
            cells.sort_unstable();
            cells.dedup();
            let known = self.levels[l].largest;
            if l == 0 {
                if let Some(with) = self.galerkin.coefficients() {
                    let bound = self.leaf_bounds.largest(&self.hierarchy.levels[0], &cells, with);
                    self.levels[0].largest = known.max(bound);
                }
            } else if l == self.first {
                self.estimate(team, (&mut *A, inverse), l, ITERATIONS);
                self.levels[l].largest = known.max(self.levels[l].largest);
            } else if let Vectors { kernel: Some(kernel), inverse, largest, .. } = &mut self.levels[l] {
                let level = &self.hierarchy.levels[l];
                let mut near: Vec<u32> = cells.iter().flat_map(|&id| level.vertices[id as usize]).collect();
                near.sort_unstable();
                near.dedup();
                // Where much was cut, products with the whole operator cost less.
                if 2 * near.len() > level.n_vertices {
                    self.estimate(team, (&mut *A, &[]), l, ITERATIONS);
                    self.levels[l].largest = known.max(self.levels[l].largest);
                    continue;
                }
                let around = near.iter().flat_map(|&v| level.slots_of(v as usize)).map(|(id, _)| id as u32);
                let mass = &self.galerkin.levels[l].mass;
                let found = kernel.largest_near((around, &near), (mass, inverse), ITERATIONS);
                *largest = known.max(SAFETY * found);
            }
        }
    }

    /// Estimates the largest eigenvalue of level `l`, from the same vector each time.
    fn estimate(
        &mut self,
        team: &mut Team,
        (A, inverse): (&mut dyn LinearOperator, &[Inverse3]),
        l: usize,
        iterations: usize,
    ) {
        let Self { galerkin, levels, fixed, partial, first, .. } = self;
        let Vectors { inverse: own, largest, r, d, q, kernel, .. } = &mut levels[l];
        let inverse = if l == *first { inverse } else { &own[..] };
        (0_u32..).zip(r.iter_mut()).for_each(|(v, r)| *r = noise(v));
        if l == *first {
            filter(fixed, r);
        }
        let partial = &mut partial[..r.len().div_ceil(BLOCK)];
        q.fill([0.0; 4]);
        let found = largest_ritz_value(iterations, |alpha, before| {
            let state = (blocks(r, BLOCK), blocks(q, BLOCK), blocks(partial, 1));
            team.for_blocks(state, |block, (r, z, partial)| {
                for (r, q) in r.iter_mut().zip(&*z) {
                    (0..4).for_each(|k| r[k] -= alpha * q[k]);
                }
                partial[0] = rows::precondition(block_of(inverse, block), r, z);
            });
            let product: f64 = partial.iter().sum();
            let beta = factor(product, before) as f32;
            let z = &*q;
            team.for_blocks(blocks(d, BLOCK), |block, d| {
                d.iter_mut().zip(block_of(z, block)).for_each(|(p, z)| rows::direction(p, z, beta));
            });
            match kernel {
                Some(kernel) => kernel.apply(team, &galerkin.levels[l].mass, d, q),
                None => A.apply(team, d, q),
            }
            let (p, q) = (&*d, &*q);
            team.for_blocks(blocks(partial, 1), |block, partial| {
                partial[0] = rows::dot(block_of(p, block), block_of(q, block));
            });
            [product, partial.iter().sum()]
        });
        *largest = if found > 0.0 { SAFETY * found } else { 1.0 };
    }

    /// z = V r: one cycle on A z = r from z = 0. `inverse` has the inverse diagonal blocks of A.
    ///
    /// `largest` raises the largest eigenvalue of the finest level, where terms were added to A since the update.
    pub fn cycle(
        &mut self,
        team: &mut Team,
        A: &mut dyn LinearOperator,
        (inverse, largest): (&[Inverse3], f64),
        r: &[Padded],
        z: &mut [Padded],
    ) {
        let first = self.first;
        if first + 1 == self.levels.len() {
            z.fill([0.0; 4]);
            return self.solve_coarsest(team, A, (inverse, largest), Some((r, z)));
        }
        self.smooth(team, A, (first, inverse, largest), (r, z), true);
        self.correct(team, A, first);
        filter(&self.fixed, &mut self.levels[first].d);
        self.smooth(team, A, (first, inverse, largest), (r, z), false);
    }

    /// Restricts the residual of level `l`, solves on the next one, and leaves the correction in `d`.
    fn correct(&mut self, team: &mut Team, A: &mut dyn LinearOperator, l: usize) {
        let (fine, coarse) = self.levels.split_at_mut(l + 1);
        let (r, b) = (&fine[l].r, &mut coarse[0].b);
        let (transfer, level) = (&self.hierarchy.steps[l].transfer, &self.hierarchy.levels[l + 1]);
        transfer.restrict(team, r, b);
        self.galerkin.levels[l + 1].restrict_inner(team, level, r, b);
        self.solve_level(team, A, l + 1);
        let (fine, coarse) = self.levels.split_at_mut(l + 1);
        let (e, d) = (&coarse[0].x, &mut fine[l].d);
        let (transfer, level) = (&self.hierarchy.steps[l].transfer, &self.hierarchy.levels[l + 1]);
        transfer.prolong(team, e, d);
        self.galerkin.levels[l + 1].prolong_inner(team, level, e, d);
    }

    /// x ≈ A⁻¹ b on a coarse level.
    fn solve_level(&mut self, team: &mut Team, A: &mut dyn LinearOperator, l: usize) {
        if l + 1 == self.levels.len() {
            return self.solve_coarsest(team, A, (&[], 0.0), None);
        }
        self.visit(team, A, l);
        for again in 1..self.settings.visits {
            let Vectors { x, b, q, whole: [all, known], kernel, columns, .. } = &mut self.levels[l];
            let Some(kernel) = kernel else { return };
            if again == 1 {
                all.copy_from_slice(b);
            }
            known.copy_from_slice(x);
            b.copy_from_slice(all);
            LevelSystem { kernel, mass: &self.galerkin.levels[l].mass, columns }.apply(team, x, q);
            subtract(b, q);
            self.visit(team, A, l);
            let Vectors { x, whole: [_, known], .. } = &mut self.levels[l];
            for (x, known) in x.iter_mut().zip(known) {
                (0..4).for_each(|k| x[k] += known[k]);
            }
        }
    }

    /// One cycle from 0 on a coarse level.
    fn visit(&mut self, team: &mut Team, A: &mut dyn LinearOperator, l: usize) {
        self.smooth_inner(team, A, l, true);
        self.correct(team, A, l);
        self.smooth_inner(team, A, l, false);
    }

    fn smooth_inner(&mut self, team: &mut Team, A: &mut dyn LinearOperator, l: usize, before: bool) {
        let Vectors { x, b, inverse, .. } = &mut self.levels[l];
        let (mut x, b, inverse) = (std::mem::take(x), std::mem::take(b), std::mem::take(inverse));
        self.smooth(team, A, (l, &inverse, 0.0), (&b, &mut x), before);
        let level = &mut self.levels[l];
        (level.x, level.b, level.inverse) = (x, b, inverse);
    }

    /// Smooths on level `l` before the correction, which leaves the residual in `r`, or after it, with the
    /// correction in `d`.
    fn smooth(
        &mut self,
        team: &mut Team,
        A: &mut dyn LinearOperator,
        (l, inverse, largest): (usize, &[Inverse3], f64),
        (b, x): (&[Padded], &mut [Padded]),
        before: bool,
    ) {
        let Self { settings, hierarchy, galerkin, levels, first, .. } = self;
        let first = *first;
        let operator = galerkin.operator(&hierarchy.levels[l], l);
        let Vectors { largest: known, r, d, q, kernel, columns, spring_blocks, .. } = &mut levels[l];
        let (columns, mass) = (&*columns, &galerkin.levels[l].mass[..]);
        let mut system = kernel.as_mut().map(|kernel| LevelSystem { kernel, mass, columns });
        let A: &mut dyn LinearOperator = match &mut system {
            Some(system) => system,
            None => A,
        };
        match settings.smoother {
            Smoother::Chebyshev { degree, most } => {
                let degree = degree_on(l - first, degree, most);
                let sprung = (!columns.is_empty()).then_some(Sprung { columns, blocks: spring_blocks });
                let diagonal = Diagonal { inverse, largest: largest.max(*known), sprung };
                let stage = if before { Stage::Before } else { Stage::After };
                chebyshev(team, A, diagonal, degree, (Smoothing { b, x, r, d, q }, stage));
            }
            Smoother::GaussSeidel { sweeps, omega } => {
                if before {
                    x.fill([0.0; 4]);
                } else {
                    for (x, d) in x.iter_mut().zip(&*d) {
                        (0..4).for_each(|k| x[k] += d[k]);
                    }
                }
                (0..sweeps).for_each(|_| gauss_seidel(&operator, inverse, b, x, omega));
                if before {
                    r.copy_from_slice(b);
                    A.apply(team, x, q);
                    subtract(r, q);
                }
            }
        }
    }

    /// Solves on the coarsest level; `outer` has its right-hand side and solution if that is the finest one.
    fn solve_coarsest(
        &mut self,
        team: &mut Team,
        A: &mut dyn LinearOperator,
        (inverse, largest): (&[Inverse3], f64),
        outer: Option<(&[Padded], &mut [Padded])>,
    ) {
        let Self { galerkin, coarsest, levels, .. } = self;
        let last = levels.len() - 1;
        let is_outer = outer.is_some();
        let Vectors { inverse: own, largest: known, x, b, r, d, q, kernel, columns, spring_blocks, .. } =
            &mut levels[last];
        let columns = &*columns;
        let (b, x, inverse) = match outer {
            Some((b, x)) => (b, x, inverse),
            None => (&b[..], &mut x[..], &own[..]),
        };
        match coarsest.solve_kind() {
            CoarsestSolve::Cholesky => coarsest.solve(b, x),
            CoarsestSolve::Sweeps { degree } => {
                let mass = &galerkin.levels[last].mass[..];
                let mut system = kernel.as_mut().map(|kernel| LevelSystem { kernel, mass, columns });
                let A: &mut dyn LinearOperator = match &mut system {
                    Some(system) => system,
                    None => A,
                };
                let largest = known.max(if is_outer { largest } else { 0.0 });
                let sprung = (!columns.is_empty()).then_some(Sprung { columns, blocks: spring_blocks });
                let diagonal = Diagonal { inverse, largest, sprung };
                chebyshev(team, A, diagonal, degree, (Smoothing { b, x, r, d, q }, Stage::Alone));
            }
        }
    }

    /// The largest eigenvalue of level `l` by many iterations; the estimate stays.
    #[cfg(test)]
    pub(super) fn true_eigenvalue(
        &mut self,
        team: &mut Team,
        A: &mut dyn LinearOperator,
        inverse: &[Inverse3],
        l: usize,
    ) -> f64 {
        let known = self.levels[l].largest;
        self.estimate(team, (A, inverse), l, 300);
        std::mem::replace(&mut self.levels[l].largest, known) / SAFETY
    }

    /// Figures of every level, from the finest on, and how the coarsest one is solved.
    pub fn report(&self) -> (Vec<LevelReport>, CoarsestSolve) {
        let levels = self.hierarchy.levels.iter().zip(&self.galerkin.levels).zip(&self.levels);
        let levels = levels.map(|((level, matrices), vectors)| LevelReport {
            cells: level.cells.len(),
            vertices: level.n_vertices,
            stored: matrices.matrix.iter().filter(|m| matches!(m, CellMatrix::Stored(_))).count(),
            largest_eigenvalue: vectors.largest,
        });
        (levels.collect(), self.coarsest.solve_kind())
    }

    /// Bytes in use: all but stored matrices, and these. The factor of the coarsest level is left out.
    pub fn memory(&self) -> [usize; 2] {
        let vectors = |level: &Vectors| {
            let Vectors { inverse, x, b, r, d, q, whole: [all, known], .. } = level;
            size_of_val(&inverse[..])
                + [x, b, r, d, q, all, known].iter().map(|v| size_of_val(&v[..])).sum::<usize>()
        };
        let kernels = self.levels.iter().filter_map(|level| level.kernel.as_ref()).map(LevelKernel::memory);
        let parts = kernels.chain([self.galerkin.memory()]);
        let [others, stored] = parts.fold([0, 0], |[a, b], [c, d]| [a + c, b + d]);
        [others + self.hierarchy.memory() + self.levels.iter().map(vectors).sum::<usize>(), stored]
    }

    /// What it was made with.
    pub fn settings(&self) -> &MultigridSettings {
        &self.settings
    }

    /// Number of vertices of the finest level.
    pub fn n_vertices(&self) -> usize {
        self.hierarchy.n_vertices()
    }

    /// Cells, vertices and transfers.
    pub fn hierarchy(&self) -> &Hierarchy {
        &self.hierarchy
    }

    /// Estimate of the largest eigenvalue of D⁻¹A of the level that is solved on, from above.
    pub fn largest_eigenvalue(&self) -> f64 {
        self.levels[self.first].largest
    }
}
