//! Implicit Euler, linearised at the inertial predictor.
//!
//! # Derivation
//! M (v⁺ − v)/h = f_ext − f_int(x⁺) − D v⁺ with x⁺ = x̂ + δ, x̂ = x + h v, v⁺ = v + δ/h and
//! f_int(x⁺) ≈ f_int(x̂) + K̂ δ, D = α M + β K̂ gives
//!
//!   [(1 + hα) M + (h² + hβ) K̂] δ = h² (f_ext − f_int(x̂) − α M v − β K̂ v)
//!
//! Linearised at x_n instead, a spinning body gains energy; from the predictor it never does.
//! K̂ turns with the material, so β leaves rigid motion alone.

use nalgebra::Vector3;

use super::State;
use super::parts::{LooseParts, Translations};
use super::springs::{ActiveSpring, PointSpring};
use crate::material::Material;
use crate::operator::{
    BLOCK, Block6, BlockJacobi, Elastic, ElasticUpdate, FixedCopy, LinearOperator, Padded, Spring,
    SystemOperator, filter, padded,
};
use crate::solver::{Pcg, PcgReport, PcgSettings, StopReason};
use crate::team::{Team, blocks};

/// Springs may open, close or reach their cap this often within one step.
const SPRING_PASSES: usize = 3;
/// The residual is measured against the right-hand side, but at least against this part of the
/// loads, so that a body at rest is not solved for rounding noise.
const LOAD_FLOOR: f64 = 0.01;

/// What a step is made from.
#[derive(Clone, Copy, Debug)]
pub struct StepInputs<'a> {
    /// Length of the step h [s].
    pub h: f64,
    /// Acceleration of gravity [m/s²].
    pub gravity: Vector3<f64>,
    /// Mass of every copy [kg].
    pub mass: &'a [f64],
    /// The same in single precision.
    pub mass_f32: &'a [f32],
    /// Load on every copy [N], gravity not included.
    pub load: &'a [Vector3<f64>],
    /// Prescribed copies.
    pub fixed: &'a [FixedCopy],
    /// Connected parts.
    pub parts: &'a LooseParts,
    /// Springs of this step.
    pub springs: &'a [PointSpring],
    /// Material constants.
    pub material: &'a Material,
    /// When to stop the solver.
    pub solver: PcgSettings,
}

/// How a step went.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepOutcome {
    /// How the last linear solve went; iterations are those of all passes.
    pub solve: PcgReport,
    /// Pieces with det F ≤ 0 at the predictor.
    pub inverted_pieces: usize,
    /// Springs that were left out because a number in them is not usable.
    pub refused_springs: usize,
    /// Whether everything stayed finite. If not, the state was left as it was.
    pub finite: bool,
}

/// The integrator's scratch vectors, one entry per copy.
#[derive(Debug, Default)]
pub struct ImplicitEuler {
    predicted: Vec<Vector3<f64>>,
    f_int: Vec<Padded>,
    damping: Vec<Padded>,
    rhs: Vec<Padded>,
    delta: Vec<Padded>,
    diagonal: Vec<Block6>,
    bare_diagonal: Vec<Block6>,
    preconditioner: BlockJacobi,
    pcg: Pcg,
    active: Vec<ActiveSpring>,
    accepted: Vec<bool>,
    terms: Vec<Spring>,
    translations: Translations,
    reference: f64,
}

impl ImplicitEuler {
    /// Makes room for `n` copies.
    pub fn resize(&mut self, n: usize) {
        self.predicted.resize(n, Vector3::zeros());
        for v in [&mut self.f_int, &mut self.damping, &mut self.rhs, &mut self.delta] {
            v.resize(n, [0.0; 4]);
        }
        self.diagonal.resize(n, [0.0; 8]);
        self.bare_diagonal.resize(n, [0.0; 8]);
        self.preconditioner.resize(n);
        self.pcg.resize(n);
    }

    /// Advances `state` by h, unless something turns out not to be finite. The force of every
    /// spring goes to `spring_forces`, in the order of the inputs.
    pub fn step(
        &mut self,
        team: &mut Team,
        elastic: &mut Elastic,
        state: &mut State,
        inputs: &StepInputs<'_>,
        spring_forces: &mut Vec<Vector3<f64>>,
    ) -> StepOutcome {
        self.predict(state, inputs);
        let inverted_pieces = self.update_operator(team, elastic, state, inputs);
        self.start_springs(inputs);
        let mut solve = PcgReport::default();
        self.delta.fill([0.0; 4]);
        self.translations.restart(inputs.parts);
        for pass in 0..SPRING_PASSES {
            self.complete_operator(team, elastic, inputs, pass);
            self.balance_parts(state, inputs);
            self.residual(team, elastic, state, inputs, pass);
            let report = self.solve(team, elastic, inputs, pass);
            solve = PcgReport { iterations: solve.iterations + report.iterations, ..report };
            self.balance_parts(state, inputs);
            if report.stop == StopReason::NonFinite || !self.springs_changed(inputs, pass) {
                break;
            }
        }
        let finite = solve.stop != StopReason::NonFinite && self.commit(state, inputs, spring_forces);
        let refused_springs = inputs.springs.len() - self.active.len();
        StepOutcome { solve, inverted_pieces, refused_springs, finite }
    }

