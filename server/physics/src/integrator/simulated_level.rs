//! Linear solves on a coarse level of multigrid, whose composite elements are simulated in place of the cells.
//!
//! The residual of the finest vertices is restricted to the level, the equations are solved there, and the body
//! moves by the prolongation of the solution. The operators of merged cells are approximate where their children
//! have turned differently. For laws that rotate these solves are therefore directions of conjugate gradients on
//! the exact Galerkin operator, which takes one product on the finest level each; one or two suffice.
//!
//! # Source
//! Nesme et al. 2009; Wu, Dick, Westermann 2011. Conjugate gradients with inexact inner solves: Golub, Ye 1999,
//! *Inexact preconditioned conjugate gradient method with inner-outer iteration*.

use nalgebra::Vector3;
use scindo_algebra::operator::{
    BLOCK, LinearOperator, Padded, Preconditioner, Spring, Stiffness, block_of, filter, padded, rows,
    unpadded,
};
use scindo_algebra::solver::multigrid::{Coefficients, Composite, CycleShape, Hierarchy, Multigrid};
use scindo_algebra::solver::{LinearReport, Method, Pcg, PcgSettings, StopReason};
use scindo_matter::element::FixedCopy;
use scindo_matter::octree::Octree;
use scindo_matter::storage::reserve::resize_reserving;
use scindo_matter::team::{Team, blocks};

use super::step_grid::set_coefficients;
use super::step_inputs::{LinearInputs, StepInputs};

/// Largest number of inner solves. Where the norm of the residual does not halve in one, further ones do not pay.
const MOST_SOLVES: u32 = 10;
/// Relative tolerance of the masses' equations.
const MASS_TOLERANCE: f64 = 1e-6;
/// Largest number of iterations for them. The condition number is below 27.
const MASS_ITERATIONS: u32 = 60;

/// The simulated level, and what it was brought up to date with.
#[derive(Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct SimulatedLevel {
    composite: Composite,
    coefficients: Coefficients,
    version: Option<u64>,
    pcg: Pcg,
    /// Right-hand side, later residual, of the level.
    b: Vec<Padded>,
    /// Solution of the level, last inner solution, direction and its product.
    x: Vec<Padded>,
    z: Vec<Padded>,
    p: Vec<Padded>,
    q: Vec<Padded>,
    /// Scratch of the level.
    u: Vec<Padded>,
    partial: Vec<f64>,
    /// Scratch of the finest level.
    fine: [Vec<Padded>; 2],
}

impl SimulatedLevel {
    /// Level `level` of `hierarchy`.
    pub(super) fn new(hierarchy: Hierarchy, level: usize, shape: CycleShape) -> Self {
        let n_fine = hierarchy.n_vertices();
        let composite = Composite::new(hierarchy, shape.into(), level);
        let n = composite.n_vertices();
        let mut pcg = Pcg::default();
        pcg.resize(n);
        let zeros = || vec![[0.0; 4]; n];
        Self {
            composite,
            coefficients: Coefficients { materials: Vec::new(), scale: 0.0, mass_factor: 0.0 },
            version: None,
            pcg,
            b: zeros(),
            x: zeros(),
            z: zeros(),
            p: zeros(),
            q: zeros(),
            u: zeros(),
            partial: vec![0.0; n.div_ceil(BLOCK)],
            fine: [vec![[0.0; 4]; n_fine], vec![[0.0; 4]; n_fine]],
        }
    }

    /// Hierarchy and operators.
    pub(super) fn multigrid(&self) -> &Multigrid {
        self.composite.multigrid()
    }

    /// Follows a cut of `octree`, as [`Multigrid::follow`] does.
    pub(super) fn follow_cut(
        &mut self,
        team: &mut Team,
        (octree, changed): (&Octree, &[u32]),
        beside: &mut (dyn FnMut() + Send),
    ) -> bool {
        self.version = None;
        if !self.composite.follow(team, (octree, changed), beside) {
            return false;
        }
        let n = self.composite.n_vertices();
        self.pcg.resize(n);
        for v in [&mut self.b, &mut self.x, &mut self.z, &mut self.p, &mut self.q, &mut self.u] {
            resize_reserving(v, n, [0.0; 4]);
        }
        self.partial.resize(n.div_ceil(BLOCK), 0.0);
        self.fine.iter_mut().for_each(|v| resize_reserving(v, octree.n_vertices(), [0.0; 4]));
        true
    }

