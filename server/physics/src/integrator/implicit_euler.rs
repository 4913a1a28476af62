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
    BLOCK, Block6, BlockJacobi, CompositeDiagonal, Elastic, ElasticUpdate, FixedCopy, LinearOperator, Padded,
    Spring, StiffModes, Substitution, Sum, SystemOperator, block_of, filter, invert, padded,
};
use crate::reserve::resize_reserving;
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
    /// Linearise at the positions of the last step.
    at_start: bool,
    predicted: Vec<Vector3<f64>>,
    f_int: Vec<Padded>,
    damping: Vec<Padded>,
    scratch: Vec<Padded>,
    delta: Vec<Padded>,
    /// Blocks of (1 + hα) M + (h² + hβ) K̂, springs not included.
    diagonal: Vec<Block6>,
    preconditioner: BlockJacobi,
    /// What `diagonal` and `preconditioner` were made for: version of K̂ and mass factor.
    made_for: Option<(u64, f64)>,
    /// The prescribed directions they were made for.
    made_for_fixed: Vec<(u32, [bool; 3])>,
    /// Of a body with degenerate elements.
    stiff: Option<Box<Stiff>>,
    /// Copies whose entry of the preconditioner contains springs.
    sprung: Vec<u32>,
    /// Their blocks without springs, while those with springs are inverted.
    bare: Vec<Block6>,
    pcg: Pcg,
    /// One entry per block of the vector loops.
    partial: Vec<f64>,
    active: Vec<ActiveSpring>,
    accepted: Vec<bool>,
    terms: Vec<Spring>,
    translations: Translations,
    reference: f64,
}

/// How degenerate elements are kept from costing iterations.
#[derive(Debug)]
struct Stiff {
    modes: StiffModes,
    /// Blocks of the preconditioner that the substitution changes.
    composite: CompositeDiagonal,
    /// Degenerate pieces that keep a stiff motion.
    left: usize,
    /// Whether the substitution has to be found anew.
    stale: bool,
    /// A spring's weights in the new variables.
    row: Vec<(u32, f64)>,
}

/// Most copies that a spring's weights are expected on in the new variables.
const SPRING_ROW: usize = 64;

impl ImplicitEuler {
    /// An integrator without memory. `at_start` linearises at the positions of the last step, which
    /// only a test of tests wants.
    pub fn new(at_start: bool) -> Self {
        Self { at_start, ..Self::default() }
    }

    /// Makes room for `n` copies.
    pub fn resize(&mut self, n: usize) {
        resize_reserving(&mut self.predicted, n, Vector3::zeros());
        for v in [&mut self.f_int, &mut self.damping, &mut self.scratch, &mut self.delta] {
            resize_reserving(v, n, [0.0; 4]);
        }
        resize_reserving(&mut self.diagonal, n, [0.0; 8]);
        self.partial.resize(n.div_ceil(BLOCK), 0.0);
        self.made_for = None;
        self.sprung.clear();
        self.preconditioner.resize(n);
        self.pcg.resize(n);
        self.set_stiff_modes(None);
    }

    /// Takes over the stiff motions of the degenerate elements of the present topology.
    pub fn set_stiff_modes(&mut self, modes: Option<StiffModes>) {
        self.preconditioner.set_substitution(Substitution::default());
        self.made_for = None;
        self.stiff = modes.map(|modes| {
            let (composite, row) = (CompositeDiagonal::default(), Vec::with_capacity(SPRING_ROW));
            Box::new(Stiff { modes, composite, left: 0, stale: true, row })
        });
    }

