//! A coarse level as the one that is simulated: composite finite elements.
//!
//! The body keeps its state on the finest vertices, and moves by increments F P d: P is the prolongation from the
//! simulated level ℓ, and F leaves out prescribed directions. The equations of d are those of the Galerkin operator
//! PᵀF A F P, which sees cuts and materials as fine as the cells. Where a vertex of level ℓ is the same as a
//! prescribed one, d is 0, too.
//!
//! # Source
//! Nesme, Kry, Jeřábková, Faure 2009, *Preserving topology and elasticity for embedded deformable models*; Wu, Dick,
//! Westermann 2011, *Interactive high-resolution boundary surfaces for deformable bodies with changing topology*.

use nalgebra::Matrix3;
use scindo_matter::element::{FixedCopy, Held};
use scindo_matter::octree::Octree;
use scindo_matter::team::Team;

use super::cycle::{Multigrid, MultigridSettings};
use super::galerkin::{Coefficients, Galerkin};
use super::hierarchy::Hierarchy;
use super::kernel::LevelKernel;
use super::level::NONE;
use super::matrices::INCLINED;
use super::precondition::Cycle;
use super::restricted::RestrictedSprings;
use crate::operator::{
    BlockJacobi, LinearOperator, Padded, Preconditioner, Spring, filter, filter_block, invert, invert_free,
};

/// Springs stiffer than this times the body at their point are left to block-Jacobi.
const STIFFEST_SPRING: f64 = 1.0;

/// The simulated level of a body: its operator, springs, prescribed directions and preconditioners.
#[derive(Debug, serde::Serialize, serde::Deserialize)]
pub struct Composite {
    multigrid: Multigrid,
    /// The operator of the level.
    kernel: Option<LevelKernel>,
    /// Lumped masses that belong to it, by vertex.
    mass: Vec<f32>,
    jacobi: BlockJacobi,
    springs: RestrictedSprings,
    /// Vertices whose inverse block contains springs.
    sprung: Vec<u32>,
    held: Vec<FixedCopy>,
    /// λ of the level with springs; 0 without.
    largest: f64,
    /// Whether the springs of the present solve allow cycles.
    active: bool,
    row: RowBuffers,
}

/// Buffers in which rows of the composed prolongation are made.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct RowBuffers {
    row: Vec<(u32, f32)>,
    next: Vec<(u32, f32)>,
}

/// The operator of the simulated level, springs included, as one that borrows its parts.
#[derive(Debug)]
pub struct CompositeSystem<'a> {
    kernel: &'a mut Option<LevelKernel>,
    mass: &'a [f32],
    springs: &'a RestrictedSprings,
    held: &'a [FixedCopy],
}

impl LinearOperator for CompositeSystem<'_> {
    fn apply(&mut self, team: &mut Team, x: &[Padded], y: &mut [Padded]) {
        if let Some(kernel) = self.kernel {
            kernel.apply(team, self.mass, x, y);
        }
        self.springs.add_to(x, y);
        filter(self.held, y);
    }

    fn start(&mut self, team: &mut Team, x: &[Padded]) -> bool {
        debug_assert!(self.held.is_sorted_by_key(|f| f.copy));
        match self.kernel {
            Some(kernel) if self.springs.is_empty() => {
                kernel.start(team, x);
                true
            }
            _ => false,
        }
    }

    fn finish(&self, block: usize, x: &[Padded], y: &mut [Padded]) {
        if let Some(kernel) = &*self.kernel {
            kernel.finish(block, self.mass, x, y);
        }
        filter_block(self.held, block, y);
    }
}

/// The preconditioner of the simulated level.
#[derive(Debug)]
pub enum CompositePreconditioner<'a> {
    /// One cycle over this level and those below.
    Cycle(Cycle<'a>),
    /// The diagonal blocks, where springs are too stiff for cycles.
    BlockJacobi(&'a mut BlockJacobi),
}

impl Preconditioner for CompositePreconditioner<'_> {
    fn uses_operator(&self) -> bool {
        matches!(self, Self::Cycle(_))
    }

    fn apply(
        &mut self,
        team: &mut Team,
        A: &mut dyn LinearOperator,
        r: &[Padded],
        z: &mut [Padded],
        partial: &mut [f64],
    ) -> f64 {
        match self {
            Self::Cycle(cycle) => cycle.apply(team, A, r, z, partial),
            Self::BlockJacobi(jacobi) => jacobi.apply(team, A, r, z, partial),
        }
    }
}

impl Composite {
    /// Level `level` of `hierarchy`, or its coarsest one if it has fewer. [`update`](Self::update) comes before
    /// everything else.
    pub fn new(hierarchy: Hierarchy, settings: MultigridSettings, level: usize) -> Self {
        let mut multigrid = Multigrid::on_level(hierarchy, settings, level);
        let first = multigrid.first;
        let mut jacobi = BlockJacobi::default();
        jacobi.resize(multigrid.hierarchy.levels[first].n_vertices);
        Self {
            kernel: multigrid.levels[first].kernel.take(),
            multigrid,
            mass: Vec::new(),
            jacobi,
            springs: RestrictedSprings::default(),
            sprung: Vec::new(),
            held: Vec::new(),
            largest: 0.0,
            active: true,
            row: RowBuffers::default(),
        }
    }