    fn predict(&mut self, state: &State, inputs: &StepInputs<'_>) {
        for ((predicted, x), v) in self.predicted.iter_mut().zip(&state.x).zip(&state.v) {
            *predicted = x + inputs.h * v;
        }
        for fixed in inputs.fixed {
            for axis in (0..3).filter(|&axis| fixed.axes[axis]) {
                self.predicted[fixed.copy as usize][axis] = fixed.position_m[axis];
            }
        }
    }

    /// Rotations, forces, gradients and damping at the predictor.
    fn update_operator(
        &mut self,
        team: &mut Team,
        elastic: &mut Elastic,
        state: &State,
        inputs: &StepInputs<'_>,
    ) -> usize {
        let (h, beta) = (inputs.h, inputs.material.rayleigh.stiffness_s);
        let scale = h * h + h * beta;
        let with = ElasticUpdate { lame: inputs.material.lame(), law: inputs.material.law, scale };
        let (f_int, diagonal) = (&mut self.f_int, &mut self.bare_diagonal);
        let inverted = elastic.update(team, &with, &self.predicted, f_int, diagonal);
        if beta > 0.0 {
            let moved = self.predicted.iter().zip(&state.x);
            for (v, (predicted, x)) in self.rhs.iter_mut().zip(moved) {
                *v = padded(&((predicted - x) / h));
            }
            elastic.apply(team, &self.rhs, &mut self.damping); // s K̂ v
            let factor = (beta / scale) as f32;
            self.damping.iter_mut().flatten().for_each(|v| *v *= factor); // β K̂ v
        }
        inverted
    }

    fn start_springs(&mut self, inputs: &StepInputs<'_>) {
        self.active.clear();
        self.accepted.clear();
        for spring in inputs.springs {
            let active = ActiveSpring::new(spring, &self.predicted);
            self.accepted.push(active.is_some());
            self.active.extend(active);
        }
    }

    /// Spring terms of the operator, its diagonal and the preconditioner.
    fn complete_operator(
        &mut self,
        team: &mut Team,
        elastic: &mut Elastic,
        inputs: &StepInputs<'_>,
        pass: usize,
    ) {
        self.terms.clear();
        self.terms.extend(self.active.iter().filter_map(|s| s.term(inputs.h * inputs.h)));
        if pass == 0 || !self.active.is_empty() {
            self.diagonal.copy_from_slice(&self.bare_diagonal);
            system(elastic, &self.terms, inputs).complete_diagonal(&mut self.diagonal);
            self.preconditioner.update(team, &self.diagonal, inputs.fixed);
        }
    }

    /// Solves the translation equations of every free part for what is still missing.
    fn balance_parts(&mut self, state: &State, inputs: &StepInputs<'_>) {
        if !inputs.parts.any_free() {
            return;
        }
        let factor = mass_factor(inputs);
        let h2 = inputs.h * inputs.h;
        self.translations.begin(inputs.parts, factor);
        for (c, delta) in self.delta.iter().enumerate() {
            let moved = self.translations.shift[inputs.parts.of_copy[c] as usize] + unpadded(delta);
            let missing = h2 * external(c, state, inputs) - factor * inputs.mass[c] * moved;
            self.translations.add(inputs.parts, c, missing);
        }
        for spring in &self.active {
            let point = self.point_of(spring, inputs);
            let (S, f) = (h2 * spring.stiffness(), h2 * spring.force(point));
            self.translations.add_spring(inputs.parts, spring.main_copy(), S, f);
        }
        self.translations.solve(inputs.parts);
    }

    /// Where the point of a spring is with the present δ.
    fn point_of(&self, spring: &ActiveSpring, inputs: &StepInputs<'_>) -> Vector3<f64> {
        spring.carriers().map(|(c, w)| w * self.position(c, inputs)).sum()
    }

    /// x̂ + δ of copy `c` [m].
    fn position(&self, c: usize, inputs: &StepInputs<'_>) -> Vector3<f64> {
        let part = inputs.parts.of_copy[c] as usize;
        self.predicted[c] + self.translations.shift[part] + unpadded(&self.delta[c])
    }