    /// Pieces of degenerate elements, copies that are moved relative to others for them, and pieces
    /// that keep a stiff motion; those of the last step.
    pub fn stiff_motions(&self) -> [usize; 3] {
        let (found, left) = self.stiff.as_ref().map_or((0, 0), |s| (s.modes.n_degenerate(), s.left));
        [found, self.preconditioner.substitution().len(), left]
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
        self.predict(team, state, inputs);
        let inverted_pieces = self.update_operator(team, elastic, state, inputs);
        self.start_springs(inputs);
        let mut solve = PcgReport::default();
        self.delta.fill([0.0; 4]);
        self.translations.restart(inputs.parts);
        for pass in 0..SPRING_PASSES {
            self.complete_operator(elastic, inputs);
            self.balance_parts(state, inputs);
            self.residual(team, elastic, state, inputs, pass);
            let report = self.solve(team, elastic, inputs, pass);
            // A pass that has nothing left to do estimates no error.
            let algebraic_error = solve.algebraic_error.max(report.algebraic_error);
            solve = PcgReport { iterations: solve.iterations + report.iterations, algebraic_error, ..report };
            self.balance_parts(state, inputs);
            if report.stop == StopReason::NonFinite || !self.springs_changed(inputs, pass) {
                break;
            }
        }
        let finite = solve.stop != StopReason::NonFinite && self.commit(team, state, inputs, spring_forces);
        let refused_springs = inputs.springs.len() - self.active.len();
        StepOutcome { solve, inverted_pieces, refused_springs, finite }
    }

    fn predict(&mut self, team: &mut Team, state: &State, inputs: &StepInputs<'_>) {
        team.for_blocks(blocks(&mut self.predicted, BLOCK), |block, predicted| {
            let known = block_of(&state.x, block).iter().zip(block_of(&state.v, block));
            for (predicted, (x, v)) in predicted.iter_mut().zip(known) {
                *predicted = x + inputs.h * v;
            }
        });
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
        let with = elastic_update(inputs);
        let scale = with.scale;
        let at = if self.at_start { &state.x } else { &self.predicted };
        let inverted = elastic.update_chunks(team, &with, at);
        self.sum_chunks(team, elastic, inputs);
        if self.damps(inputs) {
            let moved = self.predicted.iter().zip(&state.x);
            for (v, (predicted, x)) in self.scratch.iter_mut().zip(moved) {
                *v = padded(&((predicted - x) / h));
            }
            elastic.apply(team, &self.scratch, &mut self.damping); // s K̂ v
            // From x_n on, the predictor is h v away: f_int(x̂) ≈ f_int(x_n) + h K̂ v.
            let beta = if self.at_start { beta + h } else { beta };
            let factor = (beta / scale) as f32;
            self.damping.iter_mut().flatten().for_each(|v| *v *= factor); // β K̂ v
        }
        inverted
    }

    /// Whether K̂ v takes part.
    fn damps(&self, inputs: &StepInputs<'_>) -> bool {
        self.at_start || inputs.material.rayleigh.stiffness_s > 0.0
    }

    /// Internal forces and, where it changed, the diagonal of A and its inverse, without springs.
    fn sum_chunks(&mut self, team: &mut Team, elastic: &Elastic, inputs: &StepInputs<'_>) {
        let factor = mass_factor(inputs);
        let made_for = Some((elastic.version(), factor));
        let axes = |f: &FixedCopy| (f.copy, f.axes);
        let f_int = blocks(&mut self.f_int, BLOCK);
        if self.made_for == made_for && inputs.fixed.iter().map(axes).eq(self.made_for_fixed.iter().copied())
        {
            team.for_blocks(f_int, |block, f| elastic.forces(block, f));
            return;
        }
        self.made_for = made_for;
        if !inputs.fixed.iter().map(axes).eq(self.made_for_fixed.iter().copied()) {
            self.made_for_fixed.clear();
            self.made_for_fixed.extend(inputs.fixed.iter().map(axes));
            self.stiff.iter_mut().for_each(|stiff| stiff.stale = true);
        }
        self.sprung.clear();
        let inverses = blocks(self.preconditioner.inverses_mut(), BLOCK);
        let state = (f_int, blocks(&mut self.diagonal, BLOCK), inverses);
        let (mass, factor) = (inputs.mass_f32, factor as f32);
        team.for_blocks(state, |block, (f, diagonal, inverses)| {
            elastic.forces(block, f);
            elastic.diagonals(block, diagonal);
            for ((diagonal, inverse), &mass) in diagonal.iter_mut().zip(inverses).zip(block_of(mass, block)) {
                for k in [0, 4, 6] {
                    diagonal[k] += factor * mass;
                }
                *inverse = invert(diagonal, [false; 3]);
            }
        });
        self.substitute(team, elastic, inputs);
        for copy in inputs.fixed {
            let c = copy.copy as usize;
            self.preconditioner.set(c, &self.diagonal[c], copy.axes);
        }
    }