    /// Follows the stiffness as it was last updated.
    pub(super) fn follow(&mut self, team: &mut Team, elastic: &dyn Stiffness, inputs: &LinearInputs<'_>) {
        let Self { composite, coefficients, version, .. } = self;
        set_coefficients(coefficients, composite.multigrid().hierarchy(), inputs);
        let (fixed, now) = (inputs.step.fixed, Some(elastic.version()));
        if *version == now && composite.multigrid().is_made_for(coefficients, fixed) {
            return;
        }
        *version = now;
        let places = elastic.places();
        composite.update(team, (coefficients, fixed), &|cell| elastic.rotation(places[cell as usize]));
    }

    /// Takes the springs of the next solve.
    pub(super) fn set_springs(&mut self, team: &mut Team, springs: &[Spring]) {
        self.composite.set_springs(team, springs);
    }

    /// √(rᵀP M⁻¹ Pᵀr) of a residual of the finest level, 0 in prescribed directions: the norm in which the
    /// reference of a solve is given. After it [`solve`](Self::solve) begins from this residual.
    pub(super) fn norm(&mut self, team: &mut Team, r: &[Padded]) -> f64 {
        self.composite.restrict(team, r, &mut self.b);
        self.precondition(team).max(0.0).sqrt()
    }

    /// M⁻¹ of the residual `b`; returns bᵀM⁻¹b.
    fn precondition(&mut self, team: &mut Team) -> f64 {
        let Self { composite, pcg, b, .. } = self;
        pcg.r.copy_from_slice(b);
        let (mut A, mut M) = composite.parts();
        pcg.precondition(team, &mut A, &mut M)
    }

    /// Solves for `delta` += F P x from the residual whose [`norm`](Self::norm) was asked for last. `A` is the
    /// operator of the finest level with the springs that were given last; `exact` tells that those of the level are
    /// Galerkin operators of it up to rounding.
    pub(super) fn solve(
        &mut self,
        team: &mut Team,
        (A, exact): (&mut dyn LinearOperator, bool),
        fixed: &[FixedCopy],
        delta: &mut [Padded],
        (norm, reference, settings, method): (f64, f64, PcgSettings, Method),
    ) -> LinearReport {
        let until = (reference, settings, method);
        self.x.fill([0.0; 4]);
        let mut report = self.solve_approximately(team, norm, until);
        if exact || report.stop == StopReason::NonFinite || report.iterations == 0 {
            std::mem::swap(&mut self.x, &mut self.z);
        } else {
            self.improve(team, A, fixed, &mut report, (norm, until));
        }
        let Self { composite, x, fine: [u, _], .. } = self;
        composite.prolong(team, x, fixed, u);
        let u = &*u;
        team.for_blocks(blocks(delta, BLOCK), |block, delta| {
            for (delta, u) in delta.iter_mut().zip(block_of(u, block)) {
                (0..4).for_each(|k| delta[k] += u[k]);
            }
        });
        report
    }