    /// r = b − A δ into the solver's residual.
    fn residual(
        &mut self,
        team: &mut Team,
        elastic: &mut Elastic,
        state: &State,
        inputs: &StepInputs<'_>,
        pass: usize,
    ) {
        let (h2, factor) = (inputs.h * inputs.h, mass_factor(inputs));
        let damped = inputs.material.rayleigh.stiffness_s > 0.0;
        let (f_int, damping, shift) = (&self.f_int, &self.damping, &self.translations.shift);
        team.for_blocks(blocks(&mut self.rhs, BLOCK), |block, rhs| {
            for (i, rhs) in rhs.iter_mut().enumerate() {
                let c = block * BLOCK + i;
                let mut f = external(c, state, inputs) - unpadded(&f_int[c]);
                if damped {
                    f -= unpadded(&damping[c]);
                }
                let moved = shift[inputs.parts.of_copy[c] as usize];
                *rhs = padded(&(h2 * f - factor * inputs.mass[c] * moved));
            }
        });
        if pass > 0 {
            let r = &mut self.pcg.r;
            system(elastic, &[], inputs).apply(team, &self.delta, r);
            for (r, rhs) in r.iter_mut().zip(&self.rhs) {
                for k in 0..4 {
                    r[k] = rhs[k] - r[k];
                }
            }
        } else {
            self.pcg.r.copy_from_slice(&self.rhs);
        }
        for spring in &self.active {
            let f = h2 * spring.force(self.point_of(spring, inputs));
            for (c, w) in spring.carriers() {
                let r = &mut self.pcg.r[c];
                (0..3).for_each(|k| r[k] += (w * f[k]) as f32);
            }
        }
        filter(inputs.fixed, &mut self.pcg.r);
    }

    fn solve(
        &mut self,
        team: &mut Team,
        elastic: &mut Elastic,
        inputs: &StepInputs<'_>,
        pass: usize,
    ) -> PcgReport {
        if pass == 0 {
            self.reference = self.reference_norm(team, inputs);
        }
        let Self { pcg, preconditioner, terms, delta, reference, .. } = self;
        let mut A = system(elastic, terms, inputs);
        pcg.solve(team, &mut A, preconditioner, delta, (*reference, inputs.solver))
    }

    /// Norm of the right-hand side, at least [`LOAD_FLOOR`] times that of the loads.
    fn reference_norm(&mut self, team: &mut Team, inputs: &StepInputs<'_>) -> f64 {
        let h2 = inputs.h * inputs.h;
        for (c, rhs) in self.rhs.iter_mut().enumerate() {
            *rhs = padded(&(h2 * (inputs.mass[c] * inputs.gravity + inputs.load[c])));
        }
        filter(inputs.fixed, &mut self.rhs);
        let Self { pcg, preconditioner, rhs, .. } = self;
        let load = pcg.norm(team, preconditioner, rhs);
        rhs.copy_from_slice(&pcg.r);
        pcg.norm(team, preconditioner, rhs).max(LOAD_FLOOR * load)
    }

    fn springs_changed(&mut self, inputs: &StepInputs<'_>, pass: usize) -> bool {
        if pass + 1 == SPRING_PASSES {
            return false;
        }
        let mut changed = false;
        for s in 0..self.active.len() {
            let point = self.point_of(&self.active[s], inputs);
            changed |= self.active[s].choose_mode(point);
        }
        changed
    }

    /// Writes x⁺, v⁺ and the spring forces, if all of them are finite.
    fn commit(
        &mut self,
        state: &mut State,
        inputs: &StepInputs<'_>,
        spring_forces: &mut Vec<Vector3<f64>>,
    ) -> bool {
        for c in 0..self.predicted.len() {
            self.predicted[c] = self.position(c, inputs);
        }
        let bound = 1e15; // m: far outside any scene, far inside the range of single precision
        if !self.predicted.iter().all(|x| x.iter().all(|c| c.abs() < bound)) {
            return false;
        }
        spring_forces.clear();
        let mut active = self.active.iter();
        for &accepted in &self.accepted {
            let spring = if accepted { active.next() } else { None };
            let force = spring.map(|s| s.force(s.point(&self.predicted)));
            spring_forces.push(force.unwrap_or_else(Vector3::zeros));
        }
        for ((x, v), next) in state.x.iter_mut().zip(&mut state.v).zip(&self.predicted) {
            *v = (next - *x) / inputs.h;
            *x = *next;
        }
        true
    }
}

fn system<'a>(
    elastic: &'a mut Elastic,
    springs: &'a [Spring],
    inputs: &StepInputs<'a>,
) -> SystemOperator<'a> {
    SystemOperator {
        elastic,
        mass: inputs.mass_f32,
        mass_factor: mass_factor(inputs) as f32,
        springs,
        fixed: inputs.fixed,
    }
}

/// 1 + hα.
fn mass_factor(inputs: &StepInputs<'_>) -> f64 {
    1.0 + inputs.h * inputs.material.rayleigh.mass_1_s
}

/// m g + load − α m v of one copy [N].
#[inline(always)]
fn external(c: usize, state: &State, inputs: &StepInputs<'_>) -> Vector3<f64> {
    let drag = inputs.material.rayleigh.mass_1_s;
    inputs.mass[c] * (inputs.gravity - drag * state.v[c]) + inputs.load[c]
}

#[inline(always)]
fn unpadded(v: &Padded) -> Vector3<f64> {
    Vector3::new(f64::from(v[0]), f64::from(v[1]), f64::from(v[2]))
}