    /// The blocks of the preconditioner in the variables in which degenerate elements are not stiff.
    fn substitute(&mut self, team: &mut Team, elastic: &Elastic, inputs: &StepInputs<'_>) {
        let Some(stiff) = &mut self.stiff else { return };
        if stiff.stale {
            let held = |copy: u32| inputs.fixed.binary_search_by_key(&copy, |f| f.copy).is_ok();
            let (T, left) = stiff.modes.substitution(held);
            stiff.composite = CompositeDiagonal::new(&stiff.modes, &T, elastic);
            (stiff.left, stiff.stale) = (left, false);
            self.preconditioner.set_substitution(T);
        }
        let with = elastic_update(inputs);
        let mass = (inputs.mass_f32, mass_factor(inputs));
        stiff.composite.update(team, (elastic, &with), mass, &mut self.diagonal);
        for copy in stiff.composite.copies() {
            self.preconditioner.set(copy as usize, &self.diagonal[copy as usize], [false; 3]);
        }
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

    /// Spring terms of the operator and of the preconditioner.
    fn complete_operator(&mut self, elastic: &mut Elastic, inputs: &StepInputs<'_>) {
        self.terms.clear();
        self.terms.extend(self.active.iter().filter_map(|s| s.term(inputs.h * inputs.h)));
        let axes_of = |copy: u32| {
            let found = inputs.fixed.binary_search_by_key(&copy, |f| f.copy);
            found.map_or([false; 3], |f| inputs.fixed[f].axes)
        };
        for &copy in &self.sprung {
            self.preconditioner.set(copy as usize, &self.diagonal[copy as usize], axes_of(copy));
        }
        self.sprung.clear();
        match &mut self.stiff {
            None => self.sprung.extend(self.terms.iter().flat_map(|term| term.copies)),
            // Springs hold on to the copies that theirs are moved relative to, too.
            Some(stiff) => {
                for term in &self.terms {
                    term.expand(self.preconditioner.substitution(), &mut stiff.row);
                    self.sprung.extend(stiff.row.iter().map(|r| r.0));
                }
            }
        }
        self.bare.clear();
        self.bare.extend(self.sprung.iter().map(|&copy| self.diagonal[copy as usize]));
        if let Some(stiff) = &mut self.stiff {
            for term in &self.terms {
                term.expand(self.preconditioner.substitution(), &mut stiff.row);
                stiff
                    .row
                    .iter()
                    .for_each(|&(copy, w)| term.add_to_block(w as f32, &mut self.diagonal[copy as usize]));
            }
        } else {
            system(elastic, &self.terms, inputs).add_springs(&mut self.diagonal);
        }
        for &copy in &self.sprung {
            self.preconditioner.set(copy as usize, &self.diagonal[copy as usize], axes_of(copy));
        }
        for (&copy, bare) in self.sprung.iter().zip(&self.bare) {
            self.diagonal[copy as usize] = *bare;
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

    /// r = b − A δ into the solver's residual; on the first pass also the norm of the loads.
    fn residual(
        &mut self,
        team: &mut Team,
        elastic: &mut Elastic,
        state: &State,
        inputs: &StepInputs<'_>,
        pass: usize,
    ) {
        let (h2, factor) = (inputs.h * inputs.h, mass_factor(inputs));
        let damped = self.damps(inputs);
        if pass > 0 {
            system(elastic, &[], inputs).apply(team, &self.delta, &mut self.scratch);
        }
        let (f_int, damping, solved) = (&self.f_int, &self.damping, &self.scratch);
        let (M, shift) = (&self.preconditioner, &self.translations.shift);
        let results = (blocks(&mut self.pcg.r, BLOCK), blocks(&mut self.partial, 1));
        team.for_blocks(results, |block, (r, partial)| {
            let mut load = Sum::default();
            for (i, (r, M)) in r.iter_mut().zip(M.block(block)).enumerate() {
                let c = block * BLOCK + i;
                let mut f = external(c, state, inputs) - unpadded(&f_int[c]);
                if damped {
                    f -= unpadded(&damping[c]);
                }
                let moved = shift[inputs.parts.of_copy[c] as usize];
                *r = padded(&(h2 * f - factor * inputs.mass[c] * moved));
                if pass > 0 {
                    for k in 0..4 {
                        r[k] -= solved[c][k];
                    }
                } else {
                    let weight = padded(&(h2 * (inputs.mass[c] * inputs.gravity + inputs.load[c])));
                    load.add(&weight, &M.times(&weight)); // M⁻¹ is 0 where a copy is fixed
                }
            }
            partial[0] = load.total();
        });
        if pass == 0 {
            let loads = if self.preconditioner.substitution().is_empty() {
                self.partial.iter().sum::<f64>().max(0.0).sqrt()
            } else {
                for (c, load) in self.scratch.iter_mut().enumerate() {
                    *load = padded(&(h2 * (inputs.mass[c] * inputs.gravity + inputs.load[c])));
                }
                filter(inputs.fixed, &mut self.scratch);
                self.pcg.norm(team, &self.preconditioner, &self.scratch)
            };
            self.reference = LOAD_FLOOR * loads;
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

    /// Improves δ. The residual counts against that of the first pass, or the loads, if larger.
    fn solve(
        &mut self,
        team: &mut Team,
        elastic: &mut Elastic,
        inputs: &StepInputs<'_>,
        pass: usize,
    ) -> PcgReport {
        let Self { pcg, preconditioner, terms, delta, reference, .. } = self;
        let rz = pcg.precondition(team, preconditioner);
        if pass == 0 {
            *reference = reference.max(rz.max(0.0).sqrt());
        }
        let mut A = system(elastic, terms, inputs);
        pcg.run(team, &mut A, preconditioner, delta, (rz, *reference, inputs.solver))
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
        team: &mut Team,
        state: &mut State,
        inputs: &StepInputs<'_>,
        spring_forces: &mut Vec<Vector3<f64>>,
    ) -> bool {
        let bound = 1e15; // m: far outside any scene, far inside the range of single precision
        let (delta, shift, of_part) = (&self.delta, &self.translations.shift, &inputs.parts.of_copy);
        let results = (blocks(&mut self.predicted, BLOCK), blocks(&mut self.partial, 1));
        team.for_blocks(results, |block, (next, partial)| {
            let known = block_of(delta, block).iter().zip(block_of(of_part, block));
            let mut finite = true;
            for (next, (delta, &part)) in next.iter_mut().zip(known) {
                *next = *next + shift[part as usize] + unpadded(delta);
                finite &= next.iter().all(|c| c.abs() < bound);
            }
            partial[0] = f64::from(u8::from(finite));
        });
        if self.partial.contains(&0.0) {
            return false;
        }
        spring_forces.clear();
        let mut active = self.active.iter();
        for &accepted in &self.accepted {
            let spring = if accepted { active.next() } else { None };
            let force = spring.map(|s| s.force(s.point(&self.predicted)));
            spring_forces.push(force.unwrap_or_else(Vector3::zeros));
        }
        // The shortest steps have no finite inverse; nothing moves in them.
        let (predicted, rate) = (&self.predicted, (1.0 / inputs.h).min(f64::MAX));
        let results = (blocks(&mut state.x, BLOCK), blocks(&mut state.v, BLOCK));
        team.for_blocks(results, |block, (x, v)| {
            for ((x, v), next) in x.iter_mut().zip(v).zip(block_of(predicted, block)) {
                *v = (next - *x) * rate;
                *x = *next;
            }
        });
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

/// K̂ and its factor h² + hβ.
fn elastic_update(inputs: &StepInputs<'_>) -> ElasticUpdate {
    let (h, material) = (inputs.h, inputs.material);
    ElasticUpdate {
        lame: material.lame(),
        law: material.law,
        scale: h * h + h * material.rayleigh.stiffness_s,
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