    /// Conjugate gradients with the exact operator; `z` and `report` are those of the first inner solve.
    fn improve(
        &mut self,
        team: &mut Team,
        A: &mut dyn LinearOperator,
        fixed: &[FixedCopy],
        report: &mut LinearReport,
        (mut before, until): (f64, (f64, PcgSettings, Method)),
    ) {
        let (reference, settings, method) = until;
        let mut beta = 0.0;
        for number in 1..=MOST_SOLVES {
            // p ← z + β p, q = H Pᵀ F A F P p
            let Self { composite, p, q, z, fine: [u, v], .. } = self;
            combine(team, p, beta as f32, z);
            composite.prolong(team, p, fixed, u);
            A.apply(team, u, v);
            composite.restrict(team, v, q);
            let (pq, pb) = (self.dot(team, Vector::P, Vector::Q), self.dot(team, Vector::P, Vector::B));
            if !(pq.is_finite() && pb.is_finite()) {
                report.stop = StopReason::NonFinite;
                return;
            }
            if pq <= 0.0 {
                report.stop = StopReason::NonPositiveCurvature;
                return;
            }
            // x += α p, b −= α q
            let alpha = (pb / pq) as f32;
            let Self { x, b, p, q, .. } = self;
            let (p, q) = (&*p, &*q);
            team.for_blocks((blocks(x, BLOCK), blocks(b, BLOCK)), |block, (x, b)| {
                let known = block_of(p, block).iter().zip(block_of(q, block));
                for ((x, b), (p, q)) in x.iter_mut().zip(b).zip(known) {
                    for k in 0..4 {
                        x[k] += alpha * p[k];
                        b[k] -= alpha * q[k];
                    }
                }
            });
            // This gives the norm in which the reference is, and the next inner solve begins from it.
            let rz = self.precondition(team);
            let norm = rz.max(0.0).sqrt();
            report.residual = if reference > 0.0 { norm / reference } else { norm };
            // The error is A⁻¹ r, and M⁻¹ is near A⁻¹.
            report.algebraic_error = norm;
            report.refinements = number;
            report.stop = if !rz.is_finite() {
                StopReason::NonFinite
            } else if norm <= settings.tolerance * reference {
                StopReason::Converged
            } else if report.stop == StopReason::Interrupted {
                StopReason::Interrupted
            } else if report.iterations >= settings.iterations || number == MOST_SOLVES {
                StopReason::IterationLimit
            } else if norm > 0.5 * before && number > 1 {
                StopReason::Stagnated
            } else {
                before = norm;
                // The limit is that of all inner solves together.
                let left = PcgSettings { iterations: settings.iterations - report.iterations, ..settings };
                let inner = self.solve_approximately(team, norm, (reference, left, method));
                report.iterations += inner.iterations;
                if inner.stop == StopReason::NonFinite {
                    report.stop = inner.stop;
                    return;
                }
                // p is made conjugate to the last one.
                beta = -self.dot(team, Vector::Z, Vector::Q) / pq;
                report.stop = inner.stop;
                continue;
            };
            return;
        }
    }

    /// z ≈ A⁻¹ b with the operator of the level, after b was preconditioned, which gave `norm`.
    fn solve_approximately(
        &mut self,
        team: &mut Team,
        norm: f64,
        (reference, settings, method): (f64, PcgSettings, Method),
    ) -> LinearReport {
        let Self { composite, pcg, z, .. } = self;
        z.fill([0.0; 4]);
        let cycles = method == Method::Multigrid && !composite.has_springs();
        let (mut A, mut M) = composite.parts();
        let from = (norm * norm, reference, settings);
        match cycles {
            true => pcg.cycles(team, &mut A, &mut M, z, from),
            false => pcg.run(team, &mut A, &mut M, z, from),
        }
    }

    fn dot(&mut self, team: &mut Team, a: Vector, b: Vector) -> f64 {
        let Self { b: residual, z, p, q, partial, .. } = self;
        let of = |v: Vector| match v {
            Vector::B => &residual[..],
            Vector::Z => &z[..],
            Vector::P => &p[..],
            Vector::Q => &q[..],
        };
        let (a, b) = (of(a), of(b));
        team.for_blocks(blocks(partial, 1), |block, partial: &mut [f64]| {
            partial[0] = rows::dot(block_of(a, block), block_of(b, block));
        });
        partial.iter().sum()
    }

    /// Takes vertices between prescribed ones along with these, which the solves cannot move alone: adds to
    /// `predicted` [m] what the level interpolates between its own prescribed vertices.
    pub(super) fn follow_prescribed(
        &mut self,
        team: &mut Team,
        fixed: &[FixedCopy],
        predicted: &mut [Vector3<f64>],
    ) {
        let gap = |f: &FixedCopy| padded(&f.held.gap(&predicted[f.copy as usize], &f.position_m));
        if fixed.iter().all(|f| gap(f) == [0.0; 4]) {
            return;
        }
        let Self { composite, u, fine: [moved, _], .. } = self;
        composite.inject(fixed, gap, u);
        composite.prolong(team, u, &[], moved);
        let moved = &*moved;
        team.for_blocks(blocks(predicted, BLOCK), |block, predicted| {
            for (x, u) in predicted.iter_mut().zip(block_of(moved, block)) {
                *x += unpadded(u);
            }
        });
    }