    /// All levels, of which those above the simulated one only carry it.
    pub fn multigrid(&self) -> &Multigrid {
        &self.multigrid
    }

    /// Number of the simulated level.
    pub fn level(&self) -> usize {
        self.multigrid.first
    }

    /// Number of its vertices.
    pub fn n_vertices(&self) -> usize {
        self.jacobi.inverses().len()
    }

    /// Its prescribed vertices; their positions are not used.
    pub fn held(&self) -> &[FixedCopy] {
        &self.held
    }

    /// Follows a cut of `octree`, as [`Multigrid::follow`] does.
    pub fn follow(
        &mut self,
        team: &mut Team,
        cut: (&Octree, &[u32]),
        beside: &mut (dyn FnMut() + Send),
    ) -> bool {
        let first = self.multigrid.first;
        self.multigrid.levels[first].kernel = self.kernel.take();
        let follows = self.multigrid.follow(team, cut, beside);
        self.kernel = self.multigrid.levels[first].kernel.take();
        self.jacobi.resize(self.multigrid.hierarchy.levels[first].n_vertices);
        // Their vertices are found again with the next solve.
        self.springs.clear();
        self.sprung.clear();
        follows
    }

    /// Brings all operators up to date, as [`Multigrid::update`] does.
    pub fn update(
        &mut self,
        team: &mut Team,
        (with, fixed): (&Coefficients, &[FixedCopy]),
        rotation: &(dyn Fn(u32) -> Matrix3<f32> + Sync),
    ) {
        let first = self.multigrid.first;
        self.multigrid.levels[first].kernel = self.kernel.take();
        self.multigrid.update(team, (with, fixed), rotation);
        self.kernel = self.multigrid.levels[first].kernel.take();
        let Multigrid { galerkin, hierarchy, .. } = &self.multigrid;
        self.mass.clone_from(&galerkin.levels[first].mass);
        self.held.clear();
        let held = |&(copy, held): &(u32, Held)| FixedCopy { copy, held, position_m: [0.0; 3] };
        self.held.extend(galerkin.held().iter().map(held));
        let operator = galerkin.operator(&hierarchy.levels[first], first);
        if let Some(kernel) = &mut self.kernel {
            kernel.invert_diagonal(team, &self.mass, self.jacobi.inverses_mut());
        }
        for held in &self.held {
            let v = held.copy as usize;
            self.jacobi.inverses_mut()[v] = invert_free(&operator.diagonal(v), held.held);
        }
        self.sprung.clear();
    }

    /// Takes the `springs` of the next solves, and decides how it is preconditioned.
    pub fn set_springs(&mut self, team: &mut Team, springs: &[Spring]) {
        let Self { multigrid, jacobi, springs: restricted, sprung, row, .. } = self;
        let Multigrid { galerkin, hierarchy, first, .. } = &*multigrid;
        restricted.clear();
        for spring in springs {
            restricted.begin(spring);
            for (copy, w) in spring.point.carriers().filter(|(_, w)| *w != 0.0) {
                let free =
                    [0, 1, 2].map(|k| f32::from(u8::from(on_axes(galerkin.fixed[copy]) >> k & 1 == 0)));
                for &(v, p) in row.of(hierarchy, copy as u32, *first) {
                    restricted.add(v, free.map(|free| free * w * p));
                }
            }
        }
        restricted.hold(&galerkin.held_bits);
        let operator = galerkin.operator(&hierarchy.levels[*first], *first);
        let held = |v: u32| [0, 1, 2].map(|k| galerkin.held_bits[v as usize] >> k & 1 == 1);
        for &v in &*sprung {
            jacobi.inverses_mut()[v as usize] = invert(&operator.diagonal(v as usize), held(v));
        }
        self.active = (0..springs.len())
            .all(|s| restricted.compliance(s, |v| jacobi.inverses()[v as usize]) <= STIFFEST_SPRING);
        sprung.clear();
        restricted.for_vertices(|v| sprung.push(v));
        sprung.sort_unstable();
        sprung.dedup();
        for &v in &*sprung {
            let mut block = operator.diagonal(v as usize);
            restricted.add_to_block(v, &mut block);
            jacobi.inverses_mut()[v as usize] = invert(&block, held(v));
        }
        if !self.active {
            return;
        }
        let mut A = CompositeSystem {
            kernel: &mut self.kernel,
            mass: &self.mass,
            springs: restricted,
            held: &self.held,
        };
        multigrid.estimate_eigenvalues(team, &mut A, jacobi.inverses());
        self.largest = restricted.raise(multigrid.largest_eigenvalue(), |v| jacobi.inverses()[v as usize]);
    }

