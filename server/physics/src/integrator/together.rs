//! One implicit step of several bodies that touch, solved as one system.
//!
//! Springs between the bodies are terms s k J Jᵀ of one matrix, whose other blocks are those of the bodies. Conjugate
//! gradients run over the vectors of all bodies at once, preconditioned node by node; what the springs add to the
//! diagonal is part of it, and nodes that they tie together are [`partners`]. Both sides are implicit, so that stiff
//! contact needs no small step. The translations of free parts are balanced exactly before and after, so that momentum
//! is exchanged to rounding, however few iterations are made.

mod partners;
mod translations;

use nalgebra::{Matrix3, Vector3};
use scindo_algebra::operator::Stiffness;
use scindo_algebra::solver::{LinearReport, PcgSettings, StopReason};
use scindo_matter::team::Team;

use super::linear_step::LinearStep;
use super::linear_step::together::Own;
use super::pair_springs::{ActivePair, PairSpring, PairTerms};
use super::state::State;
use super::step_inputs::LinearInputs;
use partners::Partners;
use translations::SharedTranslations;

/// Largest number of passes, repeated while springs open, close or slip.
const PASSES: usize = 8;
/// Part of the residual that a pass may leave until the springs have found their modes.
///
/// A solve to the tolerance with springs in wrong modes is lost. Modes are right long before it: on a closed wound
/// with 2,000 triangles on its lips this saves a quarter of the iterations. 0.01 costs 4 % more, 0.3 hardly saves more.
const LOOSE: f64 = 0.1;

/// The place of a node that no spring acts on.
const NOWHERE: u32 = u32::MAX;

/// One body of a group.
pub struct Member<'a> {
    /// The step of this body.
    pub step: &'a mut LinearStep,
    /// Its threads.
    pub team: &'a mut Team,
    /// Its stiffness.
    pub elastic: &'a mut dyn Stiffness,
    /// Its positions and velocities.
    pub state: &'a mut State,
    /// What acts on it.
    pub inputs: LinearInputs<'a>,
    /// Receives the force of its own springs [N].
    pub spring_forces: &'a mut [Vector3<f64>],
    /// Pieces inverted at the predictor.
    pub inverted_pieces: usize,
}

/// Memory of steps that are solved together, reused from step to step.
#[derive(Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct Together {
    pairs: Vec<ActivePair>,
    terms: PairTerms,
    /// Which of the springs given these are.
    accepted: Vec<bool>,
    /// Nodes of one body with the diagonal parts of the springs on them, and where each node stands in there.
    shared: Vec<(u32, Matrix3<f64>)>,
    place_of: Vec<u32>,
    partners: Partners,
    translations: SharedTranslations,
    /// Whether the residuals are those of the present δ and modes.
    is_current: bool,
}

/// How a step of a group went.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GroupReport {
    /// The last linear solve; iterations are those of all passes.
    pub solve: LinearReport,
    /// Springs between bodies that were left out because one of their numbers is unusable.
    pub refused: usize,
    /// Whether everything stayed finite; no state has changed otherwise.
    pub finite: bool,
}

/// Where the conjugate gradients of a pass stand.
struct Search {
    /// rᵀM⁻¹r.
    rz: f64,
    beta: f64,
    /// What residuals are measured against.
    reference: f64,
}

/// How a pass went.
struct PassReport {
    report: LinearReport,
    /// Whether springs have changed their modes, so that it ended early.
    modes_changed: bool,
}

type Members<'a, 'b> = &'a mut [Member<'b>];