    /// Turns forces [N] into accelerations ā + F P y [m/s²]: ā of the free parts as a whole, 0 for the others, and
    /// PᵀF M F P y = Pᵀ (f − M ā).
    pub(super) fn accelerate(
        &mut self,
        team: &mut Team,
        forces: &mut [Vector3<f64>],
        inputs: &LinearInputs<'_>,
    ) {
        let StepInputs { fixed, parts, mass, .. } = inputs.step;
        let mut whole = vec![Vector3::zeros(); parts.mass.len()];
        for (f, &part) in forces.iter().zip(&parts.of_copy) {
            let part = part as usize;
            if parts.free[part] && parts.mass[part] > 0.0 {
                whole[part] += f / parts.mass[part];
            }
        }
        let Self { composite, pcg, z, u: inverse, fine: [fine, f], .. } = self;
        for (c, f) in f.iter_mut().enumerate() {
            *f = padded(&(forces[c] - mass[c] * whole[parts.of_copy[c] as usize]));
        }
        filter(fixed, f);
        composite.restrict(team, f, &mut pcg.r);
        // Row sums of PᵀM P: P keeps constants.
        fine.iter_mut().zip(inputs.mass_f32).for_each(|(f, &m)| *f = [m, m, m, 0.0]);
        filter(fixed, fine);
        composite.restrict(team, fine, inverse);
        inverse.iter_mut().flatten().for_each(|m| *m = if *m > 0.0 { 1.0 / *m } else { 0.0 });
        z.fill([0.0; 4]);
        let mut A = Masses { composite, mass: inputs.mass_f32, fixed, fine };
        let mut M = Diagonal(inverse);
        let rz = pcg.precondition(team, &mut A, &mut M);
        let settings = PcgSettings { iterations: MASS_ITERATIONS, tolerance: MASS_TOLERANCE };
        pcg.run(team, &mut A, &mut M, z, (rz, rz.max(0.0).sqrt(), settings));
        composite.prolong(team, z, fixed, f);
        for (c, a) in forces.iter_mut().enumerate() {
            *a = whole[parts.of_copy[c] as usize] + unpadded(&f[c]);
        }
    }
}

#[derive(Clone, Copy, Debug)]
enum Vector {
    B,
    Z,
    P,
    Q,
}

/// p ← z + β p.
fn combine(team: &mut Team, p: &mut [Padded], beta: f32, z: &[Padded]) {
    team.for_blocks(blocks(p, BLOCK), |block, p| {
        for (p, z) in p.iter_mut().zip(block_of(z, block)) {
            rows::direction(p, z, beta);
        }
    });
}

/// PᵀF M F P with the lumped masses of the finest vertices.
struct Masses<'a> {
    composite: &'a mut Composite,
    mass: &'a [f32],
    fixed: &'a [FixedCopy],
    fine: &'a mut [Padded],
}

impl LinearOperator for Masses<'_> {
    fn apply(&mut self, team: &mut Team, x: &[Padded], y: &mut [Padded]) {
        let Self { composite, mass, fixed, fine } = self;
        composite.prolong(team, x, fixed, fine);
        let mass = *mass;
        team.for_blocks(blocks(fine, BLOCK), |block, fine| {
            for (f, m) in fine.iter_mut().zip(block_of(mass, block)) {
                *f = f.map(|f| m * f);
            }
        });
        composite.restrict(team, fine, y);
    }
}

/// The inverse of a diagonal matrix.
struct Diagonal<'a>(&'a [Padded]);

impl Preconditioner for Diagonal<'_> {
    fn apply(
        &mut self,
        team: &mut Team,
        _: &mut dyn LinearOperator,
        r: &[Padded],
        z: &mut [Padded],
        partial: &mut [f64],
    ) -> f64 {
        let inverse = self.0;
        team.for_blocks((blocks(z, BLOCK), blocks(partial, 1)), |block, (z, partial)| {
            let r = block_of(r, block);
            for ((z, r), D) in z.iter_mut().zip(r).zip(block_of(inverse, block)) {
                *z = std::array::from_fn(|k| D[k] * r[k]);
            }
            partial[0] = rows::dot(r, z);
        });
        partial.iter().sum()
    }
}