    /// Operator and preconditioner.
    pub fn parts(&mut self) -> (CompositeSystem<'_>, CompositePreconditioner<'_>) {
        let Self { multigrid, kernel, mass, jacobi, springs, held, largest, active, .. } = self;
        let A = CompositeSystem { kernel, mass, springs, held };
        let M = if *active {
            CompositePreconditioner::Cycle(Cycle { multigrid, inverse: jacobi.inverses(), largest: *largest })
        } else {
            CompositePreconditioner::BlockJacobi(jacobi)
        };
        (A, M)
    }

    /// Whether there are springs.
    pub fn has_springs(&self) -> bool {
        !self.springs.is_empty()
    }

    /// b = H Pᵀ r of a residual that is 0 in prescribed directions; H leaves out those of the level.
    pub fn restrict(&mut self, team: &mut Team, r: &[Padded], b: &mut [Padded]) {
        let Multigrid { hierarchy, levels, first, .. } = &mut self.multigrid;
        for l in 0..*first {
            let (fine, coarse) = levels.split_at_mut(l + 1);
            let r = if l == 0 { r } else { &fine[l].b };
            let b = if l + 1 == *first { &mut *b } else { &mut coarse[0].b[..] };
            hierarchy.steps[l].transfer.restrict(team, r, b);
        }
        filter(&self.held, b);
    }

    /// u = F P d; `fixed` are the prescribed directions of the finest level.
    pub fn prolong(&mut self, team: &mut Team, d: &[Padded], fixed: &[FixedCopy], u: &mut [Padded]) {
        let Multigrid { hierarchy, levels, first, .. } = &mut self.multigrid;
        for l in (0..*first).rev() {
            let (fine, coarse) = levels.split_at_mut(l + 1);
            let d = if l + 1 == *first { d } else { &coarse[0].x };
            let u = if l == 0 { &mut *u } else { &mut fine[l].x[..] };
            hierarchy.steps[l].transfer.prolong(team, d, u);
        }
        filter(fixed, u);
    }

    /// Writes the given displacements of `fixed` to the vertices of the level that are the same ones, 0 elsewhere.
    pub fn inject(&self, fixed: &[FixedCopy], given: impl Fn(&FixedCopy) -> Padded, g: &mut [Padded]) {
        g.fill([0.0; 4]);
        for f in fixed {
            if let Some(v) = self.multigrid.hierarchy.same_vertex(f.copy, self.level()) {
                let u = given(f);
                let axes = f.held.axes().unwrap_or([true; 3]);
                (0..3).filter(|&k| axes[k]).for_each(|k| g[v as usize][k] = u[k]);
            }
        }
    }
}

impl RowBuffers {
    /// The vertices of level `level` on which vertex `v` of the finest level rests, and their weights.
    pub(super) fn of(&mut self, hierarchy: &Hierarchy, v: u32, level: usize) -> &[(u32, f32)] {
        self.row.clear();
        self.row.push((v, 1.0));
        for step in &hierarchy.steps[..level] {
            self.next.clear();
            for &(v, w) in &self.row {
                for (coarse, p) in step.transfer.row(v as usize) {
                    match self.next.iter_mut().find(|e| e.0 == coarse) {
                        Some(known) => known.1 += w * p,
                        None => self.next.push((coarse, w * p)),
                    }
                }
            }
            std::mem::swap(&mut self.row, &mut self.next);
        }
        &self.row
    }
}

/// Prescribed axes, one bit each. The level that is solved on knows no inclined directions: such a vertex is held in
/// all of them.
fn on_axes(fixed: u8) -> u8 {
    if fixed < INCLINED { fixed } else { 7 }
}

impl Hierarchy {
    /// The vertex of level `level` that is the same as vertex `v` of the finest one, if there is one.
    pub(super) fn same_vertex(&self, v: u32, level: usize) -> Option<u32> {
        self.steps[..level].iter().try_fold(v, |v, step| {
            let mut row = step.transfer.row(v as usize);
            row.next().filter(|_| row.len() == 0).map(|(coarse, _)| coarse)
        })
    }
}

impl Galerkin {
    /// Chooses the level that is solved on.
    pub(super) fn solve_on(&mut self, hierarchy: &Hierarchy, first: usize) {
        self.first = first;
        self.held_bits = if first == 0 { Vec::new() } else { vec![0; hierarchy.levels[first].n_vertices] };
    }

    /// Finds the prescribed directions of the level that is solved on, if it is not the finest one.
    pub(super) fn hold_coarse(&mut self, hierarchy: &Hierarchy) {
        if self.first == 0 {
            return;
        }
        self.held_bits.fill(0);
        for &(copy, _) in &self.known_fixed {
            let same = hierarchy.same_vertex(copy, self.first).unwrap_or(NONE);
            if let Some(bits) = self.held_bits.get_mut(same as usize) {
                *bits |= on_axes(self.fixed[copy as usize]);
            }
        }
        self.held.clear();
        let held = (0u32..).zip(&self.held_bits).filter(|(_, bits)| **bits != 0);
        self.held.extend(held.map(|(v, bits)| (v, Held::Axes([0, 1, 2].map(|k| bits >> k & 1 == 1)))));
    }
}
