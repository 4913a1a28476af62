//! The operator of a solve and its preconditioner, brought up to date at the predictor.

use nalgebra::Vector3;
use scindo_algebra::operator::{
    BLOCK, CompositeDiagonal, Stiffness, Tension, apply_damping, block_of, invert, invert_free, padded,
};
use scindo_matter::element::{FixedCopy, Held};
use scindo_matter::material::Law;
use scindo_matter::team::phase::Phase;
use scindo_matter::team::{Team, blocks};

use super::{LinearStep, system};
use crate::integrator::state::State;
use crate::integrator::step_inputs::{Inertia, LinearInputs};

impl LinearStep {
    /// Updates rotations, forces, gradients and damping at the predictor, and twists at `state` or, in further solves,
    /// at the predictor too. Returns the number of inverted pieces.
    pub(super) fn update_operator(
        &mut self,
        team: &mut Team,
        elastic: &mut dyn Stiffness,
        state: &State,
        first: bool,
        inputs: &LinearInputs<'_>,
    ) -> usize {
        team.begin(Phase::Operator);
        let (h, beta) = (inputs.step.h, inputs.material.rayleigh.stiffness_s);
        let with = inputs.elastic_update();
        let scale = with.scale;
        let at = if self.ablation.predictor { &state.x } else { &self.predicted };
        let tension = Tension {
            at: if first { &state.x } else { &self.predicted },
            start: &state.x,
            s: inputs.s(),
            density_kg_m3: if inputs.moves() { inputs.material.density_kg_m3 } else { 0.0 },
            damping: if self.damps_by_strain(inputs) { beta / h } else { 0.0 },
            // A single solve has to find a minimum.
            definite: self.equations.definite || inputs.solves == 1,
        };
        let with_tension = !self.ablation.twists || !inputs.material.law.is_hookean();
        let inverted = elastic.update(team, &with, at, with_tension.then_some(&tension));
        self.sum_chunks(team, elastic, inputs);
        // Without inertia, single-precision forces would be too coarse for the residual.
        if !inputs.moves() {
            self.exact.resize(self.predicted.len(), Vector3::zeros());
            let points = inputs.step.points;
            self.stored = points.elastic_forces(inputs.material, &self.predicted, &mut self.exact);
        }
        if self.damps(inputs) {
            // Prescribed copies count with the velocity that they have in the step.
            let scratch = self.scratch.iter_mut().zip(&self.predicted);
            match inputs.inertia {
                Inertia::Remembered(history) => scratch.zip(history.x_v).for_each(|((v, to), x)| {
                    *v = padded(&(history.increment.B * (to - x)));
                }),
                _ => scratch.zip(&state.x).for_each(|((v, to), x)| *v = padded(&((to - x) / h))),
            }
            apply_damping(elastic, team, &self.scratch, &mut self.damping); // s K̂ v
            // Linearised at x_n, the predictor is h v away: f_int(x̂) ≈ f_int(x_n) + h K̂ v.
            let beta = if self.ablation.predictor { beta + h } else { beta };
            let factor = (beta / scale) as f32;
            self.damping.iter_mut().flatten().for_each(|v| *v *= factor); // β K̂ v
        }
        inverted
    }

    /// Whether the forces of the update contain those of damping: in implicit Euler of a law that rotates.
    pub(super) fn damps_by_strain(&self, inputs: &LinearInputs<'_>) -> bool {
        matches!(inputs.inertia, Inertia::Euler)
            && inputs.material.law != Law::Linear
            && !self.ablation.predictor
            && !self.ablation.twists
    }

    /// Whether the step has a damping term K̂ v.
    pub(super) fn damps(&self, inputs: &LinearInputs<'_>) -> bool {
        let by_product = inputs.material.rayleigh.stiffness_s > 0.0 && !self.damps_by_strain(inputs);
        inputs.moves() && (self.ablation.predictor || by_product)
    }

    /// Sums internal forces and, if it changed, the diagonal of A and its inverse, without springs.
    pub(super) fn sum_chunks(&mut self, team: &mut Team, elastic: &dyn Stiffness, inputs: &LinearInputs<'_>) {
        let factor = inputs.mass_factor();
        let made_for = Some((elastic.version(), factor));
        let held = |f: &FixedCopy| (f.copy, f.held);
        let f_int = blocks(&mut self.f_int, BLOCK);
        if self.made_for == made_for
            && inputs.step.fixed.iter().map(held).eq(self.made_for_fixed.iter().copied())
        {
            team.for_blocks(f_int, |block, f| elastic.forces(block, f));
            return;
        }
        self.made_for = made_for;
        if !inputs.step.fixed.iter().map(held).eq(self.made_for_fixed.iter().copied()) {
            self.made_for_fixed.clear();
            self.made_for_fixed.extend(inputs.step.fixed.iter().map(held));
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
        for copy in inputs.step.fixed {
            let c = copy.copy as usize;
            self.preconditioner.set(c, &self.diagonal[c], copy.held);
        }
    }

    /// Replaces blocks of the preconditioner by those in variables in which degenerate elements are not
    /// stiff.
    pub(super) fn substitute(&mut self, team: &mut Team, elastic: &dyn Stiffness, inputs: &LinearInputs<'_>) {
        let Some(stiff) = &mut self.stiff else { return };
        if stiff.stale {
            let held = |copy: u32| inputs.step.fixed.binary_search_by_key(&copy, |f| f.copy).is_ok();
            let (T, left) = stiff.modes.substitution(held);
            stiff.composite = CompositeDiagonal::new(&stiff.modes, &T, elastic);
            (stiff.left, stiff.stale) = (left, false);
            self.preconditioner.set_substitution(T);
            self.coarse = None;
        }
        let with = inputs.elastic_update();
        let mass = (inputs.mass_f32, inputs.mass_factor());
        stiff.composite.update(team, (elastic, &with), mass, &mut self.diagonal);
        for copy in stiff.composite.copies() {
            self.preconditioner.set(copy as usize, &self.diagonal[copy as usize], Held::NOT);
        }
    }

    /// Brings the levels of multigrid up to date with the operator.
    pub(super) fn complete_grid(
        &mut self,
        team: &mut Team,
        elastic: &mut dyn Stiffness,
        inputs: &LinearInputs<'_>,
        pass: usize,
    ) {
        if let Some(grid) = &mut self.grid {
            if pass == 0 {
                grid.follow(team, elastic, inputs);
            }
            let (diagonal, inverse) = (&self.diagonal, self.preconditioner.inverses());
            if grid.sort(&self.terms, diagonal) {
                let bare = |copy: u32| invert_free(&diagonal[copy as usize], inputs.held_of(copy));
                let mut A = system(elastic, &[], inputs);
                grid.complete_stiff(team, &mut A, (inverse, &bare), &self.terms);
            } else {
                let mut A = system(elastic, &self.terms, inputs);
                grid.complete(team, &mut A, inverse, &self.terms);
            }
        }
        if let Some(level) = &mut self.simulated {
            if pass == 0 {
                level.follow(team, elastic, inputs);
            }
            level.set_springs(team, &self.terms);
        }
    }
}