impl Together {
    /// Advances all `members` by one step with implicit Euler. The force of every spring of `pairs` on its point
    /// goes to `pair_forces` [N].
    pub fn step(
        &mut self,
        members: Members<'_, '_>,
        pairs: &[PairSpring],
        pair_forces: &mut Vec<Vector3<f64>>,
        settings: PcgSettings,
    ) -> GroupReport {
        for member in members.iter_mut() {
            let (step, mut own) = member.split();
            let inverted = step.begin_together(&mut own);
            member.inverted_pieces = inverted;
        }
        self.begin(members, pairs);
        self.partners.choose(members, &self.pairs);
        let mut report = GroupReport { refused: pairs.len() - self.pairs.len(), ..GroupReport::default() };
        let mut reference = 0.0;
        self.is_current = false;
        for pass in 0..PASSES {
            self.complete(members);
            if self.translations.balance(members, &self.pairs) {
                place(&mut self.pairs, members);
                self.is_current = false;
            }
            let loads = if self.is_current { 0.0 } else { self.residual(members, pass) };
            let rz = self.precondition(members);
            if pass == 0 {
                reference = loads.max(rz.max(0.0).sqrt());
            }
            let mut search = Search { rz, beta: 0.0, reference };
            let solve = self.solve_pass(members, &mut search, settings, pass + 1 == PASSES);
            let iterations = report.solve.iterations + solve.report.iterations;
            report.solve = LinearReport { iterations, ..solve.report };
            if solve.modes_changed {
                continue;
            }
            if self.translations.balance(members, &self.pairs) {
                place(&mut self.pairs, members);
            }
            if solve.report.stop == StopReason::NonFinite
                || pass + 1 == PASSES
                || !self.changed(members, settings.tolerance * reference)
            {
                break;
            }
        }
        self.partners.end();
        self.write(pair_forces);
        report.finite = report.solve.stop != StopReason::NonFinite;
        // No body moves unless all can.
        report.finite &= members.iter().all(|member| member.step.is_finite_together(&member.inputs));
        for Member { step, team, state, inputs, spring_forces, .. } in members {
            report.finite &= step.end_together((team, state), inputs, spring_forces, report.finite);
        }
        report
    }

    /// Takes the usable springs, in the mode of the predicted positions.
    fn begin(&mut self, members: Members<'_, '_>, pairs: &[PairSpring]) {
        self.pairs.clear();
        self.accepted.clear();
        for spring in pairs {
            let in_group = spring.bodies.iter().all(|&b| (b as usize) < members.len());
            let nodes = |body: u32| members[body as usize].state.x.len();
            let mut active = if in_group { ActivePair::usable(spring, nodes) } else { None };
            if let Some(pair) = &mut active {
                pair.y = relative(pair, members);
                pair.law.begin(pair.y);
            }
            self.accepted.push(active.is_some());
            self.pairs.extend(active);
        }
    }

    /// Completes the operators of all members, with the diagonal parts of the springs between them.
    fn complete(&mut self, members: Members<'_, '_>) {
        self.terms.arrange(&self.pairs, |body| members[body as usize].inputs.s());
        for (number, member) in (0u32..).zip(members.iter_mut()) {
            self.sum_diagonals(number, member);
            let (step, mut own) = member.split();
            step.complete_together(&mut own, &self.shared);
        }
        self.partners.arrange(members, &self.pairs, |body| members[body as usize].inputs.s());
    }

    /// Writes the diagonal parts of the springs on the nodes of body `number` to `shared`, ascending by node.
    fn sum_diagonals(&mut self, number: u32, member: &Member<'_>) {
        let Self { pairs, shared, place_of, .. } = self;
        let s = member.inputs.s();
        shared.clear();
        place_of.resize(place_of.len().max(member.state.x.len()), NOWHERE);
        for pair in pairs.iter() {
            let stiffness = s * pair.law.stiffness();
            if stiffness == Matrix3::zeros() {
                continue;
            }
            for carrier in pair.carriers.iter().filter(|carrier| carrier.body == number) {
                let place = &mut place_of[carrier.copy as usize];
                if *place == NOWHERE {
                    *place = shared.len() as u32;
                    shared.push((carrier.copy, Matrix3::zeros()));
                }
                shared[*place as usize].1 += carrier.weight * carrier.weight * stiffness;
            }
        }
        shared.iter().for_each(|(copy, _)| place_of[*copy as usize] = NOWHERE);
        shared.sort_unstable_by_key(|(copy, _)| *copy);
    }

    /// Writes the residuals of all members. Returns the norm of their loads on the first pass.
    fn residual(&mut self, members: Members<'_, '_>, pass: usize) -> f64 {
        let mut loads = 0.0;
        for member in members.iter_mut() {
            let (step, mut own) = member.split();
            loads += step.residual_together(&mut own, pass).powi(2);
        }
        for pair in &self.pairs {
            add_to_residual(members, pair, &pair.law.force(pair.y));
        }
        loads.sqrt()
    }

    /// Preconditions the residuals of all members; returns rᵀM⁻¹r.
    fn precondition(&mut self, members: Members<'_, '_>) -> f64 {
        let mut rz = 0.0;
        for member in members.iter_mut() {
            let (step, mut own) = member.split();
            rz += step.precondition_together(&mut own);
        }
        rz + self.partners.precondition(members)
    }

    /// Solves loosely, and to the tolerance if the springs then stay in their modes. The last pass does not look.
    ///
    /// # Source
    /// Dembo, Eisenstat, Steihaug 1982: inexact Newton methods; here for the active set of the springs.
    fn solve_pass(
        &mut self,
        members: Members<'_, '_>,
        search: &mut Search,
        settings: PcgSettings,
        last: bool,
    ) -> PassReport {
        let left =
            if search.reference > 0.0 { LOOSE * search.rz.max(0.0).sqrt() / search.reference } else { 0.0 };
        let tolerance = if last { settings.tolerance } else { settings.tolerance.max(left) };
        let first = self.solve(members, search, PcgSettings { tolerance, ..settings });
        place(&mut self.pairs, members);
        if first.stop != StopReason::Converged || first.residual <= settings.tolerance {
            return PassReport { report: first, modes_changed: false };
        }
        if self.changed(members, settings.tolerance * search.reference) {
            return PassReport { report: first, modes_changed: true };
        }
        let iterations = settings.iterations - first.iterations;
        let report = self.solve(members, search, PcgSettings { iterations, ..settings });
        place(&mut self.pairs, members);
        let iterations = first.iterations + report.iterations;
        PassReport { report: LinearReport { iterations, ..report }, modes_changed: false }
    }

    /// Conjugate gradients over all members, from where the `search` is.
    ///
    /// # Source
    /// Hestenes, Stiefel 1952.
    fn solve(
        &mut self,
        members: Members<'_, '_>,
        search: &mut Search,
        settings: PcgSettings,
    ) -> LinearReport {
        let Search { rz, beta, reference } = search;
        let reference = *reference;
        let target = settings.tolerance * reference;
        let mut report = LinearReport::default();
        loop {
            let norm = rz.max(0.0).sqrt();
            report.residual = if reference > 0.0 { norm / reference } else { norm };
            report.stop = if !rz.is_finite() {
                StopReason::NonFinite
            } else if norm <= target {
                StopReason::Converged
            } else {
                StopReason::IterationLimit
            };
            if report.stop != StopReason::IterationLimit || report.iterations == settings.iterations {
                return report;
            }
            if members.iter().any(|member| member.team.told_to_stop()) {
                report.stop = StopReason::Interrupted;
                return report;
            }
            let mut curvature = 0.0;
            for member in members.iter_mut() {
                let (step, mut own) = member.split();
                curvature += step.turn_together(&mut own, *beta);
            }
            curvature += self.multiply(members);
            if !curvature.is_finite() {
                report.stop = StopReason::NonFinite;
                return report;
            }
            if curvature <= 0.0 {
                report.stop = StopReason::NonPositiveCurvature;
                return report;
            }
            let alpha = *rz / curvature;
            let mut next = 0.0;
            for member in members.iter_mut() {
                let (step, mut own) = member.split();
                next += step.descend_together(&mut own, alpha);
            }
            next += self.partners.precondition(members);
            (*beta, *rz) = (next / *rz, next);
            report.iterations += 1;
        }
    }

    /// Adds s k J Jᵀ p of the springs between members to q; returns their part of pᵀA p.
    fn multiply(&self, members: Members<'_, '_>) -> f64 {
        let mut curvature = 0.0;
        for term in self.terms.iter() {
            let mut y = [0.0; 4];
            for (body, side) in term.sides() {
                let (p, _) = members[body as usize].step.direction_together();
                for &(copy, weight) in side {
                    let p = &p[copy as usize];
                    (0..4).for_each(|k| y[k] += weight * p[k]);
                }
            }
            let f = term.force(&y);
            curvature += (0..3).map(|k| f64::from(f[k]) * f64::from(y[k])).sum::<f64>();
            for (body, side) in term.sides() {
                let (_, q) = members[body as usize].step.direction_together();
                for &(copy, weight) in side {
                    let q = &mut q[copy as usize];
                    (0..4).for_each(|k| q[k] += weight * f[k]);
                }
            }
        }
        curvature
    }

    /// Lets springs change their modes where that matters; returns whether it does. Changes that together move the
    /// residual by less than `negligible`, to which it is solved, do not.
    ///
    /// Within a mode forces are linear in δ, so that after a solve the residual is still exact up to rounding, and only
    /// what the new modes change is added to it. Where the members' own springs changed, or the variables are not
    /// those of the nodes, it is to be written anew.
    fn changed(&mut self, members: Members<'_, '_>, negligible: f64) -> bool {
        let mut changed = false;
        for member in members.iter_mut() {
            changed |= member.step.own_springs_changed(&member.inputs);
        }
        let scale = self.pairs.iter().map(|pair| pair.law.force(pair.y).norm()).fold(0.0, f64::max);
        let moved = self.pairs.iter().map(|pair| moved_residual(pair, members, scale)).sum::<f64>();
        if !changed && moved <= negligible * negligible {
            return false;
        }
        self.is_current = !changed && members.iter().all(|member| member.step.has_single_blocks());
        for pair in &mut self.pairs {
            let before = pair.law.force(pair.y);
            if pair.law.choose_mode(pair.y) && self.is_current {
                add_to_residual(members, pair, &(pair.law.force(pair.y) - before));
            }
        }
        true
    }

    /// Writes the force of every spring on its point, in the order given; 0 for those that were left out.
    fn write(&self, pair_forces: &mut Vec<Vector3<f64>>) {
        pair_forces.clear();
        let mut active = self.pairs.iter();
        pair_forces.extend(self.accepted.iter().map(|&accepted| {
            let pair = if accepted { active.next() } else { None };
            pair.map_or_else(Vector3::zeros, |pair| pair.law.force(pair.y))
        }));
    }
}

impl<'b> Member<'b> {
    /// The step, and what acts on it.
    fn split(&mut self) -> (&mut LinearStep, Own<'_, 'b>) {
        let Self { step, team, elastic, state, inputs, .. } = self;
        (step, Own { team, elastic: &mut **elastic, state, inputs })
    }
}

/// Adds a force on the point of a pair [N] to the residuals.
fn add_to_residual(members: Members<'_, '_>, pair: &ActivePair, force: &Vector3<f64>) {
    for carrier in &pair.carriers {
        let member = &mut members[carrier.body as usize];
        let s = member.inputs.s();
        member.step.add_to_residual(carrier.copy, &(s * carrier.weight * force));
    }
}

/// rᵀM⁻¹r of the residual that a notable change of mode of `pair` would leave, as if no other changed.
fn moved_residual(pair: &ActivePair, members: &[Member<'_>], scale: f64) -> f64 {
    let change = pair.law.notable_change(pair.y, scale);
    if change == 0.0 {
        return 0.0;
    }
    let eases = pair.carriers.iter().map(|c| {
        let member = &members[c.body as usize];
        (member.inputs.s() * c.weight * change).powi(2) * member.step.ease_of(c.copy)
    });
    eases.sum()
}

/// Writes y of all pairs with the present δ.
fn place(pairs: &mut [ActivePair], members: &[Member<'_>]) {
    pairs.iter_mut().for_each(|pair| pair.y = relative(pair, members));
}

/// y of a pair with the present δ [m].
fn relative(pair: &ActivePair, members: &[Member<'_>]) -> Vector3<f64> {
    let place = |body: u32, copy: u32| {
        let member = &members[body as usize];
        member.step.position_together(copy, &member.inputs)
    };
    pair.carriers.iter().map(|c| c.weight * place(c.body, c.copy)).sum()
}
